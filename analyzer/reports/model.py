"""What a report says, as values: the same facts behind the text page and the JSON.

Times are integer nanoseconds. Response times are measured ones only: where the tap cannot tell them, `count` stays 0.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from captures.recording.notes import Note

    from ..causes.model import Cause
    from ..outages import Deaf
    from ..registers.watch import WatchedValue


@dataclass(frozen=True, slots=True)
class Times:
    """Measured response times: end of request to start of answer. Percentiles are good to 1 %."""

    count: int = 0
    min_ns: int | None = None
    p50_ns: int | None = None
    p95_ns: int | None = None
    p99_ns: int | None = None
    max_ns: int | None = None
    mean_ns: int | None = None


@dataclass(frozen=True, slots=True)
class Counts:
    """Transactions by how they ended; `requests` is their number, and each of them ended in one of six ways."""

    requests: int = 0
    answered: int = 0  # without an exception
    exceptions: int = 0
    unanswered: int = 0
    broadcasts: int = 0
    damaged: int = 0  # answered by a frame with a wrong check value
    retries: int = 0  # requests that repeat one without a good answer
    late: int = 0  # answers after the client had moved on
    unheard: int = 0  # may have been answered while the recorder heard nothing


@dataclass(frozen=True, slots=True)
class UnitRow:
    """One unit's transactions."""

    unit: int
    counts: Counts
    times: Times


@dataclass(frozen=True, slots=True)
class FunctionRow:
    """One function's transactions, over all units."""

    function: int
    name: str
    counts: Counts
    times: Times


@dataclass(frozen=True, slots=True)
class ExceptionRow:
    """How often one exception came."""

    unit: int
    function: int
    exception: int
    name: str
    count: int


@dataclass(frozen=True, slots=True)
class FindingRow:
    """All findings of one code: how often, what they cost, and the first of them in words."""

    code: str
    severity: str
    count: int
    lost_answers: int
    lost_ms: float  # of the bus, waited in vain
    units: Mapping[int, int]  # unit: how often; the most afflicted ones
    text: str
    cause: str
    remedy: str
    clause: str  # of the specification that it rests on, or empty
    index: int | None  # frame of the first one; None for noise, or where the whole bus is meant
    start: int
    port: int
    t_ns: int


@dataclass(frozen=True, slots=True)
class Load:
    """Share of the time in which something is on the wire, 0 to 1; None where times or line settings are not known."""

    mean: float | None = None
    busiest_second: float | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """A bus in one page."""

    source: str
    format: str
    baud: int | None
    char_bits: int | None
    tap: str | None
    timed: bool
    damage: tuple[str, ...]  # what of the capture could not be read, and where: the first hundred
    damage_count: int
    partial: bool  # ended before the capture did
    t_start_ns: int | None
    t_end_ns: int | None
    bytes: int
    frames: int
    requests: int
    responses: int
    damaged_frames: int
    noise_bytes: int
    noise_stretches: int
    doubtful_frames: int  # confidence under a half
    transactions: Counts
    times: Times
    load: Load
    units: tuple[UnitRow, ...]
    functions: tuple[FunctionRow, ...]
    exceptions: tuple[ExceptionRow, ...]
    filter: str = ""  # what the rest of the report is narrowed to
    causes: tuple[Cause, ...] = ()  # what explains the findings, best first; none on a healthy bus
    findings: tuple[FindingRow, ...] = ()  # those that cost the bus most come first
    values: tuple[WatchedValue, ...] = ()  # what registers held, by a map or as far as inference is sure
    notes: tuple[Note, ...] = ()  # of a recording: what happened besides bytes
    deaf: tuple[Deaf, ...] = ()  # of a recording: when it heard nothing

    @property
    def span_ns(self) -> int | None:
        """First start bit to last stop bit; None without times."""
        if self.t_start_ns is None or self.t_end_ns is None:
            return None
        return self.t_end_ns - self.t_start_ns

    def to_json(self) -> dict[str, Any]:
        """The report as plain values, nested as it is here, with `span_ns`."""
        return {**asdict(self), "span_ns": self.span_ns}
