"""The characters of a file, as spreadsheets and editors save them."""

from __future__ import annotations

import re
from typing import Final

_MARKS: Final = (b"\xff\xfe", b"\xfe\xff")
_LOOK: Final = 4096  # bytes
_WORD: Final = re.compile(rb"[A-Za-z\xc0-\xff]*[\xc0-\xff][A-Za-z\xc0-\xff]*")


def decoded(data: bytes) -> str | None:
    """The text: UTF-8, UTF-16 with its mark or without, else the Windows page that its words are of; None for bytes
    that are no text."""
    if data[:2] in _MARKS:
        return data.decode("utf-16", "replace").lstrip("\ufeff")
    if b"\0" in data[:_LOOK]:
        wide = _wide(data[:_LOOK])
        return data.decode(wide, "replace") if wide else None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode(_page(data), "replace")


def _wide(data: bytes) -> str | None:
    """UTF-16 without its mark: delimiters and line ends are ASCII in any language, so that one half has zeros alone."""
    even, odd = data[0::2].count(0), data[1::2].count(0)
    lead, other = max(even, odd), min(even, odd)
    if other or lead < len(data) // 16 or data.count(b"\0\0\0"):
        return None
    return "utf-16-le" if odd else "utf-16-be"


def _page(data: bytes) -> str:
    """Windows-1251 where the words have Cyrillic letters throughout, Windows-1252 where letters of it stand alone."""
    words = _WORD.findall(data)
    cyrillic = sum(len(re.findall(rb"[\xc0-\xff]", word)) > len(word) // 2 for word in words)
    return "cp1251" if 2 * cyrillic >= len(words) else "cp1252"
