"""Values out of the limits that their register map gives."""

from __future__ import annotations

from collections.abc import Iterator

from ...tables.findings import Severity
from ..evidence import Evidence
from ..registry import Suspicion, Symptom, suspect

_BITS = 30.0  # for the first value, and one for each other


@suspect(
    "values-out-of-limits",
    Severity.WARNING,
    blame="unit",
    text="Unit {unit}: {said}; values out of their map's limits: {values}",
    share="{values:value|values}",
    deciding_test="Compare the value with the device's display: it tells a wrong map from a wrong measurement",
    remedy="Check scale, type and limits of the map, then the sensor or the wiring behind unit {unit}",
)
def out_of_limits(evidence: Evidence) -> Iterator[Suspicion]:
    """Numbers that the register map of the unit does not allow."""
    breaches = evidence.ledger.breaches
    for unit in dict.fromkeys(breach.unit for breach in breaches):
        if not evidence.is_open(Symptom.VALUES, unit):
            continue
        texts = [breach.text for breach in breaches if breach.unit == unit]
        yield Suspicion(
            (unit,),
            _BITS + len(texts) - 1,
            frozenset({(Symptom.VALUES, unit)}),
            {"unit": unit, "said": texts[0], "values": len(texts)},
        )
