"""Time in equal bins over a capture whose end nobody knows: their width doubles as it grows."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Any

import numpy as np
from numpy.typing import NDArray


class TimeBins:
    """Tables whose last axis is time, in `count` equal bins from `begin_ns` on (None before the first time).

    When time runs past the last bin, pairs merge and all bins are twice as wide: `width_ns`.
    """

    def __init__(self, count: int, width_ns: int) -> None:
        self.count = count
        self.begin_ns: int | None = None
        self.width_ns = width_ns
        self.tables: dict[Hashable, NDArray[Any]] = {}

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
