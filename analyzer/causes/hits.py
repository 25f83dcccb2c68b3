"""What was hit on the line: answers, requests, the idle line; and when."""

from __future__ import annotations

from collections.abc import Sequence
from math import exp, isfinite, log1p, log2
from typing import Any, Final

import numpy as np

from ..tables.schema import Bools, Float64s
from .bits import likelihood_bits, spells_of, strays, surplus_bits
from .evidence import Evidence
from .rawbytes import is_of_line
from .registry import Symptom
from .repeats import asked_again_into
from .signatures import AHEAD, AnswerDamage, Behind, Signature, known_header
from .unitledger import UnitLedger

WELL: Final = 0.03  # of stray bytes that hit frames all the same, on a line that floats when nobody drives it
_NEARLY_ALL: Final = 0.9
_ODD: Final = 0.6
_HARD: Final = 2.0  # characters: nearer to the next frame, a byte belongs to it
_NO_REST_CHARS: Final = 3.0
_SURE_BITS: Final = 30.0
_MOST_LATE: Final = 0.85  # what one late answer meets may make another late
_ONE_LATE_BITS: Final = 12.0
_OFTEN_LATE: Final = 0.15  # of what a unit is asked
_MOST_HIT: Final = 0.98
_ABOUT: Final = 20.0  # bytes
_AT_ONCE: Final = 0.05  # of a timeout
_STEADY: Final = 0.3  # of what else strays
_STEADIER: Final = 0.5
_RUN_INTO: Final = (AnswerDamage.CROSSED, AnswerDamage.LONG)
_TOLD: Final = 5  # waits or delays, by which a clock's errors even out
_SOONEST: Final = 0.05  # of delays
_HELD_NS: Final = 1e9  # a tap that holds bytes back for longer shows no waits at all
_WAITED: Final = 0.9  # of delays: so long its master waits for a unit that answers
_SOONER: Final = 0.8  # of them: no timer strays so far
_BY_TIMER: Final = 0.85  # of waits
_TIMER_TOLD: Final = 0.3  # of a timeout: times that are wrong by more do not tell it
_REQUEST: Final = 8  # bytes: of a read, and no request has fewer
_MANY: Final = 10  # answers
_SOME: Final = 0.1  # of the requests
_FAR_MORE: Final = 4.0
_MANY_STRAYS: Final = 30.0
_SPARED_SHARE: Final = 0.05
_HEADER: Final = 3  # bytes: unit, function, byte count
_UNTOLD: Final = 0.5  # of what a clock may be wrong by: a shorter pause than that nobody measures

# How damage spreads over kinds where it strikes all senders alike.
ALIKE: Final = {"bits": 0.24, "bits-tail": 0.03, "head": 0.09, "ahead": 0.03, "middle": 0.2, "whole": 0.13, "long": 0.06, "tail": 0.03,
                 "cut": 0.08, "cut-short": 0.05, "crossed": 0.02, "convention": 0.001, "count": 0.002, "other": 0.01}  # fmt: skip


class Hits:
    """How many exchanges were hit: frames (answers, requests) and the idle line."""

    def __init__(self, evidence: Evidence) -> None:
        self.damaged = sum(map(evidence.damaged, evidence.units))
        self.requests = sum(evidence.behind(unit, Behind.REQUEST) for unit in evidence.units)
        self.idle = sum(map(evidence.stray, evidence.units))
        self.exchanges = sum(unit.asked for unit in evidence.units)

    @property
    def frames(self) -> float:
        return self.damaged + self.requests

    @property
    def all(self) -> float:
        return self.frames + self.idle

    @property
    def numbers(self) -> dict[str, Any]:
        """For people."""
        return {
            "idle": round(self.idle),
            "damaged": self.damaged,
            "requests": round(self.requests),
            "exchanges": self.exchanges,
            "answers": self.exchanges,
            "well": self.exchanges - self.damaged,
            "hits": round(self.all),
        }


