"""What a mistyped word most likely meant: the one place that guesses."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

_BEGUN: Final = 3  # letters of a word that was begun, at least


def meant(word: str, known: Iterable[str]) -> str | None:
    """The known word that this one begins, the shortest of several, or is nearest to; None where none is near."""
    from difflib import get_close_matches

    by_fold = {name.casefold(): name for name in known}
    begun = word.casefold()
    near = sorted((name for name in by_fold if name.startswith(begun) and len(begun) >= _BEGUN), key=len)
    near = near or get_close_matches(begun, list(by_fold), 1)
    return by_fold[near[0]] if near else None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`: did you mean X?`, or nothing."""
    near = meant(word, known)
    return "" if near is None else f": did you mean {near}?"
