"""What a rule gets to see: rows as they came, transactions that were settled by them, and what is known of the line."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..deframing.options import Options
from ..deframing.rules import field as number_at
from ..frames import Batch, Kind, Rows, adu_of
from .autopsy import Part
from .clock import Clock
from .trail import Trail

_NOISE, _REQUEST, _RESPONSE = int(Kind.NOISE), int(Kind.REQUEST), int(Kind.RESPONSE)


def where(mask: NDArray[Any]) -> NDArray[np.intp]:
    """Places where a column is true or not 0: `np.flatnonzero` without its detours, which small batches feel."""
    places: NDArray[np.intp] = mask.nonzero()[0]
    return places


@dataclass(frozen=True, slots=True, eq=False)
class Plain:
    """Bytes of rows without their envelope: where each row's begin, and how many there are (check value counted 2)."""

    data: NDArray[np.uint8]
    at: NDArray[np.int64]
    length: NDArray[np.int64]


def _decoded(batch: Batch) -> Plain:
    """Of a batch in ASCII mode."""
    rows = batch.rows
    parts = [
        adu_of(batch.bytes_of(i), protocol).data + b"\0" if kind != Kind.NOISE else b""
        for i, (kind, protocol) in enumerate(zip(rows["kind"].tolist(), rows["protocol"].tolist(), strict=True))
    ]
    length = np.array([len(part) for part in parts], np.int64)
    return Plain(np.frombuffer(b"".join(parts), np.uint8), np.cumsum(length) - length, length)


