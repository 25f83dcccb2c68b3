"""What the master asks for, poll by poll: how often, with which success, again, and what comes behind each.

A request is asked again when the client has given up; what comes then may be the answer to the first try, and the one
to the second hits whatever is asked next. So all that is asked of a unit in a row hangs from the first silent one on.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.transactions import NEVER
from .exchanges import Ending, Exchanges, Stretch
from .flatmemory import Thinned

_POLLS: Final = 4096
_SEVERAL: Final = 3  # times
_RING: Final = 32  # intervals of a poll that are remembered, the newest
_HOLDS: Final = np.isin(np.arange(256), (1, 2, 3, 4, 23))
_OK, _EXCEPTION, _SILENT, _KINDS = int(Ending.OK), int(Ending.EXCEPTION), int(Ending.SILENT), len(Ending)


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
    outcomes: NDArray[np.int64]
    repeats: int
    exceptions: Counter[int]
    intervals: NDArray[np.int64]
    waits: NDArray[np.float64]
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
        held = (
            2 * self.quantity if self.function in (3, 4, 23) else self.quantity // 8 if self.function in (1, 2) else 4
        )
        return 13 + min(held, 250)

    def count(self, *outcomes: Ending) -> int:
        """How many of its requests ended so."""
        return sum(int(self.outcomes[outcome]) for outcome in outcomes)


class PollTable:
    """All polls by their number (`Exchanges.poll`); beyond a few thousand, further ones are only counted."""

    more: int
    usual: dict[int, bytes]
    _slots: dict[int, int]
    _requests: list[bytes]
    _outcomes: NDArray[np.int64]
    _repeats: NDArray[np.int64]
    _first: NDArray[np.int64]
    _last: NDArray[np.int64]
    _count: NDArray[np.int64]
    _rings: NDArray[np.int64]
    _exceptions: dict[int, Counter[int]]
    _waits: dict[int, Thinned]

    def __init__(self) -> None:
        self.more = 0  # exchanges of further polls
        self.usual = {}  # by number: a good answer
        self._slots = {}
        self._requests = []
        self._outcomes = np.zeros((0, _KINDS), np.int64)
        self._repeats, self._first, self._last, self._count = (np.zeros(0, np.int64) for _ in range(4))
        self._rings = np.zeros((0, _RING), np.int64)
        self._exceptions = {}
        self._waits = defaultdict(Thinned)

    def __len__(self) -> int:
        return len(self._slots)

    def add(self, stretch: Stretch) -> None:
        """Count the exchanges of a stretch."""
        exchanges = stretch.exchanges
        slot, order = self._slots_of(stretch)
        known = slot >= 0
        if not known.all():
            self.more += int(np.count_nonzero(~known))
            exchanges, slot = exchanges[known], slot[known]
            order = np.argsort(slot, kind="stable")
        cells = np.bincount(slot * _KINDS + exchanges.outcome, minlength=self._outcomes.size)
        self._outcomes += cells.reshape(self._outcomes.shape)
        again = exchanges.repeats
        self._repeats += np.bincount(slot[again], minlength=len(self._repeats))
        for i in (exchanges.outcome == _EXCEPTION).nonzero()[0].tolist():
            self._exceptions.setdefault(int(slot[i]), Counter())[int(exchanges.exception[i])] += 1
        self._wait(slot, exchanges)
        order = order[~again[order]]
        self._time(slot[order], exchanges.t_start[order])
        self._learn(stretch, exchanges, slot)

    def _wait(self, slot: NDArray[np.int64], exchanges: Exchanges) -> None:
        silent = (exchanges.outcome == _SILENT) & (exchanges.t_next != NEVER)
        if silent.any():
            slot, waits = slot[silent], (exchanges.t_next - exchanges.t_asked)[silent]
            for each in np.unique(slot).tolist():
                self._waits[each].add(waits[slot == each])

    def _slots_of(self, stretch: Stretch) -> tuple[NDArray[np.int64], NDArray[np.intp]]:
        """The slot of each exchange's poll, -1 for none, and the exchanges' order by poll."""
        polls = stretch.exchanges.poll
        order = np.argsort(polls, kind="stable")
        ordered = polls[order]
        begins = np.concatenate(([True], ordered[1:] != ordered[:-1]))
        numbers, first = ordered[begins].tolist(), order[begins].tolist()
        known = self._slots
        if len(known) >= _POLLS:
            slots = [known.get(number, -1) for number in numbers]
        else:
            slots = [
                known[number] if number in known else self._slot(number, stretch, i)
                for number, i in zip(numbers, first, strict=True)
            ]
        slot = np.empty(len(polls), np.int64)
        slot[order] = np.repeat(np.array(slots), np.diff(np.append(begins.nonzero()[0], len(polls))))
        return slot, order

    def _slot(self, number: int, stretch: Stretch, i: int) -> int:
        if len(self._slots) >= _POLLS:
            return -1
        slot = self._slots[number] = len(self._slots)
        if slot >= len(self._outcomes):
            self._grow(max(64, 2 * len(self._outcomes)))
        self._requests.append(stretch.table.bytes_of(int(stretch.exchanges.row[i])))
        self._first[slot] = stretch.exchanges.t_start[i]
        return slot

    def _grow(self, size: int) -> None:
        for name in ("_outcomes", "_repeats", "_first", "_last", "_count", "_rings"):
            held: NDArray[np.int64] = getattr(self, name)
            more = np.zeros((size, *held.shape[1:]), np.int64)
            more[: len(held)] = held
            setattr(self, name, more)

    def _time(self, slot: NDArray[np.intp], times: NDArray[np.int64]) -> None:
        """Intervals from each poll to its next one; exchanges come ordered by poll, then by time."""
        if not len(slot):
            return
        begins = np.concatenate(([True], slot[1:] != slot[:-1]))
        before = np.empty_like(times)
        before[1:] = times[:-1]
        before[begins] = self._last[slot[begins]]
        place = np.arange(len(slot)) - np.maximum.accumulate(np.where(begins, np.arange(len(slot)), 0))
        place += self._count[slot] - (self._count[slot] > 0)
        timed = ~begins | (self._count[slot] > 0)
        place[self._count[slot] == 0] -= 1
        self._rings[slot[timed], place[timed] % _RING] = (times - before)[timed]
        self._count += np.bincount(slot, minlength=len(self._count))
        ends = np.concatenate((begins[1:], [True]))
        self._last[slot[ends]] = times[ends]

    def _learn(self, stretch: Stretch, exchanges: Exchanges, slot: NDArray[np.int64]) -> None:
        """The newest good answer of each poll whose answer holds more than its request tells."""
        good = ((exchanges.outcome == _OK) & (_HOLDS[exchanges.function] | (exchanges.due == 0))).nonzero()[0]
        newest = np.full(len(self._outcomes), -1)
        newest[slot[good]] = good  # the last one stays
        for i in newest[newest >= 0].tolist():
            self.usual[int(exchanges.poll[i])] = stretch.table.bytes_of(int(exchanges.answer[i]))

    @property
    def requests(self) -> list[bytes]:
        """A request of each poll."""
        return self._requests

    def request_of(self, number: int) -> bytes | None:
        """A request of the poll of a number; None for one beyond those that are kept."""
        slot = self._slots.get(number)
        return None if slot is None else self._requests[slot]

    @property
    def sure_requests(self) -> list[bytes]:
        """A request of each poll that was answered or came several times: garbage holds a right check value by chance."""
        outcomes = self._outcomes[: len(self._requests)]
        sure = (outcomes[:, [_OK, _EXCEPTION]].sum(axis=1) > 0) | (outcomes.sum(axis=1) >= _SEVERAL)
        return [self._requests[slot] for slot in sure.nonzero()[0].tolist()]

    def polls(self) -> list[Poll]:
        """All of them, by unit, function and address."""
        made = []
        asked = (self._outcomes.sum(axis=1) - self._outcomes[:, Ending.ECHO]).tolist()
        for number, slot in self._slots.items():
            count = min(int(self._count[slot]) - 1, _RING)
            made.append(
                Poll(
                    number >> 40 & 0xFF,
                    number >> 32 & 0xFF,
                    number >> 16 & 0xFFFF,
                    number & 0xFFFF,
                    int(self._first[slot]),
                    int(self._last[slot]),
                    self._outcomes[slot],
                    int(self._repeats[slot]),
                    self._exceptions.get(slot, Counter()),
                    self._rings[slot, : max(count, 0)],
                    self._waits[slot].numbers if slot in self._waits else np.zeros(0),
                    asked[slot],
                )
            )
        return sorted(made, key=lambda poll: (poll.unit, poll.function, poll.address, poll.quantity))


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
    usual: dict[int, Thinned] = field(default_factory=lambda: defaultdict(Thinned))  # ns, behind no hanging exchange
    _newest: int = 0
    _last: tuple[int, int] = (0, 0)  # the newest behind
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
        self._newest = int(units[-1]) if hangs[-1] else 0
        late = (before == units) & (before > 0) & (delays >= 0)
        for unit in np.unique(units[late]).tolist():
            mine = late & (units == unit)
            self.delays[unit].add(delays[mine])
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
