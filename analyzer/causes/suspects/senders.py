"""What one unit does wrong when it sends: its driver, its settings, its firmware, and what it leaves behind its "
"answers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from statistics import median
from typing import Any, Final

from ...tables.findings import Severity
from ..bits import surplus_bits
from ..costs import cost_of_requests, is_instead_of_request, kind_bits, share_of, together
from ..evidence import Evidence, alone_or_together, usual_rate
from ..heads import begun_before, out_of_step_bits, whole_behind_bits
from ..ledger import STRAY
from ..registry import ASKED_FOR, COMES_AND_GOES, OF_A_LINE, Foretold, Suspicion, Symptom, suspect
from ..signatures import AnswerDamage, Behind, Signature, is_like_request
from ..unitledger import UnitLedger
from .common import damage_suspicion

_LEAST: Final = 3
_MOSTLY: Final = 0.5
Numbers = Callable[[Evidence, UnitLedger, list[Signature]], Mapping[str, Any]]


def damage_suspicions(
    evidence: Evidence,
    expected: Mapping[str, float],
    kinds: tuple[str, ...],
    more: Numbers = lambda *_: {},
    least_share: float = _MOSTLY,
) -> Iterator[Suspicion]:
    """A suspicion for each unit whose answers, and not those of others, are damaged in these ways."""
    for unit in evidence.units:
        readings = evidence.readings(unit)
        if len(readings) < _LEAST or share_of(readings, *kinds) < least_share:
            continue
        bits = evidence.surplus(unit) + kind_bits(readings, expected)
        if bits > 0:
            yield damage_suspicion(evidence, [unit], bits, more(evidence, unit, readings))


SHARE: Final = "{damaged:,} of {answers:,} answers of unit {unit}[, {others_damaged:,} of {others_answers:,} of others]"


_BEFORE_BITS: Final = 4.0
_BEHEADED: Final = {"whole": 0.4, "head": 0.35, "middle": 0.1, "cut": 0.05, "cut-short": 0.05, "long": 0.02}


def _head(_: Evidence, __: UnitLedger, readings: list[Signature]) -> Mapping[str, Any]:
    return {"bytes": median(each.bytes for each in readings if each.damage is AnswerDamage.HEAD)}


@suspect(
    "driver-enabled-late",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} enables its driver too late: the beginning of {damaged:,} of {answers:,} answers is lost or mangled "
    "({bytes:byte|bytes}; what follows is whole)",
    share=SHARE,
    deciding_test="Look for a driver delay or a direction setting in unit {unit} or its converter first; then swap "
    "its drop and a good one: the damage goes with the unit if it is its driver",
    remedy="Lengthen the delay between driver enable and first byte in the unit, or use a converter with automatic "
    "direction; bias resistors do not help, because undriven bits are not sent",
    foretold=OF_A_LINE,
)
def driver_enabled_late(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage at the head of one sender's frames."""
    for found in damage_suspicions(evidence, {"head": 0.85, "whole": 0.06, "middle": 0.03}, ("head",), _head):
        bits = found.bits - _BEFORE_BITS * begun_before(evidence, evidence.ledger.units[found.units[0]])
        if bits > 0:
            yield replace(found, bits=bits)
    for unit in evidence.units:
        readings = evidence.readings(unit)
        if len(readings) >= _LEAST and share_of(readings, "head") < _MOSTLY:
            bits = max(out_of_step_bits(evidence, unit), whole_behind_bits(readings))
            if bits > 0:
                bits += evidence.surplus(unit) + kind_bits(readings, _BEHEADED)
                yield damage_suspicion(evidence, [unit], bits, {"bytes": 1})


def _tail(_: Evidence, __: UnitLedger, readings: list[Signature]) -> Mapping[str, Any]:
    return {"bytes": median(max(each.bytes, 1) for each in readings)}


@suspect(
    "driver-released-early",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} releases its driver too early: the end of {damaged:,} of {answers:,} answers is cut off or filled "
    "with "
    "ones ({bytes:byte|bytes})",
    share=SHARE,
    deciding_test="Look for a driver delay or a direction setting in unit {unit} or its converter first; then swap "
    "its drop and a good one: the damage goes with the unit if it is its driver",
    remedy="Let the unit hold its driver until the last stop bit is out (wait for the transmitter to be empty, not for "
    "its "
    "buffer)",
    foretold=OF_A_LINE,
)
def driver_released_early(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage at the tail of one sender's frames."""
    expected = {"tail": 0.72, "cut-short": 0.15, "bits-tail": 0.08, "middle": 0.02}
    yield from damage_suspicions(evidence, expected, ("tail", "cut-short", "bits-tail"), _tail)


@suspect(
    "crc-convention",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} computes its check value differently ({variant}): {damaged:,} of {answers:,} answers are whole by "
    "that method",
    share=SHARE,
    deciding_test="Compute the check value of one answer by both methods",
    remedy="Update the unit's firmware, or set it to Modbus RTU if it has several protocols",
)
def crc_convention(evidence: Evidence) -> Iterator[Suspicion]:
    """All frames of one unit right by one other check value."""

    def variant(_: Evidence, __: UnitLedger, readings: list[Signature]) -> Mapping[str, Any]:
        names = [each.detail for each in readings if each.damage is AnswerDamage.CONVENTION]
        return {"variant": max(set(names), key=names.count)}

    yield from damage_suspicions(evidence, {"convention": 0.95}, ("convention",), variant)


