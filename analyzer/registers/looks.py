"""What registers look like, in classes that evidence is counted by.

A word by itself, where it stands still and where it moves; two and four as floats; and how many bits their changes take
when they are written down.

Of a word by itself, what says whether another one belongs before it: a negative number below FFFF, a number that
crosses zero, the seconds of a calendar. In what manner a register moves: as flags, states, packed bytes or parts of a
clock do, or as a number does; and how evenly it goes through all that it can hold. The manners that no low word of a
wide number has tell registers that stand for themselves. What is spread evenly over 0000 to FFFF is hardly ever a
register of its own: no quantity does so, the low words of all wide ones that move do.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .readings import Words

Mask = NDArray[np.bool_]
SIGNS: Final = 3
_NEAR: Final = 0x4000  # zero
_EPOCH: Final = (0x5C00, 0x7000)  # high words of seconds since 1970, from the end of 2018 to 2029


def sign_classes(words: Words, moved: Mask) -> Ints:
    """Of each register: 1 it stays so close below FFFF that it is negative, 2 it goes to and fro over zero as a signed
    number does, 0 neither, or it stands still."""
    signed = words.view(np.int16)
    least, most = signed.min(axis=0), signed.max(axis=0)
    near = moved & (least > -_NEAR) & (most < _NEAR)
    classes: Ints = np.where(near & (most < 0), 1, np.where(near & (least < 0), 2, 0))
    return classes


def is_epoch(words: Words) -> Mask:
    """Whether each register could be the high word of a time of these years in seconds since 1970."""
    first = words[0]
    likely: Mask = (first >= _EPOCH[0]) & (first < _EPOCH[1])
    return likely


MANNERS: Final = 7
EVEN: Final = 6
_FEW: Final = 3  # states, of which nothing more can be said
_STATES: Final = 8
_GATHERED: Final = 5.0  # Rayleigh's sum over the number of readings: by chance in one of 150 cases
_MANY: Final = 30  # readings
_DECIMAL: Final = 10_000
_ONES: Final = np.array([number.bit_count() for number in range(256)])
_AGAIN: Final = 2  # changes for each state, where states come again


def manners(words: Words, changes: Ints) -> Ints:
    """Of each register (column): 0 as a number; 1 its low byte stands still, 2 so does its high byte though it is not
    zero; 3 single bits, high ones among them, are set and cleared; 4 few states that come again and again, 5 two or
    three in all; 6 it counts up to 59, 23 or the like and begins again."""
    flips = words[1:] ^ words[:-1]
    changed = flips != 0
    amount = np.maximum(changes, 1)
    classes = np.zeros(words.shape[1], np.int64)
    low_still = ((flips & 0xFF) == 0).all(axis=0)
    high_still = ((flips & 0xFF00) == 0).all(axis=0) & (words[0] > 0xFF)
    ordered = np.sort(words, axis=0)
    states = 1 + (ordered[1:] != ordered[:-1]).sum(axis=0)
    classes[high_still] = 2
    classes[states <= _FEW] = 5
    classes[(states <= _STATES) & (changes >= _AGAIN * states)] = 4
    classes[_is_clock(words, changed, amount)] = 6
    classes[low_still] = 1
    single = changed & ((flips & (flips - np.uint16(1))) == 0)
    classes[(single.sum(axis=0) >= 0.9 * amount) & (flips >= 8).any(axis=0)] = 3
    classes[changes == 0] = 0
    return classes


def evenness(words: Words, changes: Ints) -> Ints:
    """Of each register how evenly its readings spread over 0000 to FFFF: 0 in half of it at most, 1 wider, 2 all over
    but not evenly, 3 evenly, 4 evenly in many readings; 5 evenly over 0 to 9999 and no further, as four digits of a
    decimal number do.

    Even is what no turn of the whole circle, once or twice round, gathers anywhere (Rayleigh's test).
    """
    occupied = np.bitwise_or.reduce(np.uint8(1) << (words >> 13).astype(np.uint8), axis=0)
    count = _ONES[occupied]
    grades = np.where(count <= 4, 0, np.where(count <= 6, 1, 2)).astype(np.int64)
    wide = np.flatnonzero((count >= 6) & (changes >= 0.6 * (len(words) - 1)) & (len(words) > 8))
    if len(wide):
        even = _is_even(words[:, wide], 0x10000)
        grades[wide[even]] = 3 if len(words) < _MANY else 4
    decimal = (words.max(axis=0) < _DECIMAL) & (changes >= 0.6 * (len(words) - 1)) & (len(words) >= _MANY)
    four_digits = np.flatnonzero(decimal & (words.max(axis=0) > 0.9 * _DECIMAL) & (words.min(axis=0) < 0.1 * _DECIMAL))
    if len(four_digits):
        grades[four_digits[_is_even(words[:, four_digits], _DECIMAL)]] = 5
    return grades


def _is_even(words: Words, circle: int) -> NDArray[np.bool_]:
    angles = words.astype(np.float32) * np.float32(2 * np.pi / circle)
    gathered = [np.cos(turns * angles).sum(axis=0) ** 2 + np.sin(turns * angles).sum(axis=0) ** 2 for turns in (1, 2)]
    even: NDArray[np.bool_] = np.maximum(*gathered) < _GATHERED * len(words)
    return even


def _is_clock(words: Words, changed: NDArray[np.bool_], amount: Ints) -> NDArray[np.bool_]:
    """Whether a register stays below 60 and goes up, but for falls from far up to far down."""
    steps = words[1:].astype(np.int32) - words[:-1]
    falls = steps < 0
    deep = falls & (words[:-1] >= 12) & (steps <= -6)
    clocks: NDArray[np.bool_] = (
        (words < 60).all(axis=0)
        & (falls.sum(axis=0) == deep.sum(axis=0))
        & deep.any(axis=0)
        & ((changed & ~falls).sum(axis=0) >= 0.6 * amount)
    )
    return clocks


WORD_CLASSES: Final = 16
NO_VALUE: Final = (0x7FFF, 0x8000, 0xFFFF)
"""What devices put in a register where they have no value."""
NO_VALUE_PAIR: Final = (0x7FFFFFFF, 0x80000000, 0xFFFFFFFF)
"""The same in two registers, the more significant one first."""
NO_FLOAT: Final = (0x7F80, 0x7FC0, 0x7FFF, 0xFF80, 0xFFC0, 0xFFFF)
"""The more significant word of floats that are infinite, or not a number."""
_ABSENT: Final = (*NO_VALUE, 0x7FC0, 0xFFC0, 0x7FF8)  # of the first word; the last are no number
QUIET_GROUP: Final = np.array([0, 1, 1, 1, 2, 2, 3, 3, 4, 5, 5, 3, 3, 3, 3, 2])
"""The classes of a quiet high word, coarser."""


def word_classes(words: NDArray[np.uint16]) -> Ints:
    """What a word holds: 0; 1; 2 to 9; to 127; to 999; to 9999; to 7FFE; over; FFFF; 8000; 7FFF; the head of a float
    (two classes); two letters; FF80 to FFFE; 256 times something."""
    value = words.astype(np.int64)
    classes = np.digitize(value, (1, 2, 10, 128, 1000, 10000, 0x8000))
    letters = ((value >> 8) >= 0x20) & ((value >> 8) < 0x7F) & ((value & 0xFF) >= 0x20) & ((value & 0xFF) < 0x7F)
    magnitude = value & 0x7FFF
    head = (magnitude >= 0x3C00) & (magnitude < 0x4A00)
    classes = np.where(letters, 13, classes)
    classes = np.where((value & 0xFF == 0) & (value > 0xFF), 15, classes)
    classes = np.where(head & (value < 0x8000), 11, classes)
    classes = np.where(head & (value >= 0x8000), 12, classes)
    classes = np.where((value >= 0xFF80) & (value < 0xFFFF), 14, classes)
    for special, number in ((0xFFFF, 8), (0x8000, 9), (0x7FFF, 10)):
        classes = np.where(value == special, number, classes)
    return classes


def is_absent(words: NDArray[np.uint16]) -> bool:
    """Whether a value holds what devices put where they have none, of either word order."""
    stands = bool((words == words[0]).all())
    return stands and any(_is_mark(pattern) for pattern in (words[0].tolist(), words[0, ::-1].tolist()))


def _is_mark(pattern: list[int]) -> bool:
    first, rest = pattern[0], set(pattern[1:])
    return (first in _ABSENT and rest <= {0}) or (first in (0xFFFF, 0x7FFF) and rest <= {0xFFFF})


Floats = NDArray[np.float64]
_LEAST: Final = 1e-30
_GREATEST: Final = 1e16


def float_ordinals(pair: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Floats of 32 bits as their place among all floats: a step is one float further."""
    pattern = pair.astype(np.int64)
    ordinals: NDArray[np.int64] = np.where(pattern >= 1 << 31, (1 << 31) - pattern, pattern)
    return ordinals


def in_last_digits(value: NDArray[np.floating], digits: int) -> Floats:
    """Floats counted in the last of so many binary digits of the greatest one: fair to what passes through zero."""
    with np.errstate(invalid="ignore", over="ignore"):
        number = np.nan_to_num(value.astype(np.float64), nan=0.0, posinf=1e38, neginf=-1e38)
        number = np.clip(number, -1e300, 1e300)
        unit = np.maximum(np.abs(number).max(axis=0), 1e-300) * 2.0**-digits
        found: Floats = number / unit
    return found


def float_classes(value: NDArray[np.floating]) -> Ints:
    """0 all as people measure (0.01 to 1e5), 1 to 3 a wider range of sizes, 4 zeros only, 5 some not a number, 6 some
    denormal or absurd, 7 all so."""
    with np.errstate(invalid="ignore"):
        size = np.abs(value.astype(np.float64))
        finite = np.isfinite(size)
        zero = size == 0
        usual = zero | ((size >= 0.009) & (size <= 1e5))
        wide = zero | ((size >= 1e-4) & (size <= 1e9))
        absurd = finite & ~zero & ((size < 1e-9) | (size > 1e15))
    classes = np.full(value.shape[1], 3, np.int64)
    classes[wide.all(axis=0)] = 1
    classes[usual.all(axis=0)] = 0
    classes[(usual.mean(axis=0) > 0.9) & (classes > 1)] = 2
    classes[~finite.all(axis=0)] = 5
    classes[absurd.any(axis=0)] = 6
    classes[absurd.all(axis=0) | (~finite).all(axis=0)] = 7
    classes[zero.all(axis=0)] = 4
    return classes


def is_absurd(value: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Columns of which half the readings are no quantity that anybody has: a value that moves is never such a float."""
    with np.errstate(invalid="ignore"):
        size = np.abs(value.astype(np.float64))
        odd = ~np.isfinite(size) | (size > _GREATEST) | ((size > 0) & (size < _LEAST))
    absurd: NDArray[np.bool_] = odd.mean(axis=0) >= 0.5
    return absurd


def spreads(value: NDArray[np.floating]) -> Ints:
    """How far a float's sizes lie apart, in powers of two: 0, 1, to 4, to 10, to 30, more."""
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.abs(np.nan_to_num(value.astype(np.float64), nan=1e38, posinf=1e38, neginf=1e38))
        power = np.log2(np.where(size == 0, np.nan, size))
        filled = np.where(np.isnan(power), 0.0, power)
        high = np.where(np.isnan(power), -np.inf, filled).max(axis=0)
        low = np.where(np.isnan(power), np.inf, filled).min(axis=0)
        apart = np.where(np.isfinite(high - low), high - low, 0.0)
    return np.digitize(apart, (0.01, 1.0, 4.0, 10.0, 30.0))


def decimals(value: NDArray[np.floating], digits: int = 23) -> Ints:
    """How few decimals nearly all of a float's readings have: 0 to 3, 4 more, 5 it has no room for decimals.

    A float made of a rounded number is one; the words of two integers hardly ever are. `digits` are those of its
    mantissa in binary.
    """
    form = np.float32 if digits < 24 else np.float64
    with np.errstate(invalid="ignore", over="ignore"):
        exact = np.clip(np.nan_to_num(value.astype(np.float64)), -1e30, 1e30)
        digit = np.abs(exact).max(axis=0) * 2.0**-digits
        counts = np.full(value.shape[1], 4, np.int64)
        for places in (3, 2, 1, 0):
            rounded = np.round(exact, places).astype(form)
            few = (rounded == exact.astype(form)).mean(axis=0) >= 0.95
            counts[few] = np.where(digit[few] > 0.05 * 10.0**-places, 5, places)
    return counts


_SCALE: Final = 5.0  # bits in which a column's scale is told


def change_lengths(steps: NDArray[np.int64] | Floats, most: int) -> Floats:
    """Bits of a column's changes: when it changed, and by how much.

    How much is written as a number of unknown size or, where that is shorter, with the column's own scale (Laplace)
    told once: what scatters evenly costs its width then, no more.
    """
    amounts = np.abs(steps.astype(np.float32))
    bits = change_bits(amounts, most)
    count, n = np.count_nonzero(bits, axis=0), max(len(bits), 1)
    level = amounts.sum(axis=0, dtype=np.float64) / np.maximum(count, 1)
    scaled = count * np.clip(np.log2(2 * np.e * np.maximum(level, 0.4)), 1, most - 1) + _SCALE
    when = n * _entropy(count / n) + 0.5 * np.log2(n + 1)
    lengths: Floats = np.minimum(bits.sum(axis=0, dtype=np.float64), scaled) + when
    return lengths


def change_bits(steps: NDArray[np.int64] | NDArray[np.floating], most: int) -> NDArray[np.float32]:
    """Bits that a change takes: its sign and a number of unknown size (Elias), at most a word's own; 0 for none."""
    amount = np.abs(steps.astype(np.float32))
    size = np.log2(np.maximum(amount, np.float32(1)))
    bits = np.minimum(np.float32(2) + size + np.float32(1.5) * np.log2(size + np.float32(1)), np.float32(most))
    bits[amount == 0] = 0
    return bits


def directions(steps: NDArray[np.int64]) -> Ints:
    """0 both up and down, 1 only up, 2 only down."""
    up, down = (steps > 0).any(axis=0), (steps < 0).any(axis=0)
    return np.where(up & ~down, 1, np.where(down & ~up, 2, 0))


def _entropy(share: Floats) -> Floats:
    inside = np.clip(share, 1e-9, 1 - 1e-9)
    entropy: Floats = -(inside * np.log2(inside) + (1 - inside) * np.log2(1 - inside))
    return entropy
