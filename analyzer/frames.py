"""What was found on the bus, as columns.

The one shape between the deframer and every view: a `Batch` holds rows (a structured array, a row a frame or a
stretch of noise, in wire order) and the bytes that they speak of. Rows of all batches tile each port's byte stream:
every byte once, in order. A `Frame` is a view of one row, made when somebody looks at it; nothing keeps one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from dissectors.annotation import Context, Field, annotate, summary
from dissectors.envelopes import Adu, ascii_adu, ascii_frames, rtu
from dissectors.functions import function_name
from dissectors.lengths import Role

from .findings.model import Finding, describe


class Kind(IntEnum):
    """What a row is."""

    NOISE = 0
    REQUEST = 1
    RESPONSE = 2


class Protocol(IntEnum):
    """The envelope of a frame."""

    RTU = 0
    ASCII = 1


class Direction(IntEnum):
    """The key `direction` of a frame, by kind."""

    request = Kind.REQUEST
    response = Kind.RESPONSE


NO_GAP = -(1 << 62)  # a silence of which nothing is known
ROW = np.dtype(
    [
        ("index", np.int64),  # number of the frame, 0, 1, 2 ...; -1 for noise
        ("start", np.int64),  # offset of its first byte in its port's stream
        ("length", np.int64),  # bytes
        ("at", np.int64),  # where its bytes begin in Batch.data
        ("t_start", np.int64),  # ns, best estimate of the first start bit
        ("t_end", np.int64),  # ns, best estimate of the last stop bit
        ("request", np.int64),  # index of the request that a response answers, else -1
        ("request_start", np.int64),  # `start` of that request, else -1
        ("response_ns", np.int64),  # end of request to start of response; -1 where there is none or the tap can't tell
        ("confidence", np.float32),  # 0 to 1
        ("kind", np.uint8),  # Kind
        ("unit", np.uint8),
        ("function", np.uint8),  # without the exception bit
        ("exception", np.uint8),  # exception code, 0 for none
        ("check", np.bool_),  # CRC or LRC right
        ("port", np.uint8),
        ("protocol", np.uint8),  # Protocol
        ("contested", np.bool_),  # other explanations of its bytes were weighed
        # What the reads say of it:
        ("gap_before", np.int64),  # ns, silence before it by the reads' times; NO_GAP where one read brought both
        ("gap_most", np.int64),  # longest and least silence between the reads that brought it; NO_GAP in one read
        ("gap_least", np.int64),  # negative where a read came late and the next one did not
        ("gap_at", np.int32),  # byte before which the longest silence stands
        ("reads", np.int32),  # how many reads brought it
        ("errors", np.uint16),  # bytes that the UART marked, for parity or framing
    ]
)


@dataclass(frozen=True, slots=True)
class Row:
    """The values of one row of `ROW`, as Python's own."""

    index: int
    start: int
    length: int
    at: int
    t_start: int
    t_end: int
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
    gap_before: int
    gap_most: int
    gap_least: int
    gap_at: int
    reads: int
    errors: int


# Why a row's boundaries stand where they do, in bits of evidence (log2 of a likelihood ratio); made when asked for.
EVIDENCE = np.dtype(
    [
        ("length", np.float32),  # the length that the header predicts, and the checks that could have failed
        ("crc", np.float32),
        ("silence", np.float32),  # gaps before, inside and after, by the trust that this tap has earned
        ("conversation", np.float32),  # how it fits what was said before it
        ("margin", np.float32),  # best explanation over the best one without this row
        ("rival_start", np.int64),  # what would stand here instead: -1 and 0 for noise
        ("rival_length", np.int64),
        ("rival_kind", np.uint8),
    ]
)

Rows = NDArray[np.void]
_NEAR = 16  # rows back: where nearly all requests stand


