"""Frames that follow each other too soon, where the clock carries it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from ...tables.findings import Severity
from ..bits import surplus_bits
from ..evidence import Evidence
from ..registry import Suspicion, Symptom, suspect

_LEAST: Final = 5
_TOO_SOON: Final = 0.9  # of t3.5
_MOSTLY: Final = 0.5
_STRAYS: Final = 0.3  # of t3.5, at the most


def _told_t35(evidence: Evidence) -> float | None:
    """The line's t3.5 (ns); None where the clock cannot tell less from as much."""
    due, verdict = evidence.t35_ns, evidence.verdict
    carried = due is not None and verdict.fine and verdict.jitter_ns <= _STRAYS * due
    return due if carried and len(evidence.ledger.ports) <= 1 else None


@suspect(
    "master-too-fast",
    Severity.WARNING,
    blame="master",
    text="The client sends its next request {gap:.3g} characters after an answer (median), where 3.5 are due: {short} of "
    "{requests} requests",
    share="{short} of {requests} requests",
    deciding_test="Let the client pause for 5 ms before each request, and watch the units that lost requests",
    remedy="Set the client's inter-frame delay to 3.5 characters ({due:ms}) at the least",
)
def master_too_fast(evidence: Evidence) -> Iterator[Suspicion]:
    """Less than t3.5 before requests, where the clock carries it."""
    gaps, due = evidence.ledger.request_gaps, _told_t35(evidence)
    if due is None:
        return
    share = 1 - gaps.above(_TOO_SOON * due - evidence.verdict.jitter_ns)
    median = gaps.quantile(0.5)
    if len(gaps) < 20 or share < _MOSTLY or median is None:
        return
    yield Suspicion(
        (),
        surplus_bits(share * len(gaps), len(gaps), 0.05),
        frozenset({(Symptom.TIMING, None)}),
        {
            "gap": median / evidence.ledger.char_ns,
            "short": round(share * len(gaps)),
            "requests": len(gaps),
            "due": due / 1e6,
        },
    )


@suspect(
    "unit-too-fast",
    Severity.WARNING,
    blame="unit",
    text="Answers of {units:unit|units} come {gap:.3g} characters after the request (median), where 3.5 are due: {short} "
    "of {answers}",
    share="{short} of {answers} answers of {units:unit|units}",
    deciding_test="Look whether the client, or units that listen, lose frames right behind requests to {units:unit|units}",
    remedy="Set the unit's response delay to 3.5 characters ({due:ms}) at the least",
)
def unit_too_fast(evidence: Evidence) -> Iterator[Suspicion]:
    """Less than t3.5 before the answers of some units."""
    due = _told_t35(evidence)
    if due is None:
        return
    found = []
    for unit in evidence.units:
        share = 1 - unit.gaps.above(_TOO_SOON * due - evidence.verdict.jitter_ns) if len(unit.gaps) else 0.0
        if len(unit.gaps) >= _LEAST and share >= _MOSTLY and evidence.is_open(Symptom.TIMING, unit.unit):
            found.append((surplus_bits(share * len(unit.gaps), len(unit.gaps), 0.05), unit, share))
    if not found:
        return
    found.sort(key=lambda one: -one[0])
    yield Suspicion(
        tuple(unit.unit for _, unit, _ in found),
        sum(bits for bits, _, _ in found),
        frozenset((Symptom.TIMING, unit.unit) for _, unit, _ in found),
        {
            "units": tuple(unit.unit for _, unit, _ in found),
            "gap": float(np.median(np.concatenate([unit.gaps.numbers for _, unit, _ in found])))
            / evidence.ledger.char_ns,
            "short": round(sum(share * len(unit.gaps) for _, unit, share in found)),
            "answers": sum(len(unit.gaps) for _, unit, _ in found),
            "due": due / 1e6,
        },
    )
