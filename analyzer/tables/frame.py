"""A frame: a view of one row, made when somebody looks at it; nothing keeps one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from dissectors.annotation import Context, annotate, summary
from dissectors.envelopes import Adu, ascii_adu, ascii_frames, rtu, tcp
from dissectors.fields import ENGLISH, Field, Wording
from dissectors.functions import function_name
from dissectors.length_rules import Role

from ..html_text import html_page, html_table
from .findings import Finding
from .schema import BoundaryEvidence, Kind, Protocol, Row, bounds_of

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
            **response_time_json(self.response_time_bounds_ns),
            "hex": self.adu.data.hex(),
        }
        if fields:
            line["fields"] = [item.to_json() for item in self.fields()]
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
