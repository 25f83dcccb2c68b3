"""A bus as far as it is known: rows and bytes, who answers whom, findings, registers, activity over time.

`feed` and `close` belong to one thread, everything else may be asked from any. Rows are numbered from 0 in wire order,
noise among them; a number stands for the same row for ever.
"""

from __future__ import annotations

import threading
from collections.abc import Iterator, Sequence
from dataclasses import replace
from math import inf
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..causes.gathered import SharedLedger
from ..core import Analysed
from ..failures import CAUSES, FailedPart, Failures
from ..options import Options
from ..outages import Deaf
from ..reports.summary import Summary, with_cards, with_story
from ..tables.batch import Batch, Frame
from ..tables.columns import decode
from ..tables.schema import NO_GAP, Kind, Row, Rows, bounds_of
from ..tables.transactions import NEVER, OF_ANSWER, Status, TransactionRows
from .activity import Activity, Bins, UnitActivity
from .polls import PollIndex
from .pollwatch import PollLog
from .registers import RegisterLog
from .rowstores import ByteStore, FindingLog, RowBits, RowEvidence, evidence_columns, evidence_of
from .source import CaptureSource, ViewSource
from .table import PIECE, BusRows, RowState, RowTable

if TYPE_CHECKING:
    from ..causes.reasoning import Story
    from ..causes.registry import Cause
    from ..reports.breakdown import RateTable
    from ..reports.model import Report
    from ..tables.findings import Finding

_COPIED = ("start", "length", "t_start_ns", "t_end_ns", "response_ns", "confidence", "kind", "unit", "function",
           "exception", "check", "port", "protocol", "gap_before_ns", "gap_most_ns", "errors", "taken_for_start",
           "unsure")  # fmt: skip
_READ_BY = ("length", "kind", "unit", "function", "exception", "check", "protocol")

# What the other columns of `Rows` are given as, for want of being kept.
_LEFT_OUT: Final[dict[str, Any]] = {
    **dict(zip(Rows.dtypes(), Rows.zeros(1).values(0), strict=True)),
    "request": -1,
    "request_start": -1,
    "taken_for_start": -1,
    "gap_least_ns": NO_GAP,
}


_TAKEN_ROWS: Final = 64  # back to the request that an answer is taken for
_STORED_AS: Final = {"index": "frame"}  # the columns of `Rows` that have another name here


