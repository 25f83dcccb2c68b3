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
SWAPPED_WRITES: Final = {5: 15, 15: 5, 6: 16, 16: 6}
SWAPPED: Final = {1: 2, 2: 1, 3: 4, 4: 3, **SWAPPED_WRITES}  # the other function of the same kind
ADDRESSES: Final = 1 << 16
_MOST: Final = {1: 2000, 2: 2000, 3: 125, 4: 125, 15: 1968, 16: 123}  # bits or registers of one request ([1] 6)
_NUMBERS: Final = 10_000  # logical numbers (40001) of one first digit
_BY_NUMBER: Final = {  # function: by the first digit of a number that it may mean, the function that reads or writes it
    1: {1: 1}, 2: {1: 2}, 3: {4: 3, 3: 4}, 4: {3: 4, 4: 3}, 6: {4: 6}, 16: {4: 16},
}  # fmt: skip
_PAIR: Final = 4  # bytes of address and quantity, or of address and value
_OF_ONE: Final = (5, 6, 22)  # functions of one address, with a value in the place of a quantity
_DATA_AT: Final = {5: 2, 6: 2, 22: 2, 23: 2, 15: 5, 16: 5}  # function: where behind it `Request.data` begins
_WRITTEN: Final = {5: 2, 6: 2, 22: 4}  # bytes of their data ([1] 6.5, 6.6, 6.16)
_COUNTED: Final = (15, 16)  # functions whose data follow their count
_ANSWERED: Final = (*READS, 23)  # functions whose answers hold what was asked for


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
    def begin(self) -> int:
        """The first address that it asks for; 0 where it has none."""
        return self.address or 0

    @property
    def end(self) -> int:
        """The address behind the last that it asks for."""
        return self.begin + self.quantity

    @property
    def impossible(self) -> str | None:
        """The reason (`corrections.REASONS`) why no unit may serve it by the specification; None where one may."""
        if self.end > ADDRESSES:
            return "range-end"
        return "quantity" if self.quantity > self.most else None

    @property
    def place(self) -> str:
        """The addresses that it asks for, as text."""
        return span_words(self.begin, self.end)

    @property
    def pdu(self) -> bytes:
        """Its bytes without unit and check value."""
        head = bytes((self.function,))
        if self.address is None:
            return head + self.data
        pair = head + self.address.to_bytes(2, "big")
        if self.function in _COUNTED:
            return pair + self.quantity.to_bytes(2, "big") + bytes((len(self.data),)) + self.data
        return pair + (self.data if self.function in _DATA_AT else self.quantity.to_bytes(2, "big"))

    @property
    def is_whole(self) -> bool:
        """Whether all is there that it would write."""
        counted = taken(self.quantity, self.is_bits) * (self.function in _COUNTED)
        return len(self.data) >= _WRITTEN.get(self.function, counted)

    @property
    def adu(self) -> bytes:
        """Its bytes on an RTU line, check value included."""
        body = bytes((self.unit,)) + self.pdu
        return body + crc_bytes(body)

    @property
    def longest_frame(self) -> int:
        """Bytes of the longer of its RTU frame and that of its answer."""
        answer = 2 + taken(self.quantity, self.is_bits) if self.function in _ANSWERED else 5
        return max(answer, len(self.pdu)) + OVERHEAD

    @property
    def numbered(self) -> Request | None:
        """The request that is meant where a register number (40001) was sent as an address; None where it is none."""
        digit, place = divmod(self.begin, _NUMBERS)
        function = _BY_NUMBER.get(self.function, {}).get(digit)
        return replace(self, function=function, address=place - 1) if function is not None and place else None

    @property
    def number_digit(self) -> int | None:
        """The first digit of the register number that it may mean; None where it is none."""
        return None if self.numbered is None else self.begin // _NUMBERS

    @property
    def most(self) -> int:
        """The quantity that the specification allows a request of its function."""
        return _MOST.get(self.function, ADDRESSES)

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


def span_words(begin: int, end: int) -> str:
    """Addresses from one on to before another, as people write them."""
    return f"{begin}..{end - 1}" if end - begin > 1 else f"{begin}"


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
    quantity = 1 if function in _OF_ONE else second
    return Request(unit, function, address, quantity, body[_DATA_AT.get(function, len(body)) :])
