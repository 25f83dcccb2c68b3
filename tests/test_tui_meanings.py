"""What registers mean is shown, found and filtered by in every view, and kept in the model."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Mapping
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from seats import Seat, seat

from analyzer.model.bus import Bus
from analyzer.model.meanings import CHOICES, Meaning, Meanings
from analyzer.model.polls import poll_values
from analyzer.model.search import find, wanted
from analyzer.model.source import CaptureSource
from analyzer.tui.filterbar import FilterBar
from analyzer.tui.plot import Plot
from analyzer.tui.registerlist import RegisterList
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes
from dissectors.maps.model import MappedValue, RegisterMap
from dissectors.values import readings, registers_of

METER = RegisterMap(
    "meter",
    (
        MappedValue("input", 0, "Voltage L1", "f32", length=2, unit="V"),
        MappedValue("input", 2, "Voltage L2", "f32", length=2, unit="V"),
        MappedValue("input", 4, "Temperature", "s16", scale=0.1, offset=-40.0, unit="°C"),
        MappedValue("input", 5, "Mode", "enum", values={0: "off", 3: "boost"}),
    ),
)


def _adu(body: bytes) -> bytes:
    return body + crc_bytes(body)


def _capture(volts: list[float]) -> CaptureSource:
    """A client that asks unit 1 for seven input registers: two voltages, a temperature, a mode, one of no map."""
    chunks, t_ns = [], 0
    for volt in volts:
        words = [*registers_of(struct.pack(">f", volt)), *registers_of(struct.pack(">f", 230.5)), 650, 3, 77]
        answer = bytes([1, 4, 14]) + b"".join(word.to_bytes(2, "big") for word in words)
        for adu in (_adu(bytes.fromhex("010400000007")), _adu(answer)):
            chunks.append(Chunk(t_ns, adu))
            t_ns += 50_000_000
    return CaptureSource(Capture.of(LineSettings(19200), chunks, timed=True), "meter")


def _bus(volts: list[float]) -> Bus:
    source = _capture(volts)
    bus = Bus.of(source)
    for analysed in source.steps(bool):
        bus.feed(analysed)
    bus.close()
    return bus


def _charts(units: object) -> Mapping[int, RegisterMap]:  # noqa: ARG001
    return {1: METER}


def _meanings(bus: Bus, types: dict[tuple[int, int, int], str] | None = None) -> Meanings:
    return Meanings(bus, lambda: types or {}, lambda: _charts)


def test_a_poll_says_what_its_registers_mean_and_what_they_were() -> None:
    bus = _bus([401.5, 401.75])
    carried = poll_values(bus, [2])[0]
    told = [(each.name, each.text, each.before, each.changed) for each in _meanings(bus).readings(carried)]
    assert told == [
        ("Voltage L1", "401.75 V", "401.5 V", True),
        ("Voltage L2", "230.5 V", "230.5 V", False),
        ("Temperature", "25 °C", "25 °C", False),
        ("Mode", "boost", "boost", False),
        ("30007", "77", "77", False),
    ]


def test_the_users_word_overrules_the_map_and_keeps_its_name() -> None:
    bus = _bus([401.5])
    meanings = _meanings(bus, {(1, 2, 0): "u32 ABCD"})
    first = next(meanings.readings(poll_values(bus, [0])[0]))
    assert (first.name, first.meaning.source, first.text) == ("Voltage L1", "yours", "1137229824")
    assert [row.type for row in meanings.charts[1].rows if row.name == "Voltage L1"] == ["u32"]


def test_a_value_that_a_poll_holds_but_in_part_is_shown_as_registers() -> None:
    bus = _bus([401.5])
    meanings = _meanings(bus, {(1, 2, 6): "f32 ABCD"})
    assert [each.text for each in meanings.readings(poll_values(bus, [0])[0])][-1] == "77"


@pytest.mark.parametrize("text", ["401.75", "25", "Temperature", "voltage l2"])
def test_values_are_found_by_number_and_by_name(text: str) -> None:
    bus = _bus([401.5, 401.75])
    hit = find(bus, wanted(text, _meanings(bus).charts).hits, -1)
    assert hit == (3 if text == "401.75" else 1)


@given(words=st.lists(st.integers(0, 0xFFFF), min_size=4, max_size=4))
def test_a_choice_reads_registers_as_the_interpretations_of_a_paste_do(words: list[int]) -> None:
    for choice in CHOICES:
        own = words[: choice.words]
        same = [each for each in readings(own) if each.kind == choice.kind and each.order == choice.order]
        assert choice.text(own) == same[0].text


def test_fewer_registers_than_a_value_takes_are_no_value() -> None:
    meaning = Meaning("f32", "ABCD", 2)
    assert meaning.text([1]) == "-" and meaning.number([1]) is None


async def _sitting(work: object, view: str) -> None:
    async with seat(_capture([401.5, 401.75, 401.75]), view=view, size=(120, 40)) as sitting:
        sitting.app.desk.charts = _charts
        sitting.app.desk.meanings.reworded()
        sitting.screen.reworded()
        await work(sitting)  # type: ignore[operator]


def test_named_values_stand_in_lists_fields_changes_and_filters() -> None:
    async def work(sitting: Seat) -> None:
        shown = sitting.shown()
        assert "Voltage L1 401.5 V" in shown and "Temperature 25 °C" in shown and "Mode boost" in shown
        await sitting.press("down")
        assert "Voltage L1*401.75 V" in sitting.shown()
        assert "30001 Voltage L1 401.75 V, was 401.5 V" in " ".join(sitting.shown().split())
        await sitting.press("x")
        assert "17352" in sitting.shown() and "Voltage L1 " not in sitting.shown().split("frame 3")[0]
        await sitting.press("x", "d")
        assert "Voltage L1 401.5→401.75 V" in sitting.shown()
        await sitting.press("d", "2")
        assert "7 registers: Voltage L1" in sitting.shown().replace("*", " ").replace("  ", " ")

    asyncio.run(_sitting(work, "transactions"))


def test_a_value_is_found_shown_and_filtered_by_name() -> None:
    async def work(sitting: Seat) -> None:
        await sitting.press("f")
        await sitting.type("401.75")
        await sitting.press("enter")
        assert sitting.row == 3
        item = sitting.screen.detail.fields.item
        assert item is not None and item.text.startswith("401.75 V")
        await sitting.press("tab", "=", "v")
        assert sitting.screen.query_one(FilterBar).text == 'unit == 1 and value("Voltage L1") == 401.75'
        await sitting.until(lambda: sitting.screen.transactions.count() == 2)
        await sitting.press("4")
        assert "Voltage L1" in sitting.shown() and "401.75 V" in sitting.shown(), "of the rows that are left"
        await sitting.press("escape", "5", "home", "=", "v")
        assert sitting.screen.query_one(FilterBar).text == 'unit == 1 and value("Voltage L1") == 401.75'
        assert sitting.screen.query_one(RegisterList).register is not None

    asyncio.run(_sitting(work, "transactions"))


def _heard(sitting: Seat, words: str) -> bool:
    return any(words in notice for notice in sitting.notices())


def test_values_are_plotted_and_exported_by_name(tmp_path: Path) -> None:
    async def work(sitting: Seat) -> None:
        await sitting.until(lambda: "Voltage L1" in sitting.screen.query_one(Plot).title)
        for view in "54":
            out = tmp_path / f"{view}.csv"
            await sitting.press(view, "e", "ctrl+u")
            await sitting.type(str(out))
            await sitting.press("enter")
            await sitting.until(partial(_heard, sitting, out.name))
            lines = out.read_text(encoding="utf-8").splitlines()
            named = [line for line in lines if "Voltage L1" in line]
            assert sum("Voltage L2,230.5" in line for line in lines) == 3, "no guess takes a register of the map's"
            assert len(named) == 3 and "401.75" in named[-1] and any("boost" in line for line in lines)

    asyncio.run(_sitting(work, "registers"))
