"""03 Read Holding Registers, 04 Read Input Registers ([1] 6.3, 6.4)."""

from __future__ import annotations

from typing import Final

from construct import Struct

from ..blocks import Bits, Registers
from ..declaration import Address, ByteCount, Function, Mask, Output, Quantity, Register
from ..values import Area

_MOST_REGISTERS_READ: Final = 125


def _read_registers(code: int, name: str, clause: str, area: Area, noun: str) -> Function:
    return Function(
        code,
        name,
        request=Struct("starting_address" / Address(area), "quantity" / Quantity(1, _MOST_REGISTERS_READ)),
        response=Struct(
            "byte_count" / ByteCount(2, 2 * _MOST_REGISTERS_READ, multiple=2, of="quantity"),
            "registers" / Registers("byte_count", start="starting_address", area=area),
        ),
        clause=clause,
        area=area,
        request_words=f"read {{quantity:{noun}}} from {{starting_address}}",
        response_words="{registers:register}: {registers}",
    )


REGISTER_READS: Final = (
    _read_registers(0x03, "Read Holding Registers", "6.3", "4x", "holding register"),
    _read_registers(0x04, "Read Input Registers", "6.4", "3x", "input register"),
)


# 05 Write Single Coil, 06 Write Single Register ([1] 6.5, 6.6): the response repeats the request.


_COIL: Final = Struct("output_address" / Address("0x"), "output_value" / Output())
_REGISTER: Final = Struct("register_address" / Address("4x"), "register_value" / Register())

WRITE_SINGLE_COIL: Final = Function(
    0x05,
    "Write Single Coil",
    request=_COIL,
    response=_COIL,
    clause="6.5",
    area="0x",
    echoes=("output_address", "output_value"),
    request_words="write coil {output_address}: {output_value}",
    response_words="coil {output_address} written: {output_value}",
)

WRITE_SINGLE_REGISTER: Final = Function(
    0x06,
    "Write Single Register",
    request=_REGISTER,
    response=_REGISTER,
    clause="6.6",
    area="4x",
    echoes=("register_address", "register_value"),
    request_words="write register {register_address}: {register_value}",
    response_words="register {register_address} written: {register_value}",
)


# 0F Write Multiple Coils, 10 Write Multiple Registers ([1] 6.11, 6.12): the response repeats where and how many.


_MOST_COILS_WRITTEN: Final = 1968
_MOST_REGISTERS_WRITTEN: Final = 123

