"""The analysis of one line, slice after slice, kept between them: what comes out is what one pass gives.

Blocks are cut by the chunks alone, across the slices' seams, and fed to one `Analyzer`; so a line whose newest slice
was analysed goes on with the next one, years after, without reading anything anew. `kept` is the whole state as bytes
(plain data: see `plainstate`), `resumed` makes it again.

Beside the tables of an export a line keeps its units' hours: what became of requests and how long it took, so that
questions of a fleet read little. Where the newest slice has grown since it was taken, the chunks that the lake has are
passed over, and what is behind them is new.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from functools import cache
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from captures.line import LineSettings
from captures.recording.notes import Note
from captures.spacing import INFERRED
from captures.time_order import CLOCK_STEP_NS, TimeOrder

from ..causes.ledger import Ledger
from ..causes.reasoning import causes_of
from ..causes.registry import numbers_kept
from ..core import Analysed, Analyzer, EvenBlocks
from ..deframing.ascii import AsciiEngine
from ..deframing.engine import Engine
from ..deframing.mbap import MbapEngine
from ..deframing.protocols import EngineOfPort, WeighedPort
from ..deframing.stream import EngineMaker, PortEngine
from ..exports.arrow import record_batch
from ..exports.records import TABLES, record_arrow, record_schema
from ..options import Options
from ..outages import deaf_times, listened_until
from ..registers.checking import LimitBreach
from ..reports.troubles import COUNTED_TWICE, is_habit, of_echoes
from ..tables.batch import Batch, join_batches
from ..tables.findings import FindingLook, Findings, all_looks
from ..tables.transactions import NEVER, Status, TransactionRows
from ..words import DAY_NS, HOUR_NS
from . import FleetError
from .datasets import CAUSES, HOURS, LakeFiles
from .plainstate import StateError, decoded, encoded
from .stateschema import Schema

if TYPE_CHECKING:
    from captures import Block, Capture

_STATUSES: Final = tuple(status.name.lower() for status in Status)
_UNITS: Final = 256
_COUNTS: Final = tuple(HOURS.names[2:])  # sums, but for
_LONGEST: Final = _COUNTS.index("response_time_high_max_ns")  # which is a greatest


class UnitHours:
    """Transactions in, in the order of their requests; hours that are over out. What an adapter shows twice is one
    request, as in a report."""

    _open: dict[int, NDArray[np.int64]]
    _requests: int
    _echoes: int

    def __init__(self) -> None:
        self._open = {}  # by the hour since the epoch: a row a unit, echoes last
        self._requests = self._echoes = 0  # of the line so far

    def feed(self, settled: TransactionRows, findings: Findings, off_ns: float) -> Any:
        """Take in transactions, what was said of them, and by how much their times may be wrong; the rows of hours that
        are over, as one of `HOURS`."""
        if not len(settled):
            return _hours_table({})
        hours = settled.t_start_ns // HOUR_NS
        echoes = np.isin(settled.request, findings.index[of_echoes(findings)])
        self._requests += len(settled)
        self._echoes += int(np.count_nonzero(echoes))
        counts = _counts(settled, echoes, off_ns)
        for hour in np.unique(hours).tolist():
            table = self._open.setdefault(hour, np.zeros((_UNITS, len(_COUNTS) + 1), np.int64))
            these = np.flatnonzero(hours == hour)
            units, mine = settled.unit[these], counts[these]
            longest = table[:, _LONGEST].copy()
            np.maximum.at(longest, units, mine[:, _LONGEST])
            np.add.at(table, units, mine)
            table[:, _LONGEST] = longest
        newest = max(self._open)
        return self._told([hour for hour in sorted(self._open) if hour < newest - 1])

    def close(self) -> Any:
        """The rest."""
        return self._told(sorted(self._open))

    def _told(self, hours: list[int]) -> Any:
        twice = is_habit(self._echoes, self._requests)
        return _hours_table({hour: _counted(self._open.pop(hour), shown_twice=twice) for hour in hours})


def _counted(table: NDArray[np.int64], *, shown_twice: bool) -> NDArray[np.int64]:
    counts, echoes = table[:, :-1], table[:, -1]
    for name in COUNTED_TWICE if shown_twice else ():
        column = counts[:, _COUNTS.index(name)]
        np.maximum(column - echoes, 0, out=column)
    return counts


def _counts(settled: TransactionRows, echoes: NDArray[np.bool_], off_ns: float) -> NDArray[np.int64]:
    """What each transaction adds to `_COUNTS`, and whether it is an echo."""
    _, low, high = settled.response_times(off_ns)
    columns = {
        "requests": np.ones(len(settled), np.bool_),
        **{name: settled.status == code for code, name in enumerate(_STATUSES)},
        "retries": settled.retry,
        "late": settled.late,
        "timed": low >= 0,
        "response_time_low_sum_ns": np.maximum(low, 0),
        "response_time_high_sum_ns": np.maximum(high, 0),
        "response_time_high_max_ns": np.maximum(high, 0),
    }
    return np.column_stack([columns[name] for name in _COUNTS] + [echoes]).astype(np.int64)


def _hours_table(hours: dict[int, NDArray[np.int64]]) -> Any:
    units = {hour: np.flatnonzero(table[:, 0]) for hour, table in hours.items()}
    t_ns = np.concatenate([np.zeros(0, np.int64), *(np.full(len(u), hour * HOUR_NS) for hour, u in units.items())])
    counts = np.concatenate([np.zeros((0, len(_COUNTS)), np.int64), *(hours[hour][u] for hour, u in units.items())])
    numbers = np.concatenate([np.zeros(0, np.uint8), *(u.astype(np.uint8) for u in units.values())])
    columns = [pa.array(t_ns).view(HOURS.field("t_ns").type), pa.array(numbers)]
    columns += [pa.array(np.ascontiguousarray(counts[:, i])) for i in range(len(_COUNTS))]
    return pa.record_batch(columns, schema=HOURS)


_LITTLE: Final = 256  # rows
_NOTES: Final = 4096  # of a line remembered, the newest


@dataclass(slots=True)
class LineState:
    """One line so far. `frames` and `octets` were given to the lake, or wait in it to be."""

    line: LineSettings
    options: Options
    noise: bool
    analyzer: Analyzer = field(init=False)
    even: EvenBlocks = field(init=False, default_factory=EvenBlocks)
    order: TimeOrder = field(init=False, default_factory=TimeOrder)
    notes: list[Note] = field(init=False, default_factory=list)
    hours: UnitHours = field(init=False, default_factory=UnitHours)
    frames: int = 0
    octets: int = 0
    steps: list[str] = field(default_factory=list)  # of the clock, between the newest slice and the one before
    _until_ns: int = NEVER  # of the newest byte
    _ledger: Ledger | None = None
    _day: int = 0  # of the ledger, since the epoch
    _begun_ns: int = 0  # of its first row

    def __post_init__(self) -> None:
        self.analyzer = Analyzer(self.line, self.options)

    def slice(self, capture: Capture, blocks: Iterable[Block], files: LakeFiles) -> Iterator[tuple[int, int, int]]:
        """Take in these blocks of a slice: of each, as it comes, bytes, first and last time. Raises CaptureError."""
        self.steps = []
        self.notes = [*self.notes, *(note for note in capture.notes() if note not in self.notes)][-_NOTES:]
        self.analyzer.deafen(deaf_times(self.notes))
        if INFERRED not in capture.line.notes and _settings(capture.line) != _settings(self.line):
            self._restart(capture.line, files)
        for raw in blocks:
            block = self._in_order(raw, files)
            self.octets += len(block.data)
            yield len(block.data), int(block.t_ns.min()), int(block.t_ns.max())
            for part in self.even.feed(block):
                self._take(self.analyzer.feed(part), files)

    def _in_order(self, block: Block, files: LakeFiles) -> Block:
        """The same with times that go on from the slice before; anew where a clock was set back in between."""
        if not block.timed:
            return block
        back_ns = self._until_ns - int(block.t_ns.min())
        if back_ns > CLOCK_STEP_NS:
            self.steps.append(
                f"starts {back_ns / 1e9:.3f} s before the previous slice ends (clock set back, or the same bytes in "
                "both): the line starts afresh here"
            )
            self._restart(self.line, files)
        block = replace(block, t_ns=self.order.mend(block.t_ns, block.port))
        self._until_ns = int(block.t_ns.max())
        return block

    def broken(self, files: LakeFiles) -> None:
        """A slice is missing here: what follows begins anew, so that nothing is paired across the hole."""
        self._restart(self.line, files)

    def _restart(self, line: LineSettings, files: LakeFiles) -> None:
        for part in self.even.close():
            self._take(self.analyzer.feed(part), files)
        self.even, self.order, self._until_ns = EvenBlocks(), TimeOrder(), NEVER
        self._take(self.analyzer.restart(line), files)
        self._close_day(files)
        self.line = line

    def close(self, files: LakeFiles) -> None:
        """No more comes, as far as is known: the rest of the rows. The state is of no use any more."""
        for part in self.even.close():
            self._take(self.analyzer.feed(part), files)
        self._take(_together(self.analyzer.close(listened_until(self.notes))), files)
        self._close_day(files)
        files.add("hours", self.hours.close())

    def _take(self, parts: Iterable[Analysed], files: LakeFiles) -> None:
        for analysed in parts:
            self.frames += int((analysed.batch.rows.index >= 0).sum())
            if "frames" in files.tables:
                files.add("frames", record_batch(analysed.batch, noise=self.noise))
            for name, table in TABLES.items():
                if name not in files.tables and name != "transactions":  # of these hours are counted on
                    continue
                records = record_arrow(_record_schema(name), table.made(analysed))
                files.add(name, records)
                if name == "transactions":
                    files.add("hours", self.hours.feed(analysed.transactions, analysed.findings, analysed.off_ns))
            for batch, transactions in _days(analysed):
                self._explain(batch, transactions, files)

    def _explain(self, batch: Batch, transactions: TransactionRows, files: LakeFiles) -> None:
        """Rows of one day into the ledger of that day."""
        if not len(batch):
            return
        begun = int(batch.rows.t_start_ns[0])
        if self._ledger is None or begun // DAY_NS > self._day:
            self._close_day(files)
            self._ledger, self._day, self._begun_ns = Ledger(self.line, self.options), begun // DAY_NS, begun
        self._ledger.feed(batch, transactions)

    def _close_day(self, files: LakeFiles) -> None:
        if self._ledger is None:
            return
        self._ledger.close()
        ledger, self._ledger = self._ledger, None
        if "causes" not in files.tables:
            return
        rows = [
            {
                **cause.to_json(),
                "t_ns": self._begun_ns if cause.since_ns is None else cause.since_ns,
                "numbers": numbers_kept(cause.numbers),
            }
            for cause in causes_of(ledger)
        ]
        columns = [_column_of_kind(field.type, [row[field.name] for row in rows]) for field in CAUSES]
        files.add("causes", pa.record_batch(columns, schema=CAUSES))

    def kept(self) -> bytes:
        """The whole of it, to go on from."""
        return encoded(self, _schema())


def _together(parts: list[Analysed]) -> list[Analysed]:
    """The same, as one where they are little: a table of few rows costs as much as one of many."""
    if sum(len(each.batch) for each in parts) > _LITTLE or len(parts) < 2 or parts[0].batch.evidence is not None:
        return parts
    findings = Findings.joined([each.findings for each in parts])
    transactions = TransactionRows.joined([each.transactions for each in parts])
    batch = join_batches([each.batch for each in parts]).said(findings)
    return [Analysed(batch, transactions, findings, parts[-1].skew)]


@cache
def _record_schema(name: str) -> Any:
    return record_schema(TABLES[name])


def _column_of_kind(kind: Any, values: list[Any]) -> Any:
    return pa.array([list(each) if isinstance(each, tuple) else each for each in values], kind)


def _settings(line: LineSettings) -> LineSettings:
    """What a restart hangs on: another note in a header is no other line."""
    return replace(line, tap=None, notes={})


def _days(analysed: Analysed) -> Iterator[tuple[Batch, TransactionRows]]:
    """The rows of each day, with the transactions that they began. A day begins with its first row and never again."""
    batch, transactions = analysed.batch, analysed.transactions
    days = np.maximum.accumulate(batch.rows.t_start_ns // DAY_NS)
    begins = (np.flatnonzero(np.diff(days)) + 1).tolist()
    if not begins:
        yield batch, transactions
        return
    first = begun = 0
    for last in [*begins, len(batch)]:
        rows = batch.rows[first:last]
        indices = rows.index[rows.index >= 0]
        after = int(np.searchsorted(transactions.request, indices.max(initial=-1), side="right"))
        end = len(transactions) if last == len(batch) else max(after, begun)
        earlier = {**batch.earlier, **dict(_asked_before(batch, first, last, int(indices.min(initial=1 << 62))))}
        yield replace(batch, rows=rows, earlier=earlier, evidence=None, findings=None), transactions[begun:end]
        first, begun = last, end


def _asked_before(batch: Batch, first: int, last: int, index: int) -> Iterator[tuple[int, bytes]]:
    """The requests before `index` that these rows answer, and that stand in this batch."""
    asked = batch.rows.request[first:last]
    for row in np.flatnonzero((asked >= 0) & (asked < index)).tolist():
        if (request := batch.request_of(first + row, int(asked[row]))) is not None:
            yield int(asked[row]), request


@cache
def _schema() -> Schema:
    """Of all that a line's state holds."""
    engines = (Engine, AsciiEngine, MbapEngine, WeighedPort)
    return Schema(
        LineState,
        {FindingLook: all_looks(), PortEngine: engines, EngineMaker: (EngineOfPort,)},
        {"LimitBreach": LimitBreach, "Note": Note, "LineSettings": LineSettings},
    )


