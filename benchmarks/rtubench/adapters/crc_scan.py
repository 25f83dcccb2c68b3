"""A CRC scanner: from each byte on, the shortest stretch of 4 to 256 bytes whose last two check it is a frame."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rtubench.adapters.speaking import Row, frame, given, speak

_TABLE = []
for _value in range(256):
    for _ in range(8):
        _value = _value >> 1 ^ (0xA001 if _value & 1 else 0)
    _TABLE.append(_value)


def about() -> Row:
    return {"tool": "CRC scanner", "version": "1", "input": "reads", "claims": ["frames"]}


def _frames(data: bytes) -> Iterator[tuple[int, int]]:
    at = 0
    while at < len(data) - 3:
        crc = 0xFFFF
        for length, byte in enumerate(data[at : at + 256], 1):
            crc = crc >> 8 ^ _TABLE[(crc ^ byte) & 0xFF]
            if not crc and length >= 4:
                yield at, length
                at += length
                break
        else:
            at += 1


def bus(path: Path) -> Iterator[Row]:
    for start, length in _frames(b"".join(data for _, data in given(path).reads)):
        yield frame(start, length, True)


if __name__ == "__main__":
    sys.exit(speak(about, {"bus": bus}))
