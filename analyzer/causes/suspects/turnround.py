"""A client that holds its driver into answers: those of quick units lose their beginning, those of slow ones do not."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from math import comb, log2
from statistics import median
from typing import Final

from ...deframing.tap_clock import UNKNOWN
from ...tables.findings import Severity
from ..bits import surplus_bits
from ..costs import kind_bits, share_of
from ..evidence import HEALTHY, Evidence
from ..registry import OF_A_LINE, Suspicion, Symptom, suspect
from ..unitledger import UnitLedger
from .common import damage_suspicion

_LEAST: Final = 4
_SEVERAL: Final = 2  # units
_ALONE_BITS: Final = 6.0  # of one unit it may be its own driver
_OFTEN: Final = 0.1  # of a unit's answers
_HARDLY: Final = 0.03
_MOSTLY: Final = 0.5
_HEADS: Final = {"head": 0.45, "whole": 0.45, "ahead": 0.03, "middle": 0.05}
_SOME_HEADS: Final = 0.05  # of all: where but the beginning is lost; other settings leave nothing whole


@suspect(
    "client-driver-held",
    Severity.ERROR,
    blame="master",
    text="The client or its converter holds its driver into the answers: those of {units:unit|units}[, which come within "
    "{soon:ms} of the request,] lose their beginning ({damaged:,} of {answers:,}), those of others do not"
    "[ ({others_damaged:,} of {others_answers:,})]",
    share="{damaged:,} of {answers:,} answers of {units:unit|units}[, {others_damaged:,} of {others_answers:,} of others]",
    deciding_test="Look at the direction setting of the client's port or converter: how long it drives after the last "
    "bit; with a "
    "response delay of 20 ms in one of the quick units its damage must go",
    remedy="Let the client's port release the line at once after the last stop bit (automatic direction control "
    "instead "
    "of RTS), or give the quick units a longer response delay",
    foretold=OF_A_LINE,
)
def client_driver_held(evidence: Evidence) -> Iterator[Suspicion]:
    """Damage at the head of the answers of the quickest units; those of the others are as on any line. Where the clock
    does not tell who is quick, of several: that each of them has a driver that is late is less likely."""
    fine, beheaded = evidence.verdict.fine, _is_beheaded(evidence)
    every = sorted(evidence.units, key=lambda unit: (_delay(evidence, unit) if fine else 0.0, not beheaded(unit)))
    found = [
        (_bits(evidence, every[:count], every[count:], told=fine), count)
        for count in range(1 if fine else _SEVERAL, len(every))
        if all(map(beheaded, every[:count]))
        and all(evidence.damaged(unit) <= _HARDLY * unit.asked for unit in every[count:])
    ]
    bits, count = max(found, default=(0.0, 0))
    readings = [each for unit in every[:count] for each in evidence.readings(unit)]
    if bits > 0 and share_of(readings, "head", "ahead") >= _SOME_HEADS:
        yield damage_suspicion(
            evidence,
            every[:count],
            bits,
            {"soon": _delay(evidence, every[count - 1]) / 1e6 if fine else 0.0},
            (Symptom.DAMAGE, Symptom.MARKS, Symptom.LATENESS),
        )


def _is_beheaded(evidence: Evidence) -> Callable[[UnitLedger], bool]:
    heads = 0.0 if evidence.verdict.fine else _SOME_HEADS  # who is quick speaks for a unit of which nothing is left

    def is_so(unit: UnitLedger) -> bool:
        readings = evidence.readings(unit)
        often = evidence.damaged(unit) >= max(_LEAST, _OFTEN * unit.asked)
        begun = share_of(readings, "head", "ahead")
        return (
            often
            and begun >= heads
            and begun + share_of(readings, "whole") >= _MOSTLY
            and kind_bits(readings, _HEADS) > 0
        )

    return is_so


def _bits(evidence: Evidence, quick: Sequence[UnitLedger], slow: Sequence[UnitLedger], *, told: bool) -> float:
    """How much likelier the damage is as that of the quick units: they are as many in just this order, where it is told,
    and the slow ones are no worse than any line."""
    hits, trials = sum(map(evidence.damaged, slow)), sum(unit.asked for unit in slow)
    rate = max(HEALTHY, (hits + 0.5) / (trials + 0.5 / HEALTHY))
    bits = sum(
        surplus_bits(evidence.damaged(unit), unit.asked, rate) + kind_bits(evidence.readings(unit), _HEADS)
        for unit in quick
    )
    order = log2(comb(len(quick) + len(slow), len(quick))) if told else 0.0
    return bits + order - _ALONE_BITS * (len(quick) == 1) - surplus_bits(hits, trials, HEALTHY)


def _delay(evidence: Evidence, unit: UnitLedger) -> float:
    """How soon a unit mostly answers (ns), whole or not; last of all where nothing is heard of it."""
    damaged = [each.delay for each in evidence.readings(unit) if each.delay >= 0]
    return median([*damaged, *unit.delays.numbers.tolist()]) if damaged or len(unit.delays) else UNKNOWN
