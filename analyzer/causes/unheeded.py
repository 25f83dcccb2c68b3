"""Whole answers that the client did not take, as its next move shows.

A client in want of an answer goes on when its timer ends, however soon the answer came; and it may ask the same again.
One that is deaf for a while behind its requests loses just the answers that come soon.
What goes by a list does neither: its rests hang on the answer, or on when a round began, and what it asks twice it asks
twice each time.
"""

from __future__ import annotations

from math import inf, log2
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Bools
from .bits import strays
from .contrasts import RateSums
from .evidence import Evidence
from .exchanges import Ending
from .exchangetable import AskedRows

_LEAST: Final = 4
_USUAL: Final = 0.25  # of the rests behind good answers
_FAR_LONGER: Final = 3.0
_ALIKE: Final = 0.1  # of a wait
_STEADIER: Final = 0.5
_IN_STEP: Final = 0.1
_NEARLY_ALL: Final = 0.9
_SEVERAL: Final = 3  # polls
_TURNS: Final = 5
_TOLD: Final = 3.0
_OF_READS: Final = 4  # functions up to here
_SURE_BITS: Final = 10.0


def unheeded(evidence: Evidence) -> dict[int, int]:
    """About how many good answers of each unit the client did not take; units of which none is known are left out."""
    off = evidence.verdict.wait_ns
    if not evidence.ledger.timed or not np.isfinite(off):
        return {}
    rows = evidence.ledger.table.rows
    good = (rows.outcome == Ending.OK) & (rows.wait >= 0) & (rows.delay >= 0) & (rows.due > 0)
    if not good.any():
        return {}
    rests = rows.rested.astype(np.float64)
    far = good & (rests > _FAR_LONGER * max(float(np.quantile(rests[good], _USUAL)), 0.0) + off)
    lost = (far & _by_timer(rows, rests, far, off)) | _again(rows, good, far, off)
    long = far & (rests > _TOLD * off)  # what a clock adds to a delay it takes from the rest
    lost[good] |= long[good] & (_too_soon(rows[good], long[good]) | _behind_any(rows[good], far[good]))
    count = np.bincount(rows.unit[lost], minlength=256)
    return {
        unit: round(int(count[unit]) * evidence.ledger.table.weight)
        for unit in np.flatnonzero(count >= _LEAST).tolist()
    }


def _by_timer(rows: AskedRows, rests: NDArray[np.float64], far: Bools, off: float) -> Bools:
    """Those behind which the next request comes as long behind the one before it, whatever its answer took: steadier so
    than as a rest behind the answer, or as the rest of a round that the exchange before is part of."""
    found, before = np.zeros(len(rows), np.bool_), np.zeros(len(rows))
    known = np.zeros(len(rows), np.bool_)
    before[1:], known[1:] = np.diff(rows.time), (np.diff(rows.number) == 1) & ~far[:-1]
    for unit in np.unique(rows.unit[far]).tolist():
        mine = np.flatnonzero(far & known & (rows.unit == unit))
        waits = rows.wait[mine]
        mine = mine[np.abs(waits - np.median(waits)) <= _ALIKE * np.median(waits)] if len(mine) else mine
        if len(mine) < _LEAST:
            continue
        wait, others = rows.wait[mine].astype(np.float64), (strays(rests[mine]), strays(rows.wait[mine] + before[mine]))
        if min(others) > off and strays(wait) < _STEADIER * min(others):
            found |= far & (rows.unit == unit) & (np.abs(rows.wait - np.median(wait)) <= _ALIKE * np.median(wait))
    return found


def _behind_any(rows: AskedRows, far: Bools) -> bool:
    """Whether the client rests always as long, behind any of its polls alike: the rest of a round or of a timer comes
    behind the same ones."""
    which, polls = _polls(rows)
    waits = rows.wait[far]
    if len(waits) < 2 * _LEAST or len(np.unique(which[far])) < _SEVERAL:
        return False
    alike = np.abs(waits - np.median(waits)) <= _ALIKE * np.median(waits)
    sums, hits, of = RateSums(len(far)), np.bincount(which, far, polls).astype(np.int64), np.bincount(which)
    by_poll, anyhow = float(sums.bits(hits, of).sum()), float(sums.bits(int(hits.sum()), len(far)))
    return bool(alike.mean() >= _NEARLY_ALL and anyhow > by_poll)


