"""Data in the source of programs, of whatever language: nested brackets as trees, comments of C, lines that declare.

    tree_of_source('{"at": 0x10, "label": "Flow"}, {"at": 0x12, "label": "Level"}')
    [{'at': '0x10', 'label': 'Flow'}, {'at': '0x12', 'label': 'Level'}]

A group in brackets is a mapping where its items have names (`name: x`, `.name = x`, `"name" => x`), else a list; texts
lose their quotes, what stands before a group goes. A list of words alone, in brackets or in a comment, and the fields
of a structure name the items of the lists below it: so do the columns of an SQL statement. No language's grammar is
known here, and nothing is run.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Any, Final

_DEEPEST: Final = 40
_TOKEN: Final = re.compile(
    r"(?P<text>\"(?:\\.|[^\"\\\n]){0,300}\"|'(?:\\.|[^'\\\n]){0,300}')|(?://|/\*|--)(?P<comment>[^\n]*?)(?:\*/|\n|$)|(?P<index>(?<=\w)\[)|(?P<open>[{(\[])"
    r"|(?P<close>[})\]])|(?P<part>[,;])|(?P<names>=>|:=|[:=])|(?P<word>[^\s\"'{}()\[\],;:=/&*]+|/|['\"])",
)
_WORD: Final = re.compile(r"[^\W\d]\w*")
_FEW: Final = 3  # words that may be names


def tree_of_source(text: str) -> Any:
    """The groups of a text that stand in no other."""
    tokens = ((match.lastgroup or "", match[match.lastgroup or 0]) for match in _TOKEN.finditer(text))
    return _BracketGroup(0).read(tokens, [()])


class _BracketGroup:
    """What stands between two brackets, as it is read: items, with names or without."""

    def __init__(self, depth: int) -> None:
        self.depth = depth
        self.listed: list[Any] = []
        self.named: dict[str, Any] = {}
        self.name = ""
        self.words: list[Any] = []
        self.declares = False  # its items end with semicolons
        self.is_quoted = False

    def read(self, tokens: Iterator[tuple[str, str]], names: list[tuple[str, ...]]) -> Any:
        """Take tokens up to the bracket that closes the group; `names` are those that lists have by what was read."""
        for kind, token in tokens:
            match kind:
                case "close" if self.depth:
                    break
                case "open" if self.depth < _DEEPEST:
                    self._nested(_BracketGroup(self.depth + 1).read(tokens, names))
                case "index" if self.depth < _DEEPEST:
                    _BracketGroup(self.depth + 1).read(tokens, [()])
                case "names":
                    self.name, self.words = str(self.words[-1] if self.words else "").lstrip("."), []
                case "part":
                    self.declares |= token == ";"
                    self._close()
                case "comment":
                    names[0] = _names(token.split(",")) or names[0]
                case "text":
                    self.is_quoted = True
                    self.words.append(token[1:-1])
                case "word":
                    self.words.append(token)
        self._close()
        return self._whole(names)

    def _nested(self, group: Any) -> None:
        """Take in a group; no sign parts those that stand in no other."""
        self.words = [group]
        if not self.depth:
            self._close()

    def _close(self) -> None:
        """End an item: a group, or the words of which it is."""
        if self.words:
            last = self.words[-1]
            item = last if isinstance(last, list | dict) or self.declares else " ".join(map(str, self.words))
            if self.name:
                self.named[self.name] = item
            else:
                self.listed.append(item)
        self.name, self.words = "", []

    def _whole(self, names: list[tuple[str, ...]]) -> Any:
        if not self.depth:
            return [*self.named.values(), *self.listed]
        if self.named:
            return self.named
        own = () if self.is_quoted else _names(self.listed)
        names[0] = own or names[0]
        is_row = len(self.listed) == len(names[0]) and not own
        return dict(zip(names[0], self.listed, strict=True)) if is_row else self.listed


def _names(items: list[Any]) -> tuple[str, ...]:
    """The items as names, where all of them are words; else none."""
    words = [str(item).strip().strip("*").split("[")[0] for item in items]
    return tuple(words) if len(words) >= _FEW and all(map(_WORD.fullmatch, words)) else ()
