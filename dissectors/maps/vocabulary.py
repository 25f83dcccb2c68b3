"""What people write in tables of registers: `vocabulary.toml`, with the words of each language of `languages.toml`; its
expressions are compiled as they are asked for.

`tidied` puts a text right before it is read; `meaning` gives what a text means by the first line of a list that is like
it; `form` the parts of a text that has a form as a whole; `roles` what a column may be.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from copy import deepcopy
from functools import cache, lru_cache
from importlib.resources import files as package_files
from typing import Any, Final

WIDE_SIGNS: Final = str.maketrans("（）：；，＝／", "():;,=/")
_PART: Final = re.compile(r"\{([A-Z]+)\}")
_LATIN: Final = re.compile(r"(?<!\\)[A-Za-z]")
_BEYOND_LATIN: Final = "\u0370"  # Greek and all that follows


def is_narrow(text: str) -> bool:
    """Whether a text has Latin letters alone, and signs."""
    return text.isascii() or max(text) < _BEYOND_LATIN


@cache
def _file(name: str) -> dict[str, Any]:
    return tomllib.loads((package_files(__package__) / name).read_text(encoding="utf-8"))


def vocabulary() -> Mapping[str, Any]:
    """The file, without what languages add to its roles and parts."""
    return _file("vocabulary.toml")


@cache
def _words(narrow: bool) -> tuple[Mapping[str, str], Mapping[str, Mapping[str, Any]]]:
    """Parts of expressions and roles, among their words those of languages; of `narrow` texts without words that have
    no Latin letters."""
    parts, table = dict(vocabulary()["parts"]), deepcopy(vocabulary()["roles"])
    for said in _file("languages.toml").values():
        latin = {key: words for key, words in said.items() if key != "last" and (not narrow or _LATIN.search(words))}
        for key, words in latin.items():
            if key.isupper():
                parts[key] += f"|{words}"
                continue
            for role, kind in _ADDED_TO.get(key, ((key, "words"),)):
                table[role].setdefault(kind, []).append(words)
                if said.get("last") and kind == "words":
                    table[role].setdefault("last", []).append(words)
    return parts, table


_ADDED_TO: Final = {
    "description": (("description", "words"), ("name", "maybe")),
    "scale": (("scale", "words"), ("divisor", "maybe")),
    "value": (("name", "maybe"),),
    "remark": (("description", "words"),),
}  # what a word of a language is of a role


def roles(*, narrow: bool = False) -> Mapping[str, Mapping[str, Any]]:
    """What a column may be, by name."""
    return _words(narrow)[1]


@lru_cache(maxsize=1024)
def expression(text: str, *, narrow: bool = False) -> re.Pattern[str]:
    """A pattern of the file, its named parts filled in."""
    parts, _ = _words(narrow)
    while _PART.search(text):
        text = _PART.sub(lambda name: f"(?:{parts[name[1]]})", text)
    return re.compile(text, re.DOTALL)


@cache
def _lines(kind: str, narrow: bool) -> list[tuple[re.Pattern[str], str]]:
    return [(expression(line["like"], narrow=narrow), line["is"]) for line in vocabulary()["meanings"][kind]]


@lru_cache(maxsize=4096)
def meaning(kind: str, text: str) -> str | None:
    """What a text means by a list of the file; None where no line is like it."""
    low = text.lower()
    found = next(((match, means) for like, means in _lines(kind, is_narrow(low)) if (match := like.search(low))), None)
    return found[0].expand(found[1]) if found else None


@lru_cache(maxsize=4096)
def form(kind: str, text: str) -> Mapping[str, str]:
    """The parts of a text that has this form, those that it lacks empty; nothing where it has not."""
    match = expression(vocabulary()["forms"][kind], narrow=is_narrow(text)).fullmatch(text)
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
