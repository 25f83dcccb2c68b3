"""Times that a log writes to a second, or to a part of one: response times are no finer than that."""

from __future__ import annotations

import json
from datetime import datetime, timedelta
from pathlib import Path

import pytest
from buses import adu
from running import ran

REQUEST, ANSWER = adu("2B0300A0 0002"), adu("2B0304 00CE 1DFA")
TOOK = timedelta(milliseconds=31)


def log(path: Path, digits: int, polls: int = 40) -> Path:
    """Polls whose answers take 31 ms, their times cut after so many digits of a second."""
    t, lines = datetime(2026, 3, 1, 12, 0, 0, 412_000), []
    for _ in range(polls):
        for moment, word, data in ((t, "TX", REQUEST), (t + TOOK, "RX", ANSWER)):
            written = f"{moment:%H:%M:%S.%f}"[: 9 + digits].rstrip(".")
            lines.append(f"{written} {word}: {data.hex(' ')}")
        t += timedelta(milliseconds=1013)
    path.write_text("\n".join(lines), encoding="utf-8")
    return path


@pytest.mark.parametrize(("digits", "least", "most"), [(0, 0, 1000), (1, 0, 200), (2, 20, 50)])
def test_response_times_are_no_finer_than_the_times(
    capsys: pytest.CaptureFixture[str], tmp_path: Path, digits: int, least: int, most: int
) -> None:
    times = json.loads(ran(capsys, "report", "--json", log(tmp_path / "log.txt", digits)).out)["times"]
    assert times["p50_ns"] is None
    low, high = times["p50_low_ns"], times["p50_high_ns"]
    assert least * 10**6 <= low <= 31 * 10**6 <= high <= most * 10**6


def test_milliseconds_are_exact_where_they_are_few_of_many(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    times = json.loads(ran(capsys, "report", "--json", log(tmp_path / "log.txt", 3)).out)["times"]
    assert times["p50_ns"] == 31 * 10**6


def test_frames_that_share_a_millisecond_tell_no_response_times(
    capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    """A poll and its answer in one entry: the one time is that of either, or of neither."""
    path = tmp_path / "log.jsonl"
    lines = [
        json.dumps({"ts": (1_760_000_000_123 + 1013 * i) / 1000, "request": REQUEST.hex(), "response": ANSWER.hex()})
        for i in range(40)
    ]
    path.write_text("\n".join(lines), encoding="utf-8")
    assert "response  unknown: this tap's times cannot tell them" in ran(capsys, "report", path).out
