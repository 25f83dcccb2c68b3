"""The polls of a bus as they stand: what is asked again and again, how often, how it ends, and what moves in it.

A bus is some dozens of polls, however many frames there were. They are kept in columns and fed by batches, all polls of
a batch at once, so that a list of them costs the same live and after a week.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from captures.ragged import counted_on
from dissectors.values import AREAS, logical

from ..tables.batch import Batch
from ..tables.columns import Decoded
from ..tables.schema import Kind
from ..tables.transactions import Status, TransactionRows

_MOST: Final = 4096  # polls; what a damaged client makes up beyond those is left out
_INTERVALS: Final = 64  # of each poll, the newest
_TIMES: Final = 256  # answer times of each poll, the newest
_UNSETTLED: Final = 1 << 14  # requests whose end is not known yet
_AREA_NAMES: Final = tuple(AREAS)
_Ints = NDArray[np.int64]
_NO_ROWS: Final[_Ints] = np.zeros(0, np.int64)


class PollKey(NamedTuple):
    """What is asked: of a unit, by a function; `area` is an AreaCode less 1, it, address and quantity -1 for none."""

    unit: int
    function: int
    area: int
    address: int
    quantity: int

    @property
    def register(self) -> str:
        """The logical number of the first; empty for none."""
        return logical(self.address, _AREA_NAMES[self.area]) if self.area >= 0 <= self.address else ""

    @property
    def registers(self) -> str:
        """`40108 ×3`; the first alone where no quantity is told; empty for none."""
        return f"{self.register} ×{self.quantity}" if self.register and self.quantity >= 0 else self.register


class PollFacts(NamedTuple):
    """How a poll stands."""

    asked: int = 0  # requests
    late: int = 0  # of them those whose answer came late
    last_ns: int = 0  # when the newest was asked
    row: int = -1  # and its row
    answered: int = -1  # the row of the newest with a good answer, -1 for none yet
    t_answered_ns: int = 0  # when that came
    slowest: int = -1  # the longest time of all answers, -1 where none is known


_NOT_ASKED: Final = np.array(tuple(PollFacts()), [(name, np.int64) for name in PollFacts._fields])


class WatchedPoll:
    """One poll, as it stands whenever it is asked. Times are ns."""

    __slots__ = ("_log", "_number", "key")

    def __init__(self, log: PollLog, number: int, key: PollKey) -> None:
        self._log, self._number, self.key = log, number, key

    @property
    def facts(self) -> PollFacts:
        """How it stands."""
        return PollFacts(*self._log.facts[self._number].item())

    @property
    def ended(self) -> _Ints:
        """How its requests ended, by `Status`."""
        ended: _Ints = self._log.ended[self._number]
        return ended

    @property
    def intervals(self) -> _Ints:
        """From one request to the next, the newest, oldest first."""
        return self._log.intervals.of_poll(self._number)

    @property
    def times(self) -> _Ints:
        """Of answers, the newest, oldest first."""
        return self._log.times.of_poll(self._number)

    @property
    def values(self) -> NDArray[np.uint16]:
        """What the newest good answer holds."""
        return self._log.held.values_of(self._number)

    @property
    def moved(self) -> NDArray[np.bool_]:
        """Of each of those, whether it was ever another one."""
        return self._log.held.moved_of(self._number)

    @property
    def bad(self) -> int:
        """Requests without a good answer."""
        return int(self.ended[[Status.EXCEPTION, Status.UNANSWERED, Status.DAMAGED]].sum())

    @property
    def every_ns(self) -> int | None:
        """The usual time from one request to the next."""
        intervals = self.intervals
        return int(np.median(intervals)) if len(intervals) else None

    @property
    def jitter_ns(self) -> int | None:
        """How far nine in ten intervals stray from it."""
        every = self.every_ns
        return None if every is None else int(np.quantile(np.abs(self.intervals - every), 0.9))

    def time(self, share: float) -> int | None:
        """Within what time this share of the newest answers came."""
        times = self.times
        return int(np.quantile(times, share)) if len(times) else None


class PollLog:
    """All of them, a column a fact; the lines of `polls` come in the order in which they were first asked."""

    def __init__(self) -> None:
        self._numbers: dict[int, int] = {}  # by the key as one number
        self._polls: list[WatchedPoll] = []
        self.facts: NDArray[Any] = np.empty(0, _NOT_ASKED.dtype)  # a column each of `PollFacts`
        self.ended = np.zeros((0, len(Status)), np.int64)
        self.intervals, self.times = _NewestOf(_INTERVALS), _NewestOf(_TIMES)
        self.held = _HeldAnswers()
        self._open_rows, self._open_polls = _NO_ROWS, _NO_ROWS  # requests whose end is not known, ascending

    def __len__(self) -> int:
        return len(self._polls)

    def __iter__(self) -> Iterator[WatchedPoll]:
        return iter(tuple(self._polls))

    def feed(self, batch: Batch, numbers: _Ints, decoded: Decoded, partners: _Ints) -> None:
        """Take in a batch; `numbers` are those of its rows in the model, `partners` the rows of what they answer."""
        rows = batch.rows
        good = np.flatnonzero(rows.check & (rows.kind != Kind.NOISE) & (rows.exception == 0))
        if not len(good):
            return
        keys, which = np.unique(_packed(batch, decoded, good), return_inverse=True)
        asks = rows.kind[good] == Kind.REQUEST
        polls = self._numbered(keys, np.bincount(which, asks, len(keys)) > 0)[which]
        order = np.argsort(polls.astype(np.int16), kind="stable")  # short keys sort in linear time
        order = order[np.searchsorted(polls[order], 0) :]  # without those that are left out
        good, polls, asks = good[order], polls[order], asks[order]
        self._ask(polls[asks], numbers[good[asks]], rows.t_start_ns[good[asks]])
        answers = ~asks & (partners[good] >= 0)
        good, polls = good[answers], polls[answers]
        if len(good):
            self._answer(polls, partners[good], rows.t_end_ns[good], rows.response_ns[good])
            self.held.hold(polls, decoded, good)

    def settle(self, rows: _Ints, settled: TransactionRows) -> None:
        """What became of requests, by their rows."""
        if not len(rows) or not len(self._open_rows):
            return
        rows, first = np.unique(rows, return_index=True)
        at = np.minimum(np.searchsorted(self._open_rows, rows), len(self._open_rows) - 1)
        known = self._open_rows[at] == rows
        at, first = at[known], first[known]
        np.add.at(self.ended, (self._open_polls[at], settled.status[first]), 1)
        np.add.at(self.facts["late"], self._open_polls[at], settled.late[first].astype(np.int64))
        self._open_rows, self._open_polls = np.delete(self._open_rows, at), np.delete(self._open_polls, at)

    def _numbered(self, keys: _Ints, asked: NDArray[np.bool_]) -> _Ints:
        """The numbers of polls by their keys, -1 for those that nobody has asked by now, or beyond the most."""
        numbers = np.array([self._numbers.get(key, -1) for key in keys.tolist()], np.int64)
        new = np.flatnonzero((numbers < 0) & asked)[: _MOST - len(self._polls)]
        if len(new):
            count = len(self._polls)
            numbers[new] = count + np.arange(len(new))
            self._make_room(count + len(new))
            for number, key in enumerate(keys[new].tolist(), count):
                self._numbers[key] = number
                self._polls.append(WatchedPoll(self, number, _unpacked(key)))
        return numbers

    def _make_room(self, count: int) -> None:
        """Columns that have room for so many polls."""
        if count <= len(self.facts):
            return
        room = min(_MOST, count + count // 2)
        self.facts, self.ended = _lengthened(self.facts, room, _NOT_ASKED), _lengthened(self.ended, room)
        for part in (self.intervals, self.times, self.held):
            part.make_room(room)

    def _ask(self, polls: _Ints, rows: _Ints, starts: _Ints) -> None:
        """More requests, by poll and then in the order of time."""
        if not len(polls):
            return
        begins, ends = _groups(polls)
        gaps = np.diff(starts, prepend=0)
        gaps[begins] = starts[begins] - self.facts["last_ns"][polls[begins]]
        has_one = np.ones(len(polls), np.bool_)
        has_one[begins] = self.facts["asked"][polls[begins]] > 0
        self.intervals.put(polls[has_one], gaps[has_one])
        mine = polls[ends]
        self.facts["asked"][mine] += ends - begins + 1
        self.facts["last_ns"][mine], self.facts["row"][mine] = starts[ends], rows[ends]
        order = np.argsort(rows)
        self._open_rows = np.concatenate((self._open_rows, rows[order]))[-_UNSETTLED:]
        self._open_polls = np.concatenate((self._open_polls, polls[order]))[-_UNSETTLED:]

    def _answer(self, polls: _Ints, requests: _Ints, t_ns: _Ints, took: _Ints) -> None:
        """More good answers, by poll and then in the order of time."""
        _, ends = _groups(polls)
        self.facts["answered"][polls[ends]], self.facts["t_answered_ns"][polls[ends]] = requests[ends], t_ns[ends]
        timed = took >= 0
        self.times.put(polls[timed], took[timed])
        np.maximum.at(self.facts["slowest"], polls[timed], took[timed])


class _NewestOf:
    """The newest numbers of each poll, as many as there is room for."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._numbers = np.zeros((0, most), np.int64)
        self._counts = _NO_ROWS  # of all that came

    def make_room(self, room: int) -> None:
        self._numbers, self._counts = _lengthened(self._numbers, room), _lengthened(self._counts, room)

    def put(self, polls: _Ints, numbers: _Ints) -> None:
        """More of them, by poll, oldest first."""
        if not len(polls):
            return
        begins, ends = _groups(polls)
        counts = ends - begins + 1
        within = counted_on(counts)
        newest = np.repeat(counts, counts) - within <= self._most
        at = (self._counts[polls] + within)[newest] % self._most
        self._numbers[polls[newest], at] = numbers[newest]
        self._counts[polls[ends]] += counts

    def of_poll(self, poll: int) -> _Ints:
        """Those of one, oldest first."""
        count = int(self._counts[poll])
        if count <= self._most:
            return self._numbers[poll, :count].copy()
        return np.roll(self._numbers[poll], -(count % self._most))


