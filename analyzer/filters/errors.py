"""What is wrong with a filter, and where."""

from __future__ import annotations

from collections.abc import Iterable

from ..languages import tr
from ..meant import meant as nearest


class FilterError(ValueError):
    """A filter that cannot be used: `message` says what is wrong, `column` where (from 0); the text says both."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(tr("column {number}: {message}", number=column + 1, message=message))
        self.message = message
        self.column = column


def meant(word: str, words: Iterable[str]) -> str:
    """`; did you mean unit?` where a known word is near, else nothing."""
    known = nearest(word, words)
    return "" if known is None else tr("; did you mean {word}?", word=known)
