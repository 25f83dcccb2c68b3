"""A meter that is polled: one float, as often as wanted."""

from __future__ import annotations

import struct
from pathlib import Path

import captures
from captures.chunks import Capture, Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes


def write_meter(path: Path, values: list[float]) -> None:
    """One unit's holding registers 0 and 1, a float, polled once a second."""
    chunks = []
    for i, value in enumerate(values):
        for at, frame in ((0, bytes.fromhex("010300000002")), (20, b"\x01\x03\x04" + struct.pack(">f", value))):
            chunks.append(Chunk(1_780_000_000_000_000_000 + i * 10**9 + at * 10**6, frame + crc_bytes(frame)))
    captures.write(path, Capture.of(LineSettings(baud=19200, char_bits=10), chunks))
