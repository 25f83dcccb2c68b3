"""What is wrong with a filter, and where."""

from __future__ import annotations

from collections.abc import Iterable


class FilterError(ValueError):
    """A filter that cannot be used: `message` says what is wrong, `column` where (from 0); the text says both."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(f"column {column + 1}: {message}")
        self.message = message
        self.column = column


def meant(word: str, known: Iterable[str]) -> str:
    """`; did you mean unit?` where a known word is near, else nothing."""
    from difflib import get_close_matches

    near = get_close_matches(word.casefold(), list(known), n=1, cutoff=0.6)
    return f"; did you mean {near[0]}?" if near else ""
