"""Numbers of two registers that go as another register does, though neither of their words goes so: speed and
frequency, power and current. Such words are one number, and the order in which they are is its order."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

from .readings import Words

Mask = NDArray[np.bool_]
Floats = NDArray[np.float64]
_HIGHEST: Final = 256  # of a high word: where it is large it goes as the number does, and says nothing
_WILD: Final = 0x4000  # what the low word spans
_FEW: Final = 8  # changes
_VARIED: Final = 0.1  # of a quantity, its scatter as a share of its size
_ALIKE: Final = 2e-3  # what is left of a number, squared, when another one times a factor is taken from it
_BETTER: Final = 10.0  # times less than of the high word alone


def in_proportion(words: Words, counts: Ints, blocks: Ints, high: Ints, low: Ints) -> Mask:
    """Of pairs (`high`, `low`) of registers, whether their number is another register of their block times a factor.

    `words` has readings as rows; `counts` are the changes of each register, `blocks` the number of its block."""
    found = np.zeros(len(high), np.bool_)
    least, most = words.min(axis=0).astype(np.int64), words.max(axis=0).astype(np.int64)
    pairs = np.flatnonzero(
        (most[high] < _HIGHEST)
        & (most[high] > least[high])
        & (most[low] - least[low] >= _WILD)
        & (counts[low] >= _FEW)
        & (blocks[high] == blocks[low])
    )
    values = words.astype(np.float64)
    others = np.flatnonzero((counts >= _FEW) & (values.std(axis=0) > _VARIED * values.mean(axis=0)))
    if not len(pairs) or not len(others):
        return found
    tops = values[:, high[pairs]]
    left = _left(tops * 0x10000 + values[:, low[pairs]], values[:, others])
    of_top = _left(tops, values[:, others])
    apart = (others != high[pairs][:, None]) & (others != low[pairs][:, None])
    apart &= blocks[others] == blocks[high[pairs]][:, None]
    found[pairs] = (apart & (left < _ALIKE) & (left * _BETTER < of_top)).any(axis=1)
    return found


def _left(numbers: Floats, others: Floats) -> Floats:
    """The share of each number (column), squared, that each other one times a factor does not tell."""
    squares = (numbers**2).sum(axis=0)[:, None] * (others**2).sum(axis=0)
    shares: Floats = 1 - (numbers.T @ others) ** 2 / np.maximum(squares, 1e-9)
    return shares
