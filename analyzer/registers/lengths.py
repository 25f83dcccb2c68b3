"""Description lengths: how many bits the changes of a series take when they are written down."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

Floats = NDArray[np.float64]


def change_lengths(steps: NDArray[np.int64] | Floats, most: int) -> Floats:
    """Bits of a column's changes: when it changed, and by how much."""
    return summed_lengths(change_bits(steps, most))


def summed_lengths(bits: NDArray[np.float32]) -> Floats:
    count, n = np.count_nonzero(bits, axis=0), max(len(bits), 1)
    lengths: Floats = bits.sum(axis=0, dtype=np.float64) + n * _entropy(count / n) + 0.5 * np.log2(n + 1)
    return lengths


def change_bits(steps: NDArray[np.int64] | Floats, most: int) -> NDArray[np.float32]:
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
