"""What a packet carries that a text shows as a dump with its headers, as `tcpdump -X` and `tshark -x` write them.

Bytes are taken for a packet only where its headers agree on its length to the byte: RFC 791, RFC 9293, RFC 768.
"""

from __future__ import annotations

from typing import Final, NamedTuple

_IP_AT: Final = {0: None, 14: 12, 16: 14, 18: 16}  # where IP begins: bare, Ethernet, Linux SLL, VLAN; and its type
_IPV4: Final = b"\x08\x00"
_LEAST_IP: Final = 20
_LEAST_FRAME: Final = 60  # bytes that Ethernet fills up to
_TCP: Final = 6
_UDP: Final = 17
_UDP_HEADER: Final = 8
_MODBUS_PORT: Final = 502
_TX, _RX = 1, 2


class Payload(NamedTuple):
    """The bytes of a TCP segment or UDP datagram, none of an acknowledgement; `mark` by the port of Modbus, or 0."""

    data: bytes
    mark: int


def payload_of(packet: bytes) -> Payload | None:
    """What a whole packet carries; None of all other bytes."""
    for at, kind in _IP_AT.items():
        if kind is None or packet[kind:at] == _IPV4:
            found = _of_ip(packet, at)
            if found is not None:
                return found
    return None


def _of_ip(packet: bytes, at: int) -> Payload | None:
    if len(packet) < at + _LEAST_IP or packet[at] >> 4 != 4:
        return None
    header, total = 4 * (packet[at] & 15), _number(packet, at + 2)
    filled = at > 0 and len(packet) == _LEAST_FRAME
    if header < _LEAST_IP or (at + total != len(packet) and not (filled and at + total < len(packet))):
        return None
    begin, end, protocol = at + header, at + total, packet[at + 9]
    if protocol == _TCP and begin + 20 <= end and 20 <= (size := packet[begin + 12] >> 4 << 2) <= end - begin:
        return _marked(packet, begin, packet[begin + size : end])
    if protocol == _UDP and begin + _UDP_HEADER <= end and _number(packet, begin + 4) == end - begin:
        return _marked(packet, begin, packet[begin + _UDP_HEADER : end])
    return None


def _marked(packet: bytes, begin: int, data: bytes) -> Payload:
    source, destination = _number(packet, begin), _number(packet, begin + 2)
    return Payload(data, _TX if destination == _MODBUS_PORT else _RX if source == _MODBUS_PORT else 0)


def _number(packet: bytes, at: int) -> int:
    return int.from_bytes(packet[at : at + 2], "big")
