"""A frame in one line, for people and for programs; and the newest rows, kept for what is said of them later.

A finding may come frames after the row that it speaks of (no answer came, an answer came too late). So the last batches
are kept, and a row is looked up when more is said of it.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from datetime import datetime
from functools import lru_cache
from typing import TYPE_CHECKING, Any, Final, Generic, NamedTuple, TypeVar

import numpy as np
import orjson

from dissectors.annotation import annotate
from dissectors.length_rules import Role
from dissectors.maps.model import MappedReading, RegisterMap
from dissectors.values import harmless

from ..causes.reasoning import CauseRevision
from ..exports.encoding import noise_json
from ..languages import counted, tr, wording
from ..paste.meaning import mapped_readings
from ..registers.telling import told_name
from ..tables.batch import Batch, Frame, adu_of, rows_of_findings
from ..tables.findings import Finding, Severity, describe, described
from ..tables.schema import Kind, Row, bounds_of
from ..terminal_text import TerminalText, painted, terminal_text
from ..words import between
from .session import SessionStep

if TYPE_CHECKING:
    from ..registers.watch import Revision

_ROWS: Final = 512  # kept at least


class ShownRow(NamedTuple):
    """A row to be shown, with what is to be said of it now; `late` where the row itself came before."""

    batch: Batch
    row: int
    values: Row  # of that row
    captured: bytes
    request_bytes: bytes | None  # of the request that it answers
    findings: tuple[Finding, ...]
    late: bool

    def frame(self) -> Frame:
        """A view of it, if it is a frame."""
        return self.batch.view(self.row, self.values)


class Recent:
    """Follows the steps of a session."""

    def __init__(self) -> None:
        self._batches: deque[Batch] = deque()
        self._rows = 0

    def feed(self, step: SessionStep) -> Iterator[ShownRow]:
        """What is to be said after this step: of earlier rows first, then the new rows."""
        batch = step.batch
        own = batch.findings  # None where the step brought no row: all that it says is of earlier ones
        if len(step.findings) > (0 if own is None else len(own)):
            yield from self._late(step)
        silent = own is None or not len(own)
        octets = batch.data.tobytes()
        asked = dict(batch.earlier)  # bytes of frames by their index: each may be a request that one behind it answers
        for row, values in enumerate(batch.rows):
            captured = octets[values.at : values.at + values.length]
            request = asked.get(values.request)
            if values.index >= 0:
                asked[values.index] = captured
            said = () if silent else batch.findings_of(row)
            yield ShownRow(batch, row, values, captured, request, said, late=False)
        if len(batch):
            self._batches.append(batch)
            self._rows += len(batch)
            while self._rows - len(self._batches[0]) >= _ROWS:
                self._rows -= len(self._batches.popleft())

    def _late(self, step: SessionStep) -> Iterator[ShownRow]:
        """Rows of earlier batches of which something is said now."""
        late = np.flatnonzero((rows_of_findings(step.batch.rows, step.findings) < 0) & (step.findings.start >= 0))
        stands: dict[int, tuple[Batch, int]] = {}
        for batch in reversed(self._batches):  # nearly all of them stand in the newest ones
            rows = rows_of_findings(batch.rows, step.findings[late])
            stands.update(
                (number, (batch, row)) for number, row in zip(late.tolist(), rows.tolist(), strict=True) if row >= 0
            )
            late = late[rows < 0]
            if not len(late):
                break
        for number in sorted(stands):
            batch, row = stands[number]
            one = step.findings[number : number + 1]
            values = batch.rows.row(row)
            request = batch.request_of(row, values.request) if values.request >= 0 else None
            said = (describe(one, 0),)
            yield ShownRow(batch.said(one), row, values, batch.bytes_of(row), request, said, True)


def of_the_bus(step: SessionStep) -> list[Finding]:
    """Findings about the bus as a whole."""
    return list(described(step.findings[step.findings.start < 0])) if len(step.findings) else []


_SENSIBLE_NS: Final = 1_000_000_000 * 86_400 * 365  # times before 1971 count from a beginning of their own
_CACHED: Final = 4096  # frames whose words are kept: polls repeat
_BEHIND_FIELDS: Final = (
    "address",
    "quantity",
    "values",
    "summary",
    "time",
    "confidence",
    "findings",
    "port",
)  # keys of a frame's object
_MARKS: Final = {Severity.ERROR: "!", Severity.WARNING: "?", Severity.NOTE: "-"}
_COLOURS: Final = {Severity.ERROR: "31", Severity.WARNING: "33", Severity.NOTE: "2"}
_INDENT: Final = " " * 16
_NOISE, _REQUEST = int(Kind.NOISE), int(Kind.REQUEST)  # asked of each row: enums are slow


T = TypeVar("T")


class FrameCache(Generic[T]):
    """What is said of a frame's bytes, kept for the next one that is alike."""

    def __init__(self, say: Callable[[Frame], T]) -> None:
        self._say = say
        self._cache: dict[tuple[bytes, bytes | None, int, int], T] = {}

    def of(self, frame: Frame) -> T:
        return self.of_row(frame.row, frame.captured, frame.request_bytes, lambda: frame)

    def of_row(self, row: Row, captured: bytes, request_bytes: bytes | None, view: Callable[[], Frame]) -> T:
        """The same of a frame that `view` makes only where nothing is kept yet."""
        key = (captured, request_bytes, row.kind, row.protocol)
        words = self._cache.get(key)
        if words is None:
            if len(self._cache) >= _CACHED:
                self._cache.clear()
            words = self._cache[key] = self._say(view())
        return words


