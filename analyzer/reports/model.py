"""What a report says, as values: the same facts behind the text page and the JSON.

Times are integer nanoseconds. Response times are measured, or bounded, or unknown, and say which.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import TYPE_CHECKING, Any, Final

from captures.line import LineSettings

from ..failures import FailedPart
from ..tables.schema import bounds_of
from ..words import between

if TYPE_CHECKING:
    from captures.recording.notes import Note

    from ..causes.leftovers import Left
    from ..causes.registry import Cause
    from ..outages import Deaf
    from ..registers.watch import WatchedValue
    from .against import Difference


HANDFUL: Final = 12  # frames: fewer, in a text or without times, are no sample of a bus
_SEARCHED: Final = 2  # requests: who asks so often of one unit looks for devices
_SEARCH: Final = 8  # units


@dataclass(frozen=True, slots=True)
class Times:
    """Response times by the reads' times: end of request to start of answer. Percentiles are good to 1 %.

    `off_ns`: by how much each may be wrong because of the tap; 0 where they are measured, None where nobody can tell.
    """

    count: int = 0
    min_ns: int | None = None
    p50_ns: int | None = None
    p95_ns: int | None = None
    p99_ns: int | None = None
    max_ns: int | None = None
    mean_ns: int | None = None
    off_ns: int | None = 0

    def bounds(self, figure: str) -> tuple[int, int] | None:
        """Between what a figure (`p50`) lies: twice the same where it is measured; None where it is unknown."""
        value: int | None = getattr(self, f"{figure}_ns")
        return None if value is None else bounds_of(value, self.off_ns)

    def worded(self, figure: str) -> str:
        """A figure for people: `12.3 ms`, `9..17 ms`, `?`."""
        bounds = self.bounds(figure)
        return "?" if bounds is None else between(*bounds)

    def to_json(self) -> dict[str, int | None]:
        """As plain values; a figure that is but bounded is null, and its bounds stand beside it."""
        line: dict[str, int | None] = {"count": self.count}
        for figure in ("min", "p50", "p95", "p99", "max", "mean"):
            bounds = self.bounds(figure)
            exact = bounds is not None and bounds[0] == bounds[1]
            line[f"{figure}_ns"] = bounds[0] if exact and bounds else None
            if bounds is not None and not exact:
                line[f"{figure}_low_ns"], line[f"{figure}_high_ns"] = bounds
        return line


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
    echoes: int = 0  # requests shown once more by the tap, which are none of the above

    @property
    def answers(self) -> int:
        """Those that something answered."""
        return self.answered + self.exceptions + self.damaged


@dataclass(frozen=True, slots=True)
class UnitRow:
    """One unit's transactions."""

    unit: int
    counts: Counts
    times: Times


@dataclass(frozen=True, slots=True)
class UnitChange:
    """When (ns) something about a unit was otherwise, and how."""

    t_ns: int
    until_ns: int
    text: str


@dataclass(frozen=True, slots=True)
class UnitCard:
    """One unit's exchanges by what was heard: silence and garbage are two things.

    `damage`: of the garbage, so many by the place in the frame; `delay_ns`: between what 95 of a hundred of its
    answers take (the tap's uncertainty included), None where that is unknown; `changes`: when it was otherwise.
    """

    unit: int
    asked: int
    answered: int  # without an exception
    exceptions: int
    silent: int  # not a byte
    garbage: int  # bytes, and no answer among them
    late: int
    doubles: int  # second answers
    damage: Mapping[str, int]
    delay_ns: tuple[int, int] | None
    changes: tuple[UnitChange, ...]


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
class FindingGroup:
    """Findings of one code that are of one kind and about one unit; `of`: requests to that unit, None where no unit is
    meant; `certainty` the mean of what the autopsies give, None where there are none."""

    unit: int | None
    count: int
    of: int | None
    text: str
    cause: str
    remedy: str
    certainty: float | None
    index: int | None
    start: int
    t_ns: int
    until_ns: int
    explained_by: str | None = None  # id of the cause that it follows from


@dataclass(frozen=True, slots=True)
class FindingRow:
    """All findings of one code: how often, what they cost, and the first of the commonest group in words."""

    code: str
    severity: str
    count: int
    lost_answers: int
    lost_ms: float | None  # of the bus, waited in vain; None where nobody can tell
    units: Mapping[int, int]  # unit: how often; the most afflicted ones
    text: str
    cause: str
    remedy: str
    clause: str  # of the specification that it rests on, or empty
    index: int | None  # frame of the first one; None for noise, or where the whole bus is meant
    start: int
    port: int
    t_ns: int  # of the first one
    until_ns: int  # and of the last
    groups: tuple[FindingGroup, ...] = ()  # the commonest first
    explained_by: tuple[str, ...] = ()  # ids of the causes that these follow from


@dataclass(frozen=True, slots=True)
class PollRow:
    """What is asked for again and again: unit, function, first address and quantity; `ok` of `asked` got a good answer,
    those left out whose answer nobody could hear.

    `period_ns` is the median from one to the next, `jitter_ns` how far nine in ten stray from it; None without times.
    `joins` is the first address of a poll of the same unit and function that one request could ask for as well,
    `saves_bytes` what that would save on the line each round; None where there is none. `wasted`: requests of it that
    brought nothing.
    """

    unit: int
    function: int
    address: int
    quantity: int
    asked: int
    ok: int
    exceptions: int
    unanswered: int
    damaged: int
    period_ns: int | None
    jitter_ns: int | None
    joins: int | None = None
    saves_bytes: int | None = None

    @property
    def wasted(self) -> int:
        return self.exceptions + self.unanswered + self.damaged


