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

from .roles import is_heading, known_headings
from .vocabulary import expression, form, tidied, vocabulary
from .written import numbers_in

_DEEPEST: Final = 40
_TOKEN: Final = re.compile(
    r"(?P<text>\"(?:\\.|[^\"\\\n]){0,300}\"|'(?:\\.|[^'\\\n]){0,300}')|(?://+!?|/\*+|--|#+(?=\s))(?P<comment>[^\n]*?)(?:\*/|(?=\n|$))|(?P<index>(?<=\w)\[)|(?P<open>[{(\[])"
    r"|(?P<close>[})\]])|(?P<part>[,;])|(?P<names>=>|:=|[:=])|(?P<word>[^\s\"'{}()\[\],;:=/&*]+|/|['\"])",
)
_WORD: Final = re.compile(r"[^\W\d]\w*(?: \w+){0,3}")
_CONSTANTS: Final = 1 << 16  # characters in which constants are declared
_LINE: Final = 200  # characters of one that declares a field
_FEW: Final = 3  # words that may be names
_MOST_NAMES: Final = 60  # lists of them


Fields = dict[str, str]  # names in their order, with what each is where nothing is said


class Remark(str):
    """A comment that has a line of its own: it speaks of what follows."""

    __slots__ = ()


def tree_of_source(text: str) -> Any:
    """The groups of a text that stand in no other, by their names where several have one, and the remarks between."""
    text = with_constants(tidied.__wrapped__("source", text))
    tokens = ((str(match.lastgroup), _token(match)) for match in _TOKEN.finditer(text))
    found = _BracketGroup(0).read(tokens, [{}, *_fields_in(text)])
    if sum(isinstance(one, _NamedGroup) for one in found) > 1:
        return found
    return [part for one in found for part in (one.values() if isinstance(one, _NamedGroup) else (one,))]


class _NamedGroup(dict[str, Any]):
    """A group with the name that it was given."""


def _token(match: re.Match[str]) -> str:
    """What a token says; a comment is a remark where nothing stands before it on its line."""
    kind = str(match.lastgroup)
    line = match.string.rfind("\n", 0, match.start()) + 1
    before = match.string[line : match.start()] if kind == "comment" else kind
    return match[kind] if before.strip() else Remark(match[kind].strip(" *"))


def with_constants(text: str) -> str:
    """A text in which sums of a constant and a number are the number that comes of it."""
    found = expression(vocabulary()["constant"]).finditer(text[:_CONSTANTS])
    constants = {said["name"]: numbers_in(said["number"])[0] for said in found}

    def number(sum_of: re.Match[str]) -> str:
        known = sum_of["name"] in constants
        return hex(constants[sum_of["name"]] + numbers_in(sum_of["number"])[0]) if known else sum_of[0]

    return expression(vocabulary()["sum"]).sub(number, text) if constants else text


def _fields_in(text: str) -> list[Fields]:
    """The fields that a text declares, a line each, by what declares them; with what they are where nothing is said."""
    found: list[Fields] = [{}]
    for line in text.splitlines():
        field = form("field", line[:_LINE])
        if field:
            found[-1][field["name"]] = field["usual"].strip("\"'")
        elif line.strip():
            found.append({})
    return [*filter(lambda fields: len(fields) >= _FEW, found)]  # of fewer there are too many to try