class TextLines:
    """Lines for a person: time, direction, unit, function, what it says, response time; findings below it."""

    def __init__(
        self, *, colour: bool, width: int | None, noise: bool = True, charts: Mapping[int, RegisterMap] | None = None
    ) -> None:
        """`width`: longer lines are cut; None: none are. `noise`: bytes in no frame are shown, too. `charts`: register
        maps of units, whose names stand in place of the registers."""
        self._colour, self._width, self._noise = colour, width, noise
        self.use_charts(charts or {})

    def use_charts(self, charts: Mapping[int, RegisterMap]) -> None:
        """From here on values are named and read by these maps."""
        self._summaries = FrameCache(lambda frame: harmless(_named(frame, charts)))

    def register(self, revision: Revision) -> TerminalText:
        """What a register means, told or revised."""
        return self._cut(f"{_INDENT}= {revision.text}", "36")

    def of(self, shown: ShownRow) -> TerminalText:
        """The lines of a row, each with its end; empty where there is nothing to show."""
        first = self._row(shown)
        return terminal_text(first, *map(self._finding, shown.findings)) if shown.findings else first

    def _row(self, shown: ShownRow) -> TerminalText:
        row = shown.values
        if row.kind == _NOISE:
            shows = self._noise or shown.findings
            return self._cut(_noise(shown.batch, shown.row), "2") if shows else terminal_text()
        words = self._summaries.of_row(row, shown.captured, shown.request_bytes, shown.frame)
        if shown.late:
            return self._cut(f"{clock_time(row.t_end_ns)}   #{row.index}: {words}", "2")
        return self._frame(row, words, shown.batch.off_ns)

    def bus(self, finding: Finding) -> TerminalText:
        """A finding about the bus as a whole."""
        return self._finding(finding)

    def cause(self, revision: CauseRevision) -> TerminalText:
        """What became of a cause."""
        cause, mark = revision.cause, _MARKS[Severity[revision.cause.severity.upper()]]
        head = tr(
            "cause {cause} ({state}, revision {revision} after {requests}, {sure})",
            cause=cause.cause, state=tr(revision.state), revision=revision.revision, sure=cause.sure,
            requests=counted(revision.exchanges, "request", "requests"),
        )  # fmt: skip
        text = f"{mark} {head}: {cause.text}"
        return self._cut(text, _COLOURS[Severity[cause.severity.upper()]])

    def _frame(self, row: Row, words: str, off_ns: float) -> TerminalText:
        arrow = ">" if row.kind == _REQUEST else "<"
        bounds = None if row.response_ns < 0 else bounds_of(row.response_ns, off_ns)
        took = "" if bounds is None else f"   {between(*bounds)}"
        check = "" if row.check else f"   {tr('WRONG CHECK VALUE')}"
        head = f"{clock_time(row.t_end_ns)} {arrow} {row.unit:3d} {row.function:02d} "
        if self._width is not None:
            room = self._width - len(head) - len(took) - len(check)
            words = words if len(words) <= room else words[: max(room - 1, 0)] + "…"
        colour = "31" if check else "33" if row.exception else ""
        return self._painted(f"{head}{words}{took}{check}", colour)

    def _finding(self, finding: Finding) -> TerminalText:
        text = f"{_INDENT}{_MARKS[finding.severity]} {finding.code}: {finding.text}"
        return self._cut(text, _COLOURS[finding.severity])

    def _cut(self, line: str, colour: str) -> TerminalText:
        line = harmless(line)
        if self._width is not None and len(line) > self._width:
            line = line[: self._width - 1] + "…"
        return self._painted(line, colour)

    def _painted(self, line: str, colour: str) -> TerminalText:
        return painted(line, colour if self._colour else "", ended=True)


