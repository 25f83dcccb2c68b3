"""What the client made of what the tap heard: whether it took an answer that looks damaged here.

That is not seen; its next move is. A client that got nothing waits for its timeout, or rests as long as it does behind
bad bytes, and often asks again; one that got its answer goes on as soon as it does behind good ones. Both habits are
learnt from this client: the waits behind good answers of the same unit, and how often it asks again behind silence. Of
each damaged answer the move is weighed; the sum says who lost it, the line or only the tap.
"""

from __future__ import annotations

from math import log2
from typing import Final, NamedTuple

import numpy as np

from ..deframing.tap_clock import UNKNOWN
from ..tables.schema import Bools
from .bits import likelihood_bits, strays
from .evidence import Evidence
from .exchanges import Ending
from .exchangetable import AskedRows
from .ledgerview import kept

_WELL: Final = 5  # good answers by which its usual wait is known
_RANGE: Final = (0.03, 0.97)
_TAKEN: Final = 0.85  # how often a wait is usual where it took the answer,
_LOST: Final = 0.12  # and where it did not
_AGAIN: Final = 0.6  # repeats, behind silence, of a client that asks again
_NEVER_AGAIN: Final = 0.03  # and behind answers that it took
_KNOWN: Final = 3
_TIMER: Final = 0.03  # of a timeout: so little a timer strays
_SLACK_NS: Final = 1_000_000
_TIMEOUT_NS: Final = 50_000_000  # no client gives up sooner


class Move(NamedTuple):
    """Damaged answers whose client's next move tells something, how many it seems to have taken, and bits for that it took
    them all (below 0: for that it took none)."""

    told: int
    taken: int
    bits: float


@kept
def move(evidence: Evidence, unit: int) -> Move:
    """What the client made of the damaged answers of a unit."""
    rows = evidence.rows(unit)
    damaged = rows[rows.outcome == Ending.GARBAGE]
    usual, told = _usual(evidence, rows, damaged)
    count, taken = (int(np.count_nonzero(each)) for each in (told, told & usual & ~damaged.next_same))
    bits = likelihood_bits(taken, count, _TAKEN) - likelihood_bits(taken, count, _LOST)
    again = _asks_again(evidence)
    if again is not None:
        repeated = int(np.count_nonzero(damaged.next_same))
        left = len(damaged) - repeated
        bits += left * log2((1 - _NEVER_AGAIN) / (1 - again)) + repeated * log2(_NEVER_AGAIN / again)
        count, taken = len(damaged), taken if count else left
    return Move(count, taken, bits)


@kept
def share_that_went_on(evidence: Evidence, unit: int) -> float:
    """The share of the silent requests to a unit behind which the client went on as soon as behind good answers: it got
    an answer, and the tap did not. 0 where that is not known."""
    rows = evidence.rows(unit)
    silent = rows[rows.outcome == Ending.SILENT]
    usual, told = _as_behind_good(evidence, rows, silent)
    return int(np.count_nonzero(usual & told & ~silent.next_same)) / max(int(np.count_nonzero(told)), 1)


def _usual(evidence: Evidence, rows: AskedRows, damaged: AskedRows) -> tuple[Bools, Bools]:
    """Of each damaged answer: whether the wait for the next request is as behind good ones to the same, and whether that
    is known: not where the client rests as long behind answers as its timer waits in vain."""
    usual, told = _as_behind_good(evidence, rows, damaged)
    good = rows[(rows.outcome == Ending.OK) & (rows.wait >= 0)]
    in_vain = rows.wait[(rows.outcome == Ending.SILENT) & (rows.wait >= 0)]
    usual_vain = float(np.median(in_vain)) if len(in_vain) >= _KNOWN and len(good) else float("inf")
    by_timer = np.isfinite(usual_vain) and strays(in_vain) < _TIMER * usual_vain
    if by_timer and float(np.quantile(good.wait, _RANGE[1])) + evidence.verdict.wait_ns > usual_vain:
        told[:] = False
    return usual, told


def _as_behind_good(evidence: Evidence, rows: AskedRows, bad: AskedRows) -> tuple[Bools, Bools]:
    """Of each of these: whether the wait for the next request is as behind good answers to the same, and whether enough
    of those are known."""
    usual, told = np.zeros(len(bad), np.bool_), np.zeros(len(bad), np.bool_)
    off = evidence.verdict.wait_ns
    if off == UNKNOWN:
        return usual, told
    good = rows[(rows.outcome == Ending.OK) & (rows.wait >= 0)]
    for due in np.unique(bad.due).tolist():
        waits = good.wait[good.due == due]
        mine = (bad.due == due) & (bad.wait >= 0)
        if len(waits) < _WELL or not mine.any():
            continue
        low, high = np.quantile(waits, _RANGE)
        if off > max(high, _TIMEOUT_NS):
            continue  # the tap may be wrong by more than what sets them apart
        usual |= mine & (bad.wait >= low - _SLACK_NS) & (bad.wait <= high + _SLACK_NS)
        told |= mine
    return usual, told


def _asks_again(evidence: Evidence) -> float | None:
    """How often the client asks again behind silence; None where nobody knows, or it does so behind good answers too."""
    rows = evidence.ledger.table.rows
    silent, good = rows.outcome == Ending.SILENT, rows.outcome == Ending.OK
    if np.count_nonzero(silent) < _KNOWN or not good.any():
        return None
    again, anyhow = float(rows.next_same[silent].mean()), float(rows.next_same[good].mean())
    return min(again, 0.98) if again >= _AGAIN and anyhow <= _NEVER_AGAIN else None
