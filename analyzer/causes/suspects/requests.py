"""What is asked decides: requests that a unit never serves, while it serves others."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

from ...requests.got import Got
from ...requests.reasons import Unserved
from ...tables.findings import Severity
from ..bits import surplus_bits
from ..costs import cost
from ..evidence import Evidence
from ..exchanges import Ending
from ..registry import ASKED_FOR, Foretold, Suspicion, Symptom, suspect
from ..unitledger import UnitLedger
from ..unserved import SHOWN, asks, spaced, unserved_of
from .common import examples

_BACKGROUND: Final = 0.02
_OF_REFUSALS: Final = ("address", "range-end")  # reasons that have a cause of their own where the unit refuses
_NAMED: Final = 4  # addresses or functions in a sentence
_FAILED: Final = (Ending.SILENT, Ending.EXCEPTION, Ending.GARBAGE)


@suspect(
    "cannot-serve",
    Severity.ERROR,
    blame="master",
    text="Unit {unit} cannot serve some of the client's requests[: it does not have function {lacks}][: it does not "
    "answer "
    "function {other_for} there, ask by function {by}][: it answers for up to {most} at once, and the client asks for "
    "{quantities}][: it answers in frames of up to {longest} bytes, and these need up to {needed}][: the client sends "
    "register numbers {numbers} as addresses][: the quantities {counted} are counts of bytes][: it does not have "
    "{places}]"
    "[: its registers end inside {ranges}][; of {asked:,} such requests {silent:,} got no byte back][; of {asked:,} such "
    "requests {refused:,} were refused (exception {codes})][; of {asked:,} answers {halved:,} had half the bytes]",
    share="{failed:,} of {asked:,} such requests to unit {unit}[, {others_failed:,} of {others:,} others]",
    deciding_test="[Ask unit {unit} once by hand, this only reads: {reads}][Compare with the manual of unit {unit} "
    "first, "
    "this writes: {writes}]",
    remedy="Correct this entry in the client's list using the manual of unit {unit}[; ask instead: {asks}][ and {more} "
    "more]",
    foretold=Foretold({Symptom.SILENCE: ASKED_FOR, Symptom.REFUSAL: ASKED_FOR}),
)
def cannot_serve(evidence: Evidence) -> Iterator[Suspicion]:
    """Silence, refusal or half an answer that hangs on what is asked, of a unit that is there."""
    for unit in evidence.units:
        for silent, symptom in ((True, Symptom.SILENCE), (False, Symptom.REFUSAL)):
            if not evidence.is_open(symptom, unit.unit) or not unit.count(*_FAILED):
                continue
            found = unserved_of(evidence, unit, silent=silent)
            if found is not None and (silent or found.reason not in _OF_REFUSALS):
                yield _suspicion(evidence, unit, found, symptom)


def _suspicion(evidence: Evidence, unit: UnitLedger, found: Unserved, symptom: Symptom) -> Suspicion:
    numbers = set(found.polls)
    mine = [poll for poll in evidence.polls_of(unit.unit) if poll.number in numbers]
    others = [poll for poll in evidence.polls_of(unit.unit) if poll.number not in numbers]
    halved = Got.HALF in found.got
    ending = Ending.GARBAGE if halved else Ending.SILENT if symptom is Symptom.SILENCE else Ending.EXCEPTION
    failed, asked = sum(poll.count(ending) for poll in mine), sum(poll.asked for poll in mine)
    lost = cost(evidence, unit, ending)
    return Suspicion(
        (unit.unit,),
        surplus_bits(failed, asked, _BACKGROUND) + found.bits,
        frozenset({(Symptom.DAMAGE if halved else symptom, unit.unit)}),
        {
            "unit": unit.unit,
            "failed": failed,
            "asked": asked,
            "silent": failed if ending == Ending.SILENT else 0,
            "refused": failed if ending == Ending.EXCEPTION else 0,
            "halved": failed if halved else 0,
            "codes": ", ".join(
                f"{code:02X}" for code in sorted(found.got) if symptom is Symptom.REFUSAL and code < Got.SILENCE
            ),
            "others": sum(poll.asked for poll in others),
            "others_failed": sum(poll.count(*_FAILED) for poll in others),
            **_why(found),
            **_instead(found),
        },
        since=min((poll.first for poll in mine), default=None),
        until=max((poll.last for poll in mine), default=None),
        lost_answers=failed if ending == Ending.EXCEPTION else min(lost.answers, failed) or failed,
        lost_ms=lost.ms if ending == Ending.SILENT else None,
        frames=examples([unit], ending),
    )


def _instead(found: Unserved) -> Mapping[str, Any]:
    """What to ask instead, and one request to try it by: a read where there is one."""
    reads = [spaced(request) for request in found.ask_instead if request.is_read]
    writes = [spaced(request) for request in found.ask_instead if not request.is_read]
    return {
        **asks(found),
        "reads": tuple(reads[:1]),
        "writes": () if reads else tuple(writes[:1]),
        "more": max(len(found.ask_instead) - SHOWN, 0),
    }


_CLAUSES: Final = (
    *("lacks", "other_for", "by", "most", "quantities", "longest", "needed", "numbers", "counted", "places", "ranges"),
)


def _why(found: Unserved) -> Mapping[str, Any]:
    """What the clause of its reason is filled with; nothing for the others."""
    asked, well = found.requests, found.well
    told: dict[str, Any] = dict.fromkeys(_CLAUSES, ())
    functions = _few({f"{request.function:02d}" for request in asked})
    ranges = _few(request.place for request in asked)
    match found.reason:
        case "function":
            told["lacks"] = functions
        case "read-function" | "write-function":
            told["other_for"] = functions
            told["by"] = _few({f"{request.function:02d}" for request in found.ask_instead})
        case "quantity":
            alike = [r.quantity for r in well if r.is_bits == asked[0].is_bits and r.is_read == asked[0].is_read]
            told["most"] = max(alike, default=asked[0].most)
            told["quantities"] = _few({str(request.quantity) for request in asked})
        case "answer-too-long":
            told["longest"] = max(request.longest_frame for request in well)
            told["needed"] = max(request.longest_frame for request in asked)
        case "register-number":
            told["numbers"] = _few(str(request.address) for request in asked)
        case "counted-in-bytes":
            told["counted"] = _few({str(request.quantity) for request in asked})
        case "address":
            told["places"] = ranges
        case _:
            told["ranges"] = ranges
    return told


def _few(names: Any) -> tuple[str, ...]:
    return tuple(sorted(names, key=lambda name: (len(name), name)))[:_NAMED]
