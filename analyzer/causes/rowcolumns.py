"""Rows of the deframer with the bytes that they stand for, cut and joined."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..tables.batch import Batch
from ..tables.schema import Rows


@dataclass(frozen=True, slots=True)
class RowColumns:
    """Rows of the deframer, with their bytes."""

    rows: Rows
    data: NDArray[np.uint8]

    @classmethod
    def of(cls, batch: Batch) -> RowColumns:
        """The rows of a batch."""
        return cls(batch.rows, batch.data)

    def __len__(self) -> int:
        return len(self.rows)

    def part(self, first: int, last: int) -> RowColumns:
        """Rows `first` to `last` (excluded); the bytes stay where they are."""
        return RowColumns(self.rows[first:last], self.data)

    def bytes_of(self, row: int) -> bytes:
        """The captured bytes of a row."""
        at = int(self.rows.at[row])
        return self.data[at : at + int(self.rows.length[row])].tobytes()

    def compact(self) -> RowColumns:
        """The same rows with their own bytes only."""
        if not len(self):
            return RowColumns(self.rows, np.zeros(0, np.uint8))
        at = self.rows.at
        begin, end = int(at.min()), int((at + self.rows.length).max())
        rows = self.rows.copy()
        rows.at[:] -= begin
        return RowColumns(rows, self.data[begin:end].copy())

    def followed_by(self, other: RowColumns) -> RowColumns:
        """These rows and those behind them."""
        moved = other.compact()
        moved.rows.at[:] += len(self.data)
        return RowColumns(Rows.joined((self.rows, moved.rows)), np.concatenate((self.data, moved.data)))
