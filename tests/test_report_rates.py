"""How fast senders' clocks are: of each, in per cent of the line's rate, where a logic analyser saw the edges."""

from __future__ import annotations

from pathlib import Path

import pytest
from waves import BAUD, OFF, bus, drifting_bus, vcd

import captures
from analyzer.core import Analysed
from analyzer.filters import compile_filter
from analyzer.reports import Report, summarize, text


def reported(path: Path, channels: dict[str, list[int]], filter: str = "", baud: int | None = None) -> Report:
    path.write_bytes(vcd(channels))
    capture = captures.open(path, baud=baud)
    return summarize(capture, filter=compile_filter(filter) if filter else None)


@pytest.mark.parametrize("wires", [1, 2])
@pytest.mark.parametrize("baud", [None, BAUD], ids=["inferred", "given"])
def test_the_rate_of_each_sender_is_told(tmp_path: Path, wires: int, baud: int | None) -> None:
    channels: dict[str, list[int]] = {"RO": [], "TX": []} if wires == 2 else {"RO": []}
    for sender, edges in bus():
        channels["TX" if wires == 2 and sender is None else "RO"] += edges
    report = reported(tmp_path / "bus.vcd", channels, baud=baud)
    assert report.frames == 80
    assert {row.unit: pytest.approx(row.error, abs=2e-4) for row in report.rates} == OFF
    assert {row.unit: pytest.approx(row.baud, rel=2e-4) for row in report.rates} == {
        sender: BAUD * (1 + off) for sender, off in OFF.items()
    }
    assert "rates     clocks against the line's rate: unit 17 -1.5%, client +1.0%, unit 3 +0.0%" in text(report, 200)


def test_of_what_passes_a_filter(tmp_path: Path) -> None:
    channels = {"RO": [edge for _, edges in bus() for edge in edges]}
    report = reported(tmp_path / "bus.vcd", channels, "unit == 3 and response")
    assert {row.unit: pytest.approx(row.error, abs=2e-4) for row in report.rates} == {3: 0.0}


def test_another_pass_over_the_capture_changes_nothing(tmp_path: Path) -> None:
    capture = drifting_bus(tmp_path / "bus.vcd")
    alone = summarize(capture).rates
    assert len(alone) == len(OFF)

    def look(_: Analysed) -> None:
        assert list(capture.blocks())

    assert summarize(capture, watch=look).rates == alone


def test_it_is_not_told_of_what_has_no_edges() -> None:
    assert summarize(captures.Capture.of(captures.LineSettings(baud=BAUD), [captures.Chunk(1, bytes(9))])).rates == ()
