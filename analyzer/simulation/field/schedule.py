"""Simulated time: what is to happen when."""

from __future__ import annotations

import heapq
from collections.abc import Callable
from itertools import count


class Schedule:
    """Actions in order of their times (ns); `now` is the time of the one that runs."""

    def __init__(self) -> None:
        self.now = 0.0
        self._order = count()
        self._waiting: list[tuple[float, int, Callable[[float], None]]] = []

    def at(self, t: float, action: Callable[[float], None]) -> None:
        """Run `action(t)` then; at once, where that time has passed."""
        heapq.heappush(self._waiting, (max(t, self.now), next(self._order), action))

    def run(self, until: float) -> None:
        """Run all that is due before `until`."""
        while self._waiting and self._waiting[0][0] < until:
            self.now, _, action = heapq.heappop(self._waiting)
            action(self.now)