class LiveJsonLines:
    """The objects of `rtuscope export`, a line each; a finding made later comes as one of kind `finding`."""

    def __init__(self, *, noise: bool = False, charts: Mapping[int, RegisterMap] | None = None) -> None:
        self._noise = noise
        self._fields = FrameCache(_fields)
        self.use_charts(charts or {})

    def use_charts(self, charts: Mapping[int, RegisterMap]) -> None:
        """From here on frames have the values of these maps."""
        self._charts = charts
        self._values = FrameCache(lambda frame: [reading.to_json() for reading in frame_readings(frame, charts)])

    def register(self, revision: Revision) -> str:
        """What a register means, told or revised: an object with `register`."""
        return dumped(revision.to_json())

    def of(self, shown: ShownRow) -> str:
        """The lines of a row."""
        if shown.late:
            return "".join(self.bus(finding) for finding in shown.findings)
        if shown.values.kind != _NOISE:
            return dumped(self._frame(shown.frame()))
        return dumped(noise_json(shown.batch, shown.row)) if self._noise else ""

    def _frame(self, frame: Frame) -> dict[str, Any]:
        """`Frame.to_json`, the fields as text that is kept."""
        line = frame.to_json(fields=False)
        behind: dict[str, Any] = {key: line.pop(key) for key in _BEHIND_FIELDS if key in line}
        mapped = {"mapped": self._values.of(frame)} if self._charts else {}
        return {**line, "fields": self._fields.of(frame), **behind, **mapped}

    def cause(self, revision: CauseRevision) -> str:
        """A line of kind `cause`."""
        return orjson.dumps(revision.to_json(), option=orjson.OPT_APPEND_NEWLINE).decode()

    def bus(self, finding: Finding) -> str:
        """A finding by itself: about a frame of before (`index`), a stretch of bytes, or the bus."""
        where: dict[str, Any] = {"kind": "finding", "index": finding.index}
        if finding.start >= 0:
            where |= {"start": finding.start, "length": finding.length, "t_ns": finding.t_ns}
        if finding.port:
            where["port"] = finding.port
        return dumped({**where, **finding.to_json()})


def dumped(line: dict[str, Any]) -> str:
    """A line of JSON."""
    return orjson.dumps(line, option=orjson.OPT_APPEND_NEWLINE).decode()


def _fields(frame: Frame) -> orjson.Fragment:
    return orjson.Fragment(orjson.dumps([field.to_json() for field in frame.fields()]))


def frame_readings(frame: Frame, charts: Mapping[int, RegisterMap]) -> list[MappedReading]:
    """What a frame carries by the map of its unit."""
    chart = charts.get(frame.unit)
    return [] if chart is None or not frame.crc_ok else mapped_readings(frame.to_json(), chart)


def confirmed_readings(frame: Frame, charts: Mapping[int, RegisterMap]) -> list[MappedReading]:
    """What an answer says by the map of its unit: values that it carries, and those that it confirms of its request. A
    request says nothing: it may be refused."""
    chart = charts.get(frame.unit)
    if chart is None or frame.row.kind != Kind.RESPONSE or frame.exception is not None or not frame.crc_ok:
        return []
    readings = mapped_readings(frame.to_json(), chart)
    if frame.request_bytes is None:
        return readings
    fields = annotate(adu_of(frame.request_bytes, frame.row.protocol), Role.REQUEST)
    asked = mapped_readings({"function": frame.function, "fields": [field.to_json() for field in fields]}, chart)
    own = {reading.row.address for reading in readings}
    return readings + [reading for reading in asked if reading.row.address not in own]


def _named(frame: Frame, charts: Mapping[int, RegisterMap]) -> str:
    """A frame in words; mapped values by their names."""
    readings = frame_readings(frame, charts)
    if not readings:
        return frame.summary(wording())
    names = ", ".join(f"{told_name(reading.row.name)} {reading.text}" for reading in readings)
    return f"{frame.summary(wording()).partition(': ')[0]}: {names}"


def _noise(batch: Batch, row: int) -> str:
    data = batch.bytes_of(row)
    shown = data[:16].hex(" ").upper() + (" …" if len(data) > 16 else "")
    words = tr("{bytes} outside frames: {shown}", bytes=counted(len(data), "byte", "bytes"), shown=shown)
    return f"{clock_time(int(batch.rows.t_end_ns[row]))} ~ {words}"


def clock_time(t_ns: int) -> str:
    """The time of day here, to the millisecond; seconds where the capture's clock began at zero."""
    if t_ns < _SENSIBLE_NS:
        return f"{t_ns / 1e9:12.3f}"
    seconds, rest = divmod(t_ns, 1_000_000_000)
    return f"{_second(seconds)}.{rest // 1_000_000:03d}"


@lru_cache(maxsize=8)
def _second(seconds: int) -> str:
    return f"{datetime.fromtimestamp(seconds):%H:%M:%S}"
