"""What registers look like when they are read as floats: sizes, spreads, decimals, and how they step."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints

Floats = NDArray[np.float64]
_LEAST: Final = 1e-30
_GREATEST: Final = 1e16


def float_ordinals(pair: NDArray[np.uint64]) -> NDArray[np.int64]:
    """Floats of 32 bits as their place among all floats: a step is one float further."""
    pattern = pair.astype(np.int64)
    ordinals: NDArray[np.int64] = np.where(pattern >= 1 << 31, (1 << 31) - pattern, pattern)
    return ordinals


def in_last_digits(value: NDArray[np.floating], digits: int) -> Floats:
    """Floats counted in the last of so many binary digits of the greatest one: fair to what passes through zero."""
    with np.errstate(invalid="ignore", over="ignore"):
        number = np.nan_to_num(value.astype(np.float64), nan=0.0, posinf=1e38, neginf=-1e38)
        number = np.clip(number, -1e300, 1e300)
        unit = np.maximum(np.abs(number).max(axis=0), 1e-300) * 2.0**-digits
        found: Floats = number / unit
    return found


def float_classes(value: NDArray[np.floating]) -> Ints:
    """0 all as people measure (0.01 to 1e5), 1 to 3 a wider range of sizes, 4 zeros only, 5 some not a number, 6 some
    denormal or absurd, 7 all so."""
    with np.errstate(invalid="ignore"):
        size = np.abs(value.astype(np.float64))
        finite = np.isfinite(size)
        zero = size == 0
        usual = zero | ((size >= 0.009) & (size <= 1e5))
        wide = zero | ((size >= 1e-4) & (size <= 1e9))
        absurd = finite & ~zero & ((size < 1e-9) | (size > 1e15))
    classes = np.full(value.shape[1], 3, np.int64)
    classes[wide.all(axis=0)] = 1
    classes[usual.all(axis=0)] = 0
    classes[(usual.mean(axis=0) > 0.9) & (classes > 1)] = 2
    classes[~finite.all(axis=0)] = 5
    classes[absurd.any(axis=0)] = 6
    classes[absurd.all(axis=0) | (~finite).all(axis=0)] = 7
    classes[zero.all(axis=0)] = 4
    return classes


def is_absurd(value: NDArray[np.floating]) -> NDArray[np.bool_]:
    """Columns of which half the readings are no quantity that anybody has: a value that moves is never such a float."""
    with np.errstate(invalid="ignore"):
        size = np.abs(value.astype(np.float64))
        odd = ~np.isfinite(size) | (size > _GREATEST) | ((size > 0) & (size < _LEAST))
    absurd: NDArray[np.bool_] = odd.mean(axis=0) >= 0.5
    return absurd


def spreads(value: NDArray[np.floating]) -> Ints:
    """How far a float's sizes lie apart, in powers of two: 0, 1, to 4, to 10, to 30, more."""
    with np.errstate(invalid="ignore", divide="ignore"):
        size = np.abs(np.nan_to_num(value.astype(np.float64), nan=1e38, posinf=1e38, neginf=1e38))
        power = np.log2(np.where(size == 0, np.nan, size))
        filled = np.where(np.isnan(power), 0.0, power)
        high = np.where(np.isnan(power), -np.inf, filled).max(axis=0)
        low = np.where(np.isnan(power), np.inf, filled).min(axis=0)
        apart = np.where(np.isfinite(high - low), high - low, 0.0)
    return np.digitize(apart, (0.01, 1.0, 4.0, 10.0, 30.0))


def decimals(value: NDArray[np.floating], digits: int = 23) -> Ints:
    """How few decimals nearly all of a float's readings have: 0 to 3, 4 more, 5 it has no room for decimals.

    A float made of a rounded number is one; the words of two integers hardly ever are. `digits` are those of its
    mantissa in binary.
    """
    form = np.float32 if digits < 24 else np.float64
    with np.errstate(invalid="ignore", over="ignore"):
        exact = np.clip(np.nan_to_num(value.astype(np.float64)), -1e30, 1e30)
        digit = np.abs(exact).max(axis=0) * 2.0**-digits
        counts = np.full(value.shape[1], 4, np.int64)
        for places in (3, 2, 1, 0):
            rounded = np.round(exact, places).astype(form)
            few = (rounded == exact.astype(form)).mean(axis=0) >= 0.95
            counts[few] = np.where(digit[few] > 0.05 * 10.0**-places, 5, places)
    return counts
