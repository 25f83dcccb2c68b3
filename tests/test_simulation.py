"""The simulated bus: what it promises to those who test against it."""

from __future__ import annotations

import itertools
import json
import subprocess
import sys
from array import array
from collections import Counter
from pathlib import Path
from random import Random
from typing import Any

import pytest

import captures
from analyzer.simulation import TAPS, WIRES, Scenario, Simulation, simulate, write
from analyzer.simulation.conversation import hostile
from analyzer.simulation.taps import USUAL_BAUDS
from dissectors.crc import crc_bytes

ROOT = Path(__file__).resolve().parents[1]
SHARED = ROOT.parent / "shared" / "corpus" / "simulated"
NOISY_WIRES = ("noisy", "glitch", "brutal")


def _stream(made: Simulation) -> bytes:
    return b"".join(chunk.data for chunk in made.chunks)


def _made(wire: str, tap: str = "precise", **other: Any) -> Simulation:
    return simulate(Scenario(wire, tap, **other))


@pytest.mark.parametrize(("wire", "tap"), list(itertools.product(WIRES, TAPS)))
def test_every_wire_through_every_tap(wire: str, tap: str) -> None:
    made = _made(wire, tap, transactions=60, seed=3)
    requests = [frame for frame in made.truth if frame.pair is None]
    assert len(requests) == 60
    assert made.line.tap == tap
    assert made.line.baud in USUAL_BAUDS
    assert all(chunk.data for chunk in made.chunks)
    times = [chunk.t_ns for chunk in made.chunks]
    assert times == sorted(times)
    assert len(_stream(made)) >= sum(frame.length for frame in made.truth)


@pytest.mark.parametrize("wire", WIRES)
def test_truth_fits_the_bytes(wire: str) -> None:
    made = _made(wire, seed=11)
    stream, end = _stream(made), 0
    for number, frame in enumerate(made.truth):
        assert frame.id == number
        assert frame.start >= end, "frames overlap"
        end = frame.start + frame.length
        seen = stream[frame.start : end]
        assert frame.adu[-2:] == crc_bytes(frame.adu[:-2])
        assert (seen == frame.adu) == frame.intact
        assert frame.length == {"drop": len(frame.adu) - 1, "trunc": len(seen)}.get(frame.fault or "", len(frame.adu))
    assert end <= len(stream)
    if wire not in NOISY_WIRES:
        assert sum(frame.length for frame in made.truth) == len(stream), "frames do not tile the stream"


@pytest.mark.parametrize("wire", WIRES)
def test_responses_answer_their_requests(wire: str) -> None:
    made = _made(wire, seed=5)
    answered = set()
    for frame in made.truth:
        if frame.pair is None:
            assert frame.direction == "request"
            continue
        request = made.truth[frame.pair]
        assert frame.direction == "response"
        assert (request.direction, request.unit, request.function) == ("request", frame.unit, frame.function)
        assert request.intact, "a damaged request was answered"
        assert request.unit != 0, "a broadcast was answered"
        assert request.id not in answered
        answered.add(request.id)
        if frame.function in (3, 4) and not frame.adu[1] & 0x80:
            assert frame.adu[2] == 2 * int.from_bytes(request.adu[4:6], "big")


def test_the_same_seed_gives_the_same_capture() -> None:
    scenario = Scenario("brutal", "irq", transactions=80, seed=42)
    assert simulate(scenario) == simulate(scenario)


@pytest.mark.parametrize("other", [{"seed": 43}, {"units": 1}])
def test_another_scenario_gives_another_capture(other: dict[str, int]) -> None:
    made = _made("brutal", "irq", transactions=80, seed=42)
    assert _stream(made) != _stream(_made("brutal", "irq", transactions=80, **{"seed": 42, **other}))


def test_what_a_scenario_fixes() -> None:
    made = _made("clean", "ftdi16", baud=4800, units=1, char_bits=10)
    assert (made.line.baud, made.line.char_bits) == (4800, 10)
    assert len({frame.unit for frame in made.truth}) == 1


