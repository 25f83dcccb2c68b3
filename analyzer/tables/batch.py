"""Rows with the bytes that they speak of: the one shape between the deframer and every view.

A frame is a view of one row, made when somebody looks at it; nothing keeps one.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.annotation import Context, annotate, summary
from dissectors.envelopes import Adu, ascii_adu, ascii_frames, rtu, tcp
from dissectors.fields import ENGLISH, Field, Wording
from dissectors.functions import function_name
from dissectors.length_rules import Role
from dissectors.subject import SpokenPdu, Subject, subject

from ..html_text import html_page, html_table
from .findings import Finding, Findings, describe
from .schema import BoundaryEvidence, DelayBounds, Kind, Protocol, Row, Rows, bounds_of, delay_bounds
from .spoken import spoken_json

_REQUEST, _RTU, _TCP = int(Kind.REQUEST), int(Protocol.RTU), int(Protocol.TCP)  # asked of each frame: enums are slow


@dataclass(frozen=True, slots=True, repr=False)
class Frame:
    """One frame: a row of columns with its bytes, and its request's where it answers one."""

    row: Row
    captured: bytes
    request_bytes: bytes | None = None
    evidence: BoundaryEvidence | None = None  # one row
    findings: tuple[Finding, ...] = ()
    told: Callable[[], dict[str, Any] | None] | None = field(default=None, compare=False)
    """`to_json` where somebody makes that of many frames at once; None from it: it is not ready."""
    off_ns: float = 0.0  # by how much a response time may be wrong, as `Batch` has it

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
        return self.row.t_start_ns

    @property
    def t_end_ns(self) -> int:
        return self.row.t_end_ns

    @property
    def protocol(self) -> str:
        return Protocol(self.row.protocol).name.lower()

    @property
    def role(self) -> Role:
        return Role.REQUEST if self.row.kind == _REQUEST else Role.RESPONSE

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
    def crc_ok(self) -> bool | None:
        """Whether CRC or LRC are right; None for Modbus TCP, which has neither."""
        return None if self.row.protocol == _TCP else self.row.check

    @property
    def request_start(self) -> int | None:
        start = self.row.request_start
        return None if start < 0 else start

    @property
    def taken_for_start(self) -> int | None:
        """`start` of the request that the client takes this answer for, where it is of another."""
        start = self.row.taken_for_start
        return None if start < 0 else start

    @property
    def unsure(self) -> bool:
        """Whether nobody can tell which request this answers."""
        return self.row.unsure

    @property
    def response_time_ns(self) -> int | None:
        """End of its request to its start, where the tap's clock carries it; else see `response_time_bounds_ns`."""
        bounds = self.response_time_bounds_ns
        return bounds[0] if bounds is not None and bounds[0] == bounds[1] else None

    @property
    def response_time_bounds_ns(self) -> tuple[int, int] | None:
        """Between what that lies, twice the same where it is exact; None where there is none or nobody can tell."""
        time = self.row.response_ns
        return None if time < 0 else bounds_of(time, self.off_ns)

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

    def fields(self, wording: Wording = ENGLISH) -> tuple[Field, ...]:
        """Every field, annotated; offsets are in the ADU."""
        return annotate(self.adu, self.role, self.context, wording)

    @property
    def subject(self) -> Subject:
        """The address, quantity and values that it speaks of."""
        pdu = SpokenPdu(self.adu.pdu, self.context.request or b"")
        return subject(self.function, self.role, self.exception, pdu, self.fields)

    def summary(self, wording: Wording = ENGLISH) -> str:
        """The frame in words, on one line."""
        return summary(self.adu, self.role, self.context, wording)

    def __repr__(self) -> str:
        found = "".join(f", {finding.code}" for finding in self.findings)
        return f"<{self._title}{found}: {self.adu.data.hex(' ')}>"

    @property
    def _title(self) -> str:
        return f"frame {self.index}, {self.direction}, unit {self.unit}: {self.summary()}"

    def _repr_html_(self) -> str:
        """For notebooks: its fields, and what was found."""
        fields = [(field.start, field.raw, field.name, field.text, field.problem) for field in self.fields()]
        found = "".join(finding._repr_html_() for finding in self.findings)
        return html_page(self._title, html_table(("offset", "bytes", "field", "value", "problem"), fields), found)

    def to_json(self, *, fields: bool = True) -> dict[str, Any]:
        """The frame as the JSON line that `rtuscope export` writes."""
        if fields and self.told is not None and (ready := self.told()) is not None:
            return ready
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
            "taken_for_start": self.taken_for_start,
            "unsure": self.unsure,
            **response_time_json(self.response_time_bounds_ns),
            "hex": self.adu.data.hex(),
        }
        if fields:
            line["fields"] = [item.to_json() for item in self.fields()]
        line |= spoken_json(self.subject, self.summary(), self.t_start_ns)
        line["confidence"] = round(self.confidence, 6)
        line["findings"] = [finding.to_json() for finding in self.findings]
        if self.port:
            line["port"] = self.port
        return line


