"""When things happened, in flat memory: counts by equal parts of the time, and spells of one kind of outcome."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.timebins import TimeBins

_PARTS: Final = 256
_FIRST_NS: Final = 100_000_000
_SPELLS: Final = 256  # that are remembered singly


class TimeGrid(TimeBins):
    """Counts by part of the time; a table a kind of count, made when it is first needed."""

    def __init__(self, width_ns: int = _FIRST_NS) -> None:
        super().__init__(_PARTS, width_ns)

    def add(self, kind: Hashable, times: NDArray[np.int64], weights: NDArray[np.int64] | None = None) -> None:
        """Count at these times, which need not be in order but do not lie before the first one by much."""
        if not len(times):
            return
        self.reach(int(times.min()), int(times.max()))
        counts = np.bincount(self.bins(times), weights, _PARTS).astype(np.int64)
        self.tables[kind] = self.tables[kind] + counts if kind in self.tables else counts

    def counts(self, kind: Hashable) -> NDArray[np.int64]:
        """The counts of one kind, a part each."""
        return self.tables.get(kind, np.zeros(_PARTS, np.int64))


@dataclass(slots=True)
class Spell:
    """Consecutive exchanges that ended alike: first and last time (ns), how many."""

    begin: int
    end: int
    count: int


class Spells:
    """Runs of an outcome among the exchanges of a unit; single ones are counted and not remembered."""

    def __init__(self) -> None:
        self.spells: list[Spell] = []
        self.single = 0  # outcomes that stood alone
        self.more = 0  # spells beyond those remembered
        self._open: Spell | None = None

    def add(self, hits: NDArray[np.bool_], times: NDArray[np.int64]) -> None:
        """The next exchanges: whether each ended so, and when."""
        if not hits.any():
            self._end()
            return
        edges = np.flatnonzero(np.diff(np.concatenate(([False], hits, [False])).astype(np.int8)))
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            if begin or self._open is None:
                self._end()
                self._open = Spell(int(times[begin]), int(times[end - 1]), end - begin)
            else:
                self._open.end, self._open.count = int(times[end - 1]), self._open.count + end - begin
        if not hits[-1]:
            self._end()

    def _end(self) -> None:
        spell, self._open = self._open, None
        if spell is None:
            return
        if spell.count == 1:
            self.single += 1
        elif len(self.spells) < _SPELLS:
            self.spells.append(spell)
        else:
            self.more += 1

    @property
    def all(self) -> list[Spell]:
        """All that are remembered, the one that still goes on among them."""
        lasting = self._open is not None and self._open.count > 1
        return [*self.spells, *([self._open] if lasting and self._open is not None else [])]

    @property
    def lasting(self) -> Spell | None:
        """The one that goes on."""
        return self._open
