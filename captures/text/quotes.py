"""Lines of a letter that its answer quotes: `>` before each of them, which is no arrow there."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final

_SIGN: Final = re.compile(r"[ \t]{0,3}>(?=[ \t>]|$)[ \t]?")
_WORD: Final = re.compile(r"(?<![\w\\])(?=\w*[g-zG-Z\u0400-\u04ff])[A-Za-z\u0400-\u04ff]\w+|[{}]")
_LEAST: Final = 3  # lines
_MOST: Final = 256  # lines of a letter that are looked at


def unquoted(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, those that stand together behind such signs without them, however deep.

    Bytes alone behind `>` are what somebody sent; where there are words as well, and no line with another sign, they
    are quoted.
    """
    held: list[tuple[int, str]] = []
    decided = quoting = False
    for number, line in lines:
        if _SIGN.match(line) is None:
            yield from _unquoted(held) if _are_quoted(held) else held
            held, decided, quoting = [], False, False
            yield number, line
        elif decided:
            yield number, _bare(line) if quoting else line
        else:
            held.append((number, line))
            if len(held) == _MOST:
                decided, quoting = True, _are_quoted(held)
                yield from _unquoted(held) if quoting else held
                held = []
    yield from _unquoted(held) if _are_quoted(held) else held


def _are_quoted(held: list[tuple[int, str]]) -> bool:
    return len(held) >= _LEAST and any(_WORD.search(_bare(line)) for _, line in held)


def _unquoted(held: list[tuple[int, str]]) -> list[tuple[int, str]]:
    return [(number, _bare(line)) for number, line in held]


def _bare(line: str) -> str:
    while (sign := _SIGN.match(line)) is not None:
        line = line[sign.end() :]
    return line
