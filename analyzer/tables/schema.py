"""Tables of typed columns, and those of rows: what a row of the bus is, and what its times are worth.

A column is one array, its values side by side. A table is a frozen dataclass that names its columns with their types,
once:

    @dataclass(frozen=True, slots=True, eq=False, repr=False)
    class Marks(Columns):
        start: Int64s  # offset of its first byte in its port's stream
        unit: UInt8s

Which arrays a table has is settled; what stands in them may be written (`marks.unit[:] = 7`).

Rows of all batches tile each port's byte stream: every byte once, in order.
"""

from __future__ import annotations

from collections import namedtuple
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields
from enum import IntEnum
from operator import attrgetter
from typing import Annotated, Any, ClassVar, Final, NamedTuple, Self, TypeAlias, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

Int64s: TypeAlias = NDArray[np.int64]
Int32s: TypeAlias = NDArray[np.int32]
Int16s: TypeAlias = NDArray[np.int16]
UInt32s: TypeAlias = NDArray[np.uint32]
UInt16s: TypeAlias = NDArray[np.uint16]
UInt8s: TypeAlias = NDArray[np.uint8]
Float64s: TypeAlias = NDArray[np.float64]
Float32s: TypeAlias = NDArray[np.float32]
Bools: TypeAlias = NDArray[np.bool_]
Which: TypeAlias = slice | NDArray[np.integer[Any]] | NDArray[np.bool_]  # rows: a stretch, numbers, or a mask

GLITCHES: Final = frozenset((0x00, 0xFE, 0xFF))  # what RS-485 drivers leave on the line when they switch
_SHOWN: Final = 20  # rows in a notebook
_BLOCK: Final = 1 << 12  # rows made at once where one iterates


class Columns:
    """A table. `Annotated[Float64s, 8]` is a column of eight figures a row."""

    __slots__ = ()
    _first: ClassVar[Any]  # gives the first column of a table
    _every: ClassVar[Any]  # and all of them

    def __init_subclass__(cls) -> None:
        names = tuple(cls.__annotations__)
        cls._first = attrgetter(names[0])
        cls._every = attrgetter(*names)

    @classmethod
    def dtypes(cls) -> dict[str, np.dtype[Any]]:
        """The type of each column by its name, in order."""
        return _dtypes(cls)

    @classmethod
    def zeros(cls, size: int) -> Self:
        """So many rows of nothing; of no rows, always the same table."""
        if size:
            return cls(*[np.zeros(size, dtype) for dtype in _dtypes(cls).values()])
        none = _NONE.get(cls)
        if none is None:
            none = _NONE[cls] = cls(*[np.zeros(0, dtype) for dtype in _dtypes(cls).values()])
        return none

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Tables end to end. Of a single part, or of one that alone has rows, the arrays are that part's own."""
        filled = [part for part in parts if len(part)]
        if len(filled) < 2:
            return filled[0] if filled else cls.zeros(0)
        return cls(*[np.concatenate(columns) for columns in zip(*(part.columns() for part in filled), strict=True)])

    def columns(self) -> tuple[NDArray[Any], ...]:
        """The arrays, in the order of their names."""
        arrays: tuple[NDArray[Any], ...] = self._every(self)
        return arrays

    def column(self, name: str) -> NDArray[Any]:
        """A column by its name, for what takes names: filters, exports."""
        found: NDArray[Any] = getattr(self, name)
        return found

    def __len__(self) -> int:
        return len(self._first(self))

    def __getitem__(self, which: Which) -> Self:
        """Some rows: views of a stretch, copies of rows by number or mask."""
        if isinstance(which, slice):
            return type(self)(*[column[which] for column in self.columns()])
        if not isinstance(which, np.ndarray):
            raise TypeError("rows are taken by a slice or an array; one row is `values(number)`, `for` gives all")
        if which.dtype == np.bool_:
            which = which.nonzero()[0]
        return type(self)(*[column.take(which, 0) for column in self.columns()])

    def __iter__(self) -> Iterator[Any]:
        """Row by row, as named tuples of Python's own values: for what looks at a few."""
        table = type(self)
        if table not in _ROW_TYPES:
            _ROW_TYPES[table] = namedtuple(table.__name__, _dtypes(table))
        row_of = _ROW_TYPES[table]
        for at in range(0, len(self), _BLOCK):
            for row in self[at : at + _BLOCK].tolist():
                yield row_of(*row)

    def copy(self) -> Self:
        """The same rows in arrays of their own."""
        return type(self)(*[column.copy() for column in self.columns()])

    def put(self, which: Which, rows: Columns) -> None:
        """Write whole rows."""
        for column, values in zip(self.columns(), rows.columns(), strict=True):
            column[which] = values

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {len(self):,} rows of {', '.join(self.dtypes())}>"

    def _repr_html_(self) -> str:
        """What a notebook shows: the first rows."""
        from ..html_text import html_table

        more = f"<p>the first {_SHOWN} of {len(self):,}</p>" if len(self) > _SHOWN else ""
        return html_table(tuple(self.dtypes()), self[:_SHOWN].tolist()) + more

    @property
    def nbytes(self) -> int:
        """Memory of the arrays."""
        return sum(column.nbytes for column in self.columns())

    def values(self, row: int) -> list[Any]:
        """One row as Python's own values, in the order of the columns."""
        return [column.item(row) if column.ndim == 1 else column[row].tolist() for column in self.columns()]

    def tolist(self) -> list[tuple[Any, ...]]:
        """All rows so."""
        return list(zip(*[column.tolist() for column in self.columns()], strict=True))


