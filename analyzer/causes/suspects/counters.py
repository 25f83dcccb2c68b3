"""Whole numbers of two registers: counters that do not only count, words of different moments."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...registers.looks import NO_VALUE_PAIR
from ...tables.findings import Severity
from ...tables.schema import Int64s
from ..evidence import Evidence
from ..registerstates import PollValues
from ..registry import Suspicion, suspect
from ..sisters import READS, open_reads, sisters
from ..valueforms import moves, shorter_way
from .common import value_suspicion

_WORD: Final = 1 << 16
_LEAST_UP: Final = 5
_COUNTS: Final = 0.9  # of the steps of a counter that do not go down
_USUAL: Final = 0.7  # of a counter's steps up are no larger than its usual one
_LEAP: Final = 60.0  # times its usual step, which no pause explains
_NEAR: Final = 4.0  # usual steps
_COLUMNS: Final = 3
_MOVES: Final = 0.3
_BITS: Final = 30.0  # for each jump
_MOST_BITS: Final = 240.0
_TO_AND_FRO: Final = 2  # steps that one answer makes in the place of another
_TORN: Final = 12  # reads within which a carry comes to the other word
_WAY_BITS: Final = 2.0  # for going the same way,
_SIGN_BITS: Final = 8.0  # for a word that is a sign only,
_CARRY_BITS: Final = 5.0  # and for each time that both words are of one moment: these are one number's
_CARRIES: Final = 4
_COARSE: Final = _WORD // 8  # the step of a low word from which on nobody knows how often it carried
_SELDOM: Final = 0.5
_ONE_ROUND: Final = 0.5  # of the time from read to read
_EPOCH: Final = 1_000_000_000  # seconds since 1970: a clock is set
_SECOND_NS: Final = 1e9


@suspect(
    "counter-jumps",
    Severity.WARNING,
    blame="unit",
    text="A 32-bit value of unit {unit} (register {address}) jumps: {jumps:time|times} it fell back or leapt, by up to "
    "{most:,}[: {torn:time|times} its two words were of different moments]",
    share="{jumps:,} of {reads} reads",
    deciding_test="Record this value alone for an hour, and compare it with the unit's own display",
    remedy="Check whether one value is read in two requests, or whether the unit loses it at a restart",
)
def counter_jumps(evidence: Evidence) -> Iterator[Suspicion]:
    """Counters that do not only count, where those of sister units do; numbers whose words are of different moments."""
    for group in sisters(evidence):
        for order in (0, 1):
            counting = [_counting(poll, order) for poll in group]
            for column in np.flatnonzero(np.any(counting, axis=0)).tolist():
                pairs = [
                    _Pair.of(poll, column, order) for poll, may in zip(group, counting, strict=True) if may[column]
                ]
                yield from _jumping(evidence, pairs)
    for _, polls in open_reads(evidence):
        yield from _torn(polls)


class _Pair(NamedTuple):
    """Two registers of a unit as one number: the more significant word, the less significant one, read by read."""

    poll: PollValues
    address: int
    high: Int64s
    low: Int64s
    times: Int64s

    @classmethod
    def of(cls, poll: PollValues, column: int, order: int) -> _Pair:
        """Two neighbours; `order`: 1 where the less significant word comes first."""
        words = poll.words[:, column : column + 2].astype(np.int64)
        high, low = words[:, order], words[:, 1 - order]
        known = ~np.isin(high << 16 | low, NO_VALUE_PAIR)
        return cls(poll, poll.address + column, high[known], low[known], poll.times[known])

    @property
    def values(self) -> Int64s:
        """Without a sign."""
        return self.high << 16 | self.low

    @property
    def pauses(self) -> NDArray[np.float64]:
        """How much longer than usual it was from read to read."""
        apart = np.diff(self.times).astype(np.float64)
        return np.maximum(apart / max(float(np.median(apart)), 1.0), 1.0)

    def jumps(self) -> Int64s | None:
        """Where a counter falls back, or leaps by more than the time between two reads; None where these are no counter."""
        values, pauses = self.values, self.pauses
        steps = np.diff(values)
        up = steps[steps > 0]
        if len(up) < _LEAST_UP or np.count_nonzero(steps < 0) > (1 - _COUNTS) * len(steps):
            return None
        usual = float(np.quantile(up, _USUAL, method="lower"))
        if usual > _WORD / 2 or self._is_clock(usual):
            return None  # not in step with the low word: rather a float
        jumps = np.flatnonzero((steps < 0) | (steps > _LEAP * usual * pauses))
        near = _NEAR * usual * pauses[jumps]
        by_words = np.abs(shorter_way(steps[jumps])) <= near  # a carry into another register than this one,
        in_tens = (np.diff(self.high)[jumps] == 1) & (self.low[jumps + 1] <= near)  # or at 60, at 10000
        return None if by_words.any() or in_tens.any() else jumps

    def begins_anew(self, jumps: Int64s) -> NDArray[np.bool_]:
        """Whether it is about 0 behind these jumps, or the less significant word alone."""
        usual = max(float(np.median(np.abs(np.diff(self.values)))), 1.0)
        begun = np.where(self.high[jumps + 1] == self.high[jumps], self.low[jumps + 1], self.values[jumps + 1])
        found: NDArray[np.bool_] = begun <= _NEAR * usual * self.pauses[jumps]
        return found

    def _is_clock(self, usual: float) -> bool:
        rate = (self.values[-1] - self.values[0]) / max(int(self.times[-1] - self.times[0]), 1) * _SECOND_NS
        return bool(self.values[0] > _EPOCH and (rate < 2 or usual < 2))

    def carries(self) -> _Carries | None:
        """How the more significant word follows the other one; None where that one moves too far to be followed.

        How often it carried is counted, and the more significant word held against it: of one number they differ by as
        much all the time, but for some reads near a carry, until the other one follows.
        """
        due = np.round(np.median(np.diff(self.values)) * self.pauses).astype(np.int64)
        steps = due + shorter_way(np.diff(self.low) - due)
        if np.count_nonzero(steps) < _LEAST_UP or np.quantile(np.abs(steps - due), _COUNTS) >= _COARSE:
            return None
        counted = self.low[0] + np.concatenate(([0], np.cumsum(steps)))
        carries, follows = np.diff(counted >> 16), moves(self.high)
        apart = np.cumsum(shorter_way(follows - carries))
        is_sign = bool(np.isin(self.high, (0, _WORD - 1)).all() and follows.any())
        return _Carries(apart, follows, int(np.count_nonzero((follows != 0) & (follows == carries))), is_sign)


class _Carries(NamedTuple):
    """By how many carries the more significant word is astray behind each read but the first, how it moves, how often it
    moves as the other one carries, and whether it is but a sign."""

    apart: Int64s
    follows: Int64s
    followed: int
    is_sign: bool

    @property
    def of_one_number(self) -> bool:
        """Whether it is never astray."""
        return self.followed > 0 and not self.apart.any()

    def torn(self) -> tuple[Int64s, float]:
        """After which reads the two words are of different moments for a while, and how unlikely it is in bits that one
        follows the other so soon by chance; none where these are no number."""
        astray = self.apart != 0
        turns = np.flatnonzero(np.diff(astray, prepend=False))
        begins, ends = turns[::2], np.append(turns[1::2], len(astray) - 1)[: len(turns[::2])]
        if not len(turns) or np.abs(self.apart).max() > 1 or (ends - begins).max() > _TORN or astray.mean() > _SELDOM:
            return turns[:0], 0.0
        moved = np.concatenate(([0], np.cumsum(self.follows)))
        both = moved[ends + 1] != moved[begins]
        chance = np.count_nonzero(self.follows) / len(self.follows) * (ends - begins + 1)[both]
        bits = float(np.sum(_WAY_BITS - np.log2(np.minimum(chance, 1))))
        bits += _CARRY_BITS * min(self.followed, _CARRIES) + _SIGN_BITS * self.is_sign
        return begins[both], bits


def _torn(polls: list[PollValues]) -> Iterator[Suspicion]:
    """Numbers whose words are of different moments; of registers that are a number with none of their neighbours."""
    read = [(pair, carries) for pair in _pairs(polls) if (carries := pair.carries()) is not None]
    whole = {pair.address + i for pair, carries in read if carries.of_one_number for i in (0, 1)}
    for pair, carries in read:
        torn, bits = carries.torn()
        if len(torn) and whole.isdisjoint((pair.address, pair.address + 1)):
            yield _suspicion(pair, torn, np.full(len(torn), _WORD), bits, torn=len(torn))


def _pairs(polls: list[PollValues]) -> Iterator[_Pair]:
    """Neighbours that are read in one request, or in two in one round."""
    for poll in polls:
        carried = _carried(poll.words)
        yield from (_Pair.of(poll, column, 0) for column in np.flatnonzero(carried[:-1]).tolist())
        yield from (_Pair.of(poll, column, 1) for column in np.flatnonzero(carried[1:]).tolist())
    for one, two in pairwise(polls):
        if one.function == two.function and one.address + one.words.shape[1] == two.address:
            yield from _in_two_requests(one, two)


def _counting(poll: PollValues, order: int) -> NDArray[np.bool_]:
    """Which registers may be the first of a counter's two, so that next to no other need be looked at."""
    words = poll.words.astype(np.int64)
    pairs = words[:, :-1], words[:, 1:]
    steps = np.diff(pairs[order] << 16 | pairs[1 - order], axis=0)
    up = (steps > 0).sum(axis=0)
    small = ((steps > 0) & (steps <= _WORD // 2)).sum(axis=0)
    found: NDArray[np.bool_] = (up >= _LEAST_UP) & (small > np.floor(_USUAL * (up - 1)))
    found &= (steps < 0).sum(axis=0) <= (1 - _COUNTS) * len(steps)
    return found


def _carried(words: NDArray[np.uint16] | Int64s) -> NDArray[np.bool_]:
    """Which registers change by one now and then, as the more significant word of a number does."""
    steps = np.abs(moves(words.astype(np.int64)))
    found: NDArray[np.bool_] = (steps.max(axis=0) == 1) & (steps.mean(axis=0) < _SELDOM)
    return found


def _in_two_requests(one: PollValues, two: PollValues) -> Iterator[_Pair]:
    behind = np.searchsorted(one.times, two.times).clip(1, len(one.times) - 1)
    nearest = np.where(two.times - one.times[behind - 1] <= one.times[behind] - two.times, behind - 1, behind)
    apart = np.abs(two.times - one.times[nearest])
    close = apart <= _ONE_ROUND * float(np.median(np.diff(two.times)))
    first = one.words[nearest[close], -1].astype(np.int64)
    second = two.words[close, 0].astype(np.int64)
    for high, low in ((first, second), (second, first)):
        if len(low) >= READS and 0 < np.abs(moves(high)).max() <= _CARRIES:
            yield _Pair(one, two.address - 1, high, low, two.times[close])


def _jumping(evidence: Evidence, group: list[_Pair]) -> Iterator[Suspicion]:
    found = [(pair, pair.jumps()) for pair in group]
    clean = any(jumps is not None and not len(jumps) for _, jumps in found)
    for pair, jumps in found:
        if jumps is None or not (len(jumps) and (clean or _odd(pair, jumps))):
            continue
        if len(jumps) <= _TO_AND_FRO * evidence.ledger.units[pair.poll.unit].loose:
            continue  # answers came in the place of others: so may the one that is read here
        bits = _BITS * len(jumps) if len(jumps) > 1 or (clean and not pair.begins_anew(jumps).all()) else 0.0
        yield _suspicion(pair, jumps, np.diff(pair.values)[jumps], bits)


def _odd(pair: _Pair, jumps: Int64s) -> bool:
    """Whether jumps are of a kind that no counter which is only begun anew, or is not one, has: both words leap, or come
    at no regular times."""
    lost = ~pair.begins_anew(jumps)
    steps, carries = np.diff(pair.values)[jumps], pair.carries()
    counts = carries is not None and carries.followed > 0  # and is no level in the less significant word alone
    if len(jumps) > 1 and np.count_nonzero(lost & (counts | (np.abs(steps) > _WORD))) > 1:
        return True
    apart = np.diff(pair.times[jumps]).astype(np.float64)
    return len(jumps) >= _COLUMNS and bool(apart.std() > _MOVES * apart.mean() and lost.any())


def _suspicion(pair: _Pair, jumps: Int64s, sizes: Int64s, bits: float, torn: int = 0) -> Suspicion:
    numbers = {
        "address": pair.address,
        "jumps": len(jumps),
        "most": int(np.abs(sizes).max()),
        "reads": pair.poll.reads,
        "torn": torn,
    }
    begin, end = pair.times[[jumps[0], jumps[-1] + 1]].tolist()
    return value_suspicion(pair.poll.unit, min(bits, _MOST_BITS), numbers, begin, end)
