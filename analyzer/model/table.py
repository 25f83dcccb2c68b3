"""Rows kept as compact columns, in pieces of 65,536.

One thread appends, any thread reads rows that it was told of; what is written later to a row (its answer, its state,
its mark) is a single number each. Columns take 45 bytes a row, and up to 69 where nearly every one differs from what
it nearly always is: see `narrow`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.batch import BytePlaces, rows_of_bytes
from ..tables.schema import Bools, Columns, Float32s, Int16s, Int32s, Int64s, UInt8s, UInt16s, UInt32s
from .narrow import AlikeNumbers, BesideNumbers, Column, EndTimes, Kept, NarrowNumbers, NearNumbers, ShortTimes

PIECE: Final = 1 << 16  # rows


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BusRows(Columns):
    """Rows of the model: what is kept of each, and what became of it."""

    frame: UInt32s  # how many frames come before this row; the frame's index where the row is one
    at: Int64s  # where its bytes begin in the byte store
    start: Int64s  # offset in its port's stream
    length: UInt32s
    t_start_ns: Int64s  # written before the end, which is kept as what comes after it
    t_end_ns: Int64s
    partner: Int32s  # row of the request that it answers, or of the answer to it; -1 for none
    response_ns: Int64s
    gap_before_ns: Int64s
    gap_most_ns: Int64s
    errors: UInt16s
    confidence: Float32s
    kind: UInt8s
    unit: UInt8s
    function: UInt8s
    exception: UInt8s
    check: Bools
    port: UInt8s
    protocol: UInt8s
    taken_for_start: Int64s  # as in `Rows`
    unsure: Bools
    state: UInt8s  # what became of a request: see `RowState`
    mark: UInt8s  # the gravest finding's severity, 0 for none
    why_length: Int16s  # evidence of the row's boundaries in eighths of a bit: `tables.schema.BoundaryEvidence`
    why_crc: Int16s
    why_silence: Int16s
    why_conversation: Int16s
    why_margin: Int16s  # NO_EVIDENCE where none was kept
    rival_start: Int16s  # from the row's start on
    rival_length: UInt16s
    rival_kind: UInt8s


NO_EVIDENCE: Final = np.iinfo(np.int16).min
_SHORT: Final = frozenset({"response_ns", "gap_before_ns"})  # times that nearly always are
_ALIKE: Final = frozenset(
    {
        "port",
        "protocol",
        "taken_for_start",
        "unsure",
        "errors",
        "confidence",
        "exception",
        "check",
        "gap_most_ns",
        "why_crc",
        "rival_start",
        "rival_length",
        "rival_kind",
    }
)  # that nearly always are the same in all of a piece


class RowState:
    """The column `state`: 0 while open, else transactions.Status + 1, with flags."""

    STATUS: Final = 0x0F
    RETRY: Final = 0x10
    LATE: Final = 0x20


class RowTable:
    """The columns."""

    def __init__(self) -> None:
        self._pieces: list[dict[str, Kept]] = []
        self.count = 0

    def append(self, rows: BusRows) -> None:
        """Add rows."""
        n, names = len(rows), tuple(BusRows.dtypes())
        written = 0
        while written < n:
            slot = (self.count + written) % PIECE
            if slot == 0:
                self._pieces.append(_empty_piece())
            size = min(PIECE - slot, n - written)
            for name, values in zip(names, rows.columns(), strict=True):
                self._pieces[-1][name][slot : slot + size] = values[written : written + size]
            written += size
        self.count += n

    def column(self, number: int, name: str) -> Column:
        """One column of a piece, as far as its rows are there."""
        return self.stretch(number, name, slice(min(PIECE, self.count - number * PIECE)))

    def stretch(self, number: int, name: str, slots: slice | NDArray[np.int64]) -> Column:
        """Some places of a column of a piece, where rows are."""
        return self._pieces[number][name][slots]

    def pieces(self) -> range:
        """Numbers of the pieces that hold rows."""
        return range(-(-self.count // PIECE))

    def value(self, name: str, row: int) -> int:
        """One number of one row."""
        return int(self._pieces[row // PIECE][name][row % PIECE])

    def row(self, row: int) -> dict[str, int]:
        """All numbers of one row but its confidence."""
        columns, slot = self._pieces[row // PIECE], row % PIECE
        return {name: columns[name][slot].item() for name in BusRows.dtypes()}

    def take_column(self, name: str, rows: NDArray[np.int64]) -> Column:
        """One column of some rows, in the order given."""
        if not len(rows):
            return np.empty(0, BusRows.dtypes()[name])
        first, last = int(rows.min()) // PIECE, int(rows.max()) // PIECE
        if first == last:
            return self._pieces[first][name][rows - first * PIECE]
        out = np.empty(len(rows), BusRows.dtypes()[name])
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


def _empty_piece() -> dict[str, Kept]:
    begins = np.empty(PIECE, np.int64)
    at = NearNumbers(PIECE)
    own: dict[str, Kept] = {
        "frame": NarrowNumbers(PIECE), "length": NarrowNumbers(PIECE, 0), "at": at, "start": BesideNumbers(PIECE, at),
        "t_start_ns": begins, "t_end_ns": EndTimes(begins),
    }  # fmt: skip
    return {name: own[name] if name in own else _kept(name, dtype) for name, dtype in BusRows.dtypes().items()}


def _kept(name: str, dtype: np.dtype[Any]) -> Kept:
    """An empty column that is told of no other one."""
    if name in _ALIKE:
        return AlikeNumbers(PIECE, dtype, partial(ShortTimes, PIECE) if dtype == np.int64 else None)
    return ShortTimes(PIECE) if name in _SHORT else np.empty(PIECE, dtype)
