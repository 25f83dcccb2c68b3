"""What is wrong with a filter, and where."""

from __future__ import annotations

from collections.abc import Iterable

from ..meant import did_you_mean


class FilterError(ValueError):
    """A filter that cannot be used: `message` says what is wrong, `column` where (from 0); the text says both."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(f"column {column + 1}: {message}")
        self.message = message
        self.column = column


def meant(word: str, words: Iterable[str]) -> str:
    """`; did you mean unit?` where a known word is near, else nothing."""
    return did_you_mean(word, words).replace(":", ";", 1)
