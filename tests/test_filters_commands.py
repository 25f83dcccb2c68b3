"""`export --filter` and `report --filter`: what passes is written and counted, whole conversations, nothing made up."""

from __future__ import annotations

import json
from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from buses import piece, whole
from hypothesis import given, settings
from hypothesis import strategies as st
from running import ran, refused

import captures
from analyzer.core import Analysed
from analyzer.filters import compile_filter
from analyzer.filters.evaluation import filtered
from analyzer.reports import summarize
from analyzer.tables.findings import Findings
from analyzer.tables.transactions import TransactionRows
from captures import samples

TROUBLED = samples.path("troubled.jsonl")


def lines(out: str) -> list[dict[str, object]]:
    return [json.loads(line) for line in out.splitlines()]


def test_export_writes_the_frames_that_pass_as_they_are(capsys: pytest.CaptureFixture[str]) -> None:
    every = lines(ran(capsys, "export", TROUBLED).out)
    done = ran(capsys, "export", TROUBLED, "--filter", "unit == 17 and response")
    assert done.status == 0
    assert lines(done.out) == [each for each in every if each["unit"] == 17 and each["direction"] == "response"]
    done = ran(capsys, "export", TROUBLED, "--filter", 'finding == "no-response"')
    told = [any(found["code"] == "no-response" for found in each["findings"]) for each in every]  # type: ignore[attr-defined]
    assert lines(done.out) == [each for each, mine in zip(every, told, strict=True) if mine]


def test_noise_is_written_when_asked_for_by_option_or_by_the_filter(capsys: pytest.CaptureFixture[str]) -> None:
    every = lines(ran(capsys, "export", TROUBLED, "--noise").out)
    noise = [each for each in every if each.get("kind") == "noise"]
    assert noise
    assert lines(ran(capsys, "export", TROUBLED, "--filter", "noise").out) == noise
    assert lines(ran(capsys, "export", TROUBLED, "--noise", "--filter", "length >= 0").out) == every
    frames = lines(ran(capsys, "export", TROUBLED, "--filter", "length >= 0").out)
    assert frames == [each for each in every if "kind" not in each]


def test_csv_is_filtered_too_and_mcap_says_why_not(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    out = tmp_path / "some.csv"
    assert ran(capsys, "export", TROUBLED, "-o", out, "--filter", "exception").status == 0
    exceptions = [each for each in lines(ran(capsys, "export", TROUBLED).out) if each["exception"]]
    assert len(out.read_text().splitlines()) == 1 + len(exceptions)
    said = refused(capsys, "export", TROUBLED, "-o", tmp_path / "some.mcap", "--filter", "exception")
    assert "whole capture" in said
    assert not (tmp_path / "some.mcap").exists()


def test_nothing_passes_and_mistakes(capsys: pytest.CaptureFixture[str]) -> None:
    for command in ("export", "report"):
        assert ran(capsys, command, TROUBLED, "--filter", "unit == 99").status == 1
        assert "column 9: 999 is outside 0 to 255" in refused(capsys, command, TROUBLED, "--filter", "unit == 999")
    assert "No frame passes the filter." in ran(capsys, "report", TROUBLED, "--filter", "unit == 99").out


def test_a_report_of_one_unit_is_that_units_row() -> None:
    capture = captures.open(TROUBLED)
    every = summarize(capture)
    for row in every.units:
        part = summarize(capture, filter=compile_filter(f"unit == {row.unit}"))
        assert part.units == (row,)
        assert part.filter == f"unit == {row.unit}"
    answers = summarize(capture, filter=compile_filter("response"))
    assert answers.requests == 0
    assert answers.transactions.unanswered == 0
    assert answers.transactions.answered == every.transactions.answered
    assert summarize(capture, filter=compile_filter("request")).transactions == every.transactions


@settings(max_examples=40, deadline=None)
@given(
    st.lists(st.integers(0, 180), max_size=4),
    st.sampled_from(["response", "unit == 17", "late or retry or unanswered", "noise or exception", "value > 1000",
                     "severity >= warning", "time > 5 s", "register == 40108"]),
)  # fmt: skip
def test_what_passes_hangs_on_no_batch(cuts: list[int], text: str) -> None:
    """Rows, transactions and findings of a stream that comes in any pieces."""
    capture, one = _analysed()
    bounds = sorted({0, len(one.batch), *(min(cut, len(one.batch)) for cut in cuts)})
    pieces = [piece(one, capture, first, last) for first, last in pairwise(bounds)]
    once = list(filtered([one], compile_filter(text), capture.line))
    parts = list(filtered(pieces, compile_filter(text), capture.line))
    for name in ("start", "port", "index"):
        assert (
            np.concatenate([p.batch.rows.column(name) for p in parts]).tolist()
            == once[0].batch.rows.column(name).tolist()
        )
    settled = TransactionRows.joined([p.transactions for p in parts])
    assert sorted(settled.request.tolist()) == once[0].transactions.request.tolist()
    told = Findings.joined([p.findings for p in parts])
    assert sorted(told.start.tolist()) == [start for start in sorted(once[0].findings.start.tolist()) if start >= 0]


@cache
def _analysed() -> tuple[captures.Capture, Analysed]:
    capture = captures.open(TROUBLED)
    return capture, whole(capture)
