"""What the master asks for, poll by poll: how often, with which success, and again."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ..tables.schema import Int64s
from .exchanges import Ending, Stretch

_POLLS: Final = 4096
_SEVERAL: Final = 3  # times
_RING: Final = 32  # intervals of a poll that are remembered, the newest
_BITS_OF: Final = {1: 1, 2: 1, 3: 16, 4: 16, 23: 16}  # of one thing that is asked for
_HOLDS: Final = np.isin(np.arange(256), tuple(_BITS_OF))
_OK, _EXCEPTION, _KINDS = int(Ending.OK), int(Ending.EXCEPTION), len(Ending)
_REPEATS, _FIRST, _LAST, _TIMED, _WIDTH = range(_KINDS, _KINDS + 5)  # behind the outcomes: sums and times of a poll
_SLOTS: Final = 64


@dataclass(frozen=True, slots=True)
class Poll:
    """One poll: a unit asked for so many things from an address on, by a function.

    `first` and `last` are times (ns) of requests, `intervals` (ns) some from one to the next, repeated ones left out,
    `asked` how many requests, without those that are the tap's own echo.
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
    asked: int

    @property
    def number(self) -> int:
        """What it asks for in one number, as in `Exchanges.poll`."""
        return self.unit << 40 | self.function << 32 | self.address << 16 | self.quantity

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
        timed = min(max(sums[_TIMED] - 1, 0), _RING)
        return Poll(
            number >> 40 & 0xFF, number >> 32 & 0xFF, number >> 16 & 0xFFFF, number & 0xFFFF, sums[_FIRST], sums[_LAST],
            outcomes, sums[_REPEATS], self._exceptions.get(slot, Counter()), self._rings[slot, :timed],
            sum(sums[:_KINDS]) - sums[Ending.ECHO],
        )  # fmt: skip
