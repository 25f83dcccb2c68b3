"""How exchanges of a unit fare behind those of others."""

from __future__ import annotations

from collections import Counter
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Bools
from ..tables.transactions import ECHOED
from .exchanges import Ending
from .exchangetable import AskedRows, ExchangeTable
from .flatmemory import Thinned

_UNITS: Final = 256
Pairs = Counter[tuple[int, int]]


class Successors:
    """Counts by (unit, neighbour)."""

    def __init__(self, table: ExchangeTable) -> None:
        self._table, rows = table, table.kept
        self.asked, self.hit = self._counts(rows, rows.owing)  # the neighbour: one whose answer is missing, 0 for none
        self.followed, self.met = self._counts(rows, np.maximum(rows.before, 0))  # the one right before

    def _counts(self, rows: AskedRows, neighbour: NDArray[Any]) -> tuple[Pairs, Pairs]:
        """Of all, and of those that were hit."""
        pairs, weights = rows.unit.astype(np.intp) * _UNITS + neighbour, self._table.weights(rows)
        every, hit = np.bincount(pairs, weights), np.bincount(pairs, weights * rows.odd)
        return _by_pair(every), _by_pair(hit)

    def delays(self, unit: int) -> Thinned:
        """Of its answers behind a hanging exchange of its own (ns)."""
        rows = self._table.of(unit)
        return self._delays(rows, rows.hanging == unit)

    def usual(self, unit: int) -> Thinned:
        """Of its answers behind no hanging one (ns)."""
        rows = self._table.of(unit)
        unsure = (rows.outcome_before == Ending.SILENT) & rows.repeats & ECHOED[rows.function]
        return self._delays(rows, (rows.hanging == 0) & ~unsure)

    def _delays(self, rows: AskedRows, which: Bools) -> Thinned:
        return self._table.numbers(rows[which & (rows.delay >= 0)], "delay")

    def behind(self, before: int) -> list[int]:
        """The units that were asked right behind a hanging exchange of one, itself included."""
        return sorted(unit for unit, other in self.asked if other == before)

    def rates(self, unit: int, before: int) -> tuple[int, int, int, int]:
        """Hits and exchanges of a unit right behind a hanging one of that one, and else."""
        then, then_of = self.hit[unit, before], self.asked[unit, before]
        return then, then_of, self.met_of(unit) - then, self.followed_of(unit) - then_of

    def met_of(self, unit: int) -> int:
        """Exchanges of a unit that were hit."""
        return sum(count for (mine, _), count in self.met.items() if mine == unit)

    def followed_of(self, unit: int) -> int:
        """Exchanges of a unit."""
        return sum(count for (mine, _), count in self.followed.items() if mine == unit)


def _by_pair(counts: NDArray[Any]) -> Pairs:
    return Counter({divmod(pair, _UNITS): round(float(counts[pair])) for pair in counts.nonzero()[0].tolist()})
