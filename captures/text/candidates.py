"""What a run of bytes in a line may be, and what stands around its digits: rows of dumps, offsets, names, half bytes.

How much a writing speaks for itself is its `Writing`: signs of its own (`0x11`, `[11][03]`) or many pairs of digits are
what a person takes for bytes; a number, a word or an address is bytes only where a check value says so.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from enum import IntEnum
from itertools import pairwise
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


WORD: Final = re.compile(r"\w")
H: Final = "[0-9A-Fa-f]"
EDGE: Final = r"(?<![0-9A-Za-z_.\u00c0-\u052f])"  # `Узел17`; scripts of the East put no blanks
END: Final = r"(?![0-9A-Za-z_])"
_ALIKE: Final = "OoIlАВСЕаесОЗΑΒΕΟ"  # typed by hand, on a Cyrillic or a Greek keyboard, too
LOOK_ALIKE: Final = str.maketrans(_ALIKE, "0011ABCEaec03ABE0")
TYPED: Final = f"[0-9A-Fa-f{_ALIKE}]"
MISTYPED: Final = (  # `O1 03 СD`, `O103СD...`
    rf"(?<!\w)(?:{TYPED}{{2}}(?:[ \t,-]{{1,2}}{TYPED}{{2}}){{3,}}|(?:{TYPED}{{2}}){{4,256}})(?!\w)"
)
LEFT_OUT: Final = ("...", "…")  # between bytes, or behind them
_WRAPPING: Final = " \t\r\n,;:|=>[](){}\"'-._*◇◆□■#/$`"
_SOLID: Final = re.compile(f"[^{re.escape(_WRAPPING)}]")
_NEAR: Final = 40  # characters
_SOME: Final = 3  # bytes: fewer say nothing
_SMALL: Final = 0x20  # more than the code of any public function
LONG: Final = 4096  # characters: no line of words


def line_of(text: str, marks: Iterable[int] = ()) -> TextLine:
    """A text as a line to search; `marks` are the ends of its direction marks."""
    first, begin, behind = set(), len(text), len(text)
    for position in sorted({0, *marks}, reverse=True):
        solid = _SOLID.search(text, position, behind)
        begin, behind = begin if solid is None else solid.start(), position
        first.add(begin)
    return TextLine(text, frozenset(first), len(text.rstrip(_WRAPPING)), begin)


ROWS: Final = (  # shapes of the rows of dumps
    "pairs", "words", "swapped words", "swapped words, octal or decimal", "binary", "decimal", "od -c",
)  # fmt: skip
_RULER: Final = 6  # numbers, each one more than that before it
_RULERS: Final = tuple(
    " ".join(("", *map(number.format, range(most)), "")) for number, most in (("{:X}", 256), ("{}", 100))
)
DIGITS_ABOVE: Final = ("0123456789ABCDEF", "0123456789")  # columns of characters in a dump


def counts_up(data: bytes) -> bool:
    """Whether these are small numbers, each more than that before it: functions, terminals, and no frame."""
    return len(data) > _SOME and data[-1] < _SMALL and all(one < after for one, after in pairwise(data))


def is_ruler(tokens: Sequence[str]) -> bool:
    """Whether these are the numbers that dumps and tables write above their columns."""
    shown = " ".join(token.upper().removeprefix("0") or "0" for token in tokens)
    return len(tokens) >= _RULER and any(f" {shown} " in ruler for ruler in _RULERS)


def shows(data: bytes, text: str) -> bool:
    """Whether a text is these bytes as characters, with dots or the like for those that have none."""
    text = text.strip("|<> \t")
    signs = zip(data, text.ljust(len(data)), strict=False)
    return len(text) <= len(data) and all(char == chr(byte) or _may_stand_for(byte, char) for byte, char in signs)


def _may_stand_for(byte: int, char: str) -> bool:
    return char == "." if 0x20 < byte < 0x7F else not (char.isascii() and char.isalnum())


def swapped(data: bytes) -> bytes:
    """16-bit words with their bytes the other way round."""
    out = bytearray(data)
    out[::2], out[1::2] = data[1::2], data[::2]
    return bytes(out)


_OFFSET: Final = re.compile(
    rf"(?:^|[^\w.:-])(?P<all>(?:0[xX])?({H}{{4,8}}|{H}{{3}}(?=:)))[hH]?[ \t]*(?:[:|]|-(?=[ \t]))?[ \t]*$"
)
_NAMES: Final = re.compile(r"[^\W\d_][^\W_/]*(?:/[^\W_]+)*")
_WORDS: Final = (
    "mac bssid uuid guid sha sha1 sha256 md5 hash commit rev revision version serial "
    "s/n sn key token chip eui ip ptr pointer date time id chipid oid imei iccid "
    "tel tél tlf phone telefon telefono telefone téléphone fax mobile mobil cell iban order invoice "
    "тел телефон факс счёт заказ"
)
_OTHER_THINGS: Final = frozenset(_WORDS.split())
_OFFSET_ENDS: Final = frozenset("0123456789abcdefABCDEFhH")
_NUMBER: Final = 2  # bytes that may be one number


def offset_at_the_end(before: str) -> re.Match[str] | None:
    """The offset of a dump's row with which this ends."""
    return _OFFSET.search(before) if before.rstrip(" \t:|-")[-1:] in _OFFSET_ENDS else None


