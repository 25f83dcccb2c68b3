"""The laws of causes: what is well is not accused, what is said can be so, and the story hangs on the rows alone."""

from __future__ import annotations

import json
import re
from dataclasses import replace

import pytest
from bursts import answer_of, captured, read_of
from buses import SHARED, shared

import captures
from analyzer.causes.ledger import ledger_of
from analyzer.causes.reasoning import causes_of
from analyzer.causes.registry import Cause
from analyzer.core import Analyzer, analyse
from analyzer.simulation.field.bench import FieldCapture
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture

HEALTHY = sorted(name for name in field_cases() if name.startswith("healthy"))
ILL = ("dead-unit", "driver-enabled-late", "byte-count", "duplicate-address", "emi-mains", "unit-busy", "word-order")


def capture_of(made: FieldCapture) -> Capture:
    """The chunks of a case as a capture."""
    return Capture.of(made.line, made.chunks, timed=made.line.tap != "untimed")


def causes_in(capture: Capture) -> list[Cause]:
    """What an analysis names."""
    return causes_of(ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line))


def assert_parts_are_parts(cause: Cause) -> None:
    """No `209 of 208 requests`."""
    for part, whole in re.findall(r"(\d+) of (\d+)\b", f"{cause.text} {cause.share}"):
        assert int(part) <= int(whole), cause.text


@pytest.mark.parametrize(
    ("name", "tap"),
    [
        (name, tap)
        for name in HEALTHY
        for tap in ("precise", "ftdi16", "gateway", "untimed")[:: 1 + (name != "healthy")]
    ],
)
def test_what_is_well_has_no_cause(name: str, tap: str) -> None:
    """Facts may be told of it: a unit that slept, a plant that was switched off once."""
    made = field_cases()[name].capture(tap, 5)
    assert [cause.cause for cause in causes_in(capture_of(made)) if cause.severity != "note"] == []


_real = sorted(p.stem for p in SHARED.glob("corpus/real/*.jsonl") if ".truth" not in p.suffixes)


@pytest.mark.parametrize("name", _real or ["pymodbus_rtu"])
def test_the_real_captures_have_no_cause(name: str) -> None:
    assert causes_in(captures.open(shared(f"corpus/real/{name}.jsonl"))) == []


@pytest.mark.parametrize(("name", "tap"), [(name, ("precise", "ftdi16")[i % 2]) for i, name in enumerate(ILL)])
def test_what_is_said_can_be_so(name: str, tap: str) -> None:
    case = field_cases()[name]
    if tap not in case.taps:
        pytest.skip("this tap cannot carry it")
    made = case.capture(tap, 2)
    capture = capture_of(made)
    ledger = ledger_of(((part.batch, part.transactions) for part in analyse(capture)), capture.line)
    found = causes_of(ledger)
    assert found
    assert found[0].cause == made.expected.cause
    assert not made.expected.units or found[0].units[0] in made.expected.units
    for cause in found:
        assert 0 < cause.confidence < 1
        assert cause.text
        assert cause.remedy
        assert "{" not in cause.text + cause.share + cause.deciding_test + cause.remedy
        assert cause.lost_answers is None or 0 <= cause.lost_answers <= ledger.requests
        assert cause.lost_ms is None or 0 <= cause.lost_ms <= ledger.span_ns / 1e6
        if cause.since_ns is not None and cause.until_ns is not None:
            assert (ledger.begin or 0) <= cause.since_ns <= cause.until_ns <= ledger.end
        assert_parts_are_parts(cause)
        json.dumps(cause.to_json())


def test_an_adapter_shows_no_more_than_was_sent() -> None:
    found = causes_in(capture_of(field_cases()["echo-dead-unit"].capture("ftdi16", 5)))
    (echo,) = (cause for cause in found if cause.cause == "local-echo")
    assert echo.share.endswith("requests")
    assert_parts_are_parts(echo)


