"""The page's charts: octets and findings over the time of a capture, and the geometry of all that is drawn.

Arrays and times go in, places in a drawing come out. The template draws them as SVG.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...languages import counted, grouped, page_words
from ...outages import Deaf, unheard
from ...tables.bins import TimeBins
from ...tables.findings import Findings, Severity, rules
from ...tables.schema import Rows
from ...words import decimal, duration, unit_word
from ..model import UnitRow

TROUBLE_BINS: Final = 240
_FIRST_TROUBLE_BIN_NS: Final = 1_000_000


class TroubleBins:
    """Octets and findings by severity, a bin each, over the whole capture.

    Bytes spread evenly over the time that their row took, so that a long frame does not stand in one narrow bin;
    findings count where their bytes begin.
    """

    def __init__(self) -> None:
        self._bins = TimeBins(TROUBLE_BINS, _FIRST_TROUBLE_BIN_NS)
        self._bins.tables.update(octets=np.zeros(TROUBLE_BINS))
        self._bins.tables.update({severity: np.zeros(TROUBLE_BINS, np.int64) for severity in Severity})

    @property
    def origin_ns(self) -> int | None:
        """The start of the first bin, None before any row."""
        return self._bins.begin_ns

    @property
    def width_ns(self) -> int:
        """Of a bin."""
        return self._bins.width_ns

    @property
    def octets(self) -> NDArray[np.float64]:
        """Bytes of each bin."""
        return self._bins.tables["octets"]

    @property
    def errors(self) -> NDArray[np.int64]:
        """Findings of each bin that are errors."""
        return self._bins.tables[Severity.ERROR]

    @property
    def warnings(self) -> NDArray[np.int64]:
        """Findings of each bin that are warnings."""
        return self._bins.tables[Severity.WARNING]

    def add(self, rows: Rows, findings: Findings) -> None:
        """Count rows in, nearly in order of time, and what was found on them."""
        if len(rows):
            self._spread(rows, self._bins.reach(int(rows.t_start_ns.min()), int(rows.t_end_ns.max())))
        placed = findings[findings.start >= 0]
        if self.origin_ns is None or not len(placed):
            return
        bins = self._bins.bins(placed.t_ns)
        severities = np.array([rule.severity for rule in rules()])[placed.rule]
        for severity in Severity:
            self._bins.tables[severity] += np.bincount(bins[severities == severity], minlength=TROUBLE_BINS)

    def used(self, span_ns: int) -> int:
        """How many bins a capture of that length fills."""
        return min(TROUBLE_BINS, max(1, -(-span_ns // self.width_ns)))

    def _spread(self, rows: Rows, origin_ns: int) -> None:
        passed = np.cumsum(rows.length)
        times = np.column_stack((rows.t_start_ns, rows.t_end_ns)).ravel() - origin_ns
        sums = np.column_stack((passed - rows.length, passed)).ravel()
        edges = np.arange(TROUBLE_BINS + 1) * float(self.width_ns)
        below = np.interp(edges, np.maximum.accumulate(times), sums)
        below[0], below[-1] = 0.0, passed[-1]  # nothing is lost before the first bin or on the last edge
        self._bins.tables["octets"] += np.diff(below)


WIDTH: Final = 900  # of a drawing, in its own units; it scales with the page
_LEFT: Final = 54
_RIGHT: Final = 12
_LOAD: Final = 110  # height of the load's lane
_TROUBLE: Final = 46  # and of the troubles' lane below
_GAP: Final = 12
_FIGURES: Final = 4
_ROW: Final = 26
_TICKS: Final = 8
_STEPS_S: Final = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 14400, 21600, 43200, 86400)


@dataclass(frozen=True, slots=True)
class AxisTick:
    """A place on an axis, and what stands there."""

    at: float
    text: str


@dataclass(frozen=True, slots=True)
class Bar:
    """An upright bar, and what to say of it."""

    x: float
    y: float
    width: float
    height: float
    kind: str
    title: str


@dataclass(frozen=True, slots=True)
class TimeChart:
    """Load above, troubles below, time along."""

    left: float
    right: float
    base: float  # bottom of the load's lane
    foot: float  # bottom of the troubles' lane
    height: float
    area: str  # path of the load
    top: str  # what the top of the load's lane means
    most: int  # troubles in the fullest bin
    bars: tuple[Bar, ...]
    deaf: tuple[Bar, ...]  # times in which the recorder heard nothing
    ticks: tuple[AxisTick, ...]
    bin: str  # how long a bin is


@dataclass(frozen=True, slots=True)
class TimeRange:
    """One unit's response times on the axis."""

    unit: int
    y: float
    least: float
    p50: float
    p95: float
    most: float
    title: str


@dataclass(frozen=True, slots=True)
class RangeChart:
    """A line a unit, times along on a logarithmic scale."""

    left: float
    right: float
    height: float
    rows: tuple[TimeRange, ...]
    ticks: tuple[AxisTick, ...]


