"""Markdown of foreign words: what pages that are no report share."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from ..languages import page_words


def markdown_text(words: str) -> str:
    """Text that Markdown leaves as it is."""
    return "".join(f"\\{each}" if each in "\\|`*_<>[]#" else each for each in words)


def markdown_table(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> Iterator[str]:
    """The lines of a table; heads are words of the catalogue."""
    yield f"| {' | '.join(page_words(head) for head in heads)} |"
    yield f"|{' --- |' * len(heads)}"
    for row in rows:
        yield f"| {' | '.join(map(markdown_text, row))} |"
