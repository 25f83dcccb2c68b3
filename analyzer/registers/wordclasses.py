"""What a single word looks like, in classes, where it never moves: the company of a moving one beside it."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

WORD_CLASSES: Final = 16
_ABSENT: Final = (0xFFFF, 0x8000, 0x7FFF, 0x7FC0, 0xFFC0, 0x7FF8)  # of the first word; the last are no number
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
