"""Lines as they were before a terminal, a chat, a letter or a window got them: no colours, markup, `>` or wraps."""

from __future__ import annotations

import html
import re
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, groupby, islice, pairwise
from operator import or_
from typing import Final, NamedTuple

from .candidates import LOOK_ALIKE, TYPED, H

_OTHER_DIGIT: Final = re.compile(r"(?![0-9])\d")  # of another script
_ANSI: Final = re.compile(r"\x1b\[[0-9;?]*[A-Za-z]")
# What is typed as something else than the plain characters that it means, or is markup around them.
_PLAIN: Final = str.maketrans(
    {chr(0xFF01 + i): chr(0x21 + i) for i in range(94)}
    | dict.fromkeys((0x00A0, *range(0x2000, 0x200B), 0x202F, 0x205F, 0x3000, 0), " ")  # blanks of all widths
    | dict.fromkeys((0x00AD, *range(0x200B, 0x2010), *range(0x202A, 0x202F), *range(0x2060, 0x2070), 0xFEFF))  # unseen
    | dict.fromkeys((*range(0x2010, 0x2014), 0x2212), "-")
    | dict(zip("\u2018\u2019\u201c\u201d、【】│┊║┃", "''\"\",[]| ||", strict=True))
)
_OCTET: Final = re.compile(r"<[0-9A-Fa-f]{2}>")
_SIGN_EXTENDED: Final = re.compile(
    r"(?<![0-9A-Za-z])(0[xX])?[fF]{6}([89A-Fa-f][0-9A-Fa-f])(?![0-9A-Za-z])"
)  # %02x of a char
_SMALL_HEX: Final = re.compile(r"(?<![0-9A-Za-z])(?:0[xX])?[0-9A-Fa-f]{1,2}(?![0-9A-Za-z])")
_SOME: Final = 3  # numbers that make a list, or a frame
_ESCAPED_ONCE: Final = re.compile(r"(?<!\\)(?:\\\\)*\\x")
_ESCAPE: Final = re.compile(r"\\(.)")
_PRINTABLE: Final = re.compile(  # of a mail: the sign itself, and blanks at an end; behind a name it is a value
    r"(?<!\w)=3D|=3D(?![\s;,)\]]|h\b|$)|(?<![G-Zg-z_][A-Za-z])(?<![G-Zg-z_][A-Za-z]{2})(?<![G-Zg-z_])=(?:20|09)(?=\s*$)"
)
_OF_WORDS: Final = frozenset("nrt\"'/")  # escapes in a string of words: no byte is written so


NumberedLine = tuple[int, str]


class _Rewrite(NamedTuple):
    """What is written in place of a pattern, in lines that hold a sign."""

    sign: str
    pattern: re.Pattern[str]
    put: str | Callable[[re.Match[str]], str]


def _rewrites(*rows: tuple[str, str, str | Callable[[re.Match[str]], str]]) -> tuple[_Rewrite, ...]:
    return tuple(_Rewrite(sign, re.compile(pattern), put) for sign, pattern, put in rows)


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
    text = line.rstrip("\r\n")
    if "\x1b" in text:
        text = _ANSI.sub("", text)
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
    return _PRINTABLE.sub(lambda match: chr(int(match[0][1:], 16)), text) if "=" in text else text


def _rewritten(text: str, rows: tuple[_Rewrite, ...]) -> str:
    for row in rows:
        if row.sign in text:
            text = row.pattern.sub(row.put, text)
    return text


def is_of_mail(line: str) -> bool:
    """Whether a line is quoted-printable, as mails are sent."""
    return "=" in line and _PRINTABLE.search(line) is not None


def quoted(text: str) -> str:
    """A line as a message quotes it."""
    text = text.strip()
    return repr(text if len(text) <= 60 else text[:57] + "...")


_SIGN: Final = re.compile(r"[ \t]{0,3}>(?=[ \t>]|$)[ \t]?")
_WORD: Final = re.compile(r"(?<![\w\\])(?=\w*[g-zG-Z\u0400-\u04ff])[A-Za-z\u0400-\u04ff]\w+|[{}]")
_LEAST: Final = 3  # lines
_MOST: Final = 256  # lines of a letter that are looked at


