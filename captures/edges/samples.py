"""Samples of a fixed rate: when they were taken, and the rate as sigrok writes it."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .uart import Times

RATE: Final = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([kMG]?)(?:Hz)?\s*")
_SCALE: Final = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9}
_SECOND: Final = 1_000_000_000


def hertz_of(number: str, prefix: str) -> int | None:
    """Samples a second, of a number and its prefix; None where nothing samples so."""
    wanted = float(number) * _SCALE[prefix]
    return round(wanted) if 1 <= wanted <= _SECOND else None


def sample_times(samples: NDArray[np.int64], rate: int) -> Times:
    """When samples of these numbers were taken, in ns."""
    seconds, rest = np.divmod(samples, rate)
    at: Times = seconds * _SECOND + rest * _SECOND // rate
    return at
