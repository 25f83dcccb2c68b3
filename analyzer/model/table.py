"""Rows kept as compact columns, in pieces of 65,536, and their bytes.

One thread appends, any thread reads rows that it was told of; what is written later to a row (its answer, its state,
its mark) is a single number each. Columns take 75 bytes a row; the bytes themselves are kept once, in row order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.batch import BytePlaces, rows_of_bytes
from ..tables.findings import Finding, Findings, Severity, codes, describe, rules
from ..tables.schema import NO_GAP

PIECE: Final = 1 << 16  # rows
_BYTES: Final = 1 << 20

Column = NDArray[Any]

COLUMNS: Final[dict[str, type[np.generic]]] = {
    "frame": np.uint32,  # how many frames come before this row; the frame's index where the row is one
    "start": np.int64,  # offset in its port's stream
    "at": np.int64,  # where its bytes begin in the byte store
    "length": np.uint32,
    "t_start_ns": np.int64,
    "t_end_ns": np.int64,
    "partner": np.int32,  # row of the request that it answers, or of the answer to it; -1 for none
    "response_ns": np.int64,
    "gap_before_ns": np.int64,
    "gap_most_ns": np.int64,
    "errors": np.uint16,
    "confidence": np.float32,
    "kind": np.uint8,
    "unit": np.uint8,
    "function": np.uint8,
    "exception": np.uint8,
    "check": np.bool_,
    "port": np.uint8,
    "protocol": np.uint8,
    "state": np.uint8,  # what became of a request: see `State`
    "mark": np.uint8,  # the gravest finding's severity, 0 for none
    "why_length": np.int16,  # evidence of the row's boundaries in eighths of a bit: `tables.schema.BoundaryEvidence`
    "why_crc": np.int16,
    "why_silence": np.int16,
    "why_conversation": np.int16,
    "why_margin": np.int16,  # NO_EVIDENCE where none was kept
    "rival_start": np.int16,  # from the row's start on
    "rival_length": np.uint16,
    "rival_kind": np.uint8,
}
NO_EVIDENCE: Final = np.iinfo(np.int16).min
_SHORT: Final = frozenset({"response_ns", "gap_before_ns", "gap_most_ns"})  # times that nearly always are
_NEAR: Final = frozenset({"start", "at"})  # numbers that are near each other in a piece


class RowState:
    """The column `state`: 0 while open, else transactions.Status + 1, with flags."""

    STATUS: Final = 0x0F
    RETRY: Final = 0x10
    LATE: Final = 0x20


class RowTable:
    """The columns."""

    def __init__(self) -> None:
        self._pieces: list[dict[str, Column | ShortTimes]] = []
        self.count = 0

    def append(self, columns: Mapping[str, Column]) -> None:
        """Add rows; `columns` names every one of `COLUMNS`."""
        n = len(columns["frame"])
        written = 0
        while written < n:
            slot = (self.count + written) % PIECE
            if slot == 0:
                self._pieces.append(_empty_piece())
            size = min(PIECE - slot, n - written)
            for name, values in columns.items():
                self._pieces[-1][name][slot : slot + size] = values[written : written + size]
            written += size
        self.count += n

    def piece(self, number: int) -> Mapping[str, Column | ShortTimes]:
        """Columns of rows `number * PIECE` and on, as far as they are there."""
        size = min(PIECE, self.count - number * PIECE)
        columns = self._pieces[number]
        return columns if size == PIECE else {name: column[:size] for name, column in columns.items()}

    def column(self, number: int, name: str) -> Column:
        """One column of a piece."""
        size = min(PIECE, self.count - number * PIECE)
        return self._pieces[number][name][:size]

    def pieces(self) -> range:
        """Numbers of the pieces that hold rows."""
        return range(-(-self.count // PIECE))

    def value(self, name: str, row: int) -> int:
        """One number of one row."""
        return int(self._pieces[row // PIECE][name][row % PIECE])

    def row(self, row: int) -> dict[str, int]:
        """All numbers of one row but its confidence."""
        columns, slot = self._pieces[row // PIECE], row % PIECE
        return {name: columns[name][slot].item() for name in COLUMNS}

    def take(self, name: str, rows: NDArray[np.int64]) -> Column:
        """One column of some rows, in the order given."""
        if not len(rows):
            return np.empty(0, COLUMNS[name])
        first, last = int(rows.min()) // PIECE, int(rows.max()) // PIECE
        if first == last:
            return self._pieces[first][name][rows - first * PIECE]
        out = np.empty(len(rows), COLUMNS[name])
        which = rows // PIECE
        for number in np.unique(which).tolist():
            inside = which == number
            out[inside] = self._pieces[number][name][rows[inside] - number * PIECE]
        return out

    def put(self, name: str, rows: NDArray[np.int64], values: Column | int) -> None:
        """Write one column of rows that are there; where a row comes twice its last value stays."""
        which = rows // PIECE
        for number in np.unique(which).tolist():
            inside = which == number
            chosen = values[inside] if isinstance(values, np.ndarray) else values
            self._pieces[number][name][rows[inside] - number * PIECE] = chosen

    def slices(self, first: int, last: int) -> Iterator[tuple[int, int, int]]:
        """Rows `first` to `last` (excluded) piece by piece: number, first and last place in it."""
        while first < last:
            number, slot = divmod(first, PIECE)
            stop = min(PIECE, slot + last - first)
            yield number, slot, stop
            first += stop - slot

    def row_of_frame(self, index: int) -> int:
        """The row of the frame with this index; -1 where it is not there."""
        low, high = 0, len(self._pieces)  # the first piece that begins behind it
        while low < high:
            middle = (low + high) // 2
            if middle * PIECE < self.count and int(self._pieces[middle]["frame"][0]) <= index:
                low = middle + 1
            else:
                high = middle
        for number in (low - 1, low - 2):  # a piece may end in the noise before the frame, or begin in the noise after
            if number < 0:
                break
            frames = self.column(number, "frame")
            slot = int(np.searchsorted(frames, index, side="right")) - 1
            if slot >= 0 and int(frames[slot]) == index and self.column(number, "kind")[slot]:
                return number * PIECE + slot
        return -1

    def rows_of_frames(self, indices: NDArray[np.int64]) -> NDArray[np.int64]:
        """`row_of_frame` for many; -1 for those not there."""
        rows = np.full(len(indices), -1, np.int64)
        if not len(indices) or not self.count:
            return rows
        firsts = np.array([self._pieces[number]["frame"][0] for number in self.pieces()], np.int64)
        which = np.searchsorted(firsts, indices, side="right") - 1
        for number in np.unique(which[which >= 0]).tolist():
            inside = which == number
            frames, kinds = self.column(number, "frame"), self.column(number, "kind")
            slots = np.searchsorted(frames, indices[inside].astype(np.uint32), side="right") - 1
            good = (slots >= 0) & (frames[slots] == indices[inside]) & (kinds[slots] > 0)
            rows[inside] = np.where(good, number * PIECE + slots, -1)
        for i in np.flatnonzero((rows < 0) & (indices >= 0)).tolist():
            rows[i] = self.row_of_frame(int(indices[i]))
        return rows

    def row_of_byte(self, port: int, start: int) -> int:
        """The row that holds a byte of a port's stream; -1 for none. Quick for late rows."""
        return int(self.rows_of_bytes(np.array([port], np.uint8), np.array([start], np.int64))[0])

    def rows_of_bytes(self, ports: NDArray[np.uint8], starts: NDArray[np.int64]) -> NDArray[np.int64]:
        """`row_of_byte` for many."""
        rows = np.full(len(ports), -1, np.int64)
        open_ones = np.flatnonzero(starts >= 0)
        for number in reversed(self.pieces()):
            if not len(open_ones):
                break
            places = BytePlaces(*(self.column(number, name) for name in BytePlaces._fields))
            slots = rows_of_bytes(places, ports[open_ones], starts[open_ones])
            rows[open_ones[slots >= 0]] = number * PIECE + slots[slots >= 0]
            open_ones = open_ones[slots < 0]
        return rows

    def row_at_time(self, t_ns: int) -> int:
        """The last row that begins at or before a time; 0 where none does. Rows are nearly in time order."""
        low, high = 0, len(self.pieces())
        while low < high:
            middle = (low + high) // 2
            if int(self._pieces[middle]["t_start_ns"][0]) <= t_ns:
                low = middle + 1
            else:
                high = middle
        number = max(low - 1, 0)
        if not self.count:
            return 0
        slot = int(np.searchsorted(self.column(number, "t_start_ns"), t_ns, side="right")) - 1
        return number * PIECE + max(slot, 0)

    @property
    def nbytes(self) -> int:
        """Memory of the columns."""
        return sum(column.nbytes for columns in self._pieces for column in columns.values())