class _HeldAnswers:
    """What the newest good answer of each poll holds, and what of it was ever another one; polls end to end."""

    def __init__(self) -> None:
        self._at = self._sizes = self._rooms = _NO_ROWS
        self._values = np.zeros(0, np.uint16)
        self._moved = np.zeros(0, np.bool_)
        self._used = 0

    def make_room(self, room: int) -> None:
        for name in ("_at", "_sizes", "_rooms"):
            setattr(self, name, _lengthened(getattr(self, name), room))

    def values_of(self, poll: int) -> NDArray[np.uint16]:
        return self._values[self._at[poll] : self._at[poll] + self._sizes[poll]].copy()

    def moved_of(self, poll: int) -> NDArray[np.bool_]:
        return self._moved[self._at[poll] : self._at[poll] + self._sizes[poll]].copy()

    def hold(self, polls: _Ints, decoded: Decoded, answers: NDArray[np.intp]) -> None:
        """What more answers hold, by poll, oldest first; only those of each that are as long as its newest."""
        sizes = decoded.offsets[answers + 1] - decoded.offsets[answers]
        begins, ends = _groups(polls)
        alike = sizes == np.repeat(sizes[ends], ends - begins + 1)
        alike &= sizes > 0
        polls, answers, sizes = polls[alike], answers[alike], sizes[alike]
        if not len(polls):
            return
        begins, ends = _groups(polls)
        self._lay_out(polls[begins], sizes[begins], decoded, answers[begins])
        within = counted_on(sizes)
        here = np.repeat(decoded.offsets[answers], sizes) + within
        place = np.repeat(self._at[polls], sizes) + within
        is_first, is_last = _lit(begins, sizes), _lit(ends, sizes)
        before = np.repeat(np.roll(decoded.offsets[answers], 1), sizes) + within
        before[is_first] = 0
        was = np.where(is_first, self._values[place], decoded.values[before])
        self._moved[place[was != decoded.values[here]]] = True
        self._values[place[is_last]] = decoded.values[here[is_last]]

    def _lay_out(self, polls: _Ints, sizes: _Ints, decoded: Decoded, answers: NDArray[np.intp]) -> None:
        """Polls whose answers have another length than before begin anew, with what these hold."""
        for i in np.flatnonzero(self._sizes[polls] != sizes).tolist():
            poll, size = int(polls[i]), int(sizes[i])
            if size > self._rooms[poll]:
                self._at[poll], self._rooms[poll] = self._used, max(size, 2 * int(self._rooms[poll]))
                self._used += int(self._rooms[poll])
                if self._used > len(self._values):
                    self._values = _lengthened(self._values, 2 * self._used)
                    self._moved = _lengthened(self._moved, 2 * self._used)
            begin = int(self._at[poll])
            self._values[begin : begin + size] = decoded.values_of(int(answers[i]))
            self._moved[begin : begin + size] = False
            self._sizes[poll] = size


