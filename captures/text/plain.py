"""Lines as they were before a terminal, a chat or a forum got them: no colours and no markup."""

from __future__ import annotations

import html
import re
from collections.abc import Callable
from functools import lru_cache
from typing import Final, NamedTuple

from .candidates import LOOK_ALIKE, TYPED, shortened

# What is typed as something else than the plain characters that it means, or is markup around them.
_PLAIN: Final = str.maketrans(
    {chr(0xFF01 + i): chr(0x21 + i) for i in range(94)}
    | dict.fromkeys((0x00A0, *range(0x2000, 0x200B), 0x202F, 0x205F, 0x3000, 0), " ")  # blanks of all widths
    | dict.fromkeys((0x00AD, *range(0x200B, 0x2010), *range(0x202A, 0x202F), *range(0x2060, 0x2070), 0xFEFF))  # unseen
    | dict.fromkeys((*range(0x2010, 0x2014), 0x2212), "-")
    | dict(zip("\u2018\u2019\u201c\u201d、【】│┊║┃", "''\"\",[]| ||", strict=True))
)
_SOME: Final = 3  # numbers that make a list, or a frame
_OTHER_DIGIT: Final = re.compile(r"(?![0-9])\d")  # of another script
_OCTET: Final = re.compile(r"<[0-9A-Fa-f]{2}>")
_SIGN_EXTENDED: Final = re.compile(
    r"(?<![0-9A-Za-z])(0[xX])?[fF]{6}([89A-Fa-f][0-9A-Fa-f])(?![0-9A-Za-z])"
)  # %02x of a char
_SMALL_HEX: Final = re.compile(r"(?<![0-9A-Za-z])(?:0[xX])?[0-9A-Fa-f]{1,2}(?![0-9A-Za-z])")
_ESCAPED_ONCE: Final = re.compile(r"(?<!\\)(?:\\\\)*\\x")
_ESCAPE: Final = re.compile(r"\\(.)")
_OF_WORDS: Final = frozenset("nrt\"'/")  # escapes in a string of words: no byte is written so


_REMEMBERED: Final = 4096  # characters of a line


class _Rewrite(NamedTuple):
    """What is written in place of a pattern, in lines that hold a sign."""

    sign: str
    pattern: re.Pattern[str]
    put: str | Callable[[re.Match[str]], str]


def _rewrites(*rows: tuple[str, str, str | Callable[[re.Match[str]], str]]) -> tuple[_Rewrite, ...]:
    return tuple(_Rewrite(sign, re.compile(pattern), put) for sign, pattern, put in rows)


