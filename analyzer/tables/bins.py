"""Bins, which hold a stream of any length in flat memory: of durations, for their percentiles, of values, and of time.

Durations: a histogram whose bins are 1 % wide, on a logarithmic scale. From 1 us to 1000 s that is 2084 counters
however many come, and a percentile read from it is within 0.5 %. Values: counts on a logarithmic scale, quantiles good
to 9 %; old ones may fade. Time: equal bins over a capture whose end nobody knows; their width doubles as it grows.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_LOW_NS: Final = 1_000
_STEP: Final = math.log(1.01)
_BINS: Final = math.ceil(math.log(1_000_000_000_000 / _LOW_NS) / _STEP) + 1


class Histogram:
    """Times seen so far."""

    __slots__ = ("_bins", "_sum", "least", "most")

    _bins: NDArray[np.int64]
    least: int
    most: int
    _sum: int

    def __init__(self) -> None:
        self._bins = np.zeros(_BINS, np.int64)
        self.least = np.iinfo(np.int64).max
        self.most = 0
        self._sum = 0

    def add(self, times_ns: NDArray[np.int64]) -> None:
        """Count some; at least one, none negative."""
        scaled = np.log(np.maximum(times_ns, _LOW_NS) / _LOW_NS) / _STEP
        self._bins += np.bincount(np.minimum(scaled.astype(np.intp), _BINS - 1), minlength=_BINS)
        self.least = min(self.least, int(times_ns.min()))
        self.most = max(self.most, int(times_ns.max()))
        self._sum += int(times_ns.sum())

    def __len__(self) -> int:
        return int(self._bins.sum())

    def quantiles(self, *shares: float) -> list[int]:
        """Times, ns, that so much of all are not above (nearest rank); at least one must have been counted."""
        below = np.cumsum(self._bins)
        indices = [int(np.searchsorted(below, math.ceil(share * int(below[-1])))) for share in shares]
        middles = [round(_LOW_NS * math.exp((index + 0.5) * _STEP)) for index in indices]
        return [min(max(middle, self.least), self.most) for middle in middles]

    @property
    def mean(self) -> int:
        """Their mean, ns."""
        return self._sum // len(self)


class TimeBins:
    """Tables whose last axis is time, in `count` equal bins from `begin_ns` on (None before the first time).

    When time runs past the last bin, pairs merge and all bins are twice as wide: `width_ns`.
    """

    count: int
    begin_ns: int | None
    width_ns: int
    tables: dict[Hashable, NDArray[Any]]

    def __init__(self, count: int, width_ns: int) -> None:
        self.count = count
        self.begin_ns = None
        self.width_ns = width_ns
        self.tables = {}

    def reach(self, first_ns: int, last_ns: int) -> int:
        """Makes room for times from `first_ns` (the first call's is where the bins begin) to `last_ns`; the begin."""
        if self.begin_ns is None:
            self.begin_ns = first_ns
        while last_ns - self.begin_ns >= self.width_ns * self.count:
            self.width_ns *= 2
            for name, table in self.tables.items():
                pairs = table.reshape(*table.shape[:-1], -1, 2).sum(axis=-1)
                self.tables[name] = np.concatenate((pairs, np.zeros_like(pairs)), axis=-1)
        return self.begin_ns

    def bins(self, times: NDArray[np.int64]) -> NDArray[np.int64]:
        """The bin of each time; those before the first one or past the last one are counted there."""
        return np.clip((times - (self.begin_ns or 0)) // self.width_ns, 0, self.count - 1)


_STEPS: Final = 8  # bins an octave
_SPREAD_BINS: Final = 48 * _STEPS


class Spread:
    """A histogram of values from 0 up."""

    _counts: NDArray[np.float64]

    def __init__(self) -> None:
        self._counts = np.zeros(_SPREAD_BINS)

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
        bins: NDArray[np.intp] = np.minimum(steps, _SPREAD_BINS - 1).astype(np.intp)
        return bins

    def add(self, values: NDArray[Any]) -> None:
        """Count values in."""
        self.count(self.bins(values))

    def count(self, bins: NDArray[np.intp]) -> None:
        """Count values in, given by their `bins`."""
        self._counts += np.bincount(bins, minlength=_SPREAD_BINS)

    def fade(self) -> None:
        """Let all values so far count half."""
        self._counts /= 2

    def quantile(self, share: float) -> float | None:
        """The upper edge of the bin where it lies; None without values."""
        total = self.weight
        if not total:
            return None
        edge = int(np.searchsorted(np.cumsum(self._counts), share * total))
        return float(2 ** ((min(edge, _SPREAD_BINS - 1) + 1) / _STEPS) - 1)


# Columns that wait until there are enough of them for one pass, for what learns but need not speak yet.


Columns = tuple[NDArray[Any], ...]


class ColumnQueue:
    """Columns of one length, put end to end as they come."""

    _parts: list[Columns]
    _rows: int

    def __init__(self) -> None:
        self._parts = []
        self._rows = 0

    def __len__(self) -> int:
        return self._rows

    def add(self, *columns: NDArray[Any]) -> None:
        """More of each column, in the same order each time."""
        if len(columns[0]):
            self._parts.append(columns)
            self._rows += len(columns[0])

    def take_rows(self) -> Columns:
        """All that waits, which waits no longer; at least one row must."""
        parts, self._parts, self._rows = self._parts, [], 0
        return parts[0] if len(parts) == 1 else tuple(np.concatenate(column) for column in zip(*parts, strict=True))
