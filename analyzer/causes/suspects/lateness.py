"""Answers that come when the master has given up."""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...diagnosis.tap_clock import UNKNOWN
from ...tables.findings import Severity
from ..bits import likelihood_bits, surplus_bits
from ..evidence import HEALTHY, Evidence, kind_bits, kind_of
from ..exchanges import Ending
from ..hits import interrupted, timed_by_the_master
from ..registry import Suspicion, Symptom, suspect
from ..signatures import AnswerDamage, Signature
from ..unitledger import UnitLedger

_LEAST: Final = 3
_BACKGROUND: Final = 0.003
_MOSTLY: Final = 0.6  # of all late answers
_SURE_BITS: Final = 16.0
_RUN_INTO_BITS: Final = 30.0
_CONTRAST: Final = 8  # exchanges of a unit behind others, or behind answers
_SOONER: Final = 0.85
_HURRIED: Final = 5  # answers, each of which would come so by chance once in ten times at the most
_SILENT: Final = 0.02
_OTHERS: Final = 2
_STEADY: Final = 0.3
_STEADIEST: Final = 0.01  # of a delay: so much any device's strays
_SHIFTED: Final = 4.0
_OVERDUE: Final = 0.8  # of the timeout
_FAR_SLOWER: Final = 3.0
_TIMED_BITS: Final = 3.0  # of a time that is just the timeout, and might be any
_KINDS: Final = {
    "crossed": 0.5,
    "other": 0.12,
    "cut": 0.1,
    "cut-short": 0.1,
    "middle": 0.08,
    "whole": 0.05,
    "long": 0.03,
}


@suspect(
    "timeout-too-short",
    Severity.ERROR,
    blame="master",
    text="The master does not wait long enough for unit {unit}: {late} of its answers came when the master had gone on"
    "[ (it takes up to {delay:.3g} ms)]; what it takes for an answer to one request may be that of the one before",
    share="{late} of {asked} requests to unit {unit}[, {others_late} of {others_asked} to others]",
    deciding_test="Set the master's timeout three times as long: no request may stay without an answer then",
    remedy="Set the response timeout longer than the slowest answer of unit {unit}, and let the master drop what comes "
    "late before it sends again",
)
def timeout_too_short(evidence: Evidence) -> Iterator[Suspicion]:
    """Late answers of one unit; requests repeated though they were answered, if late."""
    if not evidence.ordered:
        return
    late = {unit.unit: _late(evidence, unit) for unit in evidence.units}
    for unit in evidence.units:  # what stands where another's was due, if it did not come before
        if evidence.is_open(Symptom.LATENESS, unit.unit):
            late[unit.unit] += min(evidence.begun[unit.unit], unit.count(Ending.SILENT, Ending.GARBAGE))
    for unit in evidence.units:
        if interrupted(evidence, unit) > _MOSTLY * len(unit.waits):
            continue  # nobody gives up so soon
        others = [other for other in evidence.units if other.unit != unit.unit]
        behind, run_into = _run_into(evidence, unit)
        series, in_series = _shifted(evidence, unit)
        behind += series
        mine, rest = max(late[unit.unit], run_into, in_series), sum(late[other.unit] for other in others)
        if mine < _LEAST or mine < _MOSTLY * (mine + rest) or mine > unit.asked + _LEAST:
            continue  # more than it was asked for are no late answers
        background = max(_BACKGROUND, (rest + 0.5) / (sum(other.asked for other in others) + 100))
        silent = surplus_bits(evidence.silent(unit), unit.asked, _SILENT) / 2
        garbled = max(kind_bits(evidence.readings(unit), _KINDS), 0.0)
        explains = {(Symptom.LATENESS, unit.unit), (Symptom.SILENCE, unit.unit), (Symptom.DOUBLES, unit.unit),
                    (Symptom.DAMAGE, unit.unit), (Symptom.BEHIND, unit.unit), (Symptom.VALUES, unit.unit)}  # fmt: skip
        explains |= {
            (symptom, other.unit) for other in others for symptom in (Symptom.DAMAGE, Symptom.BEHIND, Symptom.SILENCE)
        }
        lost, lost_ms = evidence.cost(unit, Ending.SILENT, Ending.GARBAGE)
        slow = unit.delays.quantile(0.9)
        yield Suspicion(
            (unit.unit,),
            surplus_bits(mine, max(unit.asked, mine), background)
            + 2 * mine
            + behind
            + silent
            + garbled
            + _TIMED_BITS * len(timed_by_the_master(evidence, unit)),
            frozenset(explains),
            {
                "unit": unit.unit,
                "late": mine,
                "asked": unit.asked,
                "others_late": rest,
                "others_asked": sum(other.asked for other in others),
                "delay": slow / 1e6
                if slow and evidence.timeout_ns and slow > max(evidence.verdict.wait_ns, 0.5 * evidence.timeout_ns)
                else 0.0,
            },
            since=unit.first,
            until=unit.last,
            lost_answers=lost + _redundant(unit).count,
            lost_ms=lost_ms,
            frames=tuple(unit.examples.get(Ending.SILENT, [])),
        )


