"""What a run of bytes in a line may be, and the line in which it is looked for.

How much a writing speaks for itself is its `Writing`: signs of its own (`0x11`, `[11][03]`) or many pairs of digits are
what a person takes for bytes; a number, a word or an address is bytes only where a check value says so.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from enum import IntEnum
from typing import Final, NamedTuple


class Writing(IntEnum):
    """How much the writing alone speaks for bytes."""

    NUMBER = 0  # only a check value makes bytes of it
    LIKELY = 1  # bytes behind a direction mark, or where a text has nothing better
    BYTES = 2


class HexWindow(NamedTuple):
    """Characters `start` to `end` of a line read as bytes.

    `ascii`: an ASCII-mode frame, kept as its characters from `:` to CR LF. `offset` is the dump offset that stands
    before them, from `lead` on (`start` where there is none).
    """

    data: bytes
    start: int
    end: int
    shape: str
    level: Writing
    ascii: bool = False
    offset: str | None = None
    lead: int = 0


class TextLine(NamedTuple):
    """A line to search: its text, and where what is more than brackets and blanks begins and ends in it.

    `first` are several places where it has direction marks: it begins anew behind each.
    """

    text: str
    first: frozenset[int]
    last: int
    begin: int  # the first of `first`

    def alone(self, start: int, end: int) -> bool:
        """Whether nothing else is in the line."""
        return end >= self.last and start in self.first

    def before(self, start: int) -> str:
        """A few characters before a place."""
        return self.text[max(start - _NEAR, 0) : start]


H: Final = "[0-9A-Fa-f]"
EDGE: Final = r"(?<![0-9A-Za-z_.\u00c0-\u052f])"  # `Узел17`; scripts of the East put no blanks
END: Final = r"(?![0-9A-Za-z_])"
_DIGIT: Final = re.compile(
    r"\d|[\"'][A-Za-z0-9+/]{8}|(?<![A-Za-z])[A-Fa-f]{2}(?![A-Za-z])|\\|><|\^[@-_]|[A-Za-z+/]{6}=|"
    r"(?<![\w+/])(?=[A-Z+/]+(?![\w+/])|[A-Za-z+/]*[a-z/+][A-Z])(?:[A-Za-z+/]{4}){2,}(?![\w+/])"  # base64
)
_SHORT: Final = re.compile(rf"(?<![0-9A-Za-z])(?:&[hH])?{H}{{1,3}}(?![0-9A-Za-z])|{H}{{8}}")
_CLOSED: Final = re.compile(r"^\s*\d[\s\d,]*(?:[\])}]|$)")
_BIG: Final = re.compile(r"[A-Za-z0-9+/]{6}[A-Za-z0-9+/=]{2}")
_ALIKE: Final = "OoIlАВСЕаесОЗΑΒΕΟ"  # typed by hand, on a Cyrillic or a Greek keyboard, too
LOOK_ALIKE: Final = str.maketrans(_ALIKE, "0011ABCEaec03ABE0")
TYPED: Final = f"[0-9A-Fa-f{_ALIKE}]"
MISTYPED: Final = re.compile(  # `O1 03 СD`, `O103СD...`
    rf"(?<!\w)(?:{TYPED}{{2}}(?:[ \t,-]{{1,2}}{TYPED}{{2}}){{3,}}|(?:{TYPED}{{2}}){{4,256}})(?!\w)"
)
LEFT_OUT: Final = ("...", "…")  # between bytes, or behind them
CHECK_NAME: Final = r"(?:crc|lrc|checksum|кс|контрольная сумма|prüfsumme|校验码?|校驗碼?)(?:[-_ ]?16)?"
_WRAPPING: Final = " \t\r\n,;:|=>[](){}\"'-._*◇◆□■#/$`"
_SOLID: Final = re.compile(f"[^{re.escape(_WRAPPING)}]")
_NEAR: Final = 40  # characters
_SOME: Final = 3  # bytes: fewer say nothing
LONG: Final = 4096  # characters: no line of words


def line_of(text: str, marks: Iterable[int] = ()) -> TextLine:
    """A text as a line to search; `marks` are the ends of its direction marks."""
    first, begin, behind = set(), len(text), len(text)
    for position in sorted({0, *marks}, reverse=True):
        solid = _SOLID.search(text, position, behind)
        begin, behind = begin if solid is None else solid.start(), position
        first.add(begin)
    return TextLine(text, frozenset(first), len(text.rstrip(_WRAPPING)), begin)


def holds_digits(text: str) -> bool:
    """Whether there are digits at all that can be a byte."""
    return _DIGIT.search(text) is not None or MISTYPED.search(text) is not None


def holds_several(text: str) -> bool:
    """Whether there are enough of them for a frame, in any shape."""
    least = 0 if _CLOSED.search(text) else _SOME  # the last row of an array may be short
    return (
        len(text) > LONG
        or "\\" in text
        or "><" in text
        or "^" in text
        or len(_SHORT.findall(text)) > least
        or _BIG.search(text) is not None
        or MISTYPED.search(text) is not None
    )
