"""The same seed gives the same bus, whatever goes wrong on it, whoever taps it and however fast it is; and a cause is
simulated so that the report names it."""

from __future__ import annotations

import json
from itertools import groupby, islice
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import captures
from analyzer.cli import main
from analyzer.simulation import TAPS, Scenario, Simulation, TruthFrame, simulate
from analyzer.simulation.bus import played_bus
from analyzer.simulation.causes import case_of, cases_by_cause, other_cases, write_cause
from analyzer.simulation.defects import defects
from analyzer.simulation.field.cases.registry import field_cases

DEFECTS = defects()
ONE_AFTER_OTHER = [None, *sorted(code for code, defect in DEFECTS.items() if not defect.whole)]
FAULTY = ("clean", "noisy", "glitch", "slow-slave")  # wires whose client asks alike
WARM_UP = 14  # polls before the first defect

seeds = st.integers(0, 10_000)
rates = st.sampled_from([None, 1200, 9600, 115200])


def _asked(made: Simulation) -> list[bytes]:
    return [frame.adu for frame in made.truth if frame.pair is None]


def _tap(draw: st.DrawFn, code: str | None) -> str:
    return draw(st.sampled_from(sorted(TAPS if code is None else DEFECTS[code].taps)))


@st.composite
def scenarios(draw: st.DrawFn, seed: int) -> Scenario:
    code = draw(st.sampled_from(ONE_AFTER_OTHER))
    return Scenario(None, _tap(draw, code), transactions=40, seed=seed, baud=draw(rates), defect=code)


@settings(max_examples=40, deadline=None)
@given(st.data(), seeds)
def test_a_seed_is_a_bus_whatever_fault_tap_or_rate(data: st.DataObject, seed: int) -> None:
    plain = simulate(Scenario(None, "precise", transactions=40, seed=seed))
    made = simulate(data.draw(scenarios(seed)))
    first = 2 * WARM_UP
    assert [frame.adu for frame in made.truth[:first]] == [frame.adu for frame in plain.truth[:first]]


@settings(max_examples=40, deadline=None)
@given(st.data(), seeds)
def test_defects_that_shape_a_whole_capture_leave_the_units(data: st.DataObject, seed: int) -> None:
    code = data.draw(st.sampled_from(sorted(code for code, defect in DEFECTS.items() if defect.whole)))
    tap = data.draw(st.sampled_from(sorted(DEFECTS[code].taps)))
    plain = simulate(Scenario(None, "precise", transactions=60, seed=seed))
    made = simulate(Scenario(None, tap, transactions=60, seed=seed, defect=code))
    assert {frame.unit for frame in made.truth} <= {frame.unit for frame in plain.truth}
    assert made.line.baud == plain.line.baud


def test_registers_are_read_one_by_one_of_a_unit_that_is_polled() -> None:
    """On this bus one device is never asked."""
    plain = simulate(Scenario(None, "precise", transactions=60, seed=3163))
    made = simulate(Scenario(None, "ftdi16", transactions=60, seed=3163, defect="poll-waste"))
    assert {frame.unit for frame in made.truth} <= {frame.unit for frame in plain.truth}


@settings(max_examples=30, deadline=None)
@given(seeds, st.sampled_from(FAULTY), st.sampled_from(sorted(TAPS)), rates)
def test_wires_spoil_the_same_conversation(seed: int, wire: str, tap: str, baud: int | None) -> None:
    plain = [adu for adu, _ in groupby(_asked(simulate(Scenario("clean", "precise", transactions=60, seed=seed))))]
    asked = [adu for adu, _ in groupby(_asked(simulate(Scenario(wire, tap, transactions=60, seed=seed, baud=baud))))]
    length = min(len(plain), len(asked))
    assert length > 20
    assert asked[:length] == plain[:length]


@settings(max_examples=8, deadline=None)
@given(seeds, st.sampled_from(sorted(TAPS)), rates)
def test_devices_of_maps_serve_the_same_values(seed: int, tap: str, baud: int | None) -> None:
    maps = ("xy-md02@7", "eastron-sdm630@1")
    plain = simulate(Scenario(None, "precise", transactions=30, seed=seed, maps=maps))
    made = simulate(Scenario(None, tap, transactions=30, seed=seed, baud=baud, maps=maps))
    assert [frame.adu for frame in made.truth] == [frame.adu for frame in plain.truth]


def test_a_bus_on_which_nothing_is_wrong(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["simulate", str(tmp_path / "bus.jsonl"), "--seed", "1"]) == 0
    assert main(["report", str(tmp_path / "bus.jsonl"), "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert report["causes"] == []
    assert not [each for each in report["findings"] if each["severity"] == "error"]


@pytest.mark.parametrize("scenario", [{}, {"defect": "bit-flip"}, {"wire": "brutal"}, {"maps": ("xy-md02@7",)}])
def test_a_bus_is_made_as_it_is_written(scenario: dict[str, Any]) -> None:
    """However long it is: no more of it is held than the chunks that are on their way."""
    heard: list[TruthFrame] = []
    played = played_bus(Scenario(**{"wire": None, "tap": "irq", "transactions": 10**9, **scenario}))
    chunks = list(islice(played.chunks(heard.extend), 1000))
    assert sum(len(chunk.data) for chunk in chunks) >= 1000
    assert len(heard) < 1000


def test_chunks_that_pass_are_read_as_they_are_made() -> None:
    made = iter(range(10**9))
    passing = captures.Capture.passing(captures.LineSettings(), (captures.Chunk(at, b"x") for at in made))
    block = next(passing.blocks())
    assert 0 < len(block) == next(made) < 1 << 20


@pytest.mark.parametrize("cause", ["dead-unit", "all-silent", "cannot-serve", "duplicate-address"])
def test_a_cause_is_simulated_with_its_truth(cause: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "bus.jsonl"
    assert main(["simulate", str(path), "--cause", cause, "--seed", "1"]) == 0
    truth, *requests = [json.loads(line) for line in path.with_suffix(".truth.jsonl").read_text().splitlines()]
    assert truth["cause"] == cause
    assert requests
    assert {"unit", "t_end_ns", "result"} == set(requests[0])
    assert main(["report", str(path), "--json"]) == 0
    first, *_ = json.loads(capsys.readouterr().out)["causes"]
    assert first["cause"] == cause
    assert not truth["units"] or set(first["units"]) & set(truth["units"])


def test_the_same_seed_gives_the_same_site(tmp_path: Path) -> None:
    for name in ("one", "two"):
        write_cause("unit-busy", tmp_path / f"{name}.jsonl", seed=4)
    assert (tmp_path / "one.jsonl").read_bytes() == (tmp_path / "two.jsonl").read_bytes()
    assert list(captures.open(tmp_path / "one.jsonl").chunks())


def test_every_case_has_a_name_to_ask_for() -> None:
    assert {*cases_by_cause(), *other_cases()} >= set(field_cases())
    assert len(cases_by_cause()) >= 50
    assert case_of("healthy").name == "healthy"


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        (("--cause", "dead-unt"), "did you mean dead-unit?"),
        (("--cause", "gremlins"), "invalid choice: 'gremlins'"),
        (("--cause", "dead-unit", "--baud", "9600"), "leave out --baud"),
        (("--cause", "master-too-fast", "--tap", "irq"), "use one of precise"),
    ],
)
def test_a_cause_that_cannot_be_is_refused_in_one_line(
    asked: tuple[str, ...], words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["simulate", str(tmp_path / "bus.jsonl"), *asked]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert told.count("\n") == 1
    assert not (tmp_path / "bus.jsonl").exists()