def evenness_bits(evidence: Evidence) -> float:
    """How much less likely the damage of units is, each as it is, if all share one rate a byte; never more than 0."""
    units = [unit for unit in evidence.units if evidence.is_open(Symptom.DAMAGE, unit.unit)]
    if len(units) < 2:
        return 0.0
    hits = [min(evidence.damaged(unit), unit.asked) for unit in units]
    lengths = [_mean_due(evidence, unit.unit) for unit in units]
    exposed = sum(unit.asked * length for unit, length in zip(units, lengths, strict=True))
    surely = -log1p(-min(sum(hits) / sum(unit.asked for unit in units), _MOST_HIT))
    a_byte = surely * sum(unit.asked for unit in units) / exposed
    return _shared_bits(hits, [unit.asked for unit in units], [1 - exp(-a_byte * length) for length in lengths])


def requests_evenness_bits(evidence: Evidence) -> float:
    """How much less likely the damaged requests behind each unit's answers are, if all requests share one rate; never
    more than 0."""
    units = [unit for unit in evidence.units if unit.answered]
    hits = [min(round(evidence.requests_behind(unit)), unit.answered) for unit in units]
    if not sum(hits):
        return 0.0
    of = [unit.answered for unit in units]
    return _shared_bits(hits, of, [sum(hits) / sum(of)] * len(of))


def requests_part(evidence: Evidence) -> float:
    """The part of the bytes of exchanges that are requests, about."""
    asked = sum(unit.asked for unit in evidence.units)
    every = sum(unit.asked * _mean_due(evidence, unit.unit) for unit in evidence.units)
    return _REQUEST * asked / every if every else 1.0


def apart_bits(evidence: Evidence) -> float:
    """How much likelier it is that what comes behind answers is some units' own than that it strikes the idle line, which
    is idle behind each for so much of the time, or is let go so often; 0 or more."""
    stray, idle, let_go = _exposed(evidence)
    every = stray.sum()
    if not every or not evidence.ledger.timed:
        return 0.0
    some = stray > 0
    own = min(
        float((stray[some] * np.log2(stray[some] * exposed.sum() / (every * exposed[some]))).sum())
        for exposed in (idle, let_go)
    )
    return max(own - 0.5 * (len(stray) - 1) * log2(every + 2), 0.0)


def unlike_idle_bits(evidence: Evidence) -> float:
    """How much likelier it is that what strays is sent by somebody than that it strikes the idle line, which makes few
    other bytes than those that are low once, and lies idle ahead of answers, and hard before requests, for so much of
    the time; 0 or more."""
    ahead = hard = every = odd = waited = rested = 0.0
    hard_ns = _HARD * evidence.ledger.char_ns + evidence.verdict.wait_ns
    for unit in evidence.units:
        readings = [each for each in evidence.followed(unit) if each.behind in (Behind.NOISE, Behind.ZEROS)]
        each_stands_for = evidence.stray(unit) / max(len(readings), 1)
        ahead += each_stands_for * sum(each.detail == AHEAD for each in readings)
        hard += each_stands_for * sum(abs(each.left) <= hard_ns for each in readings)
        odd += each_stands_for * sum(not is_of_line(each.heard) for each in readings)
        every, waited, rested = every + evidence.stray(unit), waited + unit.delays.total, rested + unit.pauses.total
    share = waited / (waited + rested) if waited > 0 < rested else 1.0
    begins = min(evidence.ledger.exchanges * hard_ns / max(evidence.ledger.span_ns, 1), 1.0)
    return surplus_bits(ahead, every, share) + surplus_bits(odd, every, _ODD) + surplus_bits(hard, every, begins)


def _exposed(evidence: Evidence) -> tuple[Float64s, Float64s, Float64s]:
    """About how many good answers of each unit have stray bytes behind them; how much of what strays on an idle line is due
    there, by how long it is idle, or by how often it is let go."""
    stray = np.array([evidence.stray(unit) for unit in evidence.units])
    let_go = np.array([max(unit.answered, 1) for unit in evidence.units], np.float64)
    return stray, _idle(evidence, stray, let_go), let_go