def response_time_json(bounds_ns: tuple[int, int] | None) -> dict[str, int | None]:
    """What a line of JSON says of a response time between these, both the same where it is exact."""
    if bounds_ns is None:
        return {"response_time_ns": None}
    low, high = bounds_ns
    if low == high:
        return {"response_time_ns": low}
    return {"response_time_ns": None, "response_time_low_ns": low, "response_time_high_ns": high}


def adu_of(captured: bytes, protocol: int) -> Adu:
    """The ADU that these captured bytes are; of ASCII mode, what their digits stand for."""
    if protocol == _RTU:
        return rtu(captured)
    if protocol == _TCP:
        return tcp(captured)
    frames = ascii_frames(captured)
    return frames[0] if frames else ascii_adu(b"")


_NEAR = 16  # rows back: where nearly all requests stand


def rows_of_findings(rows: Rows, findings: Findings) -> NDArray[np.int64]:
    """The row that each finding stands on: the one that holds the first byte it speaks of, frame or noise.

    -1 for what concerns the bus as a whole, and for findings on other rows than these.
    """
    return rows_of_bytes(BytePlaces(rows.port, rows.start, rows.length), findings.port, findings.start)


class BytePlaces(NamedTuple):
    """Of rows, which bytes of their ports' streams each holds: columns."""

    port: NDArray[np.uint8]
    start: NDArray[np.int64]
    length: NDArray[np.integer[Any]]


