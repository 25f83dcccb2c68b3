"""Check values: CRC-16 of RTU, LRC of ASCII, and other 16-bit ones that firmware sends in their place.

CRC-16/MODBUS [2] 6.2.2: polynomial 8005 reflected (A001), initial value FFFF, sent least significant byte first.
LRC [2] 6.2.1: two's complement of the sum of the bytes. Pure Python, for one frame; whole captures are checked in
columns elsewhere, from the same `CRC_TABLE`.

The others are of a firmware whose author took another CRC, or sent the right one the wrong way round. Parameters as in
the catalogue of parametrised CRC algorithms (reveng): polynomial, initial value, whether bits go in and come out least
significant first, and what is added at the end. Each is held to its catalogued check value, the one of the text
123456789, by the tests. Sums stand beside them, for devices that were never taught a CRC.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, lru_cache
from itertools import groupby
from typing import Final, Literal

from .limits import MIN_ADU


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


Order = Literal["little", "big"]


@dataclass(frozen=True, slots=True)
class Algorithm:
    """A CRC-16; `reflected` says that bits go in and come out least significant first. `check`: of 123456789."""

    name: str
    polynomial: int
    init: int
    reflected: bool
    xorout: int
    check: int

    def __call__(self, data: bytes) -> int:
        # A CRC is linear: what the initial value leaves behind hangs on the length alone, the rest on the bytes alone.
        left = _left_of(self.init, self.polynomial, self.reflected, len(data))
        return _remainder(self.polynomial, self.reflected, data) ^ left ^ self.xorout


@dataclass(frozen=True, slots=True)
class Sum:
    """The bytes added up; `negated` is the two's complement of it, as in the LRC of ASCII mode, 16 bits wide."""

    name: str
    negated: bool
    check: int

    def __call__(self, data: bytes) -> int:
        return (-sum(data) if self.negated else sum(data)) & 0xFFFF


@dataclass(frozen=True, slots=True)
class CrcVariant:
    """A convention for the last two bytes of a frame: how they are made, over which bytes, which of them goes first.

    `skipped` is how many of a frame's first bytes are left out: 1 where somebody forgot the unit.
    """

    algorithm: Algorithm | Sum
    order: Order
    skipped: int = 0

    @property
    def name(self) -> str:
        """The convention for people: `CRC-16/ARC, most significant byte first`."""
        order = "least" if self.order == "little" else "most"
        without = " without the unit" if self.skipped else ""
        return f"{self.algorithm.name}{without}, {order} significant byte first"

    def made(self, frame: bytes) -> bytes:
        """The two bytes that this convention sends after a frame's first bytes (unit to the end of the PDU)."""
        return self.algorithm(frame[self.skipped :]).to_bytes(2, self.order)


_MODBUS: Final = Algorithm("CRC-16/MODBUS", 0x8005, 0xFFFF, True, 0, 0x4B37)

ALGORITHMS: Final[tuple[Algorithm | Sum, ...]] = (
    Algorithm("CRC-16/ARC", 0x8005, 0x0000, True, 0x0000, 0xBB3D),
    Algorithm("CRC-16/USB", 0x8005, 0xFFFF, True, 0xFFFF, 0xB4C8),
    Algorithm("CRC-16/MAXIM-DOW", 0x8005, 0x0000, True, 0xFFFF, 0x44C2),
    Algorithm("CRC-16/UMTS", 0x8005, 0x0000, False, 0x0000, 0xFEE8),
    Algorithm("CRC-16/CMS", 0x8005, 0xFFFF, False, 0x0000, 0xAEE7),
    Algorithm("CRC-16/DDS-110", 0x8005, 0x800D, False, 0x0000, 0x9ECF),
    Algorithm("CRC-16/CCITT-FALSE", 0x1021, 0xFFFF, False, 0x0000, 0x29B1),
    Algorithm("CRC-16/XMODEM", 0x1021, 0x0000, False, 0x0000, 0x31C3),
    Algorithm("CRC-16/KERMIT", 0x1021, 0x0000, True, 0x0000, 0x2189),
    Algorithm("CRC-16/X-25", 0x1021, 0xFFFF, True, 0xFFFF, 0x906E),
    Algorithm("CRC-16/MCRF4XX", 0x1021, 0xFFFF, True, 0x0000, 0x6F91),
    Algorithm("CRC-16/GENIBUS", 0x1021, 0xFFFF, False, 0xFFFF, 0xD64E),
    Algorithm("CRC-16/GSM", 0x1021, 0x0000, False, 0xFFFF, 0xCE3C),
    Algorithm("CRC-16/AUG-CCITT", 0x1021, 0x1D0F, False, 0x0000, 0xE5CC),
    Algorithm("CRC-16/DNP", 0x3D65, 0x0000, True, 0xFFFF, 0xEA82),
    Algorithm("CRC-16/EN-13757", 0x3D65, 0x0000, False, 0xFFFF, 0xC2B7),
    Algorithm("CRC-16/PROFIBUS", 0x1DCF, 0xFFFF, False, 0xFFFF, 0xA819),
    Sum("sum of the bytes", False, 0x01DD),
    Sum("negated sum of the bytes", True, 0xFE23),
)

VARIANTS: Final[tuple[CrcVariant, ...]] = (
    CrcVariant(_MODBUS, "big"),
    *(CrcVariant(algorithm, order) for algorithm in ALGORITHMS for order in ("little", "big")),
    CrcVariant(_MODBUS, "little", skipped=1),
    CrcVariant(_MODBUS, "big", skipped=1),
)


_ALIKE: Final = tuple((made, tuple(alike)) for made, alike in groupby(VARIANTS, lambda v: (v.algorithm, v.skipped)))


def matching(frame: bytes) -> Iterator[CrcVariant]:
    """The conventions by which the last two bytes of a frame are right; the usual one is not among them."""
    if len(frame) < 4:
        return
    body, sent = frame[:-2], frame[-2:]
    for (algorithm, skipped), alike in _ALIKE:
        value = algorithm(body[skipped:])
        for variant in alike:
            if value == int.from_bytes(sent, variant.order):
                yield variant


@lru_cache(maxsize=64)
def _remainder(polynomial: int, reflected: bool, data: bytes, crc: int = 0) -> int:
    """The register behind some bytes, from 0: the same for all algorithms of one polynomial and direction."""
    table = _table(polynomial, reflected)
    if reflected:
        for byte in data:
            crc = crc >> 8 ^ table[(crc ^ byte) & 0xFF]
    else:
        for byte in data:
            crc = (crc << 8 & 0xFFFF) ^ table[crc >> 8 ^ byte]
    return crc


@lru_cache(maxsize=1 << 13)
def _left_of(init: int, polynomial: int, reflected: bool, length: int) -> int:
    """What an initial value leaves in the register behind so many bytes."""
    return _remainder.__wrapped__(polynomial, reflected, bytes(length), init) if init else 0


@cache
def _table(polynomial: int, reflected: bool) -> tuple[int, ...]:
    if reflected:
        mirrored = int(f"{polynomial:016b}"[::-1], 2)
        return tuple(_reflected_entry(mirrored, byte) for byte in range(256))
    return tuple(_variant_entry(polynomial, byte) for byte in range(256))


def _reflected_entry(mirrored: int, byte: int) -> int:
    for _ in range(8):
        byte = byte >> 1 ^ mirrored if byte & 1 else byte >> 1
    return byte


def _variant_entry(polynomial: int, byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ polynomial if crc & 0x8000 else crc << 1) & 0xFFFF
    return crc
