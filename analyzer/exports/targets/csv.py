"""CSV for spreadsheets: a row a frame, the same columns in every file.

Bytes are written in pairs with spaces between, so that no spreadsheet takes them for a number; text that a device sent
and that a spreadsheet would run as a formula gets an apostrophe before it.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from dissectors.functions import function_name
from dissectors.values import FORMULA_STARTS

from ...tables.batch import Batch, Frame
from ...tables.columns import Pdus
from ...tables.schema import Direction, Kind, Protocol, Row, Rows
from ..chosen import FRAME_COLUMNS, ChosenCells
from ..encoding import explain_json
from ..encoding.forms import BatchBytes, Forms, Whole, kept
from ..encoding.sheet import Cursor, Ints, Pieces, Sheet, Store, without
from ..encoding.spoken import ClockPieces, Speech, SpokenWords, separated
from ..encoding.summaries import summary_pieces
from ..sink import ExportOptions, OutputStream, Sink

if TYPE_CHECKING:
    from captures import Capture

    from ...core import Analysed
    from ...tables.findings import Finding

TAKES: Final = frozenset({"noise", "explain", "fields", "delimiter", "bom"})
EXPLAINED: Final = (
    "bits_length",
    "bits_crc",
    "bits_silence",
    "bits_conversation",
    "margin",
    "runner_up",
    "runner_up_start",
    "runner_up_length",
)
_HEAD: Final = 5 + 9  # pieces before the summary, times left out
_TIMES: Final = 7  # theirs
_TAIL: Final = 5 + 5  # pieces behind the summary, values left out
_TAIL_TIMED: Final = _TAIL + ClockPieces.PIECES
_NO_CHECK: Final = 2  # in a key: beside 0 and 1, whether the check value is right
_EXACT: Final = 1 << 53  # nanoseconds that a float still counts
_SPECIAL: Final = frozenset(',"\r\n')


class _CsvTable(Sink):
    def __init__(self, out: OutputStream, options: ExportOptions, timed: bool) -> None:
        plain = (options.delimiter, options.fields) == (",", ())
        self._out = out if plain else ChosenCells(out, options.delimiter, options.fields)
        self._options = options
        self._timed = timed
        self._zero: int | None = None
        self._pdus: Pdus | None = None
        self._store = Store()
        self._cell = self._store.table(lambda number: b",%d," % number)
        self._number = self._store.table(lambda number: b",%d" % (number - 1) if number else b",")
        self._value = self._store.table_of_many(lambda numbers: [b" %d" % number for number in numbers])
        self._clock = ClockPieces(self._store, b"", b"", b"")
        self._unit = self._store.table(_unit)
        self._function = self._store.table(_function)
        self._confidence = self._store.table(lambda key: b",%.6f," % float(np.uint32(key).view(np.float32)))
        self._forms = Forms(partial(summary_pieces, self._store, _begun, _csv_text))
        self._summary = Whole(lambda frame: _begun(frame.summary()))
        self._speech = Speech()
        columns = FRAME_COLUMNS + (EXPLAINED if options.explain else ())
        out.write(b"\xef\xbb\xbf" if options.bom else b"")
        self._out.write(",".join(columns).encode() + b"\n")

    def begins(self, t_ns: int) -> None:
        """From when the seconds count; what is told first holds."""
        self._zero = t_ns if self._zero is None else self._zero

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """A line a row."""
        self._store.settle()
        if self._pdus is None or self._pdus.batch is not batch:
            self._pdus = Pdus(batch)
        self.begins(int(batch.rows.t_start_ns[first]))
        row_numbers, rows = kept(batch, first, last, noise=self._options.noise)
        silent = rows.kind == Kind.NOISE
        frames = np.flatnonzero(~silent)
        spoken = rows if len(frames) == len(rows) else rows[frames]
        source = BatchBytes.of(self._pdus, spoken)
        groups = self._forms.groups(rows, row_numbers, source)
        head = _HEAD + (_TIMES if self._timed else 1)
        contents = self._speech.of(self._pdus, row_numbers[frames])
        tail = (_TAIL_TIMED if self._timed else _TAIL) + contents.counts
        sizes = np.ones(len(rows), np.int64)
        sizes[frames] = head + 1 + tail
        for group in groups:
            sizes[group.lines] += group.sizes() - 1
        sheet = Sheet(self._store, sizes)
        sheet.at(np.flatnonzero(silent)).put_texts(self._noise(batch, row_numbers[silent]))
        self._put_head(spoken, row_numbers[frames], source, sheet.at(frames))
        unformed = ~silent
        for group in groups:
            group.put(source, sheet.at(group.lines, head))
            unformed[group.lines] = False
        annotated = [self._summary.text(batch.frame(row)) for row in row_numbers[unformed].tolist()]
        sheet.at(np.flatnonzero(unformed), head).put_texts(annotated)
        self._put_tail(spoken, contents, batch, row_numbers[frames], sheet.before_end(frames, tail))
        for part in sheet.parts():
            self._out.write(part)

    def batch(self, analysed: Analysed) -> None:
        """Nothing here hangs on a whole batch."""

    def close(self) -> None:
        """Nothing is left: rows are written as they come."""

    def _put_head(self, rows: Rows, row_numbers: Ints, source: BatchBytes, cursor: Cursor) -> None:
        """Everything before the summary."""
        cursor.put(b"frame,")
        cursor.put_numbers(rows.index)
        cursor.put(self._cell.take_pieces(rows.port.astype(np.int64)))
        cursor.put_numbers(rows.start)
        cursor.put(self._cell.take_pieces(rows.length))
        self._put_times(rows, cursor)
        kind, protocol, unit = (rows.column(name).astype(np.int64) for name in ("kind", "protocol", "unit"))
        cursor.put(self._unit.take_pieces(kind << 10 | protocol << 8 | unit))
        function, exception, check = (rows.column(name).astype(np.int64) for name in ("function", "exception", "check"))
        check[protocol == Protocol.TCP] = _NO_CHECK
        cursor.put(self._function.take_pieces(function << 10 | exception << 2 | check))
        cursor.put(b",")
        cursor.put_known(rows.request_start, b"")
        cursor.put(b",")
        cursor.put_known(source.pdus.batch.response_times.exact[row_numbers], b"")
        cursor.put(self._confidence.take_pieces(rows.confidence.view(np.uint32).astype(np.int64)))
        plain = protocol != Protocol.ASCII
        texts = np.empty(len(rows), np.int64)
        texts[plain] = source.spaced(rows.at[plain], rows.length[plain], cursor.sheet)
        ascii_frames = (source.pdus.batch.frame(int(row)) for row in row_numbers[~plain])
        texts[~plain] = cursor.sheet.texts([frame.adu.data.hex(" ").upper().encode() for frame in ascii_frames])
        cursor.put(texts)
        cursor.put(b',"')

    def _put_times(self, rows: Rows, cursor: Cursor) -> None:
        """Seconds, start and end, or three empty cells."""
        if not self._timed:
            cursor.put(b",,")
            return
        seconds, rest = _seconds(rows.t_start_ns - (self._zero or 0), cursor.sheet)
        cursor.put(seconds)
        cursor.put(b".")
        cursor.put(rest)
        cursor.put(b",")
        cursor.put_numbers(rows.t_start_ns)
        cursor.put(b",")
        cursor.put_numbers(rows.t_end_ns)

    def _put_tail(self, rows: Rows, contents: SpokenWords, batch: Batch, row_numbers: Ints, cursor: Cursor) -> None:
        """What is behind the summary, and the line's end."""
        findings = np.full(len(row_numbers), self._store.fixed(b'",,'), np.int64)
        odd = np.flatnonzero(batch.finding_counts[row_numbers])
        if len(odd):
            texts = [b'",' + _findings_cell(batch.findings_of(row)) + b"," for row in row_numbers[odd].tolist()]
            findings[odd] = cursor.sheet.texts(texts)
        cursor.put(findings)
        if self._timed:
            self._clock.put(rows.t_start_ns, cursor)
        cursor.put(self._number.take_pieces(contents.address + 1))
        cursor.put(self._number.take_pieces(contents.quantity + 1))
        cursor.put(b",")
        cursor.spread(contents.counts, separated(contents, self._value))
        for column in (batch.response_times.low, batch.response_times.high):
            cursor.put(b",")
            cursor.put_known(column[row_numbers], b"")
        owners = np.full(len(row_numbers), self._store.fixed(b",,false"), np.int64)
        odd = np.flatnonzero((rows.taken_for_start >= 0) | rows.unsure)
        if len(odd):
            owners[odd] = cursor.sheet.texts([_owner(rows.row(row)) for row in odd.tolist()])
        cursor.put(owners)
        if self._options.explain:
            cursor.put_texts([_explained(batch.frame(row)) + b"\n" for row in row_numbers.tolist()])
        else:
            cursor.put(b"\n")

    def _noise(self, batch: Batch, row_numbers: Ints) -> list[bytes]:
        blank = b"," * (FRAME_COLUMNS.index("hex") - FRAME_COLUMNS.index("t_end_ns"))
        behind = (
            len(FRAME_COLUMNS) - 1 - FRAME_COLUMNS.index("findings") + (len(EXPLAINED) if self._options.explain else 0)
        )
        end = b"," * behind + b"\n"
        rows = batch.rows[row_numbers]
        columns: list[list[Any]] = [rows.column(name).tolist() for name in ("port", "start", "length")]
        form = b"noise,,%d,%d,%d,,,"
        if self._timed:
            form = b"noise,,%d,%d,%d,%.6f,%d,%d"
            columns += [((rows.t_start_ns - (self._zero or 0)) / 1e9).tolist()]
            columns += [rows.column(name).tolist() for name in ("t_start_ns", "t_end_ns")]
        begins = [form % row for row in zip(*columns, strict=True)]
        hexes = [batch.bytes_of(row).hex(" ").upper().encode() for row in row_numbers.tolist()]
        findings = [b",," + _findings_cell(batch.findings_of(row)) for row in row_numbers.tolist()]
        return [b"".join((begin, blank, *texts, end)) for begin, *texts in zip(begins, hexes, findings, strict=True)]


