"""What a rule gets to see: rows as they came, transactions that were settled by them, and what is known of the line."""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..deframing.rules import big_endian_at as number_at
from ..deframing.tap_clock import TapClock
from ..options import Options
from ..tables.batch import Batch, adu_of
from ..tables.columns import Pdus
from ..tables.schema import Kind, Protocol, Row, Rows
from ..tables.transactions import TransactionRows
from .damage import DividedFrame

_SPARE: Final = 2  # bytes behind a PDU, where RTU has its check value
_NOISE, _REQUEST, _RESPONSE = int(Kind.NOISE), int(Kind.REQUEST), int(Kind.RESPONSE)


def where(mask: NDArray[Any]) -> NDArray[np.intp]:
    """Places where a column is true or not 0: `np.flatnonzero` without its detours, which small batches feel."""
    indices: NDArray[np.intp] = mask.nonzero()[0]
    return indices


@dataclass(frozen=True, slots=True, eq=False)
class PduBytes:
    """Bytes of rows without their envelope: a byte before the PDU of each, and how many (check value counted 2)."""

    data: NDArray[np.uint8]
    at: NDArray[np.int64]
    length: NDArray[np.int64]


def _plain_pdus(batch: Batch) -> PduBytes:
    """Those of a batch that is not all RTU."""
    pdus = Pdus(batch)
    length = np.where(batch.rows.kind == _NOISE, 0, pdus.ends - pdus.begins + 1 + _SPARE)
    return PduBytes(np.append(pdus.data, np.zeros(_SPARE, np.uint8)), pdus.begins - 1, length)


