"""Columns of one length, side by side in memory each: what a structured array is to people, and faster to machines."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


class ColumnTable:
    """Named arrays of one length. `part` gives views, `take` copies."""

    __slots__ = ("_columns", "_size")

    def __init__(self, columns: Mapping[str, NDArray[Any]]) -> None:
        self._columns = columns
        self._size = len(next(iter(columns.values())))

    @classmethod
    def zeros(cls, dtype: np.dtype[Any], size: int) -> ColumnTable:
        """So many rows of nothing, with the fields of a structured type for columns."""
        return cls({name: np.zeros(size, dtype[name]) for name in dtype.names or ()})

    @classmethod
    def joined(cls, parts: Sequence[ColumnTable]) -> ColumnTable:
        """Tables of the same columns end to end, at least one."""
        if len(parts) == 1:
            return parts[0]
        return cls({name: np.concatenate([part[name] for part in parts]) for name in parts[0]._columns})

    def __len__(self) -> int:
        return self._size

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self._columns[name]

    def part(self, first: int, last: int) -> ColumnTable:
        """Rows `first` to `last` (excluded)."""
        return ColumnTable({name: column[first:last] for name, column in self._columns.items()})

    def take(self, which: NDArray[Any], names: Sequence[str] | None = None) -> ColumnTable:
        """The rows of these numbers, or where this mask is true; of all columns or of these."""
        which = which.nonzero()[0] if which.dtype == np.bool_ else which
        return ColumnTable({name: self._columns[name].take(which) for name in names or self._columns})

    def row(self, i: int) -> dict[str, Any]:
        """One row, as Python's own values."""
        return {name: column[i].item() for name, column in self._columns.items()}
