"""What one unit does wrong when it sends: its driver, its settings, its firmware."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from math import log2
from statistics import median
from typing import Any, Final

from dissectors.crc import crc16

from ...tables.findings import Severity
from ..bits import surplus_bits
from ..evidence import HEALTHY, Evidence, kind_bits, share_of
from ..exchanges import Ending
from ..hits import answers_too_many
from ..misreading import beheaded, formats_of
from ..registry import Suspicion, Symptom, suspect
from ..signatures import AnswerDamage, Behind, Signature, known_header
from ..unitledger import UnitLedger

_LEAST: Final = 3
_MOSTLY: Final = 0.5
_OFTEN: Final = 0.2
_TWO_RIGHT: Final = 0.001  # of requests: no noise makes a second answer whose check value is right
_SHORT: Final = 0.8  # of what is due: two answers that overlap are no shorter than one,
_SHORT_BITS: Final = 2.0  # but where the receiver falls out of step

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
            yield damage_suspicion(evidence, unit, bits, more(evidence, unit, readings))


def damage_suspicion(evidence: Evidence, unit: UnitLedger, bits: float, more: Mapping[str, Any]) -> Suspicion:
    """The damaged answers of one unit."""
    others = [other for other in evidence.units if other.unit != unit.unit]
    lost, lost_ms = evidence.cost(unit, Ending.GARBAGE)
    return Suspicion(
        (unit.unit,),
        bits,
        frozenset((kind, unit.unit) for kind in (Symptom.DAMAGE, Symptom.MARKS, Symptom.BEHIND)),
        {
            "unit": unit.unit,
            "damaged": unit.count(Ending.GARBAGE),
            "answers": unit.answered + unit.count(Ending.GARBAGE),
            "others_damaged": sum(other.count(Ending.GARBAGE) for other in others),
            "others_answers": sum(other.answered + other.count(Ending.GARBAGE) for other in others),
            **more,
        },
        since=unit.samples.kept[0].t_asked if evidence.ledger.timed and unit.samples.kept else None,
        until=unit.samples.kept[-1].t_asked if evidence.ledger.timed and unit.samples.kept else None,
        lost_answers=lost,
        lost_ms=lost_ms,
        frames=tuple(unit.examples.get(Ending.GARBAGE, [])),
    )


_SHARE: Final = "{damaged} of {answers} answers of unit {unit}[, {others_damaged} of {others_answers} of others]"


_BYTE: Final = 8.0
_CHECKED: Final = 16.0
_RUN_INTO_BITS: Final = 20.0
_BEGINNING: Final = 3  # bytes of garbage that count
_FEWER: Final = 0.6
_CHARACTER_BITS: Final = 12
_BEFORE_BITS: Final = 4.0
_LOST_BITS: Final = 24  # more than two characters
_SPREAD: Final = (0.88, 1.12)  # of the delay, from answer to answer
_MISSED: Final = 2.0  # bits against it, where garbage begins otherwise
_BEHEADED: Final = {"whole": 0.4, "head": 0.35, "middle": 0.1, "cut": 0.05, "cut-short": 0.05, "long": 0.02}


def _head(_: Evidence, __: UnitLedger, readings: list[Signature]) -> Mapping[str, Any]:
    return {"bytes": median(each.bytes for each in readings if each.damage is AnswerDamage.HEAD)}


@suspect(
    "driver-enabled-late",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} enables its driver too late: the beginning of {damaged} of {answers} answers is lost or mangled "
    "({bytes:byte|bytes}; what follows is whole)",
    share=_SHARE,
    deciding_test="Swap the drops of unit {unit} and a good one: the damage goes with the unit if it is its driver",
    remedy="Lengthen the delay between driver enable and first byte in the unit, or use a converter with automatic "
    "direction; bias resistors hide a delay of less than a character",
)
def driver_enabled_late(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage at the head of one sender's frames."""
    for found in damage_suspicions(evidence, {"head": 0.85, "whole": 0.06, "middle": 0.03}, ("head",), _head):
        bits = found.bits - _BEFORE_BITS * _begun_before(evidence, evidence.ledger.units[found.units[0]])
        if bits > 0:
            yield replace(found, bits=bits)
    for unit in evidence.units:
        readings = evidence.readings(unit)
        if len(readings) >= _LEAST and share_of(readings, "head") < _MOSTLY:
            bits = max(_out_of_step(evidence, unit), _whole_behind(readings))
            if bits > 0:
                bits += evidence.surplus(unit) + kind_bits(readings, _BEHEADED)
                yield damage_suspicion(evidence, unit, bits, {"bytes": 1})


def _begun_before(evidence: Evidence, unit: UnitLedger) -> int:
    """How many damaged answers have their first byte as if it had begun some bits too soon, and all their bytes: another
    transmitter's start was heard before. A driver that is late begins none sooner."""
    found = 0
    for each in evidence.readings(unit):
        header = known_header(each.request)
        if len(header) < 2 or len(each.heard) < 2:
            continue
        first = each.heard[0]
        if each.length == each.due and first != header[0] and each.heard[1:2] == header[1:2]:
            sooner = any(first >> bits == header[0] & 0xFF >> bits for bits in range(1, 8))
            found += sooner and not any(
                beheaded(header, lost, receiver).startswith(each.heard[:1])
                for receiver in formats_of(evidence.ledger.line)
                for lost in range(1, _CHARACTER_BITS)
            )
    return found


