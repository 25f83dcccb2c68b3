"""18 Read FIFO Queue ([1] 6.18): its byte count has two bytes and counts the FIFO count as well."""

from __future__ import annotations

from typing import Final

from construct import Struct

from dissectors.blocks import Registers
from dissectors.declaration import Function
from dissectors.parts import Address, ByteCount, Quantity

_MOST: Final = 31

READ_FIFO_QUEUE: Final = Function(
    0x18,
    "Read FIFO Queue",
    request=Struct("fifo_pointer_address" / Address("4x")),
    response=Struct(
        "byte_count" / ByteCount(2, 2 + 2 * _MOST, width=2, multiple=2),
        "fifo_count" / Quantity(0, _MOST),
        "registers" / Registers("byte_count", less=2),
    ),
    clause="6.18",
    area="4x",
    request_words="read the FIFO queue at {fifo_pointer_address}",
    response_words="{fifo_count:register} in the queue: {registers}",
)
