"""What a rule gets to see: rows as they came, transactions that were settled by them, and what is known of the line."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings

from ..deframing.options import Options
from ..deframing.rules import field
from ..frames import Batch, Kind, Rows, adu_of
from .autopsy import Verdict
from .clock import Clock


@dataclass(frozen=True, slots=True, eq=False)
class Plain:
    """Bytes of rows without their envelope: where each row's begin, and how many there are (check value counted 2)."""

    data: NDArray[np.uint8]
    at: NDArray[np.int64]
    length: NDArray[np.int64]

    @classmethod
    def of(cls, batch: Batch) -> Plain:
        """Of a batch in RTU mode: its own bytes."""
        return cls(batch.data, batch.rows["at"], batch.rows["length"])


def _decoded(batch: Batch) -> Plain:
    """Of a batch in ASCII mode."""
    rows = batch.rows
    parts = [
        adu_of(batch.bytes_of(i), protocol).data + b"\0" if kind != Kind.NOISE else b""
        for i, (kind, protocol) in enumerate(zip(rows["kind"].tolist(), rows["protocol"].tolist(), strict=True))
    ]
    length = np.array([len(part) for part in parts], np.int64)
    return Plain(np.frombuffer(b"".join(parts), np.uint8), np.cumsum(length) - length, length)


@dataclass(frozen=True)
class View:
    """One batch, seen by the rules; the columns that several rules need are made once."""

    batch: Batch
    transactions: Rows  # TRANSACTION, settled by this batch
    line: LineSettings
    options: Options
    timed: bool  # whether the capture has times
    clock: Clock
    verdicts: Mapping[int, Verdict]  # what happened to damaged rows, by row
    explained: Collection[int]  # requests (by index) whose answer came damaged
    now: int  # ns, end of the newest row

    @property
    def rows(self) -> Rows:
        return self.batch.rows

    @cached_property
    def plain(self) -> Plain:
        """The bytes of the frames as unit, PDU and two bytes more, whatever their envelope."""
        return _decoded(self.batch) if self.rows["protocol"].any() else Plain.of(self.batch)

    @property
    def data(self) -> NDArray[np.uint8]:
        """The bytes that `pdu` points into."""
        return self.plain.data

    @cached_property
    def kind(self) -> NDArray[np.uint8]:
        """Kind of each row."""
        return np.ascontiguousarray(self.rows["kind"])

    @cached_property
    def frames(self) -> NDArray[np.intp]:
        """Rows that are frames."""
        return np.flatnonzero(self.kind != Kind.NOISE)

    @cached_property
    def good(self) -> NDArray[np.intp]:
        """Rows that are frames with a right check value."""
        return np.flatnonzero((self.kind != Kind.NOISE) & self.rows["check"])

    @cached_property
    def requests(self) -> NDArray[np.intp]:
        """Of those the requests."""
        asks: NDArray[np.intp] = self.good[self.kind[self.good] == Kind.REQUEST]
        return asks

    @cached_property
    def requested(self) -> NDArray[np.uint8]:
        """Their function codes as they were sent."""
        return self.function_bytes(self.requests)

    @cached_property
    def responses(self) -> NDArray[np.intp]:
        """And the responses."""
        answers: NDArray[np.intp] = self.good[self.kind[self.good] == Kind.RESPONSE]
        return answers

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
        here = np.flatnonzero(places >= 0)
        here = here[self.reaches(places[here], offset + 2)]
        asked[here] = field(self.data, self.pdu(places[here]) + offset, 2)
        for i in np.flatnonzero(places < 0).tolist():
            captured = self.batch.request_of(int(answers[i]), int(self.rows["request"][answers[i]]))
            pdu = b"" if captured is None else adu_of(captured, int(self.rows["protocol"][answers[i]])).pdu
            if len(pdu) >= offset + 2:
                asked[i] = int.from_bytes(pdu[offset : offset + 2], "big")
        return asked

    def request_rows(self, answers: NDArray[np.intp]) -> NDArray[np.intp]:
        """The rows of this batch that these rows answer; -1 where the request lies in an earlier batch."""
        frames = self.frames
        first = int(self.rows["index"][frames[0]]) if len(frames) else 0
        number = self.rows["request"][answers] - first
        inside = (number >= 0) & (self.rows["request"][answers] >= 0)
        places: NDArray[np.intp] = np.where(inside, frames.take(np.where(inside, number, 0)), -1)
        return places
