"""What the data cannot carry is not said: repeated broadcasts, echoes, costs, response times of a coarse clock."""

from __future__ import annotations

import struct
from random import Random

import pytest
from buses import LINE
from diagnosed import ANSWER, REQUEST, Wire, diagnosed, said, with_crc

from analyzer.checks import compile_check, run
from analyzer.core import analyse
from analyzer.reports import summarize, text
from analyzer.simulation import Scenario, simulate
from analyzer.simulation.field.bench import SECOND, Expected, FieldCapture, site
from analyzer.simulation.field.master import FieldPoll
from analyzer.tables.findings import Severity, described
from captures.chunks import Capture

WRITE = with_crc("110600010003")
ANOTHER = with_crc("110300700002")


def shouting(seed: int, tap: str) -> FieldCapture:
    """A client that sends the same broadcast again and again, among its polls."""
    random = Random(seed)
    bench = site(random, tap, seconds=(20, 60))
    function, value = random.choice(((5, 0xFF00), (6, 100)))
    shouts = [FieldPoll(0, lambda _: struct.pack(">BHH", function, 7, value))] * random.randint(1, 3)
    polls = bench.master.polls if random.random() < 0.7 else []
    bench.master.polls = [*shouts, *polls, FieldPoll(0, shouts[0].pdu, random.uniform(0.5, 3) * SECOND)]
    return bench.run(Expected(None))


@pytest.mark.parametrize(
    ("seed", "tap"),
    [(seed, tap) for seed in range(4) for tap in ("precise", "irq", "ftdi16", "untimed")[seed % 2 :: 2]],
)
def test_repeated_broadcasts_are_neither_answered_nor_late_nor_retried(seed: int, tap: str) -> None:
    made = shouting(seed, tap)
    capture = Capture.of(made.line, made.chunks, timed=tap != "untimed")
    found = [finding for part in analyse(capture) for finding in described(part.findings)]
    wrong = {"broadcast-answered", "late-response", "retry", "no-response", "unexpected-response"}
    assert [finding.text for finding in found if finding.code in wrong] == []
    assert [finding.text for finding in found if finding.severity is Severity.ERROR] == []


def test_broadcasts_of_a_client_that_pauses_between_none_are_not_answered() -> None:
    wire = Wire().polls(3)
    for value in (1, 2, 2, 3, 4, 4, 5):  # a set value that hardly changes
        wire.silence(15).send(with_crc(f"0006000700{value:02x}"))
    wire.silence(120)
    assert "broadcast-answered" not in {code for code, _ in said(diagnosed(wire.polls(3)))}


def late(answer: bytes, newest: bytes) -> list[str]:
    """What is said of an answer that comes behind another request."""
    wire = Wire().polls(12).exchange(REQUEST, None).silence(20)
    wire.send(newest)
    wire.silence(4).send(answer)
    wire.silence(200)
    return [finding.text for finding in diagnosed(wire.polls(3)) if finding.code == "late-response"]


def test_a_late_answer_that_is_mistaken_for_another_is_told_from_one_that_is_rejected() -> None:
    (danger,) = late(ANSWER, with_crc("110300900003")) or ["none"]
    (rejected,) = late(ANSWER, ANOTHER)
    assert "too late" in danger or danger == "none"  # nothing in its bytes tells whose answer it is
    assert "reject" in rejected


def test_a_second_echo_of_a_write_is_a_second_answer() -> None:
    wire = Wire().polls(12)
    first = wire.offset
    wire.exchange(WRITE, WRITE).silence(6).send(WRITE)
    assert [(code, start - first) for code, start in said(diagnosed(wire.polls(3)))] == [("duplicate-response", 16)]


def test_costs_are_measured_or_absent() -> None:
    made = simulate(Scenario("noisy", "untimed", seed=3))
    report = summarize(Capture.of(made.line, made.chunks, timed=False))
    assert any(row.lost_answers for row in report.findings)
    assert all(not row.lost_ms for row in report.findings)
    assert " ms lost" not in text(report)
    timed = simulate(Scenario("noisy", "precise", seed=3))
    told = summarize(Capture.of(timed.line, timed.chunks))
    assert any(row.lost_ms for row in told.findings)
    assert sum(row.lost_ms or 0 for row in told.findings) <= (told.span_ns or 0) / 1e6


@pytest.mark.parametrize("tap", ["ftdi16", "gateway"])
def test_response_times_of_a_coarse_clock_are_intervals(tap: str) -> None:
    made = simulate(Scenario("clean", tap, seed=1))
    capture = Capture.of(made.line, made.chunks)
    line = summarize(capture).to_json()["times"]
    assert line["p50_ns"] is None
    assert line.get("p50_low_ns", 0) < line.get("p50_high_ns", 1)
    rules = [compile_check(rule, capture.line) for rule in ("p50 response_time < 1 us", "p50 response_time < 2 ms")]
    results = run(Capture.of(made.line, made.chunks), rules)
    assert not any(outcome.passed for outcome in results.outcomes)
    assert any("cannot be told" in outcome.measured or "unknown" in outcome.measured for outcome in results.outcomes)


def test_groups_tell_unit_share_and_time() -> None:
    wire = Wire().polls(12)
    for _ in range(3):
        wire.exchange(with_crc("090300000001"), None)
    wire.polls(3)
    report = summarize(Capture.of(LINE, wire.chunks))
    (row,) = [row for row in report.findings if row.code == "no-response"]
    (group,) = row.groups
    assert (group.unit, group.count, group.of) == (9, 3, 3)
    assert group.t_ns < group.until_ns
    assert "Master State diagram" in row.clause
