"""Lines that a window, a mail or a terminal has broken, whole again."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from operator import or_
from typing import Final

from .candidates import H

ENTRY: Final = re.compile(  # how one begins
    r"\[\d\d:\d\d:\d\d(?:\.\d+)?\]\[[A-Z]{1,2}\]\[|(?<!\S)\[[A-Z]\] ?\d+\| |"
    r"(?<![\w:.-])20\d\d-\d\d-\d\d[ T]\d\d:\d\d:\d\d[.,]\d{3} [A-Z(]|>>>>> (?=send: |recv: |extra: )"
)
_WINDOW: Final = 38  # columns that a window has at least
_PAIRS_WIDE: Final = 14  # characters of a few pairs
_BROKEN: Final = re.compile(rf"(?: {H}{{2}}){{4}} {H}$")
_BEGUN: Final = re.compile(rf"{H}(?:(?: {H}{{2}}){{2}}|(?: {H}{{2}})?\s*$)")
_FOLDED: Final = (60, 76)  # characters of a line that a mail folds
_MOST_FOLDED: Final = 64  # lines into one
_QUOTED: Final = re.compile(r"(?:>[ \t]?)+")
_STAMP: Final = re.compile(r"[\s\[(<|]*\d{1,4}[-/.:]\d\d?[-/.:]\d\d?")
_DATE: Final = re.compile(r"\d[-/.]\d\d$")
_WRAPPED: Final = range(40, 141)  # columns at which texts are broken
_LEAST_WRAPPED: Final = 3  # lines, and entries in them
_FEWEST: Final = 2  # lines that go on with another
_SLACK: Final = 4  # blanks that a break may take
_MOST_WRAPPED: Final = 256  # lines of one paragraph


def unwrapped(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Lines, with the entries of a log whole that a mail has broken where its width ends."""
    held: list[tuple[int, str]] = []
    for number, line in lines:
        fits = bool(line.strip()) and len(line) <= _WRAPPED[-1]
        if not fits or len(held) == _MOST_WRAPPED:
            yield from _paragraph(held)
            held = []
        if fits:
            held.append((number, line))
        else:
            yield number, line
    yield from _paragraph(held)


def _paragraph(held: list[tuple[int, str]]) -> list[tuple[int, str]]:
    """Lines that stand together; where each that begins no entry is behind one that had no room for its first word."""
    if len(held) < _LEAST_WRAPPED:
        return held
    texts = [line.rstrip() for _, line in held]
    signs = [_QUOTED.match(text) for text in texts]
    if all(signs):
        texts = [text[len(sign[0]) :] for text, sign in zip(texts, signs, strict=True) if sign is not None]
    width = max(map(len, texts))
    if ENTRY.match(texts[0]) is None or width not in _WRAPPED:
        return held
    begins = [True, *(_begins(text, above) for above, text in pairwise(texts))]
    broken = [len(line) + _SLACK + len(below.split(" ")[0]) > width for line, below in pairwise(texts)]
    if begins.count(False) < _FEWEST or not all(map(or_, begins[1:], broken)):
        return held
    if len(list(ENTRY.finditer(" ".join(texts)))) < _LEAST_WRAPPED:
        return held
    whole: list[tuple[int, str]] = []
    for (number, _), text, begin in zip(held, texts, begins, strict=True):
        whole = [*whole, (number, text)] if begin else [*whole[:-1], (whole[-1][0], f"{whole[-1][1]} {text}")]
    return [(number, entry) for number, text in whole for entry in entries_in(text)]


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


def unfolded(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Lines, with those whole that a mail's `=` at their end says to go on in the next."""
    held: list[str] = []
    first = 0
    for number, line in lines:
        text = line.rstrip("\r\n")
        first = first if held else number
        if text.endswith("=") and _FOLDED[0] <= len(text) <= _FOLDED[1] and " " in text and len(held) < _MOST_FOLDED:
            held.append(text[:-1])
        elif held:
            yield first, "".join((*held, text))
            held = []
        else:
            yield number, line
    if held:
        yield first, "".join(held)


def mended(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Lines, with a byte that a terminal's edge broke in two whole at the end of the first."""
    held: tuple[int, str] | None = None
    for number, line in lines:
        text = line.rstrip("\r\n")
        if held is not None:
            if _BEGUN.match(text):
                yield held[0], held[1] + text[0]
                text = line = text[1:]
            else:
                yield held
            held = None
        if _BROKEN.search(text, max(len(text) - _PAIRS_WIDE, 0)) and len(text) >= _WINDOW:
            held = number, text
        else:
            yield number, line
    if held is not None:
        yield held
