"""01 Read Coils, 02 Read Discrete Inputs ([1] 6.1, 6.2)."""

from __future__ import annotations

from typing import Final

from construct import Struct

from dissectors.blocks import Bits
from dissectors.declaration import Function
from dissectors.parts import Address, ByteCount, Quantity
from dissectors.values import Area

_MOST: Final = 2000


def _read(code: int, name: str, clause: str, area: Area, noun: str, block: str, each: str) -> Function:
    return Function(
        code,
        name,
        request=Struct("starting_address" / Address(area), "quantity" / Quantity(1, _MOST)),
        response=Struct(
            "byte_count" / ByteCount(1, _MOST // 8, of="quantity", bits=True),
            block / Bits("byte_count", each=each, area=area, start="starting_address", quantity="quantity"),
        ),
        clause=clause,
        area=area,
        request_words=f"read {{quantity:{noun}}} from {{starting_address}}",
        response_words=f"{{{block}:{noun}}}: {{{block}}}",
    )


FUNCTIONS: Final = (
    _read(0x01, "Read Coils", "6.1", "0x", "coil", "coils", "coil"),
    _read(0x02, "Read Discrete Inputs", "6.2", "1x", "discrete input", "inputs", "input"),
)
