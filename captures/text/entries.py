"""A log's entries, a line each: JSON's objects and YAML's items that stand over several lines, or several in one."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from itertools import pairwise
from typing import Final

_OPENS: Final = re.compile(r"(\s*)(?:\[\s*|\}\s*,\s*)?\{\s*$")
_KEY: Final = re.compile(r'\s*"[^"]*"\s*:')
_ITEM: Final = re.compile(r"(\s*)- [\"']?[A-Za-z]\w*[\"']?:(?:\s|$)")
_TIMED: Final = re.compile(
    r"(?:[\"{\s'-]|^)(?:ts?|time\w*|date\w*|at|when|[\w.]*(?:time_?stamp|epoch)|(?:elapsed|uptime|t)(?:_?(?:ms|us|ns|s))?)[\"']?\s*:",
    re.IGNORECASE,
)
_MOST: Final = 1024  # lines of an entry
_NESTING: Final = re.compile(r'"(?:[^"\\]|\\.)*"?|[][{}]')
_SEVERAL: Final = re.compile(r"\}\s*,\s*\{")


def whole_entries(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, those of an indented entry as one line with the number of the first.

    An object that holds others in a list is none: they are. Items of YAML are those that have a time.
    """
    held: list[tuple[int, str]] = []
    ends = ""  # how the line begins that ends the object; of an item its indentation
    item = False
    for number, line in lines:
        opens = _OPENS.match(line)
        if held and item and (not line.strip() or not line.startswith(ends + " ") or len(held) >= _MOST):
            yield from _entry(held, _is_timed(held))
            held = []
        if held and not item:
            if line.startswith(ends):
                held.append((number, line if opens is None else "}"))
                yield from _entry(held, True)
                held = []
                if opens is None:
                    continue
            elif opens or len(held) >= _MOST or (len(held) == 1 and not _KEY.match(line)):
                yield from held
                held = []
        if held:
            held.append((number, line))
        elif opens is not None:
            held, ends, item = [(number, line)], opens[1] + "}", False
        elif (begins := _ITEM.match(line)) is not None:
            held, ends, item = [(number, line)], begins[1], True
        else:
            yield number, line
    yield from _entry(held, item and _is_timed(held))


def _is_timed(held: list[tuple[int, str]]) -> bool:
    return any(_TIMED.search(line) for _, line in held)


def _entry(held: list[tuple[int, str]], whole: bool) -> Iterator[tuple[int, str]]:
    if whole and len(held) > 1:
        yield held[0][0], " ".join(line.strip() for _, line in held)
    else:
        yield from held


def entries_of(line: str) -> list[str]:
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
