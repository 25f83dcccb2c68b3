"""Servers on the bus: what each unit holds and how it answers a request.

A unit has a register map that begins at an address of its own, words that look like what meters and drives hold (zeros,
small counts, -1, halves of floats, letters) and that drift a little from read to read. Answers are PDUs, assembled byte
by byte: this file says what a plausible device does, the dissectors say what the bytes mean.
"""

# ruff: noqa: ARG001 - one signature serves every answer

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from random import Random

MAP_BASES = (0, 100, 0x100, 1000, 0x1000, 30000)
MAP_LENGTH = 60  # starting addresses that a client polls; quantities may reach past them

_SERVER_IDS = (
    b"\x01\xff",
    b"\x21\xffNL-16DI",
    b"ELP SU Control (i) 2010 Elim Ltd.",
)
_OBJECTS = (b"RealLab", b"NL-16DI")
_DRIFT = 0.22  # of words, from one read to the next
_EXCEPTIONS = (1, 2, 2, 3, 4, 6)
_COUNTERS = range(0x0B, 0x10)  # subfunctions of diagnostics that return a counter


@dataclass(slots=True)
class Device:
    """One server: its unit, where its map begins, how fast it answers (ns, typically), and what it holds."""

    unit: int
    base: int
    response_ns: float
    server_id: bytes
    words: dict[int, int] = field(default_factory=dict)
    events: int = 0

    def read_words(self, random: Random, address: int, quantity: int) -> bytes:
        """Words from `address` on, drifting as they are read."""
        words = self.words
        out = []
        for register in range(address, address + quantity):
            value = words.get(register)
            if value is None:
                value = _word(random, words.get(register - 1, 0))
            elif random.random() < _DRIFT:
                value = (value + random.choice((-1, 1))) & 0xFFFF
            words[register] = value
            out.append(value)
        return struct.pack(f">{quantity}H", *out)

    def answer(self, random: Random, pdu: bytes) -> bytes:
        """The response PDU to a request PDU with a function code that this file knows."""
        return _ANSWERS[pdu[0]](self, random, pdu)


def exception(random: Random, function: int) -> bytes:
    """An exception response PDU."""
    return bytes((function | 0x80, random.choice(_EXCEPTIONS)))


def make_devices(random: Random, count: int) -> list[Device]:
    """`count` servers with units of their own."""
    return [
        Device(unit, random.choice(MAP_BASES), random.uniform(2.5e6, 31e6), random.choice(_SERVER_IDS))
        for unit in random.sample(range(1, 40), min(count, 39))
    ]


def _word(random: Random, before: int) -> int:
    if before >> 8 in (0x42, 0x43, 0xC2, 0xC3) and random.random() < 0.2:
        return random.getrandbits(16)  # the low half of a float
    kind = random.random()
    if kind < 0.2:
        return 0
    if kind < 0.53:
        return random.randrange(400)
    if kind < 0.635:
        return 0xFFFF
    if kind < 0.725:
        return int.from_bytes(struct.pack(">f", random.uniform(-400, 400))[:2], "big")
    if kind < 0.86:
        return random.randrange(0x20, 0x7B) << 8 | random.randrange(0x20, 0x7B)
    return random.getrandbits(16)


def _u16(pdu: bytes, at: int) -> int:
    return pdu[at] << 8 | pdu[at + 1]


def _read_bits(device: Device, random: Random, pdu: bytes) -> bytes:
    quantity = _u16(pdu, 3)
    bits = bytearray(random.choice((0, 0, 0xFF, 0xFF, random.getrandbits(8))) for _ in range((quantity + 7) // 8))
    if quantity & 7:
        bits[-1] &= (1 << (quantity & 7)) - 1
    return bytes((pdu[0], len(bits))) + bits


def _read_words(device: Device, random: Random, pdu: bytes) -> bytes:
    words = device.read_words(random, _u16(pdu, 1), _u16(pdu, 3))
    return bytes((pdu[0], len(words))) + words


def _read_write(device: Device, random: Random, pdu: bytes) -> bytes:
    return _read_words(device, random, pdu)


def _echo(device: Device, random: Random, pdu: bytes) -> bytes:
    return pdu


def _written(device: Device, random: Random, pdu: bytes) -> bytes:
    return pdu[:5]


def _status(device: Device, random: Random, pdu: bytes) -> bytes:
    return bytes((pdu[0], random.getrandbits(8)))


def _diagnostics(device: Device, random: Random, pdu: bytes) -> bytes:
    if _u16(pdu, 1) in _COUNTERS:
        return pdu[:3] + random.randrange(300).to_bytes(2, "big")
    return pdu


def _event_counter(device: Device, random: Random, pdu: bytes) -> bytes:
    return bytes((pdu[0], 0, 0)) + random.randrange(1600).to_bytes(2, "big")


def _event_log(device: Device, random: Random, pdu: bytes) -> bytes:
    events = random.randbytes(random.randrange(12))
    head = bytes((0, 0)) + random.randrange(1000).to_bytes(2, "big") + random.randrange(1000).to_bytes(2, "big")
    return bytes((pdu[0], len(head) + len(events))) + head + events


def _server_id(device: Device, random: Random, pdu: bytes) -> bytes:
    return bytes((pdu[0], len(device.server_id))) + device.server_id


def _read_files(device: Device, random: Random, pdu: bytes) -> bytes:
    groups = b""
    for at in range(2, len(pdu), 7):
        record = random.randbytes(2 * _u16(pdu, at + 5))
        groups += bytes((len(record) + 1, 6)) + record
    return bytes((pdu[0], len(groups))) + groups


def _read_fifo(device: Device, random: Random, pdu: bytes) -> bytes:
    count = random.randrange(10)
    words = device.read_words(random, _u16(pdu, 1), count)
    return pdu[:1] + struct.pack(">HH", 2 * count + 2, count) + words


def _identification(device: Device, random: Random, pdu: bytes) -> bytes:
    objects = (*_OBJECTS, f"V1.{random.randrange(100)}".encode())
    listed = b"".join(bytes((number, len(text))) + text for number, text in enumerate(objects))
    return pdu[:3] + bytes((1, 0, 0, len(objects))) + listed


def _vendor(device: Device, random: Random, pdu: bytes) -> bytes:
    return pdu[:1] + random.randbytes(random.randint(1, 29))


VENDOR = 0x41

_ANSWERS = {
    0x01: _read_bits,
    0x02: _read_bits,
    0x03: _read_words,
    0x04: _read_words,
    0x05: _echo,
    0x06: _echo,
    0x07: _status,
    0x08: _diagnostics,
    0x0B: _event_counter,
    0x0C: _event_log,
    0x0F: _written,
    0x10: _written,
    0x11: _server_id,
    0x14: _read_files,
    0x15: _echo,
    0x16: _echo,
    0x17: _read_write,
    0x18: _read_fifo,
    0x2B: _identification,
    VENDOR: _vendor,
}
