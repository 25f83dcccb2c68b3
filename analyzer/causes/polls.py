"""What the master asks for, poll by poll: how often, with which success, again, and what comes behind each.

A request is asked again when the client has given up; what comes then may be the answer to the first try, and the one
to the second hits whatever is asked next. So all that is asked of a unit in a row hangs from the first silent one on.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ..tables.schema import Bools, Float64s, Int64s, UInt8s
from ..tables.transactions import ECHOED, NEVER
from .exchanges import Ending, Exchanges, Stretch
from .flatmemory import Thinned

_POLLS: Final = 4096
_SEVERAL: Final = 3  # times
_RING: Final = 32  # intervals of a poll that are remembered, the newest
_BITS_OF: Final = {1: 1, 2: 1, 3: 16, 4: 16, 23: 16}  # of one thing that is asked for
_HOLDS: Final = np.isin(np.arange(256), tuple(_BITS_OF))
_OK, _EXCEPTION, _SILENT, _KINDS = int(Ending.OK), int(Ending.EXCEPTION), int(Ending.SILENT), len(Ending)
_REPEATS, _FIRST, _LAST, _TIMED, _WIDTH = range(_KINDS, _KINDS + 5)  # behind the outcomes: sums and times of a poll
_SLOTS: Final = 64


@dataclass(frozen=True, slots=True)
class Poll:
    """One poll: a unit asked for so many things from an address on, by a function.

    `first` and `last` are times (ns) of requests, `intervals` (ns) some from one to the next, repeated ones left out,
    `waits` (ns) some from the end of one that stayed without an answer to the next request of any poll, `asked` how many
    requests, without those that are the tap's own echo.
    """

    unit: int
    function: int
    address: int
    quantity: int
    first: int
    last: int
    outcomes: Int64s
    repeats: int
    exceptions: Counter[int]
    intervals: Int64s
    waits: Float64s
    asked: int

    @property
    def number(self) -> int:
        """What it asks for in one number, as in `Exchanges.poll`."""
        return self.unit << 40 | self.function << 32 | self.address << 16 | self.quantity

    @property
    def key(self) -> int:
        """Function, address and quantity as one number, as `contrasts` has it."""
        return (self.function << 32) + (self.address << 16) + self.quantity

    @property
    def end(self) -> int:
        """The address behind the last that it asks for."""
        return self.address + self.quantity

    @property
    def about_bytes(self) -> int:
        """Bytes of a request with its answer, about."""
        bits = _BITS_OF.get(self.function)
        return 13 + min(4 if bits is None else bits * self.quantity // 8, 250)

    def count(self, *outcomes: Ending) -> int:
        """How many of its requests ended so."""
        return sum(int(self.outcomes[outcome]) for outcome in outcomes)


@dataclass(slots=True, eq=False)
class PollTable:
    """All polls by their number (`Exchanges.poll`); beyond a few thousand, further ones are left out."""

    requests: list[bytes] = field(default_factory=list)  # one of each poll, by slot
    usual: dict[int, bytes] = field(default_factory=dict)  # by number: a good answer
    _slots: dict[int, int] = field(default_factory=dict)
    _sums: Int64s = field(default_factory=lambda: np.zeros((0, _WIDTH), np.int64))  # a row a slot
    _rings: Int64s = field(default_factory=lambda: np.zeros((0, _RING), np.int64))
    _exceptions: defaultdict[int, Counter[int]] = field(default_factory=lambda: defaultdict(Counter))
    _waits: defaultdict[int, Thinned] = field(default_factory=lambda: defaultdict(Thinned))

    def __len__(self) -> int:
        return len(self._slots)

    def add(self, part: Stretch) -> None:
        """Count the exchanges of a stretch."""
        exchanges = part.exchanges
        numbers, first, which = np.unique(exchanges.poll, return_index=True, return_inverse=True)
        known, firsts = self._slots, zip(numbers.tolist(), first.tolist(), strict=True)
        slots = [known[number] if number in known else self._slot(number, part, i) for number, i in firsts]
        slot = np.array(slots)[which]
        if min(slots) < 0:
            exchanges, slot = exchanges[slot >= 0], slot[slot >= 0]
        outcome, again, count = exchanges.outcome, exchanges.repeats, len(self._sums)
        cells = np.bincount(slot * _KINDS + outcome, minlength=count * _KINDS)
        self._sums[:, :_KINDS] += cells.reshape(count, _KINDS)
        self._sums[:, _REPEATS] += np.bincount(slot[again], minlength=count)
        refused = outcome == _EXCEPTION
        for each, code in zip(slot[refused].tolist(), exchanges.exception[refused].tolist(), strict=True):
            self._exceptions[each][code] += 1
        silent = (outcome == _SILENT) & (exchanges.t_next != NEVER)
        for each in np.unique(slot[silent]).tolist():
            mine = silent & (slot == each)
            self._waits[each].add((exchanges.t_next - exchanges.t_asked)[mine])
        order = np.argsort(slot.astype(np.int16), kind="stable")
        order = order[~again[order]]
        if len(order):
            self._time(slot[order], exchanges.t_start[order])
        good = ((outcome == _OK) & (_HOLDS[exchanges.function] | (exchanges.due == 0))).nonzero()[0]
        newest = np.full(count, -1)
        newest[slot[good]] = good  # the last one stays
        for i in newest[newest >= 0].tolist():
            self.usual[int(exchanges.poll[i])] = part.table.bytes_of(int(exchanges.answer[i]))

    def _slot(self, number: int, part: Stretch, i: int) -> int:
        """One for a poll that is new, which exchange i asks for; -1 for none."""
        if len(self._slots) >= _POLLS:
            return -1
        slot = self._slots[number] = len(self._slots)
        if slot == len(self._sums):
            more = ((0, max(slot, _SLOTS)), (0, 0))
            self._sums, self._rings = np.pad(self._sums, more), np.pad(self._rings, more)
        self.requests.append(part.table.bytes_of(int(part.exchanges.row[i])))
        self._sums[slot, _FIRST] = part.exchanges.t_start[i]
        return slot

    def _time(self, slot: Int64s, times: Int64s) -> None:
        """Intervals from each poll to its next one; exchanges come ordered by poll, then by time; at least one."""
        begins = np.flatnonzero(np.diff(slot, prepend=-1))
        ends = np.append(begins[1:], len(slot)) - 1
        before = np.roll(times, 1)
        before[begins] = self._sums[slot[begins], _LAST]
        asked = self._sums[slot, _TIMED] + np.arange(len(slot)) - np.repeat(begins, ends - begins + 1)
        again = asked > 0
        self._rings[slot[again], (asked[again] - 1) % _RING] = (times - before)[again]
        self._sums[slot[ends], _TIMED] += ends - begins + 1
        self._sums[slot[ends], _LAST] = times[ends]

    def request_of(self, number: int) -> bytes | None:
        """A request of the poll of a number; None for one beyond those that are kept."""
        slot = self._slots.get(number)
        return None if slot is None else self.requests[slot]

    @property
    def sure_requests(self) -> list[bytes]:
        """A request of each poll that was answered or came several times: garbage holds a right check value by chance."""
        outcomes = self._sums[: len(self), :_KINDS]
        sure = (outcomes[:, [_OK, _EXCEPTION]].sum(axis=1) > 0) | (outcomes.sum(axis=1) >= _SEVERAL)
        return [self.requests[slot] for slot in sure.nonzero()[0].tolist()]

    def polls(self) -> list[Poll]:
        """All of them, by unit, function and address."""
        return [self._poll(number, self._slots[number]) for number in sorted(self._slots)]

    def _poll(self, number: int, slot: int) -> Poll:
        outcomes, sums = self._sums[slot, :_KINDS], self._sums[slot].tolist()
        waits, timed = self._waits.get(slot), min(max(sums[_TIMED] - 1, 0), _RING)
        return Poll(
            number >> 40 & 0xFF, number >> 32 & 0xFF, number >> 16 & 0xFFFF, number & 0xFFFF, sums[_FIRST], sums[_LAST],
            outcomes, sums[_REPEATS], self._exceptions.get(slot, Counter()), self._rings[slot, :timed],
            np.zeros(0) if waits is None else waits.numbers, sum(sums[:_KINDS]) - sums[Ending.ECHO],
        )  # fmt: skip


_UNITS: Final = 256


@dataclass(slots=True, eq=False)
class SuccessorTable:
    """Counts by (unit, unit of a hanging exchange before it); 0 where what is before got its answers in time."""

    asked: Counter[tuple[int, int]] = field(default_factory=Counter)
    hit: Counter[tuple[int, int]] = field(default_factory=Counter)
    met: Counter[tuple[int, int]] = field(default_factory=Counter)  # of those that were hit: (unit, unit right before)
    followed: Counter[tuple[int, int]] = field(default_factory=Counter)  # of all: (unit, unit right before)
    near: Counter[tuple[int, int]] = field(default_factory=Counter)  # of all: (unit, one among it and the two before)
    near_hit: Counter[tuple[int, int]] = field(default_factory=Counter)  # of those that were hit
    delays: defaultdict[int, Thinned] = field(default_factory=lambda: defaultdict(Thinned))  # ns, behind a hanging one
    usual: defaultdict[int, Thinned] = field(default_factory=lambda: defaultdict(Thinned))  # ns, behind no hanging one
    _newest: int = 0
    _last: tuple[int, int] = (0, 0)  # the newest behind
    _unsure: bool = False
    _owing: tuple[int, int] = (0, 0)  # the unit of the newest silent request, and until when its answer may come

    def add(self, exchanges: Exchanges, odd: Bools) -> None:
        """The next exchanges; `odd` those that were hit."""
        units, delays = exchanges.unit, exchanges.delay
        silent = exchanges.outcome == _SILENT
        unsure = silent & ECHOED[exchanges.function] & exchanges.next_same  # one of two echoes reads like a request
        silent &= ~unsure
        before = self._hanging(units, silent)
        late = (before == units) & (before > 0) & (delays >= 0)
        for unit in np.unique(units[late]).tolist():
            self.delays[unit].add(delays[late & (units == unit)])
        settled = (before == 0) & (delays >= 0) & ~np.concatenate(([self._unsure], unsure[:-1]))
        self._unsure = bool(unsure[-1])
        for unit in self.delays:
            self.usual[unit].add(delays[settled & (units == unit)])
        before = np.where(before == 0, self._owed(exchanges, silent), before)
        both, here = np.concatenate((self._last, units)), units * np.int64(_UNITS)
        right, beyond = both[1:-1], both[:-2]
        self._last = int(both[-2]), int(both[-1])
        others, third = right != units, (beyond != units) & (beyond != right)
        everything = np.ones(len(units), np.bool_)
        for of, of_hit, neighbour, which in (
            (self.asked, self.hit, before, everything), (self.followed, self.met, right, everything),
            (self.near, self.near_hit, units, everything), (self.near, self.near_hit, right, others),
            (self.near, self.near_hit, beyond, third),
        ):  # fmt: skip
            _count(of, (here + neighbour)[which])
            _count(of_hit, (here + neighbour)[which & odd])

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


def _count(counts: Counter[tuple[int, int]], pairs: Int64s) -> None:
    found = np.bincount(pairs)
    at = found.nonzero()[0]
    for pair, count in zip(at.tolist(), found[at].tolist(), strict=True):
        counts[divmod(pair, _UNITS)] += count
