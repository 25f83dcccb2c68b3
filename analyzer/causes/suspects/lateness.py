"""Answers that come when the master has given up."""

from __future__ import annotations

from bisect import insort
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import log2
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...deframing.tap_clock import UNKNOWN
from ...tables.findings import Severity
from ..bits import likelihood_bits, strays, surplus_bits
from ..costs import cost_of, kind_bits, kind_of, shifted, untimely
from ..evidence import HEALTHY, Evidence, alone_or_together
from ..exchanges import Ending
from ..hits import cut_short, given_up_by_timer, interrupted, late_units, timed_by_the_master
from ..registry import Suspicion, Symptom, suspect
from ..repeats import (
    answers_like_requests,
    asked_again_behind,
    asked_again_into,
    only_displaced,
    only_repeats,
    waits_longer,
)
from ..signatures import AnswerDamage, Signature
from ..unitledger import UnitLedger

_LEAST: Final = 3
_BACKGROUND: Final = 0.003
_MOSTLY: Final = 0.6  # of all late answers
_SURE_BITS: Final = 16.0
_ALONE_BITS: Final = 40.0  # where nothing else tells it
_RUN_INTO_BITS: Final = 30.0
_CONTRAST: Final = 8  # exchanges of a unit behind others, or behind answers
_SOONER: Final = 0.85
_HURRIED: Final = 5  # answers, each of which would come so by chance once in ten times at the most
_SILENT: Final = 0.02
_SILENT_FOR_LATE: Final = 3
_OTHERS: Final = 2
_STEADY: Final = 0.3
_LATER: Final = 1.2  # times what is usual
_USUAL: Final = (0.5, 0.75, 0.9, 1.0)  # of good answers: some late ones the master may still have taken
_HEAD_CHARS: Final = 3  # that a driver may lose
_OVERDUE: Final = 0.8  # of the timeout
_FAR_SLOWER: Final = 3.0
_RUN_INTO: Final = (Symptom.DAMAGE, Symptom.BEHIND, Symptom.SILENCE)  # what late answers do to others and themselves
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
    text="The client does not wait long enough for {units:unit|units}: {late:answer|answers} came after the client had "
    "moved on"
    "[ (up to {delay:ms} after the request)]; it may take the answer to one request for the answer to the next",
    share="{late:,} of {asked:,} requests to {units:unit|units}[, {others_late:,} of {others_asked:,} to others]",
    deciding_test="Set the client's timeout three times as long: no request may stay without an answer then",
    remedy="Set the response timeout longer than the slowest answer of {units:unit|units}, and let the client discard "
    "late bytes before it sends again",
)
def timeout_too_short(evidence: Evidence) -> Iterator[Suspicion]:
    """Late answers of one unit, or of several where the master's own timer tells that nobody else sends; requests
    repeated though they were answered, if late."""
    if not evidence.ordered:
        return
    late = {unit.unit: _late(evidence, unit) for unit in evidence.units}
    for unit in evidence.units:  # what stands where another's was due, if it did not come before
        if evidence.is_open(Symptom.LATENESS, unit.unit):
            without = unit.count(Ending.SILENT, Ending.GARBAGE) - late[unit.unit]
            late[unit.unit] += max(min(evidence.begun[unit.unit], without), 0)
    found = [each for unit in evidence.units if (each := _weighed(evidence, unit, late)) is not None]
    together = [each for each in found if _is_timed(evidence, each.unit)] or [
        each for each in found if each.unit in late_units(evidence)
    ]
    for group in alone_or_together(found, together):
        group.sort(key=lambda each: -each.late / max(each.unit.asked, 1))
        mine = sum(each.late for each in group)
        rest = sum(late.values()) - sum(late[each.unit.unit] for each in group)
        if mine >= _MOSTLY * (mine + rest):
            yield _suspicion(evidence, group, late, mine, rest)


def _is_timed(evidence: Evidence, unit: UnitLedger) -> bool:
    return given_up_by_timer(evidence, unit) or _repeated_by_timer(unit) or bool(asked_again_into(evidence, unit))


@dataclass(frozen=True, slots=True)
class _LateUnit:
    """A unit with late answers: how many, and the bits of what they ran into."""

    unit: UnitLedger
    late: int
    behind: float


