"""Runs of hex bytes in a line of text: every way in which people and tools write them.

A line is searched for all shapes at once; what they give are candidates, which may overlap (`10 20 30 40` is hex or
decimal: for shapes that are no hex see `captures.text.othershapes`). Who chooses between candidates is
`captures.text.choosing`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator
from typing import Final

from .candidates import (
    DIGITS_ABOVE,
    EDGE,
    END,
    LEFT_OUT,
    LONG,
    H,
    HexWindow,
    TextLine,
    Writing,
    counts_up,
    is_ruler,
    offset_at_the_end,
    swapped,
)

_GLUED: Final = (
    rf"(?:{END}|(?=[A-Za-z]{{0,31}}[g-zG-Z])(?=[A-Za-z]{{2}})|(?=\d{{4}}-\d\d-\d\d))"  # to a word, to a date
)
_SIGN: Final = (  # C, PLC languages, Pascal, Basic, URLs, Verilog
    r"(?:0[xX]|(?:[A-Z]+#)?16#|\$|&[hH]|%|8'[hH]|[XxHh]['\"]?)"
)
_FRACTION: Final = r"(?!\.\d{1,3}(?:[\s)]|[mµu]?s))"  # `10.5ms` behind bytes
_PAIRS: Final = re.compile(rf"{EDGE}{H}{{2}}(?:[ \t]{{1,4}}{H}{{2}})*{_FRACTION}{_GLUED}")
_LOOSE: Final = re.compile(rf"{EDGE}(?:{H}{{2}}){{1,4}}(?:[ \t]{{1,6}}(?:{H}{{2}}){{1,4}})+{END}")
_PAIR_OF_PAIRS: Final = 2
_SIGNED: Final = re.compile(
    rf"{EDGE}{H}{{2}}(?P<gap>[ \t]{{0,2}}[^\w\s][^\w\n]{{0,5}}|_){H}{{2}}(?:(?P=gap){H}{{2}})*{_GLUED}"
)
_WORDS: Final = re.compile(
    rf"(?:(?<![0-9A-Za-z_.#@])|(?<=[A-Za-z]#))"  # `TX#1103006B`
    rf"(?:{H}{{2}}){{2,}}(?:(?P<gap>[ \t]{{1,2}})(?:{H}{{2}})+(?:(?P=gap)(?:{H}{{2}})+)*)?{_FRACTION}{_GLUED}"
)
_BETWEEN: Final = r"(?:[\s,;|'\"\\]{0,4}|[-:/.]|\][ \t]?\[|>[ \t]?<|\}[ \t]?\{|\)[ \t]?\()"  # of signed bytes
_UP_TO_SIGN: Final = rf"{H}+?(?=(?P=sign)|(?!{H}))"  # the next byte's, which may begin with a digit
_PREFIXED: Final = re.compile(
    rf"{EDGE}(?P<sign>{_SIGN})(?P<first>{_UP_TO_SIGN})[uU]?['\"]?"
    rf"(?:{_BETWEEN}(?P=sign){_UP_TO_SIGN}[uU]?['\"]?)*{_GLUED}"
)
_SUFFIXED: Final = re.compile(rf"{EDGE}0?{H}{{2}}[hH](?:[\s,;-]+0?{H}{{2}}[hH])+{END}")
_ASCII: Final = re.compile(rf"(?<![0-9A-Za-z_])(?::(?:{H}{{2}}){{3,300}})+{END}")
_BITS: Final = re.compile(r"0[bB][01]{8}$")
_ASCII_APART: Final = re.compile(rf"(?:^|[:>|=])[ \t]*(?P<frame>:(?:[ \t]?{H}{{2}}){{3,300}}){END}")
_SPELLED: Final = re.compile(  # `: 0 1 0 3`, `':' '0' '1'`
    rf"(?P<quote>['\"]?):(?P=quote)(?:[ \t,]{{1,3}}(?P=quote){H}(?P=quote)){{8,512}}(?![\w'\"])"
)
_OF_OD: Final = (
    (re.compile(r"[0-7]{7}\s+(?P<words>[0-7]{6}(?: +[0-7]{6}){0,15})\s*$"), 8),
    (re.compile(r"[0-9a-f]{7}\s+(?P<words>\d{5}(?: +\d{5}){0,15})\s*$"), 10),
    (re.compile(r"[0-7]{7} {2,}(?P<words>\d{1,5}(?: +\d{1,5}){7})\s*$"), 10),
)
_WORD_MOST: Final = 0xFFFF
_COMMON_SIGNS: Final = ("%", "$", "x", "X", "h", "H")
_GAP: Final = re.compile(r"[ \t]+")
_SOME: Final = 3  # bytes: fewer say nothing
_STAMPED: Final = 8  # characters: no time before bytes is shorter
_TWO_PAIRS: Final = 4  # characters
_WORDY: Final = 4  # pairs that name a function code: `unit 01 fc 03`
_MINUTE: Final = re.compile(r"(?:[01]\d|2[0-3]):[0-5]\d")
_MAC_LENGTH: Final = 6  # bytes
_BYTEA: Final = 8  # digits behind one `\\x`, as databases write bytes
_WORD_LENGTH: Final = 8  # bytes: no address of a machine is longer


def hex_candidates(line: TextLine) -> Iterator[HexWindow]:
    """All runs of characters that can be hex bytes, shape by shape."""
    text = line.text
    yield from _pairs(line)
    yield from _signed(line)
    yield from _words(line)
    yield from _loose_words(line)
    if not _SIGNS.isdisjoint(text) or _LETTER_H.search(text):
        yield from _prefixed(line)
    if "h" in text or "H" in text:
        yield from _suffixed(text)
    if ":" in text:
        yield from _ascii_frames(text)
    if text[:1] == "0":
        yield from _numbers(text)


_SIGNS: Final = frozenset("xX$#&%'\"")
_LETTER_H: Final = re.compile(rf"(?<![0-9A-Za-z_.])(?:h{H}{{2}}[ ,;]+){{2}}", re.IGNORECASE)


_BEFORE_BYTES: Final = tuple(":=[({])}><")


def _begins_bytes(before: str) -> bool:
    """Whether nothing but a byte is to be expected behind this: a sign, or the offset of a row."""
    return before.rstrip()[-1:] in _BEFORE_BYTES or offset_at_the_end(before) is not None


def _pairs(line: TextLine) -> Iterator[HexWindow]:
    """`11 03 00 6B`"""
    text = line.text
    for match in _PAIRS.finditer(text):
        start, end = match.span()
        tokens = text[start:end].split()
        if len(tokens) < _SOME and (len(text) > LONG or text[end : end + 1].isalnum()):
            continue  # one number of many, or the beginning of a word
        data = bytes.fromhex(text[start:end])
        level = _level_of_pairs(line, start, end, tokens)
        if len(tokens) > _SOME:  # what stands at the ends may be a word, or a number in a column of its own
            second = text.index(tokens[1], start + 2)
            (usual, _), *_ = Counter(_GAP.findall(text, second, end)).most_common(1)
            apart = text[start + 2 : second] != usual
            counted = tokens[0].isdigit() and int(tokens[0]) == len(tokens) - 1  # "OUT 10 01 03 00 ...": so many bytes
            counted = counted and start >= _STAMPED  # which nothing but bytes cannot say
            word = tokens[0].isalpha() and not (line.alone(start, end) or _begins_bytes(line.before(start)))
            if apart or counted or word:
                yield HexWindow(data[1:], second, end, "pairs", level)
            if text[end : end + 1].isalnum():  # "02Connected", "10 after"
                last = start + len(text[start : end - 2].rstrip())
                yield HexWindow(data[:-1], start, last, "pairs", level)
        yield HexWindow(data, start, end, "pairs", level)


def _level_of_pairs(line: TextLine, start: int, end: int, tokens: list[str]) -> Writing:
    """Three pairs are bytes where any can be no number that people write: it has a letter, or a leading zero."""
    alone = line.alone(start, end)
    odd = any(token[0] == "0" or not token.isdigit() for token in tokens)
    if all(token.isalpha() for token in tokens):
        word = any(token.istitle() for token in tokens)  # `Be Ad`
        return Writing.LIKELY if (alone or len(tokens) >= _SOME) and not word else Writing.NUMBER
    if len(tokens) == 1:
        return Writing.LIKELY if alone and (odd or start == line.begin) else Writing.NUMBER
    if len(tokens) < _SOME:
        return Writing.LIKELY if alone else Writing.NUMBER
    wordy = start not in line.first
    if is_ruler(tokens) or (wordy and _is_list(tokens)):
        return Writing.NUMBER
    return Writing.BYTES if odd else Writing.LIKELY


def _is_list(tokens: list[str]) -> bool:
    """Whether these are functions by their names or their numbers: `unit 01 fc 03`, `functions 01 02 03 05 0F 10`."""
    if len(tokens) <= _WORDY:
        return "fc" in map(str.lower, tokens[:2])
    return counts_up(bytes.fromhex("".join(tokens)))


def _signed(line: TextLine) -> Iterator[HexWindow]:
    """`11-03-00`, `11:03:00`, `11, 03, 00`, `[11][03]`, `'11', '03'`"""
    text, at = line.text, 0
    while (match := _SIGNED.search(text, at)) is not None:
        gap, end = match["gap"], match.end()
        if gap.strip() in LEFT_OUT:
            at = match.start() + 2
            continue
        at = end if end - match.start() > _TWO_PAIRS + len(gap) else end - 2  # `[11]: 05-10-00`: a count before them
        tokens = match[0].split(gap)
        goes_on = text.startswith(gap, end) and text[end + len(gap) : end + len(gap) + 1].isalnum()
        before = match.start() - len(gap)
        goes_on = goes_on or (before > 0 and text.startswith(gap, before) and text[before - 1].isdigit())
        level = _level_of_signed(tokens, gap.strip())
        if (
            goes_on
            or _MINUTE.fullmatch(match[0])
            or (match.start() not in line.first and counts_up(bytes.fromhex("".join(tokens))))
        ):
            level = Writing.NUMBER  # a list of other numbers, `10:15`
        elif line.alone(match.start(), end):
            level = max(level, Writing.LIKELY)
        yield HexWindow(bytes.fromhex("".join(tokens)), match.start(), end, f"pairs{gap.strip()}", level)


def _level_of_signed(tokens: list[str], gap: str) -> Writing:
    count, numbers = len(tokens), all(token.isdigit() for token in tokens)
    if gap in "/." or is_ruler(tokens):
        return Writing.NUMBER  # a date, an address, a version
    if gap == ":" and count == _MAC_LENGTH:
        return Writing.LIKELY
    if count > 3 or (count == 3 and not numbers):
        return Writing.BYTES if not numbers or any(token[0] == "0" for token in tokens) else Writing.LIKELY
    return Writing.NUMBER


def _words(line: TextLine) -> Iterator[HexWindow]:
    """`1103006B`, `1103 006B`: digits without signs between the bytes; of 16-bit words the other order, too."""
    for match in _WORDS.finditer(line.text):
        start, end = match.span()
        tokens = line.text[start:end].split()
        if match[0].upper() in DIGITS_ABOVE:
            continue
        data, level = bytes.fromhex("".join(tokens)), _level_of_words(line, start, end, tokens)
        if len(tokens) > 1 and line.text[end : end + 1].isalnum():  # "0A3843 after"
            last = start + len(line.text[start : end - len(tokens[-1])].rstrip())
            yield HexWindow(data[: -len(tokens[-1]) // 2], start, last, "words", level)
        yield HexWindow(data, start, end, "words", level)
        if all(len(token) == 4 for token in tokens):
            yield HexWindow(swapped(data), start, end, "swapped words", Writing.NUMBER)
        elif len(tokens) > 1 and all(len(token) == 8 for token in tokens[:-1]):
            parts = (bytes.fromhex(token)[::-1] for token in tokens)
            yield HexWindow(b"".join(parts), start, end, "swapped words", Writing.NUMBER)


def _level_of_words(line: TextLine, start: int, end: int, tokens: list[str]) -> Writing:
    digits = "".join(tokens)
    size = len(digits) // 2
    quoted = line.text[start - 1 : start] in ("'", '"') and line.text[end : end + 1] == line.text[start - 1 : start]
    bare = line.alone(start, end) or (quoted and line.alone(max(start - len("b'"), 0), end))
    alone = bare or (end >= line.last and line.before(start).rstrip()[-1:] in (":", "=", ","))
    if digits.isalpha():
        return Writing.NUMBER
    if digits.isdigit():
        return Writing.LIKELY if bare else Writing.NUMBER
    if size >= _WORD_LENGTH:
        return Writing.BYTES if size > _WORD_LENGTH or alone or digits[0] == "0" or len(tokens) > 1 else Writing.LIKELY
    return Writing.LIKELY if bare or (alone and len(tokens) > 1) else Writing.NUMBER


def _numbers(text: str) -> Iterator[HexWindow]:
    """`0000000 000401 000000`, `0000000   00257   00000`: 16-bit words as `od` and `hexdump -d` write them."""
    for pattern, base in _OF_OD:
        if (match := pattern.match(text)) is not None:
            words = [int(word, base) for word in match["words"].split()]
            if max(words) <= _WORD_MOST:
                data = b"".join(word.to_bytes(2, "little") for word in words)
                yield HexWindow(data, *match.span("words"), "swapped words, octal or decimal", Writing.LIKELY)


def _loose_words(line: TextLine) -> Iterator[HexWindow]:
    """`01 03  006B   0003 74 17`: fields of one, two or more bytes, as far from one another as a person likes."""
    for match in _LOOSE.finditer(line.text):
        tokens = match[0].split()
        last = len(tokens) == _PAIR_OF_PAIRS and line.alone(*match.span())  # row of an array
        if last or len({len(token) for token in tokens}) > 1 or "  " in match[0]:
            yield HexWindow(bytes.fromhex(match[0]), *match.span(), "loose words", Writing.NUMBER)


def _prefixed(line: TextLine) -> Iterator[HexWindow]:
    """`0x11, 0x03`, `16#11`, `$11`, `&H11`, `%11`"""
    text = line.text
    for match in _PREFIXED.finditer(text):
        sign, start, end = match["sign"], match.start(), match.end()
        is_escape = sign in ("x", "X") and text[start - 1 : start] == "\\"
        if is_escape and len(match["first"]) < _BYTEA and not _is_apart(match[0]):
            continue  # a string's, in which other characters are bytes, too
        tokens = re.findall(rf"{re.escape(sign)}({H}+?)(?={re.escape(sign)}|(?!{H}))", match[0])
        if len(tokens[-1]) > 2 and len(tokens) > 2 and all(len(token) < 3 for token in tokens[:-1]):
            last = start + match[0].rfind(sign) + len(sign)
            if re.match(r"20\d\d-", text[last + 2 : last + 7]):  # the line break was lost: 0xee2026-09-11
                tokens[-1], end = text[last : last + 2], last + 2
        if any(len(token) > 2 for token in tokens):
            yield from _prefixed_words(line, match, tokens)
            continue
        level = Writing.NUMBER
        if sign not in _COMMON_SIGNS or len(tokens) > 2:
            some = len(tokens) > 1 or line.alone(start, end)
            level = Writing.BYTES if len(tokens) > 2 else Writing.LIKELY if some else Writing.NUMBER
        yield HexWindow(bytes(int(token, 16) for token in tokens), start, end, "0x", level)


def _is_apart(escapes: str) -> bool:
    r"""Whether something parts all of these escapes, `x11 \x03 \x00`, and always the same."""
    between = {escape[3:] for escape in escapes.split("\\")[:-1]}
    return len(between) == 1 and between != {""}


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
        data = bytes.fromhex("".join(re.findall(rf"({H}{{2}})[hH]", match[0])))
        yield HexWindow(data, *match.span(), "h", Writing.BYTES if len(data) > 2 else Writing.LIKELY)


def _ascii_frames(text: str) -> Iterator[HexWindow]:
    """`:1103006B00037E`, `: 11 03 00 6B 00 03 7E`"""
    for match in _ASCII.finditer(text):
        end = match.start()
        for frame in match[0][1:].split(":"):
            start, end = end, end + 1 + len(frame)
            level = Writing.NUMBER if _BITS.match(frame) else Writing.BYTES
            yield HexWindow(f":{frame}\r\n".encode(), start, end, "ascii", level, ascii=True)
    for match in _SPELLED.finditer(text):
        frame = ":" + "".join(re.findall(H, match[0]))
        yield HexWindow(f"{frame}\r\n".encode(), *match.span(), "ascii spelled", Writing.NUMBER, ascii=True)
    for match in _ASCII_APART.finditer(text):
        frame = "".join(match["frame"].split())
        if len(frame) < len(match["frame"]):  # its LRC must be right, and no bit of it may be an RTU frame
            yield HexWindow(frame.encode() + b"\r\n", *match.span("frame"), "ascii apart", Writing.NUMBER, ascii=True)
