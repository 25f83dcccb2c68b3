"""How values spread, in bounded memory: counts on a logarithmic scale, quantiles good to 9 %."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_STEPS: Final = 8  # bins an octave
_BINS: Final = 48 * _STEPS


class Spread:
    """A histogram of values from 0 up."""

    def __init__(self) -> None:
        self._counts = np.zeros(_BINS)

    def __len__(self) -> int:
        return round(self.weight)

    @property
    def weight(self) -> float:
        """How many values there are, old ones that faded counted less."""
        return float(self._counts.sum())

    @staticmethod
    def bins(values: NDArray[Any]) -> NDArray[np.intp]:
        """Where values are counted; negative ones as 0."""
        steps = np.log2(np.maximum(values, 0).astype(np.float64) + 1.0) * _STEPS
        bins: NDArray[np.intp] = np.minimum(steps, _BINS - 1).astype(np.intp)
        return bins

    def add(self, values: NDArray[Any]) -> None:
        """Count values in."""
        self.count(self.bins(values))

    def count(self, bins: NDArray[np.intp]) -> None:
        """Count values in, given by their `bins`."""
        self._counts += np.bincount(bins, minlength=_BINS)

    def fade(self) -> None:
        """Let all values so far count half."""
        self._counts /= 2

    def quantile(self, share: float) -> float | None:
        """The upper edge of the bin where it lies; None without values."""
        total = self.weight
        if not total:
            return None
        edge = int(np.searchsorted(np.cumsum(self._counts), share * total))
        return float(2 ** ((min(edge, _BINS - 1) + 1) / _STEPS) - 1)


# Columns that wait until there are enough of them for one pass, for what learns but need not speak yet.


Columns = tuple[NDArray[Any], ...]


class ColumnQueue:
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
