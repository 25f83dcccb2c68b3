"""Runs of bytes that are written otherwise than in hex pairs: decimals, single digits, strings with escapes, base64.

But for strings with `\\x` and the arrays of Node.js they are bytes only where a check value says so: `10, 20, 30, 40`
may be anything.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator
from typing import Final

from .candidates import EDGE, END, LOOK_ALIKE, MISTYPED, H, HexWindow, TextLine, Writing

LOOK_ALIKES: Final = "look-alikes"
_LONG: Final = 1 << 16  # characters: these shapes are not looked for in a longer line
_ESCAPES: Final = re.compile(r"\\(?:x[0-9A-Fa-f]{2}|u00[0-9A-Fa-f]{2}|[ux]\{[0-9A-Fa-f]{1,2}\}|\d{1,3})")
_QUOTE: Final = re.compile(r"\\.|([\"'])", re.DOTALL)
_INNER: Final = re.compile(r"\\([\"'])(.*?)\\\1")  # within another string
_BARE: Final = re.compile(r"\\[xu\d]\S*(?: (?=\S{0,20}\\(?:x|\d{3}))\S*)*")
_HALF: Final = re.compile(r"\\x(?![0-9A-Fa-f]{2}|\{)")
_ESCAPE: Final = re.compile(
    r"\\(?:x([0-9A-Fa-f]{1,2})|u00([0-9A-Fa-f]{2})|[ux]\{([0-9A-Fa-f]{1,2})\}|([0-7]{1,3})|(.))|([^\\])", re.DOTALL
)
_DECIMAL_ESCAPE: Final = re.compile(r"()()()\\(\d{1,3})|\\(.)|([^\\])", re.DOTALL)
_SIMPLE_ESCAPES: Final = {"0": 0, "a": 7, "b": 8, "t": 9, "n": 10, "v": 11, "f": 12, "r": 13, "e": 27, "s": 32}
_WORD: Final = 300  # characters before an escape that may be bytes, too
_DECIMALS: Final = (
    re.compile(r"(?<![\w.+-])-?\d{1,3}(?:[ \t]{1,8}-?\d{1,3}){3,}+"),
    re.compile(
        r"(?<![\w.+-])-?\d{1,3}[ \t]*(?P<sign>[,;|:./#]|\][ \t]?\[|>[ \t]?<|\}[ \t]?\{|[\"'],[ \t]?[\"'])[ \t]{0,4}"
        r"-?\d{1,3}(?:[ \t]*(?P=sign)[ \t]{0,4}-?\d{1,3}){2,}+"
    ),
    re.compile(r"(?<![\w.+-])\d{1,3}(?P<dash>-)\d{1,3}(?:-\d{1,3}){2,}+"),
)
_LAST_ROW: Final = re.compile(r"^\s*(\d{1,3}(?:(?:\s*,\s*|\s+)\d{1,3}){0,2})\s*(?:[\])}]|,?\s*$)")  # of an array
_GOES_ON: Final = re.compile(r"\w|[.,]\d|-\d")
_LEAST_BYTES: Final = 4
_TWO: Final = 2  # bytes in a string: a check value that somebody quotes
_DIGITS: Final = (
    re.compile(rf"{EDGE}{H}{{1,2}}(?:[ \t]{{1,4}}{H}{{1,2}}){{3,}}{END}"),
    re.compile(rf"{EDGE}{H}{{1,2}}(?P<gap>[ \t]?[,:;|-][ \t]?){H}{{1,2}}(?:(?P=gap){H}{{1,2}}){{2,}}{END}"),
)
_BINARY: Final = re.compile(r"(?<![\w.])(?P<sign>(?:0b)?)[01]{8}(?:[\s,;|]{1,3}(?P=sign)[01]{8})*(?!\w)")
_BASE64: Final = re.compile(r"(?<![\w+/=])(?:[A-Za-z0-9+/]{4})+(?:[A-Za-z0-9+/]{2}==|[A-Za-z0-9+/]{3}=)?(?![\w+/=])")
_OD_CELLS: Final = r"(?P<row>(?: {3}[ -~]| {2}\\[0abtnvfr]| [0-7]{3}){1,16})\s*$"
_OD_CHARACTERS: Final = re.compile(rf"^[0-9a-f]{{7}}{_OD_CELLS}")
OD_BELOW: Final = re.compile(rf"^ {{7}}{_OD_CELLS}")  # of a row whose bytes stand above
_HEX_ESCAPE: Final = re.compile(r"\\([0-9A-F]{2})()()()|\\([bfnrst\\])|([^\\\s])")
_HEX_ESCAPES: Final = re.compile(rf"(?:{_HEX_ESCAPE.pattern.replace('(', '(?:')}){{4,}}")
_NAMES: Final = (
    "NUL SOH STX ETX EOT ENQ ACK BEL BS HT LF VT FF CR SO SI DLE DC1 DC2 DC3 DC4 NAK SYN ETB CAN EM SUB ESC FS GS RS US"
)
_CONTROLS: Final = {name: code for code, name in enumerate(_NAMES.split())} | {"TAB": 9, "DEL": 127}
_CONTROL: Final = re.compile(rf"<(?:({'|'.join(_CONTROLS)})|({H}{{2}}))>|([^<])")
_NAMED: Final = re.compile(rf"(?<!\S)\S{{0,300}}?<(?:{'|'.join(_CONTROLS)})>.*<(?:{'|'.join(_CONTROLS)}|{H}{{2}})>\S*")
_CARET: Final = re.compile(r"(M-)?(?:\^([@-_?])|([ -~]))")
_CARETS: Final = re.compile(r"(?:(?<![^\s:>'\"=\]])[!-~]{0,8})?\^[@-_?][ -~]*")
_WITH_CHARACTERS: Final = re.compile(rf"(?<!\w)(?:{H}{{2}} ?\[.\][ ,]{{0,3}}){{4,}}")
_CHARACTER_EACH: Final = re.compile(rf"{EDGE}(?:{H}{{2}}[ -~] ){{3,}}{H}{{2}}[ -~](?!\S)")
_IN_BRACKETS: Final = re.compile(rf"\((?:(?:0[xX]|&[hH]|\$)({H}{{1,2}})|(\d{{1,3}}))\)")
_PAIR_IN_BRACKETS: Final = re.compile(rf"(?<=\d)\(({H}{{2}})\)")  # behind the decimal
_PLAIN_WORD: Final = re.compile(r"[A-Za-z]?(?:[a-z]*|[A-Z]*)|[a-z/]+")
_ASCII_BEHIND_WORD: Final = re.compile(rf"(?<=[A-Za-z]{{2}}):(?:{H}{{2}}){{3,300}}{END}")  # `Tx:0103…`
_LEAST_BASE64: Final = 8  # characters
_RUN_TOGETHER: Final = re.compile(rf"{EDGE}{H}{{8,24}}{END}")
_MOST_WAYS: Final = 1000  # to part digits, over which a check value says too little


def other_candidates(line: TextLine) -> Iterator[HexWindow]:
    """All runs of characters that can be bytes and are no hex pairs."""
    text = line.text
    if len(text) > _LONG:
        return
    if "\\" in text:
        yield from _strings(text)
        yield from _hex_escapes(text)
    if text[:1] == "0":
        yield from _od_characters(text)
    if "<" in text:
        yield from _control_names(text)
    if "^" in text:
        yield from _carets(text)
    for match in _ASCII_BEHIND_WORD.finditer(text):
        yield HexWindow(f"{match[0]}\r\n".encode(), *match.span(), "ascii", Writing.NUMBER, ascii=True)
    yield from _decimals(text)
    yield from _with_characters(text)
    if max(text.count("("), text.count("[")) >= _LEAST_BYTES:
        yield from _in_brackets(text)
    yield from _mistyped(text)
    yield from _end_of_array(text)
    yield from _digits(text)
    if "000" in text:
        yield from _binary(text)
    yield from _base64(text)


def _strings(text: str) -> Iterator[HexWindow]:
    r"""`'\x11\x03\x00k'`, `\021\003`, quoted or not, other characters as they are."""
    at = 0
    first: int | None = len(text) - len(text.lstrip())
    for start, end in (*_quoted(text), (len(text), len(text))):
        if _ESCAPES.search(text, start, end) is not None or start == len(text):
            for match in _BARE.finditer(text, at, start):
                yield from _unquoted(text, match.start(), match.end(), first)
                first = None  # all of the line is a candidate once
            if start < end:
                yield from _string(text[start:end], start, end)
                for inner in _INNER.finditer(text, start, end):
                    yield from _string(inner[2], *inner.span(2))
                for first, last in _quoted(text[start:end]):  # a string in a string
                    yield from _string(text[start + first : start + last], start + first, start + last)
            at = end


def _unquoted(text: str, start: int, end: int, first: int | None) -> Iterator[HexWindow]:
    """Escapes without quotes; the characters before the first may belong to them, and all from `first` on."""
    body = text[start:end].rstrip("'`\",)];")
    yield from _string(body, start, start + len(body))
    word = text.rfind(" ", max(start - _WORD, 0), start) + 1 or max(start - _WORD, 0)
    whole = () if first is None else ((first, len(text)),)
    for begin, stop in ((word, start + len(body)), *whole):
        for at in {begin, max(begin - 1, 0)}:  # a blank may be a byte
            yield HexWindow(unescape(text[at:stop]), at, stop, "\\x", Writing.NUMBER)


def _quoted(text: str) -> Iterator[tuple[int, int]]:
    """Where the insides of quoted strings begin and end."""
    starts: dict[str, list[int]] = {"'": [], '"': []}
    for match in _QUOTE.finditer(text):
        if match[1]:
            starts[match[1]].append(match.start())
    at = 0
    for start, sign in sorted((position, sign) for sign, of_sign in starts.items() for position in of_sign):
        following = bisect_left(starts[sign], start + 1)
        if start >= at and following < len(starts[sign]):
            at = starts[sign][following] + 1
            yield start + 1, at - 1


def _string(body: str, start: int, end: int) -> Iterator[HexWindow]:
    hexadecimal = "\\x" in body
    level = Writing.BYTES if hexadecimal or len(_ESCAPES.findall(body)) > 2 else Writing.NUMBER
    if _HALF.search(body):
        level = Writing.NUMBER
    data = unescape(body)
    yield HexWindow(data, start, end, "\\x", level if len(data) > _TWO else min(level, Writing.LIKELY))
    if "\\0" in body:  # as Rust and JavaScript have it
        yield HexWindow(unescape(body.replace("\\0", "\\x00")), start, end, "\\0", Writing.NUMBER)
    if not hexadecimal:  # as Lua and Haskell have it
        yield HexWindow(unescape(body, _DECIMAL_ESCAPE, 10), start, end, "\\decimal", Writing.NUMBER)


def _hex_escapes(text: str) -> Iterator[HexWindow]:
    r"""`\01\03\00k\C5\CD`, as LabVIEW writes them."""
    for match in _HEX_ESCAPES.finditer(text):
        if match[0].count("\\") < _LEAST_BYTES - 1:
            continue
        data = unescape(match[0], _HEX_ESCAPE)
        yield HexWindow(data, *match.span(), "\\hex", Writing.NUMBER)


def _od_characters(text: str) -> Iterator[HexWindow]:
    r"""`0000000 001 003  \0   k  \0 001 365 326`, as `od -c` writes a row."""
    if (match := _OD_CHARACTERS.match(text)) is not None:
        end = match.end("row")
        yield HexWindow(od_bytes(match["row"]), end - len(match["row"].lstrip()), end, "od -c", Writing.NUMBER)


def od_bytes(row: str) -> bytes:
    """The bytes of a row of `od -c`, four characters each."""
    cells = [row[at : at + 4][1:] for at in range(0, len(row), 4)]
    return b"".join(unescape(f"\\{cell}" if cell.isdigit() else cell.lstrip() or " ") for cell in cells)


def _control_names(text: str) -> Iterator[HexWindow]:
    """`<SOH><ETX><NUL>k<C5>`, as terminals show characters without a shape."""
    for match in _NAMED.finditer(text):
        data = b"".join(
            bytes((_CONTROLS[name],)) if name else bytes.fromhex(digits) if digits else _octets(char)
            for name, digits, char in _CONTROL.findall(match[0])
        )
        yield HexWindow(data, *match.span(), "<NUL>", Writing.NUMBER)


def _carets(text: str) -> Iterator[HexWindow]:
    """`^A^C^@kM-^D^J`, as `cat -v` shows bytes; a blank may be one of them."""
    for match in _CARETS.finditer(text):
        data = bytes(
            (0x80 if high else 0) + (ord(control) ^ 0x40 if control else ord(char))
            for high, control, char in _CARET.findall(match[0])
        )
        yield HexWindow(data, *match.span(), "^A", Writing.NUMBER)
        if text[match.start() - 1 : match.start()] == " ":
            yield HexWindow(b" " + data, match.start() - 1, match.end(), "^A", Writing.NUMBER)


def _with_characters(text: str) -> Iterator[HexWindow]:
    """`01. 03. 6Bk 00.`: behind each byte the character that it is, or what stands for one."""
    for match in _CHARACTER_EACH.finditer(text):
        data = bytes.fromhex("".join(match[0][at : at + 2] for at in range(0, len(match[0]), 4)))
        if match[0][2::4] == "".join(chr(byte) if 0x20 <= byte < 0x7F else "." for byte in data):
            yield HexWindow(data, match.start(), match.end(), "pair and character", Writing.BYTES)


def _in_brackets(text: str) -> Iterator[HexWindow]:
    """`k(107) .(000)`, `0b00000001 (0x01)`, `6B [k]`: bytes beside another writing of them."""
    for match in _WITH_CHARACTERS.finditer(text):
        digits = re.findall(rf"({H}{{2}}) ?\[.\]", match[0])
        yield HexWindow(bytes.fromhex("".join(digits)), *match.span(), "pair [.]", Writing.NUMBER)
    if len(pairs := list(_PAIR_IN_BRACKETS.finditer(text))) >= _LEAST_BYTES:
        data = bytes.fromhex("".join(pair[1] for pair in pairs))
        yield HexWindow(data, pairs[0].start() + 1, pairs[-1].end() - 1, "(pair)", Writing.NUMBER)
    found = list(_IN_BRACKETS.finditer(text))
    values = [int(match[1], 16) if match[1] else int(match[2]) for match in found]
    if len(values) >= _LEAST_BYTES and max(values) < 256:
        yield HexWindow(bytes(values), found[0].start() + 1, found[-1].end() - 1, "(byte)", Writing.NUMBER)


def _mistyped(text: str) -> Iterator[HexWindow]:
    """`O1 03 СD`: letters in place of digits that look like them."""
    for match in MISTYPED.finditer(text):
        if (typed := match[0].translate(LOOK_ALIKE)) != match[0]:
            data = bytes.fromhex("".join(re.findall(rf"{H}{{2}}", typed)))
            yield HexWindow(data, *match.span(), LOOK_ALIKES, Writing.NUMBER)


def unescape(text: str, escape: re.Pattern[str] = _ESCAPE, base: int = 8) -> bytes:
    """Bytes of a C or Python string's inside: hex, octal and letter escapes, other characters as they are."""
    out = bytearray()
    for digits, wide, braced, number, letter, plain in escape.findall(text):
        if digits or wide or braced:
            out.append(int(digits or wide or braced, 16))
        elif number:
            out.append(int(number, base) & 0xFF)
        elif letter in _SIMPLE_ESCAPES:
            out.append(_SIMPLE_ESCAPES[letter])
        else:
            out += _octets(letter or plain)
    return bytes(out)


