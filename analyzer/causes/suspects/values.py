"""Values that tell trouble: `analyzer.registers.troubles` has the evidence, where somebody looked at the values.

What they say is told beside other causes and explains none of the exchanges: those were all good.
"""

from __future__ import annotations

from collections.abc import Iterator

from ...registers.troubles import ValueTrouble
from ...tables.findings import Severity
from ..evidence import Evidence
from ..registry import Suspicion, Symptom, suspect


def _suspicions(evidence: Evidence, kind: str) -> Iterator[Suspicion]:
    """One of a unit, its plainest trouble of this kind."""
    by_unit: dict[int, list[ValueTrouble]] = {}
    for trouble in evidence.ledger.values:
        if trouble.kind == kind:
            by_unit.setdefault(trouble.units[0], []).append(trouble)
    for unit, found in by_unit.items():
        if not evidence.is_open(Symptom.VALUES, unit):
            continue
        best = max(found, key=lambda trouble: trouble.bits)
        yield Suspicion(
            best.units,
            best.bits + len(found) - 1,
            frozenset({(Symptom.VALUES, unit)}),
            {"unit": unit, "said": best.text, "values": len(found), "count": best.count, "looked": best.looked},
            since=best.since_ns,
        )


@suspect(
    "frozen-values",
    Severity.WARNING,
    blame="unit",
    text="The values of unit {unit} stand still: {said}",
    share="{count} of {looked} registers that were lively",
    deciding_test="Look at the device's own display: it shows whether the values stand still there, too",
    remedy="Restart unit {unit}; where it comes back, its firmware or what measures behind it hangs: the bus part "
    "answers on",
)
def frozen_values(evidence: Evidence) -> Iterator[Suspicion]:
    """All lively registers of a unit stop at one moment."""
    return _suspicions(evidence, "frozen")


@suspect(
    "counter-jumps",
    Severity.WARNING,
    blame="unit",
    text="A counter falls for a moment: {said}",
    share="{count} of {looked} readings",
    deciding_test="Read the registers of the counter in one request and alone: the jumps go if a pair was torn",
    remedy="Read all words of a value in one request; a device that still mixes two moments needs a newer firmware, or a "
    "master that reads twice and takes what agrees",
)
def counter_jumps(evidence: Evidence) -> Iterator[Suspicion]:
    """A value that only rises falls for a reading or two."""
    return _suspicions(evidence, "falls")


@suspect(
    "word-order",
    Severity.WARNING,
    blame="unit",
    text="One unit has its words the other way round: {said}",
    share="{count} values",
    deciding_test="Compare one value of unit {unit} on its display with what the master shows",
    remedy="Set the word order of unit {unit} as its sisters have it, in the device or in the master's list",
)
def word_order(evidence: Evidence) -> Iterator[Suspicion]:
    """A unit among sisters whose 32-bit values have the other word order."""
    return _suspicions(evidence, "word-order")


@suspect(
    "values-out-of-limits",
    Severity.WARNING,
    blame="unit",
    text="{said}; values out of their map's limits: {values}",
    share="{values} values",
    deciding_test="Compare the value with the device's display: it tells a wrong map from a wrong measurement",
    remedy="Check scale, type and limits of the map, then the sensor or the wiring behind unit {unit}",
)
def out_of_limits(evidence: Evidence) -> Iterator[Suspicion]:
    """Numbers that the register map of the unit does not allow."""
    return _suspicions(evidence, "limits")
