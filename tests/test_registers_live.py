"""Types told while a bus is heard: early, revised as evidence grows, overruled by the user, the same as from a file."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from running import ran

import analyzer
import captures
from analyzer.core import Analyzer
from analyzer.model.registers import AREA_WORDS
from analyzer.registers.inference import infer
from analyzer.registers.readings import RegisterReadings, is_due
from analyzer.registers.watch import RevisedRegisters, Revision
from analyzer.simulation import Scenario, write
from analyzer.usernotes import Notes


@pytest.fixture(scope="module")
def bus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bus") / "bus.jsonl"
    write(Scenario("clean", "precise", transactions=500, seed=2, maps=("eastron-sdm630@1",)), path)
    return path


def heard(registers: RevisedRegisters, bus: Path) -> list[Revision]:
    """All revisions, the bus fed read by read."""
    capture = captures.open(bus)
    core, found = Analyzer(capture.line), []
    for block in capture.blocks(64):
        for analysed in core.feed(block):
            found += registers.feed(analysed.batch)
    for analysed in core.close():
        found += registers.feed(analysed.batch)
    return found


def test_types_are_told_early_and_end_as_those_of_the_file(bus: Path) -> None:
    registers, readings = RevisedRegisters(), RegisterReadings()
    found = heard(registers, bus)
    assert found and found[0].before is None and "f32 ABCD" in found[0].text and "%" in found[0].text
    assert all(one.value.changes or one.value.kind == "text" for one in found)  # of what never moved nothing is sure
    for batch in analyzer.open(bus).batches():
        readings.feed(batch)
    registers.revise()
    assert [v.to_json() for v in registers.values] == [v.to_json() for v in infer(readings)]
    assert registers.charts[1].rows


def test_it_is_asked_ever_more_rarely() -> None:
    asked, times = 0, 0
    for frames in range(0, 100_000, 16):
        if is_due(asked, frames):
            asked, times = frames, times + 1
    assert times < 25


def test_the_users_word_overrules_and_teaches(bus: Path) -> None:
    registers = RevisedRegisters()
    heard(registers, bus)
    value = next(v for v in registers.values if v.kind == "float" and v.changes)
    place = (value.unit, value.area, value.address)
    registers.say_type(place, "u32 CDAB")
    own = next(v for v in registers.values if (v.unit, v.area, v.address) == place)
    assert (own.type, own.order, own.why, own.confidence) == ("u32", "CDAB", "as you said", 1.0)
    assert own.name is None
    registers.say_type(place, "")
    assert next(v for v in registers.values if (v.unit, v.area, v.address) == place).type == "f32"


def test_the_word_that_is_kept_beside_a_capture_is_heeded(
    bus: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    copy = tmp_path / "mine.jsonl"
    copy.write_bytes(bus.read_bytes())
    lines = [json.loads(line) for line in ran(capsys, "registers", copy, "--json").out.splitlines()]
    value = next(line for line in lines if line["kind"] == "float" and line["changes"])
    Notes.beside(copy).choose_type((1, AREA_WORDS.index(value["area"]), value["address"]), "u32 CDAB")
    lines = [json.loads(line) for line in ran(capsys, "registers", copy, "--json").out.splitlines()]
    own = next(line for line in lines if (line["area"], line["address"]) == (value["area"], value["address"]))
    assert (own["kind"], own["order"], own["why"]) == ("int", "CDAB", "as you said")


def test_replay_tells_what_registers_mean(bus: Path, capsys: pytest.CaptureFixture[str]) -> None:
    shown = ran(capsys, "replay", bus, "--speed", "max", "--infer").out
    assert " = unit 1 input " in shown and "f32 ABCD" in shown
    lines = [
        json.loads(line) for line in ran(capsys, "replay", bus, "--speed", "max", "--infer", "--json").out.splitlines()
    ]
    told = [line["register"] for line in lines if line.get("kind") == "register"]
    assert told and {"unit", "address", "order", "confidence", "why"} <= set(told[0])
