"""Check values: CRC-16 of RTU and LRC of ASCII.

CRC-16/MODBUS [2] 6.2.2: polynomial 8005 reflected (A001), initial value FFFF, sent least significant byte first.
LRC [2] 6.2.1: two's complement of the sum of the bytes. Pure Python, for one frame; whole captures are checked in
columns elsewhere, from the same `CRC_TABLE`.
"""

from __future__ import annotations

from typing import Final

from .adu import MIN_ADU


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
    return len(adu) >= MIN_ADU and crc16(adu) == 0


def crc_ends(data: bytes, start: int, most: int) -> list[int]:
    """Where RTU ADUs with a right CRC that begin at `start` and are of at most `most` bytes end, in order."""
    crc, ends = 0xFFFF, []
    table = CRC_TABLE
    for end, byte in enumerate(data[start : start + most], start + 1):
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xFF]
        if not crc and end - start >= MIN_ADU:
            ends.append(end)
    return ends


def lrc(data: bytes) -> int:
    """LRC of the decoded bytes (unit to the end of the PDU)."""
    return -sum(data) & 0xFF


# What a wrong CRC tells: the algebra of CRC-16/MODBUS, solved for the byte or the bit that is to blame.
#
# Theory. The CRC register is linear over GF(2). The residue of a frame with a flipped bit (its CRC with the check
# value taken along; 0 for a right frame) hangs only on how far that bit stands from the end, and differs for each of
# 32,767 bits: so a residue names its bit. Each step of the register can be undone, so the register that must stand
# before any byte for the frame to end in 0 is known as well, and the one byte that leads from one register to another,
# if any does.


INIT: Final = 0xFFFF
_LONGEST: Final = 0x7FFF // 8  # bytes: from there on two bits share a residue
_BYTE_OF: Final = {entry >> 8: byte for byte, entry in enumerate(CRC_TABLE)}  # all upper halves differ
_syndromes: Final[dict[int, int]] = {}  # residue: distance of the bit from the end, in bits; grown as frames need it


def flipped_bit(residue: int, length: int) -> tuple[int, int] | None:
    """The byte and the bit (0 the least significant) whose flipping makes this residue in a frame of `length` bytes.

    None where no single bit does. `residue` is `crc16` of the whole frame.
    """
    if length > _LONGEST:
        raise ValueError(f"{length} bytes: beyond {_LONGEST} a residue names several bits")
    if len(_syndromes) < 8 * length:
        _grow(length)
    distance = _syndromes.get(residue)
    if distance is None or distance >= 8 * length:
        return None
    return length - 1 - distance // 8, distance % 8


def _grow(length: int) -> None:
    _syndromes.clear()
    effects = [CRC_TABLE[1 << bit] for bit in range(8)]
    for byte in range(length):
        for bit, effect in enumerate(effects):
            _syndromes[effect] = 8 * byte + bit
        effects = [effect >> 8 ^ CRC_TABLE[effect & 0xFF] for effect in effects]


def registers(data: bytes, init: int = INIT) -> list[int]:
    """The register before each byte, and after the last (one more than there are bytes)."""
    states = [init]
    for byte in data:
        init = init >> 8 ^ CRC_TABLE[(init ^ byte) & 0xFF]
        states.append(init)
    return states


def needed(data: bytes) -> list[int]:
    """The register that would have to stand before each byte, and after the last, for the whole to end in 0."""
    register = 0
    states = [register]
    for byte in reversed(data):
        index = _BYTE_OF[register >> 8]
        register = (register ^ CRC_TABLE[index]) << 8 & 0xFF00 | index ^ byte
        states.append(register)
    states.reverse()
    return states


def stepped(register: int, byte: int) -> int:
    """The register after one more byte."""
    return register >> 8 ^ CRC_TABLE[(register ^ byte) & 0xFF]


def byte_between(before: int, after: int) -> int | None:
    """The one byte that takes the register from `before` to `after`; None where none does."""
    index = _BYTE_OF[after >> 8]
    return (index ^ before) & 0xFF if before >> 8 ^ CRC_TABLE[index] == after else None