def _empty_piece() -> dict[str, Column | ShortTimes]:
    columns: dict[str, Column | ShortTimes] = {}
    for name, kind in COLUMNS.items():
        if name in _SHORT:
            columns[name] = ShortTimes(PIECE)
        elif name in _NEAR:
            columns[name] = NearNumbers(PIECE)
        else:
            columns[name] = EndTimes(columns["t_start_ns"]) if name == "t_end_ns" else np.empty(PIECE, kind)
    return columns


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


# A piece's column of times that are nearly always under two seconds: four bytes each, eight once one is longer.
#
# It is indexed like an array of int64, and gives such. One thread writes; others read rows that it was told of.


_LONGEST: Final = np.iinfo(np.int32).max
_UNKNOWN: Final = np.iinfo(np.int32).min  # stands for NO_GAP


class ShortTimes:
    """So many times, ns; NO_GAP where one is not known."""

    def __init__(self, count: int) -> None:
        self._values: NDArray[Any] = np.empty(count, np.int32)

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        values: NDArray[Any] = self._values[slots]
        if values.dtype == np.int64:
            return values
        return np.where(values == _UNKNOWN, NO_GAP, values.astype(np.int64))

    def __setitem__(self, slots: Any, times: NDArray[np.int64] | int) -> None:
        exact = np.asarray(times, np.int64)
        if self._values.dtype == np.int32:
            unknown = exact == NO_GAP
            if not (np.abs(exact[~unknown]) > _LONGEST).any():
                self._values[slots] = np.where(unknown, _UNKNOWN, exact)
                return
            self._values = ShortTimes.__getitem__(self, slice(None))
        self._values[slots] = exact

    @property
    def nbytes(self) -> int:
        """Memory of the column."""
        return self._values.nbytes


