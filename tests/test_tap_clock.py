"""What a tap's times are worth is told from what the tap does, not from what befalls the line.

A log may write times to a second, or to a part of one: response times are no finer than that.
"""

from __future__ import annotations

import json
from dataclasses import replace
from datetime import datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from buses import adu
from running import ran

from analyzer.core import analyse
from analyzer.deframing.tap_clock import UNKNOWN, USUAL_NS, TapClock
from analyzer.tables.schema import Rows
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes, lrc

_LINE = LineSettings(baud=19200)
_MS = 1_000_000
_CHAR_NS = 11e9 / 19200
_REST_NS = 2_864_583  # five characters on the line
_REQUEST, _ANSWER = bytes.fromhex("0103006b0003"), bytes.fromhex("010306000100020003")


def _rows() -> Rows:
    """Requests and answers that come in two reads each, the later one up to 10 ms late."""
    chunks, now = [], 0
    for number in range(400):
        body = _REQUEST if number % 2 == 0 else _ANSWER
        adu = body + crc_bytes(body)
        now += 60 * _MS
        chunks += [Chunk(now, adu[:4]), Chunk(now + (5 + number % 6) * _MS, adu[4:])]
    batches = [part.batch.rows for part in analyse(Capture.of(_LINE, chunks))]
    rows = max(batches, key=len)
    assert len(rows) >= 200 and rows.check.all()
    return rows


@pytest.mark.parametrize("sound", [True, False])
def test_a_silence_inside_a_damaged_frame_is_not_the_taps(sound: bool) -> None:
    rows = _rows()
    struck = np.arange(len(rows)) % 10 == 3
    clock = TapClock(_LINE)
    clock.feed(
        replace(
            rows,
            check=rows.check & (sound | ~struck),
            gap_most_ns=np.where(struck, 400 * _MS, rows.gap_most_ns),
        )
    )
    clock.close()
    wait = clock.newest().wait_ns
    assert wait > 400 * _MS if sound else 5 * _MS < wait < 20 * _MS


@pytest.mark.parametrize(("late_ms", "told"), [(12.0, True), (0.3, False)])
def test_a_few_frames_in_two_reads_tell_how_late_any_may_be_if_they_come_as_late_as_whole_reads_do(
    late_ms: float, told: bool
) -> None:
    chunks, now = [], 0
    for number in range(1000):
        pair = b"".join(body + crc_bytes(body) for body in (_REQUEST, _ANSWER))
        now += 60 * _MS
        if number % 25:
            chunks.append(Chunk(now, pair))  # both at once: how late, nobody knows
        else:
            chunks += [Chunk(now, pair[:14]), Chunk(now + int(late_ms * _MS) + _REST_NS, pair[14:])]
    clock = TapClock(_LINE)
    for part in analyse(Capture.of(_LINE, chunks)):
        clock.feed(part.batch.rows)
    clock.close()
    wait = clock.newest().wait_ns
    assert late_ms * _MS <= wait < 2 * late_ms * _MS if told else wait == UNKNOWN


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
    assert "response  unknown: this tap's timestamps are too coarse" in ran(capsys, "report", path).out


@pytest.mark.parametrize(("late_ms", "exact"), [(0.0, True), (2.4, False)])
def test_ascii_frames_tell_what_a_tap_is_worth(late_ms: float, exact: bool) -> None:
    """Their senders may pause within a frame, so silences say nothing, but bytes cannot come before their time."""
    bodies = (bytes.fromhex(body) for body in ("1103006B0003", "110306AE4156524340"))
    ask, answer = (b":%s\r\n" % (body + bytes([lrc(body)])).hex().upper().encode() for body in bodies)
    each = 11 / 19200 * 1000 * _MS
    chunks, now = [], 0.0
    for number in range(80):
        for sent, pause in ((ask, 47 * _MS), (answer, 31 * _MS)):
            now += pause + len(sent) * each
            if exact:
                chunks.append(Chunk(int(now), sent))
            else:  # the first bytes are late now and then
                early = now - 5 * each
                chunks += [Chunk(int(early + number % 4 * late_ms / 3 * _MS), sent[:-5]), Chunk(int(now), sent[-5:])]
    capture = Capture.of(_LINE, sorted(chunks, key=lambda chunk: chunk.t_ns))
    answers = [frame for part in analyse(capture) for frame in part.batch.frames() if frame.request_start is not None]
    assert len(answers) == 80 and all(frame.protocol == "ascii" for frame in answers)
    for frame in answers:
        low, high = frame.response_time_bounds_ns or (0, 0)
        assert low <= 31 * _MS + each and high >= 31 * _MS - each
        assert (frame.response_time_ns is not None) == exact


def _with_glitches(count: int = 60) -> list[Chunk]:
    """Each frame in a read of its own, which begins with the byte that a driver makes when it is switched on."""
    chunks, now = [], 0.0
    for _ in range(count):
        for sent, pause in ((REQUEST, 47 * _MS), (b"\0" + ANSWER, 31 * _MS)):
            now += pause + len(sent) * _CHAR_NS
            chunks.append(Chunk(int(now), sent))
    return chunks


@pytest.mark.parametrize("rows", [1, 2, 3, 1000])
def test_a_byte_of_a_driver_before_a_frame_is_no_read_that_joins_frames(rows: int) -> None:
    batch = next(analyse(Capture.of(_LINE, _with_glitches()))).batch.rows
    clock = TapClock(_LINE)
    for first in range(0, len(batch), rows):  # however they come
        clock.feed(batch[first : first + rows])
    clock.close()
    assert clock.newest().wait_ns == USUAL_NS


def test_a_driver_that_is_switched_on_leaves_response_times_known() -> None:
    answers = [
        frame
        for part in analyse(Capture.of(_LINE, _with_glitches()))
        for frame in part.batch.frames()
        if frame.request_start is not None
    ]
    assert len(answers) == 60
    assert all(abs((frame.response_time_ns or 0) - 31 * _MS - _CHAR_NS) < 2 for frame in answers)