WRITE_MULTIPLE_COILS: Final = Function(
    0x0F,
    "Write Multiple Coils",
    request=Struct(
        "starting_address" / Address("0x"),
        "quantity" / Quantity(1, _MOST_COILS_WRITTEN),
        "byte_count" / ByteCount(1, _MOST_COILS_WRITTEN // 8, of="quantity", bits=True),
        "coils" / Bits("byte_count", each="coil", area="0x", start="starting_address", quantity="quantity"),
    ),
    response=Struct("starting_address" / Address("0x"), "quantity" / Quantity(1, _MOST_COILS_WRITTEN)),
    clause="6.11",
    area="0x",
    echoes=("starting_address", "quantity"),
    request_words="write {quantity:coil} from {starting_address}: {coils}",
    response_words="{quantity:coil} from {starting_address} written",
)

WRITE_MULTIPLE_REGISTERS: Final = Function(
    0x10,
    "Write Multiple Registers",
    request=Struct(
        "starting_address" / Address("4x"),
        "quantity" / Quantity(1, _MOST_REGISTERS_WRITTEN),
        "byte_count" / ByteCount(2, 2 * _MOST_REGISTERS_WRITTEN, multiple=2, of="quantity"),
        "registers" / Registers("byte_count", start="starting_address", area="4x"),
    ),
    response=Struct("starting_address" / Address("4x"), "quantity" / Quantity(1, _MOST_REGISTERS_WRITTEN)),
    clause="6.12",
    area="4x",
    echoes=("starting_address", "quantity"),
    request_words="write {quantity:register} from {starting_address}: {registers}",
    response_words="{quantity:register} from {starting_address} written",
)


# 17 Read/Write Multiple Registers ([1] 6.17): the write comes first, then the read that the response answers.


_MOST_READ_BESIDE_WRITE: Final = 125
_MOST_WRITTEN_BESIDE_READ: Final = 121

READ_WRITE_MULTIPLE_REGISTERS: Final = Function(
    0x17,
    "Read/Write Multiple Registers",
    request=Struct(
        "read_starting_address" / Address("4x"),
        "quantity_to_read" / Quantity(1, _MOST_READ_BESIDE_WRITE),
        "write_starting_address" / Address("4x"),
        "quantity_to_write" / Quantity(1, _MOST_WRITTEN_BESIDE_READ),
        "write_byte_count" / ByteCount(2, 2 * _MOST_WRITTEN_BESIDE_READ, multiple=2, of="quantity_to_write"),
        "write_registers" / Registers("write_byte_count", start="write_starting_address", area="4x"),
    ),
    response=Struct(
        "byte_count" / ByteCount(2, 2 * _MOST_READ_BESIDE_WRITE, multiple=2, of="quantity_to_read"),
        "registers" / Registers("byte_count", start="read_starting_address", area="4x"),
    ),
    clause="6.17",
    area="4x",
    request_words="read {quantity_to_read:register} from {read_starting_address}, "
    "write {quantity_to_write:register} from {write_starting_address}: {write_registers}",
    response_words="{registers:register}: {registers}",
)


# 16 Mask Write Register ([1] 6.16): (value AND and_mask) OR (or_mask AND NOT and_mask); the response repeats it.


_MASKS: Final = Struct("reference_address" / Address("4x"), "and_mask" / Mask(), "or_mask" / Mask())

MASK_WRITE_REGISTER: Final = Function(
    0x16,
    "Mask Write Register",
    request=_MASKS,
    response=_MASKS,
    clause="6.16",
    area="4x",
    echoes=("reference_address", "and_mask", "or_mask"),
    request_words="mask register {reference_address}: and {and_mask}, or {or_mask}",
    response_words="register {reference_address} masked: and {and_mask}, or {or_mask}",
)


# 01 Read Coils, 02 Read Discrete Inputs ([1] 6.1, 6.2).


_MOST_BITS_READ: Final = 2000


def _read_bits(code: int, name: str, clause: str, area: Area, noun: str, block: str, each: str) -> Function:
    return Function(
        code,
        name,
        request=Struct("starting_address" / Address(area), "quantity" / Quantity(1, _MOST_BITS_READ)),
        response=Struct(
            "byte_count" / ByteCount(1, _MOST_BITS_READ // 8, of="quantity", bits=True),
            block / Bits("byte_count", each=each, area=area, start="starting_address", quantity="quantity"),
        ),
        clause=clause,
        area=area,
        request_words=f"read {{quantity:{noun}}} from {{starting_address}}",
        response_words=f"{{{block}:{noun}}}: {{{block}}}",
    )


BIT_READS: Final = (
    _read_bits(0x01, "Read Coils", "6.1", "0x", "coil", "coils", "coil"),
    _read_bits(0x02, "Read Discrete Inputs", "6.2", "1x", "discrete input", "inputs", "input"),
)


# 18 Read FIFO Queue ([1] 6.18): its byte count has two bytes and counts the FIFO count as well.


_MOST_QUEUED: Final = 31

READ_FIFO_QUEUE: Final = Function(
    0x18,
    "Read FIFO Queue",
    request=Struct("fifo_pointer_address" / Address("4x")),
    response=Struct(
        "byte_count" / ByteCount(2, 2 + 2 * _MOST_QUEUED, width=2, multiple=2),
        "fifo_count" / Quantity(0, _MOST_QUEUED),
        "registers" / Registers("byte_count", less=2),
    ),
    clause="6.18",
    area="4x",
    request_words="read the FIFO queue at {fifo_pointer_address}",
    response_words="{fifo_count:register} in the queue: {registers}",
)