@suspect(
    "byte-count",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} answers with another byte count than was asked for: {damaged:,} of {answers:,} answers have a "
    "correct check value, and the client cannot use them",
    share=SHARE,
    deciding_test="Compare the byte count of one answer with its length: where they agree, the unit has fewer registers "
    "than are asked of it, or more; where they do not, it counts wrongly",
    remedy="Ask for as many registers as it gives; where it counts wrongly, update its firmware",
)
def byte_count(evidence: Evidence) -> Iterator[Suspicion]:
    """All frames of one unit with a wrong count."""
    yield from damage_suspicions(evidence, {"count": 0.95}, ("count", "other"))


_OFTEN: Final = 0.2
_RARELY: Final = 0.05
_NEARLY: Final = 0.95
_OWN_BITS: Final = 6.0
_SURE_BITS: Final = 40.0
_ALIKE_BITS: Final = 3.0  # an answer behind which stands what stands behind all others


@suspect(
    "driver-held",
    Severity.ERROR,
    blame="unit",
    text="The driver of {units:unit|units} is held into the next request: {spoilt:,} requests that came behind "
    "{answers:,} answers are damaged[, {others_spoilt:,} behind the {others_answers:,} of others]",
    share="{spoilt:,} of {answers:,} requests behind answers of {units:unit|units}[, {others_spoilt:,} of {others_answers:,} "
    "behind others]",
    deciding_test="Look for a hold time or a direction setting in {units:unit|units} or a converter there; with a "
    "pause of 50 ms before each request the damage must go",
    remedy="Shorten the time for which {units:unit|units} (or a converter there) {units:|holds its|hold their} driver "
    "after the last byte",
    foretold=Foretold({Symptom.BEHIND: COMES_AND_GOES | ASKED_FOR | {"rest", "since-write"}}),
)
def driver_held(evidence: Evidence) -> Iterator[Suspicion]:
    """The request behind that unit's answers is damaged; of several units, where others' are well."""
    totals = {
        unit.unit: max(evidence.behind(unit, Behind.REQUEST, Behind.NOISE) - evidence.tails(unit), 0.0)
        for unit in evidence.units
    }
    twice = {
        u.unit for u in evidence.units if evidence.behind(u, Behind.ANSWER) >= max(_LEAST, _half_heard(evidence, u))
    }
    totals |= dict.fromkeys(twice, 0.0)  # a driver that is held answers once, but whom it drowns may hear its request
    held = [unit for unit in evidence.units if totals[unit.unit] >= max(_LEAST, _OFTEN * unit.answered)]
    well = [unit for unit in evidence.units if totals[unit.unit] <= _RARELY * unit.answered]
    sharing = held if len(held) < len(well) and len(held) + len(well) == len(evidence.units) else []
    for units in alone_or_together(evidence.units, sharing):
        found = _held(evidence, units, totals)
        if found is not None:
            yield found


def _half_heard(evidence: Evidence, unit: UnitLedger) -> float:
    return _MOSTLY * evidence.behind(unit, Behind.REQUEST, Behind.NOISE)


def _held(evidence: Evidence, units: list[UnitLedger], totals: Mapping[int, float]) -> Suspicion | None:
    spoilt = sum(totals[unit.unit] for unit in units)
    requests = sum(evidence.behind(unit, Behind.REQUEST) for unit in units)
    others = evidence.others(*units)
    others_spoilt, others_answered = sum(totals[o.unit] for o in others), sum(o.answered for o in others)
    few = others_spoilt <= _RARELY * others_answered
    if few and all(_always_spoilt(evidence, unit, totals[unit.unit]) for unit in units):
        requests = max(requests, 0.5 * spoilt)  # so damaged that they are not known again
    if requests < _LEAST or requests < 0.3 * spoilt or _begin_well(evidence, units) > _MOSTLY * spoilt:
        return None
    background = usual_rate(others_spoilt, others_answered)
    bits = sum(surplus_bits(totals[unit.unit], max(unit.answered, 1), background) for unit in units)
    if bits < _OWN_BITS:
        return None  # requests behind all units' answers are damaged alike
    units = sorted(units, key=lambda unit: -totals[unit.unit] / max(unit.answered, 1))
    lost = together(cost_of_requests(evidence, unit) for unit in units)
    samples = [sample for unit in units for sample in unit.followed.kept]
    times = sorted(sample.t_asked for sample in samples)
    return Suspicion(
        tuple(unit.unit for unit in units),
        bits + requests,
        frozenset((Symptom.BEHIND, unit.unit) for unit in units),
        {
            "units": tuple(unit.unit for unit in units),
            "spoilt": round(spoilt),
            "answers": sum(unit.answered for unit in units),
            "others_spoilt": round(others_spoilt),
            "others_answers": others_answered,
        },
        since=times[0],
        until=times[-1],
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=tuple(sample.index for sample in samples[:3]),
    )


