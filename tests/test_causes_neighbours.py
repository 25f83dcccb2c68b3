"""Causes that look alike, each told from its neighbour."""

from __future__ import annotations

import pytest

from analyzer.causes.ledger import ledger_of
from analyzer.causes.model import Cause
from analyzer.causes.reasoning import causes_of
from analyzer.core import analyse
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture


def _causes(case: str, seed: int, tap: str) -> list[Cause]:
    made = field_cases()[case].capture(tap, seed)
    capture = Capture.of(made.line, made.chunks)
    return causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def _named(case: str, seed: int, tap: str) -> list[tuple[str, tuple[int, ...]]]:
    return [(cause.cause, cause.units) for cause in _causes(case, seed, tap)]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
def test_a_quiet_bus_that_is_disturbed_at_times_does_not_float(tap: str) -> None:
    """Where frames are rare, so are those that are hit."""
    assert _named("hours", 9100, tap) == [("hours", ())]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
def test_a_second_answer_that_runs_into_the_next_exchange_is_no_second_master(tap: str) -> None:
    found = _named("duplicate-beside-settings", 9100, tap)
    assert sorted(found) == [("duplicate-address", (4,)), ("unit-line-settings", (37,))]


@pytest.mark.parametrize("tap", ["precise", "ftdi16"])
def test_a_fixed_pause_that_takes_no_time_to_speak_of_is_no_rest(tap: str) -> None:
    """The line is full all the same: without these pauses the round would be hardly shorter."""
    assert _named("overload-fixed-pause", 9100, tap) == [("overload", ())]