@dataclass(frozen=True, eq=False)
class DiagnosisStep:
    """One batch, seen by the rules; what several rules need is made once, when the first one asks.

    A row is wide and most rules look at few columns of it: `column` gives one by itself, and the properties tell which
    rows may concern a rule at all.
    """

    batch: Batch
    transactions: TransactionRows  # settled by this batch
    line: LineSettings
    options: Options
    timed: bool  # whether the capture has times
    clock: TapClock
    trail: LookBack  # the rows before this batch
    explained: Collection[int]  # requests (by index) whose answer came damaged
    now: int  # ns, end of the newest row
    verdicts: dict[int, Sequence[DividedFrame]] = field(default_factory=dict)  # what happened to damaged rows, by row
    _numbers: dict[tuple[int, int], NDArray[np.int64]] = field(default_factory=dict)

    @property
    def rows(self) -> Rows:
        return self.batch.rows

    @cached_property
    def plain(self) -> PduBytes:
        """The bytes of the frames as unit, PDU and two bytes more, whatever their envelope."""
        if self.rows.protocol.any():
            return _plain_pdus(self.batch)
        return PduBytes(self.batch.data, self.rows.at, self.rows.length)

    @property
    def data(self) -> NDArray[np.uint8]:
        """The bytes that `pdu` points into."""
        return self.plain.data

    @property
    def kind(self) -> NDArray[np.uint8]:
        """Kind of each row."""
        return self.rows.kind

    @cached_property
    def ports(self) -> list[int]:
        """Ports that rows came from."""
        ports: list[int] = where(np.bincount(self.rows.port)).tolist()
        return ports

    @cached_property
    def frames(self) -> NDArray[np.intp]:
        """Rows that are frames."""
        return where(self.kind)

    @cached_property
    def noise(self) -> NDArray[np.intp]:
        """Rows that are not."""
        return where(self.kind == _NOISE)

    @cached_property
    def damaged(self) -> NDArray[np.intp]:
        """Rows that are frames with a wrong check value."""
        return where((self.kind != _NOISE) & ~self.rows.check)

    @cached_property
    def requests(self) -> NDArray[np.intp]:
        """Rows that are requests with a right check value."""
        return where((self.kind == _REQUEST) & self.rows.check)

    @cached_property
    def responses(self) -> NDArray[np.intp]:
        """And responses."""
        return where((self.kind == _RESPONSE) & self.rows.check)

    @cached_property
    def strays(self) -> NDArray[np.intp]:
        """Of those the ones that answer no request; of some nobody can tell, and nothing is said of them."""
        return self.responses[(self.rows.request[self.responses] < 0) & ~self.rows.unsure[self.responses]]

    @cached_property
    def to_all(self) -> NDArray[np.intp]:
        """Rows that are frames of unit 0, the broadcast's; over Modbus TCP that is the server itself."""
        return where((self.kind != _NOISE) & (self.rows.unit == 0) & (self.rows.protocol != Protocol.TCP))

    @cached_property
    def requested(self) -> NDArray[np.uint8]:
        """The function codes of the requests as they were sent."""
        return self.data.take(self._request_begins)

    @cached_property
    def asked_functions(self) -> list[int]:
        """Each of them once, in order."""
        codes: list[int] = where(np.bincount(self.requested)).tolist()
        return codes

    @cached_property
    def _request_begins(self) -> NDArray[np.intp]:
        return self.pdu(self.requests)

    @cached_property
    def _request_lengths(self) -> NDArray[np.int64]:
        length: NDArray[np.int64] = self.plain.length[self.requests] - 3
        return length

    def numbers(self, offset: int, width: int) -> NDArray[np.int64]:
        """The number of 1 or 2 bytes at a PDU offset of each of the `requests`; -1 where one does not reach so far."""
        if (offset, width) not in self._numbers:
            at, short = self._request_begins + offset, where(self._request_lengths < offset + width)
            at[short] = 0
            self._numbers[offset, width] = values = number_at(self.data, at, width)
            values[short] = -1
        return self._numbers[offset, width]

    def right(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Those of these rows whose check value is right."""
        sound: NDArray[np.intp] = rows[self.rows.check[rows]] if len(rows) else rows
        return sound

    def bytes_of(self, row: int) -> bytes:
        """The captured bytes of a row."""
        return self.batch.bytes_of(row)

    def pdu(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Where the PDUs of these rows begin in `data`."""
        begins: NDArray[np.intp] = self.plain.at[rows] + 1
        return begins

    def function_bytes(self, rows: NDArray[np.intp]) -> NDArray[np.uint8]:
        """Function codes as they were sent, the exception bit with them."""
        return self.data.take(self.pdu(rows))

    def last_byte(self, rows: NDArray[np.intp]) -> NDArray[np.int64]:
        """Where the last byte of the PDU of these rows stands in `data`."""
        positions: NDArray[np.int64] = self.plain.at[rows] + self.plain.length[rows] - 3
        return positions

    def reaches(self, rows: NDArray[np.intp], octets: int) -> NDArray[np.bool_]:
        """Whether the PDUs of these rows have that many bytes at least."""
        reached: NDArray[np.bool_] = self.plain.length[rows] >= octets + 3
        return reached

    def asked(self, answers: NDArray[np.intp], offset: int) -> NDArray[np.int64]:
        """The two-byte number at a PDU offset of the requests that these rows answer; -1 where it is not known."""
        values = np.full(len(answers), -1, np.int64)
        requests = self.request_rows(answers)
        inside = where(requests >= 0)
        inside = inside[self.reaches(requests[inside], offset + 2)]
        values[inside] = number_at(self.data, self.pdu(requests[inside]) + offset, 2)
        for i in where(requests < 0).tolist():
            captured = self.batch.request_of(int(answers[i]), int(self.rows.request[answers[i]]))
            pdu = b"" if captured is None else adu_of(captured, int(self.rows.protocol[answers[i]])).pdu
            if len(pdu) >= offset + 2:
                values[i] = int.from_bytes(pdu[offset : offset + 2], "big")
        return values

    def request_rows(self, answers: NDArray[np.intp]) -> NDArray[np.intp]:
        """The rows of this batch that these rows answer; -1 where the request lies in an earlier batch."""
        frames, requests = self.frames, self.rows.request[answers]
        first = int(self.rows.index[frames[0]]) if len(frames) else 0
        inside = requests >= first  # and so not -1
        rows: NDArray[np.intp] = np.where(inside, frames.take(np.where(inside, requests - first, 0)), -1)
        return rows


# The rows before a row, across batches: what a rule looks back on when something is odd.


_REACH: Final = 64  # rows
_FEW: Final = 16  # of them, made at once
_MADE: Final = 1024  # of a batch, kept at most


class EarlierRow(NamedTuple):
    """A row with its bytes."""

    row: Row
    captured: bytes

    @classmethod
    def of(cls, batch: Batch, number: int) -> EarlierRow:
        """A row of a batch."""
        return cls(batch.rows.row(number), batch.bytes_of(number))

    @property
    def is_frame(self) -> bool:
        return self.row.kind != _NOISE


class _MadeRows:
    """Rows of a batch, each made once for all that look back at it."""

    batch: Batch
    _rows: dict[int, EarlierRow]

    def __init__(self, batch: Batch) -> None:
        self.batch = batch
        self._rows = {}

    def __len__(self) -> int:
        return len(self.batch)

    def before(self, number: int, most: int) -> Iterator[EarlierRow]:
        """At most so many rows before row number `number`, the nearest first; made few by few where there are many."""
        end = max(number - most, 0)
        if len(self.batch) <= _REACH:
            yield from self._all[end:number][::-1]
            return
        while number > end:
            first = max(number - _FEW, end)
            self._make(first, number)
            yield from [self._rows[before] for before in range(number - 1, first - 1, -1)]
            number = first

    @cached_property
    def _all(self) -> list[EarlierRow]:
        return [EarlierRow(row, self.batch.bytes_of(number)) for number, row in enumerate(self.batch.rows)]

    def _make(self, first: int, last: int) -> None:
        missing = [number for number in range(first, last) if number not in self._rows]
        if not missing:
            return
        if len(self._rows) >= _MADE:
            self._rows.clear()
            missing = list(range(first, last))
        low, high = missing[0], missing[-1] + 1
        for number, row in zip(range(low, high), self.batch.rows[low:high], strict=True):
            self._rows[number] = EarlierRow(row, self.batch.bytes_of(number))


class LookBack:
    """Looks back from any row of a batch, at most some rows into the batches before."""

    _earlier: deque[_MadeRows]
    _rows: int
    _current: _MadeRows | None

    def __init__(self) -> None:
        self._earlier = deque()  # their last rows, enough of them together
        self._rows = 0
        self._current = None

    def back(self, batch: Batch, number: int) -> Iterator[EarlierRow]:
        """The last rows before row number `number`, the nearest first."""
        if self._current is None or self._current.batch is not batch:
            self._current = _MadeRows(batch)
        yield from self._current.before(number, _REACH)
        left = _REACH - number
        for earlier in reversed(self._earlier):
            if left <= 0:
                return
            yield from earlier.before(len(earlier), left)
            left -= len(earlier)

    @property
    def newest(self) -> Rows:
        """The last row before this batch (a table of one); all zeros where there is none."""
        return self._earlier[-1].batch.rows[-1:] if self._earlier else Rows.zeros(1)

    def go_on(self, batch: Batch) -> None:
        """This batch is done."""
        if not len(batch):
            return
        made, self._current = self._current, None
        if made is None or made.batch is not batch or len(batch) > _REACH:
            made = _MadeRows(batch if len(batch) <= _REACH else _end(batch))
        self._earlier.append(made)
        self._rows += min(len(batch), _REACH)
        while self._rows - len(self._earlier[0]) >= _REACH:
            self._rows -= len(self._earlier.popleft())


def _end(batch: Batch) -> Batch:
    """The last rows of a batch and their bytes, which hold on to no more than themselves."""
    rows = batch.rows[-_REACH:].copy()
    first = int(rows.at[0])
    rows.at[:] -= first
    return Batch(rows, batch.data[first:].copy())
