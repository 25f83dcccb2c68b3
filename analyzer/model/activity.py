"""How busy the bus was, over time: counts in equal bins over the whole capture, whose width doubles as it grows.

For a span of few rows the counts are made from the rows themselves, so that one can zoom in to single frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from analyzer.frames import Kind, Rows

if TYPE_CHECKING:
    from .bus import Bus

_BINS: Final = 1 << 14
_WIDTH_NS: Final = 1_000_000  # of a bin, at first
_FEW: Final = 1 << 20  # rows that are counted anew
_TRACKS: Final = 4  # bytes, frames, damaged frames and exceptions, noise bytes


@dataclass(frozen=True, slots=True)
class Bins:
    """Counts over a span, in equal bins from `t_start` on, each `width_ns` long."""

    t_start: int
    width_ns: float
    octets: NDArray[np.int64]
    frames: NDArray[np.int64]
    troubles: NDArray[np.int64]  # frames with a wrong check value, exceptions, noise stretches
    noise: NDArray[np.int64]  # bytes


class Activity:
    """The counts of everything so far."""

    def __init__(self) -> None:
        self._begin: int | None = None
        self._width = _WIDTH_NS
        self._counts = np.zeros((_TRACKS, _BINS), np.int64)

    def feed(self, rows: Rows) -> None:
        """Count rows in, where they end."""
        if self._begin is None:
            self._begin = int(rows["t_start"][0])
        last = int(rows["t_end"].max())
        counts = self._counts
        while last - self._begin >= self._width * _BINS:
            half = counts.reshape(_TRACKS, -1, 2).sum(axis=2)
            counts = np.concatenate((half, np.zeros_like(half)), axis=1)
            self._width *= 2
        place = np.clip((rows["t_end"] - self._begin) // self._width, 0, _BINS - 1)
        self._counts = counts + _counted(rows["length"], rows["kind"], rows["check"], rows["exception"], place, _BINS)

    def over(self, bus: Bus, t_start: int, t_end: int, bins: int) -> Bins:
        """The span in this many bins."""
        width = max(t_end - t_start, 1) / bins
        first, last = bus.table.row_at_time(t_start), bus.table.row_at_time(t_end) + 1
        if last - first <= _FEW and bus.count:
            total = np.zeros((_TRACKS, bins), np.int64)
            for number, low, high in bus.table.slices(first, min(last, bus.count)):
                piece = bus.table.piece(number)
                place = ((piece["t_end"][low:high] - t_start) // width).astype(np.int64)
                inside = (place >= 0) & (place < bins)
                lengths, kinds, checks, exceptions = (
                    piece[name][low:high][inside] for name in ("length", "kind", "check", "exception")
                )
                total += _counted(lengths, kinds, checks, exceptions, place[inside], bins)
            return Bins(t_start, width, *total)
        begin = self._begin or 0
        at = ((begin + (np.arange(_BINS) + 0.5) * self._width - t_start) // width).astype(np.int64)
        inside = (at >= 0) & (at < bins)
        whole = self._counts
        tracks = [np.bincount(at[inside], whole[i][inside], bins).astype(np.int64) for i in range(_TRACKS)]
        return Bins(t_start, width, *tracks)


def _counted(
    lengths: NDArray[np.int64],
    kinds: NDArray[np.uint8],
    checks: NDArray[np.bool_],
    exceptions: NDArray[np.uint8],
    place: NDArray[np.int64],
    bins: int,
) -> NDArray[np.int64]:
    noise = kinds == Kind.NOISE
    trouble = noise | ~checks | (exceptions > 0)
    weights = (lengths, ~noise, trouble, lengths * noise)
    return np.stack([np.bincount(place, weight, bins)[:bins].astype(np.int64) for weight in weights])
