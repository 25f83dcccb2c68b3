"""Registers that hold the values of several: readings of polls that came in each other's places.

What such readings look like would look otherwise if each were its own poll's: successive readings would lie nearer to
each other than any two do, and the readings of one poll nearer to themselves than to those of another. Where neither
is so, the readings are of several registers, and no type is claimed.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .readings import Words
from .runs import Run

UNSURE_AT_MOST: Final = 0.5  # of a type that nothing would show to be wrong
SHORT: Final = 4  # readings, of fewer no type is sure
_LEAST: Final = 8  # readings that tell
_LOOKED_AT: Final = 32
_STEADIER: Final = 0.8  # a step in time, of a step between any two readings
_APART_BITS: Final = 0.25  # a word, by which another poll's readings lie further off than its own

Block = tuple[int, str, int, int]  # unit, area, address, quantity


def mixed_blocks(runs: Sequence[Run]) -> set[Block]:
    """Blocks of which some readings are another's of the same unit and length."""
    by_shape: dict[tuple[int, int], list[tuple[Block, Words]]] = {}
    for run in runs:
        for block, (words, beginning) in zip(run.blocks, run.series, strict=True):
            rows = words[: beginning if beginning >= _LEAST else len(words)][:_LOOKED_AT]
            if len(rows) >= _LEAST and not _steady(rows):
                by_shape.setdefault((block.unit, block.quantity), []).append((block.key, rows))
    mixed: set[Block] = set()
    for members in by_shape.values():
        for (one, its), (other, others) in combinations(members[:_LOOKED_AT], 2):
            if one != other and _alike(its, others):
                mixed |= {one, other}
    return mixed


def _steps(one: Words, other: Words) -> NDArray[np.float64]:
    """How far apart readings lie, in bits a word: every one from every other."""
    apart = np.abs(one[:, None].astype(np.int32) - other[None].astype(np.int32))
    bits: NDArray[np.float64] = np.log2(1 + np.minimum(apart, 0x10000 - apart)).mean(axis=2)
    return bits


def _steady(rows: Words) -> bool:
    """Whether readings lie nearer to the next one than to any; what never moves lies nowhere else."""
    every = _steps(rows, rows)
    usual = every[np.triu_indices(len(rows), 1)].mean()
    return usual == 0 or bool(np.diag(every, 1).mean() < _STEADIER * usual)


def _alike(one: Words, other: Words) -> bool:
    """Whether the readings of two polls could as well be each other's."""
    among = [_steps(rows, rows) + np.diag([np.inf] * len(rows)) for rows in (one, other)]
    own = np.mean([bits.min(axis=1).mean() for bits in among])
    across = _steps(one, other)
    crossed = (across.min(axis=1).mean() + across.min(axis=0).mean()) / 2
    return bool(crossed <= own + _APART_BITS)
