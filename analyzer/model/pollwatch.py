"""The polls of a bus as they stand: what is asked again and again, how often, how it ends, and what moves in it.

A bus is some dozens of polls, however many frames there were. Each is kept in flat memory and fed by batches, so that
a list of them costs the same live and after a week.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

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


@dataclass(slots=True, eq=False)
class WatchedPoll:
    """One poll. Times are ns; `intervals` from one request to the next and `times` of answers are the newest ones;
    `row` is the newest request's, `answered` that of the newest with a good answer, -1 for none yet. `moved` says of
    each register whether it was ever another one."""

    key: PollKey
    asked: int = 0
    ended: NDArray[np.int64] = field(default_factory=lambda: np.zeros(len(Status), np.int64))
    late: int = 0
    first_ns: int = 0
    last_ns: int = 0
    row: int = -1
    answered: int = -1
    t_answered_ns: int = 0
    intervals: _Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    times: _Ints = field(default_factory=lambda: np.zeros(0, np.int64))
    slowest: int = -1
    values: NDArray[np.uint16] = field(default_factory=lambda: np.zeros(0, np.uint16))
    moved: NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, np.bool_))

    @property
    def bad(self) -> int:
        """Requests without a good answer."""
        return int(self.ended[[Status.EXCEPTION, Status.UNANSWERED, Status.DAMAGED]].sum())

    @property
    def every_ns(self) -> int | None:
        """The usual time from one request to the next."""
        return int(np.median(self.intervals)) if len(self.intervals) else None

    @property
    def jitter_ns(self) -> int | None:
        """How far nine in ten intervals stray from it."""
        every = self.every_ns
        return None if every is None else int(np.quantile(np.abs(self.intervals - every), 0.9))

    def time(self, share: float) -> int | None:
        """Within what time this share of the newest answers came."""
        return int(np.quantile(self.times, share)) if len(self.times) else None

    def ask(self, rows: _Ints, starts: _Ints) -> None:
        """More requests, in the order of time."""
        if not self.asked:
            self.first_ns = int(starts[0])
        before = [self.last_ns] if self.asked else []
        gaps = np.diff(np.concatenate((np.array(before, np.int64), starts)))
        self.intervals = np.concatenate((self.intervals, gaps)).astype(np.int64)[-_INTERVALS:]
        self.asked += len(rows)
        self.last_ns, self.row = int(starts[-1]), int(rows[-1])

    def answer(self, request: int, t_ns: int, took: _Ints) -> None:
        """More good answers, the newest to `request`."""
        self.answered, self.t_answered_ns = request, t_ns
        took = took[took >= 0]
        if len(took):
            self.times = np.concatenate((self.times, took)).astype(np.int64)[-_TIMES:]
            self.slowest = max(self.slowest, int(took.max()))

    def hold(self, values: NDArray[np.uint16]) -> None:
        """What its answers hold, a line each, all as long as the first were."""
        if values.shape[1] != len(self.values):
            self.values, self.moved = values[0], np.zeros(values.shape[1], np.bool_)
        self.moved |= (np.concatenate((self.values[None], values[:-1])) != values).any(axis=0)
        self.values = values[-1].copy()


class PollLog:
    """All of them."""

    def __init__(self) -> None:
        self._polls: dict[PollKey, WatchedPoll] = {}
        self._unsettled: dict[int, WatchedPoll] = {}  # by the request's row

    def __len__(self) -> int:
        return len(self._polls)

    def __iter__(self) -> Iterator[WatchedPoll]:
        return iter(tuple(self._polls.values()))

    def feed(self, batch: Batch, numbers: _Ints, decoded: Decoded, partners: _Ints) -> None:
        """Take in a batch; `numbers` are those of its rows in the model, `partners` the rows of what they answer."""
        rows = batch.rows
        good = np.flatnonzero(rows.check & (rows.kind != Kind.NOISE) & (rows.exception == 0))
        for key, own in _by_key(batch, decoded, good):
            asks = rows.kind[own] == Kind.REQUEST
            poll = self._polls.get(key)
            if poll is None:
                if len(self._polls) >= _MOST or not asks.any():
                    continue
                poll = self._polls[key] = WatchedPoll(key)
            requests, answers = own[asks], own[~asks]
            if len(requests):
                poll.ask(numbers[requests], rows.t_start_ns[requests])
                self._unsettled.update(dict.fromkeys(numbers[requests].tolist(), poll))
            answers = answers[partners[answers] >= 0]
            if len(answers):
                newest = answers[-1]
                poll.answer(int(partners[newest]), int(rows.t_end_ns[newest]), rows.response_ns[answers])
                _hold(poll, decoded, answers)
        while len(self._unsettled) > _UNSETTLED:
            del self._unsettled[next(iter(self._unsettled))]

    def settle(self, rows: _Ints, settled: TransactionRows) -> None:
        """What became of requests, by their rows."""
        for row, status, late in zip(rows.tolist(), settled.status.tolist(), settled.late.tolist(), strict=True):
            poll = self._unsettled.pop(row, None)
            if poll is not None:
                poll.ended[status] += 1
                poll.late += bool(late)


def _by_key(batch: Batch, decoded: Decoded, rows: NDArray[np.intp]) -> Iterator[tuple[PollKey, NDArray[np.intp]]]:
    """Rows by the poll that they ask or answer."""
    columns = np.stack([
        batch.rows.unit[rows].astype(np.int64), batch.rows.function[rows].astype(np.int64),
        decoded.area[rows].astype(np.int64) - 1, decoded.address[rows].astype(np.int64),
        decoded.quantity[rows].astype(np.int64),
    ])  # fmt: skip
    order = np.lexsort(columns)
    columns = columns[:, order]
    cuts = np.flatnonzero((np.diff(columns, axis=1) != 0).any(axis=0)) + 1
    for part, first in zip(np.split(rows[order], cuts), np.concatenate(([0], cuts)).tolist(), strict=True):
        if len(part):
            yield PollKey(*columns[:, first].tolist()), part


def _hold(poll: WatchedPoll, decoded: Decoded, answers: NDArray[np.intp]) -> None:
    sizes = decoded.offsets[answers + 1] - decoded.offsets[answers]
    size = int(sizes[-1])
    same = answers[sizes == size]
    if size:
        poll.hold(decoded.values[decoded.offsets[same][:, None] + np.arange(size)])
