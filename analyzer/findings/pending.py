"""Columns that wait until there are enough of them for one pass, for what learns but need not speak yet."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Columns = tuple[NDArray[Any], ...]


class Pending:
    """Columns of one length, put end to end as they come."""

    def __init__(self) -> None:
        self._parts: list[Columns] = []
        self._rows = 0

    def __len__(self) -> int:
        return self._rows

    def add(self, *columns: NDArray[Any]) -> None:
        """More of each column, in the same order each time."""
        if len(columns[0]):
            self._parts.append(columns)
            self._rows += len(columns[0])

    def take(self) -> Columns:
        """All that waits, which waits no longer; at least one row must."""
        parts, self._parts, self._rows = self._parts, [], 0
        return parts[0] if len(parts) == 1 else tuple(np.concatenate(column) for column in zip(*parts, strict=True))
