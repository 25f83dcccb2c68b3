"""0F Write Multiple Coils, 10 Write Multiple Registers ([1] 6.11, 6.12): the response repeats where and how many."""

from __future__ import annotations

from typing import Final

from construct import Struct

from dissectors.blocks import Bits, Registers
from dissectors.declaration import Function
from dissectors.parts import Address, ByteCount, Quantity

_MOST_COILS: Final = 1968
_MOST_REGISTERS: Final = 123

WRITE_MULTIPLE_COILS: Final = Function(
    0x0F,
    "Write Multiple Coils",
    request=Struct(
        "starting_address" / Address("0x"),
        "quantity" / Quantity(1, _MOST_COILS),
        "byte_count" / ByteCount(1, _MOST_COILS // 8, of="quantity", bits=True),
        "coils" / Bits("byte_count", each="coil", area="0x", start="starting_address", quantity="quantity"),
    ),
    response=Struct("starting_address" / Address("0x"), "quantity" / Quantity(1, _MOST_COILS)),
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
        "quantity" / Quantity(1, _MOST_REGISTERS),
        "byte_count" / ByteCount(2, 2 * _MOST_REGISTERS, multiple=2, of="quantity"),
        "registers" / Registers("byte_count", start="starting_address", area="4x"),
    ),
    response=Struct("starting_address" / Address("4x"), "quantity" / Quantity(1, _MOST_REGISTERS)),
    clause="6.12",
    area="4x",
    echoes=("starting_address", "quantity"),
    request_words="write {quantity:register} from {starting_address}: {registers}",
    response_words="{quantity:register} from {starting_address} written",
)