@dataclass(frozen=True)
class Batch:
    """Rows in wire order, with their bytes.

    `earlier` holds the bytes of those requests (by index) that rows here answer and that lie in a batch before.
    `findings` (FINDING) are what a diagnosis said of these rows; None where there was none.
    """

    rows: Rows
    data: NDArray[np.uint8]
    earlier: Mapping[int, bytes] = field(default_factory=dict)
    evidence: Rows | None = None
    findings: Rows | None = None

    @classmethod
    def empty(cls) -> Batch:
        """No rows."""
        return cls(np.zeros(0, ROW), np.zeros(0, np.uint8))

    def __len__(self) -> int:
        return len(self.rows)

    def bytes_of(self, row: int) -> bytes:
        """The captured bytes of one row."""
        at = int(self.rows["at"][row])
        return self.data[at : at + int(self.rows["length"][row])].tobytes()

    def frames(self) -> Iterator[Frame]:
        """A view of each frame, noise left out."""
        return (self.frame(int(i)) for i in np.flatnonzero(self.rows["kind"] != Kind.NOISE))

    def frame(self, row: int) -> Frame:
        """A view of one row that is a frame."""
        values = Row(*self.rows[row].item())
        captured = self.data[values.at : values.at + values.length].tobytes()
        request = self.request_of(row, values.request) if values.request >= 0 else None
        evidence = None if self.evidence is None else self.evidence[row]
        return Frame(values, captured, request, evidence, self._said_of(values.port, values.start))

    def findings_of(self, row: int) -> tuple[Finding, ...]:
        """What the diagnosis said of one row, frame or noise."""
        return self._said_of(int(self.rows["port"][row]), int(self.rows["start"][row]))

    def _said_of(self, port: int, start: int) -> tuple[Finding, ...]:
        if self.findings is None or not len(self.findings):
            return ()
        places = self._places.get((port, start), ())
        return tuple(describe(self.findings[place]) for place in places)

    @cached_property
    def _places(self) -> dict[tuple[int, int], list[int]]:
        """Findings by port and start of the rows that they speak of, or of a part of which they do."""
        places: dict[tuple[int, int], list[int]] = {}
        if self.findings is None:
            return places
        for port in np.flatnonzero(np.bincount(self.findings["port"])).tolist():
            rows = self.rows[self.rows["port"] == port]
            order = np.argsort(rows["start"], kind="stable")
            starts = rows["start"][order]
            ends = starts + rows["length"][order]
            mine = np.flatnonzero((self.findings["port"] == port) & (self.findings["start"] >= 0))
            spoken = self.findings["start"][mine]
            holders = np.searchsorted(starts, spoken, side="right") - 1
            here = (holders >= 0) & (spoken < ends[holders])  # else its row is not among these
            for place, holder in zip(mine[here].tolist(), holders[here].tolist(), strict=True):
                places.setdefault((port, int(starts[holder])), []).append(place)
        return places

    def request_of(self, row: int, index: int) -> bytes | None:
        """The bytes of the request with this index, which the frame at `row` answers."""
        if index in self.earlier:
            return self.earlier[index]
        indices = self.rows["index"]
        for before in range(row - 1, max(row - _NEAR, 0) - 1, -1):
            if indices[before] == index:
                return self.bytes_of(before)
        here = np.flatnonzero(indices[:row] == index)
        return self.bytes_of(int(here[0])) if len(here) else None


@dataclass(frozen=True, slots=True)
class Frame:
    """One frame: a row of columns with its bytes, and its request's where it answers one."""

    row: Row
    captured: bytes
    request_bytes: bytes | None = None
    evidence: np.void | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def index(self) -> int:
        return self.row.index

    @property
    def start(self) -> int:
        return self.row.start

    @property
    def length(self) -> int:
        return self.row.length

    @property
    def port(self) -> int:
        return self.row.port

    @property
    def t_start_ns(self) -> int:
        return self.row.t_start

    @property
    def t_end_ns(self) -> int:
        return self.row.t_end

    @property
    def protocol(self) -> str:
        return Protocol(self.row.protocol).name.lower()

    @property
    def role(self) -> Role:
        return Role.REQUEST if self.row.kind == Kind.REQUEST else Role.RESPONSE

    @property
    def direction(self) -> str:
        return self.role.name.lower()

    @property
    def unit(self) -> int:
        return self.row.unit

    @property
    def function(self) -> int:
        return self.row.function

    @property
    def name(self) -> str:
        """The function's name in the Modbus specification."""
        return function_name(self.function)

    @property
    def exception(self) -> int | None:
        return self.row.exception or None

    @property
    def crc_ok(self) -> bool:
        return self.row.check

    @property
    def request_start(self) -> int | None:
        start = self.row.request_start
        return None if start < 0 else start

    @property
    def response_time_ns(self) -> int | None:
        time = self.row.response_ns
        return None if time < 0 else time

    @property
    def confidence(self) -> float:
        return self.row.confidence

    @property
    def adu(self) -> Adu:
        return adu_of(self.captured, self.row.protocol)

    @property
    def context(self) -> Context:
        """What the conversation adds to the reading of these bytes."""
        if self.request_bytes is None:
            return Context()
        return Context(request=adu_of(self.request_bytes, self.row.protocol).pdu)

    def fields(self) -> tuple[Field, ...]:
        """Every field, annotated; offsets are in the ADU."""
        return annotate(self.adu, self.role, self.context)

    def summary(self) -> str:
        """The frame in words, on one line."""
        return summary(self.adu, self.role, self.context)

    def to_json(self, *, fields: bool = True) -> dict[str, Any]:
        """The frame as the JSON line that `rtuscope export` writes."""
        line: dict[str, Any] = {
            "index": self.index,
            "start": self.start,
            "length": self.length,
            "t_start_ns": self.t_start_ns,
            "t_end_ns": self.t_end_ns,
            "protocol": self.protocol,
            "direction": self.direction,
            "unit": self.unit,
            "function": self.function,
            "name": self.name,
            "exception": self.exception,
            "crc_ok": self.crc_ok,
            "request_start": self.request_start,
            "response_time_ns": self.response_time_ns,
            "hex": self.adu.data.hex(),
        }
        if fields:
            line["fields"] = [item.to_json() for item in self.fields()]
        line["confidence"] = round(self.confidence, 6)
        line["findings"] = [finding.to_json() for finding in self.findings]
        if self.port:
            line["port"] = self.port
        return line


def adu_of(captured: bytes, protocol: int) -> Adu:
    """The ADU that these captured bytes are; of ASCII mode, what their digits stand for."""
    if protocol != Protocol.ASCII:
        return rtu(captured)
    found = ascii_frames(captured)
    return found[0] if found else ascii_adu(b"")
