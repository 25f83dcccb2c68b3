"""Description lengths: how many bits the changes of a series take when they are written down."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

Floats = NDArray[np.float64]
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