def _begin_well(evidence: Evidence, units: list[UnitLedger]) -> float:
    """About how many requests behind answers begin as they should: a driver that is held meets their beginning."""

    def is_so(each: Signature) -> bool:
        return is_like_request(each) and evidence.requests.begin(each.heard, 0)

    return sum(evidence.about(unit, is_so) for unit in units)


def _always_spoilt(evidence: Evidence, unit: UnitLedger, spoilt: float) -> bool:
    """Whether noise of more than a spike's bytes, or for a request's time, stands behind many good answers of a unit,
    which are well themselves, and no request does."""
    damaged, readings = evidence.damaged(unit), evidence.followed(unit)
    instead = sum(is_instead_of_request(evidence, *pair) for pair in zip(unit.followed.kept, readings, strict=False))
    long = max(sum(reading.length > STRAY for reading in readings), instead)
    return (
        spoilt >= _OFTEN * unit.answered
        and spoilt >= _LEAST
        and long >= _MOSTLY * len(readings)
        and damaged <= _RARELY * unit.asked
    )


@suspect(
    "null-suffix",
    Severity.WARNING,
    blame="unit",
    text="Zeros follow the frames of {units:unit|units}: behind {zeros:,} of {answers:,} answers {length:|comes|come} "
    "{length:byte|bytes} 00",
    share="{zeros:,} of {answers:,} answers of {units:unit|units}[, {others_zeros:,} of {others_answers:,} of others]",
    deciding_test="Record right at the terminals of {units:unit|units}: the extra bytes must be there, too, and "
    "behind no other unit's answers",
    remedy="Update the unit's firmware, or release its driver sooner after the last byte; clients that wait for a "
    "silence "
    "treat such frames as damaged",
)
def null_suffix(evidence: Evidence) -> Iterator[Suspicion]:
    """A zero right behind nearly every frame of one sender, or behind many and nothing else behind any."""
    totals = {unit.unit: evidence.behind(unit, Behind.ZEROS) for unit in evidence.units}
    found = _with_zeros(evidence, totals)
    if not found:
        return
    first, others = found[0], evidence.others(*found)
    others_zeros, others_answered = sum(totals[o.unit] for o in others), sum(o.answered for o in others)
    background = usual_rate(others_zeros, others_answered)
    bits = sum(surplus_bits(totals[unit.unit], unit.answered, background) for unit in found)
    bits += sum(_ALIKE_BITS * totals[u.unit] for u in found if _is_always_so(evidence, u, totals[u.unit]))
    if totals[first.unit] < _OFTEN * first.answered and bits < _SURE_BITS:
        return
    yield Suspicion(
        tuple(unit.unit for unit in found),
        bits,
        frozenset((Symptom.BEHIND, unit.unit) for unit in found),
        {
            "units": tuple(unit.unit for unit in found),
            "zeros": round(sum(totals[unit.unit] for unit in found)),
            "length": _usual_zeros(evidence, found),
            "answers": sum(unit.answered for unit in found),
            "others_zeros": round(others_zeros),
            "others_answers": others_answered,
        },
        since=first.followed.kept[0].t_asked,
        until=first.followed.kept[-1].t_asked,
        frames=tuple(sample.index for sample in first.followed.kept[:3]),
    )


def _with_zeros(evidence: Evidence, totals: Mapping[int, float]) -> list[UnitLedger]:
    """Units with zeros behind most of their answers, or the only one with anything behind them, nearly always zeros; the
    surest first. Noise on the idle line comes behind all, and is not always a zero."""
    found = [u for u in evidence.units if totals[u.unit] >= max(_LEAST, _MOSTLY * u.answered)]
    every = [u for u in evidence.units if u.behind]
    if not found and len(every) == 1 and totals[every[0].unit] >= max(_LEAST, _NEARLY * every[0].behind):
        found = every
    return sorted(found, key=lambda unit: -totals[unit.unit] / unit.answered)


def _is_always_so(evidence: Evidence, unit: UnitLedger, zeros: float) -> bool:
    """Whether the same zeros stand behind nearly all answers: a line that floats picks up now this, now that."""
    lengths = Counter(each.length for each in evidence.followed(unit))
    return zeros >= _NEARLY * unit.answered and lengths.most_common(1)[0][1] >= _NEARLY * lengths.total()


def _usual_zeros(evidence: Evidence, units: Sequence[UnitLedger]) -> int:
    """How many zeros mostly stand there."""
    lengths = Counter(each.length for unit in units for each in evidence.followed(unit) if each.behind is Behind.ZEROS)
    return max(lengths.most_common(1)[0][0], 1)