def time_chart(timeline: TroubleBins, span_ns: int, char_ns: float | None, deaf: Sequence[Deaf] = ()) -> TimeChart:
    """The bus over time; with `char_ns` (time of a character) as load, else as bytes a second."""
    count = timeline.used(span_ns)
    full = count * timeline.width_ns
    step = (WIDTH - _LEFT - _RIGHT) / count
    rate = timeline.octets[:count] * 1e9 / timeline.width_ns
    if char_ns:
        share = np.minimum(rate * char_ns / 1e9, 1.0)
        ceiling = next(limit for limit in (0.05, 0.1, 0.25, 0.5, 1.0) if limit >= share.max() or limit == 1.0)
        heights, top = share / ceiling, decimal(f"{ceiling:.0%}")
    else:
        most_rate = max(float(rate.max()), 1.0)
        heights, top = rate / most_rate, f"{grouped(round(most_rate))} {unit_word('B/s')}"
    base, foot = 10.0 + _LOAD, 10.0 + _LOAD + _GAP + _TROUBLE
    area = f"M{_LEFT} {base:g}"
    for i, height in enumerate(heights.tolist()):
        area += f"V{base - height * _LOAD:.1f}H{_LEFT + (i + 1) * step:.1f}"
    area += f"V{base:g}Z"
    most = int((timeline.errors[:count] + timeline.warnings[:count]).max())
    ticks = tuple(
        AxisTick(_LEFT + at / full * (WIDTH - _LEFT - _RIGHT), duration(at) if at else "0") for at in _round_times(full)
    )
    bars = tuple(_trouble_bars(timeline, count, step, foot, max(most, 1)))
    shut = tuple(_deaf_bars(deaf, timeline.origin_ns or 0, full, foot))
    width = duration(timeline.width_ns)
    return TimeChart(_LEFT, WIDTH - _RIGHT, base, foot, foot + 26, area, top, most, bars, shut, ticks, width)


def _deaf_bars(deaf: Sequence[Deaf], origin_ns: int, full_ns: int, foot: float) -> Iterator[Bar]:
    scale = (WIDTH - _LEFT - _RIGHT) / full_ns
    for time in deaf:
        begin = min(max(time.from_ns - origin_ns, 0), full_ns)
        end = full_ns if time.to_ns is None else min(max(time.to_ns - origin_ns, 0), full_ns)
        yield Bar(_LEFT + begin * scale, 10.0, max((end - begin) * scale, 1.5), foot - 10.0, "deaf", unheard(time))


def _trouble_bars(timeline: TroubleBins, count: int, step: float, foot: float, most: int) -> list[Bar]:
    bars = []
    for i in np.flatnonzero(timeline.errors[:count] + timeline.warnings[:count]).tolist():
        y = foot
        for kind, number in (("error", int(timeline.errors[i])), ("warning", int(timeline.warnings[i]))):
            if number:
                height = max(number / most * _TROUBLE, 3.0)
                y -= height
                time = duration(i * timeline.width_ns)
                title = page_words("{count} at {time}", count=counted(number, kind, f"{kind}s"), time=time)
                bars.append(Bar(_LEFT + i * step, y, max(step - 0.6, 1.5), height, kind, title))
    return bars


def _round_times(full_ns: int) -> range:
    """Round times from 0 to the end, few enough to be told apart."""
    least = full_ns / _TICKS
    if least <= 1e9:
        power = 10 ** math.floor(math.log10(max(least, 1e3)))
        step = next(int(power * n) for n in (1, 2, 5, 10) if power * n >= least or n == 10)
    else:
        days = math.ceil(least / 86_400e9) * 86_400
        step = next((s for s in _STEPS_S if s * 1e9 >= least), days) * 1_000_000_000
    return range(0, full_ns + 1, step)


def range_chart(units: Sequence[UnitRow]) -> RangeChart | None:
    """Response times of units that have some; None where none has."""
    rows = []
    for unit in units:
        times = unit.times
        bounds = [each for f in ("min", "p50", "p95", "max") if (each := times.bounds(f)) is not None]
        if len(bounds) == _FIGURES:
            ends = [bounds[0][0], sum(bounds[1]) // 2, sum(bounds[2]) // 2, bounds[3][1]]
            rows.append((unit.unit, [max(value, 1_000) for value in ends], times))
    if not rows:
        return None
    low = math.floor(math.log10(min(four[0] for _, four, _ in rows)))
    high = max(math.ceil(math.log10(max(four[3] for _, four, _ in rows))), low + 1)
    wide = WIDTH - _LEFT - _RIGHT - 20

    def x_of(ns: float) -> float:
        return round(_LEFT + (math.log10(ns) - low) / (high - low) * wide, 1)

    ranges = tuple(
        TimeRange(
            unit,
            _ROW * (i + 0.5) + 4,
            x_of(four[0]),
            x_of(four[1]),
            x_of(four[2]),
            x_of(four[3]),
            page_words(
                "unit {unit}: min {min}, p50 {p50}, p95 {p95}, max {max} ({count:,} measured)",
                unit=unit,
                count=times.count,
                **{figure: times.worded(figure) for figure in ("min", "p50", "p95", "max")},
            ),
        )
        for i, (unit, four, times) in enumerate(rows)
    )
    ticks = tuple(AxisTick(x_of(10.0**power), duration(10**power)) for power in range(low, high + 1))
    return RangeChart(_LEFT, WIDTH - _RIGHT, _ROW * len(ranges) + 34, ranges, ticks)
