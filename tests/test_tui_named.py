"""What a register means, by a map, by the user's word or told from traffic, holds wherever values stand.

Whatever the type, the order of its words, its scale and its name: what is shown can be found and filtered by, is
plotted, exported and told where it changed.
"""

from __future__ import annotations

import asyncio
import csv
from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from pytest import approx
from running import PATIENCE_S
from seats import Seat, seat

from analyzer.model.bus import Bus
from analyzer.model.meanings import CHOICES, Meanings
from analyzer.model.polls import poll_values
from analyzer.model.search import find, wanted
from analyzer.model.selection import compiled
from analyzer.model.source import CaptureSource
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.plot import Plot
from analyzer.tui.registerlist import RegisterList
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes
from dissectors.maps.model import MappedValue, RegisterMap

_UNIT, _AREA, _FIRST, _COUNT = 1, 2, 0, 6
_NUMBERS = [meaning for meaning in CHOICES if meaning.is_number and meaning.kind not in ("hex", "bits", "u16")]
_LINE = LineSettings(19200)


@dataclass(frozen=True)
class Meant:
    """A value, where it stands, how it is read, and its registers in three answers of which the last is another."""

    at: int
    type: str  # `f32 CDAB`
    words: tuple[tuple[int, ...], ...]
    row: MappedValue | None  # the map's, else the user chose the type

    @property
    def name(self) -> str:
        return f"3{self.at + 1:04d}" if self.row is None else self.row.name

    def charts(self, units: object) -> Mapping[int, RegisterMap]:  # noqa: ARG002
        return {} if self.row is None else {_UNIT: RegisterMap("own", (self.row,))}

    @property
    def types(self) -> dict[tuple[int, int, int], str]:
        return {(_UNIT, _AREA, self.at): self.type} if self.row is None else {}

    @property
    def source(self) -> CaptureSource:
        """A client that asks for all of them, three times."""
        chunks, t_ns = [], 0
        for own in self.words:
            registers = [7, 8, 9, 10, 11, 12]
            registers[self.at : self.at + len(own)] = own
            answer = bytes([_UNIT, 4, 2 * _COUNT]) + np.array(registers, ">u2").tobytes()
            for body in (bytes([_UNIT, 4, 0, _FIRST, 0, _COUNT]), answer):
                chunks.append(Chunk(t_ns, body + crc_bytes(body)))
                t_ns += 50_000_000
        return CaptureSource(Capture.of(_LINE, chunks, timed=True), "named")


@st.composite
def meant(draw: st.DrawFn) -> Meant:
    meaning = draw(st.sampled_from(_NUMBERS))
    at = draw(st.integers(0, _COUNT - meaning.words))
    row = None
    if draw(st.booleans()):
        name = draw(st.sampled_from(["Voltage L1", "Ток фазы А", "flow", "P1.2 (kW)", "état"]))
        scale, unit = draw(st.sampled_from([1.0, 0.1, 0.01, 10.0])), draw(st.sampled_from(["", "V", "°C", "m³/h"]))
        offset = draw(st.sampled_from([0.0, 0.0, -40.0]))
        order = meaning.order or "ABCD"
        row = MappedValue("input", at, name, meaning.kind, order, meaning.words, scale, offset, unit=unit)
    if meaning.kind.startswith("f"):
        size = meaning.words * 2
        number = st.floats(2**-10, 2**20, width=32) | st.floats(-(2**20), -(2**-10), width=32)
        drawn = [draw(number), draw(number)]
        raw = [np.array([each], f">f{size}").view(">u2").tolist() for each in drawn]
        raw = [_ordered(each, meaning.order or "ABCD") for each in raw]
    else:
        low = st.lists(st.integers(0, 0xFFFF), min_size=meaning.words, max_size=meaning.words)
        raw = [draw(low), draw(low)]
    first, last = map(tuple, raw)
    return Meant(at, meaning.type, (first, first, last), row)


def _ordered(words: list[int], order: str) -> list[int]:
    """Registers of the first order as another has them."""
    out = list(words) if order[0] in "AB" else list(reversed(words))
    return out if order in ("ABCD", "CDAB") else [(word & 0xFF) << 8 | word >> 8 for word in out]


