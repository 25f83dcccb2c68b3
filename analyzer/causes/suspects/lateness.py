"""Answers that come when the master has given up."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import log2
from typing import Final

import numpy as np

from ...deframing.tap_clock import UNKNOWN
from ...tables.findings import Severity
from ..answeredas import lent
from ..bits import surplus_bits
from ..costs import cost_of, kind_bits, kind_of, untimely
from ..evidence import Evidence, alone_or_together, usual_rate
from ..exchanges import Ending
from ..givenup import all_repeated, asked_again_though_slow, given_up_on, repeated_by_timer
from ..hits import given_up_by_timer, interrupted, late_units, timed_by_the_master
from ..registry import Suspicion, Symptom, suspect
from ..repeats import (
    answers_like_requests,
    asked_again_behind,
    asked_again_into,
    only_displaced,
    only_repeats,
)
from ..signatures import AnswerDamage, Signature
from ..unitledger import UnitLedger
from .common import examples

_LEAST: Final = 3
_BACKGROUND: Final = 0.003
_MOSTLY: Final = 0.6  # of all late answers
_SURE_BITS: Final = 16.0
_RUN_INTO_BITS: Final = 30.0
_CONTRAST: Final = 8  # exchanges of a unit behind others, or behind answers
_SILENT: Final = 0.02
_SILENT_FOR_LATE: Final = 3
_LATER: Final = 1.2  # times what is usual
_USUAL: Final = (0.5, 0.75, 0.9, 1.0)  # of good answers: some late ones the master may still have taken
_HEAD_CHARS: Final = 3  # that a driver may lose
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
    return given_up_by_timer(evidence, unit) or repeated_by_timer(unit) or bool(asked_again_into(evidence, unit))


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
    behind, run_into = _run_into(evidence, unit)
    odd, at_odd_times = untimely(evidence, unit)
    mine = max(late[unit.unit], run_into, at_odd_times)
    if mine < _LEAST or mine > unit.asked + _LEAST:
        return None  # more than it was asked for are no late answers
    return _LateUnit(unit, mine, behind + odd)


def _lives(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether anything was ever heard of a unit: one that is dead is late with nothing, whatever else is hit."""
    heard = (unit.answered + unit.loose) * (not only_repeats(evidence, unit)) + evidence.begun[unit.unit]
    return bool(heard or asked_again_into(evidence, unit))


def _suspicion(
    evidence: Evidence, group: Sequence[_LateUnit], late: Mapping[int, int], mine: int, rest: int
) -> Suspicion:
    units = [each.unit for each in group]
    others = evidence.others(*units)
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
        + sum(max(asked_again_though_slow(evidence, u).count, _met_on_the_way(evidence, u)) for u in units),
        lost_ms=lost.ms,
        frames=examples(units, Ending.SILENT),
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
        elsewhere = usual_rate(other, other_of)
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
    found = unit.late + max(unit.strays - lent(evidence, unit), 0)
    if unit.doubles <= 1.2 * evidence.unanswered(unit):
        found += unit.doubles
    readings = evidence.readings(unit)
    slow = asked_again_though_slow(evidence, unit)
    bound = min(slow.bound_ns, _beyond(evidence, unit)[0])
    quick, char_ns = given_up_on(evidence, unit), evidence.ledger.char_ns
    by_timer = timed_by_the_master(evidence, unit)
    late = [
        r
        for r in readings
        if kind_of(r) == "crossed"
        or r.delay >= bound
        or r.delay + r.due * char_ns >= quick.bound_ns
        or _own(r, unit)
        or r in by_timer
    ]
    found += round(unit.count(Ending.GARBAGE) * len(late) / max(len(readings), 1))
    behind = asked_again_behind(evidence, unit) + answers_like_requests(evidence, unit)
    return found + max(slow.count, quick.count, all_repeated(evidence, unit), behind)


def _own(reading: Signature, unit: UnitLedger) -> bool:
    """Whether it is a right answer of this unit to another request."""
    return reading.damage is AnswerDamage.OTHER and reading.heard[:1] == bytes((unit.unit,))


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
