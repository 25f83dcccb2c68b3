"""What is kept beside the table of rows.

Row by row: their bytes, kept once and in row order; why their boundaries stand where they do, in 15 bytes a row; and
how long their bits took, where a capture has edges, and by that how fast senders' clocks are. And findings in the
order in which they were made, each with the row that it stands on; and by what explains them.
"""

from __future__ import annotations

import threading
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..causes.registry import cause_of
from ..reports.breakdown import RateTable, bit_times
from ..tables.findings import Finding, Findings, Severity, codes, describe, rules
from ..tables.schema import Kind
from .table import NO_EVIDENCE, RowTable

if TYPE_CHECKING:
    from captures.edges.source import BitSpans

    from ..causes.registry import Cause
    from ..tables.batch import Batch
    from ..tables.schema import Rows
    from .bus import Bus

_BYTES: Final = 1 << 20


class ByteStore:
    """Bytes end to end, in blocks of 1 MiB."""

    def __init__(self) -> None:
        self._blocks: list[NDArray[np.uint8]] = []
        self.size = 0

    def append(self, data: NDArray[np.uint8]) -> int:
        """Add bytes; where they begin."""
        begin, written = self.size, 0
        while written < len(data):
            offset = (begin + written) % _BYTES
            if offset == 0:
                self._blocks.append(np.empty(_BYTES, np.uint8))
            size = min(_BYTES - offset, len(data) - written)
            self._blocks[-1][offset : offset + size] = data[written : written + size]
            written += size
        self.size = begin + len(data)
        return begin

    def get(self, at: int, length: int) -> NDArray[np.uint8]:
        """`length` bytes from `at`; a view where they lie in one block."""
        number, offset = divmod(at, _BYTES)
        if offset + length <= _BYTES:
            return self._blocks[number][offset : offset + length] if length else np.empty(0, np.uint8)
        parts = []
        while length > 0:
            size = min(_BYTES - offset, length)
            parts.append(self._blocks[number][offset : offset + size])
            length, number, offset = length - size, number + 1, 0
        return np.concatenate(parts)

    @property
    def nbytes(self) -> int:
        """Memory of the blocks."""
        return len(self._blocks) * _BYTES


_STEPS: Final = 8  # of a bit
_MOST: Final = np.iinfo(np.int16).max
_WEIGHTS: Final = ("length", "crc", "silence", "conversation", "margin")


class RowEvidence(NamedTuple):
    """Bits for this reading of the bytes (log2 of a likelihood ratio), `margin` over the best one without the row.

    The runner-up is what would stand here instead: noise where `rival_kind` says so, else `rival_length` bytes from
    `rival_start` on, an offset in the port's stream.
    """

    length: float
    crc: float
    silence: float
    conversation: float
    margin: float
    rival_kind: Kind
    rival_start: int
    rival_length: int


def evidence_columns(batch: Batch) -> dict[str, NDArray[Any]]:
    """A batch's evidence as columns of the table."""
    n, why = len(batch), batch.evidence
    if why is None:
        none: dict[str, NDArray[Any]] = {f"why_{name}": np.full(n, NO_EVIDENCE, np.int16) for name in _WEIGHTS}
        return {**none, "rival_start": np.zeros(n, np.int16), "rival_length": np.zeros(n, np.uint16),
                "rival_kind": np.zeros(n, np.uint8)}  # fmt: skip
    columns: dict[str, NDArray[Any]] = {}
    for name in _WEIGHTS:
        eighths = np.nan_to_num(why.column(name).astype(np.float64) * _STEPS, posinf=_MOST, neginf=-_MOST)
        columns[f"why_{name}"] = np.clip(np.round(eighths), -_MOST, _MOST).astype(np.int16)
    framed = (why.rival_start >= 0) & (why.rival_kind != Kind.NOISE)
    ahead = np.where(framed, why.rival_start - batch.rows.start, 0)
    near = framed & (np.abs(ahead) <= _MOST)
    columns["rival_start"] = np.where(near, ahead, 0).astype(np.int16)
    columns["rival_length"] = np.where(near, np.clip(why.rival_length, 0, (1 << 16) - 1), 0).astype(np.uint16)
    columns["rival_kind"] = np.where(near, why.rival_kind, Kind.NOISE).astype(np.uint8)
    return columns


