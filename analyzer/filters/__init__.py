"""The display filter: `compile_filter("unit == 17 and exception").mask(table)`.

One language for lists, exports, reports and live views. `docs/filters.md` is its reference, made from `fields`.
A table is a batch (`BatchTable`) or whatever has its columns (`Table`).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from ..errors import RtuscopeError
from ..languages import tr
from ..lazy import lazily
from ..meant import meant as nearest

if TYPE_CHECKING:
    from .completion import Completion, complete
    from .evaluation import Filter, check, compile_filter
    from .table import BatchTable, FilterTable, RowOctets, narrowed

__all__ = [
    "BatchTable",
    "Completion",
    "Filter",
    "FilterError",
    "FilterTable",
    "RowOctets",
    "check",
    "compile_filter",
    "complete",
    "narrowed",
]

_HOMES = {
    "BatchTable": "table",
    "Completion": "completion",
    "Filter": "evaluation",
    "FilterTable": "table",
    "RowOctets": "table",
    "check": "evaluation",
    "compile_filter": "evaluation",
    "complete": "completion",
    "narrowed": "table",
}


__getattr__ = lazily(__name__, _HOMES)


class FilterError(RtuscopeError, ValueError):
    """A filter that cannot be used: `message` says what is wrong, `column` where (from 0); the text says both."""

    def __init__(self, message: str, column: int) -> None:
        super().__init__(tr("column {number}: {message}", number=column + 1, message=message))
        self.message = message
        self.column = column


def meant(word: str, words: Iterable[str]) -> str:
    """`; did you mean unit?` where a known word is near, else nothing."""
    known = nearest(word, words)
    return "" if known is None else tr("; did you mean {word}?", word=known)
