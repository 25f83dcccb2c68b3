"""The display filter: `compile_filter("unit == 17 and exception").mask(table)`.

One language for lists, exports, reports and live views. `docs/filters.md` is its reference, made from `fields`.
A table is a batch (`BatchTable`) or whatever has its columns (`Table`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily
from .errors import FilterError as FilterError

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
