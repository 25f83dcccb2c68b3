"""Devices with maps: what a wrong map contradicts is found where it stands, a right one left alone.

Values out of the limits of their map are told; what the values of healthy devices do is no cause of anything.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
import pytest

import analyzer
from analyzer.registers.checking import check_map, limit_breaches
from analyzer.registers.readings import RegisterReadings
from analyzer.simulation import Scenario, write
from analyzer.simulation.mapped.client import MappedClient
from dissectors.maps import RegisterMap, shipped_map, shipped_names
from dissectors.maps.model import MapArea, MappedValue

NAMES = ("eastron-sdm630", "abb-b23", "huawei-sun2000", "janitza-umg96rm", "siemens-pac3200", "carlo-gavazzi-em340")
# values of which the high word stands still, and a float that begins at nothing: neither contradicts anything
QUIET = ("socomec-countis", "tuf-2000m")
OTHER = {"ABCD": "CDAB", "CDAB": "ABCD"}


@cache
def readings_of(name: str, polls: int = 60, seed: str = "") -> RegisterReadings:
    """A device of this map, whose values are as their names say."""
    client = MappedClient(Random(f"check {name}{seed}"), [(1, shipped_map(name))], 0.0)
    rows: dict[tuple[MapArea, int, int], list[list[int]]] = {(p.area, p.address, p.quantity): [] for p in client.polls}
    for _ in range(polls):
        client.devices[0].step()
        for block, read in rows.items():
            read.append(client.devices[0].read(*block))
    readings = RegisterReadings()
    for (area, address, _), read in rows.items():
        readings.put(1, area, address, np.array(read, np.uint16))
    return readings


def words_of(row: MappedValue, readings: RegisterReadings) -> np.ndarray | None:
    for block in readings:
        if block.area == row.area and block.address <= row.address and row.end <= block.address + block.quantity:
            return block.series[0][:, row.address - block.address : row.end - block.address]
    return None


def plants(name: str) -> Iterator[tuple[str, MappedValue, MappedValue]]:
    """A row of the map and what a wrong map would have of it: of each kind the first that the readings can show."""
    readings, kinds = readings_of(name), set()
    for row in shipped_map(name).rows:
        words = words_of(row, readings)
        if words is None or row.area not in ("input", "holding") or row.type in ("text", "enum", "bits", "time"):
            continue
        lively = (words[1:] != words[:-1]).all(axis=1).mean() > 0.5
        wrong: dict[str, MappedValue] = {}
        if row.length == 2 and lively:
            wrong["order"] = replace(row, order=OTHER[row.order])
            wrong["type"] = replace(row, type="s32" if row.is_float else "f32")
        if row.length == 1 and len(np.unique(words)) > 3:
            wrong["states"] = replace(row, type="enum", values={1: "a", 40000: "b"})
            wrong["limit"] = replace(
                row, minimum=None, maximum=(int(words.max()) + 5e4) * -abs(row.scale) - abs(row.offset)
            )
        for kind, value in wrong.items():
            if kind not in kinds:
                kinds.add(kind)
                yield kind, row, value


@pytest.mark.parametrize("name", NAMES + QUIET)
def test_a_right_map_is_not_contradicted(name: str) -> None:
    remarks = check_map(readings_of(name), {1: shipped_map(name)})
    assert not [remark for remark in remarks if remark.kind == "contradiction"]


@pytest.mark.parametrize(("name", "seed"), [("el-psu", " 4"), ("nl-16di", " 2")])
def test_a_device_that_lacks_a_value_holds_nothing_that_its_map_forbids(name: str, seed: str) -> None:
    """Zero is no mark of what is not there where a unit's address begins at 1, or a speed has no state of it."""
    remarks = check_map(readings_of(name, seed=seed), {1: shipped_map(name)})
    assert not [remark for remark in remarks if remark.kind == "contradiction"]


@pytest.mark.parametrize("name", NAMES)
def test_planted_contradictions_are_found_where_they_stand(name: str) -> None:
    chart, readings = shipped_map(name), readings_of(name)
    found = list(plants(name))
    assert found
    for kind, row, wrong in found:
        spoilt: RegisterMap = replace(chart, rows=tuple(wrong if one is row else one for one in chart.rows))
        told = [r for r in check_map(readings, {1: spoilt}) if r.kind == "contradiction"]
        assert {(r.area, r.address) for r in told} == {(row.area, row.address)}, (kind, row.name, told)


