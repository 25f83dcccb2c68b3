"""What the master asks for, poll by poll: how often, with which success, and what a good answer looks like."""

from __future__ import annotations

from collections import Counter, defaultdict
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.transactions import NEVER
from .exchanges import Ending, Exchanges, Stretch
from .thinned import Thinned

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

    def count(self, outcome: Ending) -> int:
        """How many of its requests ended so."""
        return int(self.outcomes[outcome])


class PollTable:
    """All polls by their number (`Exchanges.poll`); beyond a few thousand, further ones are only counted."""

    def __init__(self) -> None:
        self.more = 0  # exchanges of further polls
        self.usual: dict[int, bytes] = {}  # by number: a good answer
        self._slots: dict[int, int] = {}
        self._requests: list[bytes] = []
        self._outcomes = np.zeros((0, _KINDS), np.int64)
        self._repeats, self._first, self._last, self._count = (np.zeros(0, np.int64) for _ in range(4))
        self._rings = np.zeros((0, _RING), np.int64)
        self._exceptions: dict[int, Counter[int]] = {}
        self._waits: dict[int, Thinned] = defaultdict(Thinned)

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
