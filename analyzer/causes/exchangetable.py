"""Exchanges as the judges see them: one row a request, with what stood before it and what the client did next.

Which exchange is remembered hangs on its number, its unit and how it ended alone, however the rows came: of what is rare
all is, of what is frequent a part, spread over all of the capture as chance would spread it (an even stride would always
meet the same poll of a round). So the table is bounded, each row carries what its neighbours were, and any selection of
rows has an even part.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import NO_GAP, Bools, Columns, Float64s, Int16s, Int32s, Int64s, UInt8s
from ..tables.transactions import ECHOED, NEVER
from .exchanges import Ending, Exchanges
from .flatmemory import Thinned

_MOST: Final = 1 << 14  # rows of a bus, about, of each way to end
_LEAST: Final = 1 << 8  # and of a unit, whatever the units are
_SPREAD: Final = np.uint64(0x9E3779B97F4A7C15)  # the golden ratio: multiples of it lie evenly
_KNOWN: Final = np.isin(np.arange(256), (Ending.OK, Ending.EXCEPTION, Ending.SILENT, Ending.GARBAGE))
_ALL: Final = (1 << 64) - 1
_UNITS: Final = 256
_SORTS: Final = 16  # of exchanges of a unit
_SILENT: Final = int(Ending.SILENT)
Hashes = NDArray[np.uint64]
T = TypeVar("T")


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AskedRows(Columns):
    """Requests of which something is known. `time` in ns, or bytes before it where there are no times."""

    time: Int64s
    number: Int64s  # of the exchange
    unit: UInt8s
    function: UInt8s
    address: Int32s
    quantity: Int32s
    due: Int32s  # bytes of a right answer, 0 where nobody knows
    outcome: UInt8s
    exception: UInt8s
    got: Int16s  # as `analyzer.requests` counts it
    heard: Int32s  # bytes behind it that belong to no right frame
    rest: Int64s  # ns of silence before it; NO_GAP
    wait: Int64s  # ns to the next request, below 0 where a tap's times say so; NO_GAP where there is none
    delay: Int64s  # ns to the answer; -1
    took: Int64s  # ns to the answer's end; NO_GAP
    gap: Int64s  # ns of silence before the answer by the reads; NO_GAP
    hole: Int64s  # ns, longest silence inside the answer; 0 for none
    hole_at: Int32s  # byte of the answer before which it stands
    before: Int16s  # the unit asked before, -1 for none
    outcome_before: UInt8s  # and what became of the one before
    hanging: Int16s  # the unit of a hanging exchange right before, 0 for none
    owing: Int16s  # the unit whose answer to the newest silent request may still come, or that one; 0 for none
    repeats: Bools  # the request before
    next_same: Bools  # the client asks once more
    next_echoed: Bools  # the next request is of a function whose answer reads like it: it may be a late one
    strays: Int32s  # right answers that answer nothing
    late: Int32s  # right answers to requests before it, while its own was due or behind it

    @property
    def good(self) -> Bools:
        """Which got a whole answer; an exception is one."""
        found: Bools = self.outcome <= Ending.EXCEPTION
        return found

    @property
    def poll(self) -> Int64s:
        """What is asked for in one number, as in `Exchanges`."""
        of = self.unit.astype(np.int64) << 40 | self.function.astype(np.int64) << 32
        return of | self.address.astype(np.int64) << 16 | self.quantity

    @property
    def rested(self) -> Int64s:
        """ns from the answer's end to the next request, where both are known."""
        return self.wait - self.took

    @property
    def alone(self) -> Bools:
        """Which got no more than their answer, as far as late ones are none of it."""
        found: Bools = (self.heard == 0) & (self.strays == 0)
        return found

    @property
    def odd(self) -> Bools:
        """Which were hit: with something else behind them."""
        return ~self.alone | (self.late > 0)

    @property
    def doubtful(self) -> Bools:
        """Which of those without an answer come again, and read like it: one of the two may be the answer."""
        found: Bools = (self.outcome == _SILENT) & ECHOED[self.function] & self.next_same
        return found


