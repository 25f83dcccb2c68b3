"""Units that answer by exceptions from some moment on, or always, whatever they are asked."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from dissectors.functions.exceptions import exception_name

from ...tables.findings import Severity
from ..bits import surplus_bits
from ..costs import LostAnswers
from ..evidence import Evidence
from ..exchanges import Ending
from ..registry import COMES_AND_GOES, Foretold, Suspicion, Symptom, suspect
from ..unitledger import UnitLedger
from .common import silent_suspicion

_BACKGROUND: Final = 0.02
_LEAST: Final = 5
_ALWAYS: Final = 0.95
_SURE_BITS: Final = 8.0
_AS_GOOD: Final = 10.0  # bits: of units that fail together one is refused behind another
_ELSEWHERE: Final = frozenset(
    (1, 2, 3, 5, 6, 0x0A, 0x0B)
)  # that say something of the request, of the time, of a gateway
_OF_REQUEST: Final = frozenset((1, 2, 3))


@dataclass(frozen=True, slots=True)
class Refusing:
    """A unit that refuses whatever it is asked: since when (None: always), how many of how many requests, and how many
    were answered well before."""

    begin: int | None
    refused: int
    asked: int
    well_before: int = 0
    before: int = 0

    def since(self, unit: UnitLedger) -> int:
        """When it began, or the unit was first asked."""
        return unit.first if self.begin is None else self.begin


def codes_of(evidence: Evidence, unit: UnitLedger) -> Counter[int]:
    """The exceptions that a unit answered by, and how often; none where they are few."""
    codes = Counter[int]()
    if unit.count(Ending.EXCEPTION) >= _LEAST:
        for poll in evidence.polls_of(unit.unit):
            codes.update(poll.exceptions)
    return codes


def refusing_since(evidence: Evidence, unit: UnitLedger) -> Refusing | None:
    """The state of a unit that gets exceptions only, always or from a moment to the end; None where what is asked decides,
    or nothing does. Of a long capture the counts before and behind the moment are what its part stands for."""
    refused = unit.count(Ending.EXCEPTION)
    if refused < _LEAST:
        return None
    if refused >= _ALWAYS * unit.answered:
        return Refusing(None, refused, unit.answered)
    best = evidence.best_contrast(Symptom.REFUSAL, unit.unit)
    since = next((each for each in evidence.contrasts(Symptom.REFUSAL, unit.unit) if each.name == "since"), None)
    if since is None or not since.over or not since.is_sharp or since.bits < max(_SURE_BITS, best.bits - _AS_GOOD):
        return None
    weight = evidence.ledger.table.weight_of(evidence.rows(unit.unit))
    then, before = since.then, since.otherwise
    return Refusing(since.value, *(round(weight * n) for n in (*then, before.of - before.hits, before.of)))


@suspect(
    "unit-fails",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} answers every request with exception {code} ({name}){since}: {refused:,} of {asked:,} requests"
    "[; before, {before:,} of {before_of:,} were answered well]",
    share="{refused:,} of {asked:,} requests to unit {unit}{since}",
    deciding_test="Look at the unit's own display or lamps for a fault, and read its error register by the maker's "
    "tool",
    remedy="Find the unit's own fault (a dead sensor board, a lost parameter set); the bus carries its answers well",
    foretold=Foretold({Symptom.REFUSAL: COMES_AND_GOES}),
)
def unit_fails(evidence: Evidence) -> Iterator[Suspicion]:
    """A state, not a matter of what is asked."""
    for unit in evidence.units:
        codes = codes_of(evidence, unit)
        if not codes or not evidence.is_open(Symptom.REFUSAL, unit.unit):
            continue
        (code, _), *_ = codes.most_common(1)
        state = refusing_since(evidence, unit)
        if state is None or code in (_ELSEWHERE - _OF_REQUEST) or (code in _OF_REQUEST and state.begin is None):
            continue
        numbers = {
            "code": f"{code:02X}",
            "name": exception_name(code),
            "since": "" if state.begin is None else ", from some moment on",
            "refused": state.refused,
            "asked": state.asked,
            "before": state.well_before,
            "before_of": state.before,
        }
        bits, lost = 1.1 * surplus_bits(state.refused, state.asked, _BACKGROUND), LostAnswers(state.refused)
        cause = silent_suspicion(evidence, [unit], bits, (Symptom.REFUSAL,), numbers, lost, Ending.EXCEPTION)
        yield replace(cause, since=state.since(unit))


NO_ANSWER: Final = frozenset((0x0A, 0x0B))  # of a gateway: it has no way to its target, or that is silent


def excused(evidence: Evidence) -> dict[int, Refusing]:
    """Units of which a gateway says that they do not answer, and from when on nothing else."""
    found = {}
    for unit in evidence.units:
        codes = codes_of(evidence, unit)
        theirs = sum(codes[code] for code in NO_ANSWER)
        if theirs >= _LEAST and theirs >= _ALWAYS * codes.total() and evidence.is_open(Symptom.REFUSAL, unit.unit):
            state = refusing_since(evidence, unit)
            if state is not None:
                found[unit.unit] = state
    return found
