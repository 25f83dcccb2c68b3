"""Modbus RTU as its specification says it, written for this bench alone: frames, and a device that answers.

Clauses are those of "MODBUS Application Protocol Specification V1.1b3" and "MODBUS over Serial Line V1.02".
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from random import Random

ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE, BUSY = 1, 2, 3, 6
LONGEST = 256  # bytes of a frame, check value included


def _table() -> list[int]:
    values = []
    for value in range(256):
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
        values.append(value)
    return values


_CRC = _table()


def crc16(data: bytes) -> int:
    """The check value of a frame's bytes (serial line, 6.2.2)."""
    crc = 0xFFFF
    for byte in data:
        crc = crc >> 8 ^ _CRC[(crc ^ byte) & 0xFF]
    return crc


def adu(unit: int, pdu: bytes) -> bytes:
    """A frame: address, function and data, check value with its low byte first."""
    body = bytes((unit,)) + pdu
    return body + crc16(body).to_bytes(2, "little")


def read(function: int, address: int, quantity: int) -> bytes:
    """The PDU of a request of functions 1 to 4 (6.1 to 6.4)."""
    return struct.pack(">BHH", function, address, quantity)


def write_one(function: int, address: int, value: int) -> bytes:
    """The PDU of a request of functions 5 and 6 (6.5, 6.6)."""
    return struct.pack(">BHH", function, address, value)


def write_registers(address: int, values: Sequence[int]) -> bytes:
    """The PDU of a request of function 16 (6.12)."""
    return struct.pack(f">BHHB{len(values)}H", 16, address, len(values), 2 * len(values), *values)


def write_coils(address: int, bits: Sequence[int]) -> bytes:
    """The PDU of a request of function 15 (6.11)."""
    return struct.pack(">BHHB", 15, address, len(bits), (len(bits) + 7) // 8) + packed(bits)


def read_and_write(address: int, quantity: int, into: int, values: Sequence[int]) -> bytes:
    """The PDU of a request of function 23 (6.17)."""
    head = struct.pack(">BHHHHB", 23, address, quantity, into, len(values), 2 * len(values))
    return head + struct.pack(f">{len(values)}H", *values)


def packed(bits: Sequence[int]) -> bytes:
    """Bits as they travel: eight a byte, the first one lowest."""
    octets = bytearray((len(bits) + 7) // 8)
    for at, bit in enumerate(bits):
        octets[at // 8] |= bit << at % 8
    return bytes(octets)


def refusal(function: int, code: int) -> bytes:
    """The PDU of an exception response (7)."""
    return bytes((function | 0x80, code))


@dataclass
class Memory:
    """What a device holds: registers and bits with what `value` gives them until somebody writes."""

    value: Callable[[int], int]  # of a register, by its address
    written: dict[int, int] = field(default_factory=dict)
    coils: dict[int, int] = field(default_factory=dict)
    name: bytes = b"RTUBench unit"

    @classmethod
    def drawn(cls, random: Random) -> Memory:
        """Values as plants have them: many small, some zero, some of full range, slowly moving."""
        base = [random.choice((0, random.randrange(300), random.randrange(5000), random.randrange(65536)))
                for _ in range(97)]  # fmt: skip
        moves = [random.choice((0, 0, 1, 3, 40)) for _ in range(89)]
        return cls(lambda at: (base[at % 97] + random.randrange(-1, 2) * moves[at % 89]) & 0xFFFF)

    def register(self, address: int) -> int:
        """A register as it stands now."""
        return self.written[address] if address in self.written else self.value(address)

    def bit(self, address: int) -> int:
        """A coil or a discrete input."""
        return self.coils.get(address, address * 7 // 3 & 1)

    def answer(self, pdu: bytes) -> bytes:
        """The response to the PDU of a request; a function that is not there is refused (7, code 1)."""
        make = _ANSWERS.get(pdu[0])
        return make(self, pdu) if make else refusal(pdu[0], ILLEGAL_FUNCTION)


def _registers(memory: Memory, address: int, quantity: int) -> bytes:
    values = [memory.register(address + at) for at in range(quantity)]
    return struct.pack(f">B{quantity}H", 2 * quantity, *values)


def _read_registers(memory: Memory, pdu: bytes) -> bytes:
    return pdu[:1] + _registers(memory, *struct.unpack(">HH", pdu[1:5]))


def _read_bits(memory: Memory, pdu: bytes) -> bytes:
    address, quantity = struct.unpack(">HH", pdu[1:5])
    octets = packed([memory.bit(address + at) for at in range(quantity)])
    return pdu[:1] + bytes((len(octets),)) + octets


def _write_one(memory: Memory, pdu: bytes) -> bytes:
    address, value = struct.unpack(">HH", pdu[1:5])
    if pdu[0] == 5:
        memory.coils[address] = int(value == 0xFF00)
    else:
        memory.written[address] = value
    return pdu


def _write_many(memory: Memory, pdu: bytes) -> bytes:
    address, quantity = struct.unpack(">HH", pdu[1:5])
    if pdu[0] == 15:
        for at in range(quantity):
            memory.coils[address + at] = pdu[6 + at // 8] >> at % 8 & 1
    else:
        memory.written.update(zip(range(address, address + quantity), _words(pdu[6:]), strict=True))
    return pdu[:5]


def _mask_write(memory: Memory, pdu: bytes) -> bytes:
    address, both, either = struct.unpack(">HHH", pdu[1:7])
    memory.written[address] = memory.register(address) & both | either & ~both & 0xFFFF
    return pdu


def _read_and_write(memory: Memory, pdu: bytes) -> bytes:
    address, quantity, into, count = struct.unpack(">HHHH", pdu[1:9])
    memory.written.update(zip(range(into, into + count), _words(pdu[10:]), strict=True))
    return pdu[:1] + _registers(memory, address, quantity)


def _words(octets: bytes) -> tuple[int, ...]:
    words: tuple[int, ...] = struct.unpack(f">{len(octets) // 2}H", octets)
    return words


def _report_id(memory: Memory, pdu: bytes) -> bytes:
    told = memory.name + b"\xff"
    return pdu[:1] + bytes((len(told),)) + told


def _identify(memory: Memory, pdu: bytes) -> bytes:
    """Function 43, MEI type 14, basic objects one after the other (6.21)."""
    objects = (b"RTUBench", memory.name, b"1.0")
    body = b"".join(bytes((at, len(text))) + text for at, text in enumerate(objects))
    return pdu[:3] + b"\x01\x00\x00\x03" + body


def _vendor(memory: Memory, pdu: bytes) -> bytes:
    """A maker's own function: a channel is asked for, a count and as many bytes come back."""
    count = 4 + pdu[1] % 12
    return pdu[:2] + bytes((count,)) + bytes(memory.register(pdu[1] + at) & 0xFF for at in range(count))


_ANSWERS: dict[int, Callable[[Memory, bytes], bytes]] = {
    1: _read_bits, 2: _read_bits, 3: _read_registers, 4: _read_registers, 5: _write_one, 6: _write_one,
    7: lambda memory, pdu: pdu + bytes((memory.register(0) & 0xFF,)), 8: lambda _, pdu: pdu,
    15: _write_many, 16: _write_many, 17: _report_id, 22: _mask_write, 23: _read_and_write, 43: _identify,
    0x41: _vendor,
}  # fmt: skip