def resumed(data: bytes) -> LineState:
    """What `kept` gave. Raises FleetError where these bytes are something else, or of another version."""
    if data[:1] == b"\x80":
        words = "it is a pickle from an older rtuscope, not read because a pickle can run code"
        raise FleetError(f"the state of the line cannot be used: {words}")
    try:
        state = decoded(data, _schema())
    except StateError as error:
        raise FleetError(f"the state of the line cannot be used: {error}") from error
    assert isinstance(state, LineState)
    return state


class NotGrownError(Exception):
    """The slice does not begin with the chunks that were taken."""


class ChunkDigest:
    """What chunks come to, however divided into blocks: how many, and a digest of bytes, lengths, times, ports."""

    def __init__(self) -> None:
        self.count = 0
        self._columns = [hashlib.sha256() for _ in range(4)]

    def add(self, block: Block) -> None:
        """Chunks behind those so far."""
        self.count += len(block)
        columns = (block.data, np.diff(block.offsets), block.t_ns, block.port)
        for digest, column in zip(self._columns, columns, strict=True):
            digest.update(np.ascontiguousarray(column).tobytes())

    def text(self) -> str:
        """The digest."""
        return hashlib.sha256(b"".join(each.digest() for each in self._columns)).hexdigest()[:32]


def behind(blocks: Iterable[Block], count: int, digest: str, seen: ChunkDigest) -> Iterator[Block]:
    """What stands behind the first `count` chunks, which have this digest; all are `seen`. Raises NotGrownError."""
    left = count
    for block in blocks:
        at = min(left, len(block))
        if at:
            seen.add(block.slice(0, at))
            left -= at
            if not left and seen.text() != digest:
                raise NotGrownError
        if at < len(block):
            rest = block.slice(at, len(block))
            seen.add(rest)
            yield rest
    if left:
        raise NotGrownError