def _groups(polls: _Ints) -> tuple[_Ints, _Ints]:
    """Where each poll begins and ends (inclusive) among such that are sorted."""
    cuts = np.flatnonzero(np.diff(polls))
    return np.concatenate(([0], cuts + 1)), np.append(cuts, len(polls) - 1)


def _lit(which: _Ints, sizes: _Ints) -> NDArray[np.bool_]:
    """Which items of stretches of these sizes, end to end, belong to some of these."""
    chosen = np.zeros(len(sizes), np.bool_)
    chosen[which] = True
    return np.repeat(chosen, sizes)


def _lengthened(column: NDArray[Any], room: int, empty: int | NDArray[Any] = 0) -> NDArray[Any]:
    """A longer copy; what is new is empty."""
    out = np.full((room, *column.shape[1:]), empty, column.dtype)
    out[: len(column)] = column
    return out


def _packed(batch: Batch, decoded: Decoded, rows: NDArray[np.intp]) -> _Ints:
    """What rows ask or answer, each as one number."""
    key = batch.rows.unit[rows].astype(np.int64)
    for part, bits in ((batch.rows.function, 8), (decoded.area, 3), (decoded.address, 17), (decoded.quantity, 17)):
        more = part[rows].astype(np.int64)
        key = key << bits | (more if bits < 17 else more + 1)
    return key


def _unpacked(key: int) -> PollKey:
    quantity, key = (key & 0x1FFFF) - 1, key >> 17
    address, key = (key & 0x1FFFF) - 1, key >> 17
    return PollKey(key >> 11, key >> 3 & 0xFF, (key & 7) - 1, address, quantity)
