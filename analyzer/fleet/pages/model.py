"""What the pages of a fleet show: days as cells, units, causes, captures, sites."""

from __future__ import annotations

from dataclasses import dataclass

from ...causes.model import Cause
from ...reports.html.outcomes import OutcomeBar


@dataclass(frozen=True, slots=True)
class DayCell:
    """How well requests were answered on a day: a level (`none`, `good`, `fair`, `poor`, `bad`), and words."""

    level: str
    title: str


@dataclass(frozen=True, slots=True)
class HealthStrip:
    """Cells of days, oldest first, and the whole in words, for those who do not see it."""

    cells: tuple[DayCell, ...]
    words: str


@dataclass(frozen=True, slots=True)
class DelayCurve:
    """Mean response times by day: the points of runs of days in a drawing, what its top means, what it says in all."""

    runs: tuple[str, ...]
    top: str
    words: str


@dataclass(frozen=True, slots=True)
class HealthSums:
    """What became of requests in all; `response` in words."""

    asked: int
    answered: int
    exceptions: int
    unanswered: int
    damaged: int
    bad_percent: float | None
    response: str


@dataclass(frozen=True, slots=True)
class UnitHealth:
    """A unit of a line over its days."""

    line: str
    unit: int
    strip: HealthStrip
    curve: DelayCurve | None
    bar: OutcomeBar
    sums: HealthSums


@dataclass(frozen=True, slots=True)
class CauseSpell:
    """A cause of a line over all days on which it was found: its words are those of the newest.

    `first` and `last` are days since the epoch, `days` how many there were; `lately` whether it was found on the last
    two days of its line; `fresh` whether it first came in the fleet's last week.
    """

    cause: Cause
    line: str
    first: int
    last: int
    days: int
    lately: bool
    fresh: bool


@dataclass(frozen=True, slots=True)
class CaptureEntry:
    """A capture: its name without folders, times and sizes in words, what could not be read of it."""

    name: str
    line: str
    begun: str
    span: str
    octets: int
    state: str
    damage: tuple[str, ...]
    damage_count: int


@dataclass(frozen=True, slots=True)
class SiteHealth:
    """All that a page of a site shows. `file`: the name of the page in its folder."""

    name: str
    file: str
    strip: HealthStrip
    sums: HealthSums
    lines: int
    captures: int
    harmed: int  # captures of which something could not be read
    octets: int
    span: str
    newest: str
    behind: bool  # nothing was recorded on the last two days of the fleet
    units: tuple[UnitHealth, ...]
    unit_count: int
    causes: tuple[CauseSpell, ...]
    cause_count: int
    damaged: tuple[CaptureEntry, ...]
    latest: tuple[CaptureEntry, ...]

    @property
    def names_lines(self) -> bool:
        """Whether captures have lines of other names than their own."""
        return any(each.line != each.name for each in (*self.latest, *self.damaged))

    @property
    def now(self) -> list[CauseSpell]:
        """Causes that were found lately."""
        return [each for each in self.causes if each.lately]

    @property
    def before(self) -> list[CauseSpell]:
        """Those that were not."""
        return [each for each in self.causes if not each.lately]
