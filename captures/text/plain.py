"""A line without colours, markup and typographic signs, and as a message quotes it."""

from __future__ import annotations

import html
import re
from typing import Final

from .candidates import LOOK_ALIKE, TYPED

_OTHER_DIGIT: Final = re.compile(r"(?![0-9])\d")  # of another script
_ANSI: Final = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
# What is typed as something else than the plain characters that it means, or is markup around them.
_PLAIN: Final = str.maketrans(
    {0xFF01 + i: chr(0x21 + i) for i in range(94)}
    | dict.fromkeys((0x00A0, *range(0x2000, 0x200B), 0x202F, 0x205F, 0x3000, 0), " ")  # blanks of all widths
    | dict.fromkeys((0x00AD, *range(0x200B, 0x2010), *range(0x202A, 0x202F), *range(0x2060, 0x2070), 0xFEFF))  # unseen
    | dict.fromkeys((*range(0x2010, 0x2014), 0x2212), "-")
    | {
        "\u2018": "'",
        "\u2019": "'",
        "\u201c": '"',
        "\u201d": '"',
        "、": ",",
        "【": "[",
        "】": "]",
        "│": "|",
        "┊": " ",
        "║": "|",
        "┃": "|",
    }
)
_CELL: Final = re.compile(r"(?:</?(?:td|th|tr|li|p|br|div|dd|dt)\b[^<>]*>\s*)+", re.IGNORECASE)
_TAG: Final = re.compile(r"</?(?:code|span|pre|b|i|em|strong|font|a|tt|ul|ol|table|tbody)\b[^<>]*>", re.IGNORECASE)
_LAST_CELLS: Final = re.compile(r"(?:</?(?:li|p|br|div|dd|dt)\b[^<>]*>\s*)+$", re.IGNORECASE)
_MARKUP: Final = re.compile(  # of forums, of trackers
    r"\[/?(?:code|quote|spoiler|pre|color|size|font|table|tr|list|url|indent|center|tt|icode|php|syntax|highlight|noparse"
    r"|offtop|cut)(?:(?:=| \w+=)[^\[\]\n]*)?\]|\{(?:code|noformat|quote|color|panel)(?:[:=][^{}\n]*)?\}",
    re.IGNORECASE,
)
_BOLD: Final = re.compile(r"\[([biu])\]([^\[\]]*)\[/\1\]", re.IGNORECASE)
_OCTET: Final = re.compile(r"<[0-9A-Fa-f]{2}>")
_ENTITY: Final = re.compile(r"&(?:nbsp|lt|gt|quot|amp|#\d+|rarr|larr);")
_EMPHASIS: Final = re.compile(
    r"(?<![0-9A-Za-z*_~])[*_~]{1,4}([0-9A-Fa-f]{2}[0-9A-Fa-f ,:x-]*)[*_~]{1,4}(?![0-9A-Za-z*_~])"
)
_ARDUINO: Final = re.compile(r"^(\d\d:\d\d:\d\d\.\d{3}) -> ")  # its serial monitor puts this before every line
_SIGN_EXTENDED: Final = re.compile(
    r"(?<![0-9A-Za-z])(0[xX])?[fF]{6}([89A-Fa-f][0-9A-Fa-f])(?![0-9A-Za-z])"
)  # %02x of a char
_SMALL_HEX: Final = re.compile(r"(?<![0-9A-Za-z])(?:0[xX])?[0-9A-Fa-f]{1,2}(?![0-9A-Za-z])")
_SOME: Final = 3  # numbers that make a list, or a frame
_ESCAPED_ONCE: Final = re.compile(r"(?<!\\)(?:\\\\)*\\x")
_CAST_BEHIND: Final = re.compile(  # of Kotlin and Rust
    r"(?<=[0-9A-Fa-f])(?:\.to(?:UByte|Byte)\(\)|_?u8(?!\w)|\s+as\s+(?:u8|byte)(?!\w))"
)
_ESCAPE: Final = re.compile(r"\\(.)")
_ESCAPED_BLANKS: Final = re.compile(r"\\[nrt]")
_URL_BLANK: Final = re.compile(r"(?<!%[0-9A-Fa-f]{2})%20(?=[0-9A-Za-z])")
_PRINTABLE: Final = re.compile(  # of a mail: the sign itself, and blanks at an end; behind a name it is a value
    r"=3D|(?<![G-Zg-z_][A-Za-z])(?<![G-Zg-z_][A-Za-z]{2})(?<![G-Zg-z_])=(?:20|09)(?=\s*$)"
)
_OF_WORDS: Final = frozenset("nrt\"'/")  # escapes in a string of words: no byte is written so
_HEX_SIGN: Final = re.compile(  # typed with a letter O, a multiplication sign, a Cyrillic letter
    rf"(?<!\w)(?:[OoОо][xX×хХ]|0[×хХ]|0[xX](?=[0-9A-Fa-f]?[^\x00-\x7f]))({TYPED}{{1,2}})(?!\w)"
)
_REPEATED: Final = re.compile(r"(?<!\w)(0x[0-9A-Fa-f]{1,2}|\d{1,3}) <repeats (\d{1,3}) times>")  # as gdb shows arrays
_LOST_BREAK: Final = re.compile(r"(?<![0-9A-Za-z])([0-9A-Fa-f]{2})(?=(?:[TR]x|[TR]X|tx|rx) ?[:>])")  # `0BRx: 01 03`
_MIDDLE: Final = re.compile(  # of a dump's row: `00000000: 01 03 04 00 00 00 00 00 - 00 00`
    r"^(\s*(?:0[xX])?[0-9A-Fa-f]{4,8}\s?[:|]?\s+(?:[0-9A-Fa-f]{2} ){7}[0-9A-Fa-f]{2}) [-|:] (?=[0-9A-Fa-f]{2}\s)"
)
_CAST: Final = re.compile(r"\(\s*(?:unsigned |signed )?(?:byte|sbyte|char|u?int8(?:_t)?|u8|BYTE)\s*\)\s*")


