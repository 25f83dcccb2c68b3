"""No error and no warning where nothing is wrong: healthy captures of every tap, and real ones, each read by hand."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import pytest
from buses import SHARED, shared

import analyzer
import captures.samples
from analyzer.core import analyse
from analyzer.simulation import TAPS, WIRES, Scenario, simulate
from analyzer.tables.findings import Severity, described
from captures.chunks import Capture

TIMING = {"gap-in-frame", "gap-too-short", "turnaround-short", "slow-device"}

# What is wrong on the real captures, and why it is true.
REAL = {
    # An inverter polls an energy meter that stays silent (the issue that it comes from is about just that); after the
    # fifth request the capture ends, so that nothing can be said of it.
    "issue_solax_sdm230": {"no-response": 4},
    # Deliberate exceptions of a test run. The server answers functions 14 hex with function 28 hex and its exception
    # bit, twice (1300, 2654), and a poll of a unit that it does not serve with function 0 (2729): no answer to any
    # request. It answers unit 0 as well (2724). The polls after its wrong answers are no repetitions.
    "pymodbus_rtu": {"exception": 6, "response-mismatch": 2, "unexpected-response": 1, "broadcast-answered": 1},
}


def troubles(capture: Capture) -> Counter[str]:
    """Errors and warnings by code."""
    found = [finding for part in analyse(capture) for finding in described(part.findings)]
    return Counter(finding.code for finding in found if finding.severity > Severity.NOTE)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("tap", TAPS)
def test_a_clean_bus_has_no_troubles_but_what_devices_refuse(tap: str, seed: int) -> None:
    made = simulate(Scenario("clean", tap, transactions=300, seed=seed))
    refused = sum(1 for frame in made.truth if frame.adu[1] & 0x80)
    assert troubles(Capture.of(made.line, made.chunks)) == Counter({"exception": refused} if refused else {})


@pytest.mark.parametrize("name", ["healthy.jsonl", "mbpoll.mcap"])
def test_the_healthy_samples(name: str) -> None:
    assert set(troubles(captures.open(captures.samples.path(name)))) <= {"exception"}


_real = sorted(p.stem for p in SHARED.glob("corpus/real/*.jsonl") if ".truth" not in p.suffixes)


@pytest.mark.parametrize("name", _real or ["pymodbus_rtu"])
def test_the_real_captures(name: str) -> None:
    assert troubles(captures.open(shared(f"corpus/real/{name}.jsonl"))) == Counter(REAL.get(name, {}))


@pytest.mark.parametrize("wire", sorted(WIRES))
def test_no_timing_accusation_behind_a_latency_timer(wire: str) -> None:
    for tap in ("ftdi16", "gateway", "untimed"):
        made = simulate(Scenario(wire, tap, transactions=200, seed=11))
        found = [
            finding for part in analyse(Capture.of(made.line, made.chunks)) for finding in described(part.findings)
        ]
        assert not {finding.code for finding in found} & TIMING
        assert [finding.code for finding in found].count("timing-blind") == 1


def test_a_tap_that_sees_each_byte_is_not_blind(tmp_path: Path) -> None:
    made = simulate(Scenario("clean", "precise", transactions=60, seed=1))
    captures.write(tmp_path / "bus.jsonl", made.chunks, line=made.line)
    assert "timing-blind" not in {finding.code for finding in analyzer.open(tmp_path / "bus.jsonl").findings()}
