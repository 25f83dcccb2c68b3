"""Numbers over time: each column is the least and the greatest that was read in it, so that nothing is thinned away.

Several series share the axis of time, each in a band of its own with a scale of its own: over one another they could
be told apart by colour alone. Findings stand below as ticks, and a cursor reads what each series was.

Beside words numbers are small lines of blocks, in eighths of a line, of which taller plots are made, too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from rich.cells import cell_len
from textual.strip import Strip

from ..languages import tr
from .paint import Painted, StyledText, fitted
from .plotwindow import PlotWindow

EIGHTHS: Final = " ▁▂▃▄▅▆▇█"  # of a cell, from none to all


def sparkline(values: NDArray[np.float64], width: int, line: int = 0, lines: int = 1) -> str:
    """Values as blocks from 0 to the most, joined to fit, a space where there is none; of several lines one."""
    if not len(values) or width < 1 or np.isnan(values).all():
        return ""
    groups = [group[~np.isnan(group)] for group in np.array_split(values, min(width, len(values)))]
    means = [float(group.mean()) if len(group) else None for group in groups]
    high = max(mean for mean in means if mean is not None)
    scale = ((len(EIGHTHS) - 1) * lines - 1) / high if high > 0 else 0.0
    under = (len(EIGHTHS) - 1) * (lines - 1 - line)
    levels = (0 if mean is None else 1 + round(max(0.0, mean) * scale) for mean in means)
    return "".join(EIGHTHS[max(0, min(len(EIGHTHS) - 1, level - under))] for level in levels)


def over_time(values: NDArray[np.float64], width: int) -> str:
    """The same of equal parts of a time, which fill the width where they are fewer."""
    if len(values) < width:
        values = values[np.arange(width) * len(values) // max(1, width)] if len(values) else values
    return sparkline(values, width)


def trend(values: NDArray[np.float64], width: int) -> StyledText:
    """The same from the least to the most, in exactly this many columns; a line where they stand still."""
    line, kind = "", _KINDS[0]
    if not np.isnan(values).all():
        line = over_time(values - np.nanmin(values), width)
        if np.nanmin(values) == np.nanmax(values):
            line, kind = "".join("─" if block.strip() else " " for block in line), "dim"
    return StyledText(f"{line:<{width}}", kind)


_DOTS: Final = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # of a braille cell: row, column
_KINDS: Final = ("request", "response", "noise", "place", "strong")
_LABEL: Final = 11
_SHORT_LABEL: Final = 8
_NARROW: Final = 60  # columns under which labels are shorter
_DATE: Final = 10  # of a time, where there is no room for more
_FINE_NS: Final = 5 * 60 * 10**9  # spans under which the cursor's time is told to the millisecond
_WHOLE: Final = 1e15  # under which a number without a fraction is told in full
_DIGITS: Final = range(6, 18)  # of a number
_BLANK: Final = 0x2800
_FAR: Final = 0.01  # the share of readings at either end that may stand far off
_LOST: Final = 5  # times so wide must all of them be, for the others to be drawn by themselves
_NAMED: Final = 2  # numbers off the scale that are named
_ENOUGH: Final = 50  # readings from which on a few are known from many
_KNOWN_GAPS: Final = 8  # between readings, from which on a hole is known from them
_USUAL: Final = 0.9  # the share of gaps that are
_HOLE: Final = 8  # times as long as those is none
_TICKS: Final = 5  # lines from which on the scale has a middle
_AROUND: Final = 3  # lines that are no band: title, findings, times
_BORDER: Final = 1
_LEAST_HEIGHT: Final = 8
_LEAST_BAND: Final = 2  # lines: what it is, and the curve


@dataclass(frozen=True)
class Series:
    """Times (ns, ascending) and numbers; NaN: none from then on."""

    name: str
    t_ns: NDArray[np.int64]
    numbers: NDArray[np.float64]
    measure: str = ""  # what they are counted in: V
    short: str = ""  # its name where there is little room

    @property
    def range(self) -> tuple[float, float] | None:
        """The least and the greatest; None where there is none."""
        good = self.numbers[np.isfinite(self.numbers)]
        return (float(good.min()), float(good.max())) if len(good) else None

    @property
    def scale(self) -> tuple[float, float] | None:
        """Between what it is drawn: `range`, but for a few numbers so far off that they would flatten all others."""
        reach = self.range
        if reach is None or len(self.numbers) < _ENOUGH:
            return reach
        low, high = (float(each) for each in np.nanquantile(self.numbers, (_FAR, 1 - _FAR)))
        good = self.numbers[np.isfinite(self.numbers)]
        room = (high - low) / 2
        inner = good[(good >= low - room) & (good <= high + room)]
        low, high = float(inner.min()), float(inner.max())
        return (low, high) if 0 < (high - low) * _LOST <= reach[1] - reach[0] else reach

    @property
    def beyond(self) -> NDArray[np.float64]:
        """The numbers outside the scale."""
        low, high = self.scale or (0.0, 0.0)
        return self.numbers[(self.numbers < low) | (self.numbers > high)]

    def at(self, t_ns: int) -> float | None:
        """What it was then."""
        index = int(np.searchsorted(self.t_ns, t_ns, side="right")) - 1
        return None if index < 0 else float(self.numbers[index])


def dots(series: Series, span: tuple[int, int], columns: int, rows: int) -> NDArray[np.int64]:
    """A series as braille cells (rows, columns): least to greatest of each column of dots, joined to the one before."""
    grid = np.zeros((rows, columns), np.int64)
    scale = series.scale
    if scale is None:
        return grid
    low, high = scale
    wide, tall = 2 * columns, 4 * rows
    indices = ((series.t_ns - span[0]).astype(float) * (wide - 1) / max(1, span[1] - span[0])).round().astype(np.int64)
    inside = (indices >= 0) & (indices < wide)
    indices, number = indices[inside], series.numbers[inside]
    level = np.full(len(number), tall // 2) if high == low else np.zeros(len(number))
    with np.errstate(invalid="ignore"):
        level = level if high == low else ((number - low) / (high - low) * (tall - 1)).clip(0, tall - 1)
    before: int | None = None
    holes = _behind_holes(series.t_ns)[inside]
    cuts = np.flatnonzero(np.diff(indices)) + 1
    begins, ends = np.concatenate(([0], cuts)), np.concatenate((cuts, [len(indices)]))
    column_before = 0
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        if begin == end:
            continue
        column, levels = int(indices[begin]), level[begin:end]
        if holes[begin]:
            before = None  # nobody read it for long: what it was then is not known
        good = levels[np.isfinite(levels)]
        if before is not None:  # held until this reading
            for between in range(column_before + 1, column):
                _set(grid, between, before, before, tall)
        if not len(good):
            before = None
            continue
        least, most = round(float(good.min())), round(float(good.max()))
        if before is not None:
            least, most = min(least, before), max(most, before)
        _set(grid, column, least, most, tall)
        before = round(float(levels[-1])) if np.isfinite(levels[-1]) else None
        column_before = column
    return grid


def _behind_holes(t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Which readings come after a time without any, many times as long as usual."""
    behind = np.zeros(len(t_ns), np.bool_)
    gaps = np.diff(t_ns)
    if len(gaps) >= _KNOWN_GAPS:
        behind[1:] = gaps > _HOLE * np.quantile(gaps, _USUAL)
    return behind


