"""Check values: CRC-16 of RTU and LRC of ASCII.

CRC-16/MODBUS [2] 6.2.2: polynomial 8005 reflected (A001), initial value FFFF, sent least significant byte first.
LRC [2] 6.2.1: two's complement of the sum of the bytes. Pure Python, for one frame; whole captures are checked in
columns elsewhere, from the same `CRC_TABLE`.
"""

from __future__ import annotations

from typing import Final


def _entry(byte: int) -> int:
    for _ in range(8):
        byte = (byte >> 1) ^ 0xA001 if byte & 1 else byte >> 1
    return byte


CRC_TABLE: Final[tuple[int, ...]] = tuple(_entry(byte) for byte in range(256))


def crc16(data: bytes, init: int = 0xFFFF) -> int:
    """CRC-16/MODBUS of `data`; 0 for an ADU that includes its own CRC. `init` carries on from earlier bytes."""
    crc = init
    table = CRC_TABLE
    for byte in data:
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xFF]
    return crc


def crc_bytes(data: bytes) -> bytes:
    """The two bytes to send after `data`, least significant first."""
    return crc16(data).to_bytes(2, "little")


def crc_ok(adu: bytes) -> bool:
    """Whether an RTU ADU (unit to CRC) is long enough to be one and ends in the right CRC."""
    return len(adu) >= 4 and crc16(adu) == 0


def lrc(data: bytes) -> int:
    """LRC of the decoded bytes (unit to the end of the PDU)."""
    return -sum(data) & 0xFF
