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
_BLANK: Final = 0x2800


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

    def at(self, t_ns: int) -> float | None:
        """What it was then."""
        index = int(np.searchsorted(self.t_ns, t_ns, side="right")) - 1
        return None if index < 0 else float(self.numbers[index])


def dots(series: Series, span: tuple[int, int], columns: int, rows: int) -> NDArray[np.int64]:
    """A series as braille cells (rows, columns): least to greatest of each column of dots, joined to the one before."""
    grid = np.zeros((rows, columns), np.int64)
    reach = series.range
    if reach is None:
        return grid
    low, high = reach
    wide, tall = 2 * columns, 4 * rows
    indices = ((series.t_ns - span[0]).astype(float) * (wide - 1) / max(1, span[1] - span[0])).round().astype(np.int64)
    inside = (indices >= 0) & (indices < wide)
    indices, number = indices[inside], series.numbers[inside]
    level = np.full(len(number), tall // 2) if high == low else np.zeros(len(number))
    with np.errstate(invalid="ignore"):
        level = level if high == low else (number - low) / (high - low) * (tall - 1)
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

    def __init__(self, *, id: str, when: Callable[[int], str]) -> None:
        super().__init__(id=id)
        self.title = ""
        self.series: Sequence[Series] = ()
        self.ticks: NDArray[np.int64] = np.zeros(0, np.int64)
        self.cursor: float | None = None  # share of the span
        self._when = when  # a time in words
        self._cells: list[NDArray[np.int64]] = []
        self._drawn = (0, 0)

    def show(self, title: str, series: Sequence[Series], ticks: NDArray[np.int64] | None = None) -> None:
        """Other series; `ticks` are times of findings."""
        self.title, self.series = title, series
        self.ticks = np.zeros(0, np.int64) if ticks is None else ticks
        self._cells, self._drawn = [], (0, 0)
        self.refresh()

    def move(self, step: int) -> None:
        """The cursor of time, by columns; over either end it goes."""
        columns = max(2, self.content_size.width - _LABEL - 1)
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
        return self.strip(fitted(self._line(y, width, height), width), width, self.base)

    def _line(self, y: int, width: int, height: int) -> list[StyledText]:
        span = self.span
        legend = len(self.series) if len(self.series) > 1 else 0
        if y == 0 or span is None:
            return [StyledText(self.title if y == 0 else "", "strong")]
        if y <= legend:
            return self._legend(y - 1)
        columns, rows = max(2, width - _LABEL - 1), height - 3 - legend
        y -= 1 + legend
        if rows < 1:
            return []
        if y < rows:
            return self._dots(y, columns, rows, span)
        return self._tick_line(columns, span) if y == rows else self._axis(columns, span)

    def _legend(self, number: int) -> list[StyledText]:
        series = self.series[number]
        reach = series.range
        values = tr("no number") if reach is None else tr("{low:.6g} to {high:.6g}", low=reach[0], high=reach[1])
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
        return "" if number is None else tr(", here {number:.7g}", number=number)

    def _time(self, span: tuple[int, int]) -> int:
        return span[0] + round((span[1] - span[0]) * (self.cursor or 0.0))

    def _dots(self, y: int, columns: int, rows: int, span: tuple[int, int]) -> list[StyledText]:
        if self._drawn != (columns, rows):
            self._cells = [dots(series, span, columns, rows) for series in self.series]
            self._drawn = columns, rows
        reach = self.series[0].range if len(self.series) == 1 else None
        label = "" if reach is None else f"{reach[1]:.6g}" if y == 0 else f"{reach[0]:.6g}" if y == rows - 1 else ""
        if reach is not None and reach[0] == reach[1]:
            label = f"{reach[0]:.6g}" if y == rows // 2 else ""
        cursor_column = None if self.cursor is None else round(self.cursor * (columns - 1))
        parts = [StyledText(f"{label:>{_LABEL}} ", "dim")]
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
            StyledText(f"{tr('findings') if len(positions) else '':>{_LABEL}} ", "dim"),
            StyledText("".join(marks), "error"),
        ]

    def _axis(self, columns: int, span: tuple[int, int]) -> list[StyledText]:
        first, last = self._when(span[0]), self._when(span[1])
        middle = ""
        if self.cursor is not None:
            middle = self._when(self._time(span))
            if len(self.series) == 1:
                middle += self._read(self.series[0])
        room = columns - len(first) - len(last)
        return [
            StyledText(" " * (_LABEL + 1) + first, "dim"),
            StyledText(f"{middle:^{max(0, room)}}" if len(middle) <= room else " " * max(1, room), "strong"),
            StyledText(last, "dim"),
        ]