def _octets(char: str) -> bytes:
    """A character as the one byte that it was: Python 2 and terminals show bytes over 7F as letters."""
    for codec in ("latin-1", "cp1252", "cp1251"):
        try:
            return char.encode(codec)
        except UnicodeEncodeError:
            continue
    return char.encode("utf-8", "replace")


def _decimals(text: str) -> Iterator[HexWindow]:
    """`17, 3, 0, 107`, `[17 3 0 107]`, `[17][3]`, `17-3-0`; negative ones as Java has them."""
    for pattern in _DECIMALS:
        for match in pattern.finditer(text):
            end = _list_end(text, *match.span())
            number = r"\d+" if "dash" in match.groupdict() else r"-?\d+"
            values = [int(word) for word in re.findall(number, text[match.start() : end])]
            if len(values) >= _LEAST_BYTES and max(values) < 256 and min(values) > -129:
                node = text[: match.start()].endswith(('"data":[', '"data": ['))  # of Node.js
                level = Writing.BYTES if node else Writing.NUMBER
                if values[0] == len(values) - 1:  # so many bytes
                    second = text.index(str(values[1]), match.start() + len(str(values[0])))
                    behind = bytes(value & 0xFF for value in values[1:])
                    yield HexWindow(behind, second, end, "decimal", level)
                yield HexWindow(bytes(value & 0xFF for value in values), match.start(), end, "decimal", level)


