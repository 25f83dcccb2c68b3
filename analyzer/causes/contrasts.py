"""What a symptom of a unit hangs on: a dozen generic contrasts, each weighed in bits against one rate for all.

A contrast parts the requests to a unit in two: by what was asked (function, quantity, address), by what went before
(rest, the unit asked before), by when (since a moment, in spells). Its bits are how much likelier the outcomes are with
a rate for each part than with one for all, by the estimator of Krichevsky and Trofimov, in which a rate pays for
itself; the choice among so many places to part at is paid for as well. So contrasts of any kind compete, for any
symptom, and a symptom that hangs on nothing has none.

Requests that the client repeats are left out where they fare as before, which is no evidence.

What may be known of a request is a row of `REQUEST_PROPERTIES`; another one needs no edit elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from math import log2
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import NO_GAP
from .exchanges import Ending
from .exchangetable import AskedRows
from .registry import Symptom

_LEAST: Final = 4  # hits, and of each side of a threshold
_AS_BEFORE: Final = 0.5  # of what is asked once more
_UNKNOWN: Final = -1  # of a property: this request has none
_LONG_AGO: Final = np.iinfo(np.int64).max
_WRITES: Final = np.isin(np.arange(256), (5, 6, 15, 16, 22, 23))

Hits = NDArray[np.bool_]
Figures = NDArray[np.int64]


class Parting(Enum):
    """How a property parts requests."""

    OVER = "over"  # a threshold
    EACH = "each"  # one value against all others


class Family(Enum):
    """What sort of thing a symptom hangs on."""

    ASKED = "asked"  # the request itself
    BEFORE = "before"  # what went before it
    TIME = "time"
    NOTHING = "nothing"


@dataclass(frozen=True, slots=True)
class Property:
    """Something that is known of each request: a figure, or -1 where it is unknown. `price`: bits that it pays for not
    being the likeliest thing; `timed`: it is a time in ns."""

    name: str
    family: Family
    way: Parting
    of: Callable[[AskedRows], Figures]
    price: float = 0.0
    timed: bool = False


class Side(NamedTuple):
    """Requests of one part, and how many of them show the symptom."""

    hits: int
    of: int

    @property
    def rate(self) -> float:
        """The share of them; 0 without any."""
        return self.hits / self.of if self.of else 0.0


@dataclass(frozen=True, slots=True)
class Contrast:
    """A symptom hangs on this: `then` the part that shows it more often, `otherwise` the rest. Of a threshold the symptom
    is above it (`over`) or below: `value` is the nearest figure with it, `spared` the nearest one without. Else `value`
    is the one figure with it."""

    name: str
    family: Family
    way: Parting
    bits: float
    then: Side
    otherwise: Side
    value: int = 0
    spared: int = 0
    over: bool = True

    @property
    def is_sharp(self) -> bool:
        """Whether it decides: nearly always then, hardly ever otherwise."""
        return self.then.rate >= _ALWAYS and self.otherwise.rate <= 1 - _ALWAYS


_ALWAYS: Final = 0.9
NO_CONTRAST: Final = Contrast("nothing", Family.NOTHING, Parting.EACH, 0.0, Side(0, 0), Side(0, 0))


def _end(rows: AskedRows) -> Figures:
    return np.where(rows.quantity > 0, rows.address + rows.quantity - 1, _UNKNOWN).astype(np.int64)


def _rest(rows: AskedRows) -> Figures:
    return np.where(rows.rest == NO_GAP, _UNKNOWN, np.maximum(rows.rest, 0))


def _outcome_before(rows: AskedRows) -> Figures:
    """A broadcast fares as it must: that it was one is told by whom it went to."""
    return np.where(rows.outcome_before == Ending.BROADCAST, Ending.OK, rows.outcome_before).astype(np.int64)


def _since_write(rows: AskedRows) -> Figures:
    """How long ago the unit was written to; as long as anything where it was not."""
    writes = rows.time[_WRITES[rows.function]]
    if not len(writes):
        return np.full(len(rows), _UNKNOWN, np.int64)
    before = np.searchsorted(writes, rows.time)
    ago = rows.time - writes[np.maximum(before - 1, 0)]
    return np.where(before > 0, ago, _LONG_AGO).astype(np.int64)


def _own_rest(rows: AskedRows) -> Figures:
    """The rest behind an exchange with the same unit; behind others it has rested for as long as it ever does."""
    rests = _rest(rows)
    return np.where((rows.before == rows.unit) | (rests == _UNKNOWN), rests, rests.max(initial=0))


REQUEST_PROPERTIES: Final = (
    Property("function", Family.ASKED, Parting.EACH, lambda rows: rows.function.astype(np.int64)),
    Property("quantity", Family.ASKED, Parting.OVER, lambda rows: rows.quantity.astype(np.int64), 0.5),
    Property("answer-bytes", Family.ASKED, Parting.OVER, lambda rows: np.where(rows.due > 0, rows.due, _UNKNOWN), 1.0),
    Property("address", Family.ASKED, Parting.OVER, lambda rows: rows.address.astype(np.int64), 1.5),
    Property("range-end", Family.ASKED, Parting.OVER, _end, 2.0),
    Property("poll", Family.ASKED, Parting.EACH, lambda rows: rows.poll, 2.5),
)
CIRCUMSTANCES: Final = (
    Property("rest", Family.BEFORE, Parting.OVER, _rest, 2.0, timed=True),
    Property("rest", Family.BEFORE, Parting.OVER, _own_rest, 2.5, timed=True),
    Property("unit-before", Family.BEFORE, Parting.EACH, lambda rows: rows.before.astype(np.int64), 2.0),
    Property("outcome-before", Family.BEFORE, Parting.EACH, _outcome_before, 2.0),
    Property("since-write", Family.BEFORE, Parting.OVER, _since_write, 2.0, timed=True),
    Property("delay", Family.BEFORE, Parting.OVER, lambda rows: rows.delay, 2.0, timed=True),
    Property("since", Family.TIME, Parting.OVER, lambda rows: rows.time, 2.0),
)


HITS_OF: Final[Mapping[Symptom, Callable[[AskedRows], tuple[Hits, Hits]]]] = {  # which show it, of which that is known
    Symptom.SILENCE: lambda rows: (rows.outcome == Ending.SILENT, np.ones(len(rows), np.bool_)),
    Symptom.DAMAGE: lambda rows: (rows.outcome == Ending.GARBAGE, rows.outcome != Ending.SILENT),
    Symptom.REFUSAL: lambda rows: (rows.outcome == Ending.EXCEPTION, rows.good),
    Symptom.BEHIND: lambda rows: (rows.heard > 0, rows.good),
}


def contrasts(rows: AskedRows, hits: Hits, tick_ns: float = 1.0) -> list[Contrast]:
    """What the hits among these requests, in their order, hang on; the best first, none that saves nothing. `tick_ns`:
    by less times do not differ."""
    again = rows.repeats
    if again.any() and hits[again].mean() > _AS_BEFORE:
        rows, hits = rows[~again], hits[~again]
    count = int(np.count_nonzero(hits))
    if count < _LEAST or count == len(hits):
        return []
    sums = RateSums(len(hits))
    found = [
        each
        for one in (*REQUEST_PROPERTIES, *CIRCUMSTANCES)
        if (each := _parted(one, one.of(rows), hits, sums, tick_ns if one.timed else 1.0)) is not None
    ]
    found += _chain(rows, hits, sums)
    return sorted((each for each in found if each.bits > 0), key=lambda each: -each.bits)


class RateSums:
    """Logarithms that the estimator needs, up to so many requests."""

    def __init__(self, most: int) -> None:
        numbers = np.arange(1, most + 1)
        self._halves = np.concatenate(([0.0], np.log2(numbers - 0.5).cumsum()))
        self._whole = np.concatenate(([0.0], np.log2(numbers).cumsum()))

    def bits(self, hits: Any, of: Any) -> Any:
        """log2 of how likely so many hits are, in their order, at a rate that nobody knows."""
        return self._halves[hits] + self._halves[of - hits] - self._whole[of]


def _parted(one: Property, values: Figures, hits: Hits, sums: RateSums, tick: float) -> Contrast | None:
    known = values != _UNKNOWN
    if one.name == "unit-before":
        known = np.ones(len(values), np.bool_)
    if np.count_nonzero(known) < 0.9 * len(known):
        return None
    values, hits = values[known], hits[known]
    return _over(one, values, hits, sums, tick) if one.way is Parting.OVER else _each(one, values, hits, sums)


def _over(one: Property, values: Figures, hits: Hits, sums: RateSums, tick: float) -> Contrast | None:
    order = np.argsort(values, kind="stable")
    values, hits = values[order], hits[order]
    ticks = np.round((values - values[len(values) // 2]) / tick)  # most of what is usual stands amid one
    edges = np.flatnonzero(ticks[1:] != ticks[:-1]) + 1  # of the first value above
    edges = edges[(edges >= _LEAST) & (edges <= len(values) - _LEAST)]
    if not len(edges):
        return None
    below = np.concatenate(([0], hits.cumsum()))
    every, size = int(below[-1]), len(hits)
    gains = sums.bits(below[edges], edges) + sums.bits(every - below[edges], size - edges) - sums.bits(every, size)
    i = int(np.argmax(gains))
    edge = int(edges[i])
    low, high = Side(int(below[edge]), edge), Side(every - int(below[edge]), size - edge)
    over = high.rate > low.rate
    bits = float(gains[i]) - log2(len(edges)) - one.price
    then, otherwise = (high, low) if over else (low, high)
    under, above = int(values[edge - 1]), int(values[edge])
    value, spared = (above, under) if over else (under, above)
    return Contrast(one.name, one.family, one.way, bits, then, otherwise, value, spared, over)


def _each(one: Property, values: Figures, hits: Hits, sums: RateSums) -> Contrast | None:
    kinds, which, of = np.unique(values, return_inverse=True, return_counts=True)
    if len(kinds) < 2:
        return None
    mine = np.bincount(which, hits, len(kinds)).astype(np.int64)
    every, size = int(mine.sum()), len(hits)
    gains = sums.bits(mine, of) + sums.bits(every - mine, size - of) - sums.bits(every, size)
    more = mine * (size - of) > (every - mine) * of  # the value that has more, so that it can be named
    gains = np.where(more, gains, -np.inf)
    i = int(np.argmax(gains))
    if not np.isfinite(gains[i]):
        return None
    bits = float(gains[i]) - log2(len(kinds)) - one.price
    then = Side(int(mine[i]), int(of[i]))
    return Contrast(one.name, one.family, one.way, bits, then, Side(every - then.hits, size - then.of), int(kinds[i]))


def _chain(rows: AskedRows, hits: Hits, sums: RateSums) -> Iterator[Contrast]:
    """Spells: whether a hit follows a hit."""
    order = np.argsort(rows.time, kind="stable")
    hits = hits[order]
    behind, now = hits[:-1], hits[1:]
    then = Side(int(np.count_nonzero(behind & now)), int(np.count_nonzero(behind)))
    otherwise = Side(int(np.count_nonzero(~behind & now)), int(np.count_nonzero(~behind)))
    every = Side(then.hits + otherwise.hits, then.of + otherwise.of)
    if then.rate <= otherwise.rate:
        return
    bits = float(sums.bits(*then) + sums.bits(*otherwise) - sums.bits(*every)) - _CHAIN_PRICE
    yield Contrast("spells", Family.TIME, Parting.EACH, bits, then, otherwise)


_CHAIN_PRICE: Final = 1.0
