"""Numbers over time: each column is the least and the greatest that was read in it, so that nothing is thinned away.

Several series share the axis of time, each with a scale of its own; findings stand below as ticks, and a cursor reads
what each series was.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from textual.strip import Strip

from ..languages import tr
from .paint import Painted, StyledText, fitted

_DOTS: Final = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]])  # of a braille cell: row, column
_KINDS: Final = ("accent", "request", "response", "noise", "warning")
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


@dataclass(frozen=True)
class Series:
    """Times (ns, ascending) and numbers; NaN: none from then on."""

    name: str
    t_ns: NDArray[np.int64]
    numbers: NDArray[np.float64]

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
    cuts = np.flatnonzero(np.diff(indices)) + 1
    begins, ends = np.concatenate(([0], cuts)), np.concatenate((cuts, [len(indices)]))
    column_before = 0
    for begin, end in zip(begins.tolist(), ends.tolist(), strict=True):
        if begin == end:
            continue
        column, levels = int(indices[begin]), level[begin:end]
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
        self._when = when
        self._cells: list[NDArray[np.int64]] = []
        self._drawn = (0, 0)

    def show(self, title: str, series: Sequence[Series], ticks: NDArray[np.int64] | None = None) -> None:
        """Other series; `ticks` are times of findings."""
        self.title, self.series = title, series
        self.ticks = np.zeros(0, np.int64) if ticks is None else ticks
        self._cells, self._drawn = [], (0, 0)
        self.refresh()

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
        """From the first reading to the last; None where there is none."""
        some = [series for series in self.series if len(series.t_ns)]
        if not some:
            return None
        return min(int(s.t_ns[0]) for s in some), max(int(s.t_ns[-1]) for s in some)

    def render_line(self, y: int) -> Strip:
        width, height = self.content_size.width, self.content_size.height
        return self.strip(fitted(self._line(y, height), width), width, self.base)

    def _line(self, y: int, height: int) -> list[StyledText]:
        span = self.span
        legend = len(self.series) if len(self.series) > 1 else 0
        if y == 0 or span is None:
            far = _far_off(self.series[0]) if y == 0 and len(self.series) == 1 else ""
            return [StyledText(self.title if y == 0 else "", "strong"), StyledText(far, "warning")]
        if y <= legend:
            return self._legend(y - 1)
        columns, rows = self._columns, height - 3 - legend
        y -= 1 + legend
        if rows < 1:
            return []
        if y < rows:
            return self._dots(y, columns, rows, span)
        return self._tick_line(columns, span) if y == rows else self._axis(columns, span)

    def _legend(self, number: int) -> list[StyledText]:
        series = self.series[number]
        reach = series.range
        values = tr("no number")
        if reach is not None:
            low, high = told_apart(*reach)
            values = tr("{low} to {high}", low=low, high=high)
        values += _far_off(series)
        return [
            StyledText(" ━ ", _KINDS[number % len(_KINDS)]),
            StyledText(f"{series.name}: {values}{self._read(series)}"),
        ]

    def _read(self, series: Series) -> str:
        """What the cursor reads."""
        span = self.span
        if self.cursor is None or span is None:
            return ""
        number = series.at(self._time(span))
        if number is None:
            return ""
        whole = number.is_integer() and abs(number) < _WHOLE
        return tr(", here {number}", number=f"{number:.0f}" if whole else f"{number:.7g}")

    def _time(self, span: tuple[int, int]) -> int:
        return span[0] + round((span[1] - span[0]) * (self.cursor or 0.0))

    def _dots(self, y: int, columns: int, rows: int, span: tuple[int, int]) -> list[StyledText]:
        if self._drawn != (columns, rows):
            self._cells = [dots(series, span, columns, rows) for series in self.series]
            self._drawn = columns, rows
        reach = self.series[0].scale if len(self.series) == 1 else None
        label = ""
        if reach is not None:
            least, most = told_apart(*reach, self._label)
            at_most, at_least = (0, rows - 1) if reach[0] < reach[1] else (rows // 2, rows // 2)
            label = most if y == at_most else least if y == at_least else ""
        cursor_column = None if self.cursor is None else round(self.cursor * (columns - 1))
        parts = [StyledText(f"{label:>{self._label}} ", "dim")]
        text, kind = "", ""
        for column in range(columns):
            owner = next((i for i, cells in enumerate(self._cells) if cells[y, column]), None)
            cell = " " if owner is None else chr(_BLANK + int(self._cells[owner][y, column]))
            own = kind if owner is None else _KINDS[owner % len(_KINDS)]
            if column == cursor_column:
                cell, own = ("┊" if owner is None else cell), "strong"
            if own != kind and text:
                parts.append(StyledText(text, kind))
                text = ""
            text, kind = text + cell, own
        return [*parts, StyledText(text, kind)]

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
                middle += self._read(self.series[0])
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
