"""Entries that are not a line each: lines that are one put together, and lines that are several parted.

A letter quotes lines; objects of JSON and items of YAML have one for each of their keys.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

from .candidates import H

NumberedLine = tuple[int, str]
_MOST: Final = 1024  # lines of one


class Joining(NamedTuple):
    """A way in which lines are one: how the first begins, whether a line goes on with those so far, and what they are
    then; `put` is shown the line behind them, too, which is empty at the end."""

    opens: re.Pattern[str]
    goes_on: Callable[[re.Match[str], Sequence[NumberedLine], str], bool]
    put: Callable[[re.Match[str], Sequence[NumberedLine], str], Sequence[NumberedLine]]


def joined_lines(lines: Iterable[NumberedLine], way: Joining) -> Iterator[NumberedLine]:
    """Lines with their numbers, those that are one in a way as such, with the number of the first."""
    held: list[NumberedLine] = []
    begins: re.Match[str] | None = None
    for number, line in lines:
        if begins is not None and not (len(held) < _MOST and way.goes_on(begins, held, line)):
            yield from way.put(begins, held, line)
            held, begins = [], None
        begins = begins or way.opens.match(line)
        if begins is None:
            yield number, line
        else:
            held.append((number, line))
    if begins is not None:
        yield from way.put(begins, held, "")


def _whole(held: Sequence[NumberedLine]) -> list[NumberedLine]:
    return [(held[0][0], " ".join(line.strip() for _, line in held))]


_SIGNS: Final = re.compile(r"(?:[ \t]{0,3}>(?=[ \t>]|$)[ \t]?)+")  # of a letter
_WORD: Final = re.compile(r"(?<![\w\\])(?=\w*[g-zG-Z\u0400-\u04ff])[A-Za-z\u0400-\u04ff]\w+|[{}]")
_KEY: Final = re.compile(r'\s*"[^"]*"\s*:')
_OPENS: Final = re.compile(r"(?P<indent>\s*)(?:\[\s*|\}\s*,\s*)?\{\s*$")
_ITEM: Final = re.compile(r"(?P<indent>\s*)- [\"']?[A-Za-z]\w*[\"']?:(?:\s|$)")
_TIMED: Final = re.compile(
    r"(?i)(?:[\"{\s'-]|^)(?:ts?|time\w*|date\w*|at|when|[\w.]*(?:time_?stamp|epoch)|"
    r"(?:elapsed|uptime|t)(?:_?(?:ms|us|ns|s))?)[\"']?\s*:"
)
_LEAST_QUOTED: Final = 3  # lines


def _unquoted(_: re.Match[str], held: Sequence[NumberedLine], __: str) -> Sequence[NumberedLine]:
    """Bytes alone behind `>` are what somebody sent; where there are words as well, lines are quoted, however deep."""
    bare = [(number, _SIGNS.sub("", line, count=1)) for number, line in held]
    return bare if len(held) >= _LEAST_QUOTED and any(_WORD.search(line) for _, line in bare) else held


def _is_closed(begins: re.Match[str], held: Sequence[NumberedLine]) -> bool:
    return len(held) > 1 and held[-1][1].startswith(begins["indent"] + "}")


def _is_of_object(begins: re.Match[str], held: Sequence[NumberedLine], line: str) -> bool:
    """An object that holds others in a list is none: they are."""
    if _OPENS.match(line) or _is_closed(begins, held):
        return False
    return len(held) > 1 or line.startswith(begins["indent"] + "}") or _KEY.match(line) is not None


def _object(begins: re.Match[str], held: Sequence[NumberedLine], following: str) -> Sequence[NumberedLine]:
    if _is_closed(begins, held):
        return _whole(held)
    return _whole([*held, (0, "}")]) if following.startswith(begins["indent"] + "}") else held  # `}, {`


def _item(_: re.Match[str], held: Sequence[NumberedLine], __: str) -> Sequence[NumberedLine]:
    return _whole(held) if len(held) > 1 and any(_TIMED.search(line) for _, line in held) else held


LETTER: Final = Joining(_SIGNS, lambda begins, _, line: begins.re.match(line) is not None, _unquoted)
OBJECT: Final = Joining(_OPENS, _is_of_object, _object)
ITEM: Final = Joining(  # of YAML, if it has a time
    _ITEM,
    lambda begins, _, line: bool(line.strip()) and line.startswith(begins["indent"] + " "),
    _item,
)


# A line that is several.

_NESTING: Final = re.compile(r'"(?:[^"\\]|\\.)*"?|[][{}]')
_SEVERAL: Final = re.compile(r"\}\s*,\s*\{")
_ENTRY: Final = re.compile(  # how one begins in a log,
    r"\[\d\d:\d\d:\d\d(?:\.\d+)?\]\[[A-Z]{1,2}\]\[|(?<!\S)\[[A-Z]\] ?\d+\| |"
    r"(?<![\w:.-])20\d\d-\d\d-\d\d[ T]\d\d:\d\d:\d\d[.,]\d{3} [A-Z(]|>>>>> (?=send: |recv: |extra: )"
)
_TURN: Final = re.compile(  # with its time, wherever it stands
    r"(?:[\[(]|(?<![\w:./-]))(?:(?:\d{4}[-/.]\d\d[-/.]\d\d|\d\d[-/.]\d\d[-/.]\d{4})[ T]{1,2})?"
    r"\d\d:\d\d:\d\d[.,]\d{3}(?!\d*:)"
)
_TURN_BYTES: Final = re.compile(rf"(?:(?<!\w)(?:0[xX])?{H}{{2}}(?!\w)[ ,:.-]{{0,2}}){{4}}|(?<!\w){H}{{8,}}(?!\w)")
_SIGNS_OF_CELLS: Final = ";\t|"
_SIGNS_OF_CLOCKS: Final = 4  # in a line that has two
_SEVERAL_ENTRIES: Final = 3
_LONG: Final = 120  # characters of a line that may be several entries
_LONGEST: Final = 1 << 18


def parts_of(line: str) -> list[str]:
    """A line, with log entries apart that stand in one, or whose line breaks were lost, as blanks or altogether."""
    return [turn for one in _objects_in(line) for entry in _entries_in(one) for turn in _turns_in(entry)]


def _objects_in(line: str) -> list[str]:
    """A line, or the objects apart of a list that stands in it, if each tells its time."""
    if line.lstrip()[:1] not in ("[", "{") or not _SEVERAL.search(line):
        return [line]
    depth = 0
    starts: dict[int, list[int]] = {}
    for token in _NESTING.finditer(line):
        if token[0] in "[{":
            depth += 1
            if token[0] == "{":
                starts.setdefault(depth, []).append(token.start())
        elif token[0] in "]}":
            depth -= 1
    first = min((level for level, places in starts.items() if len(places) > 1), default=0)
    if not first:
        return [line]
    parts = [line[start:end] for start, end in pairwise((*starts[first], len(line)))]
    if sum(bool(_TIMED.search(part)) for part in parts) <= len(parts) / 2:
        return [line]
    return [head, *parts] if (head := line[: starts[first][0]]).strip("[ ") else parts


def _entries_in(line: str) -> list[str]:
    """The entries of a log that stand in one line."""
    heads = [match.start() for match in _ENTRY.finditer(line)] if _LONG < len(line) <= _LONGEST else []
    ends = [*pairwise((0, *heads[heads[:1] == [0] :], len(line)))]
    return [line[start:end] for start, end in ends] if len(ends) >= _SEVERAL_ENTRIES else [line]


def _turns_in(line: str) -> list[str]:
    """The parts of a line in which several have spoken: a time and bytes behind it in each, in its cell of a table."""
    if len(line) > _LONGEST or line.count(":") < _SIGNS_OF_CLOCKS:
        return [line]
    heads = [head.start() for head in _TURN.finditer(line)]
    ends = [*pairwise((0, *heads[1:], len(line)))]
    if len(ends) < 2 or not all(_TURN_BYTES.search(line, *end) for end in ends):
        return [line]
    turns, signs = [], ""
    for start, end in ends:
        turns.append(signs + line[start:end])
        signs += "".join(filter(_SIGNS_OF_CELLS.__contains__, line[start:end]))
    return turns