def _seconds(ns: Ints, sheet: Sheet) -> tuple[Pieces, Pieces]:
    """What `%.6f` says of some nanoseconds as seconds: before the point, and behind it."""
    plain = (ns >= 0) & (ns < _EXACT) & (ns % 1000 != 500)  # the others round as their float does
    micros = (ns + 500) // 1000
    full_seconds = micros // 1_000_000
    rest = micros - 1_000_000 * full_seconds
    before, behind = sheet.numbers(full_seconds), without(sheet.numbers(1_000_000 + rest), 1)
    if not plain.all():
        texts = [b"%.6f" % seconds for seconds in (ns[~plain] / 1e9).tolist()]
        before[~plain] = sheet.texts([text[:-7] for text in texts])
        behind[~plain] = sheet.texts([text[-6:] for text in texts])
    return before, behind


def _unit(key: int) -> bytes:
    protocol, direction = Protocol(key >> 8 & 3).name.lower(), Direction(key >> 10).name
    return f",{protocol},{direction},{key & 0xFF}".encode()


def _function(key: int) -> bytes:
    function, exception = key >> 10, key >> 2 & 0xFF
    check = "" if key & _NO_CHECK else str(bool(key & 1)).lower()
    name = safe(function_name(function))
    if not _SPECIAL.isdisjoint(name):
        name = f'"{_csv_text(name).decode()}"'
    return f",{function},{name},{exception or ''},{check}".encode()


