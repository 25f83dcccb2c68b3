"""17 Read/Write Multiple Registers ([1] 6.17): the write comes first, then the read that the response answers."""

from __future__ import annotations

from typing import Final

from construct import Struct

from dissectors.blocks import Registers
from dissectors.declaration import Function
from dissectors.parts import Address, ByteCount, Quantity

_MOST_READ: Final = 125
_MOST_WRITTEN: Final = 121

READ_WRITE_MULTIPLE_REGISTERS: Final = Function(
    0x17,
    "Read/Write Multiple Registers",
    request=Struct(
        "read_starting_address" / Address("4x"),
        "quantity_to_read" / Quantity(1, _MOST_READ),
        "write_starting_address" / Address("4x"),
        "quantity_to_write" / Quantity(1, _MOST_WRITTEN),
        "write_byte_count" / ByteCount(2, 2 * _MOST_WRITTEN, multiple=2, of="quantity_to_write"),
        "write_registers" / Registers("write_byte_count", start="write_starting_address", area="4x"),
    ),
    response=Struct(
        "byte_count" / ByteCount(2, 2 * _MOST_READ, multiple=2, of="quantity_to_read"),
        "registers" / Registers("byte_count", start="read_starting_address", area="4x"),
    ),
    clause="6.17",
    area="4x",
    request_words="read {quantity_to_read:register} from {read_starting_address}, "
    "write {quantity_to_write:register} from {write_starting_address}: {write_registers}",
    response_words="{registers:register}: {registers}",
)
