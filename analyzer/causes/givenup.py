"""Good answers that came when the client had given up, as its timer shows: it goes on, or asks once more, when that ends."""

from __future__ import annotations

from bisect import insort
from collections import Counter
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..deframing.tap_clock import UNKNOWN
from .bits import likelihood_bits, strays
from .evidence import Evidence
from .exchanges import Ending
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


@dataclass(frozen=True, slots=True)
class Slow:
    """Good answers that the master did not take: how many, and the delay (ns) from which on."""

    count: int = 0
    bound_ns: float = UNKNOWN


def hurried(evidence: Evidence, unit: UnitLedger) -> Slow:
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
    medians = [other.pauses.quantile(0.5) for other in evidence.units if other is not unit]
    elsewhere = [median - off for median in medians if median is not None]
    usual = min((unit.pauses.total - repeated.total) / others, *elsewhere, UNKNOWN)
    return bool(repeated.total / len(repeated) + 2 * error < _SOONER * usual)


def _rate_bits(hits: int, misses: int) -> float:
    return likelihood_bits(hits, hits + misses, (hits + 0.5) / (hits + misses + 1))


def all_repeated(evidence: Evidence, unit: UnitLedger) -> int:
    """Good answers, all slow beside those of others, whose requests are repeated by the master's timer."""
    delay, others = unit.delays.quantile(0.1), [other for other in evidence.units if other is not unit]
    delays = [value for other in others if (value := other.delays.quantile(0.5)) is not None]
    slow = delay is not None and len(delays) >= _OTHERS and delay > _FAR_SLOWER * max(delays)
    met = unit.behind + unit.count(Ending.GARBAGE)  # a list of one poll repeats it by a timer too, and meets nothing
    return len(unit.redundant) if slow and met >= _LEAST and repeated_by_timer(unit) else 0
