"""What people write in tables of registers: `vocabulary.toml`, with the words of each language of `languages.toml`; its
expressions are compiled as they are asked for.

`tidied` puts a text right before it is read; `meaning` gives what a text means by the first line of a list that is like
it; `form` the parts of a text that has a form as a whole; `roles` what a column may be.

There are thousands of words, and a file has few of them. A word is part of an expression from the first text on that
has its letters (`meet`): it could match no text before, and expressions stay small.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import cache, lru_cache
from importlib.resources import files as package_files
from typing import Any, Final
from unicodedata import category, normalize

WIDE_SIGNS: Final = str.maketrans("（）：；，＝／", "():;,=/")
_PART: Final = re.compile(r"\{([A-Z]+|[a-z_]+\.[a-z]+)\}")
_BRACKETS: Final = re.compile(r"\\.|\[(?:\\.|[^\]\\])+\]|[(|)]")
_INNERMOST: Final = re.compile(r"\([^()]*\)")
_PERHAPS: Final = re.compile(r".(?:[?*]|\{0?,)")
_RUN: Final = re.compile(r"[^\W\d_]+")
NEVER: Final = "(?!)"
_UNIT: Final = 3  # letters by which words are looked up
_STROKES: Final = str.maketrans({"đ": "d", "ł": "l", "ø": "o", "ı": "i", "æ": "ae", "œ": "oe", "ß": "ss"})
LONGEST_HEADING: Final = 60  # characters
WHOLE, _BEGINS, _ENDS, _MAYBE = 10.0, 6.0, 5.0, 6.0  # bits
_LEAST_END: Final = 5  # bytes of a noun that stands last in a heading: two letters of Chinese say much

_ADDED_TO: Final = {
    "description": (("description", "words"), ("name", "maybe")),
    "scale": (("scale", "words"), ("divisor", "maybe")),
    "value": (("name", "maybe"),),
    "remark": (("description", "words"),),
}  # what a word of a language is of a role


@cache
def _file(name: str) -> dict[str, Any]:
    return tomllib.loads((package_files(__package__) / name).read_text(encoding="utf-8"))


def vocabulary() -> Mapping[str, Any]:
    """The file, without what languages add to its roles and parts."""
    return _file("vocabulary.toml")


def roles() -> Mapping[str, Mapping[str, Any]]:
    """What a column may be, by name."""
    table: Mapping[str, Mapping[str, Any]] = vocabulary()["roles"]
    return table


def unaccented(text: str) -> str:
    """A text without the marks on its letters, which people leave out."""
    if text.isascii():
        return text
    bare = "".join(sign for sign in normalize("NFD", text) if category(sign) != "Mn")
    return normalize("NFC", bare).translate(_STROKES)


class _KnownWords:
    """The words of expressions by the part that they are of, each with the letters without which no text has it."""

    def __init__(self) -> None:
        self.parts: dict[str, list[tuple[str, str]]] = {}
        self.by_first: dict[str, set[str]] = {}  # letters, by the first of them
        self.met = {""}
        self.seen: set[str] = set()  # words of texts
        for part, words in _listed_words():
            self.parts.setdefault(part, []).extend((_letters_of(word), word) for word in _alternatives(words))
        for letters in {letters for words in self.parts.values() for letters, _ in words} - self.met:
            self.by_first.setdefault(letters[:_UNIT], set()).add(letters)

    @property
    def age(self) -> int:
        """Another number where more words are known."""
        return len(self.met)

    def meet(self, text: str) -> None:
        """Take in the words of a text, whichever thread reads it."""
        low = text.lower()
        words = {*_RUN.findall(low), *_RUN.findall(unaccented(low))} - self.seen
        if words:
            self.met.update(self.letters_in(" ".join(words)))
            self.seen.update(words)

    def letters_in(self, text: str) -> set[str]:
        """Which of the letters of words stand in a text, with accents or without."""
        low = text.lower()
        both = {low, unaccented(low)}
        firsts = {one[at : at + size] for one in both for size in range(1, _UNIT + 1) for at in range(len(one))}
        likely = [letters for first in firsts & self.by_first.keys() for letters in self.by_first[first]]
        return {letters for letters in likely if any(letters in one for one in both)}

    def of(self, part: str) -> str:
        """The words of a part that may stand in what was read, as alternatives."""
        return "|".join(word for letters, word in self.parts.get(part, ()) if letters in self.met) or NEVER


def _listed_words() -> Iterator[tuple[str, str]]:
    """(part, words) of both files: parts of expressions, and `ROLE.words` of headings."""
    yield from vocabulary()["parts"].items()
    for role, declared in roles().items():
        for kind in ("words", "maybe", "ends"):
            yield from ((f"{role}.{kind}", unaccented(words)) for words in declared.get(kind, ()))
    for said in _file("languages.toml").values():
        for key, words in said.items():
            for role, kind in _ADDED_TO.get(key, ((key, "words"),)) if key.islower() and key != "last" else ():
                yield f"{role}.{kind}", unaccented(words)
                yield from [(f"{role}.last", unaccented(words))] * (kind == "words" and "last" in said)
            yield from [(key, words)] * key.isupper()


def _alternatives(words: str) -> Iterator[str]:
    """What the bars part in an expression that stand in no brackets."""
    if "(" not in words:
        yield from words.split("|")
        return
    depth, begin = 0, 0
    for mark in _BRACKETS.finditer(words):
        depth += (mark[0] == "(") - (mark[0] == ")")
        if mark[0] == "|" and depth == 0:
            yield words[begin : mark.start()]
            begin = mark.end()
    yield words[begin:]


def _letters_of(word: str) -> str:
    """The longest run of letters that any text has which is like an expression."""
    if word.isalpha():
        return word.lower()
    bare, groups = _BRACKETS.sub(lambda mark: mark[0] if mark[0] in "(|)" else " ", _PART.sub(" ", word)), 1
    while groups:
        bare, groups = _INNERMOST.subn(" ", bare)
    return max(_RUN.findall(_PERHAPS.sub(" ", bare).lower()), key=len, default="")


@cache
def _words() -> _KnownWords:
    return _KnownWords()


def meet(text: str) -> None:
    """Take in a text that is going to be read."""
    _words().meet(text)


def has_met(part: str) -> bool:
    """Whether a text may have a word of a part; of none, any text."""
    return part == "" or _words().of(part) != NEVER


def known_letters(text: str) -> int:
    """How many letters known words have that stand in a text, short ones of Latin letters left out."""
    return sum(len(letters) for letters in _words().letters_in(text) if len(letters.encode()) >= _UNIT)


@lru_cache(maxsize=4096)
def _filled(text: str, age: int) -> re.Pattern[str]:  # noqa: ARG001 - of the words that it may have
    """An expression with its named parts."""
    while _PART.search(text):
        text = _PART.sub(lambda name: f"(?:{_words().of(name[1])})", text)
    return _compiled(text)


@lru_cache(maxsize=4096)
def _compiled(text: str) -> re.Pattern[str]:
    return re.compile(text, re.DOTALL)


def expression(text: str) -> re.Pattern[str]:
    """A pattern of the file, its named parts filled in."""
    return _filled(text, _words().age)


@lru_cache(maxsize=256)
def _lines(kind: str, age: int) -> list[tuple[re.Pattern[str], str]]:  # noqa: ARG001 - as of `_filled`
    return [(expression(line["like"]), line["is"]) for line in vocabulary()["meanings"][kind]]


@lru_cache(maxsize=4096)
def meaning(kind: str, text: str) -> str | None:
    """What a text means by a list of the file; None where no line is like it."""
    low = text.lower()
    meet(low)
    found = next(((match, means) for like, means in _lines(kind, _words().age) if (match := like.search(low))), None)
    return found[0].expand(found[1]) if found else None


@lru_cache(maxsize=4096)
def form(kind: str, text: str) -> Mapping[str, str]:
    """The parts of a text that has this form, those that it lacks empty; nothing where it has not."""
    meet(text)
    match = expression(vocabulary()["forms"][kind]).fullmatch(text)
    return {"": text, **match.groupdict("")} if match else {}


@lru_cache(maxsize=8192)
def tidied(kind: str, text: str) -> str:
    """A text with what is to be put right in it before it is read as this kind."""
    for line in vocabulary()["tidy"].get(kind, ()):
        text = expression(line["like"]).sub(line.get("is", ""), text)
    return text.strip()


def given(text: str) -> str:
    """A cell, or nothing where it only says that there is nothing."""
    return text * (expression("{NOTHING}").fullmatch(text) is None)


@lru_cache(maxsize=4096)
def heading_bits(text: str, role: str) -> float:
    """How much a heading, in small letters, speaks for a role: by all of it, by how it begins or by how it ends."""
    if not 0 < len(text) <= LONGEST_HEADING:
        return 0.0
    words = expression(f"{{{role}.words}}")
    last = expression(f"{{{role}.last}}$").search(text)
    ends = [mark.start() for mark in expression(r"(?<=\w)(?!\w)").finditer(text)]
    ways = (
        (WHOLE, is_whole(text, role)),
        (_BEGINS, any(words.fullmatch(text, 0, end) for end in ends)),
        (_MAYBE, expression(f"{{{role}.maybe}}").fullmatch(text)),
        (_ENDS, expression(f"{{{role}.ends}}$").search(text)),
        (_ENDS, last and len(last[0].encode()) >= _LEAST_END),
    )
    return next((bits for bits, found in ways if found), 0.0)


@lru_cache(maxsize=8192)
def roles_headed(text: str) -> Sequence[str]:
    """The roles of which a text is the heading by all of it."""
    return [role for role in roles() if is_whole(text, role)] if 0 < len(text) <= LONGEST_HEADING else []


def is_whole(text: str, role: str) -> bool:
    """Whether a heading is of a role by all of it."""
    return text == role or expression(f"{{{role}.words}}").fullmatch(text) is not None


@lru_cache(maxsize=8192)
def plain_heading(cell: str) -> str:
    """A heading in small letters without accents, its signs those of ASCII."""
    meet(cell)
    return " ".join(unaccented(cell.translate(WIDE_SIGNS).lower()).split()).strip(" :.")