def beginnings(readings: Sequence[Signature], most: int) -> dict[bytes, Counter[bytes]]:
    """How often each beginning of so many bytes was heard, by the header that was to be sent."""
    heard: dict[bytes, Counter[bytes]] = defaultdict(Counter)
    for each in readings:
        heard[known_header(each.request)][each.heard[:most]] += 1
    return heard


def _out_of_step(evidence: Evidence, unit: UnitLedger) -> float:
    """Bits for garbage that begins as a known header does whose first bits are missing, nearly the same number each
    time: its receiver is out of step from there on."""
    readings = evidence.readings(unit)
    if readings and sum(each.length < _FEWER * each.due for each in readings) > _MOSTLY * len(readings):
        return 0.0  # what is out of step is heard a byte a byte
    heard = beginnings(readings, _BEGINNING)
    best = 0.0
    for receiver in formats_of(evidence.ledger.line):
        for lost in range(2, _LOST_BITS):
            reach = range(round(_SPREAD[0] * lost), round(_SPREAD[1] * lost) + 1)
            price = log2(len(reach))
            bits = -_BYTE
            for header, heads in heard.items():
                garbled = {beheaded(header, bits_lost, receiver)[:_BEGINNING] for bits_lost in reach}
                telling = [g for g in garbled if g and not header.startswith(g)]
                for head, count in heads.items():
                    fits = max((len(g) for g in telling if head.startswith(g)), default=0)
                    bits += count * (_BYTE * fits - price if fits else -_MISSED)
            best = max(best, bits)
    return best


def _whole_behind(readings: Sequence[Signature]) -> float:
    """Bits for garbage whose end is whole, though its beginning is not known: two answers to one request, as long and
    not the same, leave the same rest by the check value where all in which they differ is right. A late driver adds no
    byte."""
    alike: dict[tuple[bytes, int], list[bytes]] = defaultdict(list)
    for each in readings:
        if each.length <= each.due and not each.heard.startswith(known_header(each.request)[:1]):
            alike[each.request, each.length].append(each.heard)
    bits = -_BYTE
    for several in alike.values():
        for one, two in pairwise(dict.fromkeys(several)):
            bits += _CHECKED if crc16(one) == crc16(two) else -1
    return bits


def _tail(_: Evidence, __: UnitLedger, readings: list[Signature]) -> Mapping[str, Any]:
    return {"bytes": median(max(each.bytes, 1) for each in readings)}


@suspect(
    "driver-released-early",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} releases its driver too early: the end of {damaged} of {answers} answers is cut off or filled with "
    "ones ({bytes:byte|bytes})",
    share=_SHARE,
    deciding_test="Swap the drops of unit {unit} and a good one: the damage goes with the unit if it is its driver",
    remedy="Let the unit hold its driver until the last stop bit is out (wait for the transmitter to be empty, not for its "
    "buffer)",
)
def driver_released_early(evidence: Evidence) -> Iterator[Suspicion]:
    """AnswerDamage at the tail of one sender's frames."""
    expected = {"tail": 0.72, "cut-short": 0.15, "bits-tail": 0.08, "middle": 0.02}
    yield from damage_suspicions(evidence, expected, ("tail", "cut-short", "bits-tail"), _tail)


@suspect(
    "crc-convention",
    Severity.ERROR,
    blame="unit",
    text="Unit {unit} makes its check value by another convention ({variant}): {damaged} of {answers} answers are whole "
    "by it",
    share=_SHARE,
    deciding_test="Compute the check value of one answer by both conventions",
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
    text="Unit {unit} counts its bytes wrongly: {damaged} of {answers} answers have a right check value and a byte count "
    "that does not fit what was asked",
    share=_SHARE,
    deciding_test="Compare the byte count of one answer with its length",
    remedy="Update the unit's firmware; some clients can be told to pass over the byte count",
)
def byte_count(evidence: Evidence) -> Iterator[Suspicion]:
    """All frames of one unit with a wrong count."""
    for found in damage_suspicions(evidence, {"count": 0.95}, ("count", "other")):
        unread = {(Symptom.LATENESS, found.units[0])}  # right frames of its that answer nothing
        yield replace(found, explains=found.explains | unread)


