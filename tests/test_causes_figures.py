"""The figures of causes are those of the rows: whoever reads a cause finds its numbers in the tables beside it."""

from __future__ import annotations

import re

import pytest

from analyzer.causes.registry import Cause, suspects
from analyzer.reports.model import Report
from analyzer.reports.summary import summarize
from analyzer.simulation.field.cases.registry import field_cases
from captures.chunks import Capture

_CASES = ("dead-unit", "unit-restarts", "unit-busy", "retry-policy", "missing-registers", "deaf-to-some", "unit-fails",
          "gateway-unit-gone", "unit-0-asked", "cut-at-length", "crc-convention", "tap-loses", "bias-beside-dead",
          "unknown-function", "healthy-asleep")  # fmt: skip
_REQUESTS = re.compile(r"(\d+) of (\d+)(?: such)? requests to (?:unit (\d+)|it\b)")


def _reported(name: str) -> Report:
    made = field_cases()[name].capture("precise", 6)
    return summarize(Capture.of(made.line, made.chunks))


def _holds(cause: Cause, report: Report) -> list[str]:
    """Figures of a cause that its rows cannot carry."""
    wrong = []
    rows = {row.unit: row for row in report.units}
    for part, whole, unit in _REQUESTS.findall(f"{cause.text} {cause.share}"):
        row = rows.get(int(unit) if unit else cause.units[0])
        if row is None or int(part) > int(whole) or int(whole) > row.counts.requests:
            wrong.append(f"{part} of {whole}: {row}")
    if cause.lost_answers is not None and cause.lost_answers > report.transactions.requests:
        wrong.append(f"{cause.lost_answers} answers lost")
    if cause.lost_ms is not None and report.span_ns is not None and cause.lost_ms > report.span_ns / 1e6:
        wrong.append(f"{cause.lost_ms} ms lost")
    return wrong


@pytest.mark.parametrize("name", _CASES)
def test_no_cause_counts_more_than_its_rows(name: str) -> None:
    report = _reported(name)
    assert report.causes
    assert [wrong for cause in report.causes for wrong in _holds(cause, report)] == []


@pytest.mark.parametrize("name", _CASES[:6])
def test_silent_requests_of_a_unit_are_those_of_its_card(name: str) -> None:
    report = _reported(name)
    cards = {card.unit: card for card in report.cards}
    for cause in report.causes:
        silent = cause.numbers.get("silent")
        if silent is not None and len(cause.units) == 1:
            card = cards[cause.units[0]]
            assert silent <= card.silent + card.garbage


def test_silences_are_told_in_time_as_they_are_due() -> None:
    """Above 19200 bit/s 1.75 ms are due, whatever that is in characters."""
    texts = [suspect.text for suspect in suspects() if suspect.cause in ("master-too-fast", "unit-too-fast")]
    assert len(texts) == 2
    assert all("{gap:ms}" in text and "{due:ms}" in text for text in texts)
