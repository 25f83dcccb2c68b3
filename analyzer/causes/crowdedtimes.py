"""Times of a stream in flat memory: those of whole stretches of it, of the stretches with the most of them.

What keeps step does so over a minute or two; times spread evenly over a week would have no neighbours to tell it by.
"""

from __future__ import annotations

from heapq import heappop, heappush
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_STRETCH_NS: Final = 128_000_000_000
_MOST: Final = 1024
_MOST_OF_ONE: Final = 256


class CrowdedTimes:
    """Some of the times added (ns), about in order."""

    __slots__ = ("_begin", "_kept", "_left", "_open", "_place")

    def __init__(self) -> None:
        self._begin: int | None = None
        self._place = 0  # of the stretch that is open
        self._open: NDArray[np.int64] = np.zeros(0, np.int64)
        self._kept: list[tuple[int, int, NDArray[np.int64]]] = []  # a heap: how many, minus the place, which
        self._left = _MOST

    def add(self, times: NDArray[Any]) -> None:
        """More of the stream, in whatever portions."""
        if not len(times):
            return
        times = times.astype(np.int64)
        if self._begin is None:
            self._begin = int(times[0])
        places = np.maximum.accumulate(np.maximum((times - self._begin) // _STRETCH_NS, self._place))
        edges = np.flatnonzero(np.diff(places)) + 1
        for part, place in zip(np.split(times, edges), places[np.append(0, edges)].tolist(), strict=True):
            if place > self._place:
                self._close(place)
            self._open = np.concatenate((self._open, part[: _MOST_OF_ONE - len(self._open)]))

    def _close(self, place: int) -> None:
        if len(self._open):
            heappush(self._kept, (len(self._open), -self._place, self._open))
            self._left -= len(self._open)
        while self._left < 0:
            self._left += heappop(self._kept)[0]
        self._place, self._open = place, np.zeros(0, np.int64)

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Those remembered, in their order."""
        stretches = sorted(self._kept, key=lambda one: -one[1])
        return np.concatenate([*(times for _, _, times in stretches), self._open]).astype(np.float64)
