"""What masters and the ways to them do wrong: two of them, broadcasts, too much, pieces."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from ...tables.findings import Severity
from ..bits import likelihood_bits, surplus_bits
from ..costs import LostAnswers, cost, cost_of, kind_bits, kind_of, overlaid, share_of, together, twice
from ..evidence import HEALTHY, Evidence
from ..exchanges import Ending
from ..hits import (
    answers_too_many,
    by_another,
    evenness_bits,
    given_up_by_timer,
    interrupted,
    is_about_one,
    is_one_units,
    late_of_any,
    requests_evenness_bits,
    requests_part,
    timed_by_the_master,
)
from ..hittimes import spells_of_hits
from ..registry import OF_A_LINE, Explained, Suspicion, Symptom, suspect
from ..repeats import CalledBack, broadcasts_answered, called_back
from ..signatures import Behind, Signature
from ..unitledger import UnitLedger

_LEAST: Final = 5
_MET: Final = 3  # times, that two are seen to send at once or to know nothing of each other
_MANY: Final = 10  # second answers of a unit,
_SOME: Final = 0.05  # of its requests
_UNLIKE_BITS: Final = 100.0  # by which the damage of some units is theirs: another master meets all alike
_SENT_INTO: Final = 0.15  # of damaged answers
_CROSSED: Final = 0.4  # of what is hit
_HASTY: Final = 0.35  # of the timeout: nobody gives up so soon
_CUT_SHORT_BITS: Final = 4.0
_AT_ONCE: Final = 0.1  # the same, by which times may be wrong
_COLLIDED: Final = {"crossed": 0.27, "cut": 0.17, "cut-short": 0.15, "whole": 0.22, "long": 0.07, "other": 0.03,
                    "middle": 0.03, "tail": 0.02, "head": 0.02, "ahead": 0.06, "bits": 0.01}  # fmt: skip
_RUN_INTO: Final = ("crossed", "cut", "cut-short")  # as a request that is sent into an answer leaves it
_ON_FRAMES: Final = 0.93  # of what collides
_MOSTLY: Final = 0.5
_NEARLY_ALL: Final = 0.8
_ALONE_BITS: Final = 12.0
_SEVERAL: Final = 4  # units: of fewer another master may well ask one alone
_OFTEN: Final = 0.3
_STORM: Final = 30  # broadcasts
_STORM_NS: Final = 60e6
_STORM_LOAD: Final = 0.3  # of the time, that bytes take
_STARVED: Final = 0.02  # of the requests to units
_STORM_PAUSES: Final = 2.5  # times t3.5, on slow lines
_HOLE_CHARS: Final = 1.5
_DISORDER: Final = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.LATENESS, Symptom.SILENCE, Symptom.DOUBLES, Symptom.MARKS,
                    Symptom.VALUES)  # fmt: skip


@suspect(
    "two-masters",
    Severity.ERROR,
    blame="master",
    text="Two clients poll this line without knowing of each other: {crossed} requests came while an answer was due"
    "[, {damaged:answer|answers} {damaged:|is|are} cut or overlaid by one]",
    share="{hits} of {exchanges} exchanges, of {units_hit:unit|units}",
    deciding_test="Look for a second client: a panel, a service computer, a gateway, a program that was left running; "
    "one that controls something is taken off only with the operator's consent",
    remedy="Let one client poll and the other get its values from it, or put a gateway with several clients between",
    foretold=OF_A_LINE,
)
def two_masters(evidence: Evidence) -> Iterator[Suspicion]:
    """Requests while an answer is due, and what collides with them, for all units alike."""
    units = [unit for unit in evidence.units if evidence.is_open(Symptom.DAMAGE, unit.unit)]
    early = {unit.unit: interrupted(evidence, unit) for unit in units}
    misled = sum(unit.strayed + evidence.silent_but_for(unit, Behind.NOISE) for unit in units)
    late = max(late_of_any(evidence) - misled, 0)  # a master that takes noise for an answer goes on before that comes
    by_timer = [unit for unit in units if unit.late and given_up_by_timer(evidence, unit)]
    others = [unit for unit in units if unit not in by_timer]  # what is late of these is not the timer's
    about_one = is_about_one(evidence)
    spread = sum(early.values()) - max(early.values(), default=0) >= _MET or not (about_one or is_one_units(evidence))
    sure = sum(early.values()) >= _MET and spread  # two answers to one unit's requests drive a master on as well
    sure = sure or late - max((unit.late for unit in others), default=0) >= _LEAST
    if not evidence.ordered or broadcasts_answered(evidence) or (about_one and not sure):
        return
    if any(answers_too_many(evidence, unit) for unit in units):
        return  # where it is sure, it need not meet all alike: slow units are met most
    hasty = sum(max(_hasty(evidence, unit), early[unit.unit]) for unit in units)
    late = max(sum(unit.late for unit in others) - misled, 0) if sure else late
    if hasty + late < _MET and sum(unit.late for unit in by_timer) >= _MET:
        return  # a master that gives up too soon runs into answers all alone
    behind = sum(evidence.behind(unit, Behind.REQUEST, Behind.NOISE) for unit in units)
    own = {unit.unit: timed_by_the_master(evidence, unit) for unit in units}  # what its own requests ran into
    damaged = sum(round(evidence.damaged(unit) * (1 - _part(evidence, unit, own[unit.unit]))) for unit in units)
    readings = [each for unit in units for each in evidence.readings(unit) if each not in own[unit.unit]]
    behind_of = {unit.unit: evidence.requests_behind(unit) for unit in units}
    hit = [
        unit for unit in units if evidence.damaged(unit) or unit.late or _hasty(evidence, unit) or behind_of[unit.unit]
    ]
    requests = sum(behind_of.values())
    sent_into = max(
        share_of(readings, "crossed", "cut", "cut-short", "long"), overlaid(readings) / max(len(readings), 1)
    )
    crossed = hasty + late + requests + damaged * sent_into
    hits = min(hasty + late + behind + damaged, evidence.ledger.exchanges)
    unlike = min(evenness_bits(evidence), requests_evenness_bits(evidence)) < -_UNLIKE_BITS
    few = not sure and (len(hit) < min(2, len(units)) or unlike or _twice(evidence) or _is_one_late(evidence))
    if few or crossed < _LEAST or (not sure and crossed < _CROSSED * hits) or not hasty + late + requests:
        return
    met = min(overlaid(readings), sum(kind_of(each) in _RUN_INTO for each in readings))
    if surplus_bits(requests, damaged + requests, requests_part(evidence)) > _UNLIKE_BITS:
        met += evidence.requests_overlaid  # what disturbs a line meets answers as well
    if hasty + late < _MET and met < max(_MET, _SENT_INTO * len(readings)):
        return  # damage alone: one transmitter and a bad line do as well
    bits = surplus_bits(hits, evidence.ledger.exchanges, HEALTHY) + kind_bits(readings, _COLLIDED)
    bits += overlaid(readings) + 2 * (hasty + late) + likelihood_bits(damaged + requests, damaged + behind, _ON_FRAMES)
    bits -= likelihood_bits(damaged + requests, damaged + behind, 0.5)
    bits += evenness_bits(evidence) / 2  # two cycles meet where they do, yet not at one unit only
    spells = spells_of_hits(evidence)[0]
    bits += (
        spells if sure else -spells
    )  # one of them comes later, or goes; of what is not seen two polls go on as they do
    if sure:  # no single master cuts short what it asked, whatever disturbs the line
        bits += _CUT_SHORT_BITS * sum(early.values())
    explains = frozenset((kind, unit.unit) for unit in evidence.units for kind in _DISORDER)
    lost = _lost_to_each_other(evidence, explains)
    yield Suspicion(
        (),
        bits,
        explains,
        {
            "crossed": round(hasty + late + requests),
            "damaged": damaged,
            "hits": round(hits),
            "exchanges": evidence.ledger.exchanges,
            "units_hit": len(hit),
        },
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=tuple(index for unit in hit for index in unit.examples.get(Ending.GARBAGE, []))[:6],
    )


def _lost_to_each_other(evidence: Evidence, explains: Explained) -> LostAnswers:
    """What meets costs each of two masters a request; what one of them sends while the other waits only makes that one's
    answer late."""
    silences = frozenset(each for each in explains if each[0] is Symptom.SILENCE)
    met, silent = twice(evidence, cost_of(evidence, explains - silences)), cost_of(evidence, silences)
    lost = max(silent.answers - sum(unit.late for unit in evidence.units), 0)
    ms = 0.0 if not lost else None if silent.ms is None else silent.ms * lost / silent.answers
    return together((met, LostAnswers(lost, ms)))


def _is_one_late(evidence: Evidence) -> bool:
    """Whether one unit alone stays silent, more than its share, and what is heard in the place of others' answers and
    behind them begins as its answers do: it is late. Two masters leave all units silent."""
    begun = evidence.begun.most_common(1)
    if not begun or len(evidence.units) < _SEVERAL or begun[0][1] < max(_LEAST, _NEARLY_ALL * evidence.begun.total()):
        return False
    late = evidence.ledger.units[begun[0][0]]
    silent, asked = (
        sum(unit.count(Ending.SILENT) for unit in evidence.units),
        sum(unit.asked for unit in evidence.units),
    )
    mine = late.count(Ending.SILENT)
    return mine >= _NEARLY_ALL * silent and surplus_bits(mine, silent, late.asked / asked) >= _ALONE_BITS


def _twice(evidence: Evidence) -> bool:
    """Whether some units often answer one request twice, and rightly, for which no second master is needed."""
    return any(
        evidence.is_open(Symptom.DOUBLES, unit.unit)
        and max(unit.doubles, evidence.behind(unit, Behind.ANSWER), evidence.echoed_again(unit))
        >= max(_MANY, _SOME * unit.asked)
        for unit in evidence.units
    )


def _part(evidence: Evidence, unit: UnitLedger, some: Sequence[Signature]) -> float:
    """The share of a unit's damaged answers that these are."""
    return len(some) / max(len(evidence.readings(unit)), 1)


