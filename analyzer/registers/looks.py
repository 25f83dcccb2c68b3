"""What a word looks like by itself that says whether another one belongs before it: a negative number below FFFF, a
number that crosses zero, the seconds of a calendar.
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
