"""What was hit on the line: answers, requests, the idle line; and when."""

from __future__ import annotations

from math import exp, log1p, log2
from typing import Any, Final

import numpy as np

from .bits import likelihood_bits, surplus_bits
from .evidence import Evidence
from .registry import Symptom
from .signatures import Behind, known_header
from .unitledger import UnitLedger

WELL: Final = 0.03  # of stray bytes that hit frames all the same, on a line that floats when nobody drives it
_NEARLY_ALL: Final = 0.9
_SURE_BITS: Final = 30.0
_ABOUT_ONE: Final = 0.95
_SPARED: Final = 2  # units
_MOST_LATE: Final = 0.85  # what one late answer meets may make another late
_ONE_LATE_BITS: Final = 12.0
_MOST_HIT: Final = 0.98
_ABOUT: Final = 20.0  # bytes
_TOLD: Final = 5  # waits or delays, by which a clock's errors even out
_SOONEST: Final = 0.05  # of delays
_SOONER: Final = 0.8  # of them: no timer strays so far
_HEADER: Final = 3  # bytes: unit, function, byte count

# How damage spreads over kinds where it strikes all senders alike.
ALIKE: Final = {"bits": 0.24, "bits-tail": 0.03, "head": 0.09, "ahead": 0.03, "middle": 0.2, "whole": 0.13, "long": 0.06, "tail": 0.03,
                 "cut": 0.08, "cut-short": 0.05, "crossed": 0.02, "convention": 0.001, "count": 0.002, "other": 0.01}  # fmt: skip


class Hits:
    """How many exchanges were hit: frames (answers, requests) and the idle line."""

    def __init__(self, evidence: Evidence) -> None:
        self.damaged = sum(map(evidence.damaged, evidence.units))
        self.requests = sum(evidence.behind(unit, Behind.REQUEST) for unit in evidence.units)
        self.idle = sum(evidence.behind(unit, Behind.NOISE, Behind.ZEROS) for unit in evidence.units)
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
    units = [unit for unit in evidence.units if unit.asked and evidence.is_open(Symptom.DAMAGE, unit.unit)]
    if len(units) < 2:
        return 0.0
    hits = [min(evidence.damaged(unit), unit.asked) for unit in units]
    lengths = [_mean_due(evidence, unit.unit) for unit in units]
    exposed = sum(unit.asked * length for unit, length in zip(units, lengths, strict=True))
    surely = -log1p(-min(sum(hits) / sum(unit.asked for unit in units), _MOST_HIT))
    a_byte = surely * sum(unit.asked for unit in units) / exposed
    bits, price = 0.0, 0.5 * log2(sum(unit.asked for unit in units) + 2)
    for unit, hit, length in zip(units, hits, lengths, strict=True):
        shared = likelihood_bits(hit, unit.asked, 1 - exp(-a_byte * length))
        bits += min(0.0, shared - likelihood_bits(hit, unit.asked, (hit + 0.25) / (unit.asked + 0.5)) + price)
    return bits


def is_one_units(evidence: Evidence) -> bool:
    """Whether nearly all damage is that of one unit, which has no such share of the line's bytes."""
    units = [unit for unit in evidence.units if unit.asked]
    hits = [evidence.damaged(unit) for unit in units]
    if len(units) < 2 or not sum(hits):
        return False
    exposed = [unit.asked * _mean_due(evidence, unit.unit) for unit in units]
    at = hits.index(max(hits))
    share = exposed[at] / sum(exposed)  # by chance alone so many of the hits would be its
    return hits[at] >= _NEARLY_ALL * sum(hits) and -sum(hits) * log2(share) >= _SURE_BITS


def is_about_one(evidence: Evidence) -> bool:
    """Whether nearly all that was hit is a unit's or at most two behind what it was asked, and that is no such share of the
    time that exchanges take: what comes from elsewhere, a second master too, meets whatever is going on.

    Not told where but one other unit is spared: two cycles may keep step, and meet at the same place each time.
    """
    successors = evidence.ledger.successors
    hit = {unit for unit, _ in successors.met if evidence.is_open(Symptom.DAMAGE, unit)}  # but what is explained
    if len({unit.unit for unit in evidence.units} - hit) < _SPARED:
        return False
    every = sum(count for (unit, _), count in successors.met.items() if unit in hit)
    times = {unit.unit: _mean_time(evidence, unit) for unit in evidence.units}
    whole = sum(count * times.get(unit, 0.0) for (unit, _), count in successors.followed.items())
    for one in times:
        hits = sum(count for (unit, near), count in successors.near_hit.items() if near == one and unit in hit)
        share = sum(n * times.get(unit, 0.0) for (unit, near), n in successors.near.items() if near == one) / whole
        if hits >= _ABOUT_ONE * every and surplus_bits(hits, every, share) >= _SURE_BITS:
            return True
    return False