@dataclass(slots=True)
class NeighbourUnits:
    """Whose exchange hangs before each: it stayed without an answer, which may still come.

    A request is asked again when the client has given up; what comes then may be the answer to the first try, and the one
    to the second hits whatever is asked next. So all that is asked of a unit in a row hangs from the first silent one on.
    """

    _newest: int = 0
    _owing: tuple[int, int] = (0, 0)  # the unit of the newest silent request, and until when its answer may come

    def of(self, exchanges: Exchanges) -> tuple[Int16s, Int16s]:
        """Of the next exchanges: the unit of a hanging one right before each, or else whose answer may still come."""
        silent = exchanges.outcome == _SILENT
        silent &= ~(ECHOED[exchanges.function] & exchanges.next_same)  # one of two echoes reads like a request
        hanging = self._hanging(exchanges.unit, silent)
        owing = np.where(hanging == 0, self._owed(exchanges, silent), hanging)
        return hanging.astype(np.int16), owing.astype(np.int16)

    def _hanging(self, units: UInt8s, silent: Bools) -> Int64s:
        """The unit of a hanging exchange right before each, 0 for none."""
        seen, another = np.cumsum(silent), np.diff(units, prepend=units[:1]) != 0
        begins = np.maximum.accumulate(np.where(another, np.arange(len(units)), 0))  # of what is asked of one in a row
        hangs = seen > np.where(begins, seen[begins - 1], 0)
        hangs |= (begins == 0) & (units[0] == self._newest)
        hanging = np.concatenate(([self._newest], np.where(hangs, units, 0)))
        self._newest = int(hanging[-1])
        return hanging[:-1]

    def _owed(self, exchanges: Exchanges, silent: Bools) -> Int64s:
        """The unit whose answer to the newest silent request may still come, by each exchange's end: within as long again
        as was waited for it; 0 for none."""
        asked, t_next = exchanges.t_asked, exchanges.t_next
        until = np.where(t_next == NEVER, asked, 2 * t_next - asked)
        newest = np.maximum.accumulate(np.concatenate(([0], np.where(silent, np.arange(1, len(asked) + 1), 0))))
        owing = np.concatenate(([self._owing[0]], exchanges.unit))[newest]
        until = np.concatenate(([self._owing[1]], until))[newest]
        self._owing = int(owing[-1]), int(until[-1])
        return np.where(asked < until[:-1], owing[:-1], 0).astype(np.int64)