def spares_units(evidence: Evidence) -> bool:
    """Whether next to no stray bytes come behind a unit behind which, by its idle time, many must: what strikes the idle
    line strikes it whoever was asked."""
    stray, idle, _ = _exposed(evidence)
    due = stray.sum() * idle / idle.sum()
    return evidence.ledger.timed and bool(((due >= _MANY_STRAYS) & (stray < _SPARED_SHARE * due)).any())


def _idle(evidence: Evidence, stray: Float64s, let_go: Float64s) -> Float64s:
    """How long the line is idle before and behind each unit's answers (ns, about), until something strays there if it does;
    for each answer as long where the clock shows no pauses at all, and nowhere shorter than the clock can tell."""
    char_ns, shown, off = evidence.ledger.char_ns, evidence.ledger.pauses, evidence.verdict.wait_ns
    if shown.total <= char_ns * len(shown):
        return let_go * char_ns
    least = _UNTOLD * off if isfinite(off) else 0.0
    found = []
    for unit, strays_behind in zip(evidence.units, stray.tolist(), strict=True):
        rested = [each.rested for each in evidence.followed(unit) if each.rested >= 0]
        idle = strays_behind * _mean(rested) + unit.answered * unit.delays.mean
        idle += (unit.answered - strays_behind) * unit.pauses.mean
        found.append(max(idle, unit.answered * least, char_ns))
    return np.array(found)


def _mean(numbers: Sequence[float]) -> float:
    return sum(numbers) / max(len(numbers), 1)


def _shared_bits(hits: Sequence[int], of: Sequence[int], rates: Sequence[float]) -> float:
    """How much less likely so many hits are by these rates than each unit's by its own, which has its price."""
    bits, price = 0.0, 0.5 * log2(sum(of) + 2)
    for hit, count, rate in zip(hits, of, rates, strict=True):
        own = likelihood_bits(hit, count, (hit + 0.25) / (count + 0.5))
        bits += min(0.0, likelihood_bits(hit, count, rate) - own + price)
    return bits


def is_one_units(evidence: Evidence) -> bool:
    """Whether nearly all damage is that of one unit, which has no such share of the line's bytes."""
    hits = [evidence.damaged(unit) for unit in evidence.units]
    exposed = [unit.asked * _mean_due(evidence, unit.unit) for unit in evidence.units]
    most, every = max(hits, default=0), sum(hits)
    if not every or most < _NEARLY_ALL * every:
        return False
    share = exposed[hits.index(most)] / sum(exposed)  # by chance alone so many of the hits would be its
    return -every * log2(share) >= _SURE_BITS


def spares_requests(evidence: Evidence, hits: Hits) -> bool:
    """Whether the one unit's answers are hit and the requests behind its good ones are not, though by their bytes many
    must be if what strikes comes from outside."""
    if len(evidence.units) != 1:
        return False
    unit = evidence.units[0]
    a_byte = -log1p(-min(hits.damaged / unit.asked, _MOST_HIT)) / max(_mean_due(evidence, unit.unit) - _REQUEST, 1)
    spared = unit.answered - min(hits.requests + hits.idle, unit.answered)
    return surplus_bits(spared, unit.answered, exp(-a_byte * _REQUEST)) >= _SURE_BITS


def interrupted(evidence: Evidence, unit: UnitLedger) -> int:
    """Requests to a unit behind which another came well before it ever answers, for which the master does wait: nobody
    gives up so soon, that is another who sends. They stayed without a byte, or damaged answers begin as one to another."""
    if len(unit.delays.numbers) < _TOLD:
        return 0
    before = _SOONER * (unit.delays.quantile(_WAITED) or 0.0) - evidence.verdict.wait_ns

    def is_so(each: Signature) -> bool:
        met = each.damage is AnswerDamage.CROSSED and 0 <= each.delay < before
        return met and evidence.begun_by(each) is not None

    return _cut_short(evidence, unit) + round(evidence.damaged_so(unit, is_so))