class Bus:
    """The model of one source."""

    def __init__(self, line: LineSettings, *, timed: bool = True) -> None:
        self.line = line
        self.timed = timed
        self.table = RowTable()
        self.store = ByteStore()
        self.found = FindingLog()
        self.registers = RegisterLog()
        self.polls = PollIndex(self)
        self.watched = PollLog()
        self.activity = Activity()
        self.units = UnitActivity()
        self.frames = 0
        self.noise_bytes = 0  # in no frame
        self._count = 0
        self.whole = False  # nothing more comes
        self.t_first = self.t_last = 0
        self.off_ns: int | None = None  # by how much response times may be wrong, as `reports.model.Times` has it
        self._parts: tuple[FailedPart, ...] = ()  # of the analysis that failed: looks and judges,
        self._failures = Failures()  # and causes altogether
        self._summary = Summary(line.character_ns)
        self.options = Options()
        self.bits: RowBits | None = None  # where the capture has edges
        self._ledger = SharedLedger(line)
        self._lock = threading.Lock()
        self._source: ViewSource | None = None

    @classmethod
    def of(cls, source: ViewSource) -> Bus:
        """An empty model for a source."""
        bus = cls(source.line, timed=source.timed)
        bus._source = source
        if not isinstance(source, CaptureSource):
            return bus
        bus.options = source.options
        bus._ledger = SharedLedger(source.line, source.options)
        if source.capture.spans is not None:
            bus.bits = RowBits(source.capture.spans)
        return bus

    @property
    def char_ns(self) -> float | None:
        """Time of one character on the line; None where its speed is not known."""
        return self.line.character_ns

    @property
    def count(self) -> int:
        """Rows, all that is known of them written."""
        return self._count

    @property
    def deaf(self) -> Sequence[Deaf]:
        """Times in which a recording heard nothing."""
        return getattr(self._source, "deaf", ())

    # Taking in

    def feed(self, analysed: Analysed) -> None:
        """Take in the next rows, and what is said of these or of earlier ones."""
        batch, first = analysed.batch, self.table.count
        if len(batch):
            self._append(batch)
            self._join(batch.rows, first)
        self._settle(analysed.transactions)
        told = self.found.count
        in_trouble = self.found.add(analysed.findings, self.table)
        earlier = np.unique(self.found.rows_of(np.arange(told, self.found.count))).astype(np.int64)
        earlier = earlier[(earlier >= 0) & (earlier < first)]
        if len(batch):
            numbers, decoded = np.arange(first, first + len(batch)), decode(batch)
            self.registers.feed(batch, numbers, decoded)
            self.watched.feed(batch, numbers, decoded, self.table.take_column("partner", numbers).astype(np.int64))
            self.activity.feed(batch.rows)
            self.units.feed(batch.rows)
        self.watched.settle(self.table.rows_of_frames(analysed.transactions.request), analysed.transactions)
        self.activity.trouble(self.table.take_column("t_end_ns", in_trouble))
        with self._lock:
            if self.bits is not None:
                self.bits.feed(batch.rows)
            self._summary.feed(analysed, self.batch(earlier).rows if len(earlier) else None)
            self.off_ns = self._summary.off_ns
        if CAUSES not in self._failures:
            with self._failures.contained(CAUSES):
                self._ledger.feed(self.line, batch, analysed.transactions)
        self._count = self.table.count
        self._take_failed(analysed.failed)

    def close(self) -> None:
        """Nothing more comes."""
        try:
            if CAUSES not in self._failures:
                with self._failures.contained(CAUSES):
                    self._ledger.close()
        finally:
            self.whole = True

    @property
    def failed(self) -> tuple[FailedPart, ...]:
        """Parts of the analysis that failed so far."""
        return (*self._parts, *self._failures.parts)

    def _append(self, batch: Batch) -> None:
        rows = batch.rows
        n = len(rows)
        noise = rows.kind == Kind.NOISE
        lengths = rows.length
        ends = np.cumsum(lengths)
        if (rows.at == ends - lengths).all() and int(ends[-1]) == len(batch.data):
            data = batch.data
        else:
            spread = np.repeat(rows.at - (ends - lengths), lengths) + np.arange(int(ends[-1]))
            data = batch.data[spread]
        columns: dict[str, NDArray[Any]] = {name: rows.column(name) for name in _COPIED}
        columns["frame"] = self.frames + np.cumsum(~noise) - ~noise
        columns["at"] = self.store.append(data) + ends - lengths
        columns["partner"] = np.full(n, -1, np.int32)
        columns["state"] = columns["mark"] = np.zeros(n, np.uint8)
        columns.update(evidence_columns(batch))
        if not self.table.count:
            self.t_first = int(rows.t_start_ns[0])
        self.t_first = min(self.t_first, int(rows.t_start_ns.min()))
        self.t_last = max(self.t_last, int(rows.t_end_ns.max()))
        self.noise_bytes += int(rows.length[noise].sum())
        self.frames += n - int(noise.sum())
        self.table.append(BusRows(**columns))

    def _join(self, rows: Rows, first: int) -> None:
        """Who answers whom; of several answers the first is the request's partner."""
        answers = np.flatnonzero(rows.request >= 0)
        requests = self.table.rows_of_frames(rows.request[answers])
        answers, requests = answers[requests >= 0] + first, requests[requests >= 0]
        self.table.put("partner", answers, requests)
        new = self.table.take_column("partner", requests) < 0
        self.table.put("partner", requests[new][::-1], answers[new][::-1])

    def _settle(self, settled: TransactionRows) -> None:
        rows = self.table.rows_of_frames(settled.request)
        state = settled.status + 1 | settled.retry * RowState.RETRY | settled.late * RowState.LATE
        self.table.put("state", rows[rows >= 0], state[rows >= 0])

    # Looking

    def captured(self, row: int) -> bytes:
        """The bytes of a row."""
        return self.store.get(self.table.value("at", row), self.table.value("length", row)).tobytes()

    def is_noise(self, row: int) -> bool:
        """Whether a row is a stretch that no frame explains."""
        return self.table.value("kind", row) == Kind.NOISE

    def partner(self, row: int) -> int | None:
        """The row of the request that a row answers, or of the answer to it."""
        joined = self.table.value("partner", row)
        return None if joined < 0 else joined

    def taken_for(self, row: int) -> int | None:
        """The row of the request that the client takes an answer for, where it is of another."""
        start, unit = self.table.value("taken_for_start", row), self.table.value("unit", row)
        for before in range(row - 1, max(row - _TAKEN_ROWS, -1), -1):
            if start >= 0 and self.table.value("start", before) == start and self.table.value("unit", before) == unit:
                return before
        return None

    def frame(self, row: int) -> Frame:
        """A view of a row that is a frame."""
        values = self.table.row(row)
        request = -1
        if values["kind"] == Kind.RESPONSE:
            request = values["partner"]
        fields: dict[str, Any] = {**_LEFT_OUT, **{name: values[name] for name in _COPIED}, "index": values["frame"]}
        if request >= 0:
            fields["request"] = self.table.value("frame", request)
            fields["request_start"] = self.table.value("start", request)
        return Frame(
            Row(**fields),
            self.captured(row),
            None if request < 0 else self.captured(request),
            findings=self.findings(row),
            off_ns=self._off_ns,
        )

    def findings(self, row: int) -> tuple[Finding, ...]:
        """What was found about a row."""
        return self.found.of_row(row) if self.table.value("mark", row) else ()

    def evidence(self, row: int) -> RowEvidence | None:
        """Why a row's boundaries stand where they do; None where nobody kept it."""
        return evidence_of(self.table, row)

    def gap_ns(self, row: int) -> int | None:
        """Silence before a row; None before the first one and where unknown from this tap."""
        gap = self.table.value("gap_before_ns", row)
        return gap if self.timed and row > 0 and gap > NO_GAP else None

    @property
    def _off_ns(self) -> float:
        return inf if self.off_ns is None else self.off_ns

    def response(self, row: int) -> tuple[int, int] | None:
        """Between what the time (ns) lies that an answer took, twice the same where it is measured; None: unknown."""
        took = self.table.value("response_ns", row)
        return None if took < 0 else bounds_of(took, self.off_ns)

    def batch(self, rows: NDArray[np.int64]) -> Batch:
        """Rows, ascending, all of one piece, as what the pipeline gives; bytes between them are in its data too."""
        batch, requests = self._placed(rows, _COPIED)
        out = batch.rows
        out.gap_least_ns[:], out.request_start[:] = NO_GAP, -1
        answers = np.flatnonzero(requests >= 0)
        out.request_start[answers] = self.table.take_column("start", requests[answers])
        return replace(batch, findings=self.found.on(rows))

    def contents(self, rows: NDArray[np.int64]) -> Batch:
        """The same as far as it takes to read their bytes: places, times, confidence and findings are left out."""
        return self._placed(rows, _READ_BY)[0]

    def _placed(self, rows: NDArray[np.int64], names: Sequence[str]) -> tuple[Batch, NDArray[np.int64]]:
        """These rows with some columns, their bytes and those of their requests; the rows of the requests, or -1."""
        number = int(rows[0]) // PIECE
        first = int(rows[0]) - number * PIECE
        all_between = rows[-1] - rows[0] == len(rows) - 1
        slots = slice(first, first + len(rows)) if all_between else rows - number * PIECE
        column = self.table.stretch
        out = Rows.zeros(len(rows))
        out.taken_for_start[:] = -1
        for name in names:
            out.column(name)[:] = column(number, name, slots)
        at, frame, partner = (column(number, name, slots).astype(np.int64) for name in ("at", "frame", "partner"))
        np.subtract(at, at[0], out=out.at)
        out.index[:] = np.where(out.kind != Kind.NOISE, frame, -1)
        requests = np.where(out.kind == Kind.RESPONSE, partner, -1)
        answers = np.flatnonzero(requests >= 0)
        asked = requests[answers]
        out.request[:] = -1
        out.request[answers] = self.table.take_column("frame", asked)
        away = asked[(asked < rows[0]) | (asked > rows[-1])] if all_between else asked[~np.isin(asked, rows)]
        earlier = {self.table.value("frame", row): self.captured(row) for row in np.unique(away).tolist()}
        data = self.store.get(int(at[0]), int(at[-1]) + int(out.length[-1]) - int(at[0]))
        return Batch(out, data, earlier, off_ns=self._off_ns), requests

    def transactions(self, requests: NDArray[np.int64]) -> TransactionRows:
        """What became of the requests among these rows, as the pipeline gives it; open ones are left out."""
        read = self.table.take_column
        requests = requests[read("state", requests) > 0]
        state = read("state", requests)
        out = TransactionRows.zeros(len(requests))
        out.status[:] = (state & RowState.STATUS) - 1
        out.retry[:], out.late[:] = state & RowState.RETRY, state & RowState.LATE
        for name in ("start", "length", "t_start_ns", "unit", "function", "port", "protocol"):
            out.column(name)[:] = read(name, requests)
        out.request[:], out.t_request_ns[:], out.t_next_ns[:] = (
            read("frame", requests),
            read("t_end_ns", requests),
            NEVER,
        )
        has_answer = np.isin(out.status, (Status.ANSWERED, Status.EXCEPTION, Status.DAMAGED))
        has_answer &= read("partner", requests) >= 0  # else nobody can tell whose the answer is
        answers = read("partner", requests[has_answer])
        for name, column in OF_ANSWER.items():
            out.column(name)[:] = -1 if TransactionRows.dtypes()[name].kind == "i" else 0
            out.column(name)[has_answer] = read(_STORED_AS.get(column, column), answers)
        return out

    def batches(self, first: int, last: int, size: int = 1 << 14) -> Iterator[tuple[int, Batch]]:
        """Rows `first` to `last` (excluded) as batches of at most `size` rows, each with its first row's number."""
        while first < last:
            stop = min(last, first + size, (first // PIECE + 1) * PIECE)
            yield first, self.batch(np.arange(first, stop))
            first = stop

    def over(self, t_start: int, t_end: int, bins: int) -> Bins:
        """How busy a span was, in equal bins."""
        return self.activity.over(self, t_start, t_end, bins)

    def report(self, source: ViewSource, *, story: bool = False) -> Report:
        """The bus on one page, as it is known now; `story`: with its causes, which take a moment."""
        with self._lock:
            rates = None if self.bits is None else self.bits.of_all
            page = self.page(self._summary, rates, source, partial=not self.whole)
        if CAUSES in self._failures:
            return replace(page, failed=self.failed)
        with self._ledger.looked_at() as ledger:
            report = (with_story if story else with_cards)(page, ledger)
        self._take_failed(report.failed)
        return report

    def page(self, summary: Summary, rates: RateTable | None, source: ViewSource, *, partial: bool) -> Report:
        """A summary of this bus, or of some of its rows, as a page."""
        from captures.chunks import Capture

        capture = getattr(source, "capture", None) or Capture.of(source.line, (), timed=source.timed)
        report = summary.report(capture, source=source.name, partial=partial)
        return report if rates is None else replace(report, rates=rates.rows())

    def causes(self) -> list[Cause]:
        """What explains the findings so far, best first; nothing on a healthy bus. Takes a moment."""
        return self.story().causes

    def story(self) -> Story:
        """The same, with what no cause takes."""
        from ..causes.reasoning import Story, story_of

        if CAUSES in self._failures:
            return Story([], [], self.failed)
        with self._ledger.looked_at() as ledger:
            story = story_of(ledger)
        self._take_failed(story.failed)
        return story

    def _take_failed(self, parts: Sequence[FailedPart]) -> None:
        if new := [part for part in parts if part not in self._parts]:
            self._parts = (*self._parts, *new)

    @property
    def nbytes(self) -> tuple[int, int]:
        """Memory of everything but the bytes, and of the bytes."""
        return self.table.nbytes + self.found.nbytes + self.registers.nbytes, self.store.nbytes