def _end_of_array(text: str) -> Iterator[HexWindow]:
    """`194,  25, 164], dtype=uint8`"""
    if (match := _LAST_ROW.match(text)) is not None:
        values = [int(word) for word in re.findall(r"\d+", match[1])]
        if max(values) < 256:
            yield HexWindow(bytes(values), *match.span(1), "decimal", Writing.NUMBER)


def _list_end(text: str, start: int, end: int) -> int:
    """Where a list of numbers ends: its last may be part of a word; of one that goes on with others nothing is left."""
    if _GOES_ON.match(text, end) is None:
        return end
    end = start + len(text[start:end].rstrip("0123456789"))
    while end > start and not text[end - 1].isdigit():
        end -= 1
    return start if _GOES_ON.match(text, end) is not None else end


def _digits(text: str) -> Iterator[HexWindow]:
    """`11 3 0 6B`, as `Serial.print(byte, HEX)` writes them; `1 1 03 0 0 6B`, as a picture is read."""
    for pattern in _DIGITS:
        for match in pattern.finditer(text):
            tokens = re.findall(rf"{H}+", match[0])
            if min(map(len, tokens)) == 1:
                data = bytes(int(token, 16) for token in tokens)
                yield HexWindow(data, *match.span(), "digits", Writing.NUMBER)
                if not match.groupdict() and len(digits := "".join(tokens)) % 2 == 0:
                    yield HexWindow(bytes.fromhex(digits), *match.span(), "digits apart", Writing.NUMBER)


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


def _binary(text: str) -> Iterator[HexWindow]:
    """`00010001 00000011`, `0b00010001, 0b00000011`"""
    for match in _BINARY.finditer(text):
        data = bytes(int(word, 2) for word in re.findall(r"[01]{8}", match[0]))
        yield HexWindow(data, *match.span(), "binary", Writing.NUMBER)


def _base64(text: str) -> Iterator[HexWindow]:
    """`EQMAawADdoc=`"""
    for match in _BASE64.finditer(text):
        word = _PLAIN_WORD.fullmatch(match[0]) and not match[0].isupper()
        if len(match[0]) < _LEAST_BASE64 or word:
            continue
        from base64 import b64decode

        yield HexWindow(b64decode(match[0]), *match.span(), "base64", Writing.NUMBER)