def _cut_short(evidence: Evidence, unit: UnitLedger) -> int:
    """Those of them that stayed without a byte. Of a coarse clock all or none, by the mean of the waits."""
    waits, off, soonest = unit.quiet_waits.numbers, evidence.verdict.wait_ns, unit.delays.quantile(_SOONEST) or 0.0
    if not evidence.is_open(Symptom.SILENCE, unit.unit) or off > _HELD_NS:
        return 0
    early = unit.quiet_waits.below(_SOONER * (soonest - off))
    error = 3 * off / (12 * max(len(waits), 1)) ** 0.5  # of the mean of times that are wrong by up to so much
    if len(waits) >= _TOLD and waits.mean() + error < _SOONER * (unit.delays.quantile(0.25) or 0.0):
        early = 1.0
    return round(early * len(unit.quiet_waits)) if by_another(evidence, unit, soonest) else 0


def by_another(evidence: Evidence, unit: UnitLedger, before: float) -> bool:
    """Whether another client may have sent what came so soon (ns) behind requests without a byte: where nearly all of it
    asks the very same again without a rest, it is the one who asked."""
    soon = int(np.count_nonzero(unit.quiet_waits.numbers < before))
    again = int(np.count_nonzero(unit.quiet_again.numbers < _NO_REST_CHARS * evidence.ledger.char_ns))
    return again < _NEARLY_ALL * soon or not soon


def answers_too_many(evidence: Evidence, unit: UnitLedger) -> int:
    """By how many a unit's right answers are more than the requests to it that were heard: one device answers each once.
    0 where it is so of others too, whose requests the tap does not hear."""
    if not evidence.ordered or not evidence.is_open(Symptom.DOUBLES, unit.unit):
        return 0
    found = _surplus(evidence, unit)
    if found < max(_MANY, _SOME * unit.asked):
        return 0
    others = evidence.others(unit)
    most = max((_surplus(evidence, other) / other.asked for other in others), default=0.0)
    return found if found >= _FAR_MORE * most * unit.asked else 0


def _surplus(evidence: Evidence, unit: UnitLedger) -> int:
    again = evidence.echoed_again(unit)
    return max(unit.answered + unit.loose - unit.unfit - unit.asked + 2 * again, 0)


def timed_by_the_master(evidence: Evidence, unit: UnitLedger) -> list[Signature]:
    """Damaged answers of a unit into which the master's own next request was sent, for it came by its timer: they begin
    just when it gives up, or end always as long behind their request, though the unit answers now sooner, now later."""
    readings = [each for each in evidence.readings(unit) if each.delay >= 0]
    found = [*_begun_at_timeout(evidence, unit, readings), *asked_again_into(evidence, unit)]
    if _end_in_step(evidence, readings):
        found += [each for each in readings if each.damage is not AnswerDamage.HEAD]
    return [each for each in readings if each in found]


def _begun_at_timeout(evidence: Evidence, unit: UnitLedger, readings: Sequence[Signature]) -> Sequence[Signature]:
    timeout, good = evidence.timeout_ns or 0.0, unit.delays.numbers
    begun = [each for each in readings if abs(each.delay - timeout) <= _AT_ONCE * timeout]
    steady = len(good) < _TOLD or strays([each.delay for each in begun]) < _STEADY * strays(good)
    return begun if steady and len(begun) >= _TOLD and evidence.verdict.wait_ns < _AT_ONCE * timeout else ()


def _end_in_step(evidence: Evidence, readings: Sequence[Signature]) -> bool:
    char_ns, run_into = evidence.ledger.char_ns, [each for each in readings if each.damage in _RUN_INTO]
    run_into = [each for each in run_into if each.length >= each.due]
    ends, begun = [e.delay + e.length * char_ns for e in run_into], strays([each.delay for each in run_into])
    steady = strays(ends) + evidence.verdict.wait_ns < _STEADIER * begun + char_ns
    return len(ends) >= _TOLD and begun > 2 * char_ns and steady


