"""The view of the registers: their list, and below it what is chosen and pinned in it over time."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from textual.containers import Vertical

from dissectors.values import logical

from ..languages import counted, tr
from ..model.registers import RegisterSeries
from ..words import duration
from .places import OF_FIGURES, Place, RegisterPlace
from .plot import Plot, Series
from .registerlist import AREA_NAMES, RegisterList, spot_text
from .view import DoorCell, View, register_text

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..model.registers import Spot
    from .desk import ViewState
    from .screen import BusScreen

_AGAIN_S: Final = 1.0  # between two readings of a plot while rows come


class RegistersPane(Vertical):
    """The list, and the plot of what is chosen and pinned in it."""

    def __init__(self, desk: ViewState, *, id: str) -> None:
        super().__init__(id=id)
        self._desk = desk
        self._series: dict[tuple[Spot, int], RegisterSeries] = {}
        self.next_at = 0.0

    def compose(self) -> object:  # type: ignore[override]
        yield RegisterList(self._desk, id="register-list")
        yield Plot(id="plot", when=self._desk.when)

    def series(self, spots: Sequence[Spot]) -> list[RegisterSeries]:
        """The readings of some values, as far as they were read."""
        listing = self.query_one(RegisterList)
        out = []
        for spot in spots:
            key = spot, listing.meaning(spot).words
            out.append(self._series.setdefault(key, RegisterSeries(*spot, words=key[1])))
        return out


def _plotted(screen: BusScreen) -> None:
    """Read what is chosen and pinned, then show it."""
    pane, listing, plot = screen.query_one(RegistersPane), screen.query_one(RegisterList), screen.query_one(Plot)
    register, bus = listing.register, screen.desk.bus
    if register is None:
        screen.jobs.run("history", lambda _: None, lambda _: plot.show_series("", ()))  # in the place of one on its way
        return
    pane.next_at = time.monotonic() + _AGAIN_S
    own = listing.owner(register)
    spots = [*listing.pins, *([] if own in listing.pins else [own])]
    wanted = pane.series(spots)

    def show_read(read: list[RegisterSeries]) -> None:
        meanings = [listing.meaning(spot) for spot in spots]
        series = []
        for spot, each, meaning in zip(spots, read, meanings, strict=True):
            t_ns, rows, registers = screen.desk.in_scope(*each.readings())
            if meaning.words == each.words:
                numbers = meaning.numbers(registers) if meaning.is_number else registers[:, 0].astype(float)
                times = t_ns if bus.timed else rows
                series.append(Series(listing.label(spot), times, numbers, meaning.measure, spot_text(spot)))
        count, span = len(series[-1].t_ns) if series else 0, ""
        if count > 1 and bus.timed:
            span = tr(" over {time}", time=duration(int(series[-1].t_ns[-1] - series[-1].t_ns[0])))
        plot.show_series(
            f" {listing.label(own)}: {counted(count, 'reading', 'readings')}{span}",
            series,
            bus.found.times(bus.table, own[0]),
            bus.t_last if bus.timed else None,
        )

    screen.jobs.run("history", lambda stop: [each.extend(bus, stop) for each in wanted], show_read)


def _widget(desk: ViewState) -> Widget:
    return RegistersPane(desk, id="registers")


def _refresh(screen: BusScreen) -> None:
    pane, bus = screen.query_one(RegistersPane), screen.desk.bus
    screen.query_one(RegisterList).grown()
    screen.jobs.tell_meanings()
    if time.monotonic() >= pane.next_at and pane.next_at and not bus.whole:
        _plotted(screen)


def _chosen(screen: BusScreen, sender: Widget) -> None:  # noqa: ARG001
    _plotted(screen)


def _entered(screen: BusScreen, sender: Widget) -> None:
    """The frame that brought the value; at the plot's cursor, the one that brought it then."""
    assert isinstance(sender, RegisterList)
    register, plot = sender.register, screen.query_one(Plot)
    if register is None:
        return
    row, span = register.row, plot.span
    if plot.cursor is not None and span is not None:
        (series,) = screen.query_one(RegistersPane).series([sender.owner(register)])
        t_ns, rows, _ = series.readings()
        at = int(np.searchsorted(t_ns, span[0] + round((span[1] - span[0]) * plot.cursor), side="right")) - 1
        row = int(rows[at]) if at >= 0 else row
    screen.jumps.go_to_row(row)


def _cells(screen: BusScreen) -> list[DoorCell]:
    listing = screen.query_one(RegisterList)
    register = listing.register
    if register is None:
        return []
    number = logical(register.address, AREA_NAMES[register.area])
    words = tr("register {register} of unit {unit}", register=number, unit=register.unit)
    return [
        *listing.value_cells(register),
        DoorCell("r", words, register_text(register.unit, number)),
        DoorCell("u", tr("unit {unit}", unit=register.unit), f"unit == {register.unit}"),
    ]


def _at(screen: BusScreen) -> Place:
    spot = screen.query_one(RegisterList).spot
    return None if spot is None else RegisterPlace(spot)


def _copied(screen: BusScreen) -> str:
    """The value under the cursor, with what it is called."""
    listing = screen.query_one(RegisterList)
    return "" if listing.register is None else listing.worded(listing.owner(listing.register))


VIEW: Final = View(
    name="registers", key="5", title="Registers",
    make=_widget, refresh=_refresh, chosen=_chosen, entered=_entered, at=_at, cells=_cells, copied=_copied,
    offers=OF_FIGURES | {"copy"}, figures=True,
)  # fmt: skip