def _read(source: CaptureSource) -> Bus:
    bus = Bus.of(source)
    for analysed in source.steps(bool):
        bus.feed(analysed)
    bus.close()
    return bus


@given(meant())
@settings(max_examples=120, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_what_a_value_is_shown_as_finds_and_filters_it(value: Meant) -> None:
    bus = _read(value.source)
    assert bus.frames == 6
    meanings = Meanings(bus, lambda: value.types, lambda: value.charts)
    told = [
        next(each for each in meanings.readings(poll) if each.at == value.at) for poll in poll_values(bus, [0, 2, 4])
    ]
    assert [each.changed for each in told] == [False, False, value.words[0] != value.words[2]]
    number = told[2].meaning.number(value.words[2])
    if number is None:
        return
    shown = told[2].text.split(" ")[0]
    alike = [row for row, each in zip((1, 3, 5), told, strict=True) if each.text == told[2].text]
    hits = wanted(shown, meanings.charts).hits
    assert find(bus, hits, alike[0] - 1) == alike[0], shown  # a register of that number may stand before
    for text in (f'value("{value.name}") == {shown}', f'value("{value.name}") == {told[2].meaning.typed(number)}'):
        test = compiled(text, _LINE, meanings.charts).test
        passed = np.flatnonzero(test(bus, 0, 0, bus.count)).tolist()
        assert set(alike) <= set(passed), text
    if value.row is not None:
        assert find(bus, wanted(value.name, meanings.charts).hits, -1) is not None


@given(meant().filter(lambda value: value.words[0] != value.words[2]))
@settings(max_examples=4, suppress_health_check=[HealthCheck.too_slow], deadline=None)
def test_every_view_of_rows_shows_plots_filters_and_exports_it(value: Meant) -> None:
    bus = _read(value.source)
    meanings = Meanings(bus, lambda: value.types, lambda: value.charts)
    polls = poll_values(bus, [0, 4])
    old, new = (next(each for each in meanings.readings(poll) if each.at == value.at) for poll in polls)
    number = new.meaning.number(value.words[2])
    assume(number is not None and old.text != new.text)
    assert number is not None

    async def work(sitting: Seat, folder: Path) -> None:
        desk, screen = sitting.app.desk, sitting.screen
        desk.charts = value.charts
        desk.notes.types.update(value.types)
        desk.meanings.reworded()
        screen.reworded()
        registers = screen.query_one(RegisterList)
        for view in "1245":
            await sitting.press(view)
            await sitting.until(lambda: new.text in _in_one(sitting))
            assert value.row is None or value.name in _in_one(sitting), view
        registers.go_to_spot((_UNIT, _AREA, value.at))
        plot = screen.query_one(Plot)
        await sitting.until(lambda: value.name in plot.title and bool(plot.series))
        assert plot.series[0].numbers[-1] == number
        for view in "54":
            out = folder / f"{view}.csv"
            await sitting.press(view, "e", "ctrl+u")
            await sitting.type(str(out))
            await sitting.press("enter")
            await sitting.until(partial(_heard, sitting, out.name))
            lines = list(csv.DictReader(out.read_text(encoding="utf-8").splitlines()))
            mine = [line for line in lines if value.name in line.values()]
            assert [float(line["value"]) for line in mine][-1] == approx(number, rel=1e-6), lines
        await sitting.press("1", "d")
        await sitting.until(lambda: "→" in _in_one(sitting))
        measure = new.meaning.measure
        assert f"{old.text.removesuffix(f' {measure}') if measure else old.text}→{new.text}" in _in_one(sitting)
        await sitting.press("d", "5")
        registers.go_to_spot((_UNIT, _AREA, value.at))
        await sitting.press("=", "v")
        assert f'value("{value.name}")' in screen.query_one(FilterBar).text
        await sitting.until(lambda: screen.transactions.count() == 1)

    async def main() -> None:
        with TemporaryDirectory() as folder:
            source = seat(value.source, view="transactions", size=(160, 40))
            async with source as sitting, asyncio.timeout(PATIENCE_S / 5):
                await work(sitting, Path(folder))

    asyncio.run(main())


def _in_one(sitting: Seat) -> str:
    return " ".join(sitting.shown().replace("*", " ").split())


def _heard(sitting: Seat, words: str) -> bool:
    return any(words in notice for notice in sitting.notices())
