"""Rows as a stream that another program reads: InfluxDB's line protocol, and packets for Wireshark.

The protocol is for telegraf (`execd`) and whatever else reads it:

    modbus_request,unit=17,function=3 length=8i,crc_ok=true 1763800000000000000
    modbus_response,unit=17,function=3 length=11i,crc_ok=true,response_time_ns=868000i 1763800000000868000
    modbus_value,unit=17,area=holding,name=Active\\ power value=12.5 1763800000000868000
    modbus_finding,code=no-response,severity=warning,unit=17 text="..." 1763800001000000000

Times are ns on the capture's clock: a frame's is that of its last stop bit. What is not known has no field. Packets are
those of a pcapng file that goes on, at the end of a pipe.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING

from dissectors.maps.model import MappedReading, RegisterMap
from dissectors.values import harmless

from ..exports.targets.pcapng import PacketStream, finding_comment
from ..registers.watch import Revision
from ..tables.batch import Frame, response_time_json
from ..tables.findings import Finding
from ..tables.schema import Kind
from .lines import FrameCache, ShownRow, clock_time, confirmed_readings

if TYPE_CHECKING:
    from .session import Session


class InfluxLines:
    """A line a frame, a mapped value, a finding."""

    def __init__(self, *, charts: Mapping[int, RegisterMap] | None = None) -> None:
        self.use_charts(charts or {})

    def use_charts(self, charts: Mapping[int, RegisterMap]) -> None:
        """From here on frames have the values of these maps."""
        self._values = FrameCache(lambda frame: [_value(reading) for reading in confirmed_readings(frame, charts)])

    def register(self, _revision: Revision) -> str:
        """Nothing: what a register means is no measurement."""
        return ""

    def of(self, shown: ShownRow) -> str:
        """The lines of a row, each with its end."""
        row = shown.values
        noise = row.kind == Kind.NOISE
        lines = []
        if not (noise or shown.late):
            lines = self._frame(shown.frame())
        lines += [_finding(finding, None if noise else row.unit, row.t_end_ns) for finding in shown.findings]
        return "".join(f"{line}\n" for line in lines)

    def bus(self, finding: Finding) -> str:
        """A finding about the bus as a whole."""
        return f"{_finding(finding, None, finding.t_ns)}\n"

    def _frame(self, frame: Frame) -> list[str]:
        tags: dict[str, object] = {"unit": frame.unit, "function": frame.function, "exception": frame.exception}
        tags["port"] = frame.row.port
        fields = {"length": f"{frame.row.length}i", "crc_ok": str(bool(frame.row.check)).lower()}
        times = response_time_json(frame.response_time_bounds_ns)
        fields |= {name: f"{time}i" for name, time in times.items() if time is not None}
        lines = [_line(f"modbus_{frame.direction}", tags, fields, frame.t_end_ns)]
        for name, area, field in self._values.of(frame):
            tags = {"unit": frame.unit, "area": area, "name": name, "port": frame.row.port}
            lines.append(_line("modbus_value", tags, dict([field]), frame.t_end_ns))
        return [line for line in lines if line]


def _value(reading: MappedReading) -> tuple[str, str, tuple[str, str]]:
    """Name, area and field of a reading: a number where it is one, else its words."""
    value = reading.value
    field = ("text", _string_value(reading.text))
    if isinstance(value, int | float) and math.isfinite(value):
        field = ("value", repr(float(value)))
    return reading.row.name, reading.row.area, field


def _finding(finding: Finding, unit: int | None, t_ns: int) -> str:
    tags = {"code": finding.code, "severity": finding.severity.name.lower(), "unit": unit, "port": finding.port}
    return _line("modbus_finding", tags, {"text": _string_value(finding.text)}, max(t_ns, finding.t_ns, 0))


def _line(measurement: str, tags: Mapping[str, object], fields: Mapping[str, str], t_ns: int) -> str:
    """A line; tags that are None are left out, and port 0, the only one of most buses."""
    present = {name: value for name, value in tags.items() if value is not None and (name != "port" or value)}
    head = "".join(f",{name}={_tag(str(value))}" for name, value in present.items())
    return f"{measurement}{head} {','.join(f'{name}={text}' for name, text in fields.items())} {t_ns}"


def _tag(text: str) -> str:
    text = " ".join(harmless(text).split()) or "-"  # a tag cannot be empty
    return re.sub(r"([,= ])", r"\\\1", text.replace("\\", "/"))  # a backslash at its end would escape what follows


def _string_value(text: str) -> str:
    escaped = " ".join(harmless(text).split()).replace("\\", "\\\\").replace('"', '\\"')
    return f'"{escaped}"'


class LivePackets:
    """A packet a row; what is said later of a frame is an empty packet whose comments tell of which one."""

    def __init__(self, session: Session, *, noise: bool = False) -> None:
        self._session, self._noise = session, noise
        self._stream = PacketStream()
        self._now = 0  # ns, of what was written so far

    def begin(self) -> bytes:
        """What stands before all packets."""
        return self._stream.begin()

    def of(self, shown: ShownRow) -> bytes:
        """The packet of a row, or what is said of it later."""
        row = shown.values
        line = self._session.line
        self._now = max(self._now, row.t_end_ns)
        if row.kind == Kind.NOISE and not self._noise:
            if not shown.findings:
                return b""
        elif not shown.late:
            return self._stream.row(shown.batch, shown.row, line)
        where = f"(unit {row.unit}, {clock_time(row.t_end_ns)})" if row.kind else "(bytes in no frame)"
        texts = [f"{finding_comment(finding)} {where}" for finding in shown.findings]
        return self._stream.remark(self._now, row.port, line, texts)

    def use_charts(self, _charts: Mapping[int, RegisterMap]) -> None:
        """Packets are bytes: maps change nothing."""

    def register(self, _revision: Revision) -> bytes:
        """Nothing: what a register means is no packet."""
        return b""

    def bus(self, finding: Finding) -> bytes:
        """A finding about the bus as a whole."""
        return self._stream.remark(self._now, finding.port, self._session.line, [finding_comment(finding)])
