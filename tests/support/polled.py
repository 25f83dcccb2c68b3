"""A bus of two polls, of which one register moves."""

from __future__ import annotations

from collections.abc import Sequence

from analyzer.model.source import CaptureSource
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes


def moving(values: Sequence[int]) -> CaptureSource:
    """A poll of two registers every 100 ms, of which the second moves, and one of one register that stands still."""
    chunks, t_ns = [], 0
    for value in values:
        for ask, answer in (
            ("010300000002", bytes([1, 3, 4, 0, 7]) + value.to_bytes(2, "big")),
            ("020300090001", bytes([2, 3, 2, 0, 5])),
        ):
            for body, wait in ((bytes.fromhex(ask), 20_000_000), (answer, 30_000_000)):
                chunks.append(Chunk(t_ns, body + crc_bytes(body)))
                t_ns += wait
    return CaptureSource(Capture.of(LineSettings(19200), chunks, timed=True), "moving")