@dataclass(slots=True, eq=False)
class ExchangeTable:
    """The exchanges of a bus, or an even part of each sort of them."""

    timed: bool = True  # whether waits are known
    _parts: list[AskedRows] = field(default_factory=list)
    _held: Int64s = field(default_factory=lambda: np.zeros(_UNITS * _SORTS, np.int64))
    _below: Hashes = field(default_factory=lambda: np.full(_UNITS * _SORTS, _ALL, np.uint64))  # what is remembered
    _count: int = 0  # exchanges seen
    _before: tuple[int, int] = (-1, int(Ending.OK))
    _neighbours: NeighbourUnits = field(default_factory=NeighbourUnits)
    _known: dict[Any, Any] = field(default_factory=dict)  # of the rows as they are

    def add(self, exchanges: Exchanges, times: Int64s) -> None:
        """The next exchanges; `times` tell their order."""
        self._known = {}
        every = self._asked(exchanges, times)
        self._parts.append(self._kept(every[_KNOWN.take(every.outcome)]))
        self._held += np.bincount(_sorts(self._parts[-1]), minlength=len(self._held))
        while (over := self._held > self._most).any():
            self._below[over] >>= np.uint64(1)
            self._parts = [self._kept(self.kept)]
            self._held = np.bincount(_sorts(self._parts[0]), minlength=len(self._held))

    @property
    def _most(self) -> int:
        """Rows of each sort."""
        units = int(self._held.reshape(_UNITS, -1).any(axis=1).sum())
        return max(_MOST // max(units, 1), _LEAST)

    def _kept(self, rows: AskedRows) -> AskedRows:
        return rows[_hash(rows.number) <= self._below[_sorts(rows)]]

    def _asked(self, exchanges: Exchanges, times: Int64s) -> AskedRows:
        poll, (before, outcome_before) = exchanges.poll, self._before
        units = np.concatenate(((before,), exchanges.unit)).astype(np.int16)
        outcomes = np.concatenate(((outcome_before,), exchanges.outcome)).astype(np.uint8)
        self._before = int(units[-1]), int(outcomes[-1])
        numbers = np.arange(self._count, self._count + len(exchanges))
        self._count += len(exchanges)
        return AskedRows(
            times, numbers, exchanges.unit, exchanges.function, (poll >> 16 & 0xFFFF).astype(np.int32),
            (poll & 0xFFFF).astype(np.int32), exchanges.due, exchanges.outcome, exchanges.exception, exchanges.got, exchanges.noise,
            exchanges.gap_before, _since_asked(exchanges, exchanges.t_next), exchanges.delay,
            _since_asked(exchanges, exchanges.t_answered), exchanges.answer_gap, exchanges.hole, exchanges.hole_at,
            units[:-1], outcomes[:-1], *self._neighbours.of(exchanges), exchanges.repeats,
            exchanges.next_same, exchanges.next_echoed, exchanges.strays, exchanges.late,
        )  # fmt: skip

    def known(self, key: Any, reckon: Callable[[], T]) -> T:
        """What is reckoned of the rows, once, until more come."""
        if key not in self._known:
            self._known[key] = reckon()
        found: T = self._known[key]
        return found

    @property
    def kept(self) -> AskedRows:
        """All that are remembered, in order; of rare sorts more than of others."""
        self._parts = [AskedRows.joined(self._parts)]
        return self._parts[0]

    def of(self, unit: int) -> AskedRows:
        """All of a unit that are remembered."""
        kept = self.kept
        order = self.known("order", lambda: np.argsort(kept.unit, kind="stable"))
        edges = self.known("edges", lambda: np.searchsorted(kept.unit[order], np.arange(_UNITS + 1)))
        return self.known(unit, lambda: kept[order[edges[unit] : edges[unit + 1]]])

    def even(self, rows: AskedRows) -> AskedRows:
        """An even part of what these rows stand for."""
        bound = self._bound(rows)
        return rows if bound == _ALL else rows[_hash(rows.number) <= np.uint64(bound)]

    def numbers(self, rows: AskedRows, column: str) -> Thinned:
        """A column of an even part of these rows."""
        return Thinned.of(self.even(rows).column(column), self.weight_of(rows))

    def weight_of(self, rows: AskedRows) -> float:
        """How many exchanges each row of an even part of these stands for."""
        return 2.0**64 / (self._bound(rows) + 1.0)

    def weights(self, rows: AskedRows) -> Float64s:
        """How many exchanges each of these stands for, by itself."""
        found: Float64s = 2.0**64 / (self._below[_sorts(rows)].astype(np.float64) + 1.0)
        return found

    def _bound(self, rows: AskedRows) -> int:
        return int(self._below[_sorts(rows)].min(initial=_ALL))

    @property
    def rows(self) -> AskedRows:
        """An even part of all, in order."""
        return self.known("rows", lambda: self.even(self.kept))

    @property
    def weight(self) -> float:
        """How many exchanges each of these stands for."""
        return self.weight_of(self.kept)


def _since_asked(exchanges: Exchanges, then: Int64s) -> Int64s:
    return np.where(then == NEVER, NO_GAP, then - exchanges.t_asked)


def _sorts(rows: AskedRows) -> NDArray[np.intp]:
    """The sort of each: unit, ending, whether it was hit, whether it is asked once more."""
    found = rows.unit.astype(np.intp) * _SORTS + rows.outcome * 4
    return found + rows.odd * 2 + rows.next_same


def _hash(numbers: Int64s) -> Hashes:
    """Numbers spread evenly over all 64 bits."""
    mixed = numbers.astype(np.uint64) * _SPREAD  # arrays run over without a word
    mixed ^= mixed >> np.uint64(29)
    found: Hashes = mixed * np.uint64(0xBF58476D1CE4E5B9)
    return found
