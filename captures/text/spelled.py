"""Frames of ASCII mode a character a line, as programs print what they receive one by one."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Final

_CHARACTER: Final = re.compile(r"^(?P<head>(?:.{0,60}[\s:>=])?)(?P<quote>['\"]?)(?P<char>[:0-9A-F])(?P=quote)\s*$")
_LEAST: Final = 9  # characters of a frame from its colon on, without its end
_MOST: Final = 513


def whole_words(lines: Iterable[tuple[int, str]]) -> Iterator[tuple[int, str]]:
    """Lines with their numbers, those that show a frame's characters one each as one line with the number of the first.

    A frame begins with its colon; what stands before each of its characters is the same.
    """
    held: list[tuple[int, str]] = []
    head, word = "", ""
    for number, line in lines:
        shown = _CHARACTER.match(line)
        if held and shown is not None and shown["char"] != ":" and shown["head"] == head and len(word) < _MOST:
            held.append((number, line))
            word += shown["char"]
            continue
        yield from _frame(held, head, word)
        held = []
        if shown is not None and shown["char"] == ":":
            held, head, word = [(number, line)], shown["head"], ":"
        else:
            yield number, line
    yield from _frame(held, head, word)


def _frame(held: list[tuple[int, str]], head: str, word: str) -> list[tuple[int, str]]:
    return held if not held or len(word) < _LEAST else [(held[0][0], head + word)]