def _hasty(evidence: Evidence, unit: UnitLedger) -> int:
    """Requests behind which another one came sooner than a master gives up, who waits longer for answers that come."""
    timeout = 0.0 if evidence.timeout_ns is None else max(evidence.timeout_ns, evidence.patience_ns)
    if not timeout or not evidence.is_open(Symptom.SILENCE, unit.unit) or evidence.verdict.wait_ns > _HASTY * timeout:
        return 0
    waits = unit.quiet_waits.numbers  # what a master hears, though it is another answer, ends its waiting
    if not len(waits) or (evidence.verdict.wait_ns > _AT_ONCE * timeout and (waits <= 0).mean() > _OFTEN):
        return 0  # a tap that passes several requests on at once tells nothing of their waits
    hasty = float((waits < _HASTY * timeout).mean()) * by_another(evidence, unit, _HASTY * timeout)
    return round(len(unit.quiet_waits) * hasty)


@suspect(
    "broadcast-answered",
    Severity.ERROR,
    blame="unit",
    text="Broadcasts are answered[: bytes follow {answered} of {broadcasts} requests to unit 0 within the time of an "
    "answer]"
    "[; {met} of {met_of} exchanges right behind broadcasts are hit by what answers them]",
    share="{calls} of {broadcasts} broadcasts",
    deciding_test="Look at the address that each unit is set to: one at 0 takes broadcasts for its own. Then, with the "
    "operator's consent, disconnect units one by one while the broadcasts go on",
    remedy="Give the device that takes 0 for its own an address from 1 to 247, or update its firmware",
)
def broadcast_answered(evidence: Evidence) -> Iterator[Suspicion]:
    """Bytes behind broadcasts, or what is sent soon behind them hit and little else."""
    ledger = evidence.ledger
    answered, back = ledger.broadcasts_answered, called_back(evidence)
    calls = max(answered, min(back.met, ledger.broadcasts))
    if calls < 3 or not evidence.is_open(Symptom.REQUESTS, 0):
        return
    noisy = sum(evidence.behind(unit, Behind.NOISE) for unit in evidence.units)
    background = max(0.02, 2 * (noisy + 0.5) / (sum(unit.asked for unit in evidence.units) + 50))
    yield Suspicion(
        tuple(sorted(unit.unit for unit in ledger.units.values() if unit.called)),
        surplus_bits(answered, ledger.broadcasts, background) * 1.1 + back.bits,
        frozenset({(Symptom.REQUESTS, 0)} | (_run_into(evidence, back) if broadcasts_answered(evidence) else set())),
        {
            "answered": answered,
            "calls": calls,
            "broadcasts": ledger.broadcasts,
            "met": back.met,
            "met_of": back.met_of,
        },
        frames=tuple(ledger.called_examples),
    )


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
    text="Broadcasts leave no time for anything else: {broadcasts} of {requests} requests go to unit 0, {pause:ms} "
    "apart",
    share="{broadcasts} of {requests} requests",
    deciding_test="Count the broadcasts here against what the client is set to send; ask the operator before anything "
    "that sends them is stopped",
    remedy="Broadcast on change instead of continuously, and leave 100 to 200 ms after each",
)
def broadcast_storm(evidence: Evidence) -> Iterator[Suspicion]:
    """Broadcasts without turnaround, most of all requests."""
    ledger = evidence.ledger
    share = ledger.broadcasts / max(ledger.exchanges, 1)
    if ledger.broadcasts < _STORM or share < _MOSTLY or ledger.broadcast_runs < 0.4 * ledger.broadcasts:
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
    share="{broken} of {answers} answers[ of {units:unit|units}][, {others_broken} of {others_answers} of others]",
    deciding_test="Tap the line on the far side of the converter: there the answers must be in one piece",
    remedy="Give clients and gateways on the way a longer silence that ends a frame (t3.5 of 50 ms), or a converter "
    "that "
    "knows Modbus and passes frames on whole",
)
def converter_gaps(evidence: Evidence) -> Iterator[Suspicion]:
    """Holes inside the frames of some units."""
    ledger, verdict = evidence.ledger, evidence.verdict
    if not ledger.line.baud or not ledger.timed:
        return
    least = max(
        _HOLE_CHARS * ledger.char_ns,
        (1.5 if verdict.fine else 4.0) * (verdict.jitter_ns if verdict.fine else verdict.wait_ns),
    )
    if not np.isfinite(least):
        return
    shares = [(unit.holes.above(least), unit) for unit in evidence.units if len(unit.holes) >= _LEAST]
    behind = sorted([pair for pair in shares if pair[0] > 0.1], key=lambda pair: -pair[0])
    others = [pair for pair in shares if pair[0] <= 0.1]
    broken = sum(share * len(unit.holes) for share, unit in behind)
    if broken < _LEAST:
        return
    holes = np.concatenate([unit.holes.numbers[unit.holes.numbers > least] for _, unit in behind])
    places = sum((unit.hole_places for _, unit in behind), start=type(behind[0][1].hole_places)())
    if not verdict.fine and not others and not _piece(places):
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


def _piece(places: dict[int, int]) -> int:
    """The size of which most places of holes are multiples; 0 for none."""
    total = sum(places.values())
    for size in (256, 128, 64, 62, 48, 32, 31, 24, 20, 16, 14, 12, 10, 8):
        if total and sum(count for place, count in places.items() if place % size == 0) >= 0.7 * total:
            return size
    return 0