@pytest.mark.parametrize("name", ["dead-unit", "counter-jumps"])
def test_the_same_story_however_it_was_read(name: str) -> None:
    made = field_cases()[name].capture("precise", 3)
    capture = capture_of(made)
    analyzer = Analyzer(capture.line)
    parts = [part for block in capture.blocks(997) for part in analyzer.feed(block)]
    parts += analyzer.close()
    pieces = causes_of(ledger_of(((part.batch, part.transactions) for part in parts), capture.line))
    whole = causes_in(capture_of(made))
    assert [(c.cause, c.units, c.lost_answers) for c in pieces] == [(c.cause, c.units, c.lost_answers) for c in whole]


def test_a_second_answer_is_one_whatever_portions_the_rows_come_in() -> None:
    """Behind the request to another unit it is known by the one before, which may have come in an earlier portion."""
    round_of_two = [(20.0, read_of(1)), (4.0, answer_of(1, 7)), (20.0, read_of(2)), (2.0, answer_of(1, 8)),
                    (4.0, answer_of(2, 9))]  # fmt: skip
    capture = captured(round_of_two * 12)
    parts = [(part.batch, part.transactions) for part in analyse(capture)]
    rows = [
        (replace(batch, rows=batch.rows[i : i + 1]), transactions[: 0 if i else None])
        for batch, transactions in parts
        for i in range(len(batch))
    ]
    whole, pieces = (ledger_of(portions, capture.line).units[1] for portions in (parts, rows))
    assert (pieces.doubles, pieces.strays) == (whole.doubles, whole.strays)
    assert whole.doubles >= 10


@pytest.mark.parametrize("name", ["absent-units", "bias", "driver-enabled-late", "unit-restarts"])
def test_without_times_no_time_is_said(name: str) -> None:
    made = field_cases()[name].capture("untimed", 4)
    causes = causes_in(capture_of(made))
    assert causes
    for cause in causes:
        assert (cause.since_ns, cause.until_ns, cause.period_s, cause.lost_ms) == (None,) * 4
        assert " s " not in cause.text


def test_answers_that_run_into_what_is_sent_next_are_late_and_no_second_master() -> None:
    made = field_cases()["timeout-too-short"].capture("precise", 3601)
    found = causes_in(capture_of(made))
    assert [(cause.cause, cause.units[:1]) for cause in found[:1]] == [("timeout-too-short", made.expected.units)]
    assert "two-masters" not in [cause.cause for cause in found]


@pytest.mark.parametrize("tap", ["precise", "untimed"])
def test_damage_of_the_unit_behind_a_silent_one_is_no_late_answer(tap: str) -> None:
    found = causes_in(capture_of(field_cases()["duplicate-beside-dead"].capture(tap, 7001)))
    assert {cause.cause for cause in found[:2]} == {"duplicate-address", "dead-unit"}


def test_two_units_at_fault_are_no_interference() -> None:
    found = causes_in(capture_of(field_cases()["duplicate-beside-settings"].capture("ftdi16", 7001)))
    assert {cause.cause for cause in found[:2]} == {"duplicate-address", "unit-line-settings"}


def test_a_request_inside_an_answer_tells_a_second_master() -> None:
    found = causes_in(capture_of(field_cases()["two-masters"].capture("ftdi16", 500)))
    assert [cause.cause for cause in found] == ["two-masters"]


def test_an_answer_that_runs_into_its_own_request_once_more_is_late() -> None:
    found = causes_in(capture_of(field_cases()["timeout-too-short-shifted"].capture("precise", 7001)))
    assert [cause.cause for cause in found[:1]] == ["timeout-too-short"]


def test_a_speed_that_is_not_0_goes_with_the_damage() -> None:
    found = causes_in(capture_of(field_cases()["emi-drive"].capture("precise", 501)))
    assert found[0].cause == "emi-drive"
    assert "is not 0" in found[0].text


@pytest.mark.parametrize(("tap", "seed"), [("precise", 13002), ("ftdi16", 13008)])
def test_what_a_value_tells_is_no_floating_line_and_no_hours_even_where_frames_are_rare(tap: str, seed: int) -> None:
    assert causes_in(capture_of(field_cases()["emi-drive"].capture(tap, seed)))[0].cause == "emi-drive"


@pytest.mark.parametrize("seed", [13002, 13009])
def test_a_value_that_changes_much_oftener_than_the_damage_does_not_take_its_times(seed: int) -> None:
    assert causes_in(capture_of(field_cases()["hours"].capture("precise", seed)))[0].cause == "hours"
