"""What is behind requests that nobody answered in time, and how much of it was hit: pairs of units, not frames.

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
    """Counts by (unit, unit of a hanging exchange before it); 0 where what is before got its answers in time."""

    asked: Counter[tuple[int, int]] = field(default_factory=Counter)
    hit: Counter[tuple[int, int]] = field(default_factory=Counter)
    met: Counter[tuple[int, int]] = field(default_factory=Counter)  # of those that were hit: (unit, unit right before)
    followed: Counter[tuple[int, int]] = field(default_factory=Counter)  # of all: (unit, unit right before)
    near: Counter[tuple[int, int]] = field(default_factory=Counter)  # of all: (unit, one among it and the two before)
    near_hit: Counter[tuple[int, int]] = field(default_factory=Counter)  # of those that were hit
    delays: dict[int, Thinned] = field(default_factory=lambda: defaultdict(Thinned))  # ns, behind a hanging exchange
    lagged: dict[int, Thinned] = field(
        default_factory=lambda: defaultdict(Thinned)
    )  # the same, from the request before
    usual: dict[int, Thinned] = field(default_factory=lambda: defaultdict(Thinned))  # ns, behind no hanging exchange
    _newest: int = 0
    _last: tuple[int, int] = (0, 0)  # the newest behind
    _asked: int = 0
    _unsure: bool = False
    _owing: tuple[int, int] = (0, 0)  # the unit of the newest silent request, and until when its answer may come

    def add(
        self,
        units: NDArray[np.uint8],
        silent: NDArray[np.bool_],
        unsure: NDArray[np.bool_],
        odd: NDArray[np.bool_],
        asked: NDArray[np.int64],
        delays: NDArray[np.int64],
        waits: NDArray[np.int64],
    ) -> None:
        """The next exchanges: `silent` those without an answer, `unsure` those that may have had one, `odd` those that were
        hit; `asked` when (ns), `delays` until answers came, -1 for none or where nobody knows, `waits` until the next
        request."""
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
        settled = (before == 0) & (delays >= 0) & ~np.concatenate(([self._unsure], unsure[:-1]))
        self._unsure = bool(unsure[-1])
        for unit in self.delays:
            self.usual[unit].add(delays[settled & (units == unit)])
        before = np.where(before == 0, self._owed(units, silent, asked, waits), before)
        pairs = units * np.int64(_UNITS) + before
        both = np.concatenate((self._last, units))
        right, beyond, here = both[1:-1], both[:-2], units * np.int64(_UNITS)
        self._last = int(both[-2]), int(both[-1])
        others, third = right != units, (beyond != units) & (beyond != right)
        near = [(here + units, odd), ((here + right)[others], odd[others]), ((here + beyond)[third], odd[third])]
        tables = [(self.asked, pairs), (self.hit, pairs[odd]), (self.followed, here + right),
                  (self.met, (here + right)[odd])]  # fmt: skip
        tables += [(self.near, which) for which, _ in near] + [(self.near_hit, which[hit]) for which, hit in near]
        for counts, which in tables:
            for pair, count in zip(*(each.tolist() for each in np.unique(which, return_counts=True)), strict=True):
                counts[divmod(pair, _UNITS)] += count

    def _owed(
        self,
        units: NDArray[np.uint8],
        silent: NDArray[np.bool_],
        asked: NDArray[np.int64],
        waits: NDArray[np.int64],
    ) -> NDArray[np.int64]:
        """The unit whose answer to the newest silent request may still come, by each exchange's end: within as long again
        as was waited for it; 0 for none."""
        newest = np.maximum.accumulate(np.where(silent, np.arange(1, len(units) + 1), 0))
        newest = np.concatenate(([0], newest[:-1]))
        owing = np.concatenate(([self._owing[0]], units))[newest]
        until = np.concatenate(([self._owing[1]], asked + 2 * waits))[newest]
        if silent.any():
            last = len(units) - 1 - int(np.argmax(silent[::-1]))
            self._owing = int(units[last]), int(asked[last] + 2 * waits[last])
        return np.where(asked < until, owing, 0).astype(np.int64)

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