def _owner(row: Row) -> bytes:
    """Two cells: whose answer the client takes it for, and whether nobody can tell whose it is."""
    taken = "" if row.taken_for_start < 0 else str(row.taken_for_start)
    return f",{taken},{str(row.unsure).lower()}".encode()


def _explained(frame: Frame) -> bytes:
    """The reasons, in cells."""
    why = explain_json(frame)
    if why is None:
        return b"," * len(EXPLAINED)
    rival = why["runner_up"]
    cells = [why[key] for key in ("length", "crc", "silence", "conversation", "margin")]
    cells += [rival[key] for key in ("kind", "start", "length")]
    return b"".join(b"," + ("" if cell is None else str(cell)).encode() for cell in cells)


def _findings_cell(findings: Sequence[Finding]) -> bytes:
    """Findings in one cell."""
    if not findings:
        return b""
    return b'"' + _begun("; ".join(f"{finding.code}: {finding.text}" for finding in findings)) + b'"'


def _begun(text: str) -> bytes:
    """The beginning of a text between quotes."""
    return _csv_text(safe(text))


def _csv_text(text: str) -> bytes:
    """Text as it stands between quotes."""
    return text.replace('"', '""').encode()


def safe(text: str) -> str:
    """Text that no spreadsheet runs as a formula."""
    return f"'{text}" if text.startswith(FORMULA_STARTS) else text


def open_sink(out: OutputStream, capture: Capture, options: ExportOptions) -> _CsvTable:
    """Rows onto `out`."""
    return _CsvTable(out, options, capture.timed)
