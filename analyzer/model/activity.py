"""How busy the bus was, over time: counts in equal bins over the whole capture, and each unit's share of the line.

For a span of few rows the counts are made from the rows themselves, so that one can zoom in to single frames.
"""

from __future__ import annotations

import threading
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Kind, Rows
from ..tables.timebins import TimeBins

if TYPE_CHECKING:
    from .bus import Bus

_BINS: Final = 1 << 14
_FIRST_BIN_NS: Final = 1_000_000  # of a bin, at first
UNIT_BINS: Final = 64
_UNITS: Final = 256
_FIRST_UNIT_BIN_NS: Final = 100_000_000  # of a bin, at first
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
        self._bins = TimeBins(_BINS, _FIRST_BIN_NS)
        self._bins.tables["all"] = np.zeros((_TRACKS, _BINS), np.int64)
        self._merging = threading.Lock()  # bins become wider while others ask for them

    def feed(self, rows: Rows) -> None:
        """Count rows in, where they end."""
        bins = self._bins
        columns = (rows.length, rows.kind, rows.check, rows.exception)
        with self._merging:
            bins.reach(int(rows.t_start_ns[0]), int(rows.t_end_ns.max()))
            bins.tables["all"] += _counted(*columns, bins.bins(rows.t_end_ns), _BINS)

    def over(self, bus: Bus, t_start: int, t_end: int, bins: int) -> Bins:
        """The span in this many bins."""
        width = max(t_end - t_start, 1) / bins
        first, last = bus.table.row_at_time(t_start), bus.table.row_at_time(t_end) + 1
        if last - first <= _FEW and bus.count:
            total = np.zeros((_TRACKS, bins), np.int64)
            for number, low, high in bus.table.slices(first, min(last, bus.count)):
                ends = bus.table.stretch(number, "t_end_ns", slice(low, high))
                slots = ((ends - t_start) // width).astype(np.int64)
                inside = (slots >= 0) & (slots < bins)
                lengths, kinds, checks, exceptions = (
                    bus.table.stretch(number, name, slice(low, high))[inside]
                    for name in ("length", "kind", "check", "exception")
                )
                total += _counted(lengths, kinds, checks, exceptions, slots[inside], bins)
            return Bins(t_start, width, *total)
        with self._merging:
            begin_ns, width_ns, table = self._bins.begin_ns or 0, self._bins.width_ns, self._bins.tables["all"].copy()
        at = ((begin_ns + (np.arange(_BINS) + 0.5) * width_ns - t_start) // width).astype(np.int64)
        inside = (at >= 0) & (at < bins)
        tracks = [np.bincount(at[inside], track[inside], bins).astype(np.int64) for track in table]
        return Bins(t_start, width, *tracks)


def binned(bus: Bus, rows: NDArray[np.int64], t_start: int, t_end: int, bins: int) -> Bins:
    """Some rows alone over a span, in this many bins, where they end."""
    width = max(t_end - t_start, 1) / bins
    ends = bus.table.take("t_end_ns", rows)
    slots = ((ends - t_start) // width).astype(np.int64)
    inside = (slots >= 0) & (slots < bins)
    lengths, kinds, checks, exceptions = (
        bus.table.take(name, rows[inside]) for name in ("length", "kind", "check", "exception")
    )
    return Bins(t_start, width, *_counted(lengths, kinds, checks, exceptions, slots[inside], bins))


def _counted(
    lengths: NDArray[np.int64],
    kinds: NDArray[np.uint8],
    checks: NDArray[np.bool_],
    exceptions: NDArray[np.uint8],
    slots: NDArray[np.int64],
    bins: int,
) -> NDArray[np.int64]:
    noise = kinds == Kind.NOISE
    trouble = noise | ~checks | (exceptions > 0)
    weights = (lengths, ~noise, trouble, lengths * noise)
    return np.stack([np.bincount(slots, weight, bins)[:bins].astype(np.int64) for weight in weights])


class UnitActivity:
    """Bytes by unit, and mean response times by unit in equal bins, whose width doubles as the capture grows."""

    def __init__(self) -> None:
        self.octets = np.zeros(_UNITS, np.int64)
        self.heard = np.zeros(_UNITS, np.bool_)  # units that a frame with a right check value speaks of
        self._bins = TimeBins(UNIT_BINS, _FIRST_UNIT_BIN_NS)
        self._bins.tables["sums"] = np.zeros((_UNITS, UNIT_BINS))
        self._bins.tables["counts"] = np.zeros((_UNITS, UNIT_BINS), np.int64)
        self._merging = threading.Lock()

    def feed(self, rows: Rows) -> None:
        """Count rows in."""
        frames = rows.kind != Kind.NOISE
        self.octets += np.bincount(rows.unit[frames], rows.length[frames], _UNITS).astype(np.int64)
        self.heard[rows.unit[frames & rows.check]] = True
        measured = frames & (rows.response_ns >= 0)
        times, answers, units = (column[measured] for column in (rows.t_start_ns, rows.response_ns, rows.unit))
        if not len(times):
            return
        bins, size = self._bins, _UNITS * UNIT_BINS
        with self._merging:
            bins.reach(int(times[0]), int(times.max()))
            slots = units.astype(np.int64) * UNIT_BINS + bins.bins(times)
            bins.tables["sums"] += np.bincount(slots, answers, size).reshape(_UNITS, UNIT_BINS)
            bins.tables["counts"] += np.bincount(slots, minlength=size).reshape(_UNITS, UNIT_BINS)

    def means(self, unit: int) -> NDArray[np.float64]:
        """Mean response time, ns, of each bin up to the last that holds one; NaN where there is none."""
        with self._merging:
            used = np.flatnonzero(self._bins.tables["counts"].any(axis=0))
            last = int(used[-1]) + 1 if len(used) else 0
            sums, counts = (self._bins.tables[name][unit, :last].copy() for name in ("sums", "counts"))
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)