def _set(grid: NDArray[np.int64], column: int, least: int, most: int, tall: int) -> None:
    for level in range(least, most + 1):
        y = tall - 1 - level
        grid[y // 4, column // 2] |= _DOTS[y % 4, column % 2]


class Plot(Painted):
    """Series over one axis of time."""

    def __init__(self, *, id: str, when: Callable[[int, bool], str]) -> None:
        """`when`: a time in words; True: to the millisecond."""
        super().__init__(id=id)
        self.title = ""
        self.series: Sequence[Series] = ()
        self.ticks: NDArray[np.int64] = np.zeros(0, np.int64)
        self.cursor: float | None = None  # share of the span
        self.window = PlotWindow()
        self._all: Sequence[Series] = ()  # what was given: `series` are cut to the window
        self._now: int | None = None
        self._when = when
        self._cells: list[NDArray[np.int64] | None] = []
        self._drawn = (0, 0)

    def show_series(
        self, title: str, series: Sequence[Series], ticks: NDArray[np.int64] | None = None, now: int | None = None
    ) -> None:
        """Other series; `ticks` are times of findings, `now` is the newest time heard, read or not."""
        self.title, self._all, self._now = title, series, now
        self.ticks = np.zeros(0, np.int64) if ticks is None else ticks
        self.styles.min_height = max(_LEAST_HEIGHT, _BORDER + _AROUND + _LEAST_BAND * len(series))
        self._cut()

    def _cut(self) -> None:
        reach = self.reach
        self.series = [] if reach is None else self.window.cut(self._all, reach)
        self._cells, self._drawn = [], (0, 0)
        self.refresh()

    def zoom(self, *, whole: bool = False) -> None:
        """A shorter time: around the cursor, without one the newest; or all of it again."""
        reach, span = self.reach, self.span
        if reach is None or span is None:
            return
        at = None if self.cursor is None else self._time(span)
        self.window = PlotWindow() if whole else self.window.shorter(reach, at)
        begin, end = self.window.of(reach)
        self.cursor = None if at is None else min(1.0, max(0.0, (at - begin) / max(1, end - begin)))
        self._cut()

    @property
    def _label(self) -> int:
        """Columns of what stands left of the plot."""
        return _LABEL if self.content_size.width >= _NARROW else _SHORT_LABEL

    @property
    def _columns(self) -> int:
        return max(2, self.content_size.width - self._label - 1)

    def move(self, step: int) -> None:
        """The cursor of time, by columns; over either end it goes."""
        columns = self._columns
        at = (columns if step < 0 else -1) if self.cursor is None else round(self.cursor * (columns - 1))
        at += step
        self.cursor = at / (columns - 1) if 0 <= at < columns else None
        self.refresh()

    @property
    def span(self) -> tuple[int, int] | None:
        """The time in sight; None where there is no reading."""
        reach = self.reach
        return None if reach is None else self.window.of(reach)

    @property
    def reach(self) -> tuple[int, int] | None:
        """From the first reading to the last, in a window up to now; None where there is none."""
        some = [series for series in self._all if len(series.t_ns)]
        if not some:
            return None
        last = max(int(s.t_ns[-1]) for s in some)
        newest = last if self._now is None or not self.window.length_ns else max(last, self._now)
        return min(int(s.t_ns[0]) for s in some), newest

    def render_line(self, y: int) -> Strip:
        width, height = self.content_size.width, self.content_size.height
        return self.strip(fitted(self._line(y, height), width), width, self.base)

    def _line(self, y: int, height: int) -> list[StyledText]:
        span = self.span
        if y == 0 or span is None:
            far = _far_off(self.series[0]) if y == 0 and len(self.series) == 1 else ""
            title = f"{self.title}{self.window.words}" if y == 0 else ""
            return [StyledText(title, "strong"), StyledText(far, "warning")]
        columns, room = self._columns, height - _AROUND
        if room < len(self.series):
            return []
        if y > room:
            return self._tick_line(columns, span) if y == room + 1 else self._axis(columns, span)
        tall = room // len(self.series)  # of a band; what is left over belongs to the first of them
        number, line = _band(y - 1, room - tall * len(self.series), tall)
        rows = tall + (room - tall * len(self.series) if number == 0 else 0)
        if len(self.series) == 1:
            return self._dots(number, line, columns, rows, span)
        if tall < _LEAST_BAND:
            return self._dots(number, line, columns, rows, span, self.series[number].short)
        return self._dots(number, line - 1, columns, rows - 1, span) if line else self._head(number, rows - 1)

    def _head(self, number: int, rows: int) -> list[StyledText]:
        """What stands over a band: whose it is, its newest number or that under the cursor; a reach for a scale."""
        series = self.series[number]
        reach = series.range
        values = tr("no number")
        if reach is not None:
            values = self._read(series) or tr("last {number}", number=_worded(series, float(series.numbers[-1])))
            if rows < _LEAST_BAND and reach[0] < reach[1]:
                low, high = told_apart(*reach)
                values += ", " + tr("{low} to {high}", low=low, high=high)
        name = series.name
        if cell_len(f"━ {name}: {values}") > self.content_size.width:
            name = series.short or name
        return [
            StyledText("━ ", _KINDS[number % len(_KINDS)]),
            StyledText(f"{name}: "),
            StyledText(values, "strong"),
            StyledText(_far_off(series), "warning"),
        ]

    def _read(self, series: Series) -> str:
        """What the cursor reads."""
        span = self.span
        if self.cursor is None or span is None:
            return ""
        number = series.at(self._time(span))
        return "" if number is None else tr("here {number}", number=_worded(series, number))

    def _time(self, span: tuple[int, int]) -> int:
        return span[0] + round((span[1] - span[0]) * (self.cursor or 0.0))

    def _dots(
        self, number: int, y: int, columns: int, rows: int, span: tuple[int, int], name: str = ""
    ) -> list[StyledText]:
        """A line of a series' curve; left of it the ends of its scale, or a name where there is no room for more."""
        if self._drawn != (columns, self.content_size.height):
            self._drawn, self._cells = (columns, self.content_size.height), [None] * len(self.series)
        series, cells = self.series[number], self._cells[number]
        if cells is None:
            cells = self._cells[number] = dots(series, span, columns, rows)
        label, reach = name[: self._label], series.scale
        if reach is not None and not name and (rows >= _LEAST_BAND or len(self.series) == 1):
            least, most = told_apart(*reach, self._label)
            at_most, at_least = (0, rows - 1) if reach[0] < reach[1] else ((rows - 1) // 2, (rows - 1) // 2)
            label = most if y == at_most else least if y == at_least else ""
            if rows >= _TICKS and reach[0] < reach[1] and y == (rows - 1) // 2:
                label = f"{reach[1] - (reach[1] - reach[0]) * y / (rows - 1):.4g}"
            measured = f"{label} {series.measure}"
            label = measured if label and series.measure and len(measured) <= self._label else label
        text = "".join(chr(_BLANK + cell) if cell else " " for cell in cells[y].tolist())
        kind = _KINDS[number % len(_KINDS)]
        parts = [StyledText(f"{label:>{self._label}} ", "dim")]
        if self.cursor is None:
            return [*parts, StyledText(text, kind)]
        at = round(self.cursor * (columns - 1))
        under = "┊" if text[at] == " " else text[at]
        return [*parts, StyledText(text[:at], kind), StyledText(under, "strong"), StyledText(text[at + 1 :], kind)]

    def _tick_line(self, columns: int, span: tuple[int, int]) -> list[StyledText]:
        marks = [" "] * columns
        inside = self.ticks[(self.ticks >= span[0]) & (self.ticks <= span[1])]
        positions = ((inside - span[0]).astype(float) * (columns - 1) / max(1, span[1] - span[0])).round().astype(int)
        for position in np.unique(positions).tolist():
            marks[position] = "▴"
        return [
            StyledText(f"{tr('findings') if len(positions) else '':>{self._label}} ", "dim"),
            StyledText("".join(marks), "error"),
        ]

    def _axis(self, columns: int, span: tuple[int, int]) -> list[StyledText]:
        first, last = self._when(span[0], False), self._when(span[1], False)
        of_one_day = len(first) > _DATE and first[:_DATE] == last[:_DATE] and first[_DATE] == " "
        if len(first) + len(last) >= columns:
            part = slice(_DATE + 1, None) if of_one_day else slice(_DATE)
            first, last = first[part], last[part]
        middle = ""
        if self.cursor is not None:
            middle = self._when(self._time(span), span[1] - span[0] < _FINE_NS)
            middle = middle[_DATE + 1 :] if of_one_day else middle
            if len(self.series) == 1:
                middle += f", {self._read(self.series[0])}" if self._read(self.series[0]) else ""
        room = columns - len(first) - len(last)
        return [
            StyledText(" " * (self._label + 1) + first, "dim"),
            StyledText(f"{middle:^{max(0, room)}}" if len(middle) <= room else " " * max(1, room), "strong"),
            StyledText(last, "dim"),
        ]


def told_apart(low: float, high: float, room: int = 24) -> tuple[str, str]:
    """Two numbers in at most so many columns, with as many digits as it takes to see that they are two."""
    texts = [(f"{low:.{digits}g}", f"{high:.{digits}g}") for digits in (*_DIGITS, 5, 4, 3, 2, 1)]
    fits = [pair for pair in texts if max(map(len, pair)) <= room] or texts[-1:]
    apart = sorted((pair for pair in fits if pair[0] != pair[1]), key=lambda pair: "e" in "".join(pair))
    return (apart or fits)[0]


def _band(y: int, rest: int, tall: int) -> tuple[int, int]:
    """The band that a line belongs to, and which line of it that is, where the first one is longer by the rest."""
    return (0, y) if y < tall + rest else ((y - rest) // tall, (y - rest) % tall)


def _worded(series: Series, number: float) -> str:
    if not np.isfinite(number):
        return tr("no number")
    figures = f"{number:.0f}" if number.is_integer() and abs(number) < _WHOLE else f"{number:.7g}"
    return f"{figures} {series.measure}".rstrip()


def _far_off(series: Series) -> str:
    """How many numbers stand at the edge of the plot since they are beyond it, and what they are."""
    beyond = series.beyond
    if not len(beyond):
        return ""
    some = np.unique(beyond)
    words = ", ".join(f"{number:.6g}" for number in some[:_NAMED])
    return tr(
        ", {count} off the scale: {numbers}", count=len(beyond), numbers=words + (" …" if len(some) > _NAMED else "")
    )