_TYPES: dict[type[Any], dict[str, np.dtype[Any]]] = {}
_NONE: dict[type[Any], Any] = {}  # of each, the table without rows
_ROW_TYPES: dict[type[Any], Any] = {}


def _dtypes(table: type[Any]) -> dict[str, np.dtype[Any]]:
    known = _TYPES.get(table)
    if known is None:
        hints = get_type_hints(table, include_extras=True)
        known = _TYPES[table] = {field.name: _dtype(hints[field.name]) for field in fields(table)}
    return known


def _dtype(hint: Any) -> np.dtype[Any]:
    """The dtype of an annotation `NDArray[T]` or `Annotated[NDArray[T], n]`.

    To numpy before 2.5 the first is `ndarray[shape, dtype[T]]`, to later ones an alias whose one argument is T.
    """
    if get_origin(hint) is Annotated:
        array, width = get_args(hint)
        return np.dtype((_dtype(array), (width,)))
    last = get_args(hint)[-1]
    dtype: np.dtype[Any] = np.dtype(get_args(last)[0] if get_origin(last) is np.dtype else last)
    return dtype


class Kind(IntEnum):
    """What a row is."""

    NOISE = 0
    REQUEST = 1
    RESPONSE = 2


class Protocol(IntEnum):
    """The envelope of a frame."""

    RTU = 0
    ASCII = 1
    TCP = 2


class Direction(IntEnum):
    """The key `direction` of a frame, by kind."""

    request = Kind.REQUEST
    response = Kind.RESPONSE


