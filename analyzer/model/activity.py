"""What happened when: the capture along an axis of time.

How busy the bus was: counts in equal bins over the whole capture, and each unit's share of the line. For a span of few
rows the counts are made from the rows themselves, so that one can zoom in to single frames. A row each for causes,
whatever a filter keeps, and units, in the same bins. And the round times of day that stand along such an axis.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from datetime import tzinfo
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..languages import tr
from ..tables.bins import TimeBins
from ..tables.findings import Severity
from ..tables.schema import Kind, Rows
from ..words import moment_of
from .table import PIECE

if TYPE_CHECKING:
    from .bus import Bus
    from .selection import Test

_BINS: Final = 1 << 14
_FIRST_BIN_NS: Final = 1_000_000  # of a bin, at first
UNIT_BINS: Final = 64
_UNITS: Final = 256
_FIRST_UNIT_BIN_NS: Final = 100_000_000  # of a bin, at first
_FEW: Final = 1 << 20  # rows that are counted anew
_TRACKS: Final = 4  # bytes, frames, rows in trouble, noise bytes
_OCTETS, _TROUBLE, _NOISE = 0, 2, 3  # of them
_SHOWN: Final = ("t_start_ns", "t_end_ns", "length", "kind", "mark")
_AT_ONCE: Final = 1e-3  # bins, that a row takes of which no time is known


@dataclass(frozen=True, slots=True)
class Bins:
    """Counts over a span, in equal bins from `t_start` on, each `width_ns` long."""

    t_start: int
    width_ns: float
    octets: NDArray[np.int64]
    frames: NDArray[np.int64]
    troubles: NDArray[np.int64]  # rows that a warning or an error stands on, as in a `Band`
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
        unmarked = np.zeros(len(rows), np.uint8)
        with self._merging:
            bins.reach(int(rows.t_start_ns[0]), int(rows.t_end_ns.max()))
            bins.tables["all"] += _counted(rows.length, rows.kind, unmarked, bins.bins(rows.t_end_ns), _BINS)

    def trouble(self, ends: NDArray[np.int64]) -> None:
        """Rows that were fed, by their ends, on which a warning or an error stands now."""
        if len(ends):
            with self._merging:
                self._bins.tables["all"][_TROUBLE] += np.bincount(self._bins.bins(ends), minlength=_BINS)

    def over(self, bus: Bus, t_start: int, t_end: int, bins: int) -> Bins:
        """The span in this many bins."""
        width = max(t_end - t_start, 1) / bins
        first, last = bus.table.row_at_time(t_start), bus.table.row_at_time(t_end) + 1
        if last - first <= _FEW and bus.count:
            total = np.zeros((_TRACKS, bins), np.int64)
            for number, low, high in bus.table.slices(first, min(last, bus.count)):
                columns = [bus.table.stretch(number, name, slice(low, high)) for name in _SHOWN]
                total += _in_span(columns, t_start, width, bins)
            return Bins(t_start, width, *total)
        with self._merging:
            begin_ns, width_ns, table = self._bins.begin_ns or 0, self._bins.width_ns, self._bins.tables["all"].copy()
        at = ((begin_ns + (np.arange(_BINS) + 0.5) * width_ns - t_start) // width).astype(np.int64)
        inside = (at >= 0) & (at < bins)
        tracks = [np.bincount(at[inside], track[inside], bins).astype(np.int64) for track in table]
        return Bins(t_start, width, *tracks)


def binned(bus: Bus, rows: NDArray[np.int64], t_start: int, t_end: int, bins: int) -> Bins:
    """Some rows alone over a span, in this many bins."""
    width = max(t_end - t_start, 1) / bins
    columns = [bus.table.take_column(name, rows) for name in _SHOWN]
    return Bins(t_start, width, *_in_span(columns, t_start, width, bins))


def _in_span(columns: Sequence[NDArray[Any]], t_start: int, width: float, bins: int) -> NDArray[np.int64]:
    """The tracks of a span, of rows with these columns (`_SHOWN`): rows where they end, their bytes over the time that
    they took on the line."""
    begins, ends, lengths, kinds, marks = columns
    first, last = (begins - t_start) / width, (ends - t_start) / width
    slots = np.floor(last).astype(np.int64)
    inside = (slots >= 0) & (slots < bins)
    counts = _counted(lengths[inside], kinds[inside], marks[inside], slots[inside], bins)
    noise = kinds == Kind.NOISE
    counts[_OCTETS] = _octets_by_bin(lengths, first, last, bins)
    counts[_NOISE] = _octets_by_bin(lengths[noise], first[noise], last[noise], bins)
    return counts


def _octets_by_bin(
    lengths: NDArray[np.int64], begins: NDArray[np.float64], ends: NDArray[np.float64], bins: int
) -> NDArray[np.int64]:
    """Bytes by bin, those of a row evenly over its time: else a column would show more than the line can carry.
    `begins`, `ends`: in bins, from the first on."""
    takes = np.maximum(ends - begins, _AT_ONCE)
    rate, edges = lengths / takes, np.arange(bins + 1)
    so_far = np.zeros(bins + 1)
    for at, slope in ((ends - takes, rate), (ends, -rate)):
        behind = np.clip(np.ceil(at), 0, bins + 1).astype(np.int64)  # the first edge that it lies before
        slopes, moments = (np.bincount(behind, each, bins + 2)[: bins + 1].cumsum() for each in (slope, slope * at))
        so_far += slopes * edges - moments
    return np.diff(np.rint(so_far)).astype(np.int64)


def _counted(
    lengths: NDArray[np.int64],
    kinds: NDArray[np.uint8],
    marks: NDArray[np.uint8],
    slots: NDArray[np.int64],
    bins: int,
) -> NDArray[np.int64]:
    noise = kinds == Kind.NOISE
    weights = (lengths, ~noise, marks >= Severity.WARNING, lengths * noise)
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


_LISTED_UNITS = 256


class Band(NamedTuple):
    """Rows that ended in each bin, and how many of them a warning or an error stands on; `cause`: see `bands`."""

    name: str
    counts: NDArray[np.int64]
    troubles: NDArray[np.int64]
    cause: int | None = None


def bands(
    bus: Bus,
    scope: Sequence[Test],
    span: tuple[int, int],
    bins: int,
    named: Sequence[tuple[str, Test]],
    causes: Sequence[NDArray[np.int64]] = (),
    stop: Callable[[], bool] = bool,
) -> list[Band]:
    """A band for each cause that shows in the span, each of the kept tests, and each unit, of rows that pass the scope.

    A unit that only damaged frames speak of is none: their unit may be what was damaged.
    `causes` are the rows that show each (`rowstores.rows_of_causes`); a band has the number of its cause.
    """
    t_start, t_end = span
    width = max(t_end - t_start, 1) / bins
    by_unit = np.zeros((2, _LISTED_UNITS, bins), np.int64)
    by_test = np.zeros((2, len(named), bins), np.int64)
    by_cause = np.zeros((len(causes), bins), np.int64)
    first, last = bus.table.row_at_time(t_start), bus.table.row_at_time(t_end) + 1
    for number, low, high in bus.table.slices(first, min(last, bus.count)):
        if stop():
            break
        unit, kind, mark, ends = (
            bus.table.column(number, name)[low:high] for name in ("unit", "kind", "mark", "t_end_ns")
        )
        slots = ((ends - t_start) // width).astype(np.int64)
        inside = (slots >= 0) & (slots < bins)
        for test in scope:
            inside &= test(bus, number, low, high)
        grave = mark >= Severity.WARNING
        framed = inside & (kind != Kind.NOISE)
        for i, wanted in enumerate((framed, framed & grave)):
            keys = unit[wanted].astype(np.int64) * bins + slots[wanted]
            by_unit[i] += np.bincount(keys, minlength=_LISTED_UNITS * bins).reshape(_LISTED_UNITS, bins)
        for k, (_, test) in enumerate(named):
            passed = inside & test(bus, number, low, high)
            for i, wanted in enumerate((passed, passed & grave)):
                by_test[i, k] += np.bincount(slots[wanted], minlength=bins)
        for k, rows in enumerate(causes):
            begin, end = np.searchsorted(rows, (number * PIECE + low, number * PIECE + high))
            own = rows[begin:end] - (number * PIECE + low)
            by_cause[k] += np.bincount(slots[own[inside[own]]], minlength=bins)
    units = np.flatnonzero(by_unit[0].any(axis=1) & bus.units.heard).tolist()
    return [
        *(
            Band(tr("cause {number}", number=k + 1), counts, counts, k)
            for k, counts in enumerate(by_cause)
            if counts.any()
        ),
        *(Band(name, by_test[0, k], by_test[1, k]) for k, (name, _) in enumerate(named)),
        *(Band(tr("unit {number}", number=unit), by_unit[0, unit], by_unit[1, unit]) for unit in units),
    ]


_SECOND_NS: Final = 1_000_000_000
_DAY_S: Final = 86_400
_STEPS_S: Final = (
    60, 120, 300, 600, 900, 1800, 3600, 7200, 10_800, 21_600, 43_200,
    *(_DAY_S * days for days in (1, 2, 7, 14, 28, 56, 112, 365)),
)  # fmt: skip


def time_marks(begin_ns: int, end_ns: int, most: int, zone: tzinfo) -> Iterator[tuple[int, str]]:
    """Some times of the span, about `most` of them at most, with what to call them: `08:30`, or at midnight `11-21`."""
    wide = (end_ns - begin_ns) / _SECOND_NS / max(1, most)
    step = next((step for step in _STEPS_S if step >= wide), _STEPS_S[-1])
    offset = moment_of(begin_ns / _SECOND_NS, zone).utcoffset()
    ahead = 0 if offset is None else int(offset.total_seconds())
    at = -(-(begin_ns // _SECOND_NS + ahead) // step) * step - ahead
    while at * _SECOND_NS <= end_ns:
        moment = moment_of(at, zone)
        yield at * _SECOND_NS, f"{moment:%m-%d}" if (at + ahead) % _DAY_S == 0 else f"{moment:%H:%M}"
        at += step
