"""Good answers that came when the client had given up, as its timer shows: it goes on, or asks once more, when that ends."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from math import log2
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..deframing.tap_clock import UNKNOWN
from ..tables.transactions import ECHOED
from .bits import likelihood_bits, strays
from .evidence import Evidence
from .exchanges import Ending
from .ledgerview import kept
from .repeats import waits_longer
from .unitledger import UnitLedger

_LEAST: Final = 3
_SURE_BITS: Final = 16.0
_ALONE_BITS: Final = 40.0  # where nothing else tells it
_SOONER: Final = 0.85
_HURRIED: Final = 5  # answers, each of which would come so by chance once in ten times at the most
_OTHERS: Final = 2
_STEADY: Final = 0.3
_FAR_SLOWER: Final = 3.0
_FAR: Final = 3.0  # times what quick answers stray, by the clock's doing too
_QUICK: Final = 15  # answers by which a client's rests are known
_BOUNDS: Final = 64  # that are looked at
_WIDTH: Final = 0.1  # of how far rests stray
_LEAST_WIDTH_NS: Final = 2e5
_PLACES: Final = 4000
_EACH: Final = 0.5  # bits, of each slow answer
_ANY: Final = 0.2  # of a rest that was never seen


@dataclass(frozen=True, slots=True)
class Slow:
    """Good answers that the master did not take: how many, and the delay (ns) from which on."""

    count: int = 0
    bound_ns: float = UNKNOWN


@kept
def gave_up_ns(evidence: Evidence) -> float:
    """The time from a request on after which the client goes on by its timer, answer or none, as slow good answers show it:
    the next request comes as long behind that time as it else does behind an answer. Infinite where nothing shows it: the
    same where requests come by a timer anyhow, and quick answers do not move them either."""
    rows, off = evidence.ledger.table.rows, evidence.verdict.wait_ns
    good = (rows.outcome == Ending.OK) & (rows.wait >= 0) & (rows.delay >= 0) & (rows.due > 0) & ~rows.next_same
    good &= ~ECHOED[rows.function]  # what reads like an answer to a write may be the next request
    took, turns = rows.took[good].astype(np.float64), rows.wait[good].astype(np.float64)
    if len(took) < _QUICK + _HURRIED or not np.isfinite(off):
        return UNKNOWN
    order = np.argsort(took)
    took, turns, delays = took[order], turns[order], rows.delay[good][order]
    best, most = UNKNOWN, _SURE_BITS + log2(_BOUNDS)
    for first in np.unique(np.linspace(_QUICK, len(took) - _HURRIED, _BOUNDS).astype(int)).tolist():
        rests = (turns - took)[:first]
        rested, usual = _SeenRests(rests, off), float(took[first // 2])
        far = usual + _FAR * max(off, usual - float(took[first // 20]), usual / 4)
        if strays(turns[:first]) < strays(rests) - off or np.median(delays[first:]) < 2 * np.median(delays[:first]):
            continue  # what is longer is not slow
        if np.median((turns - took)[first:]) > np.median(rests) + off:
            continue  # what comes by a timer that ended before comes sooner behind the answer, not later
        for bound in {float(took[first]), min(float(np.median(turns[first:]) - np.median(rests)), float(took[first]))}:
            bits = float((rested.bits(turns[first:] - bound) - rested.bits(turns[first:] - took[first:])).sum())
            if bound > far and bits > max(most, _EACH * len(turns[first:])):
                best, most = bound, bits
    return best


class _SeenRests:
    """How likely rests are (log2), by those seen."""

    def __init__(self, seen: NDArray[np.float64], off: float) -> None:
        self._width = max(off / 2, _WIDTH * strays(seen), _LEAST_WIDTH_NS)
        self._least = float(seen.min()) - self._width
        places = ((seen - self._least) / self._width).astype(np.int64)
        self._counts = np.convolve(np.bincount(np.minimum(places, _PLACES)), (0.25, 0.5, 0.25), "same")
        self._every = len(seen)

    def bits(self, rests: NDArray[np.float64]) -> NDArray[np.float64]:
        """Of each."""
        places = ((rests - self._least) / self._width).astype(np.int64)
        inside = (places >= 0) & (places < len(self._counts))
        counts = np.where(inside, self._counts[np.clip(places, 0, len(self._counts) - 1)], 0.0)
        found: NDArray[np.float64] = np.log2((counts + _ANY) / self._every)
        return found


def given_up_on(evidence: Evidence, unit: UnitLedger) -> Slow:
    """Good answers of a unit that came when the client had given up. `bound_ns`: from the request to the answer's end."""
    bound, rows = gave_up_ns(evidence), evidence.rows(unit.unit)
    late = (rows.outcome == Ending.OK) & (rows.delay >= 0) & ~ECHOED[rows.function] & (rows.took >= bound)
    return Slow(round(int(np.count_nonzero(late)) * evidence.ledger.table.weight), bound)


def asked_again_though_slow(evidence: Evidence, unit: UnitLedger) -> Slow:
    """Good answers whose request the master repeats all the same, where it is the slow ones, of one poll beyond doubt, or
    it does so by its timer: sooner behind them than it pauses else. A list may hold a request twice, one behind the
    other, whatever that takes."""
    if len(unit.redundant) < _LEAST or waits_longer(evidence, unit, 1.0):
        return Slow()
    if _sooner(evidence, unit) or repeated_by_timer(unit):
        return _slow_ones(unit, unit.redundant.numbers, unit.heeded.numbers, _SURE_BITS)
    rows = evidence.rows(unit.unit)
    good = rows[(rows.outcome == Ending.OK) & (rows.delay >= 0)]
    polls = Counter(good.poll[good.next_same].tolist()).most_common(1)
    mine, delays = good.poll == (polls[0][0] if polls else 0), good.delay.astype(np.float64)
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


def repeated_by_timer(unit: UnitLedger) -> bool:
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
    medians = [other.pauses.quantile(0.5) for other in evidence.others(unit)]
    elsewhere = [median - off for median in medians if median is not None]
    usual = min((unit.pauses.total - repeated.total) / others, *elsewhere, UNKNOWN)
    return bool(repeated.total / len(repeated) + 2 * error < _SOONER * usual)


def _rate_bits(hits: int, misses: int) -> float:
    return likelihood_bits(hits, hits + misses, (hits + 0.5) / (hits + misses + 1))


def all_repeated(evidence: Evidence, unit: UnitLedger) -> int:
    """Good answers, all slow beside those of others, whose requests are repeated by the master's timer."""
    delay, others = unit.delays.quantile(0.1), evidence.others(unit)
    delays = [value for other in others if (value := other.delays.quantile(0.5)) is not None]
    slow = delay is not None and len(delays) >= _OTHERS and delay > _FAR_SLOWER * max(delays)
    met = unit.behind + unit.count(Ending.GARBAGE)  # a list of one poll repeats it by a timer too, and meets nothing
    return len(unit.redundant) if slow and met >= _LEAST and repeated_by_timer(unit) else 0
