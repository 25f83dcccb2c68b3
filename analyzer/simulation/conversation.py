"""What a client asks: one exchange after the other, ADUs complete with their CRC.

A client polls its servers in no particular order: mostly registers in small blocks, sometimes long ones, now and then a
write, and, where it knows them, every other public function. Nothing here knows of time or faults.

Some payloads are made to fool a CRC scan: register values that hold a right CRC where no frame ends. The running CRC of
any prefix can be steered by two bytes of payload, so a response can look complete too early; and registers may well
hold frames of other units, alone or as a request with its answer (gateways and loggers keep such).
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass
from random import Random
from typing import Protocol

from dissectors.crc import crc_bytes

from .devices import MAP_LENGTH, VENDOR, Device, exception, make_devices

_HEAD = 3  # unit, function, byte count
_REQUEST_LENGTH = 8  # of the commonest requests: a prefix of that length is the most tempting
_ADDRESSES = 100
_MOST_ASKED = 18


def hostile(random: Random, unit: int, answer: bytes, units: Sequence[int]) -> bytes:
    """A response PDU to a register read, as long as the PDU `answer`, with a payload that fools; merely random bytes
    where the trick drawn needs more of them. `units` are those on the bus."""
    head = bytes((unit,)) + answer[:2]
    payload = random.randbytes(len(answer) - 2)
    trick = random.randrange(4)
    if trick == 0 and len(payload) > _REQUEST_LENGTH - _HEAD:
        payload = _complete_at(_REQUEST_LENGTH, head, payload)
    elif trick == 1 and len(payload) >= 4:
        # Where the prefix ends with the payload, the frame's own CRC is 0000.
        payload = _complete_at(random.randint(_HEAD + 2, _HEAD + len(payload)), head, payload)
    elif trick == 2:
        payload = _holding(_request(random, random.choice(units)), random, payload)
    elif trick == 3:
        payload = _holding(_exchange(random, random.choice(units)), random, payload)
    return answer[:2] + payload


def _complete_at(length: int, head: bytes, payload: bytes) -> bytes:
    """`payload` with the two bytes that make the frame's first `length` bytes end in their own CRC."""
    at = length - _HEAD - 2
    return payload[:at] + crc_bytes(head + payload[:at]) + payload[at + 2 :]


def _holding(frames: bytes, random: Random, payload: bytes) -> bytes:
    """`payload` with whole frames somewhere in it, where they fit."""
    if len(frames) > len(payload):
        return payload
    at = random.randint(0, len(payload) - len(frames))
    return payload[:at] + frames + payload[at + len(frames) :]


def _request(random: Random, unit: int) -> bytes:
    address, quantity = random.randrange(_ADDRESSES), random.randint(1, _MOST_ASKED)
    return _closed(struct.pack(">BBHH", unit, random.choice((1, 3, 4)), address, quantity))


def _exchange(random: Random, unit: int) -> bytes:
    request = struct.pack(">BBHH", unit, 3, random.randrange(_ADDRESSES), 1)
    return _closed(request) + _closed(bytes((unit, 3, 2)) + random.randbytes(2))


def _closed(body: bytes) -> bytes:
    return body + crc_bytes(body)


# ruff: noqa: ARG001 - one signature serves every request


_COMMON = {3: 4, 4: 2, 16: 2, 1: 1, 2: 1, 5: 1, 6: 1, 15: 1}
_PUBLIC = _COMMON | dict.fromkeys((7, 8, 11, 12, 17, 20, 21, 22, 23, 24, 43), 1)
_BROADCASTABLE = (5, 6, 15, 16)


@dataclass(frozen=True, slots=True)
class Exchange:
    """A request, what its server would answer (None to a broadcast), and how fast (ns, typically)."""

    request: bytes
    response: bytes | None
    response_ns: float


@dataclass(frozen=True, slots=True)
class Habits:
    """What kind of conversation: all public functions or the common ones only, the weight of the vendor function, the
    share of register reads with a payload that fools a CRC scan, and the shares of broadcasts and of exceptions."""

    public: bool
    vendor: int
    hostile: float
    broadcasts: float
    exceptions: float = 0.033


class Asking(Protocol):
    """Who makes requests: `exchange` gives the next one with the answer it would get."""

    def exchange(self) -> Exchange: ...