def evidence_of(table: RowTable, row: int) -> RowEvidence | None:
    """A row's evidence; None where none was kept."""
    if table.value("why_margin", row) == NO_EVIDENCE:
        return None
    length, crc, silence, conversation, margin = (table.value(f"why_{name}", row) / _STEPS for name in _WEIGHTS)
    start = table.value("start", row) + table.value("rival_start", row)
    kind, size = Kind(table.value("rival_kind", row)), table.value("rival_length", row)
    return RowEvidence(length, crc, silence, conversation, margin, kind, start, size)


_NONE = np.zeros((2, 0), np.int64)


class RowBits:
    """Made before the pass over the bytes that it takes part in. One thread feeds, any may ask."""

    def __init__(self, spans: BitSpans) -> None:
        spans.want()
        self._spans = spans
        self._taken = [_NONE]
        self._lock = threading.Lock()
        self.of_all = self.rates()

    def feed(self, rows: Rows) -> None:
        """The rows that come next."""
        taken = bit_times(self._spans, rows)
        with self._lock:
            self._taken.append(taken)
        self.of_all.feed(rows, taken)

    def rates(self) -> RateTable:
        """An empty table, for some of the rows."""
        return RateTable(self._spans.bauds)

    def take_bit_times(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of these rows as `bit_times` has it."""
        with self._lock:
            if len(self._taken) > 1:
                self._taken = [np.concatenate(self._taken, axis=1)]
            return self._taken[0][:, rows]


_ROOM: Final = 64


class FindingLog:
    """All findings; `rows` says where each stands, -1 for the bus as a whole."""

    def __init__(self) -> None:
        self._findings = Findings.zeros(_ROOM)
        self._rows = np.zeros(_ROOM, np.int32)
        self.count = 0
        self.by_code: Counter[str] = Counter()
        self.by_severity: Counter[Severity] = Counter(dict.fromkeys(Severity, 0))  # all there: others go through it
        self._severity = np.array([rule.severity for rule in rules()], np.uint8)

    def add(self, findings: Findings, table: RowTable) -> NDArray[np.int64]:
        """Take in some more, and mark their rows; those on which a warning or an error stands for the first time."""
        n = len(findings)
        if not n:
            return np.zeros(0, np.int64)
        if self.count + n > len(self._findings):
            room = max(len(self._findings) * 5 // 4, self.count + n)
            self._findings = Findings.joined((self._findings, Findings.zeros(room - len(self._findings))))
            self._rows = np.concatenate((self._rows, np.zeros(room - len(self._rows), np.int32)))
        rows = table.rows_of_bytes(findings.port, findings.start)
        self._findings.put(slice(self.count, self.count + n), findings)
        self._rows[self.count : self.count + n] = rows
        grave = self._severity[findings.rule]
        order = np.argsort(grave, kind="stable")  # the gravest is written last
        order = order[rows[order] >= 0]
        marks = np.maximum(table.take_column("mark", rows[order]), grave[order])
        graver = np.unique(rows[order][marks >= Severity.WARNING]).astype(np.int64)
        graver = graver[table.take_column("mark", graver) < Severity.WARNING]
        table.put("mark", rows[order], marks)
        for level in Severity:
            self.by_severity[level] += int((grave == level).sum())
        names = codes()
        for rule, count in zip(*np.unique(findings.rule, return_counts=True), strict=True):
            self.by_code[names[rule]] += int(count)
        self.count += n
        return graver

    def row(self, i: int) -> int:
        """The row on which finding `i` stands, -1 for none."""
        return int(self._rows[i])

    def rows_of(self, numbers: NDArray[np.int64]) -> NDArray[np.int32]:
        """`row` for many."""
        return self._rows[numbers]

    def rules_of(self, numbers: NDArray[np.int64]) -> NDArray[np.int16]:
        """The rule of some findings."""
        rules: NDArray[np.int16] = self._findings.rule[numbers]
        return rules

    def levels_of(self, numbers: NDArray[np.int64]) -> Counter[Severity]:
        """How many of some findings are of each severity."""
        grave = self._severity[self._findings.rule[numbers]]
        return Counter({level: int((grave == level).sum()) for level in Severity})

    def finding(self, i: int) -> Finding:
        """Finding `i` in words."""
        return describe(self._findings, i)

    def of_row(self, row: int) -> tuple[Finding, ...]:
        """What stands on a row, the gravest first."""
        numbers = np.flatnonzero(self._rows[: self.count] == row)
        return tuple(sorted((self.finding(i) for i in numbers.tolist()), key=lambda f: -f.severity))

    def times(self, table: RowTable, unit: int) -> NDArray[np.int64]:
        """When the rows of a unit began that findings stand on, ascending, ns."""
        rows = np.unique(self._rows[: self.count]).astype(np.int64)
        rows = rows[rows >= 0]
        return np.sort(table.take_column("t_start_ns", rows[table.take_column("unit", rows) == unit]))

    def rules(self, first: int, last: int) -> tuple[NDArray[np.int64], NDArray[np.int16]]:
        """Rows from `first` to `last` (excluded) that findings stand on, ascending, and the rule of each."""
        rows = self._rows[: self.count]
        numbers = np.flatnonzero((rows >= first) & (rows < last))
        numbers = numbers[np.argsort(rows[numbers], kind="stable")]
        return rows[numbers].astype(np.int64), self._findings.rule[numbers]

    def on(self, wanted: NDArray[np.int64]) -> Findings:
        """Those on the wanted rows (ascending, at least one), in the order of their rows."""
        rows = self._rows[: self.count]
        numbers = np.flatnonzero((rows >= wanted[0]) & (rows <= wanted[-1]))
        numbers = numbers[np.isin(rows[numbers], wanted)]
        return self._findings[numbers[np.argsort(rows[numbers], kind="stable")]]

    def chosen(self, code: str | None, least: Severity) -> NDArray[np.int64]:
        """Numbers of the findings of a code (None: any) and of at least that severity, in the order of their rows."""
        findings = self._findings[: self.count]
        good = self._severity[findings.rule] >= least
        if code is not None:
            good &= findings.rule == codes().index(code)
        numbers = np.flatnonzero(good)
        return numbers[np.argsort(self._rows[numbers], kind="stable")]

    @property
    def nbytes(self) -> int:
        return int(self._findings.nbytes + self._rows.nbytes)


_UNIT = 0xFFFF  # of a key: unit + 1, 0 for the bus as a whole


class ExplainedFindings(NamedTuple):
    """What one cause explains, or (`cause` None) none does: numbers of findings by code, the most frequent first.

    `cause` is its number among those asked about; the findings of a code are in the order of their rows.
    """

    cause: int | None
    by_code: Mapping[str, NDArray[np.int64]]


def by_cause(bus: Bus, numbers: NDArray[np.int64], causes: Sequence[Cause]) -> list[ExplainedFindings]:
    """Some findings by cause: of each cause, best first, what it explains of them, then what none explains."""
    log, table, names = bus.found, bus.table, codes()
    rows = log.rows_of(numbers).astype(np.int64)
    units = np.where(rows >= 0, table.take_column("unit", np.maximum(rows, 0)).astype(np.int64), -1)
    keys = log.rules_of(numbers).astype(np.int64) << 16 | units + 1
    groups: dict[int | None, dict[str, list[NDArray[np.int64]]]] = {}
    for key in np.unique(keys).tolist():
        code, unit = names[key >> 16], (key & _UNIT) - 1
        cause = cause_of(code, None if unit < 0 else unit, causes)
        groups.setdefault(cause, {}).setdefault(code, []).append(numbers[keys == key])
    explained = []
    for which in [*range(len(causes)), None]:
        parts = {code: np.sort(np.concatenate(each)) for code, each in groups.get(which, {}).items()}
        if which is None and not parts:
            continue
        ordered = sorted(parts.items(), key=lambda each: -len(each[1]))
        by_code = {code: each[np.argsort(log.rows_of(each), kind="stable")] for code, each in ordered}
        explained.append(ExplainedFindings(which, by_code))
    return explained


def rows_of_causes(bus: Bus, causes: Sequence[Cause]) -> list[NDArray[np.int64]]:
    """The rows that the findings stand on which each cause explains, ascending."""
    if not causes:
        return []
    rows = [np.zeros(0, np.int64) for _ in causes]
    for explained in by_cause(bus, np.arange(bus.found.count), causes):
        if explained.cause is not None and explained.by_code:
            numbers = np.concatenate(list(explained.by_code.values()))
            on = np.unique(bus.found.rows_of(numbers).astype(np.int64))
            rows[explained.cause] = on[on >= 0]
    return rows


def rows_showing(bus: Bus, cause: Cause) -> NDArray[np.int64]:
    """The rows that show a cause, in the order of the wire: those of its findings, or else of the frames it names."""
    (rows,) = rows_of_causes(bus, [cause])
    if not len(rows):
        rows = np.unique([bus.table.row_of_frame(index) for index in cause.frames]).astype(np.int64)
    return rows[rows >= 0]