def interrupted(evidence: Evidence, unit: UnitLedger) -> int:
    """Requests to a unit behind which another came well before it ever answers, for which the master does wait: nobody
    gives up so soon, that is another who sends. Of a coarse clock all or none, by the mean of the waits."""
    waits, delays, off = unit.waits.numbers, unit.delays.numbers, evidence.verdict.wait_ns
    if len(waits) < 1 or len(delays) < _TOLD or not evidence.is_open(Symptom.SILENCE, unit.unit):
        return 0
    soonest = float(np.quantile(delays, _SOONEST))
    early = float((waits < _SOONER * (soonest - off)).mean())
    if len(waits) >= _TOLD:
        error = 3 * off / (12 * len(waits)) ** 0.5  # of the mean of times that are wrong by up to so much
        early = 1.0 if waits.mean() + error < _SOONER * float(np.quantile(delays, 0.25)) else early
    return round(early * len(unit.waits))


def late_of_any(evidence: Evidence) -> int:
    """Answers that came behind another request, whoever sent them; 0 where it is one unit that is late, for a second
    master's requests meet the answers of all."""
    units = [unit for unit in evidence.units if evidence.is_open(Symptom.LATENESS, unit.unit)]
    late = sum(unit.late for unit in units)
    if not late:
        return 0
    latest = max(units, key=lambda unit: unit.late)
    own = latest.late * log2(latest.late * sum(unit.asked for unit in units) / (late * latest.asked))
    return 0 if latest.late >= _MOST_LATE * late and own >= _ONE_LATE_BITS else late


def spared_bits(evidence: Evidence, unit: UnitLedger) -> float:
    """How much less likely the damage of a unit is if it strikes any byte, where it never strikes the header, which is
    the same in all right answers to a request; 0 or less."""
    readings = [reading for reading in evidence.readings(unit) if reading.due > _HEADER]
    spared = [reading for reading in readings if reading.heard.startswith(known_header(reading.request)[:_HEADER])]
    if not spared or len(spared) < _NEARLY_ALL * len(readings):
        return 0.0
    survive = log1p(-min(evidence.damaged(unit) / unit.asked, _MOST_HIT))
    bits = 0.0
    for reading in spared:
        whole, header = exp(survive), exp(survive * _HEADER / reading.due)
        bits += log2((header - whole) / (1 - whole))
    return bits


def _mean_due(evidence: Evidence, unit: int) -> float:
    """Bytes of an exchange with a unit, about."""
    polls = evidence.polls_of(unit)
    asked = sum(poll.asked for poll in polls)
    return sum(poll.asked * poll.about_bytes for poll in polls) / asked if asked else _ABOUT


def _mean_time(evidence: Evidence, unit: UnitLedger) -> float:
    """How long an exchange with a unit takes (ns), about."""
    waits = unit.delays.numbers
    return _mean_due(evidence, unit.unit) * evidence.ledger.char_ns + (float(waits.mean()) if len(waits) else 0.0)


def span_of_hits(evidence: Evidence) -> dict[str, Any]:
    """`since` and `until` of a suspicion, by the parts of the time with hits; nothing where there are none."""
    grid = evidence.ledger.grid
    parts = np.flatnonzero(grid.counts("damage"))
    if grid.begin_ns is None or not len(parts):
        return {}
    return {"since": grid.begin_ns + int(parts[0]) * grid.width_ns, "until": end_of_part(evidence, int(parts[-1]) + 1)}


def end_of_part(evidence: Evidence, part: int) -> int:
    """The end of so many parts of the grid, which may reach beyond the capture's."""
    grid, ledger = evidence.ledger.grid, evidence.ledger
    reach = (grid.begin_ns or 0) + part * grid.width_ns
    return min(reach, ledger.end) if ledger.timed else reach
