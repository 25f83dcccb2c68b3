"""What text in a file or on a pipe is encoded in.

UTF-16, with its mark or without, is what PowerShell's `>` and Windows editors write. Everything else is read as UTF-8
line by line, and a line that is not UTF-8 as Windows-1251: bytes are plain ASCII in all of them, so that this decides
only how words around them are read.
"""

from __future__ import annotations

import codecs
from typing import Final

_LOOK: Final = 4096  # bytes
_HIGH: Final = b"\x00\x04"  # upper bytes of Latin and Cyrillic letters, digits and signs
_SHARE: Final = 0.9  # of characters with such an upper byte


def is_binary(head: bytes) -> bool:
    """Whether a file or a paste that begins like this is no text: many control characters, and no UTF-16."""
    if utf16(head) is not None:
        return False
    head = head.rstrip(b"\0") or head  # a log whose disk space was taken before its text
    control = sum(head.count(code) for code in range(32) if code not in (7, 8, 9, 10, 12, 13, 27))
    return control * 100 > len(head)


def utf16(head: bytes) -> str | None:
    """The codec of UTF-16 text that begins like this; None for other text."""
    if head.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        return "utf-16"
    size = min(len(head), _LOOK) // 2
    first, second = head[: 2 * size : 2], head[1 : 2 * size : 2]
    for codec, low, high in (("utf-16-le", first, second), ("utf-16-be", second, first)):
        if size and 0 not in low and sum(map(high.count, _HIGH)) > _SHARE * size:
            return codec
    return None


def decoded(data: bytes) -> str:
    """All of a text, without its byte order mark."""
    codec = utf16(data)
    if codec is not None:
        return data.decode(codec, "replace").removeprefix("\ufeff")
    return "\n".join(line_of(line) for line in data.split(b"\n")).removeprefix("\ufeff")


def lines_of(text: str) -> list[str]:
    """Lines, whether they end in CR LF, LF or CR."""
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def line_of(line: bytes) -> str:
    """One line that is not UTF-16."""
    try:
        return line.decode()
    except UnicodeDecodeError:
        return line.decode("cp1251", "replace")
