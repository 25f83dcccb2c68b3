"""Captures with one defect: every code is there, the truth fits the bytes, and nothing else is wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

import captures
from analyzer.cli import main
from analyzer.core import deframe
from analyzer.simulation import Scenario, Simulation, simulate, write
from analyzer.simulation.defects import defects
from analyzer.tables.findings import About, rules
from analyzer.tables.schema import Kind
from captures.chunks import Capture
from dissectors.crc import VARIANTS, crc_ok

DEFECTS = defects()

CODES = sorted(rule.code for rule in rules())  # what an analyzer may say, a capture must be able to hold
OF_NOISE = {rule.code for rule in rules() if rule.about is About.NOISE}


def _made(code: str, seed: int = 1, **other: Any) -> Simulation:
    return simulate(Scenario("clean", DEFECTS[code].taps[0], seed=seed, defect=code, **other))


def _stream(made: Simulation) -> bytes:
    return b"".join(chunk.data for chunk in made.chunks)


def test_every_finding_can_be_simulated() -> None:
    assert sorted(DEFECTS) == CODES
    assert all(defect.words.endswith((".", "wins.")) for defect in DEFECTS.values())


@pytest.mark.parametrize("code", CODES)
def test_the_truth_fits_the_bytes(code: str) -> None:
    made = _made(code)
    stream, spans = _stream(made), {(frame.start, frame.length): frame for frame in made.truth}
    found = [finding for finding in made.findings if finding.code == code]
    assert found
    bus_wide = found[0].start < 0
    assert len(found) == 1 if bus_wide else len(found) >= 20
    for finding in made.findings:
        if finding.start < 0:
            assert finding.length == 0
        elif finding.code in OF_NOISE:
            assert all(
                frame.start + frame.length <= finding.start or frame.start >= finding.start + finding.length
                for frame in made.truth
            )
        else:
            assert (finding.start, finding.length) in spans
    end = 0
    for frame in made.truth:
        assert frame.start >= end, "frames overlap"
        end = frame.start + frame.length
        assert (stream[frame.start : end] == frame.adu) == (frame.fault is None or frame.fault == "crc-variant")
    assert end <= len(stream)


@pytest.mark.parametrize("code", CODES)
def test_what_is_not_wrong_is_a_healthy_bus(code: str) -> None:
    """Frames that nothing was done to are read as they were sent."""
    made = _made(code, transactions=150)
    spoken = {(finding.start, finding.length) for finding in made.findings}
    whole = {(f.start, f.length) for f in made.truth if f.intact and (f.start, f.length) not in spoken}
    capture = Capture.of(made.line, made.chunks, timed=made.line.tap != "untimed")
    rows = [row for batch in deframe(capture) for row in batch.rows[batch.rows.check] if row.kind != Kind.NOISE]
    read = {(int(row.start), int(row.length)) for row in rows}
    assert whole <= read
    assert made.line.tap is not None


@pytest.mark.parametrize("seed", range(3))
def test_damage_is_what_the_truth_says(seed: int) -> None:
    for code in ("bit-flip", "byte-missing", "byte-extra", "truncated", "bytes-repeated", "crc-variant", "crc-error"):
        made = _made(code, seed)
        stream, frames = _stream(made), {frame.start: frame for frame in made.truth}
        for finding in made.findings:
            sent, detail = frames[finding.start].adu, finding.detail
            data = stream[finding.start : finding.start + finding.length]
            assert not crc_ok(data)
            match code:
                case "bit-flip":
                    at = detail["byte"]
                    assert data == sent[:at] + bytes((sent[at] ^ 1 << detail["bit"],)) + sent[at + 1 :]
                case "byte-missing":
                    assert {data[:at] + bytes((detail["value"],)) + data[at:] for at in detail["places"]} == {sent}
                case "byte-extra":
                    assert {data[:at] + data[at + 1 :] for at in detail["places"]} == {sent}
                case "truncated":
                    assert sent.startswith(data)
                    assert detail["due"] == len(sent) >= len(data) + 2
                case "bytes-repeated":
                    assert data[: detail["byte"]] + data[detail["byte"] + detail["size"] :] == sent
                case "crc-variant":
                    assert any(v.name == detail["variant"] and v.made(data[:-2]) == data[-2:] for v in VARIANTS)


def test_a_port_with_flow_control_gives_no_xon_and_no_xoff() -> None:
    made = _made("flow-control-loss")
    assert not set(_stream(made)) & {0x11, 0x13}
    lost = sum(len(frame.adu) - frame.length for frame in made.truth)
    assert lost == sum(finding.detail["lost"] for finding in made.findings) > 0


def test_marked_bytes_are_marked_in_the_capture() -> None:
    made = _made("parity-error")
    marked, start = [], 0
    for chunk in made.chunks:
        marked += [start + at for at in chunk.errors]
        start += len(chunk.data)
    assert marked == [finding.start + finding.detail["byte"] for finding in made.findings]


def test_healthy_silences() -> None:
    """Where silences are not the defect, none is shorter than 3.5 characters."""
    made = simulate(Scenario("clean", "precise", seed=3, baud=9600, defect="bit-flip"))
    character = 11 / 9600 * 1e9
    starts = {frame.start for frame in made.truth}
    times = [chunk.t_ns for chunk in made.chunks]
    gaps = [times[i] - times[i - 1] - character for i in range(1, len(times)) if i in starts]
    assert min(gaps) > 3.5 * character


def test_the_same_seed_gives_the_same_capture() -> None:
    assert _made("collision", 5) == _made("collision", 5)
    assert _stream(_made("collision", 5)) != _stream(_made("collision", 6))


def test_one_unit_is_enough_for_most() -> None:
    for code in CODES:
        if DEFECTS[code].units == 1:
            assert _made(code, units=1, transactions=60).findings, code


def test_truth_is_written_beside_the_capture(tmp_path: Path) -> None:
    scenario = Scenario("clean", "irq", transactions=60, seed=1, defect="byte-missing")
    write(scenario, tmp_path / "bus.jsonl")
    made = simulate(scenario)
    lines = [json.loads(line) for line in (tmp_path / "bus.truth.jsonl").read_text().splitlines()]
    assert [line for line in lines if "finding" in line] == [finding.to_json() for finding in made.findings]
    assert [line for line in lines if "finding" not in line] == [frame.to_json() for frame in made.truth]
    assert list(captures.open(tmp_path / "bus.jsonl").chunks()) == made.chunks


def test_the_command_makes_one(tmp_path: Path) -> None:
    out = tmp_path / "lost.jsonl"
    assert main(["simulate", str(out), "--defect", "byte-missing", "--transactions", "60", "--seed", "2"]) == 0
    assert '"finding": "byte-missing"' in out.with_suffix(".truth.jsonl").read_text()


@pytest.mark.parametrize(
    ("scenario", "word"),
    [
        (Scenario("clean", "irq", defect="gremlins"), "gremlins"),
        (Scenario("noisy", "irq", defect="bit-flip"), "clean"),
        (Scenario("clean", "untimed", defect="gap-in-frame"), "precise"),
        (Scenario("clean", "irq", units=1, defect="slow-device"), "units"),
    ],
)
def test_impossible_defects_are_refused_in_one_line(scenario: Scenario, word: str) -> None:
    with pytest.raises(ValueError, match=word) as caught:
        simulate(scenario)
    assert "\n" not in str(caught.value)
