"""Streams of any length in flat memory: numbers thinned evenly, counts by parts of the time, crowded stretches of times."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.bins import TimeBins
from ..tables.schema import Bools, Float64s, Int64s

_THINNED_MOST: Final = 512
_MODE: Final = 0.12  # width of the densest numbers, of themselves


@dataclass(slots=True, eq=False, repr=False)
class Thinned:
    """Every so many-eth number of those added; `numbers` are those remembered, in their order."""

    count: int = 0
    total: float = 0.0
    numbers: Float64s = field(default_factory=lambda: np.zeros(0))
    _stride: int = 1
    _ordered: Float64s | None = None  # once somebody asks for a quantile

    @classmethod
    def of(cls, numbers: NDArray[Any], weight: float) -> Thinned:
        """Numbers each of which stands for so many."""
        return cls(round(len(numbers) * weight), float(numbers.sum()) * weight, numbers.astype(np.float64))

    def __len__(self) -> int:
        return self.count

    def add(self, numbers: NDArray[Any]) -> None:
        """More of the stream."""
        self._ordered = None
        first = -self.count % self._stride
        self.count += len(numbers)
        self.total += float(numbers.sum())
        self.numbers = np.concatenate((self.numbers, numbers[first :: self._stride]))
        while len(self.numbers) > _THINNED_MOST:
            self.numbers = self.numbers[::2]
            self._stride *= 2

    def quantile(self, share: float) -> float | None:
        """A quantile of those remembered; None without any."""
        if not len(self.numbers):
            return None
        if self._ordered is None:
            self._ordered = np.sort(self.numbers)
        low, part = divmod(share * (len(self._ordered) - 1), 1)  # as `np.quantile` does, whose checks take far longer
        first = float(self._ordered[int(low)])
        return first + part * (float(self._ordered[int(low) + 1]) - first) if part else first

    @property
    def mean(self) -> float:
        """Of all that were added; 0 without any."""
        return self.total / max(self.count, 1)

    def below(self, bound: float) -> float:
        """The share of numbers under a bound; 0 without any."""
        return float((self.numbers < bound).mean()) if len(self.numbers) else 0.0

    def above(self, bound: float) -> float:
        """The share of numbers over a bound; 0 without any."""
        return float((self.numbers > bound).mean()) if len(self.numbers) else 0.0


def densest(numbers: Float64s) -> float:
    """The median of those positive numbers that lie closest together, a window of an eighth wide; 0 for none."""
    ordered = np.sort(numbers[numbers > 0])
    if not len(ordered):
        return 0.0
    ends = np.searchsorted(ordered, ordered * (1 + _MODE), side="right")
    begin = int(np.argmax(ends - np.arange(len(ordered))))
    return float(np.median(ordered[begin : int(ends[begin])]))


_PARTS: Final = 256
_FIRST_NS: Final = 100_000_000
_SPELLS: Final = 256  # that are remembered singly
_DOUBTFUL: Final = 0.25  # of a spell


class TimeGrid(TimeBins):
    """Counts by part of the time; a table a kind of count, made when it is first needed."""

    def __init__(self, width_ns: int = _FIRST_NS) -> None:
        super().__init__(_PARTS, width_ns)

    def add(self, kind: Hashable, times: Int64s, weights: Int64s | None = None) -> None:
        """Count at these times, which need not be in order but do not lie before the first one by much."""
        if not len(times):
            return
        self.reach(int(times.min()), int(times.max()))
        counts = np.bincount(self.bins(times), weights, _PARTS).astype(np.int64)
        self.tables[kind] = self.tables[kind] + counts if kind in self.tables else counts

    def counts(self, kind: Hashable) -> Int64s:
        """The counts of one kind, a part each."""
        return self.tables.get(kind, np.zeros(_PARTS, np.int64))


@dataclass(slots=True)
class Spell:
    """Consecutive exchanges that ended alike: first and last time (ns), how many; the times of the exchanges before and
    behind them, None where there was none; `doubtful`: how many among them of which nobody knows; `visits`: how many of
    them repeat no request."""

    begin: int
    end: int
    count: int
    after: int | None = None
    before: int | None = None
    doubtful: int = 0
    visits: int = 0

    @property
    def is_sure(self) -> bool:
        """Whether few of its exchanges are doubtful."""
        return self.doubtful <= _DOUBTFUL * self.count


@dataclass(slots=True, eq=False)
class Spells:
    """Runs of an outcome among the exchanges of a unit; single ones are counted and not remembered."""

    spells: list[Spell] = field(default_factory=list)
    single: int = 0  # outcomes that stood alone
    more: int = 0  # spells beyond those remembered
    _open: Spell | None = None
    _well: int | None = None  # the time of the newest exchange that ended otherwise
    _doubtful: int = 0  # exchanges so far
    _seen: int = 0  # of them before the open spell

    def pass_over(self, time: int) -> None:
        """The next exchanges, the newest of which was then, ended otherwise; none goes on."""
        self._well = time

    def add(self, hits: Bools, times: Int64s, doubtful: Bools, repeats: Bools) -> None:
        """The next exchanges: whether each ended so, and when; doubtful ones end no run and make none longer. `repeats`:
        those that are asked once more."""
        first = ~repeats
        seen = self._doubtful + doubtful.cumsum()
        self._doubtful += int(np.count_nonzero(doubtful))
        known = ~doubtful
        hits, times, seen, first = hits[known], times[known], seen[known], first[known]
        if not len(hits):
            return
        if self._open is not None and not hits[0]:
            self._end(self._open, int(times[0]))
        edges = np.flatnonzero(np.diff(np.concatenate(([False], hits, [False])).astype(np.int8)))
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            spell = self._open
            if spell is None:
                after = int(times[begin - 1]) if begin else self._well
                spell, self._seen = Spell(int(times[begin]), 0, 0, after), int(seen[begin])
            spell.end, spell.count = int(times[end - 1]), spell.count + end - begin
            spell.visits += int(first[begin:end].sum())
            spell.doubtful = int(seen[end - 1]) - self._seen
            self._open = spell
            if end < len(hits):
                self._end(spell, int(times[end]))
        if not hits[-1]:
            self._well = int(times[-1])

    def _end(self, spell: Spell, before: int) -> None:
        spell.before, self._open = before, None
        if spell.count == 1:
            self.single += 1
        elif len(self.spells) < _SPELLS:
            self.spells.append(spell)
        else:
            self.more += 1

    @property
    def all(self) -> list[Spell]:
        """All that are remembered and sure, the one that still goes on among them."""
        lasting = self.lasting
        found = [*self.spells, *([lasting] if lasting is not None and lasting.count > 1 else [])]
        return [spell for spell in found if spell.is_sure]

    @property
    def is_open(self) -> bool:
        """Whether one goes on."""
        return self._open is not None

    @property
    def lasting(self) -> Spell | None:
        """The one that goes on, if it is sure."""
        return self._open if self._open is not None and self._open.is_sure else None


_STRETCH_NS: Final = 128_000_000_000
_TIMES_MOST: Final = 1024
_MOST_OF_ONE: Final = 256


@dataclass(slots=True, eq=False)
class CrowdedTimes:
    """Some of the times added (ns), about in order: those of the stretches that have most."""

    _begin: int | None = None
    _stretches: dict[int, Int64s] = field(default_factory=dict)  # by their place, in order; the last one is open

    def add(self, times: NDArray[Any]) -> None:
        """More of the stream, in whatever portions."""
        if not len(times):
            return
        times, kept = times.astype(np.int64), self._stretches
        self._begin = int(times[0]) if self._begin is None else self._begin
        places = np.maximum.accumulate(np.maximum((times - self._begin) // _STRETCH_NS, max(kept, default=0)))
        for place in np.unique(places).tolist():
            kept[place] = np.concatenate((kept.get(place, times[:0]), times[places == place]))[:_MOST_OF_ONE]
            closed = list(kept)[:-1]
            while sum(len(kept[each]) for each in closed) > _TIMES_MOST:
                fewest = min(reversed(closed), key=lambda each: len(kept[each]))
                closed.remove(fewest)
                del kept[fewest]

    @property
    def numbers(self) -> Float64s:
        """Those remembered, in their order."""
        return np.concatenate([np.zeros(0), *self._stretches.values()])
