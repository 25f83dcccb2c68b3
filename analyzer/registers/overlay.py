"""Where a table of times and values lies in a capture: with clocks that agree, or by how much they differ.

A table whose clock is another one (an hour of summer time, minutes that it runs ahead) is laid over a reading at every
place: a correlation of what both have at that place, for all places at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Beginning = Literal["1970", "midnight", "unknown"]
DAY_S: Final = 86_400.0
DATED_S: Final = 1e9  # seconds since 1970 that a clock with a date says
_PLACES: Final = 1 << 16
_OVERLAP: Final = 0.6  # of the table or of the capture, whichever is shorter
_LEAST: Final = 5
HALF_HOUR_S: Final = 1800.0
_AS_GOOD: Final = 1.3  # times the least misfit
_EVEN: Final = 1e-3


@dataclass(frozen=True, slots=True, eq=False)
class PanelTable:
    """Times (s) and values that somebody wrote down; `beginning` is what its times count from."""

    times_s: Floats
    values: Floats
    beginning: Beginning = "unknown"

    def dated_as(self, begin_s: float) -> PanelTable:
        """Times of day on the day on which a capture begins, where that is known."""
        if self.beginning != "midnight" or begin_s < DATED_S:
            return self
        day = DAY_S * np.round((begin_s - self.times_s[0]) / DAY_S)
        return PanelTable(self.times_s + day, self.values, "1970")

    def is_of_clock(self, begin_s: float) -> bool:
        """Whether its times and those of a capture are both of a clock: only then can those differ."""
        return self.beginning == "1970" and begin_s >= DATED_S


def clock_difference(lag_s: float, near_s: float) -> float:
    """What a lag says of the clocks: half hours of a zone where it is so within `near_s`, or all of it."""
    zone = HALF_HOUR_S * round(lag_s / HALF_HOUR_S)
    return zone if zone and abs(lag_s - zone) <= near_s else lag_s


def best_place(times_s: Floats, shown: Floats, series: Sequence[tuple[Floats, Floats]]) -> tuple[float, float] | None:
    """The lag at which the table goes best with one of these series (times in s, readings), and the share of its
    variance that is left there; of places that are about as good the nearest one. None where it has no place."""
    found: list[tuple[float, float]] = []
    for at_s, values in series:
        lags, left = _places(times_s, shown, at_s, values)
        if len(lags):
            good = left <= _AS_GOOD * left.min() + _EVEN
            which = np.flatnonzero(good)[np.argmin(np.abs(lags[good]))]
            found.append((float(left[which]), float(lags[which])))
    if not found:
        return None
    left_least, lag = min(found)
    return lag, left_least


def _places(times_s: Floats, shown: Floats, at_s: Floats, values: Floats) -> tuple[Floats, Floats]:
    """All lags on a grid, and the share of the table's variance that a line through the readings leaves there."""
    spans = times_s[-1] - times_s[0], at_s[-1] - at_s[0]
    paces = [span / max(len(times) - 1, 1) for span, times in zip(spans, (times_s, at_s), strict=True)]
    pace = max(min(paces), sum(spans) / _PLACES, 1e-3)
    if min(spans) < _LEAST * max(paces):
        return np.empty(0), np.empty(0)
    table, capture = _on_grid(times_s, shown, pace), _on_grid(at_s, values, pace)
    size = 1 << int(len(table) + len(capture)).bit_length()
    ones = np.ones(len(table)), np.ones(len(capture))

    def together(one: Floats, other: Floats) -> Floats:
        """The sums of products at every place of the table `one` in the capture `other`."""
        product = np.fft.irfft(np.fft.rfft(other, size) * np.conj(np.fft.rfft(one, size)), size)
        return np.concatenate((product[size - len(table) + 1 :], product[: len(capture)]))

    count = np.maximum(together(*ones), 1.0)
    sums, own = together(ones[0], capture), together(table, ones[1])
    power = together(ones[0], capture**2) - sums**2 / count
    own_power = together(table**2, ones[1]) - own**2 / count
    shared = together(table, capture) - sums * own / count
    enough = count > max(_OVERLAP * min(len(table), len(capture)), _LEAST)
    enough &= (power > 1e-9 * power.max()) & (own_power > 0.2 * own_power.max())
    lags = at_s[0] - times_s[0] + pace * np.arange(1 - len(table), len(capture))
    left = 1 - shared[enough] ** 2 / (power[enough] * own_power[enough])
    return lags[enough], np.clip(left, 0.0, 1.0)


def _on_grid(times_s: Floats, values: Floats, pace: float) -> Floats:
    """The values that stand at even times, in units of their spread about their mean."""
    grid = np.arange(times_s[0], times_s[-1] + pace / 2, pace)
    held = values[np.searchsorted(times_s, grid + pace * 1e-6, side="right") - 1]
    even: Floats = (held - held.mean()) / max(float(held.std()), 1e-300)
    return even