def plain(line: str) -> str:
    """A line without colours, markup and typographic signs."""
    text = line.rstrip("\r\n")
    if "\x1b" in text:
        text = _ANSI.sub("", text)
    if not text.isascii() or "\x00" in text:
        text = _OTHER_DIGIT.sub(lambda match: str(int(match[0])), text.translate(_PLAIN))
    if "<" in text and ">" in text and len(_OCTET.findall(text)) < _SOME:  # <DD> is a tag as well
        text = _TAG.sub("", _CELL.sub(" | ", _LAST_CELLS.sub("", text)))
    if "[" in text or "{" in text:
        text = _MARKUP.sub("", text)
        if "[/" in text:
            text = _BOLD.sub(r"\2", text)
    if "&" in text and ";" in text and _ENTITY.search(text):
        text = html.unescape(text).replace("\u00a0", " ")
    if _HEX_SIGN.search(text):
        text = _HEX_SIGN.sub(lambda match: f"0x{match[1].translate(LOOK_ALIKE)}", text)
    if " <repeats " in text:
        text = _REPEATED.sub(lambda match: ", ".join([match[1]] * int(match[2])), text)
    if _LOST_BREAK.search(text):
        text = _LOST_BREAK.sub(r"\1 ", text)
    text = _ARDUINO.sub(r"\1    ", text)
    if "*" in text or "_" in text or "~" in text:
        text = _EMPHASIS.sub(r"\1", text)
    if "ffffff" in text.lower() and len(_SIGN_EXTENDED.findall(text)) + len(_SMALL_HEX.findall(text)) > _SOME:
        text = _SIGN_EXTENDED.sub(r"\1\2", text)
    if "\\\\x" in text and _ESCAPED_ONCE.search(text) is None:
        text = text.replace("\\\\", "\\")
    if "\\" in text and set(_ESCAPE.findall(text)) <= _OF_WORDS:
        text = _ESCAPED_BLANKS.sub("  ", text)
    if is_of_mail(text):
        text = _PRINTABLE.sub(lambda match: chr(int(match[0][1:], 16)), text)
    if text.lstrip()[:1] == "0":
        text = _MIDDLE.sub(r"\1   ", text)
    if "%20" in text:
        text = _URL_BLANK.sub("   ", text)
    if "u8" in text or "yte" in text:
        text = _CAST_BEHIND.sub("", text)
    return _CAST.sub("", text) if "(" in text else text


def is_of_mail(line: str) -> bool:
    """Whether a line is quoted-printable, as mails are sent."""
    return "=" in line and _PRINTABLE.search(line) is not None


def quoted(text: str) -> str:
    """A line as a message quotes it."""
    text = text.strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")