class _BracketGroup:
    """What stands between two brackets, as it is read: items, with names or without."""

    def __init__(self, depth: int) -> None:
        self.depth = depth
        self.listed: list[Any] = []
        self.named: dict[str, Any] = {}
        self.name = ""
        self.words: list[Any] = []
        self.is_quoted = False
        self.label = ""  # a text which names the group behind it

    def read(self, tokens: Iterator[tuple[str, str]], names: list[Fields]) -> Any:
        """Take tokens up to the bracket that closes the group; `names` are those that lists have by what was read."""
        for kind, token in tokens:
            match kind:
                case "close" if self.depth:
                    break
                case "open" if self.depth < _DEEPEST:
                    self.name = self.name or self.label
                    self._nested(_BracketGroup(self.depth + 1).read(tokens, names))
                case "index" if self.depth < _DEEPEST:
                    _BracketGroup(self.depth + 1).read(tokens, [{}])
                case "names":
                    self.name, self.words = str(["", *self.words][-1]).lstrip("."), []
                case "part":
                    self._close()
                case "comment":
                    _put_first(names, next(filter(None, map(_names_said, expression(r"[.;:]\s").split(token))), {}))
                    if isinstance(token, Remark):
                        self._close()
                        self.listed.append(token)
                case "text" | "word":
                    if self.words and isinstance(self.words[-1], list | dict):
                        self._close()
                    self.is_quoted |= kind == "text"
                    self.label = token[1:-1] * (kind == "text")
                    self.words.append(token.strip("\"'") if kind == "text" else token)
        self._close()
        return self._whole(names)

    def _nested(self, group: Any) -> None:
        """Take in a group; no sign parts those that stand in no other."""
        before = [None, *self.words][-1]
        if isinstance(before, dict):  # what is said of a group before it
            group = {**before, "": group}
        elif isinstance(group, dict) and len(self.words) > 1:  # its kind and its name
            group = {"key": before, **group}
        self.words = [group]
        if not self.depth:
            self._close()

    def _close(self) -> None:
        """End an item: a group, or the words of which it is."""
        if self.words:
            last = self.words[-1]
            item = last if isinstance(last, list | dict) else " ".join(map(str, self.words))
            if self.name and not self.depth:
                self.listed.append(_NamedGroup({self.name: item}) if isinstance(item, list | dict) else item)
            elif self.name:
                self.named[self.name] = item
            else:
                self.listed.append(item)
        self.name, self.words, self.label = "", [], ""

    def _whole(self, names: list[Fields]) -> Any:
        if not self.depth:
            return self.listed
        items = [item for item in self.listed if not isinstance(item, Remark)]
        own = _names(items, is_quoted=self.is_quoted)
        _put_first(names, own)
        fields = {} if own else next(filter(self._may_have, names), {})
        return (
            {**fields, **dict(zip(fields, items, strict=False)), **self.named} if fields or self.named else self.listed
        )

    def _may_have(self, fields: Fields) -> bool:
        """Whether the items can be these fields: they have their names, are as many, or the last go without saying."""
        count, most = len(self.listed), len(fields)
        plain = all(type(item) is str for item in self.listed)  # no group, no remark
        fewer = plain and count < most and (any(fields.values()) if count > 1 else bool(self.named))
        return self.named.keys() <= fields.keys() and (count == most or fewer)


def _put_first(names: list[Fields], found: Fields) -> None:
    """Put the newest names in the place of those before, which stay behind them where they are headings."""
    kept = filter(lambda one: is_heading([*one]), names[:1])
    names[: found != {}] = [found, *kept] * (found != {})
    del names[_MOST_NAMES:]


def _names_said(sentence: str) -> Fields:
    """The names that a sentence of a comment lists."""
    return _names(expression(r"\s*,\s*|\s{2,}").split(form("listed", sentence).get("items", sentence)))


def _names(items: list[Any], *, is_quoted: bool = False) -> Fields:
    """The items as names, where all of them are words, or one says them all, or their first or last words are headings;
    texts must be headings, too. Else none."""
    texts = list(map(str, items))
    words = [f"{text} ".split() or [""] for text in texts]
    sentences = (text.replace(",", " ").split() for text in texts)
    lists = (one for one in sentences if 2 * known_headings(one) >= len(one))  # other sentences have headings, too
    ways = (texts, [some[0] for some in words], [some[-1] for some in words], *lists)
    listed = next((one for one in ways if len(one) >= _FEW and is_heading(one)), texts * (not is_quoted))
    names = [word.strip(" *.:").split("[")[0] for word in listed]
    return dict.fromkeys(names, "") if len(names) >= _FEW and all(map(_WORD.fullmatch, names)) else {}
