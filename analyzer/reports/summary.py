"""From batches of rows to a report, in flat memory: counters by unit and function, histograms, no object a frame.

`Summary.feed` takes batches as they come, `Summary.report` says what they come to; `summarize` does both for a capture.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from captures.errors import CaptureError
from dissectors.foreign import NAMES
from dissectors.functions import exception_name, function_name

from ..core import observed
from ..failures import CAUSES, FailedPart, Failures
from ..options import Options
from ..outages import deaf_times, notes_of
from ..tables.bins import Histogram
from ..tables.findings import Findings
from ..tables.schema import Kind, Protocol, Rows
from ..tables.separatelines import SeparateLines
from ..tables.transactions import Status, TransactionRows
from ..tables.verdict import ModbusVerdict
from ..usernotes import Notes, marked_rows
from .breakdown import RateTable, bit_times
from .findings import uncounted
from .model import BookmarkRow, Counts, ExceptionRow, FindingRow, FunctionRow, Load, Report, Times, UnitRow
from .troubles import Troubles, asked_once, is_habit, of_echoes

if TYPE_CHECKING:
    from captures import Capture

    from ..causes.ledger import Ledger
    from ..core import Analysed
    from ..deframing.clockskew import ClockSkew
    from ..filters import Filter
    from ..registers.watch import ValueWatch

_SECOND: Final = 1_000_000_000
_DOUBTFUL: Final = 0.5
_QUIET_NS: Final = 10_000_000_000  # silences that are told, at the least
_STANDS_OUT: Final = 30  # times the usual time from request to request
_OTHER: Final = "other-protocol"
# Counters a transaction adds to, in the order of `Counts`.
_COUNTERS: Final = ("requests", "answered", "exceptions", "unanswered", "broadcasts", "damaged", "retries", "late",
             "unheard", "echoes")  # fmt: skip
BY_STATUS: Final = {
    Status.ANSWERED: "answered",
    Status.EXCEPTION: "exceptions",
    Status.UNANSWERED: "unanswered",
    Status.BROADCAST: "broadcasts",
    Status.DAMAGED: "damaged",
    Status.UNHEARD: "unheard",
}


class Summary:
    """Facts of a bus, growing as batches are fed."""

    def __init__(self, char_ns: float | None = None) -> None:
        """`char_ns`: time of one character on the line, for the load."""
        self._char_ns = char_ns
        self._troubles = Troubles()
        self._counts = {name: np.zeros((256, 256), np.int64) for name in _COUNTERS}  # by unit and function
        self._exceptions: Counter[tuple[int, int, int]] = Counter()
        self._by_unit: dict[int, Histogram] = {}
        self._by_function: dict[int, Histogram] = {}
        self._all = Histogram()
        self._bytes = self._frames = self._requests = self._damaged = self._doubtful = self._tcp = 0
        self._noise_bytes = self._noise_stretches = 0
        self._foreign = np.zeros(len(NAMES), np.int64)  # bytes of other protocols, by number
        self._verdict = ModbusVerdict()
        self._lines = SeparateLines()
        self._skew: ClockSkew | None = None
        self._noise_end = (0, -1)  # port and end of the noise that the last row was, -1 if it was none
        self._first: int | None = None
        self._last: int | None = None
        self._busy = _Busiest()
        self._pause = _LongestPause()
        self.failed: tuple[FailedPart, ...] = ()  # looks
        self.off_ns: int | None = 0  # `Times.off_ns`, as far as is known by now

    @property
    def frames(self) -> int:
        return self._frames

    @property
    def bytes(self) -> int:
        return self._bytes

    def feed(self, analysed: Analysed, earlier: Rows | None = None) -> None:
        """Count a batch in, with what was said of it. `earlier`: rows before it that its findings speak of as well."""
        rows = analysed.batch.rows
        if len(rows) or len(analysed.transactions):
            self.off_ns = round(analysed.off_ns) if np.isfinite(analysed.off_ns) else None
        self._skew = analysed.skew or self._skew
        self.failed = analysed.failed or self.failed
        self._settle(analysed.transactions)
        subjects = rows if earlier is None else Rows.joined((earlier, rows))
        self._troubles.add(analysed.findings, subjects, analysed.transactions)
        self._count_echoes(analysed.findings, subjects)
        if not len(rows):
            return
        self._verdict.feed(rows)
        self._lines.feed(rows)
        noise = rows.kind == Kind.NOISE
        lengths = rows.length
        self._bytes += int(lengths.sum())
        garbage = noise & (rows.foreign == 0)
        self._noise_bytes += int(lengths[garbage].sum())
        self._noise_stretches += self._stretches(rows, garbage)
        self._foreign += np.bincount(rows.foreign, lengths, len(self._foreign)).astype(np.int64)
        frames = rows[~noise]
        self._frames += len(frames)
        self._requests += int((frames.kind == Kind.REQUEST).sum())
        self._damaged += int((~frames.check).sum())
        self._doubtful += int((frames.confidence < _DOUBTFUL).sum())
        self._tcp += int((frames.protocol == Protocol.TCP).sum())
        self._count_exceptions(frames)
        start, end = int(rows.t_start_ns.min()), int(rows.t_end_ns.max())
        self._first = start if self._first is None else min(start, self._first)
        self._last = end if self._last is None else max(end, self._last)
        self._busy.add(rows.t_end_ns, lengths)
        self._pause.add(rows)

    def report(self, capture: Capture, *, source: str = "", partial: bool = False) -> Report:
        """What it comes to."""
        notes = notes_of(capture)
        report = Report(
            source=source,
            format=capture.format,
            baud=capture.line.baud,
            char_bits=capture.line.char_bits,
            tap=capture.line.tap,
            parity=capture.line.parity,
            stop_bits=capture.line.stop_bits,
            timed=capture.timed,
            damage=tuple(str(item) for item in capture.damage),
            damage_count=capture.damage_count,
            partial=partial,
            t_start_ns=self._first if capture.timed else None,
            t_end_ns=self._last if capture.timed else None,
            bytes=self._bytes,
            frames=self._frames,
            requests=self._requests,
            responses=self._frames - self._requests,
            damaged_frames=self._damaged,
            noise_bytes=self._noise_bytes,
            noise_stretches=self._noise_stretches,
            foreign={name: int(size) for name, size in zip(NAMES, self._foreign, strict=True) if name and size},
            not_modbus=self._verdict.foreign,
            clock_skew_ns=self._skew,
            quiet=self._pause.between(self._requests) if capture.timed and not deaf_times(notes) else None,
            separate_ports=self._lines.ports,
            doubtful_frames=self._doubtful,
            tcp_frames=self._tcp,
            transactions=self._counted(lambda table: table.sum()),
            times=self._timed(self._all),
            load=self._load() if capture.timed else Load(),
            units=tuple(self._unit(unit) for unit in np.flatnonzero(self._counts["requests"].sum(axis=1)).tolist()),
            functions=tuple(
                self._function(function) for function in np.flatnonzero(self._counts["requests"].sum(axis=0)).tolist()
            ),
            exceptions=tuple(
                ExceptionRow(unit, function, code, exception_name(code), count)
                for (unit, function, code), count in sorted(self._exceptions.items(), key=lambda item: -item[1])
            ),
            findings=self._told(),
            notes=tuple(notes),
            deaf=tuple(deaf_times(notes)),
            failed=self.failed,
        )
        return replace(report, findings=tuple(map(uncounted, report.findings))) if report.is_handful else report

    def _stretches(self, rows: Rows, noise: NDArray[np.bool_]) -> int:
        """How many stretches of noise begin here; one that goes on from the row before is not a new one."""
        begins = rows.start
        ends = np.append(self._noise_end[1], begins + rows.length)
        ports = np.append(self._noise_end[0], rows.port.astype(np.int64))
        follows = np.append(self._noise_end[1] >= 0, noise)[:-1] & (ends[:-1] == begins) & (ports[:-1] == ports[1:])
        self._noise_end = (int(ports[-1]), int(ends[-1]) if noise[-1] else -1)
        return int((noise & ~follows).sum())

    def _count_exceptions(self, frames: Rows) -> None:
        raised = frames[(frames.exception > 0) & frames.check]
        if not len(raised):
            return
        self._exceptions.update(
            zip(raised.unit.tolist(), raised.function.tolist(), raised.exception.tolist(), strict=True)
        )

    def _settle(self, settled: TransactionRows) -> None:
        if not len(settled):
            return
        cells = settled.unit.astype(np.int64) << 8 | settled.function
        which = {name: settled.status == status for status, name in BY_STATUS.items()}
        which |= {"requests": np.ones(len(settled), np.bool_), "retries": settled.retry, "late": settled.late}
        for name, counted in which.items():
            if counted.any():
                counts = self._counts[name]
                counts += np.bincount(cells[counted], minlength=counts.size).reshape(counts.shape)
        measured = settled[settled.response_ns >= 0]
        if len(measured):
            self._all.add(measured.response_ns)
            for column, histograms in ((measured.unit, self._by_unit), (measured.function, self._by_function)):
                for value in np.unique(column).tolist():
                    times = measured.response_ns[column == value]
                    histograms.setdefault(value, Histogram()).add(times)

    def _told(self) -> tuple[FindingRow, ...]:
        """What is wrong; of what is no Modbus nothing but that."""
        rows = self._troubles.rows()
        return tuple(row for row in rows if row.code == _OTHER) if self._verdict.foreign else rows

    def _count_echoes(self, findings: Findings, rows: Rows) -> None:
        repeated = findings.index[of_echoes(findings)]
        at = np.flatnonzero(np.isin(rows.index, repeated) & (rows.kind == Kind.REQUEST))
        np.add.at(self._counts["echoes"], (rows.unit[at], rows.function[at]), 1)

    def _unit(self, unit: int) -> UnitRow:
        return UnitRow(unit, self._counted(lambda table: table[unit].sum()), self._timed(self._by_unit.get(unit)))

    def _function(self, function: int) -> FunctionRow:
        counts = self._counted(lambda table: table[:, function].sum())
        return FunctionRow(function, function_name(function), counts, self._timed(self._by_function.get(function)))

    def _timed(self, histogram: Histogram | None) -> Times:
        if not histogram:
            return Times()
        p50, p95, p99 = histogram.quantiles(0.50, 0.95, 0.99)
        return Times(len(histogram), histogram.least, p50, p95, p99, histogram.most, histogram.mean, off_ns=self.off_ns)

    def _counted(self, pick: Callable[[NDArray[np.int64]], np.int64]) -> Counts:
        counts = Counts(*(int(pick(self._counts[name])) for name in _COUNTERS))
        return asked_once(counts, shown_twice=is_habit(self._counts["echoes"].sum(), self._counts["requests"].sum()))

    def _load(self) -> Load:
        if not self._char_ns or self._first is None or self._last is None or self._last <= self._first:
            return Load()
        mean = self._bytes * self._char_ns / (self._last - self._first)
        busiest = self._busy.most() * self._char_ns / _SECOND
        # A short capture has hardly a whole second of the clock in it: what they hold tells no peak then.
        peak = self._last - self._first >= _SECOND and busiest >= mean
        return Load(min(mean, 1.0), min(busiest, 1.0) if peak else None)


class _LongestPause:
    """The longest silence between rows."""

    def __init__(self) -> None:
        self._begin: int | None = None
        self._end = 0  # of the last row so far
        self._longest = (0, 0)

    def add(self, rows: Rows) -> None:
        first = int(rows.t_start_ns[0])
        self._begin, self._end = (first, first) if self._begin is None else (self._begin, self._end)
        ends = np.maximum(np.maximum.accumulate(rows.t_end_ns), self._end)
        before = np.append(self._end, ends[:-1])
        at = int(np.argmax(rows.t_start_ns - before))
        begin, end = int(before[at]), int(rows.t_start_ns[at])
        if end - begin > self._longest[1] - self._longest[0]:
            self._longest = begin, end
        self._end = int(ends[-1])

    def between(self, requests: int) -> tuple[int, int] | None:
        """From when to when (ns) nothing was heard, where that is no pause as all others are."""
        begin, end = self._longest
        usual = (self._end - (self._begin or 0) - (end - begin)) / max(requests, 1)
        return self._longest if requests and end - begin >= max(_QUIET_NS, _STANDS_OUT * usual) else None


class _Busiest:
    """The most bytes in one second of the clock; bytes count where their row ends. Rows come nearly in time order."""

    def __init__(self) -> None:
        self._second: int | None = None
        self._current_octets = 0
        self._most = 0

    def add(self, t_end: NDArray[np.int64], lengths: NDArray[np.int64]) -> None:
        seconds, where = np.unique(t_end // _SECOND, return_inverse=True)
        sums = np.bincount(where, weights=lengths)
        for second, octets in ((int(seconds[0]), int(sums[0])), (int(seconds[-1]), int(sums[-1]))):
            if second != self._second:
                self._second, self._current_octets = second, 0
            self._current_octets += octets
            self._most = max(self._most, self._current_octets)
            if len(seconds) == 1:
                return
        self._most = max(self._most, int(sums.max()))

    def most(self) -> int:
        return self._most


def summarize(
    capture: Capture,
    *,
    source: str = "",
    filter: Filter | None = None,
    options: Options = Options(),  # noqa: B008 - frozen
    progress: Callable[[int, int], None] | None = None,
    stop: Callable[[], bool] | None = None,
    watch: Callable[[Analysed], None] | None = None,
    values: ValueWatch | None = None,
) -> Report:
    """Deframe a capture and report on it, or on what passes a filter (`analyzer.filters.evaluation`).

    `watch` sees every batch too, for a page that shows more than the counts; `values` gathers what registers held.
    `progress` is told (frames, bytes) after each batch; once `stop` says True the report is made of what came so far.
    """
    from ..causes.ledger import Ledger
    from ..core import analyse

    line = capture.line
    summary = Summary(line.character_ns)
    ledger = Ledger(line, options) if filter is None else None  # a part of a bus tells no story
    failures = Failures()
    stream = analyse(observed(capture, stop=stop), options)
    if filter is not None:
        from ..filters.evaluation import filtered

        stream = filtered(stream, filter, line)
    notes, marks = Notes.of_capture(capture.path), list[BookmarkRow]()
    spans = capture.spans
    rates = RateTable({} if spans is None else spans.bauds)
    if spans is not None:
        spans.want()
    for analysed in stream:
        summary.feed(analysed)
        if spans is not None:
            rates.feed(analysed.batch.rows, bit_times(spans, analysed.batch.rows))
        marks += _marks(notes, analysed.batch.rows)
        if ledger is not None and CAUSES not in failures:
            with failures.contained(CAUSES):
                ledger.feed(analysed.batch, analysed.transactions)
        if watch is not None:
            watch(analysed)
        if values is not None:
            values.feed(analysed.batch)
        if progress is not None:
            progress(summary.frames, summary.bytes)
    report = summary.report(capture, source=source, partial=stop is not None and stop())
    report = replace(report, bookmarks=tuple(marks), rates=rates.rows())
    if values is not None:
        report = replace(report, values=values.values())
    if ledger is None:
        return replace(report, filter="" if filter is None else filter.text, quiet=None)
    if CAUSES not in failures:
        with failures.contained(CAUSES):
            ledger.close()
            if values is not None:
                ledger.breaches = values.breaches()
            return with_story(report, ledger)
    return replace(report, failed=report.failed + failures.parts)


def of_one_line(report: Report) -> Report:
    """The report; CaptureError where it is one of several lines, of which a page can only be wrong."""
    if ports := report.separate_ports:
        listed = ", ".join(map(str, ports))
        raise CaptureError(
            f"{report.source}: holds {len(ports)} separate lines (ports {listed}): choose one, such as "
            f"--only-port {ports[0]}"
        )
    return report


def with_cards(report: Report, ledger: Ledger) -> Report:
    """The report with what was heard of each unit: silence and garbage are two things."""
    from .breakdown import unit_cards

    return replace(report, cards=unit_cards(ledger, report.units))


def with_story(report: Report, ledger: Ledger) -> Report:
    """And with the causes, what none of them takes, the findings that follow from each, and the polls."""
    from ..causes.reasoning import story_of
    from .breakdown import poll_rows
    from .findings import explained_row

    story = story_of(ledger)
    causes = tuple(story.causes)
    explained = tuple(explained_row(row, causes) for row in report.findings)
    return replace(with_cards(report, ledger), causes=causes, not_explained=tuple(story.not_explained),
                   polls=poll_rows(ledger), findings=explained, failed=report.failed + story.failed)  # fmt: skip


def _marks(notes: Notes, rows: Rows) -> Iterator[BookmarkRow]:
    """The rows among these that the user marked."""
    for row, comment in marked_rows(notes, rows.port, rows.start).items():
        index, port, start, t_ns, unit, function = (
            int(rows.column(name)[row]) for name in ("index", "port", "start", "t_end_ns", "unit", "function")
        )
        yield BookmarkRow(index, port, start, t_ns, unit, function, comment)
