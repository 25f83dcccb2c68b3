"""Values that the client stores under the registers of another request."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Final

from ...registers.telling import place_words
from ...tables.findings import Severity
from ..evidence import Evidence
from ..registry import Suspicion, Symptom, suspect
from ..repeats import only_displaced

_LEAST: Final = 2  # displaced answers
_BITS: Final = 16.0  # for each: what leads by less than its margin is not told as displaced
_MOST_BITS: Final = 240.0
_NAMED: Final = 6  # places
_SHIFT: Final = (Symptom.SHIFT,)
_ALL_OF_IT: Final = (Symptom.SHIFT, Symptom.LATENESS, Symptom.SILENCE)  # where no request is left without an answer


@suspect(
    "values-under-wrong-registers",
    Severity.ERROR,
    blame="master",
    text="The client stores values of unit {unit} under the wrong registers: {displaced:answer|answers} with "
    "{values:value|values} stood under another request, from frame {begun} on. Not to be trusted: {places}"
    "[, and {more:more place|more places}][. For {unsure:more answer|more answers} it is unclear whose they are]",
    share="{displaced:,} of {asked:answer|answers} of unit {unit}",
    deciding_test="Let the client pause between two requests for longer than the slowest answer of unit {unit}: the "
    "values "
    "must come right from there on",
    remedy="A pause longer than the slowest answer ends it. Make the client wait longer for unit {unit}, and let it "
    "discard late bytes before it asks again",
)
def values_under_wrong_registers(evidence: Evidence) -> Iterator[Suspicion]:
    """Answers that are certainly of another request than the one that the client takes them for."""
    ledger = evidence.ledger
    for number, shifts in sorted(ledger.shifts.units.items()):
        if shifts.displaced < _LEAST or not evidence.is_open(Symptom.SHIFT, number):
            continue
        unit = ledger.unit(number)
        asked = max(unit.asked, shifts.displaced)
        kinds, most = (_ALL_OF_IT, inf) if only_displaced(evidence, unit) else (_SHIFT, _MOST_BITS)
        places = [place_words(*poll) for poll in sorted(shifts.polls, key=lambda poll: -shifts.polls[poll])]
        yield Suspicion(
            (number,),
            min(_BITS * shifts.displaced, most),
            frozenset((kind, number) for kind in kinds),
            {
                "unit": number,
                "displaced": shifts.displaced,
                "values": shifts.values,
                "begun": shifts.begun,
                "places": tuple(places[:_NAMED]) or ("-",),
                "more": max(len(places) - _NAMED, 0),
                "unsure": shifts.unsure,
                "asked": asked,
            },
            since=shifts.first_ns,
            until=shifts.last_ns,
            lost_answers=shifts.displaced,
            frames=tuple(shifts.frames),
        )
