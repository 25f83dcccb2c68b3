"""What the tap's times are worth is told from what the tap does, not from what befalls the line."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from analyzer.core import analyse
from analyzer.diagnosis.tap_clock import TapClock
from analyzer.tables.schema import Rows
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes

_LINE = LineSettings(baud=19200)
_MS = 1_000_000


def _rows() -> Rows:
    """Requests and answers that come in two reads each, the later one up to 10 ms late."""
    chunks, now = [], 0
    for number in range(400):
        body = bytes.fromhex("0103006b0003") if number % 2 == 0 else bytes.fromhex("010306000100020003")
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