def _weighed(evidence: Evidence, unit: UnitLedger, late: Mapping[int, int]) -> _LateUnit | None:
    if (
        only_displaced(evidence, unit)
        or not _lives(evidence, unit)
        or interrupted(evidence, unit) > _MOSTLY * len(unit.waits)
    ):
        return None  # nobody gives up so soon
    if (short := cut_short(evidence, unit)) >= _LEAST and short > _MOSTLY * len(unit.quiet_waits):
        return None  # nor with nothing heard
    behind, run_into = _run_into(evidence, unit)
    series, in_series = shifted(evidence, unit)
    odd, at_odd_times = untimely(evidence, unit)
    mine = max(late[unit.unit], run_into, in_series, at_odd_times)
    if mine < _LEAST or mine > unit.asked + _LEAST:
        return None  # more than it was asked for are no late answers
    return _LateUnit(unit, mine, behind + max(series, odd))


def _lives(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether anything was ever heard of a unit: one that is dead is late with nothing, whatever else is hit."""
    heard = (unit.answered + unit.loose) * (not only_repeats(evidence, unit)) + evidence.begun[unit.unit]
    return bool(heard or asked_again_into(evidence, unit))


def _suspicion(
    evidence: Evidence, group: Sequence[_LateUnit], late: Mapping[int, int], mine: int, rest: int
) -> Suspicion:
    units = [each.unit for each in group]
    others = [other for other in evidence.units if other not in units]
    background = max(_BACKGROUND, (rest + 0.5) / (sum(other.asked for other in others) + 100))
    bits, slow, explains = 0.0, 0.0, set[tuple[Symptom, int | None]]()
    for each in group:
        unit = each.unit
        bits += surplus_bits(each.late, max(unit.asked, each.late), background) + 2 * each.late + each.behind
        silent = min(evidence.silent(unit), _SILENT_FOR_LATE * each.late)
        bits += surplus_bits(silent, unit.asked, _SILENT) / 2
        bits += max(kind_bits(evidence.readings(unit), _KINDS), 0.0)
        bits += _TIMED_BITS * len(timed_by_the_master(evidence, unit)) + _beyond(evidence, unit)[1]
        explains |= {(kind, unit.unit) for kind in (*_RUN_INTO, Symptom.LATENESS, Symptom.DOUBLES, Symptom.VALUES)}
        slow = max(slow, unit.delays.quantile(0.9) or 0.0)
    explains |= {(kind, other.unit) for other in others for kind in _RUN_INTO}
    hit = evidence.ledger.successors.hit
    for other in others:  # a master that takes what runs into an answer for it goes on before that comes
        if late[other.unit] <= sum(hit[other.unit, unit.unit] for unit in units):
            explains.add((Symptom.LATENESS, other.unit))
    lost = cost_of(evidence, frozenset(explains))
    timeout = evidence.timeout_ns
    told = timeout is not None and slow > max(evidence.verdict.wait_ns, 0.5 * timeout)
    return Suspicion(
        tuple(unit.unit for unit in units),
        bits,
        frozenset(explains),
        {
            "units": tuple(unit.unit for unit in units),
            "late": mine,
            "asked": sum(unit.asked for unit in units),
            "others_late": rest,
            "others_asked": sum(other.asked for other in others),
            "delay": slow / 1e6 if told else 0.0,
        },
        since=min(unit.first for unit in units),
        until=max(unit.last for unit in units),
        lost_answers=lost.answers
        + sum(max(_redundant(evidence, u).count, _met_on_the_way(evidence, u)) for u in units),
        lost_ms=lost.ms,
        frames=tuple(i for unit in units for i in unit.examples.get(Ending.SILENT, []))[:6],
    )


def _run_into(evidence: Evidence, unit: UnitLedger) -> tuple[float, int]:
    """How much likelier the damage right behind a unit's silent exchanges is its doing (bits), and how many of its
    answers ran into what was sent next: no more than it left requests silent, and none where that is not sure.

    What is asked there may suffer from something of its own: it is held against what it suffers elsewhere, and where it
    only ever comes behind silence of this unit, its damage must be such as a second transmitter does.
    """
    successors, ledgers = evidence.ledger.successors, evidence.ledger.units
    bits, mine, by_chance = 0.0, 0, 0.0
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


def _late(evidence: Evidence, unit: UnitLedger) -> int:
    """Answers of a unit that came too late, as far as can be told."""
    if not evidence.is_open(Symptom.LATENESS, unit.unit):
        return 0
    found = unit.late + unit.strays
    if unit.doubles <= 1.2 * evidence.unanswered(unit):
        found += unit.doubles
    readings = evidence.readings(unit)
    slow = _redundant(evidence, unit)
    bound = min(slow.bound_ns, _overdue_ns(evidence, unit), _beyond(evidence, unit)[0])
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
    behind = asked_again_behind(evidence, unit) + answers_like_requests(evidence, unit)
    return found + max(slow.count, hurried.count, _unheeded(evidence, unit), _in_vain(evidence, unit), behind)


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
        if strays(turns[bound:]) < _STEADY * strays(took[bound:]):  # by its timer
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


def _own(reading: Signature, unit: UnitLedger) -> bool:
    """Whether it is a right answer of this unit to another request."""
    return reading.damage is AnswerDamage.OTHER and reading.heard[:1] == bytes((unit.unit,))


def _overdue_ns(evidence: Evidence, unit: UnitLedger) -> float:
    """The delay from which on bytes behind a request come when the master gives up, and its good answers never do."""
    timeout, usual = evidence.timeout_ns, unit.delays.quantile(0.95)
    if timeout is None or evidence.verdict.wait_ns > (1 - _OVERDUE) * timeout:
        return UNKNOWN
    return max(_OVERDUE * timeout, _FAR_SLOWER * (usual or 0.0))


def _beyond(evidence: Evidence, unit: UnitLedger) -> tuple[float, float]:
    """The delay (ns) from which on garbage comes later than good answers of a unit hardly ever do, where most of its
    garbage does, and how much likelier that is (bits): its answer was not waited for, and met what was asked next. What
    else damages an answer does not delay it."""
    good, readings = unit.delays.numbers, [each for each in evidence.readings(unit) if each.delay >= 0]
    if len(good) < 3 * _LEAST or not readings or evidence.echoed_again(unit):
        return UNKNOWN, 0.0
    off = evidence.verdict.wait_ns + _HEAD_CHARS * evidence.ledger.char_ns
    best = UNKNOWN, 0.0
    for usual in np.quantile(good, _USUAL).tolist():
        bound = _LATER * usual + off
        beyond, by_chance = sum(each.delay >= bound for each in readings), np.mean(good >= bound - off) + 1 / len(good)
        bits = surplus_bits(beyond, len(readings), float(by_chance)) - log2(len(_USUAL))
        if beyond >= _MOSTLY * len(readings) and bits >= max(_SURE_BITS, best[1]):
            best = bound, bits
    return best


def _met_on_the_way(evidence: Evidence, unit: UnitLedger) -> int:
    """Requests that are lost besides those whose answers are damaged, where these come when the master has given up: what
    it sent into them, and good answers that came as late and met nothing."""
    bound, bits = _beyond(evidence, unit)
    if not bits:
        return 0
    readings = evidence.readings(unit)
    late = sum(each.delay >= bound for each in readings) / len(readings)
    good = float((unit.delays.numbers >= bound).mean())
    return round(unit.count(Ending.GARBAGE) * late + len(unit.delays) * good)


@dataclass(frozen=True, slots=True)
class Slow:
    """Good answers that the master did not take: how many, and the delay (ns) from which on."""

    count: int = 0
    bound_ns: float = UNKNOWN


def _redundant(evidence: Evidence, unit: UnitLedger) -> Slow:
    """Good answers whose request the master repeats all the same, where it is the slow ones, of one poll beyond doubt, or
    it does so by its timer: sooner behind them than it pauses else. A list may hold a request twice, one behind the
    other, whatever that takes."""
    if len(unit.redundant) < _LEAST or waits_longer(evidence, unit, 1.0):
        return Slow()
    if _sooner(evidence, unit) or _repeated_by_timer(unit):
        return _slow_ones(unit, unit.redundant.numbers, unit.heeded.numbers, _SURE_BITS)
    rows = evidence.rows(unit.unit)
    good = rows[(rows.outcome == Ending.OK) & (rows.delay >= 0)]
    asked = good.function.astype(np.int64) << 32 | good.address.astype(np.int64) << 16 | good.quantity
    polls, which = np.unique(asked, return_inverse=True)
    mine = (
        which == int(np.argmax(np.bincount(which[good.next_same], minlength=len(polls)))) if len(polls) else which > 0
    )
    delays = good.delay.astype(np.float64)
    return _slow_ones(unit, delays[mine & good.next_same], delays[mine & ~good.next_same], _ALONE_BITS)


def _slow_ones(unit: UnitLedger, again: NDArray[np.float64], heeded: NDArray[np.float64], least: float) -> Slow:
    """The delay from which on a master repeats its requests, where that decides about it by so many bits at the least."""
    again, heeded = np.sort(again), np.sort(heeded)
    if len(again) < _LEAST or not len(heeded):
        return Slow()
    best, most = Slow(), least
    every = likelihood_bits(len(again), len(again) + len(heeded), len(again) / (len(again) + len(heeded)))
    for bound in np.unique(np.quantile(again, (0.0, 0.05, 0.1, 0.2, 0.3))).tolist():
        slow = len(again) - int(np.searchsorted(again, bound))
        slow_heeded = len(heeded) - int(np.searchsorted(heeded, bound))
        quick, quick_heeded = len(again) - slow, len(heeded) - slow_heeded
        bits = _rate_bits(slow, slow_heeded) + _rate_bits(quick, quick_heeded) - every
        if bits > most and slow * quick_heeded > quick * slow_heeded:
            most, best = bits, Slow(round(len(unit.redundant) * slow / len(again)), bound)
    return best


def _repeated_by_timer(unit: UnitLedger) -> bool:
    """Whether requests repeated though they were answered come always as long behind the request before, however long
    its answer took: the master did not take it."""
    turns = unit.redundant_turns.numbers
    if len(turns) < _HURRIED:
        return False
    took = turns - unit.redundant_pauses.numbers
    return strays(turns) < _STEADY * strays(took)  # no clock makes times more alike than they are


def _sooner(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether the master repeats its request sooner behind a unit's answers than it sends another one, there and behind
    those of others: it may rest at the end of its list, which makes a mean long."""
    repeated = unit.redundant_pauses
    others = len(unit.pauses) - len(repeated)
    if not len(repeated) or not others:
        return False
    off = evidence.verdict.wait_ns
    error = off * ((1 / len(repeated) + 1 / others) / 12) ** 0.5  # of means of times that are wrong by up to so much
    medians = [other.pauses.quantile(0.5) for other in evidence.units if other is not unit]
    elsewhere = [median - off for median in medians if median is not None]
    usual = min((unit.pauses.total - repeated.total) / others, *elsewhere, UNKNOWN)
    return bool(repeated.total / len(repeated) + 2 * error < _SOONER * usual)


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
    if own is None or usual is None or delay is None or not delays or len(unit.pauses) < 3 * _LEAST:
        return 0
    if len(delays) < _OTHERS and not _by_timer(unit):
        return 0  # the one other unit may be the last of a round, behind which the master rests
    if own > _SOONER * usual or delay < 3 * max(delays) or own < 0 or evidence.verdict.wait_ns > usual - own:
        return 0
    timeout = (unit.turns.quantile(0.5) or 0.0) - usual  # as this would tell it
    return len(unit.pauses) if timeout > max(delays) else 0


def _in_vain(evidence: Evidence, unit: UnitLedger) -> int:
    """Good answers, all slow beside those of others, whose requests are repeated by the master's timer."""
    delay, others = unit.delays.quantile(0.1), [other for other in evidence.units if other is not unit]
    delays = [value for other in others if (value := other.delays.quantile(0.5)) is not None]
    slow = delay is not None and len(delays) >= _OTHERS and delay > _FAR_SLOWER * max(delays)
    met = unit.behind + unit.count(Ending.GARBAGE)  # a list of one poll repeats it by a timer too, and meets nothing
    return len(unit.redundant) if slow and met >= _LEAST and _repeated_by_timer(unit) else 0


def _by_timer(unit: UnitLedger) -> bool:
    """Whether requests behind those to a unit come after always the same time, though its answers do not."""
    low, high = unit.turns.quantile(0.1), unit.turns.quantile(0.9)
    soon, late = unit.delays.quantile(0.1), unit.delays.quantile(0.9)
    if low is None or high is None or soon is None or late is None:
        return False
    return high - low < _STEADY * (late - soon)
