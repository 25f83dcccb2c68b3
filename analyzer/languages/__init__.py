"""The language in which reports and causes are told: one catalogue a language, English being the words in the code.

A catalogue is a TOML file of this package: `page` (words of the report, by their English), `fragments` (words that are
filled into others) and `causes` (by id: text, share, test, remedy). What a catalogue lacks is told in English.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from contextvars import ContextVar
from functools import cache
from importlib.resources import files
from typing import Any, Final

LANGUAGES: Final = ("en", "ru")
_language: ContextVar[str] = ContextVar("language", default="en")


def use(language: str) -> None:
    """Tell everything in this language from now on (in this thread, or whatever context it is)."""
    if language not in LANGUAGES:
        raise ValueError(f"no such language: {language}; there are {', '.join(LANGUAGES)}")
    _language.set(language)


@cache
def catalogue(language: str) -> Mapping[str, Any]:
    """The words of a language; none of English, whose words are in the code."""
    if language == "en":
        return {}
    return tomllib.loads(files(__name__).joinpath(f"{language}.toml").read_text(encoding="utf-8"))


def page_words(english: str) -> str:
    """Words of the report page."""
    words = catalogue(_language.get()).get("page", {})
    return str(words.get(english, english))


def cause_words(cause: str, part: str, english: str) -> str:
    """A template of a cause: `text`, `share`, `test` or `remedy`."""
    words = catalogue(_language.get()).get("causes", {})
    return str(words.get(cause, {}).get(part, english))


def filled(template: str, numbers: Mapping[str, Any]) -> str:
    """A template with its numbers, those that are words told in the language too."""
    words = catalogue(_language.get()).get("fragments", {})
    if not words:
        return template.format_map(numbers)
    return template.format_map({k: words.get(v, v) if isinstance(v, str) else v for k, v in numbers.items()})
