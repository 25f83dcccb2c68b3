"""What suspicions of one shape share: units whose answers come damaged, beside the others; values of a unit."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from ..costs import LostAnswers, cost, together
from ..evidence import Evidence
from ..exchanges import Ending
from ..registry import Suspicion, Symptom
from ..unitledger import UnitLedger

_FRAMES: Final = 6
OF_DAMAGE: Final = (Symptom.DAMAGE, Symptom.MARKS, Symptom.BEHIND, Symptom.LATENESS)  # what is asked again seems late


def examples(units: Iterable[UnitLedger], ending: Ending) -> tuple[int, ...]:
    """Frames of a few exchanges that ended so."""
    return tuple(index for unit in units for index in unit.examples.get(ending, []))[:_FRAMES]


def answers_of(evidence: Evidence, units: Iterable[UnitLedger]) -> tuple[int, int]:
    """How many answers of these units are damaged, of how many."""
    pairs = [(evidence.damaged(unit), unit.answered) for unit in units]
    return sum(damaged for damaged, _ in pairs), sum(map(sum, pairs))


def value_suspicion(
    unit: int, bits: float, numbers: Mapping[str, Any], since: int | None = None, until: int | None = None
) -> Suspicion:
    """What registers of a unit hold."""
    return Suspicion(
        (unit,), bits, frozenset({(Symptom.VALUES, unit)}), {"unit": unit, **numbers}, since=since, until=until
    )


def damage_suspicion(
    evidence: Evidence,
    units: Sequence[UnitLedger],
    bits: float,
    more: Mapping[str, Any] | None = None,
    symptoms: Sequence[Symptom] = OF_DAMAGE,
) -> Suspicion:
    """The damaged answers of these units."""
    damaged, answers = answers_of(evidence, units)
    others_damaged, others_answers = answers_of(evidence, evidence.others(*units))
    lost = together(cost(evidence, unit, Ending.GARBAGE) for unit in units)
    times = [sample.t_asked for unit in units for sample in unit.samples.kept] if evidence.ledger.timed else []
    return Suspicion(
        tuple(unit.unit for unit in units),
        bits,
        frozenset((symptom, unit.unit) for unit in units for symptom in symptoms),
        {
            "unit": units[0].unit,
            "units": tuple(unit.unit for unit in units),
            "damaged": damaged,
            "answers": answers,
            "others_damaged": others_damaged,
            "others_answers": others_answers,
            **(more or {}),
        },
        since=min(times, default=None),
        until=max(times, default=None),
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=examples(units, Ending.GARBAGE),
    )


def silent_suspicion(
    evidence: Evidence,
    units: Sequence[UnitLedger],
    bits: float,
    kinds: Sequence[Symptom],
    numbers: Mapping[str, Any],
    lost: LostAnswers,
    ending: Ending = Ending.SILENT,
) -> Suspicion:
    """Units that do not answer, or refuse to, beside the others; `ending`: what became of the requests."""
    others = evidence.others(*units)
    return Suspicion(
        tuple(unit.unit for unit in units),
        bits,
        frozenset((kind, unit.unit) for unit in units for kind in kinds),
        {
            "unit": units[0].unit,
            "others_asked": sum(map(evidence.known, others)),
            "others_answered": sum(other.answered for other in others),
            "others_silent": sum(map(evidence.surely_silent, others)),
            **numbers,
        },
        since=min(unit.first for unit in units),
        until=max(unit.last for unit in units),
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=examples(units, ending),
    )
