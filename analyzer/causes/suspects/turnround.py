"""A client that holds its driver into answers: those of quick units lose their beginning, those of slow ones do not."""

from __future__ import annotations

from collections.abc import Iterator
from math import comb, log2
from statistics import median
from typing import Final

from ...tables.findings import Severity
from ..costs import cost, kind_bits, share_of, together
from ..evidence import Evidence
from ..exchanges import Ending
from ..registry import OF_A_LINE, Suspicion, Symptom, suspect
from ..unitledger import UnitLedger

_LEAST: Final = 4
_QUICK: Final = 2  # units: of one it may be its own driver
_OFTEN: Final = 0.1  # of a unit's answers
_HARDLY: Final = 0.03
_MOSTLY: Final = 0.5
_HEADS: Final = {"head": 0.45, "whole": 0.45, "ahead": 0.03, "middle": 0.05}
_SOME_HEADS: Final = 0.05  # of all: where but the beginning is lost; other settings leave nothing whole


@suspect(
    "client-driver-held",
    Severity.ERROR,
    blame="master",
    text="The client or its converter holds its driver into the answers: those of {units:unit|units}, which come "
    "within "
    "{soon:ms} of the request, lose their beginning ({damaged:,} of {answers:,}), those of slower units do not[ "
    "({others_damaged:,} "
    "of {others_answers:,})]",
    share="{damaged:,} of {answers:,} answers of the quick units[, {others_damaged:,} of {others_answers:,} of others]",
    deciding_test="Look at the direction setting of the client's port or converter: how long it drives after the last "
    "bit; with a "
    "response delay of 20 ms in one of the quick units its damage must go",
    remedy="Let the client's port release the line at once after the last stop bit (automatic direction control "
    "instead "
    "of RTS), or give the quick units a longer response delay",
    foretold=OF_A_LINE,
)
def client_driver_held(evidence: Evidence) -> Iterator[Suspicion]:
    """Damage at the head of several units' answers, all of which are quicker than any unit without."""
    hit, clean = [], []
    for unit in evidence.units:
        damaged, delay = evidence.damaged(unit), _delay(evidence, unit)
        if delay is None:
            continue
        if (
            damaged >= max(_LEAST, _OFTEN * unit.asked)
            and share_of(evidence.readings(unit), "head", "ahead", "whole") >= _MOSTLY
        ):
            hit.append((delay, unit))
        elif damaged <= _HARDLY * unit.asked:
            clean.append((delay, unit))
        else:
            return
    if (
        len(hit) < _QUICK
        or not clean
        or max(hit, key=lambda pair: pair[0])[0] >= min(clean, key=lambda pair: pair[0])[0]
    ):
        return
    if share_of([each for _, unit in hit for each in evidence.readings(unit)], "head", "ahead") < _SOME_HEADS:
        return
    units, others = [unit for _, unit in sorted(hit, key=lambda pair: pair[0])], [unit for _, unit in clean]
    lost = together(cost(evidence, unit, Ending.GARBAGE) for unit in units)
    yield Suspicion(
        tuple(unit.unit for unit in units),
        sum(evidence.surplus(unit) + kind_bits(evidence.readings(unit), _HEADS) for unit in units)
        + log2(comb(len(units) + len(others), len(units))),
        frozenset((kind, unit.unit) for unit in units for kind in (Symptom.DAMAGE, Symptom.MARKS, Symptom.LATENESS)),
        {
            "units": tuple(unit.unit for unit in units),
            "soon": max(delay for delay, _ in hit) / 1e6,
            "damaged": sum(map(evidence.damaged, units)),
            "answers": sum(unit.asked for unit in units),
            "others_damaged": sum(map(evidence.damaged, others)),
            "others_answers": sum(unit.asked for unit in others),
        },
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=tuple(i for unit in units for i in unit.examples.get(Ending.GARBAGE, []))[:6],
    )


def _delay(evidence: Evidence, unit: UnitLedger) -> float | None:
    """How soon a unit mostly answers (ns), of answers whole or not; None where the clock does not tell."""
    if not evidence.verdict.fine:
        return None
    damaged = [each.delay for each in evidence.readings(unit) if each.delay >= 0]
    return median([*damaged, *unit.delays.numbers.tolist()]) if damaged or len(unit.delays) else None
