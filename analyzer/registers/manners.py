"""In what manner a register moves: as flags, states, packed bytes or parts of a clock do, or as a number does.

The manners that no low word of a wide number has tell registers that stand for themselves.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .readings import Words

MANNERS: Final = 7
_FEW: Final = 3  # states, of which nothing more can be said
_STATES: Final = 8
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
