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
    rf"0[xX]{H}+|\d+\.\d+|(?<![^\W_])(?:{H}{{1,4}}|(?=[A-Fa-f]*\d){H}+)[hH]?(?![^\W_])|\d+|'(?:\\x{H}{{2}}|\\?[^'])'|(?<=\s)\((?:M-\d{{0,3}})?\^?\S?\)|(?<=[,;\t|])[^,;\t|](?=[,;\t|]|\s*$)"
)
_BITS: Final = 8
_WIDEST: Final = 4  # characters of a byte in decimal
_NO_BYTE: Final = 1000


class NumberToken(NamedTuple):
    """A number of one byte, or of several in hex; `signed` where a sign before it says that it is hex.

    `hexadecimal` and `decimal` are the bytes that it is in hex and in decimal, none where it cannot be.
    """

    start: int
    end: int
    digits: str
    signed: bool
    hexadecimal: bytes
    decimal: bytes = b""
    octet: bool = False  # Python's `b'k'`

    @property
    def is_name(self) -> bool:
        """`FC`: what a function code is called."""
        return self.digits.upper() == "FC" and not self.signed

    @property
    def is_bits(self) -> bool:
        """`00010001`: a byte in binary."""
        return len(self.digits) == _BITS and set(self.digits) <= {*"01"}

    def value(self, reading: str) -> bytes:
        """The bytes that it is; none where it cannot be."""
        if reading == "binary":
            return bytes((int(self.digits, 2),)) if self.is_bits else b""
        return self.decimal if reading == "decimal" else self.hexadecimal


def _token(match: re.Match[str]) -> NumberToken:
    if match["char"] is not None:
        return NumberToken(*match.span(), "", False, unescape(match["char"]), octet=True)
    signed, plain = match["signed"], match["plain"] or ""
    digits = plain or signed
    number = int(plain) if len(plain) <= _WIDEST and plain.removeprefix("-").isdigit() else _NO_BYTE
    decimal = bytes((number & 0xFF,)) if -129 < number < 256 else b""
    return NumberToken(*match.span(), digits, signed is not None, _in_hex(digits), decimal)


def _in_hex(digits: str) -> bytes:
    return b"" if digits[0] == "-" or len(digits) == 3 else bytes.fromhex("0" * (len(digits) % 2) + digits)


_NO_NUMBER: Final = NumberToken(0, 0, "", signed=False, hexadecimal=b"")


def nth(tokens: Sequence[NumberToken], i: int) -> NumberToken:
    """One of some numbers, counted from either end; one that is no bytes where there are not so many."""
    return tokens[i] if -len(tokens) <= i < len(tokens) else _NO_NUMBER


def tokens_of(line: LogLine, reading: str = "") -> Sequence[NumberToken]:
    """The numbers of a line; those of one field as one where they are read `JOINED`."""
    if line.numbers is None:
        line.numbers = tuple(map(_token, _TOKEN.finditer(line.clean))) if len(line.clean) <= _LONGEST_ROW else ()
    return _joined_in(line.clean, line.numbers) if reading == JOINED else line.numbers


def _joined_in(text: str, tokens: Sequence[NumberToken]) -> Sequence[NumberToken]:
    """`Starting address: 00 6B`: bytes beside one another as one number."""
    joined: list[NumberToken] = []
    for token in tokens:
        before = joined[-1] if joined else token
        beside = len(token.digits) == 2 and text[before.end : token.start] in _BETWEEN and token.hexadecimal
        if beside and before.signed == token.signed and len(before.digits) % 2 == 0:
            digits = before.digits + token.digits
            token = NumberToken(before.start, token.end, digits, before.signed, _in_hex(digits))
            joined.pop()
        joined.append(token)
    return joined


def skeleton_of(line: LogLine) -> str:
    """A line without its numbers and the characters that they are, whoever speaks in it."""
    return skeleton_in(line.clean)


@lru_cache(_REMEMBERED)
def skeleton_in(text: str) -> str:
    """The same of a text."""
    return either_way(" ".join(_NUMBER.sub("", text).lower().split())).replace("<", ">")


def holds_numbers(line: LogLine) -> bool:
    """Whether there are any."""
    return bool(tokens_of(line))
