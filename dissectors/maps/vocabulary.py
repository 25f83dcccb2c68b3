"""What people write in tables of registers: `vocabulary.toml`, with the words of each language of `languages.toml`; its
expressions are compiled as they are asked for.

`tidied` puts a text right before it is read; `meaning` gives what a text means by the first line of a list that is like
it; `form` the parts of a text that has a form as a whole; `roles` what a column may be.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from functools import cache, lru_cache
from importlib.resources import files as package_files
from typing import Any, Final

WIDE_SIGNS: Final = str.maketrans("（）：；，＝／", "():;,=/")
_PART: Final = re.compile(r"\{([A-Z]+)\}")


@cache
def _file(name: str) -> dict[str, Any]:
    return tomllib.loads((package_files(__package__) / name).read_text(encoding="utf-8"))


@cache
def vocabulary() -> Mapping[str, Any]:
    """Both files: what languages add to roles and parts stands among the words of these."""
    whole = _file("vocabulary.toml")
    for said in _file("languages.toml").values():
        stands_last = said.pop("last", False)
        for key, words in said.items():
            if key.isupper():
                whole["parts"][key] += f"|{words}"
                continue
            for role, kind in _ADDED_TO.get(key, ((key, "words"),)):
                whole["roles"][role].setdefault(kind, []).append(words)
                if stands_last and kind == "words":
                    whole["roles"][role].setdefault("last", []).append(words)
    return whole


_ADDED_TO: Final = {
    "description": (("description", "words"), ("name", "maybe")),
    "scale": (("scale", "words"), ("divisor", "maybe")),
    "value": (("name", "maybe"),),
    "remark": (("description", "words"),),
}  # what a word of a language is of a role


@cache
def roles() -> Mapping[str, Mapping[str, Any]]:
    """What a column may be, by name."""
    table: Mapping[str, Mapping[str, Any]] = vocabulary()["roles"]
    return table


@lru_cache(maxsize=1024)
def expression(text: str) -> re.Pattern[str]:
    """A pattern of the file, its named parts filled in."""
    parts = vocabulary()["parts"]
    while _PART.search(text):
        text = _PART.sub(lambda name: f"(?:{parts[name[1]]})", text)
    return re.compile(text, re.DOTALL)


@cache
def _lines(kind: str) -> list[tuple[re.Pattern[str], str]]:
    return [(expression(line["like"]), line["is"]) for line in vocabulary()["meanings"][kind]]


@lru_cache(maxsize=4096)
def meaning(kind: str, text: str) -> str | None:
    """What a text means by a list of the file; None where no line is like it."""
    low = text.lower()
    found = next(((match, means) for like, means in _lines(kind) if (match := like.search(low))), None)
    return found[0].expand(found[1]) if found else None


@lru_cache(maxsize=4096)
def form(kind: str, text: str) -> Mapping[str, str]:
    """The parts of a text that has this form, those that it lacks empty; nothing where it has not."""
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
    return "" if expression("{NOTHING}").fullmatch(text) else text
