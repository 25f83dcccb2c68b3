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

from . import catalogue, in_use, regrouped

_PLACE: Final = re.compile(r"\{\d+\}")
_COLONS: Final = 24  # so many at most in a line of ours
_LONGEST: Final = 2000  # characters: a longer line is somebody's data


class _Template(NamedTuple):
    pieces: tuple[str, ...]  # the words around its places
    words: str

    @property
    def weight(self) -> int:
        """How much of a line it says itself."""
        return sum(map(len, self.pieces))

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
    return tuple(sorted(made, key=lambda one: -one.weight))


def retold(line: str, table: str = "errors") -> str:
    """A line in the language in use; as it is where no template of the catalogue's table has its words."""
    templates = _templates(in_use(), table) if len(line) <= _LONGEST else ()
    return _by_templates(line, templates, {})[1] if templates else line


def error_words(error: BaseException) -> str:
    """What an error says, in the language in use; its type where it says nothing."""
    return retold(str(error)) or type(error).__name__


def _by_templates(line: str, templates: tuple[_Template, ...], known: dict[str, tuple[int, str]]) -> tuple[int, str]:
    """How many letters of a line templates have, and the line told: by one template, or what stands around a colon."""
    if line in known:
        return known[line]
    ways = [(0, regrouped(line))]
    for head, rest in _split(line):
        if (told := _by_templates(rest, templates, known))[0]:
            before = _by_templates(head, templates, known)
            ways.append((before[0] + told[0], f"{before[1]}: {told[1]}"))
    if (found := _match(line, templates)) is not None:  # last: a file's name before a colon is no part of a template
        template, match = found
        parts = [_by_templates(part, templates, known) for part in match.groups()]
        ways.append((template.weight + sum(n for n, _ in parts), template.words.format(*(part for _, part in parts))))
    known[line] = max(ways, key=lambda way: way[0])
    return known[line]


def _match(line: str, templates: tuple[_Template, ...]) -> tuple[_Template, re.Match[str]] | None:
    return next(((each, match) for each in templates if (match := each.matched(line)) is not None), None)


def _split(line: str) -> Iterator[tuple[str, str]]:
    """What stands before each colon, and what behind."""
    for match in re.finditer(": ", line) if line.count(": ") <= _COLONS else ():
        if match.end() < len(line):
            yield line[: match.start()], line[match.end() :]