def _run_into(evidence: Evidence, unit: UnitLedger) -> tuple[float, int]:
    """How much likelier the damage right behind a unit's silent exchanges is its doing (bits), and how many of its
    answers ran into what was sent next: no more than it left requests silent, and none where that is not sure.

    What is asked there may suffer from something of its own: it is held against what it suffers elsewhere, and where it
    only ever comes behind silence of this unit, its damage must be such as a second transmitter does.
    """
    successors, ledgers = evidence.ledger.successors, evidence.ledger.units
    bits, mine, by_chance = 0.0, 0, 0.0
    if not unit.answered + unit.late + unit.strays + evidence.begun[unit.unit]:
        return 0.0, 0  # nothing tells that it lives
    for behind in successors.behind(unit.unit):
        then, then_of, other, other_of = successors.rates(behind, unit.unit)
        elsewhere = max(HEALTHY, (other + 0.5) / (other_of + 50))
        if other_of < _CONTRAST and (
            behind not in ledgers or kind_bits(evidence.readings(ledgers[behind]), _KINDS) <= 0
        ):
            continue
        bits += surplus_bits(then, then_of, elsewhere)
        mine += then
        by_chance += elsewhere * then_of
    sure = bits >= _RUN_INTO_BITS and mine <= evidence.silent(unit) and evidence.is_open(Symptom.LATENESS, unit.unit)
    return bits, round(mine - by_chance) if sure else 0


def _shifted(evidence: Evidence, unit: UnitLedger) -> tuple[float, int]:
    """How much likelier the answers behind a silent exchange are to the request before each (bits), and how many: from
    that one on they take always the same time, from their own request on they do not."""
    successors = evidence.ledger.successors
    if unit.unit not in successors.delays or not evidence.is_open(Symptom.LATENESS, unit.unit):
        return 0.0, 0
    own, lagged = successors.delays[unit.unit].numbers, successors.lagged[unit.unit].numbers
    known = max(evidence.verdict.wait_ns, _STEADIEST * float(np.median(lagged)))
    if len(own) < 2 * _LEAST or not np.isfinite(known):
        return 0.0, 0
    strays, strays_lagged = (_strays(each) + known for each in (own, lagged))
    bits = len(own) * float(np.log2(strays / strays_lagged))
    sure = bits >= _SURE_BITS and strays > _SHIFTED * strays_lagged
    return (bits, len(successors.delays[unit.unit])) if sure else (0.0, 0)


def _late(evidence: Evidence, unit: UnitLedger) -> int:
    """Answers of a unit that came too late, as far as can be told."""
    if not evidence.is_open(Symptom.LATENESS, unit.unit):
        return 0
    found = unit.late + unit.strays
    if unit.doubles <= 1.2 * evidence.unanswered(unit):
        found += unit.doubles
    readings = evidence.readings(unit)
    slow = _redundant(unit)
    bound = min(slow.bound_ns, _overdue_ns(evidence, unit))
    hurried, char_ns = _hurried(evidence, unit), evidence.ledger.char_ns
    by_timer = timed_by_the_master(evidence, unit)
    late = [
        r
        for r in readings
        if kind_of(r) == "crossed"
        or r.delay >= bound
        or r.delay + r.due * char_ns >= hurried.bound_ns
        or _own(r, unit)
        or r in by_timer
    ]
    found += round(unit.count(Ending.GARBAGE) * len(late) / max(len(readings), 1))
    return found + max(slow.count, hurried.count, _unheeded(evidence, unit))


