"""Each unit's share of the line, and its response times over the capture, in flat memory."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analyzer.frames import Kind, Rows

BINS: Final = 64
_UNITS: Final = 256
_WIDTH_NS: Final = 100_000_000  # of a bin, at first


class Units:
    """Bytes by unit, and mean response times by unit in equal bins, whose width doubles as the capture grows."""

    def __init__(self) -> None:
        self.octets = np.zeros(_UNITS, np.int64)
        self._begin: int | None = None
        self._width = _WIDTH_NS
        self._sums: NDArray[Any] = np.zeros((_UNITS, BINS))
        self._counts: NDArray[Any] = np.zeros((_UNITS, BINS), np.int64)

    def feed(self, rows: Rows) -> None:
        """Count rows in."""
        frames = rows["kind"] != Kind.NOISE
        self.octets += np.bincount(rows["unit"][frames], rows["length"][frames], _UNITS).astype(np.int64)
        measured = frames & (rows["response_ns"] >= 0)
        times, answers, units = (rows[name][measured] for name in ("t_start", "response_ns", "unit"))
        if not len(times):
            return
        if self._begin is None:
            self._begin = int(times[0])
        while int(times.max()) - self._begin >= self._width * BINS:
            self._sums, self._counts = _halved(self._sums), _halved(self._counts)
            self._width *= 2
        place = units.astype(np.int64) * BINS + np.clip((times - self._begin) // self._width, 0, BINS - 1)
        size = _UNITS * BINS
        self._sums += np.bincount(place, answers, size).reshape(_UNITS, BINS)
        self._counts += np.bincount(place, minlength=size).reshape(_UNITS, BINS)

    def means(self, unit: int) -> NDArray[np.float64]:
        """Mean response time, ns, of each bin up to the last that holds one; NaN where there is none."""
        used = np.flatnonzero(self._counts.any(axis=0))
        last = int(used[-1]) + 1 if len(used) else 0
        sums, counts = self._sums[unit, :last], self._counts[unit, :last]
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def _halved(table: NDArray[Any]) -> NDArray[Any]:
    half = table.reshape(_UNITS, -1, 2).sum(axis=2)
    return np.concatenate((half, np.zeros_like(half)), axis=1)
