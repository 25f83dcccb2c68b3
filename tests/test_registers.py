"""What registers mean: inference, its laws, finding by value, checking maps, recognition, and the commands."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from running import ran, refused

import analyzer
from analyzer.core import deframe
from analyzer.registers.checking import check_map
from analyzer.registers.drafting import drafted_map, map_differences
from analyzer.registers.inference import infer
from analyzer.registers.like import matches_of_series, matches_of_value
from analyzer.registers.panel import read_panel
from analyzer.registers.readings import RegisterReadings
from analyzer.registers.recognition import UnitTexts, recognised
from analyzer.registers.roles import RegisterValue
from analyzer.simulation import Scenario, simulate, write
from analyzer.simulation.conversation import adu
from dissectors.maps import RegisterMap, shipped_map
from dissectors.maps.model import MappedValue

POLLS = 60


def words_of(values: list[float] | np.ndarray, form: str) -> np.ndarray:
    """Registers, a row a value, most significant word first."""
    return np.asarray(values).astype(form).view(">u2").reshape(len(values), -1).astype(np.uint16)


def readings_of(*columns: np.ndarray, unit: int = 1, area: str = "input", address: int = 100) -> RegisterReadings:
    readings = RegisterReadings()
    readings.put(unit, area, address, np.concatenate(columns, axis=1))  # type: ignore[arg-type]
    return readings


def walk(seed: int, level: float, step: float, count: int = POLLS) -> np.ndarray:
    return level + np.cumsum(np.random.default_rng(seed).normal(0, step, count))


def found_at(values: list[RegisterValue], address: int) -> RegisterValue:
    return next(value for value in values if value.address == address)


def made(tmp_path: Path, *maps: str, transactions: int = 400, seed: int = 5) -> Path:
    path = tmp_path / "bus.jsonl"
    write(Scenario("clean", "precise", transactions=transactions, seed=seed, maps=maps), path)
    return path


def readings_in(path: Path) -> RegisterReadings:
    readings = RegisterReadings()
    for batch in analyzer.open(path).batches():
        readings.feed(batch)
    return readings


def test_floats_integers_and_counters_are_told() -> None:
    floats = [words_of(walk(n, 230 + n, 0.3), ">f4") for n in range(3)]
    wide = [words_of(walk(n + 9, 3e6, 4e4), ">u4") for n in range(2)]
    small = [words_of(walk(n + 20, 4000, 30), ">u2") for n in range(2)]
    values = infer(readings_of(*floats, *wide, *small))
    assert [(v.address, v.words, v.kind, v.order) for v in values] == [
        (100, 2, "float", "ABCD"), (102, 2, "float", "ABCD"), (104, 2, "float", "ABCD"),
        (106, 2, "int", "ABCD"), (108, 2, "int", "ABCD"), (110, 1, "int", None), (111, 1, "int", None),
    ]  # fmt: skip
    assert all(v.confidence > 0.9 for v in values)
    first = values[0]
    assert first.minimum == pytest.approx(walk(0, 230, 0.3).min(), rel=1e-6)
    assert (first.readings, first.changes) == (POLLS, POLLS - 1)


def test_low_word_first_and_negative_numbers() -> None:
    floats = [words_of(walk(n, 50, 0.1), ">f4")[:, ::-1] for n in range(3)]
    below = words_of(walk(4, 0, 6), ">i2")
    values = infer(readings_of(*floats, below))
    assert [v.order for v in values] == ["CDAB"] * 3 + [None]
    assert values[-1].signed and values[-1].minimum == int(words_of(walk(4, 0, 6), ">i2").view(np.int16).min())


@pytest.mark.parametrize(("reverse", "order"), [(False, "BADC"), (True, "DCBA")])
def test_floats_of_which_the_bytes_are_swapped(reverse: bool, order: str) -> None:
    floats = [words_of(walk(n, 230 + 40 * n, 0.3), ">f4").byteswap() for n in range(6)]
    columns = [column[:, ::-1] if reverse else column for column in floats]
    columns.append(words_of(walk(7, 4000, 30), ">u2").byteswap())
    values = infer(readings_of(*columns))
    assert [(v.address, v.words, v.kind, v.order) for v in values] == [
        *((address, 2, "float", order) for address in range(100, 112, 2)), (112, 1, "int", None)
    ]  # fmt: skip
    assert values[0].minimum == pytest.approx(walk(0, 230, 0.3).min(), rel=1e-5)
    assert "swapped" in values[0].why


def test_what_cannot_be_told_is_two_readings() -> None:
    columns = [np.zeros((POLLS, 1), np.uint16), words_of(walk(1, 3000, 20), ">u2"), words_of(walk(2, 900, 9), ">u2")]
    value = next(v for v in infer(readings_of(*columns)) if v.changes and v.address <= 101)
    assert value.runner_up is not None
    assert {value.words, value.runner_up.words} == {1, 2}
    assert value.confidence + value.runner_up.confidence == pytest.approx(1, abs=0.25)


def test_what_never_moved_is_not_named() -> None:
    text = words_of(np.frombuffer(b"MADE UP DEVICE 7".ljust(16) * POLLS, ">u2").reshape(POLLS, 8).ravel(), ">u2")
    still = np.tile(np.array([[0, 0xFFFF, 417]], np.uint16), (POLLS, 1))
    values = infer(readings_of(text.reshape(POLLS, 8), still))
    assert (values[0].kind, values[0].words, values[0].last) == ("text", 8, "MADE UP DEVICE 7")
    assert [v.kind for v in values[1:]] == ["unknown", "unknown", "constant"]
    assert all(v.changes == 0 for v in values)


def test_bits_states_and_clocks() -> None:
    random = np.random.default_rng(3)
    flags = np.cumsum(random.random(200) < 0.1) % 2 * 0x0800 | 1
    states = np.repeat([1, 4, 1, 7, 1], 8).tolist() * 5
    clock = 1.7e9 + np.arange(200)
    readings = RegisterReadings()
    columns = [words_of(flags, ">u2"), words_of(states, ">u2"), words_of(clock, ">u4")]
    table = np.concatenate(columns, axis=1)
    readings.put(1, "holding", 10, table, np.arange(200, dtype=np.int64) * 1_000_000_000)
    values = {v.address: v for v in infer(readings)}
    assert values[10].kind == "bits"
    assert values[11].kind == "enum"
    assert values[12].kind == "time" and values[12].words == 2


def test_live_and_file_say_the_same(tmp_path: Path) -> None:
    path = made(tmp_path, "eastron-sdm630@1", "solax-x1-hybrid@7")
    whole = [v.to_json() for v in infer(readings_in(path))]
    batches = list(deframe(analyzer.open(path).capture))
    piecewise = RegisterReadings()
    for batch in batches:
        piecewise.feed(batch)
        len(piecewise)  # sorts what waits, as a view in between does
    assert [v.to_json() for v in infer(piecewise)] == whole


@pytest.mark.parametrize("cuts", [[1] * 700, [700], [64, 1, 300, 335]])
def test_memory_is_bounded_and_its_content_hangs_on_the_count_alone(cuts: list[int]) -> None:
    rows = np.arange(1400, dtype=np.uint16).reshape(700, 2)
    readings, at = RegisterReadings(), 0
    for size in cuts:
        readings.put(1, "input", 0, rows[at : at + size])
        at += size
    (block,) = readings
    words, beginning = block.series
    assert (block.count, len(words), beginning) == (700, 128, 64)
    assert words[:64].tolist() == rows[:64].tolist()
    assert block.apart.tolist() == rows[:: block.stride].tolist()
    assert len(block.apart) <= 128
    assert (int(block.least[0]), int(block.greatest[1])) == (0, 1399)


def test_a_map_decides_and_names() -> None:
    floats = [words_of(walk(n, 230 + n, 0.3), ">f4") for n in range(2)]
    chart = RegisterMap(
        "x",
        (MappedValue("input", 100, "Odd", "u16", scale=0.1, unit="V"), MappedValue("input", 102, "U", "f32", length=2)),
    )
    values = infer(readings_of(*floats), charts={1: chart})
    assert [(v.address, v.words, v.name) for v in values] == [(100, 1, "Odd"), (101, 1, None), (102, 2, "U")]
    assert (values[0].scale, values[0].unit_of_measure, values[0].confidence) == (0.1, "V", 1.0)


def test_a_register_is_found_by_its_value_and_by_a_table() -> None:
    volts = np.round(walk(1, 230, 0.4), 1)
    readings = RegisterReadings(1 << 14)
    other = words_of(walk(8, 500, 9), ">u2")
    table = np.concatenate([other, words_of(np.round(volts * 10), ">u2")], axis=1)
    readings.put(1, "input", 40, table, np.arange(POLLS, dtype=np.int64) * 1_000_000_000)
    values = infer(readings)
    best = matches_of_value(readings, f"{volts[30]:.1f}", values)[0]
    assert (best.address, best.words, best.scale) == (41, 1, 0.1)
    lines = "\n".join(f"{n + 3},{volts[n]}" for n in range(5, 55))
    best = matches_of_series(readings, read_panel(f"time,value\n{lines}\n", "panel.csv"), values)[0]
    assert (best.address, best.scale) == (41, 0.1)
    assert best.lag_s == pytest.approx(-3, abs=1)


CONTRADICTIONS: dict[str, tuple[str, int, dict[str, Any]]] = {
    "order": ("input", 102, {"order": "CDAB"}),
    "type": ("input", 104, {"type": "u32"}),
    "sign": ("input", 110, {"type": "u16"}),
    "range": ("input", 111, {"maximum": 30.0}),
    "states": ("input", 112, {"values": {0: "off"}}),
}


@pytest.mark.parametrize("wrong", CONTRADICTIONS)
def test_contradictions_of_a_map_are_found_and_none_in_a_right_one(wrong: str) -> None:
    floats = [words_of(walk(n, 230 + n, 0.3), ">f4") for n in range(3)]
    wide = [words_of(walk(n + 9, 3e6, 4e4), ">u4") for n in range(2)]
    below, level = words_of(walk(4, 0, 6), ">i2"), words_of(walk(5, 400, 3), ">u2")
    states = words_of(np.random.default_rng(1).choice([0, 3], POLLS), ">u2")
    readings = readings_of(*floats, *wide, below, level, states)
    rows = [MappedValue("input", 100 + 2 * n, f"F{n}", "f32", length=2) for n in range(3)]
    rows += [MappedValue("input", 106 + 2 * n, f"W{n}", "u32", length=2) for n in range(2)]
    rows += [
        MappedValue("input", 110, "Power", "s16"),
        MappedValue("input", 111, "Level", "u16", scale=0.1, minimum=0.0, maximum=100.0),
        MappedValue("input", 112, "State", "enum", values={0: "off", 3: "on"}),
    ]
    assert not check_map(readings, {1: RegisterMap("right", tuple(rows))})
    area, address, change = CONTRADICTIONS[wrong]
    spoilt = [replace(row, **change) if row.address == address else row for row in rows]
    remarks = check_map(readings, {1: RegisterMap("wrong", tuple(spoilt))})
    assert [(r.kind, r.area, r.address) for r in remarks] == [("contradiction", area, address)]


def test_a_device_that_says_its_name_is_recognised(tmp_path: Path) -> None:
    texts = UnitTexts()
    path = tmp_path / "x.txt"
    request, body = adu(5, bytes((17,))), b"EL PSU Control (c) 2010 Elim Ltd."
    path.write_text(f"{request.hex(' ')}\n{adu(5, bytes((17, len(body))) + body).hex(' ')}\n" * 3)
    for batch in analyzer.open(path).batches():
        texts.feed(batch)
    (found,) = recognised(RegisterReadings(), texts, [])
    assert (found.unit, found.name) == (5, "el-psu") and found.confidence > 0.95


def test_a_meter_is_recognised_by_what_it_answers(tmp_path: Path) -> None:
    readings = readings_in(made(tmp_path, "eastron-sdm630@3", transactions=300))
    (found,) = recognised(readings, UnitTexts(), infer(readings))
    assert (found.unit, found.name) == (3, "eastron-sdm630")


def test_nothing_is_recognised_in_noise() -> None:
    random = np.random.default_rng(0)
    readings = readings_of(random.integers(0, 65536, (POLLS, 30)).astype(np.uint16), address=7000)
    assert recognised(readings, UnitTexts(), infer(readings)) == []


def test_maps_out_of_traffic_and_their_differences() -> None:
    readings = readings_of(*[words_of(walk(n, 230, 0.3), ">f4") for n in range(2)])
    chart = drafted_map(infer(readings), "unit 1", "a capture")
    assert [(row.address, row.type) for row in chart.rows] == [(100, "f32"), (102, "f32")]
    assert list(map_differences(chart, chart)) == []
    other = replace(chart, rows=(replace(chart.rows[0], scale=0.1),))
    lines = list(map_differences(chart, other))
    assert len(lines) == 2 and "scale" in lines[0] and lines[1].startswith("- input 102")


def test_the_simulator_writes_what_the_registers_mean(tmp_path: Path) -> None:
    path = made(tmp_path, "xy-md02@9", transactions=40)
    truth = [json.loads(line) for line in path.with_suffix(".registers.jsonl").read_text(encoding="utf-8").splitlines()]
    assert {(t["unit"], t["area"], t["address"], t["kind"]) for t in truth} <= {
        (9, area, row.address, "int") for area in ("input", "holding") for row in shipped_map("xy-md02").rows
    }
    once, twice = (simulate(Scenario("clean", "irq", seed=2, maps=("abb-b23",))) for _ in range(2))
    assert once == twice
    with pytest.raises(ValueError, match="no such file"):
        simulate(Scenario("clean", "irq", maps=("nothing.csv",)))


def test_values_are_right_on_a_simulated_device(tmp_path: Path) -> None:
    """The score's floor; `benchmarks/score_registers.py` has the figures."""
    path = made(tmp_path, "janitza-umg96rm@1", "growatt-string@2", transactions=600, seed=8)
    truth = {
        (t["unit"], t["area"], t["address"]): t
        for t in map(json.loads, path.with_suffix(".registers.jsonl").read_text(encoding="utf-8").splitlines())
    }
    moved = [v for v in infer(readings_in(path)) if v.changes and (v.unit, v.area, v.address) in truth]
    right = [
        v for v in moved if (t := truth[v.unit, v.area, v.address]) and (t["words"], t["order"]) == (v.words, v.order)
    ]
    assert len(moved) > 40
    assert len(right) / len(moved) > 0.9


