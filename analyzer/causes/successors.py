"""What is right behind requests that nobody answered in time, and how much of it was hit: pairs of units, not frames.

A request is asked again when the client has given up; what comes then may be the answer to the first try, and the one
to the second hits whatever is asked next. So all that is asked of a unit in a row hangs from the first silent one on.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .thinned import Thinned

_UNITS = 256


@dataclass(slots=True)
class SuccessorTable:
    """Counts by (unit, unit of a hanging exchange right before it); 0 where what is before got its answers in time."""

    asked: Counter[tuple[int, int]] = field(default_factory=Counter)
    hit: Counter[tuple[int, int]] = field(default_factory=Counter)
    met: Counter[tuple[int, int]] = field(default_factory=Counter)  # of those that were hit: (unit, unit right before)
    followed: Counter[tuple[int, int]] = field(default_factory=Counter)  # of all: (unit, unit right before)
    delays: dict[int, Thinned] = field(default_factory=lambda: defaultdict(Thinned))  # ns, behind a hanging exchange
    lagged: dict[int, Thinned] = field(
        default_factory=lambda: defaultdict(Thinned)
    )  # the same, from the request before
    _newest: int = 0
    _last: int = 0
    _asked: int = 0

    def add(
        self,
        units: NDArray[np.uint8],
        silent: NDArray[np.bool_],
        odd: NDArray[np.bool_],
        asked: NDArray[np.int64],
        delays: NDArray[np.int64],
    ) -> None:
        """The next exchanges: `silent` those without an answer, `odd` those that were hit; `asked` when (ns), `delays`
        until answers came, -1 for none or where nobody knows."""
        seen, another = np.cumsum(silent), np.diff(units, prepend=units[:1]) != 0
        begins = np.maximum.accumulate(np.where(another, np.arange(len(units)), 0))  # of what is asked of one in a row
        hangs = seen > np.where(begins, seen[begins - 1], 0)
        if units[0] == self._newest:
            hangs[begins == 0] = True
        before = np.empty(len(units), np.int64)
        before[0], before[1:] = self._newest, np.where(hangs, units, 0)[:-1]
        lags = delays + asked - np.concatenate(([self._asked], asked[:-1]))
        self._newest, self._asked = int(units[-1]) if hangs[-1] else 0, int(asked[-1])
        late = (before == units) & (before > 0) & (delays >= 0)
        for unit in np.unique(units[late]).tolist():
            mine = late & (units == unit)
            self.delays[unit].add(delays[mine])
            self.lagged[unit].add(lags[mine])
        pairs = units * np.int64(_UNITS) + before
        beside = units * np.int64(_UNITS) + np.concatenate(([self._last], units[:-1]))
        self._last = int(units[-1])
        tables = ((self.asked, pairs), (self.hit, pairs[odd]), (self.followed, beside), (self.met, beside[odd]))
        for counts, which in tables:
            for pair, count in zip(*(each.tolist() for each in np.unique(which, return_counts=True)), strict=True):
                counts[divmod(pair, _UNITS)] += count

    def behind(self, before: int) -> list[int]:
        """The units that were asked right behind a hanging exchange of one, itself included."""
        return sorted(unit for unit, other in self.asked if other == before)

    def rates(self, unit: int, before: int) -> tuple[int, int, int, int]:
        """Hits and exchanges of a unit right behind a hanging one of that one, and else."""
        hit = sum(count for (mine, _), count in self.hit.items() if mine == unit)
        asked = sum(count for (mine, _), count in self.asked.items() if mine == unit)
        then, then_of = self.hit[unit, before], self.asked[unit, before]
        return then, then_of, hit - then, asked - then_of

    def met_of(self, unit: int) -> int:
        """Exchanges of a unit that were hit."""
        return sum(count for (mine, _), count in self.met.items() if mine == unit)

    def followed_of(self, unit: int) -> int:
        """Exchanges of a unit."""
        return sum(count for (mine, _), count in self.followed.items() if mine == unit)
