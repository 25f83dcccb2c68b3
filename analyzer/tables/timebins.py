"""How busy the bus was, over time: counts in equal bins over the whole capture, whose width doubles as it grows.

For a span of few rows the counts are made from the rows themselves, so that one can zoom in to single frames.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.typing import NDArray

from .findings import Findings, Severity, rules
from .schema import Kind, Rows

if TYPE_CHECKING:
    from ..model.bus import Bus


_BINS: Final = 1 << 14
_FIRST_BIN_NS: Final = 1_000_000  # of a bin, at first
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
        self._width = _FIRST_BIN_NS
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


def binned(bus: Bus, rows: NDArray[np.int64], t_start: int, t_end: int, bins: int) -> Bins:
    """Some rows alone over a span, in this many bins, where they end."""
    width = max(t_end - t_start, 1) / bins
    ends = bus.table.take("t_end", rows)
    place = ((ends - t_start) // width).astype(np.int64)
    inside = (place >= 0) & (place < bins)
    lengths, kinds, checks, exceptions = (
        bus.table.take(name, rows[inside]) for name in ("length", "kind", "check", "exception")
    )
    return Bins(t_start, width, *_counted(lengths, kinds, checks, exceptions, place[inside], bins))


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


# Each unit's share of the line, and its response times over the capture, in flat memory.


UNIT_BINS: Final = 64
_UNITS: Final = 256
_FIRST_UNIT_BIN_NS: Final = 100_000_000  # of a bin, at first


class UnitActivity:
    """Bytes by unit, and mean response times by unit in equal bins, whose width doubles as the capture grows."""

    def __init__(self) -> None:
        self.octets = np.zeros(_UNITS, np.int64)
        self._begin: int | None = None
        self._width = _FIRST_UNIT_BIN_NS
        self._sums: NDArray[Any] = np.zeros((_UNITS, UNIT_BINS))
        self._counts: NDArray[Any] = np.zeros((_UNITS, UNIT_BINS), np.int64)

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
        while int(times.max()) - self._begin >= self._width * UNIT_BINS:
            self._sums, self._counts = _halved(self._sums), _halved(self._counts)
            self._width *= 2
        place = units.astype(np.int64) * UNIT_BINS + np.clip((times - self._begin) // self._width, 0, UNIT_BINS - 1)
        size = _UNITS * UNIT_BINS
        self._sums += np.bincount(place, answers, size).reshape(_UNITS, UNIT_BINS)
        self._counts += np.bincount(place, minlength=size).reshape(_UNITS, UNIT_BINS)

    def means(self, unit: int) -> NDArray[np.float64]:
        """Mean response time, ns, of each bin up to the last that holds one; NaN where there is none."""
        used = np.flatnonzero(self._counts.any(axis=0))
        last = int(used[-1]) + 1 if len(used) else 0
        sums, counts = self._sums[unit, :last], self._counts[unit, :last]
        return np.where(counts > 0, sums / np.maximum(counts, 1), np.nan)


def _halved(table: NDArray[Any]) -> NDArray[Any]:
    half = table.reshape(_UNITS, -1, 2).sum(axis=2)
    return np.concatenate((half, np.zeros_like(half)), axis=1)


# The bus over time in a fixed number of bins: when time runs past the last one, pairs merge and all are twice as wide.
#
# Bytes spread evenly over the time that their row took, so that a long frame does not stand in one narrow bin;
# findings count where their bytes begin, by severity.


TROUBLE_BINS: Final = 240
_FIRST_TROUBLE_BIN_NS: Final = 1_000_000


class TroubleBins:
    """Octets and troubles a bin. `origin_ns` is the start of the first bin, None before any row."""

    def __init__(self) -> None:
        self.origin_ns: int | None = None
        self.width_ns = _FIRST_TROUBLE_BIN_NS
        self.octets: NDArray[Any] = np.zeros(TROUBLE_BINS)
        self.errors = np.zeros(TROUBLE_BINS, np.int64)
        self.warnings = np.zeros(TROUBLE_BINS, np.int64)

    def add(self, rows: Rows, findings: Findings) -> None:
        """Count rows in, nearly in order of time, and what was found on them."""
        if len(rows):
            if self.origin_ns is None:
                self.origin_ns = int(rows["t_start"].min())
            self._reach(int(rows["t_end"].max()) - self.origin_ns)
            self._spread(rows, self.origin_ns)
        placed = findings[findings["start"] >= 0]
        if self.origin_ns is None or not len(placed):
            return
        bins = np.clip((placed["t"] - self.origin_ns) // self.width_ns, 0, TROUBLE_BINS - 1)
        severity = np.array([rule.severity for rule in rules()])[placed["rule"]]
        self.errors += np.bincount(bins[severity == Severity.ERROR], minlength=TROUBLE_BINS)
        self.warnings += np.bincount(bins[severity == Severity.WARNING], minlength=TROUBLE_BINS)

    def used(self, span_ns: int) -> int:
        """How many bins a capture of that length fills."""
        return min(TROUBLE_BINS, max(1, -(-span_ns // self.width_ns)))

    def _reach(self, end_ns: int) -> None:
        """Make room for rows that end so long after the first one began."""
        while end_ns > TROUBLE_BINS * self.width_ns:
            self.width_ns *= 2
            for name in ("octets", "errors", "warnings"):
                pairs = getattr(self, name).reshape(-1, 2).sum(axis=1)
                setattr(self, name, np.append(pairs, np.zeros_like(pairs)))

    def _spread(self, rows: Rows, origin_ns: int) -> None:
        passed = np.cumsum(rows["length"])
        times = np.column_stack((rows["t_start"], rows["t_end"])).ravel() - origin_ns
        sums = np.column_stack((passed - rows["length"], passed)).ravel()
        edges = np.arange(TROUBLE_BINS + 1) * float(self.width_ns)
        below = np.interp(edges, np.maximum.accumulate(times), sums)
        below[0], below[-1] = 0.0, passed[-1]  # nothing is lost before the first bin or on the last edge
        self.octets += np.diff(below)