NO_GAP = -(1 << 62)  # a silence of which nothing is known


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Rows(Columns):
    """Rows: frames and noise."""

    index: Int64s  # number of the frame, 0, 1, 2 ...; -1 for noise
    start: Int64s  # offset of its first byte in its port's stream
    length: Int64s  # bytes
    at: Int64s  # where its bytes begin in Batch.data
    t_start_ns: Int64s  # ns, best estimate of the first start bit
    t_end_ns: Int64s  # ns, best estimate of the last stop bit
    request: Int64s  # index of the request that a response answers, else -1
    request_start: Int64s  # `start` of that request, else -1
    response_ns: Int64s  # end of request to start of response; -1 where there is none or the tap can't tell
    confidence: Float32s  # 0 to 1
    kind: UInt8s  # Kind
    unit: UInt8s
    function: UInt8s  # without the exception bit
    exception: UInt8s  # exception code, 0 for none
    check: Bools  # CRC or LRC right; of Modbus TCP, which has none, True
    port: UInt8s
    protocol: UInt8s  # Protocol
    contested: Bools  # noise, or a frame in whose bytes another could end
    # What the reads say of it:
    gap_before_ns: Int64s  # ns, silence before it by the reads' times; NO_GAP where one read brought both
    gap_most_ns: Int64s  # longest and least silence between the reads that brought it; NO_GAP in one read
    gap_least_ns: Int64s  # negative where a read came late and the next one did not
    gap_at: Int32s  # byte before which the longest silence stands
    reads: Int32s  # how many reads brought it
    errors: UInt16s  # bytes that the UART marked, for parity or framing
    foreign: UInt8s  # noise that is another protocol's: its number in `dissectors.foreign.NAMES`, else 0
    # Whose an answer is, where that is not the request that it seems to follow:
    taken_for_start: Int64s  # `start` of the request that the client takes it for, where it answers another; else -1
    unsure: Bools  # it is unclear which request it answers
    mark: UInt8s  # the direction mark that a log gives the read of its first byte: `captures.Mark`

    def row(self, number: int) -> Row:
        """One of them."""
        return Row(*self.values(number))

    def __iter__(self) -> Iterator[Row]:
        return (Row(*values) for values in self.tolist())


@dataclass(slots=True)
class Row:
    """The values of one row of `Rows`, as Python's own. Not frozen: to make one would take eight times as long."""

    index: int
    start: int
    length: int
    at: int
    t_start_ns: int
    t_end_ns: int
    request: int
    request_start: int
    response_ns: int
    confidence: float
    kind: int
    unit: int
    function: int
    exception: int
    check: bool
    port: int
    protocol: int
    contested: bool
    gap_before_ns: int
    gap_most_ns: int
    gap_least_ns: int
    gap_at: int
    reads: int
    errors: int
    foreign: int = 0
    taken_for_start: int = -1
    unsure: bool = False
    mark: int = 0


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class BoundaryEvidence(Columns):
    """Why rows stand where they do, in bits of evidence (log2 of a likelihood ratio); made when asked for."""

    length: Float32s  # the length that the header predicts, and the checks that could have failed
    crc: Float32s
    silence: Float32s  # gaps before, inside and after, by the trust that this tap has earned
    conversation: Float32s  # how it fits what was said before it
    margin: Float32s  # best explanation over the best one without this row
    rival_start: Int64s  # what would stand here instead: -1 and 0 for noise
    rival_length: Int64s
    rival_kind: UInt8s


EXACT: Final = 0.05  # of a time: what may be wrong by no more is not worth an interval


class DelayBounds(NamedTuple):
    """Columns of ns, -1 for none: what is exact, and between what each lies (twice the same where it is exact)."""

    exact: Int64s
    low: Int64s
    high: Int64s


def bounds_of(delay: int, off_ns: float | None) -> tuple[int, int] | None:
    """Between what a time (ns) lies that may be wrong by so much; None where that is not known (None or infinite)."""
    if off_ns is None or not np.isfinite(off_ns):
        return None
    return (delay, delay) if off_ns <= EXACT * delay else (max(delay - round(off_ns), 0), delay + round(off_ns))


def delay_bounds(delays: Int64s, off_ns: float) -> DelayBounds:
    """The same of a column of times (ns, -1 for none)."""
    none = np.full(len(delays), -1, np.int64)
    if not np.isfinite(off_ns):
        return DelayBounds(none, none, none)
    measured = (delays >= 0) & (off_ns <= EXACT * delays)
    present = delays >= 0
    low = np.where(present, np.where(measured, delays, np.maximum(delays - round(off_ns), 0)), -1)
    high = np.where(present, np.where(measured, delays, delays + round(off_ns)), -1)
    return DelayBounds(np.where(low == high, low, -1), low, high)
