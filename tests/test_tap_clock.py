"""What the tap's times are worth is told from what the tap does, not from what befalls the line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analyzer.core import analyse
from analyzer.diagnosis.tap_clock import UNKNOWN, TapClock
from analyzer.tables.schema import Rows
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

_LINE = LineSettings(baud=19200)
_MS = 1_000_000
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
