"""Runs of digits that may be bytes: hex in pairs, words or behind signs, decimals, digits run together.

A line is searched for all writings at once; what they give are candidates, which may overlap (`10 20 30 40` is hex or
decimal). Who chooses between candidates is `captures.text.choosing`.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import takewhile
from string import hexdigits
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
from .escapes import escaped_candidates
from .writings import HEX_ROWS, OTHER_ROWS, of_rows

_LONG: Final = 1 << 16  # characters: writings without hex pairs are not looked for in a longer line
_SOME: Final = 3  # bytes: fewer say nothing
_LEAST_BYTES: Final = 4
_STAMPED: Final = 8  # characters: no time before bytes is shorter
_TWO_PAIRS: Final = 4  # characters
_WORDY: Final = 4  # pairs that name a function code: `unit 01 fc 03`
_MAC_LENGTH: Final = 6  # bytes
_BYTEA: Final = 8  # digits behind one `\\x`, as databases write bytes
_WORD_LENGTH: Final = 8  # bytes: no address of a machine is longer
_MOST_WAYS: Final = 1000  # to part digits, over which a check value says too little
_COMMON_SIGNS: Final = ("%", "$", "x", "X", "h", "H")
_BEFORE_BYTES: Final = tuple(":=[({])}><")
_GLUED: Final = (
    rf"(?:{END}|(?=[A-Za-z]{{0,31}}[g-zG-Z])(?=[A-Za-z]{{2}})|(?=\d{{4}}-\d\d-\d\d))"  # to a word, to a date
)
_SIGN: Final = (  # C, PLC languages, Pascal, Basic, URLs, Verilog
    r"(?:0[xX]|(?:[A-Z]+#)?16#|\$|&[hH]|%|8'[hH]|[XxHh]['\"]?)"
)
_FRACTION: Final = r"(?!\.\d{1,3}(?:[\s)]|[mµu]?s))"  # `10.5ms` behind bytes
_BETWEEN: Final = r"(?:[\s,;|'\"\\]{0,4}|[-:/.]|\][ \t]?\[|>[ \t]?<|\}[ \t]?\{|\)[ \t]?\()"  # of signed bytes
_UP_TO_SIGN: Final = rf"{H}+?(?=(?P=sign)|(?!{H}))"  # the next byte's, which may begin with a digit
_PAIRS, _SIGNED, _WORDS, _PREFIXED, _DECIMALS, _RUN_TOGETHER = (
    re.compile(pattern)
    for pattern in (
        rf"{EDGE}{H}{{2}}(?:[ \t]{{1,4}}{H}{{2}})*{_FRACTION}{_GLUED}",
        rf"{EDGE}{H}{{2}}(?P<gap>[ \t]{{0,2}}[^\w\s][^\w\n]{{0,5}}|_){H}{{2}}(?:(?P=gap){H}{{2}})*{_GLUED}",
        rf"(?:(?<![0-9A-Za-z_.#@])|(?<=[A-Za-z]#))"  # `TX#1103006B`
        rf"(?:{H}{{2}}){{2,}}(?:(?P<gap>[ \t]{{1,2}})(?:{H}{{2}})+(?:(?P=gap)(?:{H}{{2}})+)*)?{_FRACTION}{_GLUED}",
        rf"{EDGE}(?P<sign>{_SIGN})(?P<first>{_UP_TO_SIGN})[uU]?['\"]?"
        rf"(?:{_BETWEEN}(?P=sign){_UP_TO_SIGN}[uU]?['\"]?)*{_GLUED}",
        r"(?<![\w.+-])(?:-?\d{1,3}(?:[ \t]{1,8}-?\d{1,3}){3,}+|"
        r"-?\d{1,3}[ \t]*(?P<sign>[,;|:./#]|\][ \t]?\[|>[ \t]?<|\}[ \t]?\{|[\"'],[ \t]?[\"'])[ \t]{0,4}"
        r"-?\d{1,3}(?:[ \t]*(?P=sign)[ \t]{0,4}-?\d{1,3}){2,}+|"
        r"\d{1,3}(?P<dash>-)\d{1,3}(?:-\d{1,3}){2,}+)",
        rf"{EDGE}{H}{{8,24}}{END}",
    )
)
_NUMBER, _GAP, _MINUTE, _GOES_ON, _OF_YEAR = (
    re.compile(pattern)
    for pattern in (
        r"-?\d+", r"[ \t]+", r"(?:[01]\d|2[0-3]):[0-5]\d", r"\w|[.,]\d|-\d", r"20\d\d-",
    )
)  # fmt: skip


def hex_candidates(line: TextLine) -> Iterator[HexWindow]:
    """All runs of characters that can be hex bytes, writing by writing."""
    yield from _pairs(line)
    yield from _signed(line)
    yield from _words(line)
    yield from _prefixed(line)
    yield from of_rows(HEX_ROWS, line.text)


def other_candidates(line: TextLine) -> Iterator[HexWindow]:
    """All runs of characters that can be bytes and are no hex pairs."""
    if len(line.text) <= _LONG:
        yield from escaped_candidates(line.text)
        yield from _decimals(line.text)
        yield from of_rows(OTHER_ROWS, line.text)


def _pairs(line: TextLine) -> Iterator[HexWindow]:
    """`11 03 00 6B`"""
    text = line.text
    for match in _PAIRS.finditer(text):
        start, end = match.span()
        tokens = match[0].split()
        glued = text[end : end + 1].isalnum()
        if len(tokens) < _SOME and (len(text) > LONG or glued):
            continue  # one number of many, or the beginning of a word
        data = bytes.fromhex(match[0])
        level = _level(line, start, end, tokens)
        if len(tokens) > _SOME:  # what stands at the ends may be a word, or a number in a column of its own
            second = text.index(tokens[1], start + 2)
            if _is_apart(line, start, second, match[0], tokens):
                yield HexWindow(data[1:], second, end, "pairs", level)
            if glued:  # "02Connected", "10 after"
                yield HexWindow(data[:-1], start, start + len(match[0][:-2].rstrip()), "pairs", level)
        yield HexWindow(data, start, end, "pairs", level)


def _is_apart(line: TextLine, start: int, second: int, shown: str, tokens: Sequence[str]) -> bool:
    """Whether the first pair stands farther off than the others, counts them, or is a word."""
    (usual, _), *_ = Counter(_GAP.findall(shown, second - start)).most_common(1)
    counts = tokens[0].isdigit() and int(tokens[0]) == len(tokens) - 1  # `OUT 10 01 03 00 ...`: so many bytes
    word = tokens[0].isalpha() and not line.alone(start, start + len(shown))
    return (
        line.text[start + 2 : second] != usual
        or (counts and start >= _STAMPED)  # which nothing but bytes cannot say
        or (word and not _begins_bytes(line.before(start)))
    )


def _begins_bytes(before: str) -> bool:
    """Whether nothing but a byte is to be expected behind this: a sign, or the offset of a row."""
    return before.rstrip()[-1:] in _BEFORE_BYTES or offset_at_the_end(before) is not None


def _level(line: TextLine, start: int, end: int, tokens: list[str]) -> Writing:
    """Three pairs are bytes where any can be no number that people write: it has a letter, or a leading zero."""
    digits, some = "".join(tokens), len(tokens) >= _SOME
    if (digits.isalpha() and any(map(str.istitle, tokens))) or is_ruler(tokens):  # `Be Ad`
        return Writing.NUMBER
    if some and start not in line.first and _is_list(tokens):
        return Writing.NUMBER
    numbers = _are_numbers(tokens)
    if not some:
        number = len(tokens) == 1 and numbers and start != line.begin  # `read 89`
        return Writing.LIKELY if line.alone(start, end) and not number else Writing.NUMBER
    return Writing.LIKELY if numbers else Writing.BYTES


def _are_numbers(tokens: Sequence[str]) -> bool:
    """Whether these may be words, or numbers as people write them."""
    digits = "".join(tokens)
    return digits.isalpha() or (digits.isdigit() and all(token[0] != "0" for token in tokens))


def _is_list(tokens: list[str]) -> bool:
    """Whether these are functions by their names or their numbers: `unit 01 fc 03`, `functions 01 02 03 05 0F 10`."""
    return "fc" in map(str.lower, tokens[:2]) if len(tokens) <= _WORDY else counts_up(bytes.fromhex("".join(tokens)))


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
        if len(tokens) < _SOME and text[end : end + 1].isalnum():
            continue  # `00;Fault`: the beginning of a word
        data = bytes.fromhex("".join(tokens))
        level = _level_of_signed(tokens, gap.strip())
        if (match.start() not in line.first and counts_up(data)) or _MINUTE.fullmatch(match[0]):
            level = Writing.NUMBER  # a list of other numbers, `10:15`
        elif line.alone(match.start(), end):
            level = max(level, Writing.LIKELY)
        yield HexWindow(data, match.start(), end, f"pairs{gap.strip()}", level)


def _level_of_signed(tokens: list[str], gap: str) -> Writing:
    if gap in "/." or is_ruler(tokens):
        return Writing.NUMBER  # a date, an address, a version
    if len(tokens) + (not "".join(tokens).isdigit()) <= _SOME:
        return Writing.NUMBER
    address = gap == ":" and len(tokens) == _MAC_LENGTH
    return Writing.LIKELY if address or ("".join(tokens).isdigit() and _are_numbers(tokens)) else Writing.BYTES


def _words(line: TextLine) -> Iterator[HexWindow]:
    """`1103006B`, `1103 006B`: digits without signs between the bytes; of 16-bit words the other order, too."""
    for match in _WORDS.finditer(line.text):
        start, end = match.span()
        tokens = match[0].split()
        if match[0].upper() in DIGITS_ABOVE:
            continue
        data, level = bytes.fromhex("".join(tokens)), _level_of_words(line, start, end, tokens)
        if len(tokens) > 1 and line.text[end : end + 1].isalnum():  # "0A3843 after"
            last = start + len(match[0][: -len(tokens[-1])].rstrip())
            yield HexWindow(data[: -len(tokens[-1]) // 2], start, last, "words", level)
        yield from _both_orders(tokens, (start, end), "words", level)
        if len(tokens) > 1 and all(len(token) == 8 for token in tokens[:-1]):
            parts = (bytes.fromhex(token)[::-1] for token in tokens)
            yield HexWindow(b"".join(parts), start, end, "swapped words", Writing.NUMBER)


def _both_orders(tokens: list[str], place: tuple[int, int], shape: str, level: Writing) -> Iterator[HexWindow]:
    """Words as they stand; those of 16 bits with their bytes the other way round, too."""
    data = bytes.fromhex("".join(tokens))
    yield HexWindow(data, *place, shape, level)
    if all(len(token) == 4 for token in tokens):
        yield HexWindow(swapped(data), *place, f"swapped {shape}", Writing.NUMBER)


def _level_of_words(line: TextLine, start: int, end: int, tokens: list[str]) -> Writing:
    digits, size = "".join(tokens), sum(map(len, tokens)) // 2
    quote = line.text[start - 1 : start]
    quoted = quote in ("'", '"') and line.text[end : end + 1] == quote
    bare = line.alone(start, end) or (quoted and line.alone(max(start - len("b'"), 0), end))
    if digits.isalpha():
        return Writing.NUMBER
    if digits.isdigit() or size < _WORD_LENGTH:
        ends = end >= line.last and line.before(start).rstrip()[-1:] in (":", "=", ",")
        return Writing.LIKELY if bare or (ends and len(tokens) > 1 and not digits.isdigit()) else Writing.NUMBER
    return Writing.BYTES


def _prefixed(line: TextLine) -> Iterator[HexWindow]:
    """`0x11, 0x03`, `16#11`, `$11`, `&H11`, `%11`"""
    text = line.text
    for match in _PREFIXED.finditer(text):
        sign, start, end = match["sign"], match.start(), match.end()
        is_escape = sign in ("x", "X") and text[start - 1 : start] == "\\"
        if is_escape and len(match["first"]) < _BYTEA and not _are_parted(match[0]):
            continue  # a string's, in which other characters are bytes, too
        tokens = ["".join(takewhile(hexdigits.__contains__, part)) for part in match[0].split(sign)[1:]]
        last = match[0].rfind(sign) + len(sign)
        if len(tokens) > 2 and _OF_YEAR.match(match[0] + text[end : end + 1], last + 2):
            tokens[-1], end = match[0][last : last + 2], start + last + 2  # a line break was lost: 0xee2026-09-11
        if any(len(token) > 2 for token in tokens):
            yield from _prefixed_words(line, match, tokens)
            continue
        few = sign not in _COMMON_SIGNS and (len(tokens) > 1 or line.alone(start, end))
        level = Writing.BYTES if len(tokens) >= _SOME else Writing.LIKELY if few else Writing.NUMBER
        yield HexWindow(bytes(int(token, 16) for token in tokens), start, end, "0x", level)


def _are_parted(escapes: str) -> bool:
    r"""Whether something parts all of these escapes, `x11 \x03 \x00`, and always the same."""
    between = {escape[3:] for escape in escapes.split("\\")[:-1]}
    return len(between) == 1 and between != {""}


def _prefixed_words(line: TextLine, match: re.Match[str], tokens: list[str]) -> Iterator[HexWindow]:
    if any(len(token) % 2 for token in tokens):
        return
    alone = line.alone(*match.span()) and sum(map(len, tokens)) > 2 * _SOME
    yield from _both_orders(tokens, match.span(), "0x words", Writing.LIKELY if alone else Writing.NUMBER)


def _decimals(text: str) -> Iterator[HexWindow]:
    """`17, 3, 0, 107`, `[17 3 0 107]`, `[17][3]`, `17-3-0`; negative ones as Java has them."""
    for match in _DECIMALS.finditer(text):
        end = _list_end(text, *match.span())
        shown = text[match.start() : end]
        values = [int(word) for word in _NUMBER.findall(shown.replace("-", " ") if match["dash"] else shown)]
        if len(values) >= _LEAST_BYTES and max(values) < 256 and min(values) > -129:
            node = text[: match.start()].endswith(('"data":[', '"data": ['))  # of Node.js
            level = Writing.BYTES if node else Writing.NUMBER
            data = bytes(value & 0xFF for value in values)
            if data[0] == len(data) - 1:  # so many bytes
                second = text.index(str(values[1]), match.start() + len(str(values[0])))
                yield HexWindow(data[1:], second, end, "decimal", level)
            yield HexWindow(data, match.start(), end, "decimal", level)


def _list_end(text: str, start: int, end: int) -> int:
    """Where a list of numbers ends: its last may be part of a word; of one that goes on with others nothing is left."""
    if _GOES_ON.match(text, end) is None:
        return end
    end = start + len(text[start:end].rstrip("0123456789"))
    while not text[end - 1].isdigit():  # there are others before it
        end -= 1
    return start if _GOES_ON.match(text, end) is not None else end


def run_together(line: TextLine) -> Iterator[HexWindow]:
    """`11 3 0 6B 0 3 76 87` without the blanks, as `Serial.print(byte, HEX)` writes bytes: each way to part the digits.

    Only behind a mark, or where nothing stands before them.
    """
    for match in _RUN_TOGETHER.finditer(line.text):
        if match.start() not in line.first:
            continue
        digits = match[0]
        ways: list[list[bytes]] = [[b""], *([] for _ in digits)]  # of the first so many digits
        for at, digit in enumerate(digits):
            if len(ways[at]) > _MOST_WAYS:
                return
            for end in range(at + 1, min(at + (2 if digit == "0" else 3), len(digits) + 1)):
                octet = bytes((int(digits[at:end], 16),))
                ways[end] += [way + octet for way in ways[at]]
        for data in ways[-1] if len(ways[-1]) <= _MOST_WAYS else ():
            yield HexWindow(data, *match.span(), "run together", Writing.NUMBER)