@dataclass(frozen=True, slots=True)
class BookmarkRow:
    """A row that the user marked in the interface, and what he says of it (empty: nothing); `index` -1 for noise."""

    index: int
    port: int
    start: int
    t_ns: int
    unit: int
    function: int
    comment: str


@dataclass(frozen=True, slots=True)
class HourRow:
    """One hour of the clock (of the capture, where its times are none): what became of its requests, and the finding
    that came most often."""

    name: str
    t_ns: int
    counts: Counts
    load: float | None
    finding: str


@dataclass(frozen=True, slots=True)
class RateRow:
    """How fast a sender's clock is, by the edges of its bits: a `unit`, or the client where that is None.

    `error`: the share by which it is faster than the line's settings say, negative where it is slower.
    """

    unit: int | None
    baud: float  # bit/s
    error: float


@dataclass(frozen=True, slots=True)
class Load:
    """Share of the time in which something is on the wire, 0 to 1; None where times or line settings are not known.

    The busiest second is one of the clock; None too where a short capture is cut so that none holds more than the mean.
    """

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
    parity: str | None = None
    stop_bits: float | None = None
    tcp_frames: int = 0  # of `frames`, those of Modbus TCP, on no line of ours
    foreign: Mapping[str, int] = field(default_factory=dict)  # bytes of other protocols on the pair, by name
    not_modbus: str = ""  # the protocol that this is instead, where that is known
    clock_skew_ns: tuple[int, int] | None = None  # bounds: how far the answers' tap is ahead of the requests'
    quiet: tuple[int, int] | None = None  # ns: the longest silence, where it stands out
    separate_ports: tuple[int, ...] = ()  # of lines of their own, which this counts as one bus
    rates: tuple[RateRow, ...] = ()  # of senders, where edges were captured
    filter: str = ""  # what the rest of the report is narrowed to
    causes: tuple[Cause, ...] = ()  # what explains the findings, best first; none on a healthy bus
    not_explained: tuple[Left, ...] = ()  # exchanges that went wrong and that no cause takes
    cards: tuple[UnitCard, ...] = ()  # by unit; none where a filter leaves out a part of the bus
    polls: tuple[PollRow, ...] = ()  # those asked most first
    hours: tuple[HourRow, ...] = ()  # where they were asked for
    bookmarks: tuple[BookmarkRow, ...] = ()  # the user's, in wire order
    before: str = ""  # the capture that it is compared with
    against: tuple[Difference, ...] = ()  # what is otherwise than there
    findings: tuple[FindingRow, ...] = ()  # those that cost the bus most come first
    values: tuple[WatchedValue, ...] = ()  # what registers held, by a map or as far as inference is sure
    notes: tuple[Note, ...] = ()  # of a recording: what happened besides bytes
    deaf: tuple[Deaf, ...] = ()  # of a recording: when it heard nothing
    failed: tuple[FailedPart, ...] = ()  # parts of the analysis that failed, by a defect: the others stand

    @property
    def line(self) -> LineSettings:
        """How the line was set."""
        return LineSettings(self.baud, self.char_bits, self.parity, self.stop_bits, self.tap)

    @property
    def span_ns(self) -> int | None:
        """First start bit to last stop bit; None without times."""
        if self.t_start_ns is None or self.t_end_ns is None:
            return None
        return self.t_end_ns - self.t_start_ns

    @property
    def is_handful(self) -> bool:
        """A few frames of a text that somebody pasted, or without times: too few for shares, loads and tables."""
        return self.frames < HANDFUL and (not self.timed or self.format == "text")

    @property
    def units_as_heard(self) -> tuple[UnitRow, ...]:
        """The units; where there are cards, `unanswered` are those of whose answer not a byte was heard, `damaged` all
        others that stayed without one."""
        cards = {card.unit: card for card in self.cards}
        return tuple(row if (card := cards.get(row.unit)) is None else _as_heard(row, card) for row in self.units)

    @property
    def scanned(self) -> frozenset[int]:
        """Units that were asked once or twice, as a search for devices asks, and never answered; none where they are
        few."""
        counts = {row.unit: row.counts for row in self.units_as_heard}
        silent = [
            unit for unit, asked in counts.items() if asked.unanswered + asked.unheard == asked.requests <= _SEARCHED
        ]
        return frozenset(silent) if len(silent) >= _SEARCH else frozenset()

    @property
    def bytes_for_answers(self) -> int:
        """How many of the `unanswered` got bytes all the same: garbage where there are cards."""
        told = zip(self.units, self.units_as_heard, strict=True)
        return sum(max(row.counts.unanswered - heard.counts.unanswered, 0) for row, heard in told)

    def to_json(self) -> dict[str, Any]:
        """The report as plain values, nested as it is here, with `span_ns`."""
        line = {**asdict(self), "span_ns": self.span_ns, "times": self.times.to_json()}
        line["causes"] = [cause.to_json() for cause in self.causes]
        for name, rows in (("units", self.units), ("functions", self.functions)):
            line[name] = [{**asdict(row), "times": row.times.to_json()} for row in rows]
        return line


def _as_heard(row: UnitRow, card: UnitCard) -> UnitRow:
    counts = row.counts
    lost = counts.unanswered + counts.damaged
    silent = min(card.silent, lost)
    return replace(row, counts=replace(counts, unanswered=silent, damaged=lost - silent))
