"""Rows that a dump leaves out: hexdump, od and xxd write `*` in place of those that are like the one above."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final, NamedTuple

_ROW: Final = re.compile(r"^(?P<lead>\s*)(?P<offset>[0-9A-Fa-f]{4,8})(?P<rest>:?\s+\S.*)?$")
_WORDS: Final = re.compile(r"^\s+[0-9A-Fa-f]{4}(?:\s|$)")
_OCTAL: Final = frozenset("01234567")
_OD_DIGITS: Final = 7  # of an offset in octal
_WIDTH: Final = 16  # bytes of a row, unless two rows say otherwise
_MOST: Final = 4096  # rows that are written again in one text


class _DumpRow(NamedTuple):
    lead: str
    offset: str
    rest: str


def with_repeats(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, each `*` between two rows of a dump as the rows for which it stands."""
    above: list[_DumpRow] = []  # the last two rows
    held: tuple[int, str] | None = None
    left = _MOST
    for number, line in lines:
        if above and line.strip() == "*":
            held = held or (number, line)
            continue
        row = _row(line)
        if held is not None:
            rows = _between(above, row.offset) if row is not None else ()
            if 0 < len(rows) <= left:
                left -= len(rows)
                for text in rows:
                    yield held[0], text
            else:
                yield held
            held = None
        above = [*above[-1:], row] if row is not None and row.rest else []
        yield number, line
    if held is not None:
        yield held


def _row(line: str) -> _DumpRow | None:
    match = _ROW.match(line.rstrip("\r\n"))
    return None if match is None else _DumpRow(match["lead"], match["offset"], match["rest"] or "")


def _between(above: list[_DumpRow], following: str) -> list[str]:
    """The rows between the last one and the next offset; none where the offsets do not say how many."""
    last = above[-1]
    for base in _bases(above, following):
        begin, end = int(last.offset, base), int(following, base)
        width = begin - int(above[0].offset, base) if len(above) > 1 else _WIDTH
        count = (end - begin) // width - 1 if width > 0 else 0
        if 0 < count <= _MOST and end - begin - (count + 1) * width < width:
            digits = "o" if base == 8 else "x"
            numbers = (f"{begin + i * width:0{len(last.offset)}{digits}}" for i in range(1, count + 1))
            return [f"{last.lead}{number}{last.rest}" for number in numbers]
    return []


def _bases(above: list[_DumpRow], following: str) -> tuple[int, ...]:
    """In which base offsets can be: od writes seven octal digits before bytes."""
    offsets = [row.offset for row in above] + [following]
    if not all(len(one) == _OD_DIGITS and set(one) <= _OCTAL for one in offsets):
        return (16,)
    if len(above) > 1:
        return (16,) if int(offsets[1], 16) - int(offsets[0], 16) == _WIDTH else (8,)
    return (16, 8) if _WORDS.match(above[0].rest) else (8, 16)
