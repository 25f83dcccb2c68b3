"""`rtuscope document`: what rows carry is described, in the client's order, and nothing else."""

from __future__ import annotations

import json
import struct
from collections.abc import Sequence
from pathlib import Path
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from running import ran

import captures
from analyzer.registers.readings import RegisterReadings
from analyzer.registers.roles import OtherReading, RegisterValue, is_bits
from analyzer.reports.description import describe
from analyzer.reports.description.rounds import bus_round
from analyzer.reports.description.sequence import AskedPoll, PollFrames, PollSequence
from analyzer.reports.description.shown import Shown
from dissectors.crc import crc_bytes

_CHARACTER_NS = 572_917  # 19200 8E1
_IDENTITY = (b"ACME", b"PM-7", b"v1.2")


def _frame(*body: int) -> bytes:
    return bytes(body) + crc_bytes(bytes(body))


class Line:
    """A capture that is being written, exchange by exchange."""

    def __init__(self) -> None:
        self.t_ns = 1_700_000_000_000_000_000
        self.lines = [json.dumps({"format": "serial-chunks", "version": 1, "baud": 19200, "char_bits": 11})]

    def exchange(self, request: bytes, answer: bytes) -> None:
        for data, pause_ns in ((request, 8_000_000), (answer, 5_000_000)):
            if data:
                self.t_ns += pause_ns + len(data) * _CHARACTER_NS
                self.lines.append(json.dumps({"t_ns": self.t_ns, "hex": data.hex()}))
        self.t_ns += 0 if answer else 300_000_000

    def write(self, path: Path) -> Path:
        path.write_text("\n".join(self.lines) + "\n")
        return path


def bus(path: Path) -> Path:
    """Unit 5: a float and a temperature; unit 9: a setpoint that is written, a constant, a refusal; unit 30: silent."""
    line, random, energy, temperature, setpoint = Line(), Random(4), 1000.0, 200, 100
    for number in range(120):
        energy, temperature = energy + 3 * random.random(), temperature + random.randint(-2, 2)
        if number == 0:
            objects = b"".join(bytes((n, len(text))) + text for n, text in enumerate(_IDENTITY))
            line.exchange(_frame(5, 43, 14, 1, 0), _frame(5, 43, 14, 1, 1, 0, 0, 3, *objects))
        line.exchange(_frame(5, 3, 0, 100, 0, 2), _frame(5, 3, 4, *struct.pack(">f", energy)))
        line.exchange(_frame(5, 4, 0, 10, 0, 1), _frame(5, 4, 2, *temperature.to_bytes(2)))
        line.exchange(_frame(9, 3, 1, 0, 0, 2), _frame(9, 3, 4, *setpoint.to_bytes(2), 0, 7))
        if number % 4 == 2:
            line.exchange(_frame(9, 3, 2, 0, 0, 1), _frame(9, 0x83, 2))
        if number in (7, 50, 111):
            setpoint += 10
            line.exchange(_frame(9, 6, 1, 0, *setpoint.to_bytes(2)), _frame(9, 6, 1, 0, *setpoint.to_bytes(2)))
        if number % 10 == 5:
            line.exchange(_frame(30, 3, 0, 0, 0, 1), b"")
        line.t_ns += 400_000_000
    return line.write(path)


