"""In what manner a register moves: as flags, states, packed bytes or parts of a clock do, or as a number does; and how
evenly it goes through all that it can hold.

The manners that no low word of a wide number has tell registers that stand for themselves. What is spread evenly over
0000 to FFFF is hardly ever a register of its own: no quantity does so, the low words of all wide ones that move do.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .readings import Words

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