def test_a_high_word_that_is_zero_all_the_time_contradicts_no_wide_integer() -> None:
    readings, random = RegisterReadings(), Random(5)
    power = [620 + random.randrange(-9, 10) for _ in range(200)]
    volts = [2300 + random.randrange(-30, 31) for _ in range(200)]
    readings.put(1, "holding", 298, np.array([[0, p, v] for p, v in zip(power, volts, strict=True)], np.uint16))
    rows = (MappedValue("holding", 298, "Power", "s32", length=2), MappedValue("holding", 300, "Voltage", "u16"))
    assert not check_map(readings, {1: RegisterMap("meter", rows)})
    turned = replace(rows[0], order="CDAB")
    assert [remark.kind for remark in check_map(readings, {1: RegisterMap("meter", (turned, rows[1]))})] == [
        "contradiction"
    ]


def test_a_wide_counter_that_begins_again_contradicts_no_map() -> None:
    name = "solax-x1-hybrid"  # whose third device has one
    remarks = check_map(readings_of(name, seed=" 2"), {1: shipped_map(name)})
    assert not [remark for remark in remarks if remark.kind == "contradiction"]


def test_a_full_counter_that_begins_again_is_not_below_zero() -> None:
    row = MappedValue("input", 10, "Energy today", "u16")
    full = [0xFFFF] * 20 + list(range(20))
    to_and_fro = [0xFFFF, 0, 1, 0, 0xFFFF, 0xFFFF, 0, 1] * 5
    for words, contradictions in ((full, 0), (full[::-1], 0), (to_and_fro, 1)):
        readings = RegisterReadings()
        readings.put(1, "input", 10, np.array(words, np.uint16)[:, None])
        remarks = check_map(readings, {1: RegisterMap("meter", (row,))})
        assert len([remark for remark in remarks if remark.kind == "contradiction"]) == contradictions, words


@pytest.mark.parametrize("order", ["ABCD", "CDAB"])
@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("s32", (0x8000, 0)),
        ("s32", (0x7FFF, 0xFFFF)),
        ("u32", (0xFFFF, 0xFFFF)),
        ("f32", (0x7FC0, 0)),
        ("s16", (0x7FFF,)),
    ],
)
def test_what_a_device_lacks_contradicts_no_map(kind: str, words: tuple[int, ...], order: str) -> None:
    row = MappedValue("input", 10, "Level", kind, order, len(words), minimum=-50, maximum=50)
    stored = words if order == "ABCD" else words[::-1]
    readings = RegisterReadings()
    readings.put(1, "input", 10, np.tile(np.array(stored, np.uint16), (40, 1)))
    assert not [r for r in check_map(readings, {1: RegisterMap("made up", (row,))}) if r.kind == "contradiction"]
    readings = RegisterReadings()
    readings.put(1, "input", 10, np.tile(np.array(stored, np.uint16) ^ 0x0100, (40, 1)))
    assert [r for r in check_map(readings, {1: RegisterMap("made up", (row,))}) if r.kind == "contradiction"]


@pytest.mark.parametrize(("maximum", "said"), [(200.0, "greatest value 200"), (500.0, None)])
def test_numbers_out_of_a_maps_limits(maximum: float, said: str | None) -> None:
    volts = (230 + np.arange(120) % 7).astype(">f4").view(">u2").reshape(-1, 2).astype(np.uint16)
    readings = RegisterReadings()
    readings.put(1, "input", 100, volts, np.arange(120, dtype=np.int64) * 1_000_000_000)
    row = MappedValue("input", 100, "Voltage", "f32", length=2, unit="V", maximum=maximum)
    found = limit_breaches(readings, {1: RegisterMap("x", (row,))})
    assert [breach.unit for breach in found] == ([1] if said else [])
    assert not said or ("Voltage" in found[0].text and said in found[0].text)


SHIPPED = shipped_names()


@pytest.mark.parametrize("first", range(0, len(SHIPPED), 9))
def test_no_healthy_device_is_accused(first: int, tmp_path: Path) -> None:
    maps = tuple(f"{name}@{unit}" for unit, name in enumerate(SHIPPED[first : first + 3], 1))
    path = tmp_path / "bus.jsonl"
    write(Scenario("clean", "precise", transactions=700, seed=first, maps=maps), path)
    assert [cause.text for cause in analyzer.open(path).causes()] == [], maps


@pytest.mark.parametrize(("low", "contradicted"), [(range(28_000, 28_060), True), ([0xFFFF] * 60, False)])
def test_no_number_is_absent_in_one_way_only(low, contradicted):
    readings = RegisterReadings()
    words = np.array([[0xFFFF, word, number % 7] for number, word in enumerate(low)], np.uint16)
    readings.put(1, "holding", 40, words)
    chart = RegisterMap("a manual", (MappedValue("holding", 40, "Power", "f32", order="ABCD", length=2),))
    texts = [remark.text for remark in check_map(readings, {1: chart}) if remark.kind == "contradiction"]
    assert any("no number in 60 ways" in text for text in texts) == contradicted == bool(texts)
