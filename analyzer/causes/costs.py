"""What damage is called, and what a cause costs: answers that the master did not get, and the time that it waited in vain."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from math import log2
from typing import Final, NamedTuple

import numpy as np

from ..deframing.tap_clock import UNKNOWN
from ..tables.schema import NO_GAP
from ..tables.transactions import NEVER
from .bits import surplus_bits
from .evidence import Evidence
from .exchanges import Ending
from .hits import given_up_by_timer
from .registry import Explained, Symptom
from .samples import READ_REQUEST, Sample
from .signatures import AnswerDamage, Behind, Signature, is_like_request
from .unitledger import UnitLedger

_PATIENT: Final = 1.3  # times a timeout
_SEVERAL: Final = 5
_BESIDE: Final = 0.5  # of the damaged answers
_TOLD: Final = 0.5  # of a timeout, by which times may be wrong
_DUE: Final = 1.5  # times the usual pause: when the next request is due,
_FAR: Final = 4.0  # times it: later than the master ever sends one
_STRAYS: Final = 0.15  # of a timeout, by which a timer and a pause behind it may differ


class LostAnswers(NamedTuple):
    """Lost answers, and the time (ms); None where nobody knows."""

    answers: int = 0
    ms: float | None = None


def cost(evidence: Evidence, unit: UnitLedger, *outcomes: Ending) -> LostAnswers:
    """The requests to a unit that ended so; of damaged answers, silence that is less as well: nothing is left of some, or it
    is left where nobody looks for it."""
    silent, damaged = evidence.surely_silent(unit), evidence.damaged(unit)
    beside = outcomes == (Ending.GARBAGE,) and silent <= _BESIDE * damaged
    return _ended(evidence, unit, *outcomes, *([Ending.SILENT] if beside else []))


def _ended(evidence: Evidence, unit: UnitLedger, *outcomes: Ending) -> LostAnswers:
    lost = 0
    if Ending.GARBAGE in outcomes:
        lost = evidence.damaged(unit) if evidence.ordered else unit.count(Ending.GARBAGE)
    if Ending.SILENT in outcomes:
        lost += evidence.surely_silent(unit)
        lost += 2 * evidence.silent_but_for(unit, Behind.REQUEST)  # the one in pieces as well
    if not evidence.ledger.timed:
        return LostAnswers(lost)
    rows = evidence.ledger.table.of(unit.unit)
    rows = rows[np.isin(rows.outcome, outcomes) & ~rows.good & (rows.wait != NO_GAP)]
    weights = evidence.ledger.table.weights(rows)
    waited, known = float(np.clip(rows.wait, 0, _longest_wait(evidence, unit)) @ weights), float(weights.sum())
    if not known or waited < evidence.verdict.wait_ns * known:
        return LostAnswers(lost)  # of requests that a tap passes on at once nobody knows what was between them
    return LostAnswers(lost, round(min(waited, evidence.ledger.span_ns) / 1e6, 3))


def _longest_wait(evidence: Evidence, unit: UnitLedger) -> float:
    """What the master waits at the most (ns): what follows later, a rest behind a round of its polls, is none of it."""
    if evidence.timeout_ns is not None:
        return _PATIENT * evidence.timeout_ns
    again = unit.garbage_again.quantile(0.9) if len(unit.garbage_again) >= _SEVERAL else None
    return _PATIENT * again if again else UNKNOWN


def cost_of_requests(evidence: Evidence, unit: UnitLedger) -> LostAnswers:
    """About how many requests behind good answers of a unit came through so damaged that nobody answered them."""
    pairs = list(zip(unit.followed.kept, evidence.followed(unit), strict=False)) if evidence.ordered else []
    found = [(sample, each) for sample, each in pairs if _is_lost_request(evidence, sample, each)]
    if not found:
        return LostAnswers(0, 0.0)
    lost = round(unit.followed.offered * len(found) / len(pairs))
    waits = [_waited(evidence, *each) for each in found if each[0].t_next != NEVER]
    most = _longest_wait(evidence, unit)
    mean = float(np.clip(waits, 0, most).mean()) if waits else 0.0
    if not evidence.ledger.timed or not mean > evidence.verdict.wait_ns:
        return LostAnswers(lost)
    return LostAnswers(lost, round(min(lost * mean, evidence.ledger.span_ns) / 1e6, 3))


def _is_lost_request(evidence: Evidence, sample: Sample, reading: Signature) -> bool:
    """Whether what stands behind a good answer is, or was, a request: it is known again, as long as one, or the master
    waits behind it until it gives up."""
    if is_like_request(reading):
        return True
    if reading.behind is Behind.NOTHING or reading.t_behind < 0:
        return False
    timeout, off, waited = evidence.timeout_ns, evidence.verdict.wait_ns, _waited(evidence, sample, reading)
    if timeout is not None:
        return off <= _TOLD * timeout and abs(waited - timeout) < _STRAYS * timeout + off
    return is_instead_of_request(evidence, sample, reading)


def is_instead_of_request(evidence: Evidence, sample: Sample, reading: Signature) -> bool:
    """Whether bytes stand behind a good answer when the next request is due, and the next one comes far later than the
    client pauses: it waits for an answer to what was sent there."""
    usual, off = evidence.ledger.pauses.quantile(0.5), evidence.verdict.wait_ns
    if usual is None or sample.t_next == NEVER:
        return False
    due = _DUE * usual + READ_REQUEST * evidence.ledger.char_ns + off
    return 0 <= reading.rested <= due and _waited(evidence, sample, reading) > _FAR * (usual + off)


def _waited(evidence: Evidence, sample: Sample, reading: Signature) -> float:
    """From the end of what stands behind a good answer to the next request (ns)."""
    return sample.t_next - reading.t_behind - len(reading.heard) * evidence.ledger.char_ns


def cost_behind_damage(evidence: Evidence, unit: UnitLedger) -> LostAnswers:
    """About how many requests behind damaged answers of a unit, asked again at that, came through damaged as well."""
    readings = evidence.readings(unit)
    found = sum(map(is_like_request, readings))
    if not found:
        return LostAnswers(0, 0.0)
    whole = cost(evidence, unit, Ending.GARBAGE)
    lost = round(whole.answers * found / len(readings))
    return LostAnswers(lost, None if whole.ms is None else 0.0)  # its time is that until the next request


_ENDINGS: Final = {Symptom.DAMAGE: Ending.GARBAGE, Symptom.SILENCE: Ending.SILENT}


def cost_of(evidence: Evidence, explains: Explained) -> LostAnswers:
    """All that follows from what a cause explains and nothing has explained yet; a unit of which nothing is ever heard
    has a cause of its own."""
    found = []
    for unit in evidence.units if evidence.ordered else ():
        mine = {kind for kind, number in explains if number == unit.unit and evidence.is_open(kind, number)}
        heard = unit.answered or unit.loose or unit.count(Ending.GARBAGE)
        found.append(_ended(evidence, unit, *(_ENDINGS[kind] for kind in mine & _ENDINGS.keys() if heard)))
        if Symptom.BEHIND in mine:
            found.append(cost_of_requests(evidence, unit))
    return together(found)


def twice(evidence: Evidence, once: LostAnswers) -> LostAnswers:
    """The same of two masters, each of which waits in its own time."""
    ms = None if once.ms is None else min(2 * once.ms, evidence.ledger.span_ns / 1e6)
    return LostAnswers(min(2 * once.answers, evidence.ledger.requests), ms)


def together(costs: Iterable[LostAnswers]) -> LostAnswers:
    """Their sum; the time of none is known where that of one is not."""
    costs = [each for each in costs if each.answers]
    known = [each.ms for each in costs if each.ms is not None]
    return LostAnswers(
        sum(each.answers for each in costs), round(sum(known), 3) if costs and len(known) == len(costs) else None
    )


_RARE: Final = 0.01
_SHORT_CUT: Final = 4  # bytes
_STRAYED: Final = 2  # bytes

# How damage spreads over kinds where it strikes anywhere, by chance.
_ANYWHERE: Final[Mapping[str, float]] = {
    "head": 0.09, "ahead": 0.03, "tail": 0.03, "cut-short": 0.05, "cut": 0.08, "bits": 0.24, "bits-tail": 0.03, "middle": 0.2,
    "long": 0.06, "convention": 0.002, "count": 0.005, "crossed": 0.03, "other": 0.02, "whole": 0.13, "none": 0.003,
}  # fmt: skip


def kind_of(reading: Signature) -> str:
    """The kind of damage, places at the end told apart."""
    if reading.damage is AnswerDamage.CUT:
        return "cut-short" if reading.bytes <= _SHORT_CUT else "cut"
    if reading.damage is AnswerDamage.HEAD and reading.length > reading.due:
        return "ahead"  # something else stands before it
    if reading.damage is AnswerDamage.BITS and reading.at >= reading.due - 1:
        return "bits-tail"
    return str(reading.damage.value)


def kind_bits(readings: list[Signature], expected: Mapping[str, float]) -> float:
    """How much likelier these kinds of damage are as expected than where damage strikes anywhere."""
    return sum(log2(expected.get(kind_of(each), _RARE) / _ANYWHERE[kind_of(each)]) for each in readings)


def overlaid(readings: Sequence[Signature]) -> int:
    """How many are so much longer or shorter than what was due that something else was sent into them: what disturbs a
    line from outside makes a byte or two more or less."""
    return sum(
        each.due > 0 and each.length >= _SHORT_CUT and abs(each.length - each.due) > _STRAYED for each in readings
    )


def share_of(readings: list[Signature], *kinds: str) -> float:
    """The share of readings of these kinds; 0 without any."""
    return sum(kind_of(each) in kinds for each in readings) / len(readings) if readings else 0.0


_LEAST: Final = 3
_SURE_BITS: Final = 16.0
_SOONER: Final = 0.85
_MOSTLY: Final = 0.6
_LONGEST: Final = 0.97  # of delays: some may be late ones, for which there was time


def untimely(evidence: Evidence, unit: UnitLedger) -> tuple[float, int]:
    """How much likelier good answers behind a silent exchange of the same unit are to the request before (bits), and how
    many: they come sooner than the unit ever answers else, or most of them sooner or later, and the master gave up by its
    timer."""
    successors = evidence.ledger.successors
    behind, usual = successors.delays(unit.unit), successors.usual(unit.unit).numbers
    if not len(behind) or not evidence.is_open(Symptom.LATENESS, unit.unit):
        return 0.0, 0
    own = behind.numbers
    if len(usual) < 3 * _LEAST or not given_up_by_timer(evidence, unit):
        return 0.0, 0
    off = evidence.verdict.wait_ns
    sooner = own < _SOONER * float(usual.min()) - off
    odd = sooner | (own > float(np.quantile(usual, _LONGEST)) / _SOONER + off)
    found = [(sooner, 1 / len(usual))]
    if np.count_nonzero(odd) >= _MOSTLY * len(own):
        found.append((odd, 1 / len(usual) + 1 - _LONGEST))
    bits, mine = max((surplus_bits(int(which.sum()), len(own), chance), int(which.sum())) for which, chance in found)
    return (bits, round(len(behind) * mine / len(own))) if bits >= _SURE_BITS else (0.0, 0)