@pytest.fixture(scope="module")
def described(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    path = bus(tmp_path_factory.mktemp("bus") / "bus.jsonl")
    return describe(captures.open(str(path)), source=str(path)).to_json()


def test_the_round_is_in_its_order_with_period_and_slots(described: dict[str, Any]) -> None:
    turn = described["round"]
    slots = [(s["unit"], s["function"], s["address"], s["quantity"], s["every"]) for s in turn["slots"]]
    assert slots == [(5, 3, 100, 2, 1), (5, 4, 10, 1, 1), (9, 3, 256, 2, 1), (9, 3, 512, 1, 4), (30, 3, 0, 1, 10)]
    assert turn["slots"][0]["offset_ns"] == 0 and 450_000_000 < turn["period_ns"] < 480_000_000
    assert 20_000_000 < turn["slots"][1]["offset_ns"] < 30_000_000
    besides = {(s["unit"], s["function"]) for s in described["others"]}
    assert besides == {(5, 43), (9, 6)}


def test_units_say_what_they_are_and_in_which_frame(described: dict[str, Any]) -> None:
    units = {unit["unit"]: unit for unit in described["units"]}
    assert [said["text"].split(": ")[1] for said in units[5]["says"]] == ["ACME", "PM-7", "v1.2"]
    assert {said["frame"] for said in units[5]["says"]} == {1}
    assert not units[30]["answered"] and units[30]["registers"] == [] and units[30]["recognised"] is None
    (refusal,) = units[9]["exceptions"]
    assert (refusal["function"], refusal["exception"], refusal["count"]) == (3, 2, 30)


def test_registers_have_what_their_values_carry_and_no_more(described: dict[str, Any]) -> None:
    registers = {
        (unit["unit"], each["area"], each["address"]): each for unit in described["units"] for each in unit["registers"]
    }
    energy, still = registers[5, "holding", 100], registers[9, "holding", 257]
    assert (energy["type"], energy["order"], energy["words"]) == ("f32", "ABCD", 2)
    assert 1000 < energy["min"] < energy["max"] < 1400 and energy["name"] is None
    assert still["type"] is None and still["role"] is None and still["last"] == 7
    written = registers[9, "holding", 256]
    assert (written["written_by"], written["writes"]) == ([6], 3) and written["written_in"] is not None
    assert energy["writes"] == 0 and energy["written_in"] is None
    assert any("30" in sentence for sentence in described["not_known"])


def test_a_number_beside_a_zero_is_told_whatever_its_width(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line, random, count = Line(), Random(7), 4000
    for _ in range(60):
        count += random.randint(0, 9)
        line.exchange(_frame(5, 3, 0, 20, 0, 2), _frame(5, 3, 4, 0, 0, *count.to_bytes(2)))
        line.t_ns += 400_000_000
    path = line.write(tmp_path / "bus.jsonl")
    told = json.loads(ran(capsys, "document", str(path), "--json").out)
    known = [each for each in told["units"][0]["registers"] if each["type"]]
    assert [(each["min"] >= 4000, each["max"]) for each in known] == [(True, count)]
    widths = {(known[0]["address"], known[0]["words"])}
    widths |= {(other["address"], other["words"]) for other in known[0]["same_number"]}
    assert widths == {(20, 2), (21, 1)}
    assert known[0]["confidence"] < known[0]["number_confidence"] >= 0.9
    for language, words in (("en", "or the same number as u"), ("ru", "или то же число как u")):
        assert words in ran(capsys, "document", str(path), "--lang", language).out


def test_a_word_that_was_no_zero_or_may_be_a_sign_leaves_no_same_number(tmp_path: Path) -> None:
    line, random = Line(), Random(7)
    for _ in range(60):
        low, signed = 4000 + random.randint(0, 99), random.randint(-9, 9) & 0xFFFF
        line.exchange(_frame(5, 3, 0, 20, 0, 2), _frame(5, 3, 4, 0, 3, *low.to_bytes(2)))
        line.exchange(_frame(5, 3, 0, 40, 0, 2), _frame(5, 3, 4, 0, 0, *signed.to_bytes(2)))
    registers = describe(captures.open(str(line.write(tmp_path / "bus.jsonl")))).units[0].registers
    assert {each.value.address for each in registers} >= {40}
    assert not any(each.value.same_number for each in registers)


def test_a_number_beside_a_constant_is_one_of_two(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line, random, count = Line(), Random(7), 20_000
    for _ in range(60):
        count += random.randint(-9, 9)
        line.exchange(_frame(5, 3, 0, 20, 0, 2), _frame(5, 3, 4, 0, 3, *count.to_bytes(2)))
        line.t_ns += 400_000_000
    path = line.write(tmp_path / "bus.jsonl")
    told = json.loads(ran(capsys, "document", str(path), "--json").out)
    (either,) = (each["either"] for each in told["units"][0]["registers"] if each["either"])
    assert {(each["address"], each["words"]) for each in either} == {(20, 2), (21, 1)}
    assert sum(each["confidence"] for each in either) >= 0.97
    assert all(each["type"] is None for each in told["units"][0]["registers"])
    for language, words in (("en", "u32 ABCD or u16 21"), ("ru", "u32 ABCD или u16 21")):
        page = ran(capsys, "document", str(path), "--lang", language).out
        (row,) = (line for line in page.splitlines() if " or u" in line or " или u" in line)
        cells = [cell.strip() for cell in row.strip("| ").split(" | ")]
        assert all(cells[3:6]) and cells[7].rstrip(" %") == f"{either[0]['confidence']:.0%}"[:-1], row
        assert words in page or words.replace("u32 ABCD", "u16").replace("u16 21", "u32 ABCD 20-21") in page


def test_a_manual_that_is_wrong_is_contradicted_with_frames(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = bus(tmp_path / "bus.jsonl")
    manual = tmp_path / "manual.csv"
    manual.write_text(
        "area,address,name,type,order,min,max\nholding,100,Energy,f32,ABCD,0,50\ninput,10,Temperature,u16,,0,400\n"
    )
    told = json.loads(ran(capsys, "document", str(path), "--map", f"{manual}@5", "--json").out)
    assert [(each["address"], each["name"]) for each in told["contradictions"]] == [(100, "Energy")]
    frames = told["contradictions"][0]["frames"]
    exported = ran(capsys, "export", str(path), "--format", "jsonl", "-o", "-").out.splitlines()
    hexes = {line["index"]: line["hex"] for line in map(json.loads, exported)}
    assert frames and all(hexes[frame].startswith("050304") for frame in frames)
    names = {each["address"]: each["name"] for unit in told["units"] for each in unit["registers"]}
    assert names[10] == "Temperature" and names[100] is None  # a name that the bus contradicts is nobody's


def test_the_pages_are_made_in_both_languages(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = bus(tmp_path / "a|b.jsonl")
    page, out = ran(capsys, "document", str(path)).out, tmp_path / "bus.html"
    assert "## the poll round" in page and "f32 ABCD" in page and r"a\|b.jsonl" in page
    assert ran(capsys, "document", str(path), "--lang", "ru", "--html", str(out)).status == 0
    text = out.read_text(encoding="utf-8")
    assert "цикл опроса" in text and "ACME" in text and "<script" not in text


def _sequence(polls: list[int]) -> PollSequence:
    made = PollSequence()
    for at, number in enumerate(polls):
        poll = AskedPoll(number, 3, 0, 1)
        made.polls.setdefault(poll, PollFrames(at)).count += 1
        made.order.append(poll)
        made.times.append(at * 1_000_000)
    return made


@given(st.lists(st.integers(1, 9), min_size=1, max_size=12, unique=True), st.integers(0, 11))
@settings(max_examples=40, deadline=None)
def test_any_round_is_found_wherever_the_capture_begins(turn: list[int], begin: int) -> None:
    polls = (turn * 8)[begin % len(turn) :]
    found = bus_round(_sequence(polls), timed=True)
    assert found is not None and found.period_ns == len(turn) * 1_000_000
    units = [slot.poll.unit for slot in found.slots]
    first = turn.index(units[0])
    assert units == turn[first:] + turn[:first]


@pytest.mark.parametrize("seed", range(8))
def test_a_client_without_an_order_is_given_none(seed: int) -> None:
    random = Random(seed)
    assert bus_round(_sequence([random.randint(1, 6) for _ in range(400)]), timed=True) is None
    assert bus_round(_sequence([]), timed=True) is None


def _shown(
    rows: Sequence[tuple[int, ...]], at: int, words: int, confidence: float, runner_up: int | None = None
) -> bool:
    """Whether an int at a register of a block from 0 on is shown; `runner_up`: where a pair begins that it may be."""
    readings = RegisterReadings()
    readings.put(5, "holding", 0, np.array(rows, np.uint16), np.arange(len(rows)))
    value = RegisterValue(
        unit=5, area="holding", address=at, words=words, kind="int", signed=False, order="ABCD" if words > 1 else None,
        role=None, confidence=confidence, bits=5.0, why="", readings=len(rows), changes=9, minimum=0, maximum=9, last=9,
        runner_up=None if runner_up is None else OtherReading(runner_up, 2, "int", "ABCD", 0.04),
    )  # fmt: skip
    return Shown(readings)(value)


def test_a_register_that_moved_only_as_its_neighbour_fell_to_zero_has_no_type() -> None:
    off = [(25_329, 800 + n) for n in range(40)] + [(0, 0)]
    assert not _shown(off, 0, 1, 0.999)
    assert _shown([(25_330, 801), *off], 0, 1, 0.999)


def test_a_float_that_only_began_with_all_around_it_has_no_type() -> None:
    begun = [(0, 0, 0)] * 20 + [(0x4120, 0x1234, 0x5678)] * 20
    assert not _shown(begun, 0, 2, 0.9999)
    assert _shown([*begun, (0x4121, 0x1234, 0x5678)], 0, 2, 0.9999)


def test_a_register_that_hardly_moved_and_never_alone_may_be_a_high_word() -> None:
    beside = [(5 + (n > 10) + (n > 30), 10_000 + 7 * n) for n in range(40)]
    assert not _shown(beside, 0, 1, 0.99) and not _shown(beside, 1, 1, 0.99)
    assert _shown(beside, 0, 1, 0.999) and _shown([*beside, (8, beside[-1][1])], 0, 1, 0.99)


def test_a_high_word_that_moves_alone_makes_no_pair() -> None:
    states = [(n % 3, 65_535) for n in range(40)]
    assert not _shown(states, 0, 2, 0.99)
    assert _shown([(n >> 2, n << 14 & 0xFFFF) for n in range(40)], 0, 2, 0.99)


def test_a_neighbour_that_stood_still_asks_for_more_confidence() -> None:
    beside = [(10_000 + n * n % 97, 3, 7 + n) for n in range(40)]
    assert not _shown(beside, 0, 1, 0.98, runner_up=0) and _shown(beside, 0, 1, 0.992, runner_up=0)
    assert _shown(beside, 0, 1, 0.95)
    assert not _shown([(3, low) for low, _, _ in beside], 0, 2, 0.95)
    assert _shown([(0, low) for low, _, _ in beside], 0, 2, 0.95)


def test_flags_set_by_themselves_are_bits_and_numbered_states_are_none() -> None:
    def series(states: list[int]) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
        return np.repeat(np.array(states * 3, np.uint64), 5)

    assert is_bits(series([0, 2, 18, 16]))
    assert not is_bits(series([0, 1, 3, 2])) and not is_bits(series([0, 2, 16, 4]))
