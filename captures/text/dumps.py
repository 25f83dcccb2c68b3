"""The rows of a dump: whether an offset goes on with those before, what stands below them, what they carry together.

hexdump, od and xxd write `*` in place of rows that are like the one above. Bytes are taken for what a packet carries
(`tcpdump -X`, `tshark -x`) only where its headers agree on its length to the byte: RFC 791, RFC 9293, RFC 768.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final, NamedTuple

from .entries import NumberedLine
from .escapes import OD_BELOW, od_bytes
from .runs import ByteRun
from .tools import NONE, RX, TX

_OFFSET_DIGITS: Final = range(3, 9)


@dataclass(slots=True)
class Dump:
    """The rows of a dump so far; none where `row` is None."""

    row: ByteRun | None = None  # the newest
    length: int = 0  # bytes
    first: int = 0  # offset of the first row
    t_ns: int | None = None

    def goes_on(self, row: ByteRun, t_ns: int | None) -> bool:
        """Take a row of a line with this time; whether it goes on with the dump of the lines before."""
        if row.offset is None:
            self.row = None
            return False
        last = self.row
        if last is None or self.t_ns != t_ns or not self._is_next(row.offset, self.length):
            self.length, self.first, self.t_ns = 0, int(row.offset, 16), t_ns
        elif len(row.data) == 1:  # alone it looks like a number, and is no half of a word
            row.shape, row.level = last.shape, last.level
        goes_on = self.length > 0
        self.length += len(row.data)
        self.row = row
        return goes_on

    def ends_with(self, rest: str) -> bool:
        """Whether a line without its time is the length, with which od and hexdump end."""
        digits = rest.strip().rstrip(":")
        if self.row is None:
            return False
        if "words" in self.row.shape and self._is_next(digits, self.length - 1):
            self.row.padded = True
            return True
        return self._is_next(digits, self.length)

    def shows(self, rest: str) -> bool:
        """Whether a line without an offset is the newest row as characters, as `od -t x1c` writes it below."""
        if self.row is None or (cells := OD_BELOW.match(rest)) is None:
            return False
        return od_bytes(cells["row"]) == self.row.data

    def _is_next(self, digits: str, length: int) -> bool:
        """Whether these digits are where the dump goes on: in hex, or in octal or decimal as od writes it."""
        place = digits.lower().lstrip("0")
        return len(digits) in _OFFSET_DIGITS and place in {format(self.first + length, base) for base in "xdo"}


_ROW: Final = re.compile(r"^(?P<lead>\s*)(?P<offset>[0-9A-Fa-f]{4,8})(?P<rest>:?\s+\S.*)?$")
_OCTAL: Final = frozenset("01234567")
_OD_DIGITS: Final = 7  # of an offset in octal
_WIDTH: Final = 16  # bytes of a row, unless two rows say otherwise
_ROWS_AGAIN: Final = 4096  # rows that are written again in one text


class _DumpRow(NamedTuple):
    lead: str
    offset: str
    rest: str


def with_repeats(lines: Iterable[NumberedLine]) -> Iterator[NumberedLine]:
    """Lines with their numbers, each `*` between two rows of a dump as the rows for which it stands."""
    above: list[_DumpRow] = []  # the last two rows
    held: NumberedLine | None = None
    left = _ROWS_AGAIN
    for number, line in lines:
        if above and line.strip() == "*":
            held = held or (number, line)
            continue
        row = _row(line)
        if held is not None:
            rows = _between(above, row.offset) if row is not None else []
            rows = rows if 0 < len(rows) <= left else [held[1]]
            left -= len(rows)
            yield from ((held[0], text) for text in rows)
            held = None
        above = [*above[-1:], row] if row is not None and row.rest else []
        yield number, line
    if held is not None:
        yield held


def _row(line: str) -> _DumpRow | None:
    match = _ROW.match(line.rstrip("\r\n"))
    return None if match is None else _DumpRow(*match.groups(""))


def _between(above: list[_DumpRow], following: str) -> list[str]:
    """The rows between the last one and the next offset; none where the offsets do not say how many."""
    last = above[-1]
    for base in _bases(above, following):
        begin, end = int(last.offset, base), int(following, base)
        width = begin - int(above[0].offset, base) if len(above) > 1 else _WIDTH
        count = (end - begin) // width - 1 if width > 0 else 0
        if 0 < count <= _ROWS_AGAIN and end - begin - (count + 1) * width < width:
            digits = "o" if base == 8 else "x"
            numbers = (f"{begin + i * width:0{len(last.offset)}{digits}}" for i in range(1, count + 1))
            return [f"{last.lead}{number}{last.rest}" for number in numbers]
    return []


def _bases(above: list[_DumpRow], following: str) -> tuple[int, ...]:
    """In which base offsets can be: od writes seven octal digits before bytes."""
    offsets = [row.offset for row in above] + [following]
    if not all(len(one) == _OD_DIGITS and set(one) <= _OCTAL for one in offsets):
        return (16,)
    if len(above) > 1:
        return (16,) if int(offsets[1], 16) - int(offsets[0], 16) == _WIDTH else (8,)
    return (16, 8)


_IP_AT: Final = {0: None, 14: 12, 16: 14, 18: 16}  # where IP begins: bare, Ethernet, Linux SLL, VLAN; and its type
_IPV4: Final = b"\x08\x00"
_LEAST_IP: Final = 20
_VERSIONS: Final = range(0x45, 0x50)  # the first byte: version 4, and how many words the header has
_LEAST_FRAME: Final = 60  # bytes that Ethernet fills up to
_TCP, _UDP = 6, 17
_LEAST_HEADER: Final = {_TCP: 20, _UDP: 8}
_MODBUS_PORT: Final = 502


class Payload(NamedTuple):
    """The bytes of a TCP segment or UDP datagram, none of an acknowledgement; `mark` by the port of Modbus, or 0."""

    data: bytes
    mark: int


def payload_of(packet: bytes) -> Payload | None:
    """What a whole packet carries; None of all other bytes."""
    begins = (at for at, kind in _IP_AT.items() if kind is None or packet[kind:at] == _IPV4)
    return next(filter(None, (_of_ip(packet, at) for at in begins)), None)


def _of_ip(packet: bytes, at: int) -> Payload | None:
    filled = at > 0 and len(packet) == _LEAST_FRAME
    ip = packet[at : at + _number(packet, at + 2) if filled else None]
    if len(ip) < _LEAST_IP or ip[0] not in _VERSIONS or _number(ip, 2) != len(ip):
        return None
    segment, protocol = ip[4 * (ip[0] & 15) :], ip[9]
    least = _LEAST_HEADER.get(protocol, len(packet))
    size = _number(segment, 12) >> 12 << 2 if protocol == _TCP else least * (_number(segment, 4) == len(segment))
    if not least <= size <= len(segment):
        return None
    ports = [_number(segment, 2), _number(segment, 0), _MODBUS_PORT]  # where to, where from
    return Payload(segment[size:], (TX, RX, NONE)[ports.index(_MODBUS_PORT)])


def _number(packet: bytes, at: int) -> int:
    return int.from_bytes(packet[at : at + 2], "big")
