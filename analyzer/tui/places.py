"""Where the user is: what the cursor of a view stands on, what may be done there, and where one has been.

An action that acts on what stands under the cursor exists in the views that offer it, and nowhere else; it asks for the
place it takes, so that nothing is done to what is not shown.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from ..causes.registry import Cause
from ..model.registers import Spot


@dataclass(frozen=True, slots=True)
class RowPlace:
    """A row of the bus."""

    row: int


@dataclass(frozen=True, slots=True)
class UnitPlace:
    """A unit."""

    unit: int


@dataclass(frozen=True, slots=True)
class PollPlace:
    """A poll, by the newest row that asked it."""

    unit: int
    row: int


@dataclass(frozen=True, slots=True)
class RegisterPlace:
    """A register, coil or input."""

    spot: Spot


@dataclass(frozen=True, slots=True)
class CausePlace:
    """A cause of trouble."""

    cause: Cause


@dataclass(frozen=True, slots=True)
class SpanPlace:
    """A stretch of time, ns."""

    t_start: int
    t_end: int


Place = RowPlace | UnitPlace | PollPlace | RegisterPlace | CausePlace | SpanPlace | None

OF_ROWS: Final = frozenset({
    "find", "find_on", "goto", "finding", "counterpart", "why", "bookmark", "comment", "reference", "select", "copy",
    "time_base", "columns", "door", "export", "follow", "noise",
})  # fmt: skip
"""What may be done in a list of rows."""
OF_FIGURES: Final = frozenset({"door", "export", "noise"})
"""What may be done beside figures of the rows that the scope leaves."""
OFFERED: Final = frozenset(OF_ROWS)
"""What exists only in the views that offer it."""

_MOST: Final = 100  # stops


@dataclass(frozen=True, slots=True)
class Visited:
    """Where one was: a view, and the row that its list stood on."""

    view: str
    row: int | None = None


@dataclass
class Trail:
    """The stops before this one, and those that one came back from."""

    past: list[Visited] = field(default_factory=list)
    ahead: list[Visited] = field(default_factory=list)

    def leave(self, stop: Visited) -> None:
        """One goes on from a stop to somewhere new."""
        if self.past[-1:] != [stop]:
            self.past = [*self.past, stop][-_MOST:]
        self.ahead.clear()

    def back(self, here: Visited) -> Visited | None:
        """The last stop that is another one than this."""
        return _from(self.past, self.ahead, here)

    def forward(self, here: Visited) -> Visited | None:
        """The one that was come back from."""
        return _from(self.ahead, self.past, here)


def _from(stops: list[Visited], others: list[Visited], here: Visited) -> Visited | None:
    while stops:
        stop = stops.pop()
        if stop != here:
            others.append(here)
            return stop
    return None
