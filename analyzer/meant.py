"""What a mistyped word most likely meant: the one place that guesses."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

_BEGUN: Final = 3  # letters of a word that was begun, at least
_ALIKE: Final = 0.75  # difflib's ratio: below it words share letters, not a meaning


def meant(word: str, known: Iterable[str]) -> str | None:
    """The known word that this one begins (the shortest of several), has the letters of, or is nearest to; or None."""
    from difflib import get_close_matches

    by_fold = {name.casefold(): name for name in known}
    begun = word.casefold()
    near = sorted((name for name in by_fold if name.startswith(begun) and len(begun) >= _BEGUN), key=len)
    near = near or [name for name in by_fold if sorted(name) == sorted(begun)]
    near = near or get_close_matches(begun, list(by_fold), 1, _ALIKE)
    return by_fold[near[0]] if near else None


def did_you_mean(word: str, known: Iterable[str]) -> str:
    """`: did you mean X?`, or nothing."""
    near = meant(word, known)
    return "" if near is None else f": did you mean {near}?"
