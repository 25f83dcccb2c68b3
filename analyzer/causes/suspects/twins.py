"""Two devices of one address."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

from ...tables.findings import Severity
from ..answeredas import lent
from ..bits import surplus_bits
from ..costs import cost_of, kind_bits
from ..evidence import HEALTHY, Evidence, usual_rate
from ..exchanges import Ending
from ..heads import begun_before
from ..hits import answers_too_many
from ..registry import ASKED_FOR, COMES_AND_GOES, LENGTHS, Foretold, Suspicion, Symptom, suspect
from ..signatures import Behind, Signature, known_header
from ..unitledger import UnitLedger
from .common import damage_suspicion
from .senders import SHARE

_LEAST: Final = 3
_MOSTLY: Final = 0.5
_OFTEN: Final = 0.2
_ALWAYS: Final = 0.9
_TWO_RIGHT: Final = 0.001  # of requests: no noise makes a second answer whose check value is right
_SHORT: Final = 0.8  # of what is due: two answers that overlap are no shorter than one,
_SHORT_BITS: Final = 2.0  # but where the receiver falls out of step
_RUN_INTO_BITS: Final = 20.0
_BEGINNING: Final = 3  # bytes of garbage that count
_BEFORE_BITS: Final = 4.0


@suspect(
    "duplicate-address",
    Severity.ERROR,
    blame="unit",
    text="Two devices answer to address {unit}[; {doubles:answer|answers} came to requests that had one already][; in "
    "{damaged:answer|answers} "
    "two transmitters mix][; {tails:answer|answers} {tails:|runs|run} on when {tails:|it is|they are} over]"
    "[; {met:exchange|exchanges} right behind {met:|is|are} hit by a second one]",
    share=SHARE,
    deciding_test="Look at the address that each device is set to; then, with the operator's consent, disconnect the "
    "device with address {unit}: if the address still answers, there is another one",
    remedy="Give one of the two devices an address of its own",
    foretold=Foretold({Symptom.DAMAGE: COMES_AND_GOES | LENGTHS | ASKED_FOR}, client_loses=True),
)
def duplicate_address(evidence: Evidence) -> Iterator[Suspicion]:
    """Overlap, or two answers, for one unit alone."""
    for unit in evidence.units if evidence.ordered else ():  # of two clocks nobody knows what came behind what
        readings, too_many = evidence.readings(unit), answers_too_many(evidence, unit)
        too_many = max(too_many - lent(evidence, unit), 0)
        behind = _are_of_others(evidence, _not_next(evidence, unit), len(evidence.followed(unit)))
        if (_are_of_others(evidence, readings, len(readings)) or behind) and not too_many:
            continue  # another unit is still answering when this one is asked
        seen = _seen(evidence, unit, too_many)
        bits = _bits(evidence, unit, seen)
        run_into = _run_into(evidence, unit) if seen.doubles >= _LEAST else _answered_again(evidence, unit)
        few = seen.doubles + seen.tails + len(readings) < _LEAST
        against = _SHORT_BITS * _shortened(readings)
        if bits + sum(run_into.values()) > against and (run_into or not few):
            yield replace(_suspicion(evidence, unit, seen, bits, run_into), against=against)


class _SecondShown(NamedTuple):
    """How often a second answer shows: whole, in what is sent next, behind an end; and by how many they are too many."""

    doubles: int
    crossed: int
    tails: int
    too_many: int


def _seen(evidence: Evidence, unit: UnitLedger, too_many: int) -> _SecondShown:
    doubles = max(unit.doubles - lent(evidence, unit), 0) if evidence.is_open(Symptom.DOUBLES, unit.unit) else 0
    doubles = max(doubles, round(evidence.behind(unit, Behind.ANSWER)))
    doubles += max(evidence.begun[unit.unit] - unit.count(Ending.SILENT, Ending.GARBAGE), 0)
    crossed, readings = round(evidence.behind(unit, Behind.REQUEST, Behind.NOISE)), evidence.readings(unit)
    if doubles < _LEAST and (len(readings) < _LEAST or crossed < _LEAST):
        crossed = 0
    if doubles <= 1.2 * evidence.unanswered(unit):
        doubles = 0
    if not unit.count(Ending.SILENT):  # one that is late leaves silence before
        doubles = max(doubles, _of_the_poll_before(evidence, unit))
        doubles += min(unit.unfit, doubles) * evidence.verdict.fine
    tails = round(evidence.tails(unit))
    return _SecondShown(max(doubles, too_many, evidence.echoed_again(unit)), max(crossed, tails), tails, too_many)


def _bits(evidence: Evidence, unit: UnitLedger, seen: _SecondShown) -> float:
    readings, rest = evidence.readings(unit), evidence.others(unit)
    rarely = _TWO_RIGHT if evidence.verdict.fine and not unit.count(Ending.SILENT) else HEALTHY
    noisy = sum(evidence.behind(other, Behind.REQUEST, Behind.NOISE) for other in rest)
    background = usual_rate(noisy, sum(other.answered for other in rest))
    bits = surplus_bits(min(seen.doubles, unit.asked), unit.asked, rarely)
    bits += surplus_bits(min(seen.crossed, unit.asked), unit.asked, background)
    if len(readings) >= _LEAST:
        kinds = kind_bits(readings, _MIXED)
        if seen.crossed >= _LEAST:  # the weaker one begins first, and may be heard behind the other
            kinds = max(kinds, kind_bits(readings, _OVERTAKEN))
        bits += evidence.surplus(unit) + kinds + _BEFORE_BITS * begun_before(evidence, unit)
    return bits


def _suspicion(
    evidence: Evidence, unit: UnitLedger, seen: _SecondShown, bits: float, run_into: Mapping[int, float]
) -> Suspicion:
    numbers = {
        "doubles": seen.doubles,
        "tails": seen.tails,
        "met": sum(evidence.ledger.successors.met[other, unit.unit] for other in run_into),
    }
    found = damage_suspicion(evidence, [unit], bits + sum(run_into.values()), numbers)
    explains = found.explains | {(kind, unit.unit) for kind in _ITS_OWN}
    explains |= {(kind, other) for other in run_into for kind in (Symptom.DAMAGE, Symptom.BEHIND)}
    disorder = 0.0
    if seen.too_many:  # the master takes one for what it asked next, and so on
        others = evidence.others(unit)
        now_and_then = [other for other in others if other.answered and evidence.damaged(other) < _ALWAYS * other.asked]
        explains |= {(kind, other.unit) for other in (unit, *now_and_then) for kind in _DISORDER}
        disorder = sum(surplus_bits(evidence.damaged(other), other.asked, HEALTHY) for other in now_and_then)
    lost = cost_of(evidence, explains)
    return replace(found, bits=found.bits + disorder, explains=explains, lost_answers=lost.answers, lost_ms=lost.ms)


_ITS_OWN: Final = (Symptom.DOUBLES, Symptom.LATENESS, Symptom.VALUES, Symptom.REFUSAL)  # of two devices
_DISORDER: Final = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.LATENESS, Symptom.SILENCE, Symptom.DOUBLES)


def _of_the_poll_before(evidence: Evidence, unit: UnitLedger) -> int:
    """About how many exchanges of a unit hold what begins as its answers to other polls do: answered once more, when
    something else was asked."""
    headers = {
        known_header(request)[:_BEGINNING] for request in evidence.ledger.polls.requests if request[0] == unit.unit
    }

    def is_so(each: Signature) -> bool:
        return each.heard[:_BEGINNING] in headers - {known_header(each.request)[:_BEGINNING]}

    return round(evidence.damaged_so(unit, is_so) + evidence.about(unit, is_so))


def _run_into(evidence: Evidence, unit: UnitLedger) -> Mapping[int, float]:
    """Other units that are hit right behind this one, and seldom else, for a second answer runs into what is asked next:
    by how much likelier that is (bits)."""
    found, successors = {}, evidence.ledger.successors
    for other in evidence.others(unit):
        if not evidence.is_open(Symptom.DAMAGE, other.unit):
            continue
        hit, asked = successors.met_of(other.unit), successors.followed_of(other.unit)
        met, followed = successors.met[other.unit, unit.unit], successors.followed[other.unit, unit.unit]
        bits = surplus_bits(met, followed, usual_rate(hit - met, asked - followed))
        if bits > _RUN_INTO_BITS:
            found[other.unit] = bits
    return found


def _are_of_others(evidence: Evidence, readings: Sequence[Signature], every: int) -> bool:
    """Whether some of these bytes begin as the answers of another unit do; `every`: of how many."""
    found = sum(evidence.begun_by(reading) is not None for reading in readings)
    return found >= max(_LEAST, _OFTEN * every)


def _not_next(evidence: Evidence, unit: UnitLedger) -> list[Signature]:
    """What stands behind good answers of a unit and does not begin by the number of the unit that is asked next, nor as
    another request that something ran into."""
    pairs = zip(unit.followed.kept, evidence.followed(unit), strict=False)
    return [
        each
        for sample, each in pairs
        if each.heard[:1] != bytes((max(sample.next_unit, 0),)) and not evidence.requests.begin(each.heard, unit.unit)
    ]


def _answered_again(evidence: Evidence, unit: UnitLedger) -> Mapping[int, float]:
    """The same of a unit whose second answers are lost in what is asked next, but for their ends: they are over before
    any answer to that can come. Nothing where its own requests stay without, for it may be late then."""
    if unit.count(Ending.SILENT) or not evidence.verdict.fine:
        return {}
    found = _run_into(evidence, unit)
    return {other: bits for other, bits in found.items() if evidence.is_too_soon(evidence.ledger.units[other])}


_MIXED: Final = {"whole": 0.35, "middle": 0.22, "long": 0.2, "cut": 0.06, "cut-short": 0.03, "crossed": 0.02,
                 "head": 0.08, "ahead": 0.04, "tail": 0.02, "bits": 0.03}  # fmt: skip
_OVERTAKEN: Final = {"head": 0.6, "ahead": 0.05, "middle": 0.1, "whole": 0.1, "long": 0.08, "cut": 0.03, "bits": 0.02}


def _shortened(readings: list[Signature]) -> int:
    """How many are too short and always by as much, as they are where one device sends faster than the line."""
    dues = Counter(each.due for each in readings)
    short = Counter((each.due, each.length) for each in readings if 0 < each.length < _SHORT * each.due)
    return sum(
        n
        for (due, length), n in short.items()
        if _MOSTLY * dues[due] < n + short[due, length - 1] + short[due, length + 1]
    )