@pytest.mark.parametrize(
    ("wire", "fault", "low", "high"),
    [
        ("clean", "flip", 0, 0),
        ("noisy", "flip", 0.008, 0.03),
        ("noisy", "drop", 0.01, 0.035),
        ("noisy", "trunc", 0.003, 0.02),
        ("noisy", "collide", 0.003, 0.02),
        ("brutal", "flip", 0.035, 0.08),
        ("brutal", "drop", 0.035, 0.08),
        ("brutal", "trunc", 0.012, 0.04),
        ("brutal", "collide", 0.012, 0.04),
    ],
)
def test_share_of_faults(wire: str, fault: str, low: float, high: float) -> None:
    truth = _made(wire, "untimed", transactions=2000, seed=1).truth
    assert low <= sum(frame.fault == fault for frame in truth) / len(truth) <= high


@pytest.mark.parametrize(
    ("wire", "low", "high"),
    [("clean", 0, 0), ("hard", 0, 0), ("noisy", 0.08, 0.2), ("glitch", 0.8, 1.2), ("brutal", 0.6, 1.2)],
)
def test_noise_bytes_a_frame(wire: str, low: float, high: float) -> None:
    made = _made(wire, "untimed", transactions=1500, seed=2)
    noise = len(_stream(made)) - sum(frame.length for frame in made.truth)
    assert low <= noise / len(made.truth) <= high


def test_what_else_a_wire_does() -> None:
    functions = {wire: Counter(frame.function for frame in _made(wire, "untimed").truth) for wire in WIRES}
    assert 40 < functions["vendor"][0x41] < 180
    assert functions["brutal"][0x41]
    assert not functions["clean"][0x41]
    truth = _made("broadcast", "untimed").truth
    assert 3 <= sum(frame.unit == 0 for frame in truth) <= 40
    late = [frame for frame in _made("brutal", "untimed").truth if frame.pair is not None and frame.pair < frame.id - 1]
    assert 2 <= len(late) <= 30


def test_gaps_of_a_clean_line() -> None:
    made = _made("clean", baud=19200, seed=9)
    character = 11 / 19200 * 1e9
    starts = {frame.start for frame in made.truth}
    times = [chunk.t_ns for chunk in made.chunks]
    for i in range(1, len(times)):
        gap = times[i] - times[i - 1]
        if i in starts:
            assert gap > 4.4 * character
        else:
            assert abs(gap - character) < 2


def test_slow_servers_leave_holes_inside_frames() -> None:
    made = _made("slow-slave", baud=9600, seed=4)
    character = 11 / 9600 * 1e9
    starts = {frame.start for frame in made.truth}
    times = [chunk.t_ns for chunk in made.chunks]
    holes = [times[i] - times[i - 1] - character for i in range(1, len(times)) if i not in starts]
    holes = [hole for hole in holes if hole > 10]
    assert len(holes) > 50
    assert 1.6 * character - 10 <= min(holes)
    assert max(holes) <= 25e6 + 10


def test_sizes_of_chunks() -> None:
    sizes = {tap: [len(chunk.data) for chunk in _made("hard", tap, seed=6).chunks] for tap in TAPS}
    assert set(sizes["precise"]) == {1}
    assert max(sizes["irq"]) == 8
    assert max(sizes["ftdi16"]) <= 62
    assert set(sizes["gateway"][:-1]) <= {1, 3, 8, 20, 64, 200}
    assert len(sizes["untimed"]) == 1


def test_taps_deliver_late_but_not_early() -> None:
    exact = _made("brutal", "precise", seed=8, baud=19200)
    for tap, latest in (("irq", 0.4e6 + 4 * 11 / 19200 * 1e9), ("ftdi16", 17e6)):
        deliver = TAPS[tap].deliver
        times = array("d", [chunk.t_ns for chunk in exact.chunks])
        at = 0
        for chunk in deliver(_stream(exact), times, Random(1), 11 / 19200 * 1e9):
            at += len(chunk.data)
            assert 0 <= chunk.t_ns - times[at - 1] <= latest + 2