class Client:
    """The one that asks; `exchange` gives its next request with the answer it would get."""

    def __init__(self, random: Random, habits: Habits, units: int) -> None:
        self._random = random
        self._habits = habits
        self.devices = make_devices(random, units)
        functions = dict(_PUBLIC if habits.public else _COMMON)
        if habits.vendor:
            functions[VENDOR] = habits.vendor
        self._functions = [code for code, weight in functions.items() for _ in range(weight)]

    def by(self, random: Random) -> Client:
        """The same client of the same devices, whose next requests come from another source of chance."""
        other = copy(self)
        other._random = random
        return other

    def exchange(self) -> Exchange:
        random = self._random
        device = random.choice(self.devices)
        if random.random() < self._habits.broadcasts:
            pdu = _REQUESTS[random.choice(_BROADCASTABLE)](device, random)
            return Exchange(adu(0, pdu), None, device.response_ns)
        function = random.choice(self._functions)
        pdu = _REQUESTS[function](device, random)
        if random.random() < self._habits.exceptions:
            answer = exception(random, function)
        else:
            answer = device.answer(random, pdu)
            if function in (3, 4) and random.random() < self._habits.hostile:
                answer = hostile(random, device.unit, answer, [neighbour.unit for neighbour in self.devices])
        return Exchange(adu(device.unit, pdu), adu(device.unit, answer), device.response_ns)


def adu(unit: int, pdu: bytes) -> bytes:
    """An RTU ADU around a PDU."""
    body = bytes((unit,)) + pdu
    return body + crc_bytes(body)


def _address(device: Device, random: Random) -> int:
    return device.base + random.randrange(MAP_LENGTH)


def _words_wanted(random: Random) -> int:
    if random.random() < 0.76:
        return random.choice((1, 2, 2, 4, 8, 10))
    return random.randint(1, random.choice((60, 125)))


def _read_bits(function: int) -> Callable[[Device, Random], bytes]:
    def request(device: Device, random: Random) -> bytes:
        quantity = random.choice((1, 8, 16, 37)) if random.random() < 0.8 else random.randint(1, 400)
        return struct.pack(">BHH", function, _address(device, random), quantity)

    return request


def _read_words(function: int) -> Callable[[Device, Random], bytes]:
    def request(device: Device, random: Random) -> bytes:
        return struct.pack(">BHH", function, _address(device, random), _words_wanted(random))

    return request


def _bare(function: int) -> Callable[[Device, Random], bytes]:
    def request(device: Device, random: Random) -> bytes:
        return bytes((function,))

    return request


def _write_coil(device: Device, random: Random) -> bytes:
    return struct.pack(">BHH", 5, _address(device, random), random.choice((0, 0xFF00)))


def _write_register(device: Device, random: Random) -> bytes:
    address = _address(device, random)
    return struct.pack(">BH", 6, address) + device.read_words(random, address, 1)


def _write_coils(device: Device, random: Random) -> bytes:
    quantity = random.randint(1, 39)
    count = (quantity + 7) // 8
    return struct.pack(">BHHB", 15, _address(device, random), quantity, count) + random.randbytes(count)


def _write_registers(device: Device, random: Random) -> bytes:
    address = _address(device, random)
    quantity = random.choice((1, 2, 4)) if random.random() < 0.78 else random.randint(1, 29)
    return struct.pack(">BHHB", 16, address, quantity, 2 * quantity) + device.read_words(random, address, quantity)


def _diagnostics(device: Device, random: Random) -> bytes:
    subfunction = random.choice((0, 1, 2, 10, 11, 12, 13, 14, 15))
    return struct.pack(">BHH", 8, subfunction, random.getrandbits(16) if subfunction == 0 else 0)


def _read_files(device: Device, random: Random) -> bytes:
    groups = b"".join(
        struct.pack(">BHHH", 6, random.randint(1, 9), random.randrange(100), random.randint(1, 5))
        for _ in range(random.randint(1, 3))
    )
    return bytes((20, len(groups))) + groups


def _write_file(device: Device, random: Random) -> bytes:
    words = random.randint(1, 9)
    group = struct.pack(">BHHH", 6, random.randint(1, 9), random.randrange(100), words) + random.randbytes(2 * words)
    return bytes((21, len(group))) + group


def _mask_register(device: Device, random: Random) -> bytes:
    return struct.pack(">BH", 22, _address(device, random)) + random.randbytes(4)


def _read_write(device: Device, random: Random) -> bytes:
    address = _address(device, random)
    written = random.randint(1, 9)
    head = struct.pack(">BHHHHB", 23, address, random.randint(1, 19), address + 5, written, 2 * written)
    return head + random.randbytes(2 * written)


def _read_fifo(device: Device, random: Random) -> bytes:
    return struct.pack(">BH", 24, _address(device, random))


def _identification(device: Device, random: Random) -> bytes:
    return bytes((43, 14, 1, 0))


def _vendor(device: Device, random: Random) -> bytes:
    return bytes((VENDOR,)) + random.randbytes(random.randint(1, 11))


_REQUESTS: dict[int, Callable[[Device, Random], bytes]] = {
    1: _read_bits(1),
    2: _read_bits(2),
    3: _read_words(3),
    4: _read_words(4),
    5: _write_coil,
    6: _write_register,
    7: _bare(7),
    8: _diagnostics,
    11: _bare(11),
    12: _bare(12),
    15: _write_coils,
    16: _write_registers,
    17: _bare(17),
    20: _read_files,
    21: _write_file,
    22: _mask_register,
    23: _read_write,
    24: _read_fifo,
    43: _identification,
    VENDOR: _vendor,
}
