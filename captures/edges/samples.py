"""Samples of a fixed rate: when they were taken, the rate as sigrok writes it, the unit of a column of times."""

from __future__ import annotations

import re
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..text.stamps import TITLE_UNIT_NS
from .uart import Times

RATE: Final = re.compile(r"\s*(\d+(?:\.\d+)?)\s*([kMG]?)(?:Hz)?\s*")
_SCALE: Final = {"": 1, "k": 10**3, "M": 10**6, "G": 10**9}
_SECOND: Final = 1_000_000_000
_SAID: Final = re.compile(r"(?:sample ?rate: | at )(\d{1,9}(?:\.\d{1,9})?) ?([kMG]?)Hz", re.IGNORECASE)


def hertz_of(number: str, prefix: str) -> int | None:
    """Samples a second, of a number and its prefix; None where nothing samples so."""
    wanted = float(number) * _SCALE[prefix]
    return round(wanted) if 1 <= wanted <= _SECOND else None


def sample_times(samples: NDArray[np.int64], rate: int) -> Times:
    """When samples of these numbers were taken, in ns."""
    seconds, rest = np.divmod(samples, rate)
    at: Times = seconds * _SECOND + rest * _SECOND // rate
    return at


def rate_said(text: str) -> int | None:
    """The rate that a comment of sigrok's tables says, in samples a second."""
    said = _SAID.search(text)
    return None if said is None else hertz_of(said[1], said[2])


def unit_of(title: str) -> int | None:
    """The unit, in ns, that the title of a column of times says: `Time [ms]`, `(us)`, `microseconds`."""
    words = re.findall(r"\w+", title.lower())
    return TITLE_UNIT_NS.get(words[-1]) if words else None