def test_hostile_payloads_fool_a_prefix_scan() -> None:
    random = Random(0)
    answer = bytes((3, 40)) + bytes(40)
    fooled = nested = 0
    for _ in range(400):
        pdu = hostile(random, 17, answer, [17, 21])
        assert len(pdu) == len(answer)
        assert pdu[:2] == answer[:2]
        frame = bytes((17,)) + pdu
        fooled += any(crc_bytes(frame[:k]) == frame[k : k + 2] for k in range(3, len(frame) - 1))
        nested += any(
            frame[k] in (17, 21) and crc_bytes(frame[k : k + 6]) == frame[k + 6 : k + 8]
            for k in range(3, len(frame) - 7)
        )
    assert 150 < fooled < 260
    assert 150 < nested < 260


def test_the_tables_are_there_without_numpy() -> None:
    code = "import sys; from analyzer.simulation import TAPS, WIRES, Scenario; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False, cwd=ROOT).returncode == 0


def test_files_are_read_back(tmp_path: Path) -> None:
    scenario = Scenario("noisy", "irq", transactions=50, seed=1)
    write(scenario, tmp_path / "bus.jsonl")
    made = simulate(scenario)
    capture = captures.open(tmp_path / "bus.jsonl")
    assert list(capture.chunks()) == made.chunks
    assert capture.line == made.line
    lines = [json.loads(line) for line in (tmp_path / "bus.truth.jsonl").read_text().splitlines()]
    assert lines == [frame.to_json() for frame in made.truth]


@pytest.mark.parametrize(
    ("scenario", "word"),
    [
        (Scenario("wet", "irq"), "wet"),
        (Scenario("clean", "ear"), "ear"),
        (Scenario("clean", "irq", transactions=0), "transactions"),
        (Scenario("clean", "irq", baud=0), "baud"),
        (Scenario("clean", "irq", char_bits=3), "bits"),
        (Scenario("clean", "irq", units=0), "units"),
        (Scenario("clean", "irq", units=40), "units"),
    ],
)
def test_impossible_scenarios_are_refused_in_one_line(scenario: Scenario, word: str) -> None:
    with pytest.raises(ValueError, match=word) as caught:
        simulate(scenario)
    assert "\n" not in str(caught.value)


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared corpus is not here")
def test_truth_lines_have_the_form_of_the_corpus() -> None:
    theirs = {tuple(json.loads(line)) for line in (SHARED / "brutal-precise.truth.jsonl").read_text().splitlines()}
    ours = {tuple(frame.to_json()) for frame in _made("brutal").truth}
    assert ours == theirs


@pytest.mark.skipif(not SHARED.is_dir(), reason="the shared corpus is not here")
@pytest.mark.parametrize("name", ["clean-precise", "noisy-precise", "glitch-irq", "brutal-irq", "vendor-irq"])
def test_statistics_are_those_of_the_corpus(name: str) -> None:
    lines = (SHARED / f"{name}.truth.jsonl").read_text().splitlines()
    header, *chunks = ((SHARED / f"{name}.jsonl").read_text()).splitlines()
    theirs = [json.loads(line) for line in lines]
    wire, tap = name.split("-")
    runs = [_made(wire, tap, seed=seed, baud=json.loads(header)["baud"]) for seed in range(6)]

    def near(value: float, ours: list[float], share: float, slack: float) -> bool:
        mean = sum(ours) / len(ours)
        return abs(value - mean) <= share * mean + slack

    assert near(len(theirs), [len(run.truth) for run in runs], 0.04, 0)
    assert near(
        sum(not frame["intact"] for frame in theirs), [sum(not f.intact for f in r.truth) for r in runs], 0.3, 6
    )
    assert near(len(chunks), [len(run.chunks) for run in runs], 0.3, 0)
    span = json.loads(chunks[-1])["t_ns"]
    assert near(span, [run.chunks[-1].t_ns for run in runs], 0.25, 0)