def rows_of_bytes(rows: BytePlaces, ports: NDArray[np.uint8], starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The row that holds each byte of a port's stream; -1 for none."""
    holders = np.full(len(ports), -1, np.int64)
    for port in np.flatnonzero(np.bincount(ports)).tolist() if len(rows.port) else ():
        own = np.flatnonzero(rows.port == port)
        if not len(own):
            continue
        order = own[np.argsort(rows.start[own], kind="stable")]
        begins = rows.start[order]
        meant = np.flatnonzero((ports == port) & (starts >= 0))
        first = starts[meant]
        holder = np.searchsorted(begins, first, side="right") - 1
        inside = (holder >= 0) & (first < begins[holder] + rows.length[order[holder]])
        holders[meant[inside]] = order[holder[inside]]
    return holders


FrameTeller = Callable[["Batch", int], dict[str, Any] | None]


@dataclass(frozen=True)
class Batch:
    """Rows in wire order, with their bytes.

    `earlier` holds the bytes of those requests (by index) that rows here answer and that lie in a batch before.
    `findings` are what a diagnosis said of these rows; None where there was none. `off_ns`: by how much response times
    may be wrong, as far as is known by now; 0 where they are measured, infinite where this tap cannot tell them.
    """

    rows: Rows
    data: NDArray[np.uint8]
    earlier: Mapping[int, bytes] = field(default_factory=dict)
    evidence: BoundaryEvidence | None = None
    findings: Findings | None = None
    off_ns: float = 0.0

    @classmethod
    def empty(cls) -> Batch:
        """No rows."""
        return cls(Rows.zeros(0), np.zeros(0, np.uint8))

    def __len__(self) -> int:
        return len(self.rows)

    def said(self, findings: Findings) -> Batch:
        """The same rows, with what was said of them."""
        return Batch(self.rows, self.data, self.earlier, self.evidence, findings, self.off_ns)

    def bytes_of(self, row: int) -> bytes:
        """The captured bytes of one row."""
        at = int(self.rows.at[row])
        return self.data[at : at + int(self.rows.length[row])].tobytes()

    def frames(self, told: FrameTeller | None = None) -> Iterator[Frame]:
        """A view of each frame, noise left out; `told` as in `frame`."""
        framed = np.flatnonzero(self.rows.kind != Kind.NOISE)
        return (self.view(row, values, told) for row, values in zip(framed.tolist(), self.rows[framed], strict=True))

    def frame(self, row: int, told: FrameTeller | None = None) -> Frame:
        """A view of one row that is a frame; `told` makes its JSON object, or says None."""
        return self.view(row, self.rows.row(row), told)

    def view(self, row: int, values: Row, told: FrameTeller | None = None) -> Frame:
        """The same where the row's values are at hand."""
        captured = self.data[values.at : values.at + values.length].tobytes()
        request = self.request_of(row, values.request) if values.request >= 0 else None
        evidence = None if self.evidence is None else self.evidence[row : row + 1]
        ready = None if told is None else partial(told, self, row)
        return Frame(values, captured, request, evidence, self.findings_of(row), ready, self.off_ns)

    def findings_of(self, row: int) -> tuple[Finding, ...]:
        """What the diagnosis said of one row, frame or noise."""
        if self.findings is None or not len(self.findings):
            return ()
        return tuple(describe(self.findings, number) for number in self._findings_by_row.get(row, ()))

    @cached_property
    def response_times(self) -> DelayBounds:
        """How long each answer took, as far as the tap's clock carries it."""
        return delay_bounds(np.where(self.rows.request_start >= 0, self.rows.response_ns, -1), self.off_ns)

    @cached_property
    def finding_rows(self) -> NDArray[np.int64]:
        """The row that each of `findings` stands on (`rows_of_findings`)."""
        return np.zeros(0, np.int64) if self.findings is None else rows_of_findings(self.rows, self.findings)

    @cached_property
    def finding_counts(self) -> NDArray[np.int64]:
        """How many findings stand on each row."""
        return np.bincount(self.finding_rows[self.finding_rows >= 0], minlength=len(self))

    @cached_property
    def _findings_by_row(self) -> dict[int, list[int]]:
        numbers: dict[int, list[int]] = {}
        for number, row in enumerate(self.finding_rows.tolist()):
            numbers.setdefault(row, []).append(number)
        return numbers

    def request_of(self, row: int, index: int) -> bytes | None:
        """The bytes of the request with this index, which the frame at `row` answers."""
        if index in self.earlier:
            return self.earlier[index]
        indices = self.rows.index
        for before in range(row - 1, max(row - _NEAR, 0) - 1, -1):
            if indices[before] == index:
                return self.bytes_of(before)
        matches = np.flatnonzero(indices[:row] == index)
        return self.bytes_of(int(matches[0])) if len(matches) else None


def join_batches(batches: Sequence[Batch]) -> Batch:
    """Batches end to end as one, at least one; without evidence and findings."""
    if len(batches) == 1:
        return batches[0]
    rows = Rows.joined([batch.rows for batch in batches])
    sizes = np.cumsum([0, *(len(batch.data) for batch in batches)])
    rows.at[:] += np.repeat(sizes[:-1], [len(batch) for batch in batches])
    held = set(rows.index.tolist())  # what one batch asks and the next answers is here by now
    earlier = {index: adu for batch in batches for index, adu in batch.earlier.items() if index not in held}
    return Batch(rows, np.concatenate([batch.data for batch in batches]), earlier, off_ns=batches[-1].off_ns)
