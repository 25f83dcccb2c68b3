"""What no cause takes: exchanges that went wrong, unit by unit, and what they have in common in plain words.

A bus with something wrong is never left without a word. What is left of each symptom is held against what happens on
any line; where it is more, the contrast that wins says what it is like. That is a description and accuses nobody.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from ..languages import left_sentence
from .answeredas import answered_as, lent
from .bits import surplus_bits
from .contrasts import HITS_OF, NO_CONTRAST, Contrast, Family
from .evidence import HEALTHY, Evidence
from .exchanges import Ending
from .polls import Poll
from .registry import Symptom
from .scans import scanned
from .signatures import Behind
from .suspects.refusals import WRITES, areas_of
from .suspects.states import NO_ANSWER, codes_of
from .unheeded import unheeded
from .unitledger import UnitLedger

_LEAST: Final = 4  # exchanges
_SURE_BITS: Final = 10.0
_BACKGROUND: Final = {Symptom.SILENCE: 0.01, Symptom.DAMAGE: HEALTHY, Symptom.REFUSAL: 0.02, Symptom.LATENESS: HEALTHY,
                      Symptom.DOUBLES: HEALTHY, Symptom.BEHIND: 0.02}  # fmt: skip
_TOLD_BITS: Final = 6.0  # of a contrast that is told
_OF_REQUEST: Final = frozenset((1, 2, 3))
_FAILURES: Final = frozenset((4, 8))  # exceptions that speak of the device, not of what is asked
_ALWAYS: Final = 0.9
_OFTEN: Final = 0.02
_BY_HAND_NS: Final = 3e9  # from one to the next: nobody enters values sooner, again and again
_TIMES: Final = (2, 3, 4)
_SEVERAL: Final = 3  # polls,
_OF_A_LIST: Final = 20  # each of which comes so often
_NOISE: Final = 0.02  # of the bytes
_NOISE_BYTES: Final = 40
_BESIDES: Final = (Behind.NOISE, Behind.ZEROS, Behind.REQUEST)
_MOSTLY: Final = 0.5
_SYMPTOMS: Final = {
    Symptom.SILENCE: "no answer to {exchanges:,} of {asked:,} requests",
    Symptom.DAMAGE: "{exchanges:,} of {asked:,} answers damaged",
    Symptom.REFUSAL: "{exchanges:,} of {asked:,} requests refused (exception {code})",
    Symptom.LATENESS: "{exchanges:,} answers later than the client waits",
    Symptom.DOUBLES: "{exchanges:,} answers too many",
    Symptom.BEHIND: "bytes behind {exchanges:,} of {asked:,} good answers",
    Symptom.FRAMING: "{exchanges:,} bytes outside frames",
    Symptom.REQUESTS: "{exchanges:,} of {asked:,} answers are whole, and the client does not take them",
}
_OF_FRAMES: Final = {
    "unasked": "{exchanges:answer|answers} that nobody asked for",
    "unfit": "{exchanges:answer|answers} to something else than was asked",
    "twice": "{exchanges:,} of {asked:,} times the same was asked again at once, though it was answered",
}
_LIKE: Final = {
    "function": ", nearly all by function {value:02X}",
    "quantity": ", mostly when {value} registers or more are asked for",
    "answer-bytes": ", mostly where the answer has {value} bytes or more",
    "address": ", mostly at addresses from {value} on",
    "range-end": ", mostly where the request reaches to {value} or beyond",
    "below": ", mostly of the smaller requests",
    "poll": ", mostly of one request ({areas})",
    "rest": ", mostly when less than {rest:ms} of silence stand before the request",
    "rest-over": ", mostly when more than {rest:ms} of silence stand before the request",
    "unit-before": ", mostly right behind requests to unit {value}",
    "outcome-before": ", mostly right behind a request that fared badly itself",
    "since-write": ", mostly soon after a write to it",
    "since-write-over": ", mostly long after a write to it",
    "delay": ", mostly when the answer came later than {rest:ms}",
    "delay-below": ", mostly when the answer came sooner than {rest:ms}",
    "since": ", from some moment on",
    "until": ", until some moment",
    "spells": ", in spells",
    "requests-behind": ", most of them requests that came damaged",
    "answered-as": ", answered by the number of unit {value} instead",
    "nothing": ", at no time and of no request in particular",
}
_TURNED: Final = {  # what is said in place of the name where the symptom is above the threshold, or below it
    "rest": (True, "rest-over"), "since-write": (True, "since-write-over"), "since": (False, "until"),
    "delay": (False, "delay-below"),
    **dict.fromkeys(("quantity", "answer-bytes", "address", "range-end"), (False, "below")),
}  # fmt: skip
TEMPLATES: Final = {**{symptom.value: words for symptom, words in _SYMPTOMS.items()}, **_OF_FRAMES, **_LIKE}


@dataclass(frozen=True, slots=True)
class Left:
    """Exchanges of one unit (None: the bus) that no cause takes, and what they are like, in words."""

    unit: int | None
    exchanges: int
    like: str

    def to_json(self) -> dict[str, Any]:
        """As plain values."""
        return {"unit": self.unit, "exchanges": self.exchanges, "like": self.like}


def left_over(evidence: Evidence) -> list[Left]:
    """What is left of the evidence, most exchanges first."""
    looked_for = scanned(evidence)
    units = [unit for unit in evidence.units if unit.unit not in looked_for]
    found = [left for unit in units for left in _of_unit(evidence, unit)]
    told = {left.unit for left in found}
    found += _of_several(evidence, [unit for unit in units if unit.unit not in told])
    more = (*_not_taken(evidence), *_unasked(evidence), *_twice(evidence), *_of_bus(evidence))
    return sorted([*found, *more], key=lambda left: -left.exchanges)


def _of_unit(evidence: Evidence, unit: UnitLedger) -> Iterator[Left]:
    for symptom, (count, of) in _counts(evidence, unit).items():
        if not evidence.is_open(symptom, unit.unit) or count < _LEAST:
            continue
        more = surplus_bits(min(count, of), of, _BACKGROUND[symptom])
        if more <= 0:
            continue  # no more than on any line
        best = evidence.best_contrast(symptom, unit.unit) if symptom in HITS_OF else NO_CONTRAST
        best = best if best.bits >= _TOLD_BITS else NO_CONTRAST
        if more + best.bits >= _SURE_BITS and not _is_fact(evidence, unit, symptom, best):
            numbers = {"exchanges": count, "asked": of, "code": _codes(evidence, unit)}
            words = "unfit" if symptom is Symptom.LATENESS and unit.unfit > unit.late else symptom.value
            yield Left(unit.unit, count, _said(words, numbers) + _like(evidence, unit, symptom, best))


def _of_several(evidence: Evidence, units: Sequence[UnitLedger]) -> Iterator[Left]:
    """Of units of each of which too little is left to be told, together."""
    for symptom in (Symptom.DAMAGE, Symptom.SILENCE):
        mine = [unit for unit in units if evidence.is_open(symptom, unit.unit)]
        count, asked = (
            sum(each) for each in zip((0, 0), *(_counts(evidence, unit)[symptom] for unit in mine), strict=True)
        )
        if count >= _LEAST and surplus_bits(min(count, asked), asked, _BACKGROUND[symptom]) >= _SURE_BITS:
            yield Left(None, count, _said(symptom.value, {"exchanges": count, "asked": asked}))


def _not_taken(evidence: Evidence) -> Iterator[Left]:
    """Good answers that the client did not take, of units of which nothing else is explained."""
    explained = {number for _, number in evidence.explained}
    for number, count in unheeded(evidence).items():
        if number not in explained:
            numbers = {"exchanges": count, "asked": evidence.ledger.units[number].answered}
            yield Left(number, count, _said(Symptom.REQUESTS.value, numbers))


def _unasked(evidence: Evidence) -> Iterator[Left]:
    """Right answers of units that nobody polls, or of one that is and answers what it is asked besides."""
    if len(evidence.ledger.ports) > 1:
        return
    for unit in evidence.ledger.units.values():
        count = unit.strays - lent(evidence, unit)
        known = any(number == unit.unit for _, number in evidence.explained)
        if count >= max(_LEAST, _OFTEN * unit.asked) and not known:
            yield Left(unit.unit, count, _said("unasked", {"exchanges": count}))


def _twice(evidence: Evidence) -> Iterator[Left]:
    """A list in which most polls stand several times, one right behind the other."""
    polls = [poll for poll in evidence.polls if poll.unit and poll.count(Ending.OK) >= _OF_A_LIST]
    again = [poll for poll in polls if any(_stands(poll, times) for times in _TIMES)]
    if len(again) >= max(_SEVERAL, _MOSTLY * len(polls)) and evidence.is_open(Symptom.REQUESTS, None):
        count, asked = sum(poll.repeats for poll in again), sum(poll.asked for poll in again)
        yield Left(None, count, _said("twice", {"exchanges": count, "asked": asked}))


def _stands(poll: Poll, times: int) -> bool:
    """Whether a poll comes so many times in a row."""
    due = poll.count(Ending.OK) * (times - 1) / times
    return abs(poll.repeats - due) <= 1 + _OFTEN * due


def _counts(evidence: Evidence, unit: UnitLedger) -> Mapping[Symptom, tuple[int, int]]:
    """How many exchanges show each symptom, of how many."""
    late, doubles = unit.late + unit.unfit, max(unit.doubles - lent(evidence, unit), 0)
    return {
        Symptom.SILENCE: (evidence.silent(unit), unit.asked),
        Symptom.DAMAGE: (evidence.damaged(unit), unit.asked),
        Symptom.REFUSAL: (unit.count(Ending.EXCEPTION), max(unit.answered, 1)),
        Symptom.LATENESS: (late, max(unit.asked, late)),
        Symptom.DOUBLES: (doubles, max(unit.asked, doubles)),
        Symptom.BEHIND: (round(evidence.behind(unit, *_BESIDES)), max(unit.answered, 1)),
    }


def _is_fact(evidence: Evidence, unit: UnitLedger, symptom: Symptom, best: Contrast) -> bool:
    """Whether that is how some device works: it refuses one request now and then, an empty log or a value beyond its
    limits that somebody enters, and answers all others."""
    if symptom is not Symptom.REFUSAL or codes_of(evidence, unit).keys() & NO_ANSWER:
        return False
    polls = evidence.polls_of(unit.unit)
    refused = [poll for poll in polls if poll.exceptions]
    refused_of = {code for poll in refused for code in poll.exceptions}
    if refused_of & _FAILURES and not any(poll.count(Ending.OK) for poll in polls if not poll.exceptions):
        return False  # there is nothing else that it answers each time
    if refused_of & _OF_REQUEST and any(poll.count(Ending.EXCEPTION) >= _ALWAYS * poll.asked for poll in refused):
        return False  # what is never answered is asked in vain
    times = sum(poll.count(Ending.EXCEPTION) for poll in refused)
    if all(poll.function in WRITES for poll in refused) and 0 < evidence.ledger.span_ns < _BY_HAND_NS * times:
        return False  # a program's doing
    one = best.family in (Family.ASKED, Family.NOTHING) and len({(p.function, p.address) for p in refused}) == 1
    return one and any(poll.count(Ending.OK) for poll in polls)


def _codes(evidence: Evidence, unit: UnitLedger) -> str:
    codes = {code for poll in evidence.polls_of(unit.unit) for code in poll.exceptions}
    return ", ".join(f"{code:02X}" for code in sorted(codes))


def _like(evidence: Evidence, unit: UnitLedger, symptom: Symptom, best: Contrast) -> str:
    """What they have in common."""
    if symptom is Symptom.BEHIND and evidence.requests_behind(unit) > _MOSTLY * evidence.behind(unit, *_BESIDES):
        return _said("requests-behind", {})
    other = answered_as(evidence, unit.unit) if symptom is Symptom.SILENCE else None
    if other is not None:
        return _said("answered-as", {"value": other})
    if symptom not in HITS_OF:
        return ""
    over, turned = _TURNED.get(best.name, (None, ""))
    name = turned if best.over is over else best.name
    polls = [poll for poll in evidence.polls_of(unit.unit) if poll.number == best.value]
    return _said(name, {"value": best.value, "rest": best.spared / 1e6, "areas": areas_of(polls)})


def _said(part: str, numbers: Mapping[str, Any]) -> str:
    return left_sentence(part, TEMPLATES[part], numbers)


def _of_bus(evidence: Evidence) -> Iterator[Left]:
    """Bytes in no frame, but for those of exchanges that are explained."""
    ledger, rows = evidence.ledger, evidence.ledger.table.rows
    if not evidence.is_open(Symptom.FRAMING, None) or any(each.behind for each in ledger.units.values()):
        return
    explained = [unit for symptom, unit in evidence.explained if symptom is Symptom.DAMAGE and unit is not None]
    known = int(rows.heard[np.isin(rows.unit, explained)].sum()) * ledger.table.weight
    left = round(ledger.noise_bytes - known)
    if left >= max(_NOISE_BYTES, _NOISE * ledger.bytes):
        yield Left(None, left, _said(Symptom.FRAMING.value, {"exchanges": left}))
