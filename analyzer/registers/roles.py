"""Kind and role of a value whose registers stand: what its readings look like to an engineer."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
_ENOUGH: Final = 20  # readings, before states are told from numbers
_STATES: Final = 8
EPOCH: Final = (1.0e9, 4.2e9)  # seconds since 1970 that a clock may say
_YEAR_S: Final = 366 * 86_400.0
_UNDATED_S: Final = 120.0
_RATE: Final = (0.99, 1.01)


def is_signed(series: NDArray[np.uint64], words: int) -> bool:
    """Whether readings are more narrow about zero as signed numbers, or are all slightly below it."""
    width = 16 * words
    top = np.uint64(1 << (width - 1))
    over = series >= top
    if not over.any():
        return False
    if over.all():
        return bool(series.min() >= np.uint64((1 << width) - (1 << (width - 4))))
    half = 1 << (width - 2)
    return bool((series[over] >= np.uint64((1 << width) - half)).all() and (series[~over] < np.uint64(half)).all())


def is_bits(series: NDArray[np.uint64]) -> bool:
    """Whether single bits were set and cleared, high ones among them."""
    flips = series[1:] ^ series[:-1]
    flips = flips[flips > 0]
    if len(flips) < 3 or len(flips) > 0.5 * len(series):
        return False
    single = (flips & (flips - np.uint64(1))) == 0
    high = single & (flips >= np.uint64(8))
    return bool(single.mean() >= 0.9 and high.mean() >= 0.5 and len(np.unique(series)) <= 2 * _STATES)


def is_enum(series: NDArray[np.uint64]) -> bool:
    """Whether it holds one of a few small states and jumps between them."""
    if len(series) < _ENOUGH:
        return False
    states = np.unique(series)
    steps = np.abs(np.diff(series.astype(np.int64)))
    changed = steps > 0
    if len(states) > _STATES or states[-1] >= 64 or changed.mean() > 0.35:
        return False
    return bool(changed.sum() >= 3 and (steps[changed] > 1).mean() >= 0.4)


def is_bcd(series: NDArray[np.uint64], words: int) -> bool:
    """Whether all digits are decimal, and the readings run more smoothly when read so."""
    digits = (series[:, None] >> np.arange(0, 16 * words, 4, dtype=np.uint64)) & np.uint64(15)
    if (digits > 9).any() or len(np.unique(series)) < 12 or series.max() < 16:
        return False
    decimal = (digits * np.array([10**digit for digit in range(4 * words)], np.uint64)).sum(axis=1)
    jumps, smooth = np.abs(np.diff(series.astype(np.float64))), np.abs(np.diff(decimal.astype(np.float64)))
    crossed = (digits[1:, 1:] != digits[:-1, 1:]).any(axis=1)
    return bool(crossed.sum() >= 3 and jumps.sum() > 1.25 * smooth.sum())


def is_clock(series: NDArray[np.uint64], begin_ns: int, end_ns: int) -> bool:
    """Whether it counts seconds since 1970, as fast as the time passes from `begin_ns` to `end_ns`.

    Many a counter grows by about one a second for a while: where the capture knows the date itself, a clock is within
    a year of it; where it does not, some minutes tell.
    """
    first, last = float(series[0]), float(series[-1])
    seconds = (end_ns - begin_ns) / 1e9
    if not (EPOCH[0] <= first <= EPOCH[1] and seconds > 0):
        return False
    dated = begin_ns / 1e9 >= EPOCH[0]
    if (dated and abs(first - begin_ns / 1e9) > _YEAR_S) or (not dated and seconds < _UNDATED_S):
        return False
    return _RATE[0] * seconds - 2 <= last - first <= _RATE[1] * seconds + 2


def is_counter(numbers: Floats) -> bool:
    """Whether it only grows, a fall to nothing or a turn over excepted."""
    steps = np.diff(numbers)
    up, down = (steps > 0).sum(), (steps < 0).sum()
    return bool(up >= 3 and down <= up // 50)


def role_of(kind: str, numbers: Floats, *, moved: bool, written: bool) -> str | None:
    """measurement, counter, setpoint, status; None where nothing can be said."""
    if written:
        return "setpoint"
    if not moved:
        return None
    if kind in ("bits", "enum"):
        return "status"
    if kind in ("text", "time"):
        return None
    return "counter" if is_counter(numbers) else "measurement"
