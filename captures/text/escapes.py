r"""Bytes that a text shows as characters: strings with escapes, and how others of `writings` show one.

But for strings with `\x` they are bytes only where a check value says so.
"""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Callable, Iterator
from typing import Final

from .candidates import H, HexWindow, Writing

_NAMES: Final = (
    "NUL SOH STX ETX EOT ENQ ACK BEL BS HT LF VT FF CR SO SI DLE DC1 DC2 DC3 DC4 NAK SYN ETB CAN EM SUB ESC FS GS RS US"
)
CONTROLS: Final = {name: code for code, name in enumerate(_NAMES.split())} | {"TAB": 9, "DEL": 127}
_SIMPLE: Final = dict(
    zip("abtnvfre0s", (b"\a", b"\b", b"\t", b"\n", b"\v", b"\f", b"\r", b"\x1b", b"\0", b" "), strict=True)
)
OD_CELLS: Final = r"(?: {3}[ -~]| {2}\\[0abtnvfr]| [0-7]{3}){1,16}"  # of a row of `od -c`
_ESCAPES, _QUOTE, _INNER, _BARE, _HALF = (
    re.compile(pattern, re.DOTALL)
    for pattern in (
        r"\\(?:x[0-9A-Fa-f]{2}|u00[0-9A-Fa-f]{2}|[ux]\{[0-9A-Fa-f]{1,2}\}|\d{1,3})",
        r"\\.|([\"'])",
        r"\\([\"'])(.*?)\\\1",  # within another string
        r"\\[xu\d]\S*(?: (?=\S{0,20}\\(?:x|\d{3}))\S*)*",
        r"\\x(?![0-9A-Fa-f]{2}|\{)",
    )
)
# What a character of a string may be: the group that matches says how it is a byte.
_ESCAPE, _DECIMAL_ESCAPE, HEX_ESCAPE, CONTROL, CARET = (
    re.compile(pattern, re.DOTALL)
    for pattern in (
        rf"\\(?:(?:[ux](?P<brace>\{{)|x|u00)(?P<hex>{H}{{1,2}})(?(brace)\}})|(?P<octal>[0-7]{{1,3}})|(?P<letter>.))|(?P<plain>[^\\])",
        r"\\(?:(?P<decimal>\d{1,3})|(?P<letter>.))|(?P<plain>[^\\])",
        r"\\(?:(?P<hex>[0-9A-F]{2})|(?P<letter>[bfnrst\\]))|(?P<plain>[^\\\s])",
        rf"<(?:(?P<control>{'|'.join(CONTROLS)})|(?P<hex>{H}{{2}}))>|(?P<plain>[^<])",
        r"(?:(?P<high>M-\^[@-_?])|(?P<meta>M-[ -~])|\^(?P<caret>[@-_?])|(?P<plain>[ -~]))",
    )
)
OD_BELOW: Final = re.compile(rf"^ {{7}}(?P<row>{OD_CELLS})\s*$")
_WORD: Final = 300  # characters before an escape that may be bytes, too
_TWO: Final = 2  # bytes in a string: a check value that somebody quotes


def escaped_candidates(text: str) -> Iterator[HexWindow]:
    r"""`'\x11\x03\x00k'`, `\021\003`, quoted or not, other characters as they are."""
    if "\\" not in text:
        return
    at = 0
    first: int | None = len(text) - len(text.lstrip())
    for start, end in (*_quoted(text), (len(text), len(text))):
        if _ESCAPES.search(text, start, end) is not None or start == len(text):
            for match in _BARE.finditer(text, at, start):
                yield from _unquoted(text, match.start(), match.end(), first)
                first = None  # all of the line is a candidate once
            if start < end:
                yield from _string(text[start:end], start)
            for inner in _INNER.finditer(text, start, end):
                yield from _string(inner[2], inner.start(2))
            for begin, last in _quoted(text[start:end]):  # a string in a string
                yield from _string(text[start + begin : start + last], start + begin)
            at = end


def _unquoted(text: str, start: int, end: int, first: int | None) -> Iterator[HexWindow]:
    """Escapes without quotes; the characters before the first may belong to them, and all from `first` on."""
    body = text[start:end].rstrip("'`\",)];")
    yield from _string(body, start)
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


def _string(body: str, start: int) -> Iterator[HexWindow]:
    end = start + len(body)
    plainly = ("\\x" in body or len(_ESCAPES.findall(body)) > _TWO) and not _HALF.search(body)
    data = unescape(body)
    level = Writing.NUMBER if not plainly else Writing.BYTES if len(data) > _TWO else Writing.LIKELY
    yield HexWindow(data, start, end, "\\x", level)
    yield HexWindow(unescape(body.replace("\\0", "\\x00")), start, end, "\\0", Writing.NUMBER)  # of Rust and JavaScript
    yield HexWindow(unescape(body, _DECIMAL_ESCAPE), start, end, "\\decimal", Writing.NUMBER)  # of Lua and Haskell


def unescape(text: str, escape: re.Pattern[str] = _ESCAPE) -> bytes:
    """Bytes of a C or Python string's inside: hex, octal and letter escapes, other characters as they are."""
    found = ((match.lastgroup or "", match) for match in escape.finditer(text))
    return b"".join(_BYTES_OF[name](match[name]) for name, match in found)


def _octets(char: str) -> bytes:
    """A character as the one byte that it was: Python 2 and terminals show bytes over 7F as letters."""
    for codec in ("latin-1", "cp1252", "cp1251"):
        try:
            return char.encode(codec)
        except UnicodeEncodeError:
            continue
    return char.encode("utf-8", "replace")


_BYTES_OF: Final[dict[str, Callable[[str], bytes]]] = {
    "hex": lambda digits: bytes((int(digits, 16),)),
    "octal": lambda digits: bytes((int(digits, 8) & 0xFF,)),
    "decimal": lambda digits: bytes((int(digits) & 0xFF,)),
    "letter": lambda letter: _SIMPLE.get(letter) or _octets(letter),
    "control": lambda name: bytes((CONTROLS[name],)),
    "caret": lambda char: bytes((ord(char) ^ 0x40,)),
    "meta": lambda said: bytes((ord(said[2]) | 0x80,)),
    "high": lambda said: bytes((ord(said[3]) ^ 0x40 | 0x80,)),
    "plain": _octets,
}


def od_bytes(row: str) -> bytes:
    """The bytes of a row of `od -c`, four characters each."""
    cells = [row[at : at + 4][1:] for at in range(0, len(row), 4)]
    return b"".join(unescape(f"\\{cell}" if cell.isdigit() else cell.lstrip() or " ") for cell in cells)
