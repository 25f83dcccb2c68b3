"""Runs of hex bytes in a line of text: every way in which people and tools write them.

A line is searched for all shapes at once; what they give are candidates, which may overlap (`10 20 30 40` is hex or
decimal: for shapes that are no hex see `captures.text.othershapes`). How much a writing speaks for itself is its
`Writing`: signs of its own (`0x11`, `[11][03]`) or many pairs of digits are what a person takes for bytes; a number, a
word or an address is bytes only where a check value says so. Who chooses between candidates is
`captures.text.choosing`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from enum import IntEnum
from typing import Final, NamedTuple


class HexError(ValueError):
    """Text that should be hex bytes and is not; `str()` is one line with the position."""


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
EDGE: Final = r"(?<![0-9A-Za-z_.])"
END: Final = r"(?![0-9A-Za-z_])"
_GLUED: Final = (
    rf"(?:{END}|(?=[A-Za-z]{{0,31}}[g-zG-Z])(?=[A-Za-z]{{2}})|(?=\d{{4}}-\d\d-\d\d))"  # to a word, to a date
)
_SIGN: Final = r"(?:0[xX]|(?:[A-Z]+#)?16#|\$|&[hH]|%|[XxHh]['\"]?)"  # C, PLC languages, Pascal, Basic, URLs
_PAIRS: Final = re.compile(rf"{EDGE}{H}{{2}}(?:[ \t]{{1,4}}{H}{{2}})*{_GLUED}")
_SIGNED: Final = re.compile(
    rf"{EDGE}{H}{{2}}(?P<gap>[ \t]{{0,2}}[^\w\s][^\w\n]{{0,5}}|_){H}{{2}}(?:(?P=gap){H}{{2}})*{_GLUED}"
)
_WORDS: Final = re.compile(
    rf"(?<![0-9A-Za-z_.#@])(?:{H}{{2}}){{2,}}(?:(?P<gap>[ \t]{{1,2}})(?:{H}{{2}})+(?:(?P=gap)(?:{H}{{2}})+)*)?{_GLUED}"
)
_PREFIXED: Final = re.compile(
    rf"{EDGE}(?P<sign>{_SIGN})(?P<first>{H}+)['\"]?(?:[\s,;|'\"\\]{{0,4}}(?P=sign){H}+['\"]?)*{_GLUED}"
)
_SUFFIXED: Final = re.compile(rf"{EDGE}{H}{{2}}[hH](?:[\s,;]+{H}{{2}}[hH])+{END}")
_ASCII: Final = re.compile(rf"(?<![0-9A-Za-z_]):((?:{H}{{2}}){{3,300}}){END}")
_OFFSET: Final = re.compile(rf"(?:^|[^\w.:-])(?P<all>(?:0[xX])?({H}{{4,8}}))[hH]?[ \t]*[:|-]?[ \t]*$")
_ELLIPSIS: Final = re.compile(r"[ ,]?,? ?(?:\.\.\.(?![\w.])|…)")
_HALF_AFTER: Final = re.compile(rf"[ \t]{{1,4}}({H}|{H}{{3}})(?=[ \t]*$|[ \t]+{H}{{2}}(?:\s|$))")
_HALF_BEFORE: Final = re.compile(rf"(?:^|[ \t])({H})[ \t]{{1,4}}$")
_NAMES: Final = re.compile(r"[a-z][a-z0-9/]*")
_OTHER_THINGS: Final = frozenset(
    [
        "mac",
        "bssid",
        "uuid",
        "guid",
        "sha",
        "sha1",
        "sha256",
        "md5",
        "hash",
        "commit",
        "rev",
        "revision",
        "version",
        "serial",
        "s/n",
        "sn",
        "key",
        "token",
        "chip",
        "eui",
        "ip",
        "ptr",
        "pointer",
        "date",
        "time",
        "id",
        "chipid",
        "oid",
        "imei",
        "iccid",
    ]
)
_OF_THINGS: Final = frozenset(["address", "addr", "number", "id", "no", "nr"])
_ROW_OF_WORDS: Final = re.compile(rf"{H}{{7,8}} +{H}{{4}}\s*$")
_OFFSET_ENDS: Final = frozenset("0123456789abcdefABCDEFhH")
_COMMON_SIGNS: Final = ("%", "$", "x", "X", "h", "H")
_ELLIPSIS_STARTS: Final = frozenset(" ,.…")
_GAP: Final = re.compile(r"[ \t]+")
_FEW: Final = 17  # characters: six bytes
_DIGIT: Final = re.compile(r"\d|[\"'][A-Za-z0-9+/]{8}|(?<![A-Za-z])[A-Fa-f]{2}(?![A-Za-z])|\\|[A-Za-z+/]{6}=")
_SHORT: Final = re.compile(rf"(?<![0-9A-Za-z]){H}{{1,3}}(?![0-9A-Za-z])|{H}{{8}}")
_BIG: Final = re.compile(r"[A-Za-z0-9+/]{6}[A-Za-z0-9+/=]{2}")
_WRAPPING: Final = " \t\r\n,;:|=>[](){}\"'-._*◇◆□■#/$`"
_SOLID: Final = re.compile(f"[^{re.escape(_WRAPPING)}]")
_NEAR: Final = 40  # characters
_SOME: Final = 3  # bytes: fewer say nothing
_LONG: Final = 4096  # characters: no line of words
_MAC_LENGTH: Final = 6
_WORD_LENGTH: Final = 8  # bytes: no address of a machine is longer
_ROW: Final = 8  # bytes, after which dumps leave a gap
ROWS: Final = ("pairs", "words", "swapped words")  # shapes of the rows of dumps
_COLUMN_NUMBERS: Final = tuple(
    [form(number) for number in range(first, first + count)]
    for count in (8, 16)
    for first in (0, 1)
    for form in ("{:02X}".format, "{:02x}".format, "{:02d}".format)
)


def line_of(text: str, marks: Iterable[int] = ()) -> TextLine:
    """A text as a line to search; `marks` are the ends of its direction marks."""
    first, begin, behind = set(), len(text), len(text)
    for place in sorted({0, *marks}, reverse=True):
        solid = _SOLID.search(text, place, behind)
        begin, behind = begin if solid is None else solid.start(), place
        first.add(begin)
    return TextLine(text, frozenset(first), len(text.rstrip(_WRAPPING)), begin)


def holds_digits(text: str) -> bool:
    """Whether there are digits at all that can be a byte."""
    return _DIGIT.search(text) is not None


def holds_several(text: str) -> bool:
    """Whether there are enough of them for a frame, in any shape."""
    return len(text) > _LONG or "\\" in text or len(_SHORT.findall(text)) > _SOME or _BIG.search(text) is not None


def hex_candidates(line: TextLine) -> Iterator[HexWindow]:
    """All runs of characters that can be hex bytes, shape by shape."""
    text = line.text
    yield from _pairs(line)
    yield from _signed(line)
    yield from _words(line)
    if not _SIGNS.isdisjoint(text):
        yield from _prefixed(line)
    if "h" in text or "H" in text:
        yield from _suffixed(text)
    if ":" in text:
        yield from _ascii_frames(text)


_SIGNS: Final = frozenset("xX$#&%'\"")


def in_its_place(found: HexWindow, line: TextLine) -> HexWindow:
    """A candidate with what stands before it taken into account."""
    before = line.before(found.start)
    bare = before.rstrip(" \t:|-")
    if found.shape in ROWS and bare[-1:] in _OFFSET_ENDS and (offset := _OFFSET.search(before)) is not None:
        begin = found.start - len(before) + offset.start("all")
        if begin in line.first:
            level = max(found.level, Writing.BYTES if len(found.data) > 2 else Writing.LIKELY)
            return found._replace(offset=offset[2], level=level, lead=begin)
    if found.level and not found.ascii and _is_named_otherwise(before):
        return found._replace(level=Writing.NUMBER, lead=found.start)
    return found._replace(lead=found.start)


def _is_named_otherwise(before: str) -> bool:
    """Whether the words before some digits say that they are an address, a name or the like, and no bytes."""
    if before.endswith(("@", "::")):
        return True
    words = _NAMES.findall(before.lower())[-2:]
    return (
        bool(words)
        and len(before) - before.lower().rfind(words[-1]) - len(words[-1]) < 4
        and (words[-1] in _OTHER_THINGS or (words[-1] in _OF_THINGS and words[0] in _OTHER_THINGS))
    )


def is_cut(line: TextLine, end: int) -> bool:
    """Whether the text says, at the end of some bytes, that there are more."""
    return line.text[end : end + 1] in _ELLIPSIS_STARTS and _ELLIPSIS.match(line.text, end) is not None


def is_halved(line: TextLine, start: int, end: int) -> bool:
    """Whether half a byte stands beside these bytes."""
    if _HALF_AFTER.match(line.text, end):
        return True
    return end - start < _FEW and _HALF_BEFORE.search(line.before(start)) is not None


def _pairs(line: TextLine) -> Iterator[HexWindow]:
    """`11 03 00 6B`"""
    text = line.text
    for match in _PAIRS.finditer(text):
        start, end = match.span()
        if "  " in match[0]:
            end = _before_characters(text, start, end)
        tokens = text[start:end].split()
        if len(tokens) < _SOME and (len(text) > _LONG or text[end : end + 1].isalnum()):
            continue  # one number of many, or the beginning of a word
        data = bytes.fromhex(text[start:end])
        level = Writing.BYTES if line.before(start).endswith("<Buffer ") else _level_of_pairs(line, start, end, tokens)
        if len(tokens) > _SOME:  # what stands at the ends may be a word, or a number in a column of its own
            second = text.index(tokens[1], start + 2)
            (usual, _), *_ = Counter(_GAP.findall(text, second, end)).most_common(1)
            apart = text[start + 2 : second] != usual
            if apart or (tokens[0].isalpha() and not line.alone(start, end)):
                yield HexWindow(data[1:], second, end, "pairs", level)
                level = Writing.LIKELY if apart else level
            if text[end : end + 1].isalnum():  # "02Connected", "10 after"
                last = start + len(text[start : end - 2].rstrip())
                yield HexWindow(data[:-1], start, last, "pairs", level)
                level = Writing.LIKELY if tokens[-1].isalpha() else level
        yield HexWindow(data, start, end, "pairs", level)


def _level_of_pairs(line: TextLine, start: int, end: int, tokens: list[str]) -> Writing:
    """Three pairs are bytes where any can be no number that people write: it has a letter, or a leading zero."""
    alone = line.alone(start, end)
    odd = any(token[0] == "0" or not token.isdigit() for token in tokens)
    if all(token.isalpha() for token in tokens):
        return Writing.LIKELY if alone or len(tokens) >= _SOME else Writing.NUMBER
    if len(tokens) == 1:
        return Writing.LIKELY if alone and (odd or start == line.begin) else Writing.NUMBER
    if len(tokens) < _SOME:
        return Writing.LIKELY if alone else Writing.NUMBER
    if tokens in _COLUMN_NUMBERS:
        return Writing.NUMBER
    return Writing.BYTES if odd else Writing.LIKELY


def _before_characters(text: str, start: int, end: int) -> int:
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


def _signed(line: TextLine) -> Iterator[HexWindow]:
    """`11-03-00`, `11:03:00`, `11, 03, 00`, `[11][03]`, `'11', '03'`"""
    text = line.text
    for match in _SIGNED.finditer(text):
        gap, end = match["gap"], match.end()
        tokens = match[0].split(gap)
        goes_on = text.startswith(gap, end) and text[end + len(gap) : end + len(gap) + 1].isalnum()
        level = _level_of_signed(tokens, gap.strip())
        if goes_on:
            level = Writing.NUMBER  # a list of other numbers
        elif line.alone(match.start(), end):
            level = max(level, Writing.LIKELY)
        yield HexWindow(bytes.fromhex("".join(tokens)), match.start(), end, f"pairs{gap.strip()}", level)


def _level_of_signed(tokens: list[str], gap: str) -> Writing:
    count, numbers = len(tokens), all(token.isdigit() for token in tokens)
    if (gap in "/." and count < 5) or all(token.isalpha() for token in tokens):
        return Writing.NUMBER  # a date, an address, a version, words
    if gap == ":" and count == _MAC_LENGTH:
        return Writing.LIKELY
    if count > 3 or (count == 3 and not numbers):
        return Writing.BYTES if not numbers or any(token[0] == "0" for token in tokens) else Writing.LIKELY
    return Writing.NUMBER


def _words(line: TextLine) -> Iterator[HexWindow]:
    """`1103006B`, `1103 006B`: digits without signs between the bytes; of 16-bit words the other order, too."""
    for match in _WORDS.finditer(line.text):
        start, end = match.span()
        if "  " in match[0]:
            end = _before_characters(line.text, start, end)
        tokens = line.text[start:end].split()
        if len(tokens) > 2 and len(tokens[0]) > 2 and all(len(token) == 2 for token in tokens[1:]):
            continue  # the first is an offset
        data = bytes.fromhex("".join(tokens))
        yield HexWindow(data, start, end, "words", _level_of_words(line, start, end, tokens))
        row = len(tokens) > 1 or _ROW_OF_WORDS.match(line.text) is not None
        if row and all(len(token) == 4 for token in tokens):
            yield HexWindow(swapped(data), start, end, "swapped words", Writing.NUMBER)


def swapped(data: bytes) -> bytes:
    """16-bit words with their bytes the other way round."""
    out = bytearray(data)
    out[::2], out[1::2] = data[1::2], data[::2]
    return bytes(out)


def _level_of_words(line: TextLine, start: int, end: int, tokens: list[str]) -> Writing:
    digits = "".join(tokens)
    size = len(digits) // 2
    bare = line.alone(start, end)
    alone = bare or (end >= line.last and line.before(start).rstrip()[-1:] in (":", "=", ","))
    if line.text[start - 1 : start] == "-" or line.text[end : end + 1] == "-":
        return Writing.NUMBER  # part of a UUID
    if digits.isalpha():
        return Writing.LIKELY if len(tokens) == 1 and size > 4 and alone else Writing.NUMBER
    if digits.isdigit():
        return Writing.LIKELY if bare else Writing.NUMBER
    if size >= _WORD_LENGTH:
        return Writing.BYTES if size > _WORD_LENGTH or alone or digits[0] == "0" or len(tokens) > 1 else Writing.LIKELY
    return Writing.LIKELY if bare or (alone and len(tokens) > 1) else Writing.NUMBER


def _prefixed(line: TextLine) -> Iterator[HexWindow]:
    """`0x11, 0x03`, `16#11`, `$11`, `&H11`, `%11`"""
    text = line.text
    for match in _PREFIXED.finditer(text):
        sign, start, end = match["sign"], match.start(), match.end()
        if sign in ("x", "X") and text[start - 1 : start] == "\\":
            continue  # an escape
        tokens = re.findall(rf"{re.escape(sign)}({H}+)", match[0])
        if len(tokens[-1]) > 2 and len(tokens) > 2 and all(len(token) < 3 for token in tokens[:-1]):
            last = start + match[0].rfind(sign) + len(sign)
            if re.match(r"20\d\d-", text[last + 2 : last + 7]):  # the line break was lost: 0xee2026-09-11
                tokens[-1], end = text[last : last + 2], last + 2
        if any(len(token) > 2 for token in tokens):
            yield from _prefixed_words(line, match, tokens)
            continue
        level = Writing.NUMBER
        if sign not in _COMMON_SIGNS or (len(tokens) > 2 and all(len(token) == 2 for token in tokens)):
            some = len(tokens) > 1 or line.alone(start, end)
            level = Writing.BYTES if len(tokens) > 2 else Writing.LIKELY if some else Writing.NUMBER
        yield HexWindow(bytes(int(token, 16) for token in tokens), start, end, "0x", level)


def _prefixed_words(line: TextLine, match: re.Match[str], tokens: list[str]) -> Iterator[HexWindow]:
    if any(len(token) % 2 for token in tokens):
        return
    data = bytes.fromhex("".join(tokens))
    alone = line.alone(*match.span()) and len(data) > 3
    yield HexWindow(data, *match.span(), "0x words", Writing.LIKELY if alone else Writing.NUMBER)
    if all(len(token) == 4 for token in tokens):
        yield HexWindow(swapped(data), *match.span(), "swapped 0x words", Writing.NUMBER)


def _suffixed(text: str) -> Iterator[HexWindow]:
    """`11h 03h`"""
    for match in _SUFFIXED.finditer(text):
        data = bytes.fromhex(re.sub(r"[hH,;\s]", "", match[0]))
        yield HexWindow(data, *match.span(), "h", Writing.BYTES if len(data) > 2 else Writing.LIKELY)


def _ascii_frames(text: str) -> Iterator[HexWindow]:
    """`:1103006B00037E`"""
    for match in _ASCII.finditer(text):
        yield HexWindow(match[0].encode() + b"\r\n", *match.span(), "ascii", Writing.BYTES, ascii=True)


_ODD: Final = "an odd number of hex digits in {!r} at column {}: write each byte with two digits"
_HALVED: Final = (
    (
        re.compile(r'"Buffer"\s*,\s*"data"\s*:\s*\[[\d,\s]*?\b(\d{4,}|2(?:5[6-9]|[6-9]\d)|[3-9]\d\d)\b'),
        "{} is not a byte, in the Buffer at column {}",
    ),
    (re.compile(rf"(?:^|[\s,;:])0[xX]((?:{H}{{2}})+{H})\b"), "an odd number of hex digits in 0x{} at column {}"),
    (re.compile(rf"\b{H}{{2}}[ \t,:-]{{1,2}}({H}|{H}{{3}})(?![0-9A-Za-z_.])"), _ODD),
    (re.compile(rf"(?:^|[\s,;:])(?=[a-fA-F]*\d)({H}{{5,}})\s*$"), _ODD),
    (re.compile(r"(\\x)(?![0-9A-Fa-f]{2})"), "{} without two hex digits at column {}"),
)


def halves(text: str) -> str | None:
    """What is wrong with digits of this text that are meant as bytes and do not come in pairs; None for others."""
    for pattern, words in _HALVED:
        if (match := pattern.search(text)) is not None and not (words is _ODD and len(match[1]) % 2 == 0):
            return words.format(shortened(match[1]), match.start(1) + 1)
    return None


def shortened(word: str) -> str:
    """A word as a message quotes it."""
    return word if len(word) <= 24 else word[:21] + "..."
