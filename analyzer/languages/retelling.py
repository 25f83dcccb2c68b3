"""One-line errors, and what `--help` says, in the language in use, told by what they say.

What raises them stands on floors that know no language, so a finished line is matched with the templates of the
catalogue's `errors` (`{0}: no such file`, without the file: what stands before a colon stays). What is filled in may be
such a line itself.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from typing import Final, NamedTuple

from . import catalogue, in_use

_PLACE: Final = re.compile(r"\{\d+\}")
_LONGEST: Final = 2000  # characters: a longer line is somebody's data


class _Template(NamedTuple):
    pieces: tuple[str, ...]  # the words around its places
    words: str

    def matched(self, line: str) -> re.Match[str] | None:
        """The line as this template, if it is one; most are not by the first look."""
        if not all(piece in line for piece in self.pieces):
            return None
        return re.fullmatch("(.+?)".join(map(re.escape, self.pieces)), line, re.DOTALL)


@cache
def _templates(language: str, table: str) -> tuple[_Template, ...]:
    """Those that say most first."""
    known: dict[str, str] = catalogue(language).get(table, {})
    made = [_Template(tuple(_PLACE.split(english)), words) for english, words in known.items()]
    return tuple(sorted(made, key=lambda one: -sum(map(len, one.pieces))))


def retold(line: str, table: str = "errors") -> str:
    """A line in the language in use; as it is where no template of the catalogue's table has its words."""
    templates = _templates(in_use(), table) if len(line) <= _LONGEST else ()
    return (_retold(line, templates) or line) if templates else line


def error_words(error: BaseException) -> str:
    """What an error says, in the language in use; its type where it says nothing."""
    return retold(str(error)) or type(error).__name__


def _retold(line: str, templates: tuple[_Template, ...]) -> str | None:
    if (told := _matched(line, templates)) is not None:
        return told
    for head, rest in _split(line):
        if (told := _matched(rest, templates)) is not None:
            return f"{_matched(head, templates) or head}: {told}"
    return None


def _matched(line: str, templates: tuple[_Template, ...]) -> str | None:
    for template in templates:
        if (match := template.matched(line)) is not None:
            return template.words.format(*(_retold(part, templates) or part for part in match.groups()))
    return None


def _split(line: str) -> Iterator[tuple[str, str]]:
    """What stands before each colon, and what behind."""
    for match in re.finditer(": ", line):
        if match.end() < len(line):
            yield line[: match.start()], line[match.end() :]
