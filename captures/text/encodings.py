"""What text in a file or on a pipe is encoded in.

UTF-16, with its mark or without, is what PowerShell's `>` and Windows editors write. Everything else is read as UTF-8
line by line, and a line that is not UTF-8 in the code page of a system in which most of the text's words are known, or
look like words: bytes are plain ASCII in all of them, so that this decides only how words around them are read.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Iterator
from typing import Final

from .tools import is_mark

_LOOK: Final = 4096  # bytes
_HIGH: Final = b"\x00\x04"  # upper bytes of Latin and Cyrillic letters, digits and signs
_SHARE: Final = 0.9  # of characters with such an upper byte
_CODE_PAGES: Final = ("cp1251", "cp866", "koi8-r", "gb18030", "cp1252", "big5", "cp932", "euc-kr")
_WORD: Final = re.compile(r"[^\W\d_]+")
_LIKELY: Final = re.compile(  # Russian words, several signs of the East
    r"(?<!\w)(?:[\u0400-\u042f]?[\u0430-\u045f]{2,}|[\u0400-\u042f]{2,})(?!\w)|"
    r"[\u3040-\u30ff\u4e00-\u9fff\uac00-\ud7a3]{2,}"
)
_LATIN: Final = re.compile(r"(?<!\w)[A-Z\u00c0-\u00de]?[a-z\u00df-\u00ff]+(?!\w)")


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


def code_page(lines: Iterable[bytes]) -> str:
    """The code page of those of these lines that are not UTF-8, by their words; empty where all are."""
    text = b"\n".join(_not_utf8(lines))
    if not text:
        return ""
    return max(_CODE_PAGES, key=lambda page: _words_known(text.decode(page, "replace")))


def _not_utf8(lines: Iterable[bytes]) -> Iterator[bytes]:
    size = 0
    for line in lines:
        try:
            line.decode()
        except UnicodeDecodeError as fault:
            yield line[max(fault.start - _LOOK, 0) : fault.start + _LOOK]
            size += len(line)
            if size > _LOOK:
                return


def _words_known(text: str) -> tuple[int, float]:
    """How many words are direction marks, less what is no character at all; the share of those in likely words."""
    known = sum(is_mark(word.lower()) for word in _WORD.findall(text) if not word.isascii())
    likely = sum(len(word) for word in _LIKELY.findall(text))
    for word in _LATIN.findall(text):
        accents = sum(not char.isascii() for char in word)
        likely += accents if 2 * accents < len(word) else 0
    return known - text.count("\ufffd"), likely / sum(not char.isascii() for char in text)


def decoded(data: bytes) -> str:
    """All of a text, without its byte order mark."""
    codec = utf16(data)
    if codec is not None:
        return data.decode(codec, "replace").removeprefix("\ufeff")
    lines = data.split(b"\n")
    page = code_page(lines)
    return "\n".join(line_of(line, page) for line in lines).removeprefix("\ufeff")


def lines_of(text: str) -> list[str]:
    """Lines, whether they end in CR LF, LF or CR."""
    return text.replace("\r\n", "\n").replace("\r", "\n").split("\n")


def line_of(line: bytes, page: str) -> str:
    """One line that is not UTF-16; `page` is the code page of lines that are not UTF-8."""
    try:
        return line.decode()
    except UnicodeDecodeError:
        return line.decode(page, "replace")
