"""Drawn sessions of meters that close their frames with the CRC of Modbus and are none, each from what is published.

A kind of meter is a function of `METERS`: of a random source it draws a session as `foreign_talks` has them.
"""

from __future__ import annotations

from collections.abc import Mapping
from random import Random
from typing import Final

from foreign_talks import Make, Said, Talk

from dissectors.crc import crc_bytes


def _closed(*parts: bytes) -> bytes:
    body = b"".join(parts)
    return body + crc_bytes(body)


def _exchanged(random: Random, frames: list[bytes]) -> Talk:
    said = [Said(random.uniform(20, 60) if n % 2 else random.uniform(120, 400), each) for n, each in enumerate(frames)]
    return Talk(random.choice((2400, 9600, 19200)), said)


def mercury_206(random: Random) -> Talk:
    """Address of four bytes, command; the answer repeats both before its data."""
    address = random.randrange(10**6, 10**8).to_bytes(4, "big")
    data = {0x20: 4, 0x21: 7, 0x22: 2, 0x26: 2, 0x27: 16, 0x28: 6, 0x2F: 4, 0x63: 7}
    frames = []
    for command in random.choices(list(data), k=random.randrange(4, 12)):
        asked = address + bytes((command,))
        frames += [_closed(asked), _closed(asked, random.randbytes(data[command]))]
    return _exchanged(random, frames)


def mercury_230(random: Random) -> Talk:
    """Address, command, parameters; the answer is address and data alone."""
    unit = bytes((random.randrange(1, 240),))
    frames = [
        _closed(unit, b"\0"),
        _closed(unit, b"\0"),
        _closed(unit, b"\x01\x01", bytes([1]) * 6),
        _closed(unit, b"\0"),
    ]
    for _ in range(random.randrange(4, 12)):
        asked, size = random.choice(((b"\x05\x00\x00", 16), (b"\x08\x11\x11", 3), (b"\x08\x05", 2), (b"\x04\x00", 8)))
        frames += [_closed(unit, asked), _closed(unit, random.randbytes(size))]
    return _exchanged(random, frames)


def milur(random: Random) -> Talk:
    """Address, command, parameter; the answer repeats them before a length and the data."""
    unit = bytes((random.randrange(1, 255),))
    frames = [_closed(unit, b"\x08\x00", b"\xff" * 6), _closed(unit, b"\x08\x01")]
    for _ in range(random.randrange(4, 12)):
        parameter = bytes((1, random.choice((1, 2, 3, 4, 118))))
        frames += [_closed(unit, parameter), _closed(unit, parameter, b"\x04", random.randbytes(4))]
    return _exchanged(random, frames)


def pulsar(random: Random) -> Talk:
    """Address of eight digits, function, length of all, data, number of the request."""
    address = bytes(random.randrange(10) << 4 | random.randrange(10) for _ in range(4))
    frames = []
    for _ in range(random.randrange(3, 10)):
        number = random.randbytes(2)
        for data in (b"\x01\0\0\0", random.randbytes(random.choice((4, 8)))):
            frames.append(_closed(address, bytes((1, 10 + len(data))), data, number))
    return _exchanged(random, frames)


def meter_of_nobody(random: Random) -> Talk:
    """A meter that nobody has described: address, command, data; answers without a command."""
    unit = bytes((random.randrange(1, 240),))
    frames = []
    for _ in range(random.randrange(7, 16)):
        frames.append(_closed(unit, bytes((random.choice((0x33, 0x70, 0x05, 0x08, 0x01)),)), random.randbytes(2)))
        frames.append(_closed(unit, random.randbytes(random.randrange(1, 20))))
    return _exchanged(random, frames)


METERS: Final[Mapping[str, Make]] = {  # by what they are named
    "Mercury 200": mercury_206, "Mercury 230": mercury_230, "Milur": milur, "Pulsar": pulsar,
    "CRC of Modbus": meter_of_nobody,
}  # fmt: skip