def given_up_by_timer(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether nearly all requests to a unit that stayed without an answer were followed when the master's timeout was
    over, and no sooner: what comes late then met nobody else's request. False where nobody knows."""
    timeout, off = evidence.timeout_ns, evidence.verdict.wait_ns
    if timeout is None:
        return False
    if off > _TIMER_TOLD * timeout:  # no clock makes waits more alike than they are
        every = np.concatenate([each.quiet_waits.numbers for each in evidence.units])
        if len(every) < 2 * _TOLD or np.median(every) < _UNTOLD * timeout:
            return False  # of requests that a tap hands over at once nobody knows what was between them
        return strays(every) < _STEADY * timeout
    waits = unit.quiet_waits  # what is late, and taken for the answer, ends a wait as well
    waits = waits if len(waits) >= _TOLD else unit.waits
    return len(waits) >= _TOLD and 1 - waits.below(_SOONER * timeout - off) >= _BY_TIMER


def late_of_any(evidence: Evidence) -> int:
    """Answers that came behind another request, whoever sent them, but for those that the master's own timer explains;
    0 where it is some units that are late, for a second master's requests meet the answers of all."""
    return 0 if late_units(evidence) else sum(unit.late for unit in _untimed(evidence))


def late_units(evidence: Evidence) -> list[UnitLedger]:
    """Units that are late nearly whenever one is, though others are asked as well; none where the master's timer tells."""
    units = sorted(_untimed(evidence), key=lambda unit: -unit.late / max(unit.asked, 1))
    late, asked = sum(unit.late for unit in units), sum(unit.asked for unit in units)
    mine = of = 0
    for count, unit in enumerate(units, 1):
        if count > 1 and unit.late < _OFTEN_LATE * unit.asked:
            break  # so seldom another master meets those that it meets
        mine, of = mine + unit.late, of + unit.asked
        if late and mine >= _MOST_LATE * late and mine * log2(mine * asked / (late * of)) >= _ONE_LATE_BITS * count:
            return units[:count]
    return []


def _untimed(evidence: Evidence) -> list[UnitLedger]:
    units = [unit for unit in evidence.units if evidence.is_open(Symptom.LATENESS, unit.unit)]
    return [unit for unit in units if not given_up_by_timer(evidence, unit)]


def spared_bits(evidence: Evidence, unit: UnitLedger) -> float:
    """How much less likely the damage of a unit is if it strikes any byte, where it never strikes the header, which is
    the same in all right answers to a request; 0 or less."""
    readings = [reading for reading in evidence.readings(unit) if reading.due > _HEADER]
    spared = [reading for reading in readings if reading.heard.startswith(known_header(reading.request)[:_HEADER])]
    if not spared or len(spared) < _NEARLY_ALL * len(readings) or not evidence.damaged(unit):
        return 0.0
    survive = log1p(-min(evidence.damaged(unit) / unit.asked, _MOST_HIT))
    whole = exp(survive)
    return sum(log2((exp(survive * _HEADER / each.due) - whole) / (1 - whole)) for each in spared)


def _mean_due(evidence: Evidence, unit: int) -> float:
    """Bytes of an exchange with a unit, about."""
    polls = evidence.polls_of(unit)
    asked = sum(poll.asked for poll in polls)
    return sum(poll.asked * poll.about_bytes for poll in polls) / asked if asked else _ABOUT


_SPELLS_BITS: Final = 14.0


def spells_of_hits(evidence: Evidence) -> tuple[float, Bools]:
    """The parts of the time in which the bus is hit, and what they save in bits; 0 where that may be chance."""
    grid = evidence.ledger.grid
    found, inside = spells_of(grid.counts("damage"), grid.counts("asked"))
    return (found if found >= _SPELLS_BITS and evidence.ledger.timed else 0.0), inside


def span_of_hits(evidence: Evidence) -> dict[str, Any]:
    """`since` and `until` of a suspicion, by the parts of the time with hits; nothing where there are none."""
    grid = evidence.ledger.grid
    parts = np.flatnonzero(grid.counts("damage"))
    if not len(parts):
        return {}
    since = (grid.begin_ns or 0) + int(parts[0]) * grid.width_ns
    return {"since": since, "until": end_of_part(evidence, int(parts[-1]) + 1)}


def end_of_part(evidence: Evidence, part: int) -> int:
    """The end of so many parts of the grid, which may reach beyond the capture's."""
    grid, ledger = evidence.ledger.grid, evidence.ledger
    reach = (grid.begin_ns or 0) + part * grid.width_ns
    return min(reach, ledger.end) if ledger.timed else reach
