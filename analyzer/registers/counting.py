"""The counting behind the evidence: of blocks side by side, the codes of each hypothesis at each register."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final, TypeVar

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .company import (
    AROUND,
    FOURS,
    KIN,
    PAIR_CODES,
    RHYTHMS,
    ROWS,
    around,
    company_of,
    fours_in_line,
    kin,
    pairs_in_line,
    rhythm,
    single_kin,
)
from .hypotheses import HYPOTHESES, Hypothesis, patterns
from .looks import (
    EVEN,
    MANNERS,
    QUIET_GROUP,
    SIGNS,
    change_bits,
    change_lengths,
    decimals,
    directions,
    evenness,
    float_classes,
    float_ordinals,
    in_last_digits,
    is_absurd,
    is_epoch,
    manners,
    sign_classes,
    spreads,
    word_classes,
)
from .readings import Words

Step = TypeVar("Step", np.int64, np.float64)
Codes = Mapping[str, Ints]
NONE: Final = -1  # the hypothesis does not reach so far

_GAINS: Final = np.array([-24, -8, -3, -0.5, 0.5, 3, 8, 16, 32, 64, 128, 256, 512])  # bits
_COSTS: Final = np.array([2.5, 4, 6, 8, 10, 12, 13.5, 15])  # bits a change
_BUSY: Final = 8  # changes
_NARROW: Final = 12.0  # bits
_SHARES: Final = np.array([0.02, 0.1, 0.3, 0.7, 0.95])
_SIZES: Final = np.array([1, 4, 7, 9, 11, 13, 15])  # bits
_RANGES: Final = np.array([1, 3, 5, 7, 9, 11, 13, 15, 15.9])  # bits

SIZES: Final[Mapping[str, int]] = {
    # of one register
    "i16": 1, "i16 quiet": 16, "i16 quiet beside": 16 * 9, "i16 moved": 9 * 9, "i16 shape": 8 * 3 * 3,
    "i16 share": 6 * 3, "i16 manner": MANNERS * 3, "i16 even": EVEN, "i16 kin": KIN,
    # of two, as an integer
    "i32": 4, "i32 gain": 14 * 2, "i32 words": 9 * 10, "i32 high": 16 * 2, "i32 low": 6 * 8 * 3,
    "i32 low range": 6 * 10, "i32 low cost": 6 * 9, "i32 high only": 16 * 4, "i32 quiet": 16 * 16,
    "i32 as float": 2 * 8 * 2, "i32 carries": 16, "i32 sign": 6 * 3, "i32 wraps": 13,
    "i32 low manner": 6 * MANNERS, "i32 manners": MANNERS * MANNERS, "i32 rhythm": 2 * RHYTHMS,
    "i32 epoch": 4, "i32 negative": 3 * SIGNS,
    "i32 even": 4 * EVEN, "i32 agreed": 5, "i32 in line": 2 * ROWS, "i32 sisters": PAIR_CODES,
    "i32 around": 2 * AROUND, "i32 kin": 2 * KIN, "i32 way": 4 * 3,
    # of two, as a float
    "f32": 4, "f32 gain": 14 * 2, "f32 value": 4 * 8, "f32 low": 4 * 9, "f32 quiet": 8 * 16, "f32 spread": 4 * 6,
    "f32 even": 2 * EVEN,
    # of four
    "i64": 16, "i64 gain": 14, "i64 top": 16 * 2, "i64 low": 8 * 3, "i64 words": 64 * 2, "i64 in line": FOURS * 2,
    "f64": 16, "f64 gain": 14, "f64 value": 8 * 2,
    "f64 decimals": 4 * 6, "f64 spread": 2 * 6, "f64 as float": 8 * 8,
    "i64 even": 2 * EVEN, "i64 wraps": 13, "i64 agreed": 5, "i64 way": 3, "f64 even": 4,
    "f32 decimals": 4 * 6,
    # by the size of the block, and whether the value begins or ends it
    "i16 block": 7 * 2, "i32 block": 7 * 4, "f32 block": 7 * 4, "wide block": 7 * 4,
}  # fmt: skip
"""The tables by name, and how many entries each has."""


class Counting:
    """Blocks of as many readings, side by side: what reaches over a border is counted too, and not used."""

    def __init__(self, blocks: Sequence[Words], beginning: int) -> None:
        words = np.concatenate(blocks, axis=1)
        self.words = words
        self.sizes = np.array([block.shape[1] for block in blocks])
        ends = np.cumsum(self.sizes)
        self.starts = ends - self.sizes
        self._first = np.repeat(self.starts, self.sizes)  # of each register, of its block
        self._last = np.repeat(ends - 1, self.sizes)
        self._block_size = np.repeat(np.digitize(self.sizes, (2, 3, 4, 5, 9, 17)), self.sizes)
        self._joint = beginning if beginning < len(words) else None
        self.moved = (words != words[0]).any(axis=0)
        changes = self.steps(words.astype(np.int32))
        self._changes = ((changes + 0x8000) & 0xFFFF) - 0x8000
        self._wraps = ((changes < -0x8000).astype(np.int8) - (changes > 0x8000)).astype(np.int8)
        self._rises = np.sign(changes).astype(np.int8)
        self._bits16 = change_bits(self._changes, 17)
        self._cost16 = change_lengths(self._changes, 17)
        self._absurd: dict[Hypothesis, NDArray[np.bool_]] = {}
        self._never = np.zeros(words.shape[1], np.bool_)
        self._company = company_of(words, self.moved, self._first, self._last)
        self._singles()

    def blocks(self) -> Iterator[tuple[list[Codes], NDArray[np.bool_], list[NDArray[np.bool_]]]]:
        """Of each block its codes by hypothesis, which of its registers moved, and by hypothesis where it is absurd."""
        codes = [self._codes(number) for number in range(len(HYPOTHESES))]
        for start, size in zip(self.starts.tolist(), self.sizes.tolist(), strict=True):
            mine: list[Codes] = []
            absurd = []
            for hypothesis, by_table in zip(HYPOTHESES, codes, strict=True):
                end = start + size - hypothesis.words + 1
                mine.append({name: code[start:end] for name, code in by_table.items()} if end > start else {})
                absurd.append(self._absurd.get(hypothesis, self._never)[start : max(start, end)])
            yield mine, self.moved[start : start + size], absurd

    def steps(self, series: NDArray[np.int64] | NDArray[np.int32]) -> NDArray[np.int64]:
        """From reading to reading; not over the joint."""
        return self._across(series[1:].astype(np.int64) - series[:-1])

    def _across(self, steps: NDArray[Step]) -> NDArray[Step]:
        """Steps without that over the joint."""
        return steps if self._joint is None else np.delete(steps, self._joint - 1, axis=0)

    def _singles(self) -> None:
        words, changes = self.words, self._changes
        signed = words.view(np.int16).astype(np.int32)
        low, high = words.min(axis=0).astype(np.int32), words.max(axis=0).astype(np.int32)
        span, signed_span = high - low, signed.max(axis=0) - signed.min(axis=0)
        self._signed = signed_span < span
        self._span = np.log2(np.minimum(span, signed_span) + 1.0)
        size = np.where(self._signed, np.abs(signed).max(axis=0), high)
        self._size = np.digitize(np.log2(size + 1.0), _SIZES)
        self._class = word_classes(words[0])
        count = (changes != 0).sum(axis=0)
        self._count = count
        self._share = np.digitize(count / max(len(changes), 1), _SHARES)
        self._mean = np.digitize(self._bits16.sum(axis=0) / np.maximum(count, 1), _COSTS)
        self._direction = directions(changes)
        self._manner = manners(words, count)
        self._even = evenness(words, count)
        amount = np.abs(changes)
        self._below = sign_classes(words, self.moved)
        self._epoch = is_epoch(words)
        self._smooth = (amount > 0x1000).sum(axis=0) * 8 < np.maximum(count, 1)
        usual = np.median(amount, axis=0) if len(amount) else np.zeros(words.shape[1])
        self._pace = np.where(self.moved, np.digitize(usual, (2, 64)) + 1, 0)

    def _codes(self, number: int) -> Codes:
        hypothesis = HYPOTHESES[number]
        reach = self.words.shape[1] - hypothesis.words + 1
        if reach <= 0:
            return {}
        if hypothesis.words == 1:
            return self._one()
        reverse = hypothesis.order == "CDAB"
        if hypothesis.words == 2:
            return self._two(hypothesis, reverse=reverse)
        return self._four(hypothesis, reverse=reverse)

    def _one(self) -> Codes:
        moved, quiet = self.moved, ~self.moved
        at = np.arange(len(moved))
        before = np.where(at == self._first, 2, np.roll(moved, 1))  # 2 at the edges of the block
        behind = np.where(at == self._last, 2, np.roll(moved, -1))
        beside = self._class * 9 + before * 3 + behind
        span = np.digitize(self._span, _RANGES)
        return {
            "i16": np.zeros(len(moved), np.int64),
            "i16 quiet": np.where(quiet, self._class, NONE),
            "i16 quiet beside": np.where(quiet, beside, NONE),
            "i16 moved": np.where(moved, np.minimum(span, 8) * 9 + self._mean, NONE),
            "i16 shape": np.where(moved, (self._size * 3 + self._direction) * 3 + self._sign(), NONE),
            "i16 share": np.where(moved, self._share * 3 + self._direction, NONE),
            "i16 manner": np.where(moved, self._manner * 3 + self._direction, NONE),
            "i16 even": np.where(moved, self._even, NONE),
            "i16 kin": np.where(moved, single_kin(self._company), NONE),
            "i16 block": self._block_size * 2 + moved,
        }

    def _edges(self, words: int) -> Ints:
        """Where a value of so many registers stands in its block."""
        at = np.arange(self.words.shape[1] - words + 1)
        first, last = self._first[: len(at)], self._last[: len(at)]
        edges: Ints = (self._block_size[: len(at)] * 2 + (at == first)) * 2 + (at == last - words + 1)
        return edges

    def _sign(self) -> Ints:
        """0 never over 7FFF, 1 on both sides of zero as a signed number, 2 over 7FFF."""
        top = (self.words >= 0x8000).any(axis=0)
        return np.where(self._signed, 1, np.where(top, 2, 0))

    def _two(self, hypothesis: Hypothesis, *, reverse: bool) -> Codes:
        first, second = np.arange(self.words.shape[1] - 1), np.arange(1, self.words.shape[1])
        high, low = (second, first) if reverse else (first, second)
        pair = patterns(np.stack((self.words[:, high], self.words[:, low]), axis=-1), "ABCD")
        number = pair.astype(np.int64)
        steps = ((self.steps(number) + (1 << 31)) & 0xFFFFFFFF) - (1 << 31)
        case = 2 * self.moved[high] + self.moved[low]
        separate = self._cost16[high] + self._cost16[low]
        value = pair.astype(np.uint32).view(np.float32)
        kinds = float_classes(value)
        both, few = case == 3, (self._count[high] < 4).astype(np.int64)
        group = QUIET_GROUP[self._class[high]]
        if hypothesis.is_float:
            self._absurd[hypothesis] = (case > 0) & is_absurd(value)
            as_float = np.minimum(
                change_lengths(self.steps(float_ordinals(pair)), 33),
                change_lengths(self._across(np.diff(in_last_digits(value, 22), axis=0)), 33),
            )
            gain = np.digitize(separate - as_float, _GAINS)
            return {
                "f32": case,
                "f32 gain": np.where(case > 0, gain * 2 + both, NONE),
                "f32 value": case * 8 + kinds,
                "f32 low": case * 9 + np.where(self.moved[low], self._mean[low], 0),
                "f32 quiet": np.where(case == 0, kinds * 16 + self._class[low], NONE),
                "f32 spread": np.where(case > 0, case * 6 + spreads(value), NONE),
                "f32 decimals": case * 6 + decimals(value),
                "f32 even": np.where(self.moved[low], both * EVEN + self._even[low], NONE),
                "f32 block": self._edges(2),
            }
        gain = np.digitize(separate - change_lengths(steps, 33), _GAINS)
        low_only = case == 1
        first = self.words[0, high]
        idle = np.where(first == 0, 0, np.where(first == 0xFFFF, 1, 2))
        clock = self._epoch[high] * np.where(case == 0, 1, np.where(self._direction[low] == 1, 2, 3))
        span = np.digitize(self._span, _RANGES)
        return {
            "i32": case,
            "i32 gain": np.where(case > 0, gain * 2 + both * few, NONE),
            "i32 words": np.where(both, self._mean[low] * 10 + span[high], NONE),
            "i32 high": np.where(both, self._class[high] * 2 + few, NONE),
            "i32 low": np.where(low_only, (group * 8 + self._size[low]) * 3 + self._direction[low], NONE),
            "i32 low range": np.where(low_only, group * 10 + span[low], NONE),
            "i32 low cost": np.where(low_only, group * 9 + self._mean[low], NONE),
            "i32 low manner": np.where(low_only, group * MANNERS + self._manner[low], NONE),
            "i32 manners": np.where(both, self._manner[high] * MANNERS + self._manner[low], NONE),
            "i32 sign": np.where(low_only, group * 3 + self._sign()[low], NONE),
            "i32 high only": np.where(case == 2, self._class[low] * 4 + np.minimum(kinds, 3), NONE),
            "i32 quiet": np.where(case == 0, self._class[high] * 16 + self._class[low], NONE),
            "i32 as float": np.where(case > 0, (both * 8 + kinds) * 2 + few, NONE),
            "i32 carries": np.where(both, self._carries(high, steps), NONE),
            "i32 wraps": np.where(low_only | both, self._carried(high, low), NONE),
            "i32 agreed": np.where(both, self._agreed(high, low), NONE),
            "i32 rhythm": np.where(low_only, (group == 0) * RHYTHMS + rhythm(self._company, high, low), NONE),
            "i32 in line": np.where(low_only, (group == 0) * ROWS + pairs_in_line(self._company, high, low), NONE),
            "i32 even": np.where(low_only | both, self._pace[high] * EVEN + self._even[low], NONE),
            "i32 around": np.where(low_only, (group == 0) * AROUND + around(self._company, high, low), NONE),
            "i32 kin": np.where(low_only, (group == 0) * KIN + kin(self._company, high, low), NONE),
            "i32 epoch": np.where(case < 2, clock, NONE),
            "i32 negative": np.where(low_only, idle * SIGNS + self._below[low], NONE),
            "i32 way": np.where(case > 0, case * 3 + directions(steps), NONE),
            "i32 block": self._edges(2),
        }

    def _carried(self, high: Ints, low: Ints) -> Ints:
        """Whether the high word counts each time that the low word runs over, and at no other time.

        0 it never runs over; 1 to 3 so it does (once, to three times, more often), 4 nearly so, 5 now and then, 6
        never. Where the high word stands still: 7 it never runs over, 8 and 9 a smooth one does (once, more often), 10
        a wild one. A smooth one beside a high word that changes: 11 never runs over, 12 hardly ever when that changes.
        """
        wraps, steps = self._wraps[:, low], self._changes[:, high]
        over, moved = (wraps != 0).sum(axis=0), (steps != 0).sum(axis=0)
        matched = ((wraps != 0) & (steps == wraps)).sum(axis=0)
        most = np.maximum(np.maximum(over, moved), 1)
        smooth = self._smooth[low]
        grades = np.where(matched >= 0.8 * most, 4, np.where(matched > 0.2 * most, 5, np.where(smooth, 12, 6)))
        grades = np.where(matched == most, np.digitize(over, (2, 4)) + 1, grades)
        grades = np.where(over == 0, np.where(smooth, 11, 0), grades)
        still = np.where(over == 0, 7, np.where(smooth, np.where(over == 1, 8, 9), 10))
        return np.where(moved == 0, still, grades)

    def _agreed(self, high: Ints, low: Ints) -> Ints:
        """Where a high word only grows, or only falls: whether the low word goes the same way each time that the high
        word stays: 1 to 3 it does (to three times, to eight, more often), 4 it does not; 0 nothing can be said."""
        stays = self._changes[:, high] == 0
        up, down = ((stays & (self._rises[:, low] == sign)).sum(axis=0) for sign in (1, -1))
        way = self._direction[high]
        agreed, seen = np.where(way == 1, up, down), up + down
        grades = np.where(agreed == seen, np.digitize(seen, (4, 9)) + 1, 4)
        return np.where((way == 0) | (seen < 2), 0, grades)

    def _carries(self, high: Ints, steps: NDArray[np.int64]) -> Ints:
        """How the high word's changes fit a carry: their number, and the share of which the whole moved little."""
        changed = self._changes[:, high] != 0
        count = changed.sum(axis=0)
        small = (changed & (np.abs(steps) < 0x8000)).sum(axis=0)
        share = np.digitize(small / np.maximum(count, 1), (0.3, 0.7, 0.95))
        grades: Ints = np.digitize(count, (2, 4, 12)) * 4 + share
        return grades

    def _four(self, hypothesis: Hypothesis, *, reverse: bool) -> Codes:
        width = self.words.shape[1] - 3
        columns = np.arange(width)[:, None] + (np.arange(4)[::-1] if reverse else np.arange(4))
        pattern = patterns(self.words[:, columns], "ABCD")
        moved = self.moved[columns]
        case = moved @ np.array([8, 4, 2, 1])
        separate = self._cost16[columns].sum(axis=1)
        any_moved = case > 0
        if hypothesis.is_float:
            value = pattern.view(np.float64)
            self._absurd[hypothesis] = any_moved & (is_absurd(value) | self._is_idle_below(columns))
            as_float = change_lengths(self._across(np.diff(in_last_digits(value, 52), axis=0)), 63)
            gain = np.digitize(separate - as_float, _GAINS)
            return {
                "f64": case,
                "f64 gain": np.where(any_moved, gain, NONE),
                "f64 value": float_classes(value) * 2 + any_moved,
                "f64 decimals": np.minimum(moved.sum(axis=1), 3) * 6 + decimals(value, 52),
                "f64 spread": any_moved * 6 + spreads(value),
                "f64 as float": self._as_floats(columns),
                "f64 even": np.where(any_moved, np.isin(self._even[columns[:, 1:]], (3, 4)).sum(axis=1), NONE),
                "wide block": self._edges(4),
            }
        self._absurd[hypothesis] = any_moved & (self._is_hollow(columns) | self._is_idle_below(columns))
        steps = self._across(np.diff(pattern, axis=0).view(np.int64))
        gain = np.digitize(separate - change_lengths(steps, 65), _GAINS)
        low = columns[:, 3]
        return {
            "i64": case,
            "i64 gain": np.where(any_moved, gain, NONE),
            "i64 top": self._class[columns[:, 0]] * 2 + any_moved,
            "i64 words": self._shapes(columns),
            "i64 in line": fours_in_line(self._company, columns) * 2 + any_moved,
            "i64 even": np.where(self.moved[low], self.moved[columns[:, 2]] * EVEN + self._even[low], NONE),
            "i64 wraps": np.where(self.moved[low], self._carried(columns[:, 2], low), NONE),
            "i64 agreed": np.where(moved[:, 2] & moved[:, 3], self._agreed(columns[:, 2], low), NONE),
            "i64 way": np.where(any_moved, directions(steps), NONE),
            "i64 low": np.where(self.moved[low], self._size[low] * 3 + self._direction[low], NONE),
            "wide block": self._edges(4),
        }

    def _is_hollow(self, columns: Ints) -> NDArray[np.bool_]:
        """Whether a word that stands at zero has a higher one that does not, as no number has that was counted or
        measured: such are two numbers side by side."""
        zero = ((self._class == 0) & ~self.moved)[columns]
        hollow: NDArray[np.bool_] = (zero[:, 1:] & ~zero[:, :-1]).any(axis=1)
        return hollow

    def _is_idle_below(self, columns: Ints) -> NDArray[np.bool_]:
        """Whether a word that is not zero hardly moves though a higher one often does: the digits behind one that
        changes are anything."""
        busy = np.logical_or.accumulate((self._count >= _BUSY)[columns], axis=1)
        idle = ((self._span < _NARROW) & (self.moved | (self._class != 0)))[columns]
        below: NDArray[np.bool_] = (idle[:, 1:] & busy[:, :-1]).any(axis=1)
        return below

    def _shapes(self, columns: Ints) -> Ints:
        """Of each word of four but the lowest: 0 it stands at zero, 1 at something, 2 at FFFF, 3 it moves; and whether
        the lowest one moves."""
        word = self._class[columns]
        kinds = np.where(self.moved[columns], 3, np.where(word == 0, 0, np.where(word == 8, 2, 1)))
        shapes: Ints = (kinds[:, :3] @ np.array([16, 4, 1])) * 2 + self.moved[columns[:, 3]]
        return shapes

    def _as_floats(self, columns: Ints) -> Ints:
        """What both halves of four registers, the high word of each first, look like as floats of 32 bits."""
        halves = [
            float_classes(patterns(self.words[:, columns[:, part]], "ABCD").astype(np.uint32).view(np.float32))
            for part in (slice(0, 2), slice(2, 4))
        ]
        return halves[0] * 8 + halves[1]