def test_the_command_speaks_json(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = made(tmp_path, "eastron-sdm120@1", transactions=200)
    done = ran(capsys, "registers", str(path), "--json", "--map", "eastron-sdm120@1")
    assert done.status == 0, done.err
    lines = [json.loads(line) for line in done.out.splitlines()]
    keys = {"unit", "area", "address", "words", "kind", "signed", "order", "role", "confidence", "bits", "why",
            "readings", "changes", "min", "max", "last", "name", "scale", "unit_of_measure"}  # fmt: skip
    assert all(keys <= set(line) for line in lines)
    assert any(line["name"] == "Voltage" and line["unit_of_measure"] == "V" for line in lines)
    voltage = next(line for line in lines if line["name"] == "Voltage")
    shown = ran(capsys, "registers", str(path), "--like", f"{voltage['last']:.4f}")
    assert shown.status == 0 and f"input {voltage['address']}: f32" in shown.out


def test_the_map_commands(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = made(tmp_path, "xy-md02@4", transactions=200)
    assert "eastron-sdm630" in ran(capsys, "map", "list").out
    assert "Temperature" in ran(capsys, "map", "show", "xy-md02").out
    checked = ran(capsys, "map", "check", "xy-md02", str(path))
    assert checked.status == 0 and "0 contradictions in unit 4" in checked.out
    drafted = tmp_path / "mine.csv"
    assert ran(capsys, "map", "infer", str(path), "-o", str(drafted)).status == 0
    assert ran(capsys, "map", "check", str(drafted)).status == 0
    assert ran(capsys, "map", "diff", "xy-md02", "xy-md02").out == "no differences\n"
    for wrong in (("check", "none.csv"), ("import", "none.csv"), ("infer", "none.jsonl"), ("show", "none")):
        assert refused(capsys, "map", *wrong)


def test_the_table_is_none_where_nothing_moved_and_no_text_widens_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    still, texts = tmp_path / "still.txt", tmp_path / "texts.txt"
    request, answer = adu(7, b"\x03\x00\x10\x00\x02"), adu(7, b"\x03\x04\x00\x05\x00\x06")
    still.write_text("\n".join([request.hex(" "), answer.hex(" ")] * 6))
    shown = ran(capsys, "registers", str(still), "--map", "xy-md02@9")
    assert shown.out == "2 registers never moved (--all lists them)\n"
    assert "has no values for unit 9: units with values: 7" in shown.err
    request, answer = adu(7, b"\x03\x00\x10\x00\x40"), adu(7, b"\x03\x80" + b"Long name " * 12 + b"No 12345")
    texts.write_text("\n".join([request.hex(" "), answer.hex(" ")] * 6))
    assert max(map(len, ran(capsys, "registers", str(texts)).out.splitlines())) < 140
    assert "Long name " * 12 in ran(capsys, "registers", str(texts), "--json").out


WRONG = [
    (("registers", "BUS", "--unit", "99"), "has no values for it: units with values"),
    (("registers", "BUS", "--unit", "x"), "'x' is not a unit address (0 to 255)"),
    (("registers", "BUS", "--like", ""), "--like: expected a number, or a table"),
    (("registers", "BUS", "--like", "nosuch.csv"), "neither a number nor a table"),
    (("registers", "BUS", "--map", "nosuch"), "no such file and no shipped map"),
    (("registers", "BUS", "--map", "el-psu@300"), "unit 300"),
    (("map",), "choose an action: list, show, check, import, infer, diff"),
    (("map", "show", "nosuch"), "map list"),
    (("map", "show", "BUS"), "not a table: expected a row of column names"),
    (("map", "check", "xy-md02", "BUS", "--unit", "9"), "no response from unit 9"),
    (("map", "import", "BUS"), "not a known register map"),
    (("map", "import", "nosuch.csv"), "no such file"),
    (("map", "infer", "BUS", "--unit", "77"), "no response from unit 77"),
    (("map", "infer", "BUS", "-o", "map.txt"), "a map must be a .csv or .yaml file"),
    (("map", "diff", "xy-md02", "nosuch"), "map list"),
]


@pytest.mark.parametrize(("words", "said"), WRONG)
def test_wrong_arguments_are_one_line(
    words: tuple[str, ...], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bus = str(made(tmp_path, "xy-md02@7", transactions=40))
    error = refused(capsys, *(bus if word == "BUS" else word for word in words))
    assert said in error and len(error.strip().splitlines()) == 1


def test_equal_maps_have_no_differences(capsys: pytest.CaptureFixture[str]) -> None:
    assert ran(capsys, "map", "diff", "xy-md02", "xy-md02").out == "no differences\n"
    assert "server_id: EL PSU Control" in ran(capsys, "map", "diff", "xy-md02", "el-psu").out


def test_series_are_of_many_kinds() -> None:
    from analyzer.simulation.mapped.device import MappedDevice, decoded, encoded

    random = Random(4)
    device = MappedDevice(1, shipped_map("abb-b23"), 1e6, 1.0, random)
    for row in device.chart.rows:
        if row.type not in ("text",):
            words = encoded(row, 12.0 * row.scale)
            assert len(words) == row.length
            assert decoded(row, words) == pytest.approx(12.0 * row.scale)


def test_pasted_frames_by_a_map(capsys: pytest.CaptureFixture[str]) -> None:
    pasted = ["01", "04", "00", "00", "00", "02", "71", "CB", "01", "04", "04", "43", "66", "33", "34", "1B", "38"]
    assert "Voltage L1  230.2 V" in ran(capsys, "parse", "--map", "eastron-sdm630", *pasted).out
    lines = [
        json.loads(line)
        for line in ran(capsys, "parse", "--json", "--map", "eastron-sdm630@1", *pasted).out.splitlines()
    ]
    (value,) = lines[1]["mapped"]
    assert (value["name"], value["unit_of_measure"], value["value"]) == ("Voltage L1", "V", pytest.approx(230.2))
    assert lines[0]["mapped"] == [] and lines[1]["values"] == [0x4366, 0x3334]


@pytest.mark.parametrize(
    ("frame", "value"),
    [
        ("01 06 00 0E 00 01 29 C9", "Standby  on  (holding 14)"),
        ("01 05 00 01 FF 00 DD FA", "Output 1  on  (coil 1)"),
        ("01 05 00 01 00 00 9C 0A", "Output 1  off  (coil 1)"),
    ],
)
def test_a_single_write_by_a_map(frame: str, value: str, capsys: pytest.CaptureFixture[str]) -> None:
    chart = "nl-16di" if "coil" in value else "el-psu"
    assert value in ran(capsys, "parse", "--map", chart, frame).out


def test_both_devices_of_the_manuals_are_shown_whole(capsys: pytest.CaptureFixture[str]) -> None:
    words = [5, 2, 0, 1, 1023, 1, 0x3F84, 0xD9A8, 0x3F80, 0, 0, 0, 0x3F80, 0, 1, 550, 150]
    answer = bytes((3, 2 * len(words))) + b"".join(word.to_bytes(2, "big") for word in words)
    frames = adu(1, bytes((3, 0, 0, 0, len(words)))) + adu(1, answer)
    shown = ran(capsys, "parse", "--map", "el-psu", frames.hex()).out
    for text in (
        "Baud rate       19200",
        "Supply type     55.0 V 15.0 A",
        "Voltage limit   55 V",
        "Standby         on",
    ):
        assert text in shown
    frames = adu(2, bytes((2, 0, 0, 0, 16))) + adu(2, bytes((2, 2, 0x81, 0x00)))
    shown = ran(capsys, "parse", "--map", "nl-16di", frames.hex()).out
    assert "Input 0   on" in shown and "Input 15  off" in shown


def test_the_table_of_values_with_a_map(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, out = made(tmp_path, "xy-md02@4", transactions=60), tmp_path / "values.jsonl"
    assert ran(capsys, "export", path, "--table", "values", "--map", "xy-md02@4", "-o", out).status == 0
    rows = [json.loads(line) for line in out.read_text(encoding="utf-8").splitlines()]
    warm = [row for row in rows if row["name"] == "Temperature"]
    assert warm and all(row["unit_of_measure"] == "°C" for row in warm)
    signed = [(row["raw"] ^ 0x8000) - 0x8000 for row in warm]
    assert [row["value"] for row in warm] == pytest.approx([number * 0.1 for number in signed])
    assert [row["t_ns"] for row in rows] == sorted(row["t_ns"] for row in rows)


def test_powers_and_sums_are_said() -> None:
    volts, amperes = walk(1, 230, 0.6), np.abs(walk(2, 12, 0.8))
    phases = [walk(n, 900, 25) for n in range(3, 6)]
    columns = [words_of(x, ">f4") for x in (volts, amperes, volts * amperes * 0.9, *phases, sum(phases))]
    values = infer(readings_of(*columns))
    why = {v.address: v.why for v in values}
    assert "goes as r100 x r102" in why[104]
    assert "the sum of r106, r108, r110" in why[112]
    assert {v.address: v.related for v in values if v.related} == {104: (100, 102), 112: (106, 108, 110)}
    assert "sum" not in why[100] and "goes as" not in why[102]
