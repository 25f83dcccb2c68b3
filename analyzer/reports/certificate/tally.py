"""What a certificate counts beside the report, in the same pass over the same rows."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ...tables.bins import Histogram
from ...tables.schema import Kind
from ...tables.transactions import Status, TransactionRows

if TYPE_CHECKING:
    from ...core import Analysed

_SECOND: Final = 1_000_000_000
_MOST_SECONDS: Final = 1 << 23  # three months: past that a clock was set, and no load is told
_LOST: Final = (Status.UNANSWERED, Status.DAMAGED)
_JUDGED: Final = (*_LOST, Status.ANSWERED, Status.EXCEPTION)


class AcceptanceTally:
    """Batches in; response times by unit, bytes by second, runs of lost requests out."""

    def __init__(self, character_ns: float | None) -> None:
        """`character_ns`: time of one character on the line, for the load."""
        self._character_ns = character_ns
        self.all_times = Histogram()
        self.times: dict[int, Histogram] = {}  # by unit
        self.damaged_requests = 0
        self.open_unit: int | None = None  # the unit of the last request, where the capture ends behind it
        self.runs: dict[int, int] = {}  # by unit: most requests on end that were lost
        self._running: dict[int, int] = {}
        self._octets = np.zeros(0, np.int64)  # by second from the first one on
        self._first: int | None = None

    def feed(self, analysed: Analysed) -> None:
        """Count a batch in."""
        rows, settled = analysed.batch.rows, analysed.transactions
        if len(rows):
            self.damaged_requests += int(((rows.kind == Kind.REQUEST) & ~rows.check).sum())
            self._count_octets(rows.t_end_ns, rows.length)
        if not len(settled):
            return
        measured = settled[settled.response_ns >= 0]
        if len(measured):
            self.all_times.add(measured.response_ns)
        for unit in np.unique(settled.unit).tolist():
            mine = settled[settled.unit == unit]
            times = mine.response_ns[mine.response_ns >= 0]
            if len(times):
                self.times.setdefault(unit, Histogram()).add(times)
            self._count_runs(unit, mine)
        last = int(np.argmax(settled.request))
        self.open_unit = int(settled.unit[last]) if settled.status[last] == Status.UNANSWERED else None

    def loads(self) -> list[float]:
        """The load of each whole second between the first byte and the last; none where the line's speed is unknown."""
        if self._character_ns is None:
            return []
        busy: NDArray[np.float64] = np.minimum(self._octets[1:-1] * (self._character_ns / _SECOND), 1.0)
        loads: list[float] = busy.tolist()
        return loads

    def _count_octets(self, ends: NDArray[np.int64], lengths: NDArray[np.int64]) -> None:
        seconds = ends // _SECOND
        if self._first is None:
            self._first = int(seconds.min())
        at = seconds - self._first
        fit = (at >= 0) & (at < _MOST_SECONDS)
        if not fit.any():
            return
        counts = np.bincount(at[fit], lengths[fit]).astype(np.int64)
        if len(counts) > len(self._octets):
            self._octets = np.concatenate((self._octets, np.zeros(len(counts) - len(self._octets), np.int64)))
        self._octets[: len(counts)] += counts

    def _count_runs(self, unit: int, mine: TransactionRows) -> None:
        judged = mine[np.isin(mine.status, _JUDGED)]
        lost = np.isin(judged.status, _LOST) | judged.late
        edges = np.flatnonzero(np.diff(np.concatenate(([0], lost.astype(np.int8), [0]))))
        begins, ends = edges[::2], edges[1::2]
        if not len(begins):
            self._running[unit] = 0 if len(lost) else self._running.get(unit, 0)
            return
        runs = ends - begins
        if begins[0] == 0:
            runs[0] += self._running.get(unit, 0)
        self.runs[unit] = max(self.runs.get(unit, 0), int(runs.max()))
        self._running[unit] = int(runs[-1]) if ends[-1] == len(lost) else 0
