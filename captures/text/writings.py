"""Ways of writing bytes, a row each: what they look like, how they are decoded, how much they speak for themselves.

But for `11h 03h`, frames in ASCII mode and od's words they are bytes only where a check value says so.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Final, NamedTuple

from .candidates import EDGE, END, LOOK_ALIKE, MISTYPED, H, HexWindow, Writing
from .escapes import CARET, CONTROL, CONTROLS, HEX_ESCAPE, OD_CELLS, od_bytes, unescape

LOOK_ALIKES: Final = "look-alikes"
_SOME: Final = 3  # bytes: fewer say nothing
_WORD_MOST: Final = 0xFFFF
_OF_BRACKET: Final = r"\((?:(?:0[xX]|&[hH]|\$)[0-9A-Fa-f]{1,2}|\d{1,3})\)"
_DIGIT, _PAIR, _NUMBER, _PLAIN_WORD, _IN_BRACKETS, _PAIR_IN_BRACKETS, _BIT_WORDS, _SUFFIXED = (
    re.compile(pattern)
    for pattern in (
        rf"{H}+", rf"{H}{{2}}", r"-?\d+", r"[A-Za-z]?(?:[a-z]*|[A-Z]*)|[a-z/]+",
        r"\((?:(?:0[xX]|&[hH]|\$)([0-9A-Fa-f]{1,2})|(\d{1,3}))\)", rf"\(({H}{{2}})\)", "[01]{8}", rf"{H}{{2}}(?=[hH])",
    )
)  # fmt: skip


def _pairs_of(text: str) -> bytes:
    return bytes.fromhex("".join(_PAIR.findall(text)))


def _digits_of(text: str) -> bytes | None:
    """`11 3 0 6B`: at least one of a digit alone, else they are pairs."""
    tokens = _DIGIT.findall(text)
    return bytes(int(token, 16) for token in tokens) if min(map(len, tokens)) == 1 else None


def _digits_apart(text: str) -> bytes | None:
    """`1 1 03 0 0 6B`, as a picture is read."""
    tokens = _DIGIT.findall(text)
    digits = "".join(tokens)
    return bytes.fromhex(digits) if min(map(len, tokens)) == 1 and len(digits) % 2 == 0 else None


def _with_characters(text: str) -> bytes | None:
    """`01. 03. 6Bk 00.`: behind each byte the character that it is, or what stands for one."""
    data = bytes.fromhex("".join(text[at : at + 2] for at in range(0, len(text), 4)))
    shown = "".join(chr(byte) if 0x20 <= byte < 0x7F else "." for byte in data)
    return data if text[2::4] == shown else None


def _bracketed(text: str) -> bytes | None:
    """`k(107) .(000)`, `0b00000001 (0x01)`"""
    values = [int(hexa, 16) if hexa else int(number) for hexa, number in _IN_BRACKETS.findall(text)]
    return bytes(values) if max(values) < 256 else None


def _mistyped(text: str) -> bytes | None:
    typed = text.translate(LOOK_ALIKE)
    return _pairs_of(typed) if typed != text else None


def _bits_of(text: str) -> bytes:
    return bytes(int(word, 2) for word in _BIT_WORDS.findall(text))


def _numbers_of(text: str) -> bytes | None:
    values = [int(word) for word in _NUMBER.findall(text)]
    return bytes(values) if max(values) < 256 else None


def _base64_of(text: str) -> bytes | None:
    if _PLAIN_WORD.fullmatch(text) and not text.isupper():
        return None
    from base64 import b64decode

    return b64decode(text)


def _frame_of(text: str) -> bytes:
    """A frame in ASCII mode, as its characters."""
    return f":{''.join(_DIGIT.findall(text))}\r\n".encode()


def _spread(text: str) -> bytes | None:
    """A frame in ASCII mode with blanks in it: its LRC must be right, and no bit of it may be an RTU frame."""
    return _frame_of(text) if len(text.split()) > 1 else None


def _suffixed(text: str) -> bytes:
    return bytes.fromhex("".join(_SUFFIXED.findall(text)))


def _loose(text: str) -> bytes | None:
    """`01 03  006B   0003 74 17`: fields of one, two or more bytes, as far from one another as a person likes."""
    return bytes.fromhex(text) if len({*map(len, text.split())}) > 1 or "  " in text else None


def _in_brackets(text: str) -> bytes:
    return bytes.fromhex("".join(_PAIR_IN_BRACKETS.findall(text)))


def _words_of(base: int) -> Callable[[str], bytes | None]:
    """16-bit words, as `od` and `hexdump -d` write them."""

    def decode(text: str) -> bytes | None:
        words = [int(word, base) for word in text.split()]
        return b"".join(word.to_bytes(2, "little") for word in words) if max(words) <= _WORD_MOST else None

    return decode


class WritingRow(NamedTuple):
    """A writing: `sign` is in each text that has it; its pattern's group `bytes`, or all of it, is decoded; how much it
    speaks for itself, of few bytes and of three or more."""

    shape: str
    sign: str
    pattern: re.Pattern[str]
    decode: Callable[[str], bytes | None]
    few: Writing
    many: Writing
    group: str | int


_NO, _LIKELY, _PLAIN = Writing


def _row(
    shape: str, sign: str, pattern: str, decode: Callable[[str], bytes | None], few: Writing = _NO, many: Writing = _NO
) -> WritingRow:
    found = re.compile(pattern)
    return WritingRow(shape, sign, found, decode, few, many, "bytes" if "bytes" in found.groupindex else 0)


_OD: Final = "swapped words, octal or decimal"
_APART: Final = rf"{EDGE}{H}{{1,2}}(?:[ \t]{{1,4}}{H}{{1,2}}){{3,}}{END}"
HEX_ROWS: Final = (
    _row("h", "", rf"(?i:{EDGE}0?{H}{{2}}h(?:[\s,;-]+0?{H}{{2}}h)+{END})", _suffixed, _LIKELY, _PLAIN),  # `11h 03h`
    _row("ascii", ":",  # `:1103006B00037E`, and others end to end
         rf"(?:(?<![0-9A-Za-z_])|(?<=[0-9A-F]{{8}})):(?!0[bB][01]{{8}}{END})(?:{H}{{2}}){{3,300}}(?![0-9A-Za-z_])",
         _frame_of, _PLAIN, _PLAIN),
    _row("ascii apart", ":", rf"(?:^|[:>|=])[ \t]*(?P<bytes>:(?:[ \t]?{H}{{2}}){{3,300}}){END}", _spread),
    _row("loose words", "", rf"{EDGE}(?:{H}{{2}}){{1,4}}(?:[ \t]{{1,6}}(?:{H}{{2}}){{1,4}})+{END}", _loose),
    _row(_OD, "0", r"^[0-7]{7}\s+(?P<bytes>[0-7]{6}(?: +[0-7]{6}){0,15})\s*$", _words_of(8), _LIKELY, _LIKELY),
    _row(_OD, "0", r"^[0-9a-f]{7}\s+(?P<bytes>\d{5}(?: +\d{5}){0,15})\s*$", _words_of(10), _LIKELY, _LIKELY),
    _row(_OD, "0", r"^[0-7]{7} {2,}(?P<bytes>\d{1,5}(?: +\d{1,5}){7})\s*$", _words_of(10), _LIKELY, _LIKELY),
)  # fmt: skip
_CARETS: Final = r"(?:(?<![^\s:>'\"=\]])[!-~]{0,8})?\^[@-_?][ -~]*"
_NAMED: Final = rf"<(?:{'|'.join(CONTROLS)})>"
OTHER_ROWS: Final = (
    _row("od -c", "0", rf"^[0-9a-f]{{7}}(?P<bytes>{OD_CELLS})\s*$", od_bytes),
    # of LabVIEW, `<SOH><ETX><NUL>k<C5>` of terminals, `^A^C^@kM-^D^J` of `cat -v`, whose first may be a blank
    _row("\\hex", "\\", r"(?:[^\\\s]*\\(?:[0-9A-F]{2}|[bfnrst\\])){3,}[^\\\s]*", partial(unescape, escape=HEX_ESCAPE)),
    _row("<NUL>", "<", rf"(?<!\S)\S{{0,300}}?{_NAMED}.*(?:{_NAMED}|<{H}{{2}}>)\S*", partial(unescape, escape=CONTROL)),
    _row("^A", "^", _CARETS, partial(unescape, escape=CARET)),
    _row("^A", "^", f" {_CARETS}", partial(unescape, escape=CARET)),
    _row("ascii", ":", rf"(?<=[A-Za-z]{{2}}):(?:{H}{{2}}){{3,300}}{END}", _frame_of),  # `Tx:0103…`
    _row("pair and character", "", rf"{EDGE}(?:{H}{{2}}[ -~] ){{3,}}{H}{{2}}[ -~](?!\S)", _with_characters,
         many=_PLAIN),
    _row("pair [.]", "[", rf"(?<!\w)(?:{H}{{2}} ?\[.\][ ,]{{0,3}}){{4,}}", _pairs_of),  # `6B [k]`
    _row("(pair)", "(", rf"(?<=\d)\({H}{{2}}\)(?:[^()]{{0,9}}\d\({H}{{2}}\)){{3,}}", _in_brackets),  # `107(6B)`
    _row("(byte)", "(", rf"{_OF_BRACKET}(?:.{{0,16}}?{_OF_BRACKET}){{3,}}", _bracketed),
    _row(LOOK_ALIKES, "", MISTYPED, _mistyped),  # `O1 03 СD`
    _row("decimal", "", r"^\s*(?P<bytes>\d{1,3}(?:(?:\s*,\s*|\s+)\d{1,3}){0,2})\s*(?:[\])}]|,?\s*$)", _numbers_of),
    _row("digits", "", _APART, _digits_of),
    _row("digits", "", rf"{EDGE}{H}{{1,2}}(?P<gap>[ \t]?[,:;|-][ \t]?){H}{{1,2}}(?:(?P=gap){H}{{1,2}}){{2,}}{END}",
         _digits_of),
    _row("digits apart", "", _APART, _digits_apart),
    _row("binary", "000", r"(?<![\w.])(?P<sign>(?:0b)?)[01]{8}(?:[\s,;|]{1,3}(?P=sign)[01]{8})*(?!\w)", _bits_of),
    _row("base64", "", r"(?<![\w+/=])(?=[\w+/=]{8})(?:[A-Za-z0-9+/]{4})+(?:[A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?"
         r"(?![\w+/=])", _base64_of),
)  # fmt: skip


def of_rows(rows: Iterable[WritingRow], text: str) -> Iterator[HexWindow]:
    """The runs of characters in a text that are written in one of these ways."""
    for row in rows:
        for match in row.pattern.finditer(text) if row.sign in text else ():
            data = row.decode(match[row.group])
            if data is not None:
                level = row.many if len(data) >= _SOME else row.few
                yield HexWindow(data, *match.span(row.group), row.shape, level, row.shape.startswith("ascii"))