class NearNumbers(ShortTimes):
    """Numbers that nearly always are within two thousand million of the first: four bytes each."""

    def __init__(self, count: int) -> None:
        super().__init__(count)
        self._base: int | None = None

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        return super().__getitem__(slots) + (self._base or 0)

    def __setitem__(self, slots: Any, times: NDArray[np.int64] | int) -> None:
        exact = np.asarray(times, np.int64)
        if self._base is None and exact.size:
            self._base = int(exact.flat[0])
        super().__setitem__(slots, exact - (self._base or 0))


class EndTimes(ShortTimes):
    """Times shortly after those of another column, which are written first."""

    def __init__(self, begins: Column | ShortTimes) -> None:
        super().__init__(PIECE)
        self._begins = begins

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        ends: NDArray[Any] = super().__getitem__(slots) + self._begins[slots]
        return ends

    def __setitem__(self, slots: Any, times: NDArray[np.int64] | int) -> None:
        super().__setitem__(slots, np.asarray(times, np.int64) - self._begins[slots])


# Findings in the order in which they were made, each with the row that it stands on.


_ROOM = 64


class FindingLog:
    """All findings; `rows` says where each stands, -1 for the bus as a whole."""

    def __init__(self) -> None:
        self._findings = Findings.zeros(_ROOM)
        self._rows = np.zeros(_ROOM, np.int32)
        self.count = 0
        self.by_code: Counter[str] = Counter()
        self.by_severity: Counter[Severity] = Counter(dict.fromkeys(Severity, 0))  # all there: others go through it
        self._severity = np.array([rule.severity for rule in rules()], np.uint8)

    def add(self, findings: Findings, table: RowTable) -> None:
        """Take in some more, and mark their rows."""
        n = len(findings)
        if not n:
            return
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
        marks = np.maximum(table.take("mark", rows[order]), grave[order])
        table.put("mark", rows[order], marks)
        for level in Severity:
            self.by_severity[level] += int((grave == level).sum())
        names = codes()
        for rule, count in zip(*np.unique(findings.rule, return_counts=True), strict=True):
            self.by_code[names[rule]] += int(count)
        self.count += n

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

    def finding(self, i: int) -> Finding:
        """Finding `i` in words."""
        return describe(self._findings, i)

    def of_row(self, row: int) -> tuple[Finding, ...]:
        """What stands on a row, the gravest first."""
        numbers = np.flatnonzero(self._rows[: self.count] == row)
        return tuple(sorted((self.finding(i) for i in numbers.tolist()), key=lambda f: -f.severity))

    def rows_beyond(self, row: int, step: int) -> NDArray[np.int32]:
        """Rows with findings behind `row`, or before it where `step` is negative, the nearest first."""
        rows = self._rows[: self.count]
        if step > 0:
            return np.unique(rows[rows > row])
        return np.unique(rows[(rows < row) & (rows >= 0)])[::-1]

    def times(self, table: RowTable, unit: int) -> NDArray[np.int64]:
        """When the rows of a unit began that findings stand on, ascending, ns."""
        rows = np.unique(self._rows[: self.count]).astype(np.int64)
        rows = rows[rows >= 0]
        return np.sort(table.take("t_start_ns", rows[table.take("unit", rows) == unit]))

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
