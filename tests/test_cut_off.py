"""A capture that ends while an answer is due: the unit is not blamed for what nobody could hear."""

from __future__ import annotations

from pathlib import Path

import pytest
from buses import adu

import captures
from analyzer.checks import compile_check, run
from analyzer.core import Analyzer, analyse, as_it_comes
from analyzer.reports import summarize, text
from analyzer.tables.findings import described
from analyzer.tables.transactions import Status
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from captures.recording.recorder import Recorder

LINE = LineSettings(baud=9600, char_bits=10, tap="precise")
REQUEST, ANSWER = adu("0103000b0001"), adu("01030200e6")
SECOND = 1_000_000_000
BLAMING = frozenset({"no-response", "retry", "truncated", "byte-missing", "crc-error", "noise"})


def polls(count: int, *, silent: frozenset[int] = frozenset(), every_ns: int = SECOND // 2) -> list[Chunk]:
    chunks = []
    for poll in range(count):
        chunks.append(Chunk(SECOND + poll * every_ns, REQUEST))
        if poll not in silent:
            chunks.append(Chunk(SECOND + poll * every_ns + 40_000_000, ANSWER))
    return chunks


def test_the_last_request_of_a_capture_is_not_held_against_its_unit() -> None:
    capture = Capture.of(LINE, polls(12, silent=frozenset({11})))
    report = summarize(capture)
    assert (report.transactions.unanswered, report.transactions.unheard) == (0, 1)
    assert BLAMING.isdisjoint(row.code for row in report.findings)
    assert report.causes == () and report.not_explained == ()
    page = text(report)
    assert "12: 11 answered, 1 not heard" in page
    assert "the capture stopped while the answer was due" in page


def test_a_request_that_was_followed_by_another_one_is() -> None:
    report = summarize(Capture.of(LINE, polls(12, silent=frozenset({5, 11}))))
    assert (report.transactions.unanswered, report.transactions.unheard) == (1, 1)
    assert [row.count for row in report.findings if row.code == "no-response"] == [1]
    assert [(row.asked, row.ok, row.wasted) for row in report.polls] == [(11, 10, 1)]


@pytest.mark.parametrize(("waited_ns", "outcome"), [(SECOND // 5, Status.UNHEARD), (3 * SECOND, Status.UNANSWERED)])
def test_live_the_wait_that_was_heard_out_counts(waited_ns: int, outcome: Status) -> None:
    analyzer = Analyzer(LINE)
    chunks = polls(12, silent=frozenset({11}))
    for block in Capture.of(LINE, chunks).blocks(1 << 16):
        analyzer.feed(block)
    analyzer.tick(chunks[-1].t_ns + waited_ns)
    settled = [status for part in analyzer.close() for status in part.transactions.status.tolist()]
    assert settled[-1] == outcome


def test_how_long_a_client_waits_shows_in_the_capture() -> None:
    """One that asks again after 200 ms has given up 300 ms after its last request."""
    chunks = polls(12, silent=frozenset({4, 11}), every_ns=SECOND // 5)
    analyzer = Analyzer(LINE)
    for block in Capture.of(LINE, chunks).blocks(1 << 16):
        analyzer.feed(block)
    analyzer.tick(chunks[-1].t_ns + 3 * SECOND // 10)
    settled = [status for part in analyzer.close() for status in part.transactions.status.tolist()]
    assert [settled[4], settled[11]] == [Status.UNANSWERED, Status.UNANSWERED]


@pytest.mark.parametrize(("listened_ns", "unanswered"), [(None, 0), (SECOND // 5, 0), (3 * SECOND, 1)])
def test_a_recording_says_how_long_was_listened_behind_its_last_request(
    tmp_path: Path, listened_ns: int | None, unanswered: int
) -> None:
    """The usual test at commissioning: one request to a unit that is dead, and a look at the record."""
    chunks = polls(12, silent=frozenset({11}))
    recorder = Recorder(tmp_path / "bus.mcap", LINE, tell=lambda _: None)
    for block in Capture.of(LINE, chunks).blocks(1 << 16):
        recorder.write(block)
    recorder.close(None if listened_ns is None else chunks[-1].t_ns + listened_ns)
    capture = captures.open(tmp_path / "bus.mcap")
    report = summarize(capture)
    assert (report.transactions.unanswered, report.transactions.unheard) == (unanswered, 1 - unanswered)
    silent = [row for row in report.findings if row.code == "no-response"]
    assert [row.count for row in silent] == [1] * unanswered
    (outcome,) = run(capture, [compile_check("every poll answered", capture.line)]).outcomes
    assert outcome.passed is (not unanswered)
    shown = [step.transactions.status.tolist() for step in as_it_comes(capture)]
    assert [status for part in shown for status in part].count(Status.UNANSWERED) == unanswered
    rows = [sum(len(step.batch) for step in steps) for steps in (as_it_comes(capture), analyse(capture))]
    assert rows == [len(chunks)] * 2


def test_no_finding_speaks_of_an_answer_that_was_still_due() -> None:
    capture = Capture.of(LINE, polls(40, silent=frozenset({39})))
    assert BLAMING.isdisjoint(finding.code for part in analyse(capture) for finding in described(part.findings))


LONG = adu("01030600e600e700e8")


@pytest.mark.parametrize("kept", range(4, 10))
def test_an_answer_that_the_end_of_a_capture_cuts_is_not_held_against_its_unit(kept: int) -> None:
    chunks = [Chunk(SECOND + at * SECOND // 2, adu("0103000b0003")) for at in range(12)]
    answers = [Chunk(chunk.t_ns + 40_000_000, LONG) for chunk in chunks]
    answers[-1] = Chunk(answers[-1].t_ns, LONG[:kept])
    report = summarize(Capture.of(LINE, [chunk for pair in zip(chunks, answers, strict=True) for chunk in pair]))
    assert (report.transactions.damaged, report.transactions.unheard) == (0, 1)
    assert BLAMING.isdisjoint(row.code for row in report.findings)
    assert report.causes == () and report.not_explained == ()


def test_a_damaged_answer_at_the_end_is_one() -> None:
    damaged = bytes([*ANSWER[:4], ANSWER[4] ^ 4, *ANSWER[5:]])
    report = summarize(Capture.of(LINE, [*polls(12)[:-1], Chunk(SECOND * 7, damaged)]))
    assert (report.transactions.damaged, report.transactions.unheard) == (1, 0)


def test_an_answer_that_ends_too_early_in_a_silence_that_was_heard_is_a_damaged_one() -> None:
    analyzer = Analyzer(LINE)
    chunks = [*polls(12)[:-1], Chunk(SECOND * 7, ANSWER[:5])]
    for block in Capture.of(LINE, chunks).blocks(1 << 16):
        analyzer.feed(block)
    analyzer.tick(chunks[-1].t_ns + SECOND)
    settled = [status for part in analyzer.close() for status in part.transactions.status.tolist()]
    assert settled[-1] == Status.DAMAGED
