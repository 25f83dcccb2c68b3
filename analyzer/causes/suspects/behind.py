"""What one unit leaves behind its answers: a driver that is held, a zero."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np

from ...tables.findings import Severity
from ...tables.transactions import NEVER
from ..bits import surplus_bits
from ..costs import cost_of_requests, together
from ..evidence import HEALTHY, Evidence
from ..grouping import alone_or_together
from ..ledger import STRAY
from ..registry import Suspicion, Symptom, suspect
from ..signatures import Behind
from ..unitledger import UnitLedger

_LEAST: Final = 3
_MOSTLY: Final = 0.5
_OFTEN: Final = 0.2
_RARELY: Final = 0.05
_TWICE: Final = 0.02  # of its answers
_NEARLY: Final = 0.95
_OWN_BITS: Final = 6.0
_SURE_BITS: Final = 40.0
_DUE: Final = 1.5  # times the usual pause,
_REQUEST_CHARS: Final = 8
_FAR: Final = 4.0  # times it


@suspect(
    "driver-held",
    Severity.ERROR,
    blame="unit",
    text="The driver of {units:unit|units} is held into the next request: {spoilt} requests that came behind "
    "{answers} answers are damaged[, {others_spoilt} behind the {others_answers} of others]",
    share="{spoilt} of {answers} requests behind answers of {units:unit|units}[, {others_spoilt} of {others_answers} behind others]",
    deciding_test="Let the client pause for 50 ms before each request: if the damage goes, a driver was held too long",
    remedy="Shorten the time for which {units:unit|units} (or a converter there) {units:|holds its|hold their} driver behind "
    "the last byte",
)
def driver_held(evidence: Evidence) -> Iterator[Suspicion]:
    """The request behind that unit's answers is damaged; of several units, where others' are well."""
    totals = {
        unit.unit: max(evidence.behind(unit, Behind.REQUEST, Behind.NOISE) - evidence.tails(unit), 0.0)
        for unit in evidence.units
    }
    twice = {u.unit for u in evidence.units if evidence.behind(u, Behind.ANSWER) >= max(_LEAST, _TWICE * u.answered)}
    totals |= dict.fromkeys(twice, 0.0)  # a driver that is held answers once
    held = [unit for unit in evidence.units if totals[unit.unit] >= max(_LEAST, _OFTEN * unit.answered)]
    well = [unit for unit in evidence.units if totals[unit.unit] <= _RARELY * unit.answered]
    sharing = held if len(held) < len(well) and len(held) + len(well) == len(evidence.units) else []
    for units in alone_or_together(evidence.units, sharing):
        found = _held(evidence, units, totals)
        if found is not None:
            yield found


def _held(evidence: Evidence, units: list[UnitLedger], totals: Mapping[int, float]) -> Suspicion | None:
    spoilt = sum(totals[unit.unit] for unit in units)
    requests = sum(evidence.behind(unit, Behind.REQUEST) for unit in units)
    others = [other for other in evidence.units if other not in units]
    others_spoilt, others_answered = sum(totals[o.unit] for o in others), sum(o.answered for o in others)
    few = others_spoilt <= _RARELY * others_answered
    if few and all(_always_spoilt(evidence, unit, totals[unit.unit]) for unit in units):
        requests = max(requests, 0.5 * spoilt)  # so damaged that they are not known again
    if requests < _LEAST or requests < 0.3 * spoilt:
        return None
    background = max(HEALTHY, (others_spoilt + 0.5) / (others_answered + 50))
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


def _always_spoilt(evidence: Evidence, unit: UnitLedger, spoilt: float) -> bool:
    """Whether noise of more than a spike's bytes, or for a request's time, stands behind many good answers of a unit,
    which are well themselves, and no request does."""
    damaged, readings = evidence.damaged(unit), evidence.followed(unit)
    long = max(sum(reading.length > STRAY for reading in readings), _instead_of_requests(evidence, unit))
    return (
        spoilt >= _OFTEN * unit.answered
        and spoilt >= _LEAST
        and long >= _MOSTLY * len(readings)
        and damaged <= _RARELY * unit.asked
    )


def _instead_of_requests(evidence: Evidence, unit: UnitLedger) -> int:
    """How often bytes stand behind a unit's good answers when the next request is due, and the next one comes far later
    than the master pauses: it waits for an answer to what was sent there."""
    off, usual = evidence.verdict.wait_ns, evidence.ledger.pauses.quantile(0.5)
    if usual is None or not np.isfinite(off) or not evidence.is_open(Symptom.BEHIND, unit.unit):
        return 0
    due = _DUE * usual + _REQUEST_CHARS * evidence.ledger.char_ns + off
    far = _FAR * (usual + off)
    pairs = zip(unit.followed.kept, evidence.followed(unit), strict=True)
    return sum(
        0 <= each.rested <= due and sample.t_next != NEVER and sample.t_next - each.t_behind > far
        for sample, each in pairs
    )


@suspect(
    "null-suffix",
    Severity.WARNING,
    blame="unit",
    text="A 00 follows the frames of {units:unit|units}: {zeros} of {answers} answers have one",
    share="{zeros} of {answers} answers of {units:unit|units}[, {others_zeros} of {others_answers} of others]",
    deciding_test="Take {units:unit|units} off the bus: the extra bytes go with {units:|it|them}",
    remedy="Update the unit's firmware, or let its driver go sooner behind the last byte; clients that wait for a silence "
    "take such frames for damaged",
)
def null_suffix(evidence: Evidence) -> Iterator[Suspicion]:
    """A zero right behind nearly every frame of one sender, or behind many and nothing else behind any."""
    totals = {unit.unit: evidence.behind(unit, Behind.ZEROS) for unit in evidence.units}
    found = [u for u in evidence.units if totals[u.unit] >= _LEAST and totals[u.unit] >= _MOSTLY * u.answered]
    if not found:  # noise on the idle line comes behind all, and is not always a zero
        every = [u for u in evidence.units if u.behind]
        found = [u for u in every if len(every) == 1 and totals[u.unit] >= max(_LEAST, _NEARLY * u.behind)]
    if not found:
        return
    found.sort(key=lambda unit: -totals[unit.unit] / unit.answered)
    first, others = found[0], [unit for unit in evidence.units if unit not in found]
    others_zeros, others_answered = sum(totals[o.unit] for o in others), sum(o.answered for o in others)
    background = max(HEALTHY, (others_zeros + 0.5) / (others_answered + 50))
    bits = sum(surplus_bits(totals[unit.unit], unit.answered, background) for unit in found)
    if totals[first.unit] < _OFTEN * first.answered and bits < _SURE_BITS:
        return
    yield Suspicion(
        tuple(unit.unit for unit in found),
        bits,
        frozenset((Symptom.BEHIND, unit.unit) for unit in found),
        {
            "units": tuple(unit.unit for unit in found),
            "zeros": round(sum(totals[unit.unit] for unit in found)),
            "answers": sum(unit.answered for unit in found),
            "others_zeros": round(others_zeros),
            "others_answers": others_answered,
        },
        since=first.followed.kept[0].t_asked,
        until=first.followed.kept[-1].t_asked,
        frames=tuple(sample.index for sample in first.followed.kept[:3]),
    )
