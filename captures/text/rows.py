"""Rows of dumps: the numbers above their columns, the characters behind their bytes, 16-bit words."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Final

ROWS: Final = (
    "pairs",
    "words",
    "swapped words",
    "swapped words, octal or decimal",
    "binary",
    "decimal",
    "od -c",
)  # shapes of the rows of dumps
_ROW: Final = 8  # bytes, after which dumps leave a gap
_PAIR: Final = re.compile(r"[0-9A-Fa-f]{1,2}")
_RULER: Final = 6  # numbers, each one more than that before it
DIGITS_ABOVE: Final = ("0123456789ABCDEF", "0123456789")  # columns of characters in a dump


def is_ruler(tokens: Sequence[str]) -> bool:
    """Whether these are the numbers that dumps and tables write above their columns."""
    if len(tokens) < _RULER or not all(_PAIR.fullmatch(token) for token in tokens):
        return False
    for base in (16, 10) if all(token.isdigit() for token in tokens) else (16,):
        first = int(tokens[0], base)
        if [int(token, base) for token in tokens] == [*range(first, first + len(tokens))]:
            return True
    return False


def before_characters(text: str, start: int, end: int) -> int:
    """Where the bytes of a viewer's row end, whose characters follow after a gap and may look like bytes, too."""
    for gap in re.finditer(r"[ \t]{2,}", text[start:end]):
        if shows(bytes.fromhex(text[start : start + gap.start()]), text[start + gap.end() :]):
            return start + gap.start()
    return end


def shows(data: bytes, text: str) -> bool:
    """Whether a text is these bytes as characters, with dots or the like for those that have none."""
    text = text.strip("\r\n|<> \t") if len(text.rstrip()) > len(data) else text.rstrip("\r\n")
    if len(text) == len(data) + 1 and len(data) > _ROW and text[_ROW] == " ":
        text = text[:_ROW] + text[_ROW + 1 :]
    text = text.ljust(len(data))
    if len(text) != len(data):
        return False
    for byte, char in zip(data, text, strict=True):
        if char != chr(byte) and (char != "." if 0x20 < byte < 0x7F else char.isascii() and char.isalnum()):
            return False
    return True


def swapped(data: bytes) -> bytes:
    """16-bit words with their bytes the other way round."""
    out = bytearray(data)
    out[::2], out[1::2] = data[1::2], data[::2]
    return bytes(out)
