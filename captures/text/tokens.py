"""The numbers of a line, each of which may be a byte or a field of a frame."""

from __future__ import annotations

import re
from collections.abc import Sequence
from functools import lru_cache
from typing import Final, NamedTuple

from .candidates import H
from .escapes import unescape
from .loglines import LogLine
from .tools import either_way

JOINED: Final = "joined"  # how numbers of a column are read, besides as hex or decimal bytes
_BETWEEN: Final = (" ", "  ", ", ")  # bytes of one field
_LONGEST_ROW: Final = 2048  # characters
_REMEMBERED: Final = 512  # lines, as logs repeat themselves
_TOKEN: Final = re.compile(
    r"b(?P<quote>['\"])(?P<char>\\x[0-9a-f]{2}|\\?[^\\])(?P=quote)|"
    rf"(?<![\w.^])(?<!\(M-)(?!(?<=\s\().\))(?:(?P<sign>0[xX]|(?:[A-Z]+#)?16#|\$)(?P<signed>{H}{{1,2}}(?!{H})|(?:{H}{{2}}){{2,256}})|(?P<plain>-?\d{{1,3}}|(?![A-F][a-f]\b|[A-Fa-f]+\[){H}{{1,2}}|(?:{H}{{2}}){{2,256}})[hH]?)"
    r"(?!\w|\.\d|=\s*\w)"
)
_NUMBER: Final = re.compile(  # with the character that it is: 'k', (k), (^A), (M-1), in a cell of its own
    rf"0[xX]{H}+|\d+\.\d+|(?<![^\W_])(?:{H}{{1,4}}|(?=[A-Fa-f]*\d){H}+)[hH]?(?![^\W_])|\d+|'(?:\\x{H}{{2}}|\\?[^'])'|(?<=\s)\((?:M-\d{{0,3}})?\^?\S?\)|(?<=[,;\t|]).(?=[,;\t|]|\s*$)"
)


_BITS: Final = re.compile(r"[01]{8}")


class NumberToken(NamedTuple):
    """A number of one byte, or of several in hex; `signed` where a sign before it says that it is hex.

    `octet`: Python's `b'k'`, which says what byte it is.
    """

    start: int
    end: int
    digits: str
    signed: bool
    octet: bytes | None = None

    @property
    def is_name(self) -> bool:
        """`FC`: what a function code is called."""
        return self.digits.upper() == "FC" and not self.signed

    @property
    def is_bits(self) -> bool:
        """`00010001`: a byte in binary."""
        return _BITS.fullmatch(self.digits) is not None

    @property
    def hexadecimal(self) -> bytes:
        """The bytes that it is in hex; none where it cannot be."""
        digits = self.digits
        if self.octet is not None:
            return self.octet
        return b"" if digits[0] == "-" or len(digits) == 3 else bytes.fromhex("0" * (len(digits) % 2) + digits)

    @property
    def decimal(self) -> bytes:
        """The byte that it is in decimal; none where it cannot be."""
        number = self.digits.removeprefix("-").isdigit() and not self.signed
        return bytes((int(self.digits) & 0xFF,)) if number and -129 < int(self.digits) < 256 else b""

    def value(self, reading: str) -> bytes:
        """The bytes that it is; none where it cannot be."""
        if reading == "binary":
            return bytes((int(self.digits, 2),)) if self.is_bits else b""
        return self.decimal if reading == "decimal" else self.hexadecimal


def cell_of(line: LogLine, i: int, reading: str) -> NumberToken | None:
    """One of the numbers of a line, counted from either end; None where there are not so many."""
    tokens = tokens_of(line, reading)
    return tokens[i] if -len(tokens) <= i < len(tokens) else None


def tokens_of(line: LogLine, reading: str = "") -> Sequence[NumberToken]:
    """The numbers of a line; those of one field as one where they are read `JOINED`."""
    if len(line.clean) > _LONGEST_ROW:
        return ()
    return _joined_in(line.clean) if reading == JOINED else _tokens_in(line.clean)


@lru_cache(_REMEMBERED)
def _joined_in(text: str) -> tuple[NumberToken, ...]:
    """`Starting address: 00 6B`: bytes beside one another as one number."""
    joined: list[NumberToken] = []
    for token in _tokens_in(text):
        before = joined[-1] if joined else None
        if (
            before is not None
            and before.signed == token.signed
            and len(token.digits) == 2
            and len(before.digits) % 2 == 0
            and text[before.end : token.start] in _BETWEEN
            and token.hexadecimal
        ):
            joined[-1] = before._replace(end=token.end, digits=before.digits + token.digits)
        else:
            joined.append(token)
    return tuple(joined)


@lru_cache(_REMEMBERED)
def _tokens_in(text: str) -> tuple[NumberToken, ...]:
    return tuple(
        NumberToken(
            match.start(),
            match.end(),
            match["signed"] or match["plain"] or "",
            match["sign"] is not None,
            None if match["char"] is None else unescape(match["char"]),
        )
        for match in _TOKEN.finditer(text)
    )


def skeleton_of(line: LogLine) -> str:
    """A line without its numbers and the characters that they are, whoever speaks in it."""
    return _skeleton_in(line.clean)


@lru_cache(_REMEMBERED)
def _skeleton_in(text: str) -> str:
    return either_way(" ".join(_NUMBER.sub("", text).lower().split())).replace("<", ">")


def holds_numbers(line: LogLine) -> bool:
    """Whether there are any."""
    return bool(tokens_of(line))
