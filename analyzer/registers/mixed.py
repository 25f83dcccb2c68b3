"""Which readings make no type sure: those in each other's places, those in no order of time, and too few.

Readings in their places look otherwise than shuffled ones. Of two polls as long, the answers of one lie nearer to each
other in time than to the other's; where exchanging both at any moment makes no difference, they could as well have been
exchanged. And successive readings of a register lie nearer to each other than in any order: the sum of its steps is
compared with its mean and deviation over all orders, which are exact; where no register of a whole unit stands out, its
readings come in no order of time. No type is claimed of either.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..languages import register_words
from .readings import Words
from .runs import Run

UNSURE_AT_MOST: Final = 0.5  # of a type that nothing would show to be wrong
SHORT: Final = 8  # readings: of fewer no type is sure, nor can be told whether two blocks are mixed
_ENOUGH: Final = 16  # that tell whether time has an order
_MOST: Final = 64
_STANDS_OUT: Final = 4.0  # standard deviations: shuffled readings hardly ever do so,
_ORDER_OF_MANY: Final = 5.0  # nor, of 32 readings and more, so far: those of real devices by 10 to 20
_MANY: Final = 32
_OF_FEW: Final = 0.75  # of what two polls that differ as clearly as can be would have
_REGISTERS: Final = 2  # that moved, before a unit is in no order: one that scatters by itself is a noisy one
_COMPARED: Final = 16  # blocks of one length, each with so many behind it

Block = tuple[int, str, int, int]  # unit, area, address, quantity
Floats = NDArray[np.float64]


def doubtful_blocks(runs: Sequence[Run]) -> Mapping[Block, str]:
    """Blocks of which no type is sure, and why."""
    by_shape: dict[tuple[int, int], list[tuple[Block, Words]]] = {}
    blocks: list[Block] = []
    moving: dict[int, int] = {}
    orderly: set[int] = set()  # units
    for run in runs:
        for block, (words, beginning) in zip(run.blocks, run.series, strict=True):
            rows = words[: beginning if beginning >= SHORT else len(words)][:_MOST]
            moved = (rows != rows[0]).any(axis=0)
            blocks.append(block.key)
            if not moved.any():
                continue
            by_shape.setdefault((block.unit, block.quantity), []).append((block.key, rows))
            moving[block.unit] = moving.get(block.unit, 0) + int(moved.sum())
            least = _ORDER_OF_MANY if len(rows) >= _MANY else _STANDS_OUT
            if block.unit not in orderly and (len(rows) < _ENOUGH or order_of_time(rows[:, moved]) >= least):
                orderly.add(block.unit)
    orderless = {unit for unit, count in moving.items() if count >= _REGISTERS} - orderly
    why = register_words("its readings come in no order of time")
    doubts = {key: why for key in blocks if key[0] in orderless}
    why = register_words("its readings could as well be another request's: answers may have been swapped")
    for members in by_shape.values():
        for number, (one, its) in enumerate(members):
            for other, others in members[number + 1 : number + 1 + _COMPARED]:
                if one != other and _exchangeable(its, others):
                    doubts |= {one: why, other: why}
    return doubts


def order_of_time(rows: Words) -> float:
    """By how many standard deviations the steps in time are smaller than in any order; of the register of which they
    are most so. `rows` are readings of registers that moved."""
    count = len(rows)
    apart = _apart(rows[:, None], rows[None])
    each = apart.sum(axis=0)
    total, squares, crossed = each.sum(axis=0), (apart**2).sum(axis=(0, 1)), (each**2).sum(axis=0)
    pairs = count * (count - 1)
    mean = total / count
    same, joined = squares / count, 2 * (crossed - squares) / pairs
    distant = (total**2 - 4 * crossed + 2 * squares) / pairs
    deviation = np.sqrt(np.maximum(same + joined + distant - mean**2, 0.0))
    in_time = _apart(rows[1:], rows[:-1]).sum(axis=0)
    one_step = apart.max(axis=(0, 1))  # a single blip at an end is no order
    return float(((mean - in_time) / np.maximum(deviation, one_step)).max())


def _exchangeable(one: Words, other: Words) -> bool:
    """Whether the readings of two polls could as well have been exchanged, each time anew."""
    count = min(len(one), len(other))
    if count < SHORT:
        return False
    one, other = one[:count], other[:count]
    within = _apart(one[1:], one[:-1]) + _apart(other[1:], other[:-1])
    excess = _apart(one[1:], other[:-1]) + _apart(other[1:], one[:-1]) - within  # either sign alike, if exchanged
    stands_out = excess.sum(axis=0) / np.sqrt(np.maximum((excess**2).sum(axis=0), 1e-9))
    return bool(stands_out.max() < min(_STANDS_OUT, _OF_FEW * np.sqrt(count - 1)))


def _apart(one: Words, other: Words) -> Floats:
    """How far apart readings lie, in bits."""
    apart = np.abs(one.astype(np.int32) - other)
    bits: Floats = np.log2(1.0 + np.minimum(apart, 0x10000 - apart))
    return bits
