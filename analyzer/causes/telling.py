"""What a cause says: the words of its suspect, filled with the numbers that were found, in the language in use."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..languages import sentence
from .registry import Suspect, suspects


@dataclass(frozen=True, slots=True)
class CauseWords:
    """The four things that people are told of a cause."""

    text: str
    share: str
    deciding_test: str
    remedy: str


def words_of(suspect: Suspect, numbers: Mapping[str, Any]) -> CauseWords:
    """What a suspect says with these numbers."""

    def said(part: str, english: str) -> str:
        return sentence(suspect.cause, part, english, numbers)

    return CauseWords(
        said("text", suspect.text),
        said("share", suspect.share),
        said("test", suspect.deciding_test),
        said("remedy", suspect.remedy),
    )


def numbers_kept(numbers: Mapping[str, Any]) -> str:
    """The numbers of a cause as JSON, by which `told_again` tells it again."""
    return json.dumps(dict(numbers), ensure_ascii=False, default=_plain)


def _plain(number: Any) -> Any:
    """A scalar of numpy's as Python's."""
    return number.item() if hasattr(number, "item") else str(number)


def _as_found(number: Any) -> Any:
    """A list is a tuple in what was found."""
    return tuple(number) if isinstance(number, list) else number


def told_again(cause: str, numbers: str | None) -> CauseWords | None:
    """A cause that was kept, in the language in use now; None where this version knows no such cause, or it had other
    numbers then."""
    known = next((each for each in suspects() if each.cause == cause), None)
    if known is None or numbers is None:
        return None
    try:
        return words_of(known, {name: _as_found(number) for name, number in json.loads(numbers).items()})
    except (ValueError, LookupError, TypeError, AttributeError):
        return None
