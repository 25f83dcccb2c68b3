"""What clients and the ways to them do wrong: broadcasts that are answered or too many, pieces."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from typing import Final

import numpy as np

from ...deframing.tap_clock import UNKNOWN
from ...tables.findings import Severity
from ..bits import surplus_bits
from ..costs import cost, together
from ..evidence import Evidence
from ..exchanges import Ending
from ..registry import Suspicion, Symptom, suspect
from ..repeats import CalledBack, broadcasts_answered, called_back
from ..signatures import Behind
from ..unitledger import UnitLedger

_LEAST: Final = 5
_MOSTLY: Final = 0.5
_OFTEN: Final = 0.3
_STORM: Final = 30  # broadcasts
_STORM_NS: Final = 60e6
_STORM_LOAD: Final = 0.3  # of the time, that bytes take
_STARVED: Final = 0.02  # of the requests to units
_STORM_PAUSES: Final = 2.5  # times t3.5, on slow lines
_HOLE_CHARS: Final = 1.5
_FAR_LONGER: Final = 3.0
_NEARLY_ALL: Final = 0.95
_SOME: Final = 0.25


@suspect(
    "broadcast-answered",
    Severity.ERROR,
    blame="unit",
    text="Broadcasts are answered[: bytes follow {answered:,} of {broadcasts:,} requests to unit 0 within the time of an "
    "answer]"
    "[; {met:,} of {met_of:,} exchanges right behind broadcasts are hit by what answers them]",
    share="{calls:,} of {broadcasts:,} broadcasts",
    deciding_test="Look at the address that each unit is set to: one at 0 takes broadcasts for its own. Then, with the "
    "operator's consent, disconnect units one by one while the broadcasts go on",
    remedy="Give the device that takes 0 for its own an address from 1 to 247, or update its firmware",
)
def broadcast_answered(evidence: Evidence) -> Iterator[Suspicion]:
    """Bytes behind broadcasts, or what is sent soon behind them hit and little else."""
    ledger, echoes = evidence.ledger, _given_back(evidence)
    answered, back = ledger.broadcasts_answered + echoes, called_back(evidence)
    broadcasts = ledger.broadcasts - echoes
    calls = max(answered, min(back.met, broadcasts))
    if calls < 3 or not evidence.is_open(Symptom.REQUESTS, 0):
        return
    noisy = sum(evidence.behind(unit, Behind.NOISE) for unit in evidence.units)
    background = max(0.02, 2 * (noisy + 0.5) / (sum(unit.asked for unit in evidence.units) + 50))
    yield Suspicion(
        tuple(sorted(unit.unit for unit in ledger.units.values() if unit.called)),
        surplus_bits(answered, broadcasts, background) * 1.1 + back.bits,
        frozenset({(Symptom.REQUESTS, 0)} | (_run_into(evidence, back) if broadcasts_answered(evidence) else set())),
        {
            "answered": answered,
            "calls": calls,
            "broadcasts": broadcasts,
            "met": back.met,
            "met_of": back.met_of,
        },
        frames=tuple(ledger.called_examples),
    )


def _given_back(evidence: Evidence) -> int:
    """Broadcasts that come once more sooner than the client ever sends anything: a device gives them back."""
    ledger = evidence.ledger
    soon = (ledger.broadcast_repeats.quantile(0.5) or UNKNOWN) + evidence.verdict.wait_ns
    rested = ledger.pauses.above(soon) >= _NEARLY_ALL and ledger.turnarounds.above(_FAR_LONGER * soon) >= _SOME
    in_pairs = 2 * ledger.broadcasts_again <= ledger.broadcasts + 1 and not ledger.echoing
    return ledger.broadcasts_again * (rested and in_pairs)


def _run_into(evidence: Evidence, back: CalledBack) -> set[tuple[Symptom, int | None]]:
    """What answers to broadcasts do to the exchanges behind them."""
    kinds = (Symptom.DAMAGE, Symptom.SILENCE, Symptom.BEHIND, Symptom.LATENESS)
    found = {
        unit.unit for unit in evidence.units if evidence.damaged(unit) + evidence.silent(unit) < _OFTEN * unit.asked
    }
    return {(kind, unit) for unit in found | back.units for kind in kinds}


@suspect(
    "broadcast-storm",
    Severity.ERROR,
    blame="master",
    text="Broadcasts leave no time for anything else: {broadcasts:,} of {requests:,} requests go to unit 0, {pause:ms} "
    "apart",
    share="{broadcasts:,} of {requests:,} requests",
    deciding_test="Count the broadcasts here against what the client is set to send; ask the operator before anything "
    "that sends them is stopped",
    remedy="Broadcast on change instead of continuously, and leave 100 to 200 ms after each",
)
def broadcast_storm(evidence: Evidence) -> Iterator[Suspicion]:
    """Broadcasts without turnaround, most of all requests."""
    ledger = evidence.ledger
    least = max(_STORM, _MOSTLY * ledger.exchanges)
    if ledger.broadcasts < least or ledger.broadcast_runs < 0.4 * ledger.broadcasts:
        return
    pause = _mean_pause(evidence)
    if pause is None or pause > max(_STORM_NS, _STORM_PAUSES * (evidence.t35_ns or 0.0)):
        return
    if (evidence.load or 1.0) < _STORM_LOAD and not _are_starved(evidence):
        return  # a heartbeat leaves the others all the time that they want
    silent = frozenset((Symptom.SILENCE, unit.unit) for unit in evidence.units)
    lost = together(cost(evidence, unit, Ending.SILENT) for unit in evidence.units)
    yield Suspicion(
        (),
        surplus_bits(ledger.broadcasts, ledger.exchanges, 0.3)
        + sum(surplus_bits(evidence.silent(unit), unit.asked, 0.02) for unit in evidence.units),
        silent | {(Symptom.REQUESTS, 0), (Symptom.REQUESTS, None)},
        {
            "broadcasts": ledger.broadcasts,
            "requests": ledger.exchanges,
            "pause": pause / 1e6,
        },
        lost_answers=lost.answers,
        lost_ms=lost.ms,
    )


def _are_starved(evidence: Evidence) -> bool:
    """Whether units lose answers."""
    silent = sum(map(evidence.silent, evidence.units)) + sum(map(evidence.damaged, evidence.units))
    return silent > _STARVED * sum(unit.asked for unit in evidence.units)


def _mean_pause(evidence: Evidence) -> float | None:
    """The time (ns) in which nothing is sent, by request that is not waited for in vain; None without times.

    A mean that every clock carries: by as much as one pause is shown too short, another is shown too long.
    """
    ledger = evidence.ledger
    if not ledger.span_ns or not ledger.line.baud:
        return None
    waited = sum(unit.waits.total for unit in evidence.units)
    silent = sum(unit.count(Ending.SILENT) for unit in evidence.units)
    rested = ledger.span_ns - ledger.bytes * ledger.char_ns - waited
    return max(rested, 0.0) / max(ledger.exchanges - silent, 1)


@suspect(
    "converter-gaps",
    Severity.WARNING,
    blame="line",
    text="Answers[ of {units:unit|units}] come in pieces[ of {size} bytes] with silences of about {hole:ms} inside: a "
    "radio, modem or converter passes them on so",
    share="{broken:,} of {answers:,} answers[ of {units:unit|units}][, {others_broken:,} of {others_answers:,} of others]",
    deciding_test="Tap the line on the far side of the converter: there the answers must be in one piece",
    remedy="Give clients and gateways on the way a longer silence that ends a frame (t3.5 of 50 ms), or a converter "
    "that "
    "knows Modbus and passes frames on whole",
)
def converter_gaps(evidence: Evidence) -> Iterator[Suspicion]:
    """Holes inside the frames of some units."""
    least, fine = _least_hole(evidence), evidence.verdict.fine
    if not np.isfinite(least):
        return
    shares = [(_broken(evidence, unit, least), unit) for unit in evidence.units if len(unit.holes) >= _LEAST]
    behind = sorted([pair for pair in shares if pair[0] > 0.1], key=lambda pair: -pair[0])
    others = [pair for pair in shares if pair[0] <= 0.1]
    broken = sum(share * len(unit.holes) for share, unit in behind)
    if broken < _LEAST:
        return
    holes = np.concatenate([unit.holes.numbers[unit.holes.numbers > least] for _, unit in behind])
    places = sum((unit.hole_places(least) for _, unit in behind), Counter[int]())
    if not fine and not others and not _piece(places):
        return  # in answers of all, at no place in particular: the tap holds them back
    yield Suspicion(
        tuple(unit.unit for _, unit in behind),
        sum(surplus_bits(share * len(unit.holes), len(unit.holes), 0.02) for share, unit in behind),
        frozenset({(Symptom.TIMING, unit.unit) for _, unit in behind} | {(Symptom.TIMING, None)}),
        {
            "units": tuple(unit.unit for _, unit in behind) if others or len(behind) < 6 else (),
            "hole": float(np.median(holes)) / 1e6,
            "size": _piece(places),
            "broken": round(broken),
            "answers": sum(len(unit.holes) for _, unit in behind),
            "others_broken": round(sum(share * len(unit.holes) for share, unit in others)),
            "others_answers": sum(len(unit.holes) for _, unit in others),
        },
    )


def _broken(evidence: Evidence, unit: UnitLedger, least: float) -> float:
    """The share of a unit's answers that come in pieces; 0 where the client takes few of these: then their rest is late."""
    rows = evidence.rows(unit.unit)
    torn = rows[rows.good & (rows.hole > least)]
    return 0.0 if np.count_nonzero(torn.next_same) > _MOSTLY * len(torn) else unit.holes.above(least)


def _least_hole(evidence: Evidence) -> float:
    """The shortest silence inside a frame that the clock carries (ns); infinite where it carries none."""
    ledger, verdict = evidence.ledger, evidence.verdict
    if not ledger.line.baud or not ledger.timed:
        return UNKNOWN
    wrong = 1.5 * verdict.jitter_ns if verdict.fine else min(4.0 * verdict.wait_ns, 2.0 * evidence.tap_holes_ns)
    return max(_HOLE_CHARS * ledger.char_ns, wrong)


def _piece(places: dict[int, int]) -> int:
    """The size of which most places of holes are multiples; 0 for none."""
    total = sum(places.values())
    for size in (256, 128, 64, 62, 48, 32, 31, 24, 20, 16, 14, 12, 10, 8):
        if total and sum(count for place, count in places.items() if place % size == 0) >= 0.7 * total:
            return size
    return 0
