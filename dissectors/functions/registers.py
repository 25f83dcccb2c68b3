"""03 Read Holding Registers, 04 Read Input Registers ([1] 6.3, 6.4)."""

from __future__ import annotations

from typing import Final

from construct import Struct

from dissectors.blocks import Registers
from dissectors.declaration import Function
from dissectors.parts import Address, ByteCount, Quantity
from dissectors.values import Area

_MOST: Final = 125


def _read(code: int, name: str, clause: str, area: Area, noun: str) -> Function:
    return Function(
        code,
        name,
        request=Struct("starting_address" / Address(area), "quantity" / Quantity(1, _MOST)),
        response=Struct(
            "byte_count" / ByteCount(2, 2 * _MOST, multiple=2, of="quantity"),
            "registers" / Registers("byte_count", start="starting_address", area=area),
        ),
        clause=clause,
        area=area,
        request_words=f"read {{quantity:{noun}}} from {{starting_address}}",
        response_words="{registers:register}: {registers}",
    )


FUNCTIONS: Final = (
    _read(0x03, "Read Holding Registers", "6.3", "4x", "holding register"),
    _read(0x04, "Read Input Registers", "6.4", "3x", "input register"),
)
