"""Units all of whose values stand still together for far longer than they ever do, as no machine does that rests.

What stands still so stops at no leap, and not at 0; and then it leaps to where it would be, or the capture ends. A
machine that rests goes on from where it stood, and much of it is 0 meanwhile.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Bools
from .registerstates import PollValues
from .valueforms import leap_bits

MOVES: Final = 0.3  # of its reads a value that moves is another one
_COLUMNS: Final = 3  # that stand still together
_CHANGES: Final = 20  # reads of a unit at which something moved
_LONG: Final = 4  # times the longest of its usual standstills,
_RUN: Final = 12  # reads at least, and
_TO_THE_END: Final = 24  # of each poll in one that does not end
_USUAL_RUN: Final = 0.8
_AT_REST: Final = 0.25  # of what moves may be 0 then: else a machine stands
_LEAP_BITS: Final = 6.0
_LEAST_CHANCE: Final = 0.3


class Standstill(NamedTuple):
    """All values of a unit from one moment to another: how many reads, of how many registers that move else, the first of
    them, how far these leap as they stop and as they go on, how many others are 0, and whether the capture ends in it."""

    since: int
    until: int
    reads: int
    registers: int
    address: int
    stop: float
    leap: float
    zeros: int
    lasts: bool

    def is_told(self, polls: int) -> bool:
        """Whether no machine comes to rest so, and goes on."""
        stops = self.registers >= _COLUMNS and self.zeros <= _AT_REST * self.registers and self.stop < _LEAP_BITS
        ends = self.reads >= _TO_THE_END * polls if self.lasts else self.leap >= max(_LEAP_BITS, 2 * self.stop)
        return stops and ends


def standstills(polls: Sequence[PollValues]) -> tuple[list[Standstill], float]:
    """Those of a unit that no rest explains, and bits for them."""
    times = np.concatenate([poll.times[1:] for poll in polls])
    order = np.argsort(times, kind="stable")
    times, changed = times[order], np.concatenate([_changes(poll) for poll in polls])[order]
    at = np.flatnonzero(changed)
    if len(at) < _CHANGES:
        return [], 0.0
    runs = np.diff(np.append(at, len(times))) - 1
    long = np.flatnonzero(runs >= max(_RUN, _LONG * (float(np.quantile(runs, _USUAL_RUN)) + 1)))
    ends = at[long] + runs[long]
    spans = zip(times[at[long]].tolist(), times[ends].tolist(), runs[long].tolist(), strict=True)
    last = int(times[-1])
    found = [_standstill(polls, since, until, reads, lasts=until == last) for since, until, reads in spans]
    moving = -np.log2(
        max(1 - len(at) / (len(times) - runs[long].sum()), _LEAST_CHANCE)
    )  # bits of a read without a move
    told = [each for each in found if each.is_told(len(polls))]
    return told, float(sum(moving * each.reads + each.leap for each in told))


def moving_shares(poll: PollValues) -> NDArray[np.float64]:
    """The share of reads that show another value than the read before, by register."""
    found: NDArray[np.float64] = (poll.words[1:] != poll.words[:-1]).mean(axis=0)
    return found


def _changes(poll: PollValues) -> Bools:
    found: Bools = (poll.words[1:] != poll.words[:-1]).any(axis=1)
    return found


def _standstill(polls: Sequence[PollValues], since: int, until: int, reads: int, *, lasts: bool) -> Standstill:
    """From the last change to the last read before the next."""
    addresses, zeros, stop, leap = list[int](), 0, 0.0, 0.0
    for poll in polls:
        first, end = (int(np.searchsorted(poll.times, each, "right")) for each in (since, until))
        moves = moving_shares(poll) >= MOVES * _changes(poll).mean()
        rest = poll.words[min(first, len(poll.words) - 1)] == 0
        moving = moves & ~rest
        zeros += int(np.count_nonzero(moves & rest))
        addresses += (poll.address + np.flatnonzero(moving)).tolist()
        stop += float(leap_bits(poll.words, first - 2)[moving].sum())
        leap += float(leap_bits(poll.words, end - 1)[moving].sum())
    return Standstill(since, until, reads, len(addresses), min(addresses, default=0), stop, leap, zeros, lasts)
