"""Numbers as decimal text, thousands at once: four digits at a time, looked up in a table."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

_Ints = NDArray[np.int64]
_DIGITS: Final = 4
_UNIT: Final = 10**_DIGITS
_MINUS: Final = ord("-")
_tables: list[NDArray[np.uint32]] = []


def decimals(numbers: _Ints) -> tuple[NDArray[np.uint8], _Ints, _Ints]:
    """The digits of these numbers: a text, and where each begins there and how many characters it has.

    The least of the 64-bit numbers, which has no counterpart, is not among them.
    """
    if not len(numbers):
        return np.zeros(0, np.uint8), numbers, numbers
    negative = numbers < 0
    rest: _Ints = np.abs(numbers)
    least, most = len(str(int(rest.min()))), len(str(int(rest.max())))
    sizes = np.full(len(numbers), least, np.int64)
    for digits in range(least, most):
        sizes += rest >= 10**digits
    words = most // _DIGITS + 1  # room for a sign
    text = np.empty((len(numbers), words), np.uint32)
    for word in range(words - 1, -1, -1):
        above = rest // _UNIT
        rest -= _UNIT * above
        text[:, word] = _table().take(rest)
        rest = above
    width = _DIGITS * words
    begins = width * np.arange(1, len(numbers) + 1) - sizes
    flat = text.reshape(-1).view(np.uint8)
    if negative.any():
        begins -= negative
        sizes += negative
        flat[begins[negative]] = _MINUS
    return flat, begins, sizes


def _table() -> NDArray[np.uint32]:
    """`0000` to `9999`, each as one word of memory."""
    if not _tables:
        digits = np.arange(_UNIT)[:, None] // 10 ** np.arange(_DIGITS - 1, -1, -1) % 10 + ord("0")
        _tables.append(digits.astype(np.uint8).view(np.uint32)[:, 0])
    return _tables[0]
