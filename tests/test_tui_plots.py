"""Several values over one axis of time: each can be read by itself, in any colours and on small terminals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from seats import Seat, sample_in, using

import captures
from analyzer import languages
from analyzer.model.source import CaptureSource
from analyzer.tui.plot import Plot, Series
from analyzer.tui.plotwindow import PlotWindow
from analyzer.tui.registerlist import RegisterList

_BRAILLE = range(0x2801, 0x2900)


@pytest.mark.parametrize("size", [(80, 24), (80, 30), (40, 24), (120, 40)])
def test_pinned_values_stand_in_bands_of_their_own_each_with_its_newest_number(
    tmp_path: Path, size: tuple[int, int]
) -> None:
    async def work(sitting: Seat) -> None:
        plot, listing = sitting.screen.query_one(Plot), sitting.screen.query_one(RegisterList)
        await sitting.press("5", "space", "down", "space", "down", "down", "space", "down", "space", "down")
        await sitting.until(lambda: len(plot.series) == 5)
        await sitting.settle()
        lines = sitting.shown().splitlines()[-plot.size.height - 2 :]
        heads = [line for line in lines if "━ " in line]
        for line, series in zip(heads, plot.series, strict=True):
            assert line.split("━ ")[1].split(":")[0] in (series.name, series.short if size[0] < 80 else series.name)
        values = [series.numbers[-1] for series in plot.series]
        assert [float(line.split("last ")[1].split(",")[0].split()[0]) for line in heads] == values
        below = [lines[lines.index(head) + 1] for head in heads]
        assert all(any(ord(c) in _BRAILLE for c in line) for line in below)
        assert listing.size.height >= 4, "what is chosen among stays in sight"
        assert "▴" in lines[-4] and lines[-3].count(":") >= 2, "findings and times stay below them"

    using(CaptureSource(captures.open(sample_in(tmp_path)), "x"), work, size=size, view="registers")


def test_the_cursor_reads_every_band(tmp_path: Path) -> None:
    async def work(sitting: Seat) -> None:
        plot = sitting.screen.query_one(Plot)
        await sitting.press("5", "space", "down", "space", "left", "left")
        await sitting.until(lambda: len(plot.series) == 2)
        lines = sitting.shown().splitlines()
        assert sum("━ " in line and "here " in line for line in lines) == 2
        columns = [line.index("┊") for line in lines if "┊" in line]
        assert len(columns) > 1 and len(set(columns)) == 1

    using(CaptureSource(captures.open(sample_in(tmp_path)), "x"), work, size=(100, 40), view="registers")


def test_a_number_stands_with_its_measure_and_one_that_is_none_is_called_so(tmp_path: Path) -> None:
    async def work(sitting: Seat) -> None:
        plot = sitting.screen.query_one(Plot)
        await sitting.press("5")
        t_ns = np.arange(3) * 10**9
        volts = Series("mains", t_ns, np.array([229.5, 230, 230.25]), "V")
        plot.show_series("", (volts, Series("broken", t_ns, np.array([1.0, 2.0, np.nan]))))
        await sitting.pilot.pause()
        assert "mains: last 230.25 V" in sitting.shown() and "broken: last no number" in sitting.shown()

    using(CaptureSource(captures.open(sample_in(tmp_path)), "x"), work, size=(100, 40), view="registers")


def test_on_narrow_terminals_a_name_gives_way_to_the_number(tmp_path: Path) -> None:
    languages.use_language("ru")

    async def work(sitting: Seat) -> None:
        plot = sitting.screen.query_one(Plot)
        await sitting.press("5", "space", "down", "space")
        await sitting.until(lambda: len(plot.series) == 2)
        assert "━ 1 40002: последнее 564" in sitting.shown() and "━ 1 40108: последнее 230" in sitting.shown()

    using(CaptureSource(captures.open(sample_in(tmp_path)), "x"), work, size=(40, 24), view="registers")


_S = 10**9


def test_a_window_goes_along_with_the_newest_or_stands_around_a_time() -> None:
    reach = (0, 1000 * _S)
    last = PlotWindow().shorter(reach, None)
    assert last.of(reach) == (400 * _S, 1000 * _S)
    assert last.of((0, 1500 * _S)) == (900 * _S, 1500 * _S), "as a live bus goes on"
    around = last.shorter(reach, 700 * _S)
    assert around.of(reach) == around.of((0, 1500 * _S)) == (670 * _S, 730 * _S)
    assert last.shorter(reach, 990 * _S).of(reach)[1] == reach[1]
    shortest = last
    for _ in range(9):
        shortest = shortest.shorter(reach, None)
    assert shortest.of(reach) == (999 * _S, 1000 * _S) and shortest.shorter(reach, None) == shortest


def test_a_window_shows_what_a_value_was_when_it_began() -> None:
    t_ns = np.array([0, 100, 950, 995, 1000], np.int64) * _S
    (cut,) = PlotWindow(60 * _S).cut([Series("x", t_ns, np.arange(5.0))], (0, 1000 * _S))
    assert cut.t_ns.tolist() == [each * _S for each in (950, 995, 1000)] and cut.numbers.tolist() == [2, 3, 4]
    (cut,) = PlotWindow(10 * _S).cut([Series("x", t_ns, np.arange(5.0))], (0, 1000 * _S))
    assert cut.t_ns.tolist() == [each * _S for each in (995, 1000)], "nobody read it for longer than that"
    (cut,) = PlotWindow(10 * _S).cut([Series("x", t_ns[:4], np.arange(4.0))], (0, 1004 * _S))
    assert cut.t_ns.tolist() == [995 * _S] and cut.range == (3, 3), "the scale is that of what is in sight"
    (cut,) = PlotWindow(10 * _S).cut([Series("x", t_ns[:4], np.arange(4.0))], (0, 1006 * _S))
    assert cut.t_ns.tolist() == [996 * _S] and cut.numbers.tolist() == [3]


def test_keys_shorten_the_time_of_a_plot_and_show_it_all_again(tmp_path: Path) -> None:
    async def work(sitting: Seat) -> None:
        plot = sitting.screen.query_one(Plot)
        await sitting.press("5", "down")
        await sitting.until(lambda: len(plot.series) == 1 and len(plot.series[0].t_ns) > 1)
        whole = plot.span
        assert whole is not None and plot.reach == whole
        await sitting.press("plus")
        assert plot.span is not None and plot.span[1] == sitting.bus.t_last
        assert plot.span[1] - plot.span[0] == 10 * _S and ", the last 10 s" in sitting.shown()
        await sitting.press("left", "left", "left", "plus")
        assert plot.span[1] - plot.span[0] == _S and ", 1 s of it" in sitting.shown()
        await sitting.press("a")
        assert plot.span == whole and " of it" not in sitting.shown()

    using(CaptureSource(captures.open(sample_in(tmp_path)), "x"), work, size=(100, 40), view="registers")