@dataclass(frozen=True, eq=False)
class View:
    """One batch, seen by the rules; what several rules need is made once, when the first one asks.

    A row is wide and most rules look at few columns of it: `column` gives one by itself, and the properties tell which
    rows may concern a rule at all.
    """

    batch: Batch
    transactions: Rows  # TRANSACTION, settled by this batch
    line: LineSettings
    options: Options
    timed: bool  # whether the capture has times
    clock: Clock
    trail: Trail  # the rows before this batch
    explained: Collection[int]  # requests (by index) whose answer came damaged
    now: int  # ns, end of the newest row
    verdicts: dict[int, Sequence[Part]] = field(default_factory=dict)  # what happened to damaged rows, by row
    _columns: dict[str, NDArray[Any]] = field(default_factory=dict)
    _settled: dict[str, NDArray[Any]] = field(default_factory=dict)
    _numbers: dict[tuple[int, int], NDArray[np.int64]] = field(default_factory=dict)

    @property
    def rows(self) -> Rows:
        return self.batch.rows

    def column(self, name: str) -> NDArray[Any]:
        """A column of the rows, its values side by side."""
        if name not in self._columns:
            self._columns[name] = np.ascontiguousarray(self.batch.rows[name])
        return self._columns[name]

    def settled(self, name: str) -> NDArray[Any]:
        """A column of the transactions in the same way."""
        if name not in self._settled:
            self._settled[name] = np.ascontiguousarray(self.transactions[name])
        return self._settled[name]

    @cached_property
    def plain(self) -> Plain:
        """The bytes of the frames as unit, PDU and two bytes more, whatever their envelope."""
        if self.column("protocol").any():
            return _decoded(self.batch)
        return Plain(self.batch.data, self.column("at"), self.column("length"))

    @property
    def data(self) -> NDArray[np.uint8]:
        """The bytes that `pdu` points into."""
        return self.plain.data

    @property
    def kind(self) -> NDArray[np.uint8]:
        """Kind of each row."""
        return self.column("kind")

    @cached_property
    def ports(self) -> list[int]:
        """Ports that rows came from."""
        ports: list[int] = where(np.bincount(self.column("port"))).tolist()
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
        return where((self.kind != _NOISE) & ~self.column("check"))

    @cached_property
    def requests(self) -> NDArray[np.intp]:
        """Rows that are requests with a right check value."""
        return where((self.kind == _REQUEST) & self.column("check"))

    @cached_property
    def responses(self) -> NDArray[np.intp]:
        """And responses."""
        return where((self.kind == _RESPONSE) & self.column("check"))

    @cached_property
    def strays(self) -> NDArray[np.intp]:
        """Of those the ones that answer no request."""
        return self.responses[self.column("request")[self.responses] < 0]

    @cached_property
    def to_all(self) -> NDArray[np.intp]:
        """Rows that are frames of unit 0, the broadcast's."""
        return where((self.kind != _NOISE) & (self.column("unit") == 0))

    @cached_property
    def requested(self) -> NDArray[np.uint8]:
        """The function codes of the requests as they were sent."""
        return self.data.take(self._asked_at)

    @cached_property
    def asked_functions(self) -> list[int]:
        """Each of them once, in order."""
        codes: list[int] = where(np.bincount(self.requested)).tolist()
        return codes

    @cached_property
    def _asked_at(self) -> NDArray[np.intp]:
        return self.pdu(self.requests)

    @cached_property
    def _asked_length(self) -> NDArray[np.int64]:
        length: NDArray[np.int64] = self.plain.length[self.requests] - 3
        return length

    def numbers(self, offset: int, width: int) -> NDArray[np.int64]:
        """The number of 1 or 2 bytes at a PDU offset of each of the `requests`; -1 where one does not reach so far."""
        if (offset, width) not in self._numbers:
            at, short = self._asked_at + offset, where(self._asked_length < offset + width)
            at[short] = 0
            self._numbers[offset, width] = found = number_at(self.data, at, width)
            found[short] = -1
        return self._numbers[offset, width]

    def right(self, places: NDArray[np.intp]) -> NDArray[np.intp]:
        """Those of these rows whose check value is right."""
        found: NDArray[np.intp] = places[self.column("check")[places]] if len(places) else places
        return found

    def bytes_of(self, row: int) -> bytes:
        """The captured bytes of a row."""
        return self.batch.bytes_of(row)

    def pdu(self, rows: NDArray[np.intp]) -> NDArray[np.intp]:
        """Where the PDUs of these rows begin in `data`."""
        places: NDArray[np.intp] = self.plain.at[rows] + 1
        return places

    def function_bytes(self, rows: NDArray[np.intp]) -> NDArray[np.uint8]:
        """Function codes as they were sent, the exception bit with them."""
        return self.data.take(self.pdu(rows))

    def last_byte(self, rows: NDArray[np.intp]) -> NDArray[np.int64]:
        """Where the last byte of the PDU of these rows stands in `data`."""
        places: NDArray[np.int64] = self.plain.at[rows] + self.plain.length[rows] - 3
        return places

    def reaches(self, rows: NDArray[np.intp], octets: int) -> NDArray[np.bool_]:
        """Whether the PDUs of these rows have that many bytes at least."""
        reached: NDArray[np.bool_] = self.plain.length[rows] >= octets + 3
        return reached

    def asked(self, answers: NDArray[np.intp], offset: int) -> NDArray[np.int64]:
        """The two-byte number at a PDU offset of the requests that these rows answer; -1 where it is not known."""
        asked = np.full(len(answers), -1, np.int64)
        places = self.request_rows(answers)
        here = where(places >= 0)
        here = here[self.reaches(places[here], offset + 2)]
        asked[here] = number_at(self.data, self.pdu(places[here]) + offset, 2)
        for i in where(places < 0).tolist():
            captured = self.batch.request_of(int(answers[i]), int(self.column("request")[answers[i]]))
            pdu = b"" if captured is None else adu_of(captured, int(self.column("protocol")[answers[i]])).pdu
            if len(pdu) >= offset + 2:
                asked[i] = int.from_bytes(pdu[offset : offset + 2], "big")
        return asked

    def request_rows(self, answers: NDArray[np.intp]) -> NDArray[np.intp]:
        """The rows of this batch that these rows answer; -1 where the request lies in an earlier batch."""
        frames, requests = self.frames, self.column("request")[answers]
        first = int(self.column("index")[frames[0]]) if len(frames) else 0
        inside = requests >= first  # and so not -1
        places: NDArray[np.intp] = np.where(inside, frames.take(np.where(inside, requests - first, 0)), -1)
        return places
