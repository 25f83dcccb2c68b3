"""Hex bytes in a piece of text: every way in which people and tools write them.

What is written with signs of its own (`0x11`, `\\x11`, `[11][03]`, `<Buffer 11 03>`, `:1103...7E`) is taken wherever it
stands. Bare digits are taken when all of the text, or all after a label, is made of them; inside prose only a run that
no words or numbers would make. Letters alone (`add`, `dead`, `face`) are words.

Digits that are plainly meant as bytes but do not come in pairs raise `HexError`, with the column: half a byte is never
dropped or guessed.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass


class HexError(ValueError):
    """Text that should be hex bytes and is not; `str()` is one line with the position."""


@dataclass(frozen=True, slots=True)
class Found:
    """Bytes in a text; `ascii` where they are an ASCII-mode frame, kept as its characters from `:` to CR LF."""

    data: bytes
    ascii: bool = False
    cut: bool = False  # the text says that it shows only the first of the bytes


_H = "[0-9A-Fa-f]"
_EDGE = r"(?<![0-9A-Za-z_])"
_END = r"(?![0-9A-Za-z_])"
_PLAIN = re.compile(rf"\s*{_H}{{2}}(?:[ \t]+{_H}{{2}})*\s*", re.ASCII)
_ASCII = re.compile(rf"(?<![0-9A-Za-z_]):((?:{_H}{{2}}){{3,300}}){_END}")
_SQUARE = re.compile(rf"(?<!\])\[{_H}{{2}}\](?:\s*\[{_H}{{2}}\])+(?!\s*\[\d)")
_ANGLE = re.compile(rf"(?<!>)<{_H}{{2}}>(?:\s*<{_H}{{2}}>)+(?!\s*<\d)")
_NODE = re.compile(rf"<Buffer((?:\s+{_H}{{2}})+)(\s*\.\.\.[^>]*)?\s*>")
_NODE_JSON = re.compile(r'\{\s*"type"\s*:\s*"Buffer"\s*,\s*"data"\s*:\s*\[([\d,\s]*)\]\s*\}')
_QUOTED = re.compile(r"""[bB]?(["'])((?:[^\\]|\\.)*?)\1""")
_ESCAPED = re.compile(r"\\x(?:[^\\\s]|\\[xX0abfnrtv'\"\\])*")
_SIGN = r"(?:0[xX]|16#|\$|&[hH])"  # C, PLC languages, Pascal, Basic
_PREFIXED = re.compile(rf"{_EDGE}{_SIGN}{_H}+(?:[\s,;|]+{_SIGN}{_H}+)*{_END}")
_SUFFIXED = re.compile(rf"{_EDGE}{_H}{{2}}[hH](?:[\s,;]+{_H}{{2}}[hH])+{_END}")
_DUMP = re.compile(
    rf"^\s*(?:0x)?(?P<offset>{_H}{{4,8}})(?:(?P<colon>:)\s*|\s+)"
    rf"(?P<body>{_H}{{2}}(?:(?: |  |-){_H}{{2}}){{0,7}}(?:(?: |  | ?-){_H}{{2}}(?: {_H}{{2}}){{0,7}})?|"
    rf"{_H}{{4}}(?: {_H}{{4}}){{0,7}}(?: {_H}{{2}})?)(?=\s|$)"
)
_RUN = re.compile(
    rf"{_EDGE}(?:(?P<halves>{_H}{{2}}(?: {_H}{{2}}){{7}}  {_H}{{2}}(?: {_H}{{2}}){{0,7}})|"
    rf"{_H}{{2}}(?:(?P<gap>[ \t]{{1,3}}){_H}{{2}}(?:(?P=gap){_H}{{2}})*|"
    rf"(?P<sign>[-:,;._|]|, ){_H}{{2}}(?:(?P=sign){_H}{{2}})*)|(?:{_H}{{2}}){{4,}}){_END}"
)
_COLUMNS = re.compile(
    rf"^\s*(?:{_H}{{4,8}}:?\s+)?(?P<bytes>{_H}{{2}}(?:[ \t]{{1,2}}{_H}{{2}}){{0,31}})[ \t]{{2,}}(?P<text>\S.*?)\s*$"
)
_DECIMALS = re.compile(r"(?<![\w.:])\d{1,3}(?:[\s,;|\[\]<>]+\d{1,3}){3,}(?![\w.:])", re.ASCII)
_NUMBER = re.compile(r"\s*\d{1,6}\s*", re.ASCII)
_TOKENS = re.compile(r"[^\s,;:|._-]+")
_LABEL_END = re.compile(r"[:>=\])}|,\"'-](?=\s)|[:>=\])}|](?=[0-9A-Fa-f])")
_WRAPPING = " \t\r\n,;:|=>[](){}\"'-"
_ODD = "an odd number of hex digits in {} at column {}: write each byte with two digits"
_ROW = 400  # characters of a hex viewer's row at most
_LABEL_LOOK = 300  # characters in which the label before the bytes ends
_SIMPLE_ESCAPES = {"0": 0, "a": 7, "b": 8, "t": 9, "n": 10, "v": 11, "f": 12, "r": 13, "e": 27}
_ESCAPE = re.compile(r"\\(?:x([0-9A-Fa-f]{1,2})|([0-7]{1,3})|(.))|([^\\])", re.DOTALL)


def find(text: str) -> list[Found]:
    """All bytes in a text without times and marks; empty where there are none. Raises HexError for halves of bytes."""
    if _PLAIN.fullmatch(text):
        return [Found(bytes.fromhex(text))]
    if "  " in text and (columns := _columns(text)) is not None:
        return [columns]
    for sign, pattern, decode in _EXPLICIT:
        if sign in text:
            read = map(decode, pattern.finditer(text))
            if found := [item for item in read if item is not None]:
                return found
    tail = _tail(text)
    return [tail] if tail is not None else _in_prose(text)


def decimals(text: str) -> list[Found]:
    """Bytes as decimal numbers, four or more in a row: 0 to 255 each, one at least of three digits.

    `10 20 30 40` could be hex as well; so this is asked only of a text in which no hex bytes were found.
    """
    rows = (re.findall(r"\d+", match[0]) for match in _DECIMALS.finditer(text))
    return [Found(bytes(map(int, row))) for row in rows if max(map(int, row)) < 256 and max(map(len, row)) == 3]


def strict(text: str) -> Found | None:
    """The bytes of a text that holds nothing but hex digits and signs between them; None where it is not such."""
    return _pure(text, 0)


def dump_line(text: str) -> tuple[str, bytes] | None:
    """Offset (its digits) and bytes of a line of an offset dump (hexdump -C, xxd, Wireshark, od -t x1)."""
    match = _DUMP.match(text)
    if match is None:
        return None
    tokens = re.split(r"[ -]+", match["body"])
    if match["colon"] is None and (len(tokens[0]) == 4 or int(match["offset"], 16) % 8):
        return None  # words of four digits, the first of which only looks like an offset
    return match["offset"], bytes.fromhex("".join(tokens))


def unescape(text: str) -> bytes:
    """Bytes of a C or Python string's inside: hex, octal and letter escapes, other characters as they are."""
    out = bytearray()
    for digits, octal, letter, plain in _ESCAPE.findall(text):
        if digits:
            out.append(int(digits, 16))
        elif octal:
            out.append(int(octal, 8) & 0xFF)
        elif letter:
            out += bytes((_SIMPLE_ESCAPES[letter],)) if letter in _SIMPLE_ESCAPES else letter.encode()
        else:
            out += plain.encode("utf-8", "replace")
    return bytes(out)


def _columns(text: str) -> Found | None:
    """A row of a hex viewer, with or without an offset: bytes, a gap, and the same bytes as characters."""
    match = _COLUMNS.match(text) if len(text) <= _ROW else None
    if match is None:
        return None
    data = bytes.fromhex(match["bytes"])
    shown = match["text"].ljust(len(data))
    if len(shown) != len(data):
        return None
    for byte, char in zip(data, shown, strict=True):
        if char != chr(byte) if 0x20 < byte < 0x7F else char.isascii() and char.isalnum():
            return None
    return Found(data)


def _ascii_frame(match: re.Match[str]) -> Found | None:
    return Found(match[0].encode() + b"\r\n", ascii=True)


def _pairs(match: re.Match[str]) -> Found | None:
    return Found(bytes.fromhex("".join(re.findall(rf"{_H}{{2}}", match[0]))))


def _node(match: re.Match[str]) -> Found | None:
    return Found(bytes.fromhex(match[1]), cut=bool(match[2]))


def _node_json(match: re.Match[str]) -> Found | None:
    values = re.findall(r"\d+", match[1])
    for value in values:
        if len(value) > 3 or int(value) > 255:
            raise HexError(f"{_short(value)} is not a byte, in the Buffer at column {match.start() + 1}")
    return Found(bytes(map(int, values))) if values else None


def _quoted(match: re.Match[str]) -> Found | None:
    return Found(unescape(match[2])) if "\\x" in match[2] else None


def _escaped(match: re.Match[str]) -> Found | None:
    if (half := re.search(r"\\x(?![0-9A-Fa-f]{2})", match[0])) is not None:
        at = match.start() + half.start()
        raise HexError(f"\\x without two hex digits at column {at + 1}")
    return Found(unescape(match[0]))


def _prefixed(match: re.Match[str]) -> Found | None:
    words = re.findall(rf"{_SIGN}({_H}+)", match[0])
    if len(words) == 1 and len(words[0]) < 8:
        before, after = match.string[: match.start()], match.string[match.end() :]
        if re.search(r"[A-Za-z0-9]", after) or re.search(r"[A-Za-z0-9][^:>=\]]*$", before):
            return None  # a number in a sentence
    for word in words:
        if len(word) % 2 and len(word) > 1:
            at = match.string.find(word, match.start())
            raise HexError(f"an odd number of hex digits in 0x{_short(word)} at column {at + 1}")
    return Found(bytes.fromhex("".join(word.zfill(2) for word in words)))


# A character that such a text must have, how it looks, and its bytes.
_EXPLICIT: tuple[tuple[str, re.Pattern[str], Callable[[re.Match[str]], Found | None]], ...] = (
    ("<", _NODE, _node),
    ("{", _NODE_JSON, _node_json),
    ("[", _SQUARE, _pairs),
    ("<", _ANGLE, _pairs),
    ("\\", _QUOTED, _quoted),
    ("\\", _ESCAPED, _escaped),
    ("x", _PREFIXED, _prefixed),
    ("X", _PREFIXED, _prefixed),
    ("$", _PREFIXED, _prefixed),
    ("#", _PREFIXED, _prefixed),
    ("&", _PREFIXED, _prefixed),
    ("h", _SUFFIXED, _pairs),
    ("H", _SUFFIXED, _pairs),
    (":", _ASCII, _ascii_frame),
)


def _tail(text: str) -> Found | None:
    """Bare digits that are all of the text, or all that follows a label."""
    for start in (0, *(match.end() for match in _LABEL_END.finditer(text, 0, _LABEL_LOOK))):
        if start and text[start - 1] == "=" and _NUMBER.fullmatch(text, start):
            return None  # baudrate=19200
        if (found := _pure(text[start:], start)) is not None:
            return found
    return None


def _pure(text: str, column: int) -> Found | None:
    body = text.strip(_WRAPPING + "._")
    tokens = _TOKENS.findall(body)
    if not tokens or not all(_is_hex(token) for token in tokens):
        return None
    if all(token.isalpha() for token in tokens) and not _letters_are_bytes(tokens):
        return None
    odd = [token for token in tokens if len(token) % 2]
    if not odd:
        return Found(bytes.fromhex("".join(tokens)))
    evens = [token for token in tokens if len(token) % 2 == 0]
    if (len(tokens[0]) < 5) if len(tokens) == 1 else len(evens) < len(odd):
        return None  # a number, or numbers: not bytes
    at = column + text.find(body) + next(m.start() for m in _TOKENS.finditer(body) if len(m[0]) % 2)
    raise HexError(_ODD.format(repr(_short(odd[0])), at + 1))


def _is_hex(token: str) -> bool:
    return all(c in "0123456789abcdefABCDEF" for c in token)


def _letters_are_bytes(tokens: list[str]) -> bool:
    """Whether hex digits that are all letters are bytes: pairs, or longer than any word; `dead` and `added` are not."""
    return all(len(token) == 2 for token in tokens) or (len(tokens) == 1 and len(tokens[0]) >= 10)


def _in_prose(text: str) -> list[Found]:
    """Runs of bare digits with words around them."""
    runs = []
    for match in _RUN.finditer(text):
        digits = re.sub(rf"[^{_H[1:-1]}]", "", match[0])
        bare = match["gap"] is None and match["sign"] is None and match["halves"] is None
        if bare and not (re.search(r"\d", digits) and re.search(r"[A-Fa-f]", digits)):
            continue  # a number or a word
        if not bare and len(digits) < 6:
            continue
        half = re.match(rf"[ \t]+({_H}|{_H}{{3}})(?=[ \t]*$|[ \t]+{_H}{{2}}(?:\s|$))", text[match.end() :])
        if half and match["gap"]:
            at = match.end() + half.start(1)
            raise HexError(_ODD.format(repr(half[1]), at + 1))
        runs.append((bare, bytes.fromhex(digits)))
    if not runs:
        return []
    longest = max(runs, key=lambda run: len(run[1]))
    return [Found(data) for bare, data in runs if data is longest[1] or (bare == longest[0] and len(data) >= 4)]


def _short(word: str) -> str:
    return word if len(word) <= 24 else word[:21] + "..."
