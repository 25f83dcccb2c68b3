"""What suspicions of one shape share: units whose answers come damaged, beside the others."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Final

from ..costs import cost, together
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


def damage_suspicion(
    evidence: Evidence,
    units: Sequence[UnitLedger],
    bits: float,
    more: Mapping[str, Any] | None = None,
    symptoms: Sequence[Symptom] = OF_DAMAGE,
) -> Suspicion:
    """The damaged answers of these units."""
    damaged, answers = answers_of(evidence, units)
    others_damaged, others_answers = answers_of(evidence, (unit for unit in evidence.units if unit not in units))
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