def unquoted(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    """Lines with their numbers, those that stand together behind such signs without them, however deep.

    Bytes alone behind `>` are what somebody sent; where there are words as well, and no line with another sign, they
    are quoted.
    """
    for signed, same in groupby(lines, lambda line: _SIGN.match(line[1]) is not None):
        held = list(islice(same, _MOST)) if signed else []
        quoting = len(held) >= _LEAST and any(_WORD.search(_bare(line)) for _, line in held)
        for number, line in chain(held, same):
            yield number, _bare(line) if quoting else line


def _bare(line: str) -> str:
    while (sign := _SIGN.match(line)) is not None:
        line = line[sign.end() :]
    return line


ENTRY: Final = re.compile(  # how one begins
    r"\[\d\d:\d\d:\d\d(?:\.\d+)?\]\[[A-Z]{1,2}\]\[|(?<!\S)\[[A-Z]\] ?\d+\| |"
    r"(?<![\w:.-])20\d\d-\d\d-\d\d[ T]\d\d:\d\d:\d\d[.,]\d{3} [A-Z(]|>>>>> (?=send: |recv: |extra: )"
)
_TURN: Final = re.compile(  # how one begins that has its time, wherever it stands
    r"(?:[\[(]|(?<![\w:./-]))(?:(?:\d{4}[-/.]\d\d[-/.]\d\d|\d\d[-/.]\d\d[-/.]\d{4})[ T]{1,2})?"
    r"\d\d:\d\d:\d\d[.,]\d{3}(?!\d*:)"
)
_TURN_BYTES: Final = re.compile(rf"(?:(?<!\w)(?:0[xX])?{H}{{2}}(?!\w)[ ,:.-]{{0,2}}){{4}}|(?<!\w){H}{{8,}}(?!\w)")
_NO_SIGN_OF_CELLS: Final = re.compile(r"[^;\t|]")
_SIGNS_OF_CLOCKS: Final = 4  # in a line that has two
_MOST_FOLDED: Final = 64  # lines into one
_STAMP: Final = re.compile(r"[\s\[(<|]*\d{1,4}[-/.:]\d\d?[-/.:]\d\d?")
_DATE: Final = re.compile(r"\d[-/.]\d\d$")
_WRAPPED: Final = range(40, 141)  # columns at which texts are broken
_LEAST_WRAPPED: Final = 3  # lines, and entries in them
_FEWEST: Final = 2  # lines that go on with another
_SLACK: Final = 4  # blanks that a break may take
_MOST_WRAPPED: Final = 256  # lines of one paragraph


def unwrapped(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    """Lines, with the entries of a log whole that a mail has broken where its width ends."""
    for fits, same in groupby(lines, lambda line: bool(line[1].strip()) and len(line[1]) <= _WRAPPED[-1]):
        while held := list(islice(same, _MOST_WRAPPED)):
            yield from _paragraph(held) if fits else held


def _paragraph(held: list[NumberedLine]) -> list[NumberedLine]:
    """Lines that stand together; where each that begins no entry is behind one that had no room for its first word."""
    texts = [line.rstrip() for _, line in held]
    if all(text.startswith(">") for text in texts):
        texts = [text.lstrip("> \t") for text in texts]
    width = max(map(len, texts))
    if len(held) < _LEAST_WRAPPED or ENTRY.match(texts[0]) is None or width not in _WRAPPED:
        return held
    begins = [True, *(_begins(text, above) for above, text in pairwise(texts))]
    broken = [len(line) + _SLACK + len(below.split(" ")[0]) > width for line, below in pairwise(texts)]
    if begins.count(False) < _FEWEST or not all(map(or_, begins[1:], broken)):
        return held
    column = {len(above) for above, begin in zip(texts, begins[1:], strict=False) if not begin} == {width}
    if column or len(list(ENTRY.finditer(" ".join(texts)))) < _LEAST_WRAPPED:
        return held  # broken at a column, within words as well: see `wraps`
    firsts = [i for i, begin in enumerate(begins) if begin]
    return [
        (held[first][0], entry)
        for first, end in pairwise([*firsts, len(held)])
        for entry in entries_in(" ".join(texts[first:end]))
    ]


def _begins(text: str, above: str) -> bool:
    """Whether a line begins an entry: as those of known logs do, or with a time whose date is not in the line above."""
    if ENTRY.match(text) is not None:
        return True
    return _STAMP.match(text) is not None and _DATE.search(above) is None


def entries_in(line: str) -> Iterator[str]:
    """The entries of a log that stand in one line."""
    heads = [head.start() for head in ENTRY.finditer(line)]
    for start, end in pairwise((0, *heads[heads[:1] == [0] :], len(line))):
        yield line[start:end]


def turns_in(line: str) -> list[str]:
    """The parts of a line in which several have spoken: a time and bytes behind it in each, in its cell of a table."""
    if line.count(":") < _SIGNS_OF_CLOCKS:
        return [line]
    heads = [head.start() for head in _TURN.finditer(line)]
    ends = [*pairwise((0, *heads[1:], len(line)))]
    if len(ends) < 2 or not all(_TURN_BYTES.search(line, *end) for end in ends):
        return [line]
    turns, signs = [], ""
    for start, end in ends:
        turns.append(signs + line[start:end])
        signs += _NO_SIGN_OF_CELLS.sub("", line[start:end])
    return turns


def unfolded(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    """Lines, with those whole that a mail's `=` at their end says to go on in the next."""
    held: list[NumberedLine] = []
    for number, line in lines:
        text = line.rstrip("\r\n")
        goes_on = text.endswith("=") and len(held) < _MOST_FOLDED
        held.append((number, text[:-1] if goes_on else text))
        if not goes_on:
            yield held[0][0], "".join(text for _, text in held)
            held = []
    if held:
        yield held[0][0], "".join(text for _, text in held)
