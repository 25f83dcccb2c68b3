"""The map commands as a user goes through them: a map out of a capture, checked against it, beside the true one."""

from __future__ import annotations

import json
import struct
from pathlib import Path

import pytest
from buses import adu
from running import ran, refused

from analyzer.cli.commands import NO_FRAME
from analyzer.simulation import Scenario, write
from analyzer.simulation.conversation import adu as frame_of
from dissectors.maps import map_text, read_map, shipped_map
from dissectors.maps.model import RegisterMap

DEVICES = ("eastron-sdm630", "huawei-sun2000", "abb-b23", "carlo-gavazzi-em340")


@pytest.fixture(params=DEVICES)
def device(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def bus(tmp_path: Path, device: str) -> Path:
    path = tmp_path / "bus.jsonl"
    write(Scenario("clean", "precise", transactions=700, seed=11, maps=(f"{device}@5",)), path)
    return path


@pytest.fixture
def inferred(bus: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    path = bus.with_name("inferred.csv")
    done = ran(capsys, "map", "infer", bus, "-o", path)
    assert (done.status, done.err) == (0, "")
    assert done.out == f"{path}: {len(read_map(path).rows)} values\n"
    return path


def test_an_inferred_map_agrees_with_its_capture(bus: Path, inferred: Path, capsys: pytest.CaptureFixture[str]) -> None:
    done = ran(capsys, "map", "check", inferred, bus)
    assert (done.status, done.err) == (0, "")
    *remarks, summary = done.out.splitlines()
    assert summary == "0 contradictions in unit 5"
    assert {remark.partition(":")[0] for remark in remarks} <= {"unmapped"}
    zeros = [remark for remark in remarks if remark.endswith(": always 0")]
    assert len(zeros) >= len(remarks) / 2  # what a draft leaves out says nothing


def test_an_inferred_map_names_the_values_of_its_capture(
    bus: Path, inferred: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    row = next(row for row in read_map(inferred).rows if row.name.startswith("measurement"))
    done = ran(capsys, "report", bus, "--map", f"{inferred}@5")
    assert done.status == 0, done.err
    assert row.name in done.out


@pytest.mark.usefixtures("bus")
def test_the_differences_from_the_true_map_are_facts(
    device: str, inferred: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    done = ran(capsys, "map", "diff", inferred, device)
    assert (done.status, done.err) == (0, "")
    changed = [line for line in done.out.splitlines() if line.startswith("* ")]
    made_up = ("confidence", "description", " name ", " scale ", " unit ")
    assert not [line for line in changed if any(word in line for word in made_up)]
    drafted = {(row.area, row.address): row for row in read_map(inferred).rows if row.other["confidence"] > "0.9"}
    drafted = {place: row for place, row in drafted.items() if row.name.split()[0] in ("measurement", "counter")}
    true = {(row.area, row.address): row for row in shipped_map(device).rows}
    both = [(drafted[place], true[place]) for place in drafted.keys() & true.keys()]
    right = [(row, truth) for row, truth in both if (row.length, row.is_float) == (truth.length, truth.is_float)]
    assert both
    assert len(right) >= 0.9 * len(both)
    for row, truth in right:  # a sign is beyond what values tell that were never below zero
        said = [line for line in changed if line.startswith(f"* {row.area} {row.address} ")]
        assert said == (
            []
            if row.type == truth.type
            else [f"* {row.area} {row.address} {truth.name}: type {row.type!r} -> {truth.type!r}"]
        )


def test_a_map_with_the_other_word_order_is_contradicted(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bus, wrong = tmp_path / "bus.jsonl", tmp_path / "wrong.csv"
    write(Scenario("clean", "precise", transactions=700, seed=3, maps=("eastron-sdm630@5",)), bus)
    right = shipped_map("eastron-sdm630")
    text = map_text(right, "x.csv").replace("word_order: ABCD", "word_order: CDAB")
    wrong.write_text(text, encoding="utf-8")
    assert ran(capsys, "map", "check", "eastron-sdm630", bus).out.splitlines()[-1] == "0 contradictions in unit 5"
    done = ran(capsys, "map", "check", wrong, bus)
    assert done.status == 1
    remarks = done.out.splitlines()
    assert sum(line.startswith("contradiction: unit 5 input ") for line in remarks) > 20
    assert remarks[-1] == f"{sum(line.startswith('contradiction: ') for line in remarks)} contradictions in unit 5"
    assert ran(capsys, "map", "diff", "eastron-sdm630", wrong).out.splitlines()[0] == "word_order: 'ABCD' -> 'CDAB'"


def test_two_inferred_maps_differ_in_what_a_user_wrote(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    head = "area,address,name,type,scale,unit,description,confidence\n"
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    one.write_text(
        f"{head}input,0,measurement r0,u16,,,moves by itself,0.91\ninput,1,measurement r1,u16,,,moves,0.99\n"
    )
    other.write_text(f"{head}input,0,Voltage,u16,0.1,V,moves by itself,0.97\ninput,1,measurement r1,s16,,,still,0.62\n")
    assert ran(capsys, "map", "diff", one, other).out.splitlines() == [
        "* input 0 Voltage: name 'measurement r0' -> 'Voltage', scale '' -> '0.1', unit '' -> 'V'",
        "* input 1 measurement r1: type 'u16' -> 's16'",
    ]
    assert ran(capsys, "map", "diff", one, one).out == "no differences\n"


def test_what_cannot_be_inferred_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    bus = tmp_path / "bus.jsonl"
    write(Scenario("clean", "precise", transactions=60, seed=1, maps=("xy-md02@1", "xy-md02@2")), bus)
    out = tmp_path / "out.csv"
    assert "units with values: 1, 2" in refused(capsys, "map", "infer", bus, "-o", out)
    assert "units with values: 1, 2" in refused(capsys, "map", "infer", bus, "-o", out, "--unit", "9")
    assert "a map must be a .csv or .yaml file" in refused(capsys, "map", "infer", bus, "-o", tmp_path / "x.xlsx")
    assert not out.exists()


def test_unmapped_registers_that_hold_something_are_told_from_zeros() -> None:
    import numpy as np

    from analyzer.registers.checking import check_map
    from analyzer.registers.readings import RegisterReadings

    readings = RegisterReadings()
    readings.put(1, "input", 10, np.array([[0, 0, 0], [0, 0, 0]], np.uint16))
    readings.put(1, "input", 20, np.array([[0, 0], [0, 7]], np.uint16))
    remarks = check_map(readings, {1: RegisterMap("empty", ())})
    assert [(one.address, one.words, one.text) for one in remarks] == [
        (10, 3, "asked for, but not in the map: always 0"),
        (20, 2, "asked for, but not in the map"),
    ]


def test_a_log_is_read_as_the_other_commands_read_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "log.txt"
    polls = [("0103000a0001", f"010302{value:04x}") for value in (230, 231, 229, 230)]
    log.write_text(
        "".join(
            f"10:00:0{at} Tx: {adu(asked).hex(' ')}\n10:00:0{at} Rx: {adu(told).hex(' ')}\n"
            for at, (asked, told) in enumerate(polls)
        )
    )
    listed = ran(capsys, "registers", log, "--json")
    assert [json.loads(line)["address"] for line in listed.out.splitlines()] == [10]
    inferred = tmp_path / "inferred.csv"
    assert ran(capsys, "map", "infer", log, "-o", inferred, "--baud", "9600").status == 0
    (row,) = read_map(inferred).rows
    assert (row.address, row.area) == (10, "holding")
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("area,address,name,type,min,max\nholding,10,Pump,u16,0,3\n")
    done = ran(capsys, "map", "check", wrong, log)
    assert (done.status, done.out.splitlines()[-1]) == (1, "1 contradiction in unit 1")


def test_a_capture_without_values_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    log = tmp_path / "log.txt"
    log.write_text(f"Tx: {adu('0103000a0001').hex(' ')}\nRx: {adu('018302').hex(' ')}\n")
    for words in (("check", "xy-md02", log), ("infer", log)):
        done = ran(capsys, "map", *words)
        assert (done.status, done.out) == (NO_FRAME, "")
        assert done.err == f"rtuscope: {log}: no response carries register values\n"


def test_requests_that_the_device_does_not_take_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    requests = (
        (3, 0, 16, b""), (3, 0, 18, b""), (6, 8, 0x3F80, b""), (6, 4, 2000, b""), (6, 3, 5, b""), (1, 0, 8, b""),
        (16, 8, 2, bytes.fromhex("043f800000")),
    )  # fmt: skip
    asked = [
        frame_of(1, struct.pack(">BHH", function, address, last) + rest) for function, address, last, rest in requests
    ]
    answers = {3: b"\x03\x20" + bytes(32), 6: None, 1: b"\x81\x01", 16: struct.pack(">BHH", 16, 8, 2)}
    log = tmp_path / "bus.txt"
    lines = []
    for number, ((function, *_), request) in enumerate(zip(requests, asked, strict=True)):
        answer = answers[function]
        lines.append(f"10:00:{number:02d}.000 TX {request.hex(' ')}")
        lines.append(f"10:00:{number:02d}.050 RX {(frame_of(1, answer) if answer else request).hex(' ')}")
    log.write_text("\n".join(lines) + "\n")
    told = [line for line in ran(capsys, "map", "check", "el-psu", log).out.splitlines() if line.startswith("request")]
    assert [line.split(": ", 2)[2] for line in told] == [
        "function 01 was asked for, the map has only 03, 04, 06, 16, 17",
        "an exchange of 41 bytes, the device takes 40",
        "5 was asked for, a state without a name",
        "2000 was asked for, its greatest value is 1023",
        "written by function 06, the device takes only 16",
        "1 of its 2 registers were written alone",
    ]


def test_values_that_read_the_same_registers_alike_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "own.csv"
    path.write_text("area,address,name,type,scale\nholding,0,A,u16,1\nholding,0,B,u16,1\nholding,0,C,u16,0.1\n")
    assert "overlap: holding 0: both 'A' and 'B'" in ran(capsys, "map", "check", path).out.splitlines()


def test_the_table_of_a_maker_is_sent_to_the_import(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "maker.csv"
    path.write_text("name;address;type\nA;0;u16\nB;1;u16\n")
    assert "`rtuscope map import`" in refused(capsys, "map", "show", path)
    assert ran(capsys, "map", "import", path, "-o", tmp_path / "own.csv").status == 0
    own = (tmp_path / "own.csv").read_text().replace("u16", "u61", 1)
    (tmp_path / "own.csv").write_text(own)
    assert "map import" not in refused(capsys, "map", "show", tmp_path / "own.csv")
