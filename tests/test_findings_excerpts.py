"""A few lines of a log: nothing is said of what is not among them, and what is harmless is said first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import pytest

import captures
from analyzer.paste import read
from analyzer.reports.model import Report
from analyzer.reports.page import text
from analyzer.reports.summary import summarize
from dissectors.crc import crc_bytes

ENVELOPE = bytes.fromhex("b71a0044"), bytes.fromhex("5e19")


def adu(body: str) -> bytes:
    data = bytes.fromhex(body)
    return data + crc_bytes(data)


ASKED, ANSWER = adu("090300100002"), adu("090304000a0014")


def reported(folder: Path, lines: Sequence[str]) -> Report:
    path = folder / "bus.log"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return summarize(captures.open(path))


def told(report: Report) -> dict[str, int]:
    return {row.code: row.count for row in report.findings}


def parsed(lines: Sequence[str]) -> set[str]:
    return {finding.code for frame in read("\n".join(lines)).frames() for finding in frame.findings}


@pytest.mark.parametrize(
    ("heard", "other"), [(ASKED, None), (ASKED[:-1], 1), (ASKED[:5] + b"\x13" + ASKED[6:], 1)], ids=str
)
def test_what_is_received_as_it_was_sent_is_an_echo(tmp_path: Path, heard: bytes, other: int | None) -> None:
    lines = [f"TX: {ASKED.hex(' ')}", f"RX: {heard.hex(' ')}"]
    report = reported(tmp_path, lines)
    assert told(report) == {"echo": 1} and parsed(lines) == {"echo"}
    assert (f"but for {other} of its 8 bytes" in report.findings[0].text) == (other is not None)
    assert "local echo" in text(report)


def test_a_damaged_answer_that_is_like_its_request_is_no_echo(tmp_path: Path) -> None:
    write = adu("0906001000ff")
    assert "echo" not in told(reported(tmp_path, [f"TX: {write.hex(' ')}", f"RX: {write[:-1].hex(' ')}"]))


def test_without_marks_a_request_that_comes_again_is_no_echo(tmp_path: Path) -> None:
    assert not told(reported(tmp_path, [ASKED.hex(" ")] * 2))


def test_a_line_end_behind_frames_is_named(tmp_path: Path) -> None:
    asked = [adu(f"0903001{i}0002") + b"\r\n" for i in range(4)]
    report = reported(tmp_path, [f"TX: {each.hex(' ')}" for each in asked])
    assert told(report) == {"noise": 4} and "newline" in report.findings[0].text
    assert not report.causes


def test_an_envelope_round_frames_is_no_second_sender(tmp_path: Path) -> None:
    lines = [f"TX: {b.join(ENVELOPE).hex(' ')}" for b in (ASKED,)] + [f"RX: {ANSWER.join(ENVELOPE).hex(' ')}"]
    report = reported(tmp_path, lines)
    assert set(told(report)) == {"noise"} and "envelope" in report.findings[0].cause
    assert not report.findings[0].lost_answers


@pytest.mark.parametrize("stamp", ["", "12:00:0{}.250 "])
def test_requests_alone_say_nothing_of_silence(tmp_path: Path, stamp: str) -> None:
    lines = [f"{stamp.format(i)}Processing: {adu(f'0903001{i}0002').hex(' ')}" for i in range(3)]
    report = reported(tmp_path, lines)
    assert not told(report) and "3 without an answer here" in text(report)
    assert not parsed(lines)


def test_requests_that_come_again_and_again_got_no_answer(tmp_path: Path) -> None:
    lines = [f"12:00:0{i}.250 Processing: {ASKED.hex(' ')}" for i in range(4)]
    assert told(reported(tmp_path, lines))["no-response"] == 3 and "no-response" in parsed(lines)


def test_silence_among_answers_is_told(tmp_path: Path) -> None:
    lines = [f"TX: {ASKED.hex(' ')}"] * 2 + [f"RX: {ANSWER.hex(' ')}"]
    assert told(reported(tmp_path, lines)) == {"no-response": 1, "retry": 1}


@pytest.mark.parametrize(("behind", "lost"), [([f"RX: {ANSWER.hex(' ')}"], 0), ([], 1)])
def test_of_a_damaged_request_that_is_answered_no_answer_is_lost(
    tmp_path: Path, behind: Sequence[str], lost: int
) -> None:
    damaged = ASKED[:-1] + bytes([ASKED[-1] ^ 8])
    report = reported(tmp_path, [f"TX: {damaged.hex(' ')}", *behind])
    assert [(row.code, row.lost_answers) for row in report.findings] == [("bit-flip", lost)]


def test_a_few_frames_fill_no_tables_and_give_no_percentiles(tmp_path: Path) -> None:
    page = text(reported(tmp_path, [f"12:00:00.100 TX: {ASKED.hex(' ')}", f"12:00:00.125 RX: {ANSWER.hex(' ')}"]))
    assert "p95" not in page and "silent" not in page and "min 25 ms, max 25 ms" in page


def test_a_long_log_is_told_like_any_capture(tmp_path: Path) -> None:
    lines = [f"12:00:{i:02}.{n}00 {who}: {data.hex(' ')}" for i in range(40)
             for n, who, data in ((1, "TX", ASKED), (2, "RX", ANSWER))]  # fmt: skip
    page = text(reported(tmp_path, [*lines, f"12:00:41.100 TX: {ASKED.hex(' ')}"]))
    assert "p95" in page and "1 not heard" in page
