"""How people and tools write bytes down, as a table: tokens, what stands between them, how they are decoded.

A line is cut into tokens by one rule; neighbours alike in sign and in what parts them are a run. Each row of `READINGS`
that fits all tokens of a run gives a candidate. Strings with escapes, control names and base64 have patterns of their
own. Nothing is decided here: a candidate has bits of prior, and who weighs it adds what the check values say.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from itertools import groupby, pairwise
from typing import Final, NamedTuple

H: Final = "[0-9A-Fa-f]"
_ALIKE: Final = "OoIlАВСЕаесОЗΑΒΕΟ"  # typed by hand, on a Cyrillic or a Greek keyboard, too
_LOOK_ALIKE: Final = str.maketrans(_ALIKE, "0011ABCEaec03ABE0")
_ALIKE_TOKEN: Final = re.compile(rf"(?<!\w)(?:0[xXхХ])?(?=[0-9A-Fa-f]*[{_ALIKE}])(?:[0-9A-Fa-f{_ALIKE}]{{2}})+(?!\w)")
_TOKEN: Final = re.compile(  # the one boundary rule
    r"(?:(?<![0-9A-Za-z_\u00c0-\u052f])|(?<=[0-9A-Fa-f]{2}_)(?=[0-9A-Fa-f]{2}(?:_|\b))|(?<=[0-9A-Fa-f])(?=0[xX])|(?<=[0-9A-Fa-f])(?=[xX$%]))"
    rf"(?P<sign>0[xX]|(?:[A-Z]+#)?16#|8'h|&[hH]|[$%]|(?<!\\)[xXhH]['\"]?(?={H}{{2}}(?![0-9A-Za-z]))|(?<!\\)[xX](?={H}{{2}}x)|0[bB](?=[01]{{8}}\b)|-(?=\d))?"
    rf"(?P<digits>{H}+?)(?P<end>[hH]|(?(sign)[uU]|(?!))|_?u8)?"
    r"(?:(?![0-9A-Za-z_])|(?<=[0-9A-Fa-f]{2})(?=_[0-9A-Fa-f]{2}(?:_|\b))|(?=0[xX])|(?=[xX%]"
    + H
    + r"{2})|(?<=[0-9A-Fa-f]{2})(?=[A-Z][a-z]{2})|(?=20\d\d-(?:\d\d-\d\d| )))"
)
_LONGEST_GAP: Final = 8  # characters between two bytes
_MOST: Final = 1 << 12  # tokens of a run
_MOST_FIELDS: Final = 300  # tokens of a line that may be one frame
_CELLS: Final = 12  # tokens of a line that may be a row of a table, or name the fields of a frame


class Token(NamedTuple):
    """A number of a line: what signs it, its digits, and the sign behind it."""

    start: int
    end: int
    sign: str
    digits: str
    behind: str


class Spelling(NamedTuple):
    """Characters `start` to `end` of a line read as bytes; `bits` are those that the writing alone speaks for them.

    `edges` are where its tokens begin, `sizes` how many bytes each has; `gap` is what parts them.
    """

    data: bytes
    start: int
    end: int
    writing: str
    gap: str
    bits: float
    edges: Sequence[int] = ()
    sizes: Sequence[int] = ()
    ascii: bool = False


class WritingWay(NamedTuple):
    """A way to read all tokens of a run: what each must be, how it is decoded, and its prior in bits."""

    name: str
    token: re.Pattern[str]
    decode: Callable[[str], bytes]
    prior: float
    signed: bool = False  # tokens stand behind a sign, or before one
    widths: frozenset[int] = frozenset((1, 2, 3))  # of tokens, one of which must be there


def _in_hex(digits: str) -> bytes:
    return int(digits, 16).to_bytes(1, "big")


def _swapped(digits: str) -> bytes:
    return bytes.fromhex(digits)[::-1]


def _decimal(digits: str) -> bytes:
    return (int(digits) & 0xFF).to_bytes(1, "big")


READINGS: Final = (
    WritingWay("pairs", re.compile(rf"{H}{{2}}"), bytes.fromhex, 0, widths=frozenset((2,))),
    WritingWay("signed", re.compile(rf"{H}{{1,2}}"), _in_hex, 4, signed=True, widths=frozenset((1, 2))),
    WritingWay(
        "signed words",
        re.compile(rf"(?:{H}{{2}}){{1,256}}"),
        bytes.fromhex,
        -1,
        signed=True,
        widths=frozenset(range(2, 515, 2)),
    ),
    WritingWay("swapped signed words", re.compile(rf"{H}{{4}}"), _swapped, -7, signed=True, widths=frozenset((4,))),
    WritingWay("words", re.compile(rf"(?:{H}{{2}})+"), bytes.fromhex, -3, widths=frozenset(range(2, 515, 2))),
    WritingWay("swapped words", re.compile(rf"{H}{{4}}"), _swapped, -7, widths=frozenset((4,))),
    WritingWay("reversed words", re.compile(rf"(?:{H}{{2}}){{1,4}}"), _swapped, -8, widths=frozenset((8,))),
    WritingWay("digits", re.compile(rf"{H}{{1,2}}"), _in_hex, -3, widths=frozenset((1,))),
    WritingWay("decimals", re.compile(r"25[0-5]|2[0-4]\d|[01]?\d?\d"), _decimal, -3),
    WritingWay(
        "negatives",
        re.compile(r"-(?:12[0-8]|1[01]\d|\d?\d)|1[01]\d|12[0-7]|\d?\d"),
        _decimal,
        -3,
        widths=frozenset((1, 2, 3)),
    ),
    WritingWay("bits", re.compile(r"[01]{8}"), lambda digits: bytes((int(digits, 2),)), -1, widths=frozenset((8,))),
    WritingWay(
        "decimal words",
        re.compile(r"[0-6]\d{4}"),
        lambda digits: (int(digits) & 0xFFFF).to_bytes(2, "little"),
        -8,
        widths=frozenset((5,)),
    ),
    WritingWay(
        "octal words",
        re.compile(r"[01][0-7]{5}"),
        lambda digits: int(digits, 8).to_bytes(2, "little"),
        -8,
        widths=frozenset((6,)),
    ),
    WritingWay(
        "octal", re.compile(r"[0-3][0-7]{2}"), lambda digits: bytes((int(digits, 8),)), -7, widths=frozenset((3,))
    ),
)
_STRING: Final = re.compile(
    r"(?:[\"'](?=[^\"'\n]{0,400}\\|[ -~]{3,40}[\"']|(?<=[\"'])[^\"'\n][\"'])(?:[^\"'\\\n]|\\.){1,4096}[\"'])|"
    r"(?:\\(?:x[0-9A-Fa-f]{2}|u00[0-9A-Fa-f]{2}|[0-7]{1,3}|[abtnvfr0\\])[ -!#-&(-\[\]-~]?){2,4096}"
)
_ESCAPE: Final = re.compile(
    r"\\(?:x(?P<hex>[0-9A-Fa-f]{2})|u00(?P<u>[0-9A-Fa-f]{2})|(?P<oct>[0-7]{1,3})|(?P<one>.))|(?P<char>.)", re.DOTALL
)
_ESCAPE_PLAIN: Final = re.compile(  # Rust, Java: `\\0` is a whole escape
    r"\\(?:x(?P<hex>[0-9A-Fa-f]{2})|u00(?P<u>[0-9A-Fa-f]{2})|u\{(?P<oct>\d)\}|(?P<one>.))|(?P<char>.)", re.DOTALL
)
_CODE: Final = re.compile(r"\\[0-9A-F]{2}")  # LabVIEW
_CODES: Final = re.compile(r"(?:[!-\[\]-~]|\\[0-9A-F]{2}|\\[snrt\\]){3,300}")
_CODE_OR_CHAR: Final = re.compile(r"\\([0-9A-F]{2})|\\([snrt\\])|(.)")
_ONES: Final = {"0": 0, "a": 7, "b": 8, "t": 9, "n": 10, "v": 11, "f": 12, "r": 13, "e": 27}
_ASCII: Final = re.compile(rf"(?<![0-9A-Za-z_]):(?:{H}{{2}}){{3,300}}(?![0-9A-Za-z_])")
_BASE64: Final = re.compile(
    r"(?<![\w+/])(?:[A-Za-z0-9+/]{4}){1,400}(?:[A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?(?![\w+/=])"
)
_CONTROLS: Final = (
    "NUL SOH STX ETX EOT ENQ ACK BEL BS HT LF VT FF CR SO SI DLE DC1 DC2 DC3 DC4 NAK SYN ETB CAN EM SUB ESC FS GS RS US"
)
_NAMES: Final = {name: code for code, name in enumerate(_CONTROLS.split())} | {"TAB": 9, "DEL": 127}
_NAMED: Final = re.compile(
    rf"(?:[<\[{{(](?:{'|'.join(_NAMES)}|{H}{{2}})[>\]}})][ -~]?(?=[<\[{{(]|\s|$)){{3,}}|"
    rf"(?<![A-Z])(?:(?:{'|'.join(_NAMES)})[ ,]{{1,2}}(?:{H}{{2}} )*){{2,}}"
)


def tokens_of(text: str) -> list[Token]:
    """The numbers of a line, in order."""
    return [
        Token(match.start(), match.end(), match["sign"] or "", match["digits"], match["end"] or "")
        for match in _TOKEN.finditer(text)
    ]


def runs_of(text: str, tokens: Sequence[Token]) -> Iterator[tuple[Sequence[Token], str]]:
    """Neighbours alike in their sign and in what stands between them; where that changes, one token is of both runs."""
    first = 0
    gap: str | None = None
    for i in range(1, len(tokens) + 1):
        bare = None
        if i < len(tokens):
            one, other = tokens[i - 1], tokens[i]
            between = text[one.end : other.start]
            alike = one.sign.lower() == other.sign.lower() or "-" in (one.sign, other.sign)
            alike = alike and (between == "." or not (_is_fraction(text, one) or _is_fraction(text, other)))
            if alike and len(between) <= _LONGEST_GAP and not _apart(between):
                bare = _SHOWN.sub("", between).strip()
                bare = "" if bare == "-" and gap == "" and between == " - " else bare
                if gap in (None, bare) and i - first < _MOST:
                    gap = bare
                    continue
        yield tokens[first:i], gap or ""
        first, gap = (i, None) if bare is None or i - first < 2 else (i - 1, bare)


_SHOWN: Final = re.compile(r"[\[('\"][^\w\s][\])'\"]|[\[(][ -~][\])]")  # `01 [.] 03 [/]`


def _is_fraction(text: str, token: Token) -> bool:
    """Whether a number is part of one with a point: `12.4`."""
    behind, before = text[token.end : token.end + 2], text[max(token.start - 2, 0) : token.start]
    return (behind[:1] == "." and behind[1:].isdigit()) or (before[1:] == "." and before[:1].isdigit())


def _alternating(text: str, tokens: Sequence[Token]) -> Iterator[Sequence[Token]]:
    """`0:0x11 1:0x03`, `5(05) 5(05)`: every second number of a list in which two signs alternate."""
    gaps = [text[one.end : other.start].strip() for one, other in pairwise(tokens)]
    for first in range(min(3, len(gaps))):
        here = gaps[first:]
        if len(here) < 7:
            return
        same = next((i for i in range(2, len(here)) if here[i] != here[i - 2]), len(here))
        if same >= 7 and here[0] != here[1]:
            some = tokens[first : first + same + 1]
            yield some[::2]
            yield some[1::2]
            return


def _apart(bare: str) -> bool:
    """Whether what stands between two numbers parts them for good."""
    return any(char.isalnum() for char in bare) or bare in ("...", "…", "->", "=>", "<-", "→", "←", "==", "!=")


def candidates_in(text: str) -> tuple[list[Spelling], Sequence[Token]]:
    """The ways to read runs of characters of a line as bytes, and its tokens."""
    if _ALIKE_TOKEN.search(text):
        text = _ALIKE_TOKEN.sub(_in_plain, text)
    found: list[Spelling] = []
    tokens = tokens_of(text)
    for run, gap in runs_of(text, tokens):
        found.extend(_of_run(text, run, gap))
    if "\\" in text or "'" in text or '"' in text:
        found.extend(_strings(text))
    if ":" in text:
        found.extend(
            Spelling(
                match[0].encode() + b"\r\n", *match.span(), "ascii", "",
                -1 if text[match.start() - 1 : match.start()] in ("", " ", "\t", ":") else -8,
                ascii=True,
            )
            for match in _ASCII.finditer(text)
        )  # fmt: skip
    return found, tokens


def _in_plain(match: re.Match[str]) -> str:
    """A number typed with letters that look like its digits; a word stays one."""
    digits = any(map(str.isdigit, match[0])) or match[0] == "OO" or (not match[0].isascii() and match[0].isupper())
    return match[0].translate(_LOOK_ALIKE) if digits else match[0]


def more_in(text: str, tokens: Sequence[Token]) -> Iterator[Spelling]:
    """What a line may hold besides its runs: bytes of columns and fields, and rarer writings."""
    if len(tokens) <= _CELLS:
        for run, _ in runs_of(text, tokens):
            if len(run) > 1:
                for token in run:
                    yield from _of_run(text, (token,), "")
    if len(tokens) <= _MOST_FIELDS:
        yield from _fields(tokens)
    for some in _alternating(text, tokens):
        yield from _of_run(text, some, ",")
    yield from _others(text)
    yield from _cells(text)


def _of_run(text: str, run: Sequence[Token], gap: str) -> Iterator[Spelling]:
    first = run[0]
    signed = bool((first.sign and first.sign != "-") or first.behind) and first.sign[:2].lower() != "0b"
    if first.behind and len(run) == 1 and first.digits.isalpha() and first.digits.islower():
        return  # `each`
    words = [token.digits for token in run]
    widths = {*map(len, words)}
    for reading in READINGS:
        if reading.signed != signed or widths.isdisjoint(reading.widths):
            continue
        if reading.name == "negatives":
            words = [f"{token.sign}{token.digits}" for token in run]
        fits = [reading.token.fullmatch(word) is not None for word in words]
        if all(fits):
            places = [(0, len(run))]
        elif any(fits):
            groups = [(fit, [*group]) for fit, group in groupby(range(len(run)), fits.__getitem__)]
            places = [(group[0], group[-1] + 1) for fit, group in groups if fit]
        else:
            continue
        for begin, end in places:
            for low, high in _stretches(text, run, begin, end):
                if _is_told_apart(reading.name, words[low:high]):
                    yield _candidate(
                        reading, run[low:high], words[low:high], gap, -3 if high - low < end - begin else 0
                    )


def _candidate(reading: WritingWay, run: Sequence[Token], words: Sequence[str], gap: str, more: float) -> Spelling:
    parts = [reading.decode(word) for word in words]
    bits = reading.prior + _bits_of(reading.name, words, gap) + more
    return Spelling(
        b"".join(parts), run[0].start, run[-1].end, reading.name, gap, bits,
        [token.start for token in run], [len(part) for part in parts],
    )  # fmt: skip


def _stretches(text: str, run: Sequence[Token], first: int, last: int) -> Iterator[tuple[int, int]]:
    """A run as it is; also from its first wide gap on, and up to its last one: there columns may begin and end."""
    yield first, last
    if last - first < 3:
        return
    if run[first].digits.isalpha() and text[run[first].end : run[first].end + 1] == " ":
        yield first + 1, last
    gaps = [text.count(" ", run[i - 1].end, run[i].start) for i in range(first + 1, last)]
    if len(gaps) > 1 and (usual := sorted(gaps)[len(gaps) // 2]) < max(gaps):
        wide = [first + 1 + i for i, size in enumerate(gaps) if size > usual]
        yield wide[0], last
        yield first, wide[-1]
        if len(wide) > 1:
            yield wide[0], wide[-1]


def _fields(tokens: Sequence[Token]) -> Iterator[Spelling]:
    """`ID=01 FC=03 ADDR=0000 CRC=C5CD`, `0:0x11 1:0x03`, `01 03 00 00 CRC=0xC5CD`: all numbers of a line as one."""
    if not len(tokens) >= 2:
        return
    bare = [token for token in tokens if token.digits.upper() not in ("FC", "ID")]
    counted = [token.digits for token in tokens[::2]] in (
        [str(i) for i in range(first, first + (len(tokens) + 1) // 2)] for first in (0, 1)
    )
    if counted and len(tokens) % 2 == 0:
        yield from _of_fields(tokens[1::2], -3)
        return
    yield from _of_fields(tokens, -5)
    if len(bare) < len(tokens):
        yield from _of_fields(bare, -6)


def _of_fields(some: Sequence[Token], prior: float) -> Iterator[Spelling]:
    for first in range(min(3, len(some) - 1)):
        left = some[first:]
        words = [f"0{token.digits}" if len(token.digits) == 1 else token.digits for token in left]
        if any(len(word) % 2 for word in words) or not 3 <= sum(map(len, words)) // 2 <= 260:
            continue
        starts, sizes = [token.start for token in left], [len(word) // 2 for word in words]
        data = bytes.fromhex("".join(words))
        yield Spelling(data, starts[0], left[-1].end, "fields", "", prior - first, starts, sizes)
        if sizes[-1] == 2:
            swapped = data[:-2] + data[:-3:-1]
            yield Spelling(
                swapped,
                starts[0],
                left[-1].end,
                "fields, check value high byte first",
                "",
                prior - first - 1,
                starts,
                sizes,
            )


def _is_told_apart(name: str, words: Sequence[str]) -> bool:
    """Whether a reading of these words is another than the plainer ones above it."""
    widths = {len(word) for word in words}
    if name == "digits":
        return 1 in widths
    if name in ("words", "signed words"):
        return max(widths) > 2
    if name == "reversed words":
        return len(words) > 1 and max(widths) == 8
    if name == "swapped words":
        return len(words) > 1 or widths == {4}
    if name == "negatives":
        return any(word[0] == "-" for word in words)
    return True


def _bits_of(name: str, words: Sequence[str], gap: str) -> float:
    """What the digits themselves speak for bytes."""
    count = len(words)
    odd = sum(word[0] == "0" or not word.isdigit() for word in words)
    if name == "pairs":
        bits = (-5, -4, -1.5)[count] if count < 3 else 1 + min(count, 8) / 2
        bits += 2 if odd and count > 2 else -5 if 2 < count < 5 else -2
        bits -= 5 if all(word.isalpha() for word in words) and count < 4 else 0
        return bits - _of_gap(gap, count)
    if name == "signed":
        return (-9, -5, -2)[count] if count < 3 else 1 + min(count, 8) / 4
    if name in ("words", "signed words"):
        size = sum(map(len, words)) // 2
        digits = "".join(words)
        bits = min(size, 12) / 2 - 2 if size > 3 else -3
        if digits.isalpha() or digits.isdigit():
            bits -= 3
        if {*map(len, words)} == {8}:  # addresses
            bits -= 6
        return bits - _of_gap(gap, count)
    if name in ("decimals", "digits", "negatives"):
        bits = -2 if count < 4 else min(count, 8) / 4
        return bits - (2 if name == "digits" and not odd else 0) - _of_gap(gap, count)
    return 0 if count > 2 else -3


def _of_gap(gap: str, count: int) -> float:
    """Against: dates, addresses, clocks, names are parted so."""
    if gap in (".", "/") and count < 5:
        return 5
    if gap == "." and count < 7:
        return 1
    if gap == ":":
        return 5 if count < 4 else 4 if count == 6 else 0
    if gap == "-" and count <= 6:
        return 3 if count < 6 else 8
    return -1.5 if gap[:1] in ("]", ">", "}", ")") else 0


def unescaped(text: str, octal: bool = True) -> bytes:
    """The bytes of a string with escapes; characters beyond Latin-1 are left out."""
    out = bytearray()
    for match in (_ESCAPE if octal else _ESCAPE_PLAIN).finditer(text):
        if (digits := match["hex"] or match["u"]) is not None:
            out.append(int(digits, 16))
        elif match["oct"] is not None:
            out.append(int(match["oct"], 8) & 0xFF)
        elif match["one"] is not None:
            out.append(_ONES.get(match["one"], ord(match["one"]) & 0xFF))
        elif ord(match["char"]) < 256:
            out.append(ord(match["char"]))
    return bytes(out)


def _strings(text: str) -> Iterator[Spelling]:
    """Quoted characters and escapes: what a program prints of a string of bytes."""
    for match in _STRING.finditer(text):
        inner = match[0][1:-1] if match[0][0] in "\"'" else match[0]
        escapes = inner.count("\\")
        ways = dict.fromkeys([unescaped(inner), unescaped(inner, octal=False)])
        for data in ways:
            if not data or (not escapes and len(data) == 2):
                continue
            share = escapes / len(data)
            bits = 3 if escapes > 1 and share > 0.3 else 0 if escapes > 1 else -8
            if "\\n" in inner and share < 0.3:
                bits = -8
            yield Spelling(data, *match.span(), "string", "", bits)
        parts = inner.split("\\")
        if (
            escapes
            and not parts[0]
            and all(len(part) == 3 and part.isdigit() and int(part) < 256 for part in parts[1:])
        ):
            yield Spelling(bytes(map(int, parts[1:])), *match.span(), "decimal escapes", "", -1)  # as Lua writes them
    if _CODE.search(text):
        for match in _CODES.finditer(text):
            data = bytes(
                int(one[1], 16)
                if one[1]
                else {"s": 32, "n": 10, "r": 13, "t": 9, "\\": 92}.get(one[2], 0)
                if one[2]
                else ord(one[3]) & 0xFF
                for one in _CODE_OR_CHAR.finditer(match[0])
            )
            yield Spelling(data, *match.span(), "codes", "", 0)


def _others(text: str) -> Iterator[Spelling]:
    for match in _BASE64.finditer(text):
        word = match[0]
        if len(word) < 8:
            continue
        if (
            any(map(str.isdigit, word))
            or "=" in word
            or "+" in word
            or (not word.islower() and not word.isupper() and not word.istitle())
        ):
            from binascii import a2b_base64

            yield Spelling(a2b_base64(word), *match.span(), "base64", "", -8)
    for match in _NAMED.finditer(text):
        data = bytearray()
        for name in re.findall(r"[A-Z]+\d?|[0-9A-Fa-f]{2}", match[0]):
            if name in _NAMES:
                data.append(_NAMES[name])
            elif len(name) == 2:
                data.append(int(name, 16))
        yield Spelling(bytes(data), *match.span(), "names", "", -1)


_OD: Final = re.compile(r"[0-7]{7}|[0-9a-f]{7}")
_CELL: Final = re.compile(r" (?: {0,2}\\[0abtnvfr]| {2}[ -~]|[0-3][0-7]{2})")
_CARET: Final = re.compile(r"(?:M-)?\^[@-_?]|M-[ -~]|[!-\]_-~]")
_CARETS: Final = re.compile(r"(?:(?:M-)?\^[@-_?]|M-[ -~]|[!-\]_-~]){4,520}")


def _cells(text: str) -> Iterator[Spelling]:
    """A row of `od -c`, and what `cat -v` shows."""
    match = _OD.match(text)
    cells = [] if match is None else _CELL.findall(text, match.end())
    if match is not None and cells and (match.end() + sum(map(len, cells)) == len(text.rstrip()) or len(cells) > 7):
        data = bytes(
            int(cell, 8) if cell.strip().isdigit() and len(cell.strip()) == 3
            else _ONES.get(cell.strip()[1:], 0) if cell.strip()[:1] == "\\" and len(cell.strip()) == 2
            else ord(cell[-1])
            for cell in cells
        )  # fmt: skip
        yield Spelling(data, match.end() + 1, len(text.rstrip()), "od -c", "", 0, [match.end() + 1], [len(data)])
    if text.count("^") > 1:
        for match in _CARETS.finditer(text):
            data = bytes(map(_of_caret, _CARET.findall(match[0])))
            yield Spelling(data, *match.span(), "carets", "", -2)


def _of_caret(shown: str) -> int:
    high = 128 if shown.startswith("M-") else 0
    low = shown[2:] if high else shown
    return high + (127 if low == "^?" else ord(low[1]) & 0x1F if len(low) == 2 else ord(low))


def shows(data: bytes, text: str) -> bool:
    """Whether a text is these bytes as characters, with dots or the like for those that have none."""
    text = text.strip("\r\n|<> \t") if len(text.rstrip()) > len(data) else text.rstrip("\r\n")
    if len(text) == len(data) + 1 and len(data) > 8 and text[8] == " ":
        text = text[:8] + text[9:]
    text = text.ljust(len(data))
    if len(text) != len(data):
        return False
    return all(
        char == chr(byte) or (char == "." if 0x20 < byte < 0x7F else not (char.isascii() and char.isalnum()))
        for byte, char in zip(data, text, strict=True)
    )


def counts_up(data: bytes) -> bool:
    """Whether these are small numbers, each more than that before it."""
    return len(data) > 3 and data[-1] < 0x20 and all(one < after for one, after in pairwise(data))