_COLOURS: Final = _rewrites(("\x1b", r"\x1b\[[0-9;?]*[A-Za-z]", ""))
_PRINTABLE: Final = _rewrites(  # of a mail: the sign itself, and blanks at an end; behind a name it is a value
    ("=",
     r"(?<!\w)=3D|=3D(?![\s;,)\]]|h\b|$)|(?<![G-Zg-z_][A-Za-z])(?<![G-Zg-z_][A-Za-z]{2})(?<![G-Zg-z_])=(?:20|09)(?=\s*$)",
     lambda match: chr(int(match[0][1:], 16)))
)  # fmt: skip
_BLOCK: Final = r"(?i:</?(?:td|th|tr|li|p|br|div|dd|dt)\b[^<>]*>\s*)+"
_TAGS: Final = _rewrites(("<", _BLOCK + "$", ""), ("<", _BLOCK, " | "))
_REWRITES: Final = _rewrites(
    ("[",  # of forums
     r"(?i)\[/?(?:code|quote|spoiler|pre|color|size|font|table|tr|list|url|indent|center|tt|icode|php|syntax|highlight|"
     r"noparse|offtop|cut)(?:(?:=| \w+=)[^\[\]\n]*)?\]", ""),
    ("{", r"(?i)\{(?:code|noformat|quote|color|panel)(?:[:=][^{}\n]*)?\}", ""),  # of trackers
    ("&", r"&(?:nbsp|lt|gt|quot|amp|#\d+|rarr|larr);", lambda match: html.unescape(match[0]).replace("\u00a0", " ")),
    ("",  # typed with a letter O, a multiplication sign, a Cyrillic letter
     rf"(?<!\w)(?:[OoОо][xX×хХ]|0[×хХ]|0[xX](?=[0-9A-Fa-f]?[^\x00-\x7f]))({TYPED}{{1,2}})(?!\w)",
     lambda match: f"0x{match[1].translate(LOOK_ALIKE)}"),
    ("h", rf"(?<!\w){TYPED}{{2}}(?=h(?!\w))", lambda match: match[0].translate(LOOK_ALIKE)),  # `ЕВh`
    # as debuggers show characters and arrays
    (" '", r"(?<=\d) '(?:\\(?:[0-7]{1,3}|x[0-9a-f]{2}|.)|[^\\])'(?=\s*(?:[,}<]|$))", ""),
    (" <repeats ", r"(?<!\w)(0x[0-9A-Fa-f]{1,2}|\d{1,3}) <repeats (\d{1,3}) times>",
     lambda match: ", ".join([match[1]] * int(match[2]))),
    ("", r"(?<![0-9A-Za-z])([0-9A-Fa-f]{2})(?=(?:[TR]x|[TR]X|tx|rx) ?[:>])", r"\1 "),  # `0BRx: 01 03`
    (" -> ", r"^(\d\d:\d\d:\d\d\.\d{3}) -> ", r"\1    "),  # before every line of a terminal
    ("", r"(?<![0-9A-Za-z*_~])[*_~]{1,4}([0-9A-Fa-f]{2}[0-9A-Fa-f ,:x-]*)[*_~]{1,4}(?![0-9A-Za-z*_~])", r"\1"),
    # of a dump's row: `00000000: 01 03 04 00 00 00 00 00 - 00 00`
    ("", r"^(\s*(?:0[xX])?[0-9A-Fa-f]{4,8}\s?[:|]?\s+(?:[0-9A-Fa-f]{2} ){7}[0-9A-Fa-f]{2}) [-|:] (?=[0-9A-Fa-f]{2}\s)",
     r"\1   "),
    ("%20", r"(?<!%[0-9A-Fa-f]{2})%20(?=[0-9A-Za-z])", "   "),
    # casts of Kotlin, Rust, C and Java
    ("", r"(?<=[0-9A-Fa-f])(?:\.to(?:UByte|Byte)\(\)|_?u8(?!\w)|\s+as\s+(?:u8|byte)(?!\w))", ""),
    ("(", r"\(\s*(?:unsigned |signed )?(?:byte|sbyte|char|u?int8(?:_t)?|u8|BYTE)\s*\)\s*", ""),
)  # fmt: skip


def plain(line: str) -> str:
    """A line without colours, markup and typographic signs."""
    return _plain(line) if len(line) <= _REMEMBERED else _plain.__wrapped__(line)


@lru_cache(maxsize=2048)  # a text's beginning is read again, once it is known what it is like
def _plain(line: str) -> str:
    text = _rewritten(line.rstrip("\r\n"), _COLOURS)
    if not text.isascii() or "\x00" in text:
        text = _OTHER_DIGIT.sub(lambda match: str(int(match[0])), text.translate(_PLAIN))
    if "<" in text and len(_OCTET.findall(text)) < _SOME:  # <DD> is a tag as well
        text = _rewritten(text, _TAGS)
    text = _rewritten(text, _REWRITES)
    if "ffffff" in text.lower() and len(_SIGN_EXTENDED.findall(text)) + len(_SMALL_HEX.findall(text)) > _SOME:
        text = _SIGN_EXTENDED.sub(r"\1\2", text)
    if "\\\\x" in text and _ESCAPED_ONCE.search(text) is None:
        text = text.replace("\\\\", "\\")
    if "\\" in text and set(_ESCAPE.findall(text)) <= _OF_WORDS:
        text = text.replace("\\n", "  ").replace("\\r", "  ").replace("\\t", "  ")
    return _rewritten(text, _PRINTABLE)


def _rewritten(text: str, rows: tuple[_Rewrite, ...]) -> str:
    for row in rows:
        if row.sign in text:
            text = row.pattern.sub(row.put, text)
    return text


def quoted(text: str) -> str:
    """A line as a message quotes it."""
    return repr(shortened(text.strip(), 60))
