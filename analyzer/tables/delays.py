"""Response times as far as a tap's clock carries them: exact, an interval, or unknown."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

EXACT: Final = 0.05  # of a time: what may be wrong by no more is not worth an interval


class DelayBounds(NamedTuple):
    """Columns of ns, -1 for none: what is exact, and between what each lies (twice the same where it is exact)."""

    exact: NDArray[np.int64]
    low: NDArray[np.int64]
    high: NDArray[np.int64]


def bounds_of(delay: int, off_ns: float | None) -> tuple[int, int] | None:
    """Between what a time (ns) lies that may be wrong by so much; None where that is not known (None or infinite)."""
    if off_ns is None or not np.isfinite(off_ns):
        return None
    return (delay, delay) if off_ns <= EXACT * delay else (max(round(delay - off_ns), 0), round(delay + off_ns))


def delay_bounds(delays: NDArray[np.int64], off_ns: float) -> DelayBounds:
    """The same of a column of times (ns, -1 for none)."""
    none = np.full(len(delays), -1, np.int64)
    if not np.isfinite(off_ns):
        return DelayBounds(none, none, none)
    measured = (delays >= 0) & (off_ns <= EXACT * delays)
    present = delays >= 0
    low = np.where(present, np.where(measured, delays, np.maximum(delays - round(off_ns), 0)), -1)
    high = np.where(present, np.where(measured, delays, delays + round(off_ns)), -1)
    return DelayBounds(np.where(measured, delays, -1), low, high)