def _polls(rows: AskedRows) -> tuple[NDArray[np.intp], int]:
    """The number of each one's poll, and how many there are."""
    polls, which = np.unique(rows.poll, return_inverse=True)
    return which, len(polls)


def _too_soon(rows: AskedRows, far: Bools) -> Bools:
    """Answers that come sooner than a client hears again behind its request: where that, the same for all polls, or for all
    behind which it ever rests, tells the rests better than the polls do, each with a rate of its own. The rest of a round
    is left out: it is longer where answers come soon."""
    which, polls = _polls(rows)
    mine, of = np.bincount(which, far, polls), np.bincount(which, minlength=polls)
    known = which != int(np.argmax(np.where(mine < of, mine, 0)))
    found = max(_told_by_delay(rows.delay, far, which, known & (mine[which] >= least)) for least in (0, 1))
    return far & (rows.delay <= found[1]) if found[0] >= _SURE_BITS else np.zeros(len(far), np.bool_)


def _told_by_delay(delays: NDArray[np.int64], far: Bools, polls: NDArray[np.intp], known: Bools) -> tuple[float, int]:
    """How much better (bits) the delay tells the rests behind these answers than their polls do, and the longest delay
    behind which the client rests."""
    delays, far, polls = delays[known], far[known], polls[known]
    order = np.argsort(delays, kind="stable")
    values, below = delays[order], np.concatenate(([0], far[order].cumsum()))
    size, every = len(far), int(below[-1])
    edges = np.flatnonzero(values[1:] != values[:-1]) + 1
    edges = edges[below[edges] * (size - edges) > (every - below[edges]) * edges]  # more of the sooner ones
    if not len(edges):
        return -inf, 0
    sums = RateSums(size)
    bits = sums.bits(below[edges], edges) + sums.bits(every - below[edges], size - edges) - log2(len(edges))
    best = int(np.argmax(bits))
    own = np.bincount(polls, far).astype(np.int64), np.bincount(polls)
    some = 2 * own[0] > own[1]
    by_poll = float(sums.bits(*own).sum())
    always = sum(float(sums.bits(*(int(each[which].sum()) for each in own))) for which in (some, ~some))
    return float(bits[best]) - max(by_poll, always - np.count_nonzero(own[1])), int(values[edges[best] - 1])


def _again(rows: AskedRows, good: Bools, far: Bools, off: float) -> Bools:
    """Those that are read again: of several polls after a rest, or now here, now there. A list asks the same twice by turns
    that tell when, and what has a timer of its own in step."""
    which, polls = _polls(rows)
    lost, bits, rested = np.zeros(len(rows), np.bool_), 0.0, 0
    for mine in (np.flatnonzero(which == poll) for poll in range(polls)):
        again = rows.next_same[mine]
        if rows.function[mine[0]] <= _OF_READS and again.any() and not _is_in_step(rows.time[mine], again[:-1], off):
            lost[mine] = again & good[mine]
            bits += _by_turns_bits(again)
            rested += bool(np.count_nonzero(again & far[mine]) >= _LEAST)
    found = rested > 1 or (bits <= 0 and np.count_nonzero(lost) >= 2 * _LEAST)
    return lost if found else np.zeros_like(lost)


def _by_turns_bits(again: Bools) -> float:
    """How much better the last few tell whether the next one comes again than one rate does (bits)."""
    sums, hits = RateSums(len(again)), again.astype(np.int64)
    padded = np.concatenate((np.zeros(_TURNS, np.int64), hits))
    before = sum(padded[n : n + len(hits)] << n for n in range(_TURNS))
    mine, of = np.bincount(before, hits).astype(np.int64), np.bincount(before)
    return float(sums.bits(mine, of).sum() - sums.bits(int(hits.sum()), len(hits)))


def _is_in_step(times: NDArray[np.int64], again: Bools, off: float) -> bool:
    """Whether a poll comes back as soon when others are asked between."""
    apart = np.diff(times)
    if again.all():
        return True
    at_once, between = float(np.median(apart[again])), float(np.median(apart[~again]))
    return abs(between - at_once) <= _IN_STEP * at_once + off