def in_its_place(found: HexWindow, line: TextLine) -> HexWindow:
    """A candidate with what stands before it taken into account."""
    before = line.before(found.start)
    offset = offset_at_the_end(before) if found.shape in ROWS else None
    if offset is not None and (begin := found.start - len(before) + offset.start("all")) in line.first:
        level = Writing.BYTES if len(found.data) > _NUMBER else found.level  # `40003: 1000`
        return found._replace(offset=offset[2], level=level, lead=begin)
    named = found.level and is_named_otherwise(before)
    return found._replace(level=Writing.NUMBER if named else found.level, lead=found.start)


def is_named_otherwise(before: str) -> bool:
    """Whether the words before some digits say that they are an address, a name or the like, and no bytes."""
    words = [*_NAMES.finditer(before.lower())]
    return bool(words) and words[-1][0] in _OTHER_THINGS and len(before) - words[-1].end() < 4


_ODD: Final = "an odd number of hex digits in {!r} at column {}: write each byte with two digits"
_HALVED: Final = tuple(
    (re.compile(pattern), words)
    for pattern, words in (
        (
            r'"Buffer"\s*,\s*"data"\s*:\s*\[[\d,\s]*?\b(\d{4,}|2(?:5[6-9]|[6-9]\d)|[3-9]\d\d)\b',
            "{} is not a byte, in the Buffer at column {}",
        ),
        (
            rf"(?:^|[\s,;:])0[xX](?:((?:{H}{{2}}){{2,}}{H})|{H}{{1,2}}[\s,;:]{{1,2}}0[xX]({H}{{3}}))\b",
            "an odd number of hex digits in 0x{} at column {}",
        ),
        (  # not `main.rs:42:5`, `12 500 rub`
            rf"\b(?<!\w:)(?:\b{H}{{2}}[ \t,:-]{{1,2}}){{2,}}({H}|{H}{{3}})(?![0-9A-Za-z_.])|"
            rf"^\s*(?!fc|FC){H}{{2}}[ \t,:-]{{1,2}}({H}|{H}{{3}})(?:\s*$|(?:\s+{H}{{1,2}}){{2}})|"
            rf"(?<![^\s,;:])(?=[a-fA-F]?\d)(?=\d*[a-fA-F])((?:{H}{{2}}){{2,}}{H})\s*$|^\s*((?:\d\d){{2,}}\d)\s*$",
            _ODD,
        ),
        (r"(\\x)(?![0-9A-Fa-f]{2}|\{)", "{} without two hex digits at column {}"),
    )
)


def halves(text: str) -> str | None:
    """What is wrong with digits of this text that are meant as bytes and do not come in pairs; None for others."""
    for pattern, words in _HALVED:
        if (match := pattern.search(text)) is not None and match.lastindex is not None:
            return words.format(shortened(match[match.lastindex]), match.start(match.lastindex) + 1)
    return None


def shortened(text: str, most: int = 24) -> str:
    """A text as a message quotes it, up to so many characters."""
    return text if len(text) <= most else text[: most - 3] + "..."
