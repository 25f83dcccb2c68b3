"""One request by its properties: function, address, quantity, the bytes that it and its answer take ([1] 6)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

from dissectors.crc import crc_bytes
from dissectors.limits import OVERHEAD, taken

READS: Final = (1, 2, 3, 4)
WRITES: Final = (5, 6, 15, 16)
ADDRESSED: Final = (*READS, *WRITES, 22, 23)
OF_BITS: Final = (1, 2, 5, 15)
SWAPPED: Final = {1: 2, 2: 1, 3: 4, 4: 3, 5: 15, 15: 5, 6: 16, 16: 6}  # the other function of the same kind
ADDRESSES: Final = 1 << 16
MOST_WORDS: Final = 125  # of one read ([1] 6.3)
MOST_BITS: Final = 2000  # of one read ([1] 6.1)
MOST_WRITTEN: Final = 123  # registers of one write ([1] 6.12)
_NUMBERS: Final = ((3, 40001, 49999), (4, 30001, 39999), (2, 10001, 19999))  # function, first and last logical number
_BY_NUMBER: Final = {3: 3, 6: 3, 16: 3, 4: 4, 1: 2, 2: 2}  # the area that a function reaches, by the read of it
_PAIR: Final = 4  # bytes of address and quantity, or of address and value


@dataclass(frozen=True, slots=True)
class Request:
    """What a client asked of a unit; `address` is None for functions that have none, `data` is what it would write."""

    unit: int
    function: int
    address: int | None = None
    quantity: int = 0
    data: bytes = b""

    @property
    def is_read(self) -> bool:
        """Whether it only reads."""
        return self.function in READS

    @property
    def is_bits(self) -> bool:
        """Whether its quantity counts bits."""
        return self.function in OF_BITS

    @property
    def end(self) -> int:
        """The address behind the last that it asks for."""
        return (self.address or 0) + self.quantity

    @property
    def place(self) -> str:
        """The addresses that it asks for, as text."""
        return f"{self.address}..{self.end - 1}" if self.quantity > 1 else f"{self.address}"

    @property
    def pdu(self) -> bytes:
        """Its bytes without unit and check value."""
        head = bytes((self.function,))
        if self.address is None:
            return head + self.data
        pair = head + self.address.to_bytes(2, "big")
        if self.function in (5, 6, 22, 23):
            return pair + self.data
        pair += self.quantity.to_bytes(2, "big")
        return pair + bytes((len(self.data),)) + self.data if self.function in (15, 16) else pair

    @property
    def adu(self) -> bytes:
        """Its bytes on an RTU line, check value included."""
        body = bytes((self.unit,)) + self.pdu
        return body + crc_bytes(body)

    @property
    def longest_frame(self) -> int:
        """Bytes of the longer of its RTU frame and that of its answer."""
        answer = 2 + taken(self.quantity, self.is_bits) if self.is_read or self.function == 23 else 5
        return max(answer, len(self.pdu)) + OVERHEAD

    @property
    def numbered(self) -> Request | None:
        """The request that is meant where a register number (40001) was sent as an address; None where it is none."""
        area = _BY_NUMBER.get(self.function)
        if self.address is None or area is None:
            return None
        for read, first, last in _NUMBERS:
            if first <= self.address <= last and (read == area or (self.is_read and {read, area} == {3, 4})):
                function = read if self.is_read and self.function != 1 else self.function
                return replace(self, function=function, address=self.address - first)
        return None

    @property
    def most(self) -> int:
        """The quantity that the specification allows a request of its function."""
        if self.function in READS:
            return MOST_BITS if self.is_bits else MOST_WORDS
        return {15: 1968, 16: MOST_WRITTEN}.get(self.function, ADDRESSES)

    def part(self, address: int, quantity: int) -> Request:
        """Some of what it asks for."""
        if self.is_read or self.address is None:
            return replace(self, address=address, quantity=quantity)
        skipped = address - self.address
        if self.function == 15:
            bits = int.from_bytes(self.data, "little") >> skipped & (1 << quantity) - 1
            return replace(
                self, address=address, quantity=quantity, data=bits.to_bytes(taken(quantity, True), "little")
            )
        return replace(self, address=address, quantity=quantity, data=self.data[2 * skipped : 2 * (skipped + quantity)])


def request_of(unit: int, pdu: bytes) -> Request | None:
    """The request of a PDU; None where it is too short to be one."""
    if not pdu:
        return None
    function, body = pdu[0], pdu[1:]
    if function not in ADDRESSED:
        return Request(unit, function, data=body)
    if len(body) < _PAIR:
        return None
    address, second = int.from_bytes(body[:2], "big"), int.from_bytes(body[2:4], "big")
    if function in (5, 6, 22):
        return Request(unit, function, address, 1, body[2:])
    if function == 23:
        return Request(unit, function, address, second, body[2:])
    return Request(unit, function, address, second, body[5:] if function in (15, 16) else b"")
