"""The units: how each answers, how much of the line it takes, how its response times went, plotted below."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, ClassVar, Final

from textual.binding import Binding, BindingType
from textual.containers import Vertical
from textual.strip import Strip

from ..languages import tr
from ..tables.schema import bounds_of
from ..words import compact, percent, rough_percent, short_bound
from .filterbar import FilterBar
from .lines import Lines
from .paint import Painted, StyledText, fitted
from .places import OF_FIGURES, Place, UnitPlace
from .plot import EIGHTHS, over_time
from .view import DoorCell, View

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..reports.model import Report, UnitRow
    from .desk import ViewState
    from .screen import BusScreen


_WIDE: Final = 20  # times the shortest: longer ones leave nothing to see of it on a linear scale


class AnswerTimes(Painted):
    """A unit's answer times over the capture, as bars."""

    def __init__(self, *, id: str, classes: str) -> None:
        super().__init__(id=id, classes=classes)
        self.unit: int | None = None
        self._times: list[float] = []
        self._written: Callable[[float], str] = str

    def show_times(self, unit: int | None, times: Sequence[float], written: Callable[[float], str]) -> None:
        """Mean times (ns, NaN: none) of equal stretches, oldest first; `written` puts one into words."""
        self.unit, self._times, self._written = unit, list(times), written
        self.refresh()

    def render_line(self, y: int) -> Strip:
        width, rows = self.content_size.width, self.content_size.height - 1
        if self.unit is None:
            return Strip.blank(width, self.base)
        times = [time for time in self._times if not math.isnan(time)]
        low, high = (min(times), max(times)) if times else (0.0, 0.0)
        orders = high > _WIDE * low > 0
        if y == 0:
            title = tr(" unit {unit}: mean answer time over the capture", unit=self.unit)
            parts = [StyledText(title, "strong"), StyledText(tr(", logarithmic scale") if orders else "", "dim")]
            return self.strip(fitted(parts, width), width, self.base)
        if not times or rows < 2:
            return self.strip([StyledText(tr(" no answer") if y == 1 else "", "dim")], width, self.base)
        label = self._written(high) if y == 1 else self._written(low) if y == rows else ""
        levels = _in_orders if orders else _in_proportion
        bars = self._bars(y - 1, rows, max(1, width - 12), levels(low, high, 8 * rows))
        return self.strip([StyledText(f"{label:>11} ", "dim"), StyledText(bars, "response")], width, self.base)

    def _bars(self, y: int, rows: int, width: int, level: Callable[[float], int]) -> str:
        """One line of the plot: bars in eighths of a line, each the newest time in its column."""
        line, at, last = [], 0, len(self._times) - 1
        for column in range(width):
            at = max(at, min(last, last * (column + 1) // width))
            time = self._times[at]
            line.append(" " if math.isnan(time) else EIGHTHS[max(0, min(8, level(time) - 8 * (rows - 1 - y)))])
        return "".join(line)


def _in_proportion(low: float, high: float, most: int) -> Callable[[float], int]:
    """Levels from 1 to `most` of times between these."""
    return lambda time: 1 + round((time - low) * (most - 1) / (high - low)) if high > low else most // 2


def _in_orders(low: float, high: float, most: int) -> Callable[[float], int]:
    """The same, an order of magnitude as high as the next one."""
    level = _in_proportion(math.log(low), math.log(high), most)
    return lambda time: level(math.log(time))


_MANY = 0.05  # of the requests without a good answer
_NONE: Final = {"none": 6, "bad": 6}  # columns of no answer and a damaged one, and their widths
_HEARD: Final = {"silent": 7, "garbage": 8}  # where one is told from the other
_BEFORE: Final = {"unit": 5, "load": 7, "asked": 6, "ok": 6, "exc": 6}
_BEHIND: Final = {"late": 6, "err": 6, "p50": 8, "p95": 8, "max": 8}
_DROPPED: Final = ("ok", "load", "p50", "late", "exc", "bad", "garbage", "none", "silent", "max")  # for want of room
_SPARKS: Final = 8  # columns from which on a line of answer times says something


class UnitList(Lines):
    """A line a unit; opening one filters the frames by it."""

    EMPTY = "no unit polled yet"
    BINDINGS: ClassVar[list[BindingType]] = [
        Binding("enter", "enter", "Open", tooltip="The rows of this unit alone"),
    ]

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self.desk = desk
        self.report: Report | None = None
        self._units: Sequence[UnitRow] = ()

    def use_report(self, report: Report) -> None:
        """Newer figures."""
        self.report, self._units = report, report.units_as_heard
        self.grown()
        if self.cursor != self._announced:
            self._tell()

    @property
    def empty(self) -> str:
        return self.desk.failed_words() or self.desk.emptied(self.EMPTY)

    @property
    def unit(self) -> int | None:
        """The unit under the cursor."""
        return self.report.units[self.cursor].unit if self.report and self.cursor < len(self.report.units) else None

    def history(self) -> tuple[int | None, list[float], Callable[[float], str]]:
        """Of the unit under the cursor: mean answer times over the capture, and how they are written."""
        unit, off_ns = self.unit, self.desk.bus.off_ns
        means = [] if unit is None else self.desk.answer_means(unit).tolist()
        return unit, means, lambda ns: short_bound(bounds_of(round(ns), off_ns) if ns else (0, 0))

    def count(self) -> int:
        return len(self.report.units) if self.report else 0

    def columns(self, width: int) -> dict[str, int]:
        """Those that there is room for, and their widths."""
        columns = _BEFORE | (_HEARD if self.report is not None and self.report.cards else _NONE) | _BEHIND
        for name in _DROPPED:
            if sum(columns.values()) > width:
                columns.pop(name, None)
        return columns

    def head(self, width: int) -> Sequence[StyledText]:
        columns = self.columns(width)
        text = "".join(f"{tr(f' {name}'):>{room}}" for name, room in columns.items())
        title = tr("  answer times over the capture")
        room = width - sum(columns.values()) - 2
        return fitted([StyledText(text + (title if room >= len(title) else ""))], width)

    def pieces(self, line: int, width: int) -> Sequence[StyledText]:
        assert self.report is not None
        unit, columns = self._units[line], self.columns(width)
        parts = [self._cell(unit, name, room) for name, room in columns.items()]
        room = width - sum(columns.values()) - 2
        if room >= _SPARKS:
            parts.append(StyledText("  " + over_time(self.desk.answer_means(unit.unit), room), "response"))
        return fitted(parts, width)

    def _cell(self, unit: UnitRow, name: str, room: int) -> StyledText:
        """What stands in a column."""
        counts = unit.counts
        if name in ("p50", "p95", "max"):
            return StyledText(f"{short_bound(unit.times.bounds(name)):>{room}}")
        if name == "unit":
            return StyledText(f"{unit.unit:>{room}}")
        if name == "load":
            return StyledText(f"{self._load(unit.unit):>{room}}", "dim")
        if name == "err":
            rate = (counts.unanswered + counts.exceptions + counts.damaged) / max(1, counts.requests)
            share = rough_percent(rate) if rate else "-"
            return StyledText(f"{share:>{room}}", "error" if rate > _MANY else "warning" if rate else "dim")
        number, kind = {
            "asked": (counts.requests, ""),
            "ok": (counts.answered, ""),
            "exc": (counts.exceptions, "warning"),
            "late": (counts.late, "error"),
            **dict.fromkeys(("none", "silent"), (counts.unanswered, "error")),
            **dict.fromkeys(("bad", "garbage"), (counts.damaged, "error")),
        }[name]
        return StyledText(f"{compact(number) if number else '-':>{room}}", kind if number else "dim")

    def _load(self, unit: int) -> str:
        """The share of the line's time that a unit's frames take; empty where it is not known."""
        bus = self.desk.bus
        if not bus.char_ns or not bus.timed or bus.t_last <= bus.t_first:
            return ""
        return percent(self.desk.figures.units.octets[unit] * bus.char_ns / (bus.t_last - bus.t_first))


def _widget(desk: ViewState) -> Widget:
    return Vertical(UnitList(desk, id="unit-list"), AnswerTimes(id="unit-history", classes="history"), id="units")


def _refresh(screen: BusScreen) -> None:
    listing = screen.query_one(UnitList)
    screen.jobs.count_report(VIEW.name, listing.use_report, failed=listing.grown)


def _chosen(screen: BusScreen, sender: Widget) -> None:
    assert isinstance(sender, UnitList)
    screen.query_one("#unit-history", AnswerTimes).show_times(*sender.history())


def _entered(screen: BusScreen, sender: Widget) -> None:
    """The frames of that unit alone."""
    assert isinstance(sender, UnitList)
    if sender.unit is not None:
        screen.action_view(screen.list_view)
        screen.query_one(FilterBar).use_filter(f"unit == {sender.unit}")


def _cells(screen: BusScreen) -> list[DoorCell]:
    unit = screen.query_one(UnitList).unit
    return [] if unit is None else [DoorCell("u", tr("unit {unit}", unit=unit), f"unit == {unit}")]


def _at(screen: BusScreen) -> Place:
    unit = screen.query_one(UnitList).unit
    return None if unit is None else UnitPlace(unit)


VIEW: Final = View(
    name="units", key="9", title="Units", tab=False,
    make=_widget, refresh=_refresh, chosen=_chosen, entered=_entered, at=_at, cells=_cells,
    offers=OF_FIGURES, figures=True,
)  # fmt: skip
