"""How long the bits of each row took, where a capture has edges, and by that how fast senders' clocks are."""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..reports.rates import RateTable, bit_times

if TYPE_CHECKING:
    from captures.edges.spans import BitSpans

    from ..tables.schema import Rows

_NONE = np.zeros((2, 0), np.int64)


class RowBits:
    """Made before the pass over the bytes that it takes part in. One thread feeds, any may ask."""

    def __init__(self, spans: BitSpans) -> None:
        spans.want()
        self._spans = spans
        self._taken = [_NONE]
        self._lock = threading.Lock()
        self.of_all = self.rates()

    def feed(self, rows: Rows) -> None:
        """The rows that come next."""
        taken = bit_times(self._spans, rows)
        with self._lock:
            self._taken.append(taken)
        self.of_all.feed(rows, taken)

    def rates(self) -> RateTable:
        """An empty table, for some of the rows."""
        return RateTable(self._spans.bauds)

    def take(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of these rows as `bit_times` has it."""
        with self._lock:
            if len(self._taken) > 1:
                self._taken = [np.concatenate(self._taken, axis=1)]
            return self._taken[0][:, rows]
