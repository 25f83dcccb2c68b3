"""What stands before a request decides: units that need more rest than the client leaves."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from ...tables.findings import Severity
from ..bits import surplus_bits
from ..contrasts import Contrast
from ..evidence import Evidence
from ..exchanges import Ending
from ..registry import Foretold, Suspicion, Symptom, suspect
from .common import examples

_BACKGROUND: Final = 0.02
_SURE_BITS: Final = 8.0
_TO_ALL: Final = 0
_HALF: Final = 0.5


@suspect(
    "rest-too-short",
    Severity.WARNING,
    blame="master",
    text="The client pauses too briefly before requests to {units:unit|units}: {silent:,} of {asked:,} requests[ after "
    "less than {rest:ms} of silence][ right behind {calls:broadcast|broadcasts}] got no byte back, {rested_silent:,} of "
    "{rested:,} others",
    share="{silent:,} of {asked:,} requests[ after less than {rest:ms}][ behind {calls:broadcast|broadcasts}], "
    "{rested_silent:,} of {rested:,} others",
    deciding_test="Let the client pause twice as long before it asks {units:unit|units}: the silences must disappear",
    remedy="Let the client pause before its requests[ for more than {rest:ms}], and for 100 ms or more behind a broadcast; "
    "the specification asks for 3.5 characters only, some devices need tens of milliseconds",
    foretold=Foretold({Symptom.SILENCE: frozenset(("rest", "unit-before"))}),
)
def rest_too_short(evidence: Evidence) -> Iterator[Suspicion]:
    """Silence that hangs on the rest before the request, or comes right behind broadcasts, each of which takes a unit
    its time."""
    found = []
    for unit in evidence.units:
        best = _told(evidence.contrasts(Symptom.SILENCE, unit.unit))
        if best is not None and evidence.silent(unit) and best.then.rate > _HALF > best.otherwise.rate:
            found.append((unit, best))
    if not found:
        return
    found.sort(key=lambda pair: -pair[1].bits)
    silent, asked = sum(best.then.hits for _, best in found), sum(best.then.of for _, best in found)
    others = sum(best.otherwise.of for _, best in found)
    yield Suspicion(
        tuple(unit.unit for unit, _ in found),
        sum(surplus_bits(best.then.hits, best.then.of, _BACKGROUND) + best.bits for _, best in found),
        frozenset((Symptom.SILENCE, unit.unit) for unit, _ in found),
        {
            "units": tuple(unit.unit for unit, _ in found),
            "silent": silent,
            "asked": asked,
            "rested": others,
            "rested_silent": sum(best.otherwise.hits for _, best in found),
            "rest": max((best.spared for _, best in found if best.name == "rest"), default=0) / 1e6,
            "calls": evidence.ledger.broadcasts if any(best.name != "rest" for _, best in found) else 0,
        },
        since=min(unit.first for unit, _ in found) if evidence.ledger.timed else None,
        until=max(unit.last for unit, _ in found) if evidence.ledger.timed else None,
        lost_answers=sum(evidence.silent(unit) for unit, _ in found),
        frames=examples((unit for unit, _ in found), Ending.SILENT),
    )


def _told(contrasts: Sequence[Contrast]) -> Contrast | None:
    """The best, if it tells of a rest too short; and behind broadcasts, as good a one: requests may just rest as long there
    as behind nothing else."""
    for each in contrasts:
        if each.bits < max(_SURE_BITS, contrasts[0].bits - _SURE_BITS):
            break
        brief = each is contrasts[0] and each.name == "rest" and not each.over
        if brief or (each.name == "unit-before" and each.value == _TO_ALL):
            return each
    return None
