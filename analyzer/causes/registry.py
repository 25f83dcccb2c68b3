"""The one collection of suspects: each is declared once, by the words for people and the judge of its evidence.

    @suspect(
        "dead-unit", Severity.ERROR, blame="unit",
        text="unit {unit} never answers: {silent} of {asked} requests stayed without a byte",
        ...
    )
    def dead_unit(evidence: Evidence) -> Iterator[Suspicion]:
        ...

A module of `analyzer.causes.suspects` holds declarations; nothing lists the modules. A judge looks at all the evidence
that no other cause has explained yet and gives a `Suspicion` for each way in which its cause may be so, with its weight
in bits. Words are templates over the numbers of a suspicion, by name, so that a catalogue can translate them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from functools import cache
from typing import TYPE_CHECKING, Any, Final, Literal

from ..registry import Registry
from ..tables.findings import Severity

if TYPE_CHECKING:
    from .evidence import Evidence

Blame = Literal["unit", "master", "line", "tap", "nobody"]


class Symptom(Enum):
    """What may be wrong with the exchanges of a unit, or (unit None) with the bus; each is explained once."""

    SILENCE = "silence"  # requests without an answer
    DAMAGE = "damage"  # answers that are none
    LATENESS = "lateness"  # answers when nobody waits for them
    DOUBLES = "doubles"  # second answers
    BEHIND = "behind"  # bytes behind good answers
    MARKS = "marks"  # good answers with marks of the UART
    REFUSAL = "refusal"  # exceptions
    TIMING = "timing"  # silences that are too short or too long
    VALUES = "values"
    REQUESTS = "requests"  # what the master asks, and how
    FRAMING = "framing"  # bytes in no frame


Explained = frozenset[tuple[Symptom, int | None]]


@dataclass(frozen=True, slots=True)
class Suspicion:
    """One way in which a cause may be so: whom it concerns, its weight, what it explains, and its numbers for people.

    `lost_answers` and `lost_ms` as in `Cause`; times are on the ledger's axis and become None without times.
    """

    units: tuple[int, ...]
    bits: float
    explains: Explained
    numbers: Mapping[str, Any] = field(default_factory=dict)
    since: int | None = None
    until: int | None = None
    period_s: float | None = None
    lost_answers: int | None = None
    lost_ms: float | None = None
    frames: tuple[int, ...] = ()


Judge = Callable[["Evidence"], Iterable[Suspicion]]


@dataclass(frozen=True, eq=False)
class Suspect:
    """The declaration of a cause."""

    cause: str
    severity: Severity
    blame: Blame
    text: str
    share: str
    deciding_test: str
    remedy: str
    judge: Judge


_SUSPECTS: Final = Registry[Suspect]("analyzer.causes.suspects", "suspect")


def suspect(
    cause: str,
    severity: Severity,
    *,
    blame: Blame,
    text: str,
    remedy: str,
    share: str = "",
    deciding_test: str = "",
) -> Callable[[Judge], Judge]:
    """Registers the judge of a cause."""

    def enter(judge: Judge) -> Judge:
        _SUSPECTS.enter(cause, Suspect(cause, severity, blame, text, share, deciding_test, remedy, judge))
        return judge

    return enter


@cache
def suspects() -> tuple[Suspect, ...]:
    """All suspects, in the order of their causes."""
    return tuple(_SUSPECTS.by_name().values())