@suspect(
    "duplicate-address",
    Severity.ERROR,
    blame="unit",
    text="Two devices answer to address {unit}[; {doubles:request|requests} got two answers][; in {damaged:answer|answers} "
    "two transmitters mix][; {tails:answer|answers} {tails:|runs|run} on when {tails:|it is|they are} over]"
    "[; {met:exchange|exchanges} right behind {met:|is|are} hit by a second one]",
    share=_SHARE,
    deciding_test="Take the device with address {unit} off the bus: if the address still answers, there is another one",
    remedy="Give one of the two devices an address of its own",
)
def duplicate_address(evidence: Evidence) -> Iterator[Suspicion]:
    """Overlap, or two answers, for one unit alone."""
    for unit in evidence.units:
        readings, too_many = evidence.readings(unit), answers_too_many(evidence, unit)
        behind = _are_of_others(evidence, _not_next(evidence, unit), len(evidence.followed(unit)))
        if (_are_of_others(evidence, readings, len(readings)) or behind) and not too_many:
            continue  # another unit is still answering when this one is asked
        doubles = unit.doubles if evidence.is_open(Symptom.DOUBLES, unit.unit) else 0
        doubles = max(doubles, round(evidence.behind(unit, Behind.ANSWER)))
        doubles += max(evidence.begun[unit.unit] - unit.count(Ending.SILENT, Ending.GARBAGE), 0)
        crossed = evidence.behind(unit, Behind.REQUEST, Behind.NOISE)
        crossed = round(crossed) if doubles >= _LEAST or (len(readings) >= _LEAST and crossed >= _LEAST) else 0
        if doubles <= 1.2 * evidence.unanswered(unit):
            doubles = 0
        if evidence.verdict.fine and not unit.count(Ending.SILENT):  # one that is late leaves silence before
            doubles += min(unit.unfit, doubles)
            rarely = _TWO_RIGHT
        else:
            rarely = HEALTHY
        tails = round(evidence.tails(unit))
        crossed = max(crossed, tails)
        doubles = max(doubles, too_many)
        rest = [other for other in evidence.units if other is not unit]
        noisy = sum(evidence.behind(other, Behind.REQUEST, Behind.NOISE) for other in rest)
        background = max(HEALTHY, (noisy + 0.5) / (sum(other.answered for other in rest) + 50))
        bits = surplus_bits(min(doubles, unit.asked), unit.asked, rarely)
        bits += surplus_bits(min(crossed, unit.asked), unit.asked, background)
        if len(readings) >= _LEAST:
            kinds = kind_bits(readings, _MIXED)
            if crossed >= _LEAST:  # the weaker one begins first, and may be heard behind the other
                kinds = max(kinds, kind_bits(readings, _OVERTAKEN))
            bits += evidence.surplus(unit) + kinds
            bits += _BEFORE_BITS * _begun_before(evidence, unit) - _SHORT_BITS * _shortened(readings)
        run_into = _run_into(evidence, unit) if doubles >= _LEAST else _answered_again(evidence, unit)
        if bits + sum(run_into.values()) <= 0 or (not run_into and doubles + tails + len(readings) < _LEAST):
            continue
        met = sum(_met(evidence, other, unit)[0] for other in run_into)
        found = damage_suspicion(
            evidence, unit, bits + sum(run_into.values()), {"doubles": doubles, "tails": tails, "met": met}
        )
        explains = found.explains | {(kind, unit.unit) for kind in _ITS_OWN}
        explains |= {(kind, other) for other in run_into for kind in (Symptom.DAMAGE, Symptom.BEHIND)}
        if too_many:  # the master takes one for what it asked next, and so on
            explains |= {(kind, other.unit) for other in evidence.units for kind in _DISORDER}
            disorder = sum(surplus_bits(evidence.damaged(other), other.asked, HEALTHY) for other in rest)
            found = replace(found, bits=found.bits + disorder)
        yield replace(found, explains=explains)


_ITS_OWN: Final = (Symptom.DOUBLES, Symptom.LATENESS, Symptom.VALUES, Symptom.REFUSAL)  # of two devices
_DISORDER: Final = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.LATENESS, Symptom.SILENCE)


def _run_into(evidence: Evidence, unit: UnitLedger) -> Mapping[int, float]:
    """Other units that are hit right behind this one, and seldom else, for a second answer runs into what is asked next:
    by how much likelier that is (bits)."""
    found, successors = {}, evidence.ledger.successors
    for other in evidence.units:
        if other is unit or not evidence.is_open(Symptom.DAMAGE, other.unit):
            continue
        hit, asked = successors.met_of(other.unit), successors.followed_of(other.unit)
        met, followed = _met(evidence, other.unit, unit)
        bits = surplus_bits(met, followed, max(HEALTHY, (hit - met + 0.5) / (asked - followed + 50)))
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


def _met(evidence: Evidence, other: int, unit: UnitLedger) -> tuple[int, int]:
    """How many exchanges of another unit right behind one's were hit, of how many; or two behind, where it is heard there."""
    successors, pair = evidence.ledger.successors, (other, unit.unit)
    if not successors.met[pair] and _is_heard_behind(evidence, evidence.ledger.units[other], unit):
        return successors.near_hit[pair], successors.near[pair]
    return successors.met[pair], successors.followed[pair]


def _is_heard_behind(evidence: Evidence, unit: UnitLedger, other: UnitLedger) -> bool:
    """Whether what stands in the place of a unit's answers, or behind them, begins as another's do."""
    readings = (*evidence.readings(unit), *evidence.followed(unit))
    return sum(evidence.begun_by(each) == other.unit for each in readings) >= _LEAST


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