def _hurried(evidence: Evidence, unit: UnitLedger) -> Slow:
    """Good answers that take long and behind which the next request comes sooner than the master ever pauses: it had
    given up, and went on by its own timer. `bound_ns`: from the request to the answer's end."""
    pauses, turns = unit.pauses.numbers, unit.turns.numbers  # of the same answers
    took = turns - pauses
    longest = max((poll.about_bytes for poll in evidence.polls_of(unit.unit)), default=0) * evidence.ledger.char_ns
    others = [other for other in evidence.units if other is not unit]
    usually = max((other.delays.quantile(0.5) or 0.0 for other in others), default=0.0)
    if len(took) < 3 * _LEAST:
        return Slow()
    order = np.argsort(took)
    took, pauses, turns = took[order], pauses[order], turns[order]
    elsewhere = [pause for other in others if (pause := other.pauses.quantile(0.1))]
    first = max(len(took) // 4, int(np.searchsorted(took, longest + _FAR_SLOWER * usually, side="right")))
    if first > len(took) - _HURRIED:
        return Slow()
    usual = np.minimum(_lowest_tenths(pauses), min(elsewhere, default=UNKNOWN))[first - 1 : len(took) - _HURRIED]
    behind = np.maximum.accumulate(pauses[::-1])[::-1][first : len(took) - _HURRIED + 1]
    sooner = behind < np.minimum(_SOONER * usual, usual - evidence.verdict.wait_ns)
    for bound in (first + np.flatnonzero(sooner)).tolist():
        if _strays(turns[bound:]) < _STEADY * _strays(took[bound:]):  # by its timer
            return Slow(round(len(unit.pauses) * (1 - bound / len(took))), float(took[bound]))
    return Slow()


def _lowest_tenths(numbers: NDArray[np.float64]) -> NDArray[np.float64]:
    """The first decile of the first n numbers, for every n from 1 on."""
    ordered: list[float] = []
    deciles = np.empty(len(numbers))
    for n, number in enumerate(numbers.tolist()):
        insort(ordered, number)
        low, part = divmod(0.1 * n, 1)
        low = int(low)
        deciles[n] = ordered[low] + part * (ordered[min(low + 1, n)] - ordered[low])
    return deciles


def _strays(numbers: NDArray[np.float64]) -> float:
    return float(np.subtract(*np.quantile(numbers, (0.9, 0.1))))


def _own(reading: Signature, unit: UnitLedger) -> bool:
    """Whether it is a right answer of this unit to another request."""
    return reading.damage is AnswerDamage.OTHER and reading.heard[:1] == bytes((unit.unit,))


def _overdue_ns(evidence: Evidence, unit: UnitLedger) -> float:
    """The delay from which on bytes behind a request come when the master gives up, and its good answers never do."""
    timeout, usual = evidence.timeout_ns, unit.delays.quantile(0.95)
    if timeout is None or evidence.verdict.wait_ns > (1 - _OVERDUE) * timeout:
        return UNKNOWN
    return max(_OVERDUE * timeout, _FAR_SLOWER * (usual or 0.0))


@dataclass(frozen=True, slots=True)
class Slow:
    """Good answers that the master did not take: how many, and the delay (ns) from which on."""

    count: int = 0
    bound_ns: float = UNKNOWN


def _redundant(unit: UnitLedger) -> Slow:
    """Good answers whose request the master repeats all the same, where it is the slow ones."""
    again, heeded = np.sort(unit.redundant.numbers), np.sort(unit.heeded.numbers)
    if len(again) < _LEAST or not len(heeded):
        return Slow()
    best = Slow()
    most = _SURE_BITS
    every = likelihood_bits(len(again), len(again) + len(heeded), len(again) / (len(again) + len(heeded)))
    for bound in np.unique(np.quantile(again, (0.0, 0.05, 0.1, 0.2, 0.3))).tolist():
        slow = len(again) - int(np.searchsorted(again, bound))
        slow_heeded = len(heeded) - int(np.searchsorted(heeded, bound))
        quick, quick_heeded = len(again) - slow, len(heeded) - slow_heeded
        bits = _rate_bits(slow, slow_heeded) + _rate_bits(quick, quick_heeded) - every
        if bits > most and slow * (quick + quick_heeded) > quick * (slow + slow_heeded):
            most = bits
            best = Slow(round(len(unit.redundant) * slow / len(again)), bound)
    return best


def _rate_bits(hits: int, misses: int) -> float:
    return likelihood_bits(hits, hits + misses, (hits + 0.5) / (hits + misses + 1))


def _unheeded(evidence: Evidence, unit: UnitLedger) -> int:
    """Slow answers of a unit behind which the next request comes sooner than it ever does behind those of others.

    A master that has given up sends its next request by its own timeout, whatever comes in between.
    """
    others = [other for other in evidence.units if other.unit != unit.unit and len(other.pauses) >= _LEAST]
    own, delay = unit.pauses.quantile(0.9), unit.delays.quantile(0.5)
    usual = min((pause for other in others if (pause := other.pauses.quantile(0.1)) is not None), default=None)
    delays = [value for other in others if (value := other.delays.quantile(0.5)) is not None]
    if own is None or usual is None or delay is None or len(unit.pauses) < 3 * _LEAST:
        return 0
    if len(delays) < _OTHERS and not _by_timer(unit):
        return 0  # the one other unit may be the last of a round, behind which the master rests
    if own > _SOONER * usual or delay < 3 * max(delays) or own < 0 or evidence.verdict.wait_ns > usual - own:
        return 0
    return len(unit.pauses)


def _by_timer(unit: UnitLedger) -> bool:
    """Whether requests behind those to a unit come after always the same time, though its answers do not."""
    low, high = unit.turns.quantile(0.1), unit.turns.quantile(0.9)
    soon, late = unit.delays.quantile(0.1), unit.delays.quantile(0.9)
    if low is None or high is None or soon is None or late is None:
        return False
    return high - low < _STEADY * (late - soon)
