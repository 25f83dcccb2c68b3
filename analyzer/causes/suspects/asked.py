"""What is asked decides: requests that a unit never answers, while it answers others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from ...tables.findings import Severity
from ..bits import surplus_bits
from ..contrasts import Contrast, Family
from ..costs import LostAnswers, cost
from ..evidence import Evidence
from ..exchanges import Ending
from ..polls import Poll
from ..registry import ASKED_FOR, Foretold, Suspicion, Symptom, suspect
from ..unitledger import UnitLedger
from .refusals import areas_of

_BACKGROUND: Final = 0.02
_SURE_BITS: Final = 8.0
_ALWAYS: Final = 0.9
_LATE: Final = 0.1  # of the silent requests: then its answers do come
_AS_ASKED: Final = 1.25  # times the bits of a fault that names no reason
_FUNCTION_UNKNOWN: Final = 1
_TOO_MANY: Final = 3  # exception 03, illegal data value
_LEAST: Final = 3
_OVER: Final = ("quantity", "answer-bytes")  # thresholds that have words of their own
_REASONS: Final = {"answer-bytes": "answer-too-long", "poll": "address"}  # as the report's JSON names them


@suspect(
    "cannot-serve",
    Severity.ERROR,
    blame="master",
    text="Unit {unit} cannot serve some of the requests to it[: those for {asked_for} registers or bits at once, while it "
    "answers up to {served}][: those by function {functions}][: those for {areas}]; {silent} of {asked} such requests {how}[ (exception "
    "{codes})], {well} of {well_of} others were answered",
    share="{silent} of {asked} such requests to unit {unit}[, {others_silent} of {well_of} others]",
    deciding_test="Compare these requests with the manual of unit {unit}: which functions it has, how many registers it gives "
    "at once, and where its map ends",
    remedy="Ask for less at once, or by a function and at addresses that the unit has; a unit that cannot serve a request "
    "should refuse it, some stay silent",
    foretold=Foretold({Symptom.SILENCE: ASKED_FOR, Symptom.REFUSAL: ASKED_FOR}),
)
def cannot_serve(evidence: Evidence) -> Iterator[Suspicion]:
    """Silence that hangs on what is asked, of a unit that is there; and refusals that hang on how much is."""
    for unit in evidence.units:
        for symptom, ending in ((Symptom.SILENCE, Ending.SILENT), (Symptom.REFUSAL, Ending.EXCEPTION)):
            decided = _decided(evidence, unit, symptom)
            found = None if decided is None else _unserved(evidence, unit, decided, symptom, ending)
            if found is not None:
                yield found


def _unserved(
    evidence: Evidence, unit: UnitLedger, decided: Contrast, symptom: Symptom, ending: Ending
) -> Suspicion | None:
    polls = evidence.polls_of(unit.unit)
    deaf = [poll for poll in polls if poll.count(ending) >= _ALWAYS * poll.asked]
    well = [poll for poll in polls if poll not in deaf]
    hits, asked = sum(poll.count(ending) for poll in deaf), sum(poll.asked for poll in deaf)
    if not deaf or not well:
        return None
    reason = _reason(decided, deaf, well)
    codes = sorted({code for poll in deaf for code in poll.exceptions})
    if ending is Ending.EXCEPTION and (not reason["asked_for"] or codes != [_TOO_MANY] or not _else_alike(deaf, well)):
        return None  # other causes tell refusals by function and address
    lost = cost(evidence, unit, Ending.SILENT) if ending is Ending.SILENT else LostAnswers(hits)
    return Suspicion(
        (unit.unit,),
        _AS_ASKED * surplus_bits(hits, asked, _BACKGROUND) + decided.bits,
        frozenset({(symptom, unit.unit)}),
        {
            "unit": unit.unit,
            "silent": hits,
            "asked": asked,
            "how": "stayed without a byte" if ending is Ending.SILENT else "were refused",
            "codes": ", ".join(f"{code:02X}" for code in codes),
            "well": sum(poll.count(Ending.OK) for poll in well),
            "well_of": sum(poll.asked for poll in well),
            "others_silent": sum(poll.count(ending) for poll in well),
            **reason,
        },
        since=min(poll.first for poll in deaf) if evidence.ledger.timed else None,
        until=max(poll.last for poll in deaf) if evidence.ledger.timed else None,
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=tuple(unit.examples.get(ending, [])),
    )


def _else_alike(deaf: Sequence[Poll], well: Sequence[Poll]) -> bool:
    """Whether each of these is asked for by a function by which others are answered: the quantity alone differs."""
    functions = {poll.function for poll in well if poll.count(Ending.OK)}
    return all(poll.function in functions for poll in deaf)


def _decided(evidence: Evidence, unit: UnitLedger, symptom: Symptom) -> Contrast | None:
    """The property of requests that decides whether a unit serves them; None where none does, or its answers come late."""
    if not evidence.is_open(symptom, unit.unit):
        return None
    if symptom is Symptom.SILENCE:
        silent = evidence.silent(unit)
        if not unit.answered or silent < _ALWAYS * unit.count(Ending.SILENT) or unit.late > _LATE * silent:
            return None
    best = evidence.best_contrast(symptom, unit.unit)
    decides = best.family is Family.ASKED and best.is_sharp and best.bits >= _SURE_BITS
    return best if decides else None


def _reason(decided: Contrast, deaf: Sequence[Poll], well: Sequence[Poll]) -> Mapping[str, Any]:
    """What the words are filled with, and `reason` for who asks by name."""
    numbers: dict[str, Any] = {
        "reason": _REASONS.get(decided.name, decided.name),
        "asked_for": 0,
        "served": 0,
        "functions": (),
        "areas": (),
    }
    if decided.name in _OVER and decided.over and min(p.quantity for p in deaf) > max(p.quantity for p in well):
        numbers |= {"asked_for": min(p.quantity for p in deaf), "served": max(p.quantity for p in well)}
    elif decided.name == "function":
        numbers["functions"] = tuple(f"{code:02X}" for code in sorted({poll.function for poll in deaf}))
    else:
        numbers["areas"] = areas_of(deaf)
    return numbers


@suspect(
    "unknown-function",
    Severity.WARNING,
    blame="master",
    text="Unit {unit} does not have function {functions}: {refused} of {asked} requests by it got exception 01[; by function "
    "{others} it answers]",
    share="{refused} of {asked} requests by function {functions} to unit {unit}",
    deciding_test="Look in the manual of unit {unit} for the functions that it has",
    remedy="Ask by a function that the unit has: many have 03 and no 04, or 16 and no 06",
    foretold=Foretold({Symptom.REFUSAL: ASKED_FOR}),
)
def unknown_function(evidence: Evidence) -> Iterator[Suspicion]:
    """Exception 01: illegal function."""
    for unit in evidence.units:
        if unit.count(Ending.EXCEPTION) < _LEAST or not evidence.is_open(Symptom.REFUSAL, unit.unit):
            continue
        polls = evidence.polls_of(unit.unit)
        refused = [poll for poll in polls if poll.exceptions[_FUNCTION_UNKNOWN] >= max(_LEAST, _ALWAYS * poll.asked)]
        if not refused:
            continue
        functions = sorted({poll.function for poll in refused})
        hits, asked = sum(p.exceptions[_FUNCTION_UNKNOWN] for p in refused), sum(poll.asked for poll in refused)
        others = sorted({p.function for p in polls if p.count(Ending.OK) and p.function not in functions})
        yield Suspicion(
            (unit.unit,),
            1.2 * surplus_bits(hits, asked, _BACKGROUND),
            frozenset({(Symptom.REFUSAL, unit.unit)}),
            {
                "unit": unit.unit,
                "functions": tuple(f"{code:02X}" for code in functions),
                "refused": hits,
                "asked": asked,
                "others": tuple(f"{code:02X}" for code in others),
                "reason": "function",
            },
            since=min(poll.first for poll in refused) if evidence.ledger.timed else None,
            until=max(poll.last for poll in refused) if evidence.ledger.timed else None,
            lost_answers=hits,
            frames=tuple(unit.examples.get(Ending.EXCEPTION, [])),
        )


@suspect(
    "rest-too-short",
    Severity.WARNING,
    blame="master",
    text="More rest is due before requests to {units:unit|units} than the client leaves: {silent} of {asked} "
    "requests behind less than {rest:ms} of silence stayed without a byte, {rested_silent} of {rested} behind more",
    share="{silent} of {asked} requests behind less than {rest:ms}, {rested_silent} of {rested} behind more",
    deciding_test="Let the client pause for twice as long before it asks {units:unit|units}: the silences must go",
    remedy="Set the client's delay between polls to more than {rest:ms}; the specification asks for 3.5 characters only, some "
    "devices need tens of milliseconds",
    foretold=Foretold({Symptom.SILENCE: frozenset(("rest",))}),
)
def rest_too_short(evidence: Evidence) -> Iterator[Suspicion]:
    """Silence that hangs on the rest before the request."""
    found = []
    for unit in evidence.units:
        best = evidence.best_contrast(Symptom.SILENCE, unit.unit)
        told = best.name == "rest" and not best.over and best.bits >= _SURE_BITS
        if told and evidence.silent(unit) and best.then.rate > 0.5 > 0.1 > best.otherwise.rate:
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
            "rest": max(best.spared for _, best in found) / 1e6,
        },
        since=min(unit.first for unit, _ in found) if evidence.ledger.timed else None,
        until=max(unit.last for unit, _ in found) if evidence.ledger.timed else None,
        lost_answers=sum(evidence.silent(unit) for unit, _ in found),
        frames=tuple(i for unit, _ in found for i in unit.examples.get(Ending.SILENT, []))[:6],
    )
