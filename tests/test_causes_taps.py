"""What is wrong with the tap is no unit's fault: one direction, the two exchanged, a line on which nobody answers."""

from __future__ import annotations

from random import Random

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation.field.bench import Expected, FieldCapture, site
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture


def _named(made: FieldCapture) -> list[str]:
    capture = Capture.of(made.line, made.chunks)
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    return [cause.cause for cause in causes_of(ledger)]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
@pytest.mark.parametrize("seed", [7081, 9302, 9308])
def test_exchanged_directions_are_told_where_requests_are_as_long_as_answers(seed: int, tap: str) -> None:
    assert _named(field_cases()["tap-reversed"].capture(tap, seed)) == ["tap-reversed"]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
@pytest.mark.parametrize("seed", [7081, 9305, 9316, 9334])
def test_requests_alone_whose_pace_hangs_on_the_poll_are_answered(seed: int, tap: str) -> None:
    assert _named(field_cases()["tap-one-direction"].capture(tap, seed)) == ["tap-one-direction"]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
@pytest.mark.parametrize("seed", [3, 4, 31])
def test_requests_whose_pace_is_the_timeouts_are_not(seed: int, tap: str) -> None:
    """Though the client's pauses stray, and so does the clock."""
    bench = site(Random(f"dead{seed}"), tap, units=(2, 8), seconds=(60, 300))
    for unit in bench.units.values():
        unit.silent = lambda _: True
    bench.master.manners.retries = 0
    assert _named(bench.run(Expected(None))) == ["absent-units"]
