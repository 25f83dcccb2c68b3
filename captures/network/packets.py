"""Packets as columns, the interfaces that they were captured on, and what stands around the bytes of each by link type.

What pcap and pcapng files give alike: a serial line's bytes, a TCP segment or a UDP datagram.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Final, Protocol

import numpy as np
from numpy.typing import NDArray

from ..chunks import Mark, Note

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

INBOUND: Final = 1  # the lowest two flag bits of a packet (pcapng): received, sent
OUTBOUND: Final = 2
LONGEST: Final = 1 << 24  # bytes of a packet or block: more is damage


@dataclass(frozen=True, slots=True)
class Interface:
    """Where packets were captured: `link` is the link type (tcpdump.org/linktypes), `baud` the speed, where told."""

    link: int
    name: str | None = None
    baud: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Packets:
    """n packets of a file. `at` and `size` (captured bytes) point into `data`; the rest are values a packet.

    `missing` are bytes that the snap length cut off, `flags` those of pcapng, `comments` texts by packet.
    """

    data: Bytes
    at: Ints
    size: Ints
    missing: Ints
    t_ns: Ints
    interface: Ints
    flags: Ints
    comments: Mapping[int, list[str]] = field(default_factory=dict)

    def __len__(self) -> int:
        return len(self.at)


class PacketFile(Protocol):
    """What a file format's reader gives. `interfaces` grows as they are met; `header` is what this tool wrote of the
    line, where it wrote the file."""

    @property
    def interfaces(self) -> list[Interface]: ...

    @property
    def header(self) -> Mapping[str, object]: ...

    def packets(self, note: Note) -> Iterator[Packets]:
        """All packets in the file's order; `note` hears of what could not be read. Interfaces are met anew."""
        ...


def take_bytes(data: Bytes, at: Ints) -> Ints:
    """The bytes at these places, as numbers; places behind the end give the last byte."""
    return data.take(at, mode="clip").astype(np.int64)


def take_number(data: Bytes, at: Ints, width: int) -> Ints:
    """The big-endian numbers of `width` bytes at these places."""
    value = take_bytes(data, at)
    for step in range(1, width):
        value = value << 8 | take_bytes(data, at + step)
    return value


ETHERNET: Final = 1
RTAC: Final = 250
UPPER_PDU: Final = 252
USER: Final = range(147, 163)
SERIAL: Final = frozenset({*USER, RTAC, UPPER_PDU})
# Where the IP header begins, or where the type of what follows stands.
_IP_AT: Final = {0: 4, 108: 4, 12: 0, 14: 0, 101: 0, 228: 0, 229: 0}  # loopback; raw IP
_TYPE_AT: Final = {ETHERNET: 12, 113: 14, 276: 0}  # Ethernet, Linux SLL, Linux SLL2
_BEHIND: Final = {ETHERNET: 14, 113: 16, 276: 20}
NETWORK: Final = frozenset({*_IP_AT, *_TYPE_AT})
_VLAN: Final = (0x8100, 0x88A8, 0x9100)
_VLANS: Final = 3  # tags in a row
_TCP: Final = 6
UDP: Final = 17
_TCP_HEADER, _UDP_HEADER = 20, 8  # bytes, at least
KEY: Final = 40  # bytes that name a direction of a connection
_V6_EXTENSIONS: Final = (0, 43, 60, 135)  # headers that tell their own length
_RTAC_HEADER: Final = 12
_RTAC_TX: Final = (1, 3)
_RTAC_RX: Final = (2, 4)
_RTAC_LOST: Final = (5, 10)  # data lost, overflow
_RTAC_ERRORS: Final = (7, 8)  # framing, parity
_TAG_DISSECTOR: Final = 12
_MODBUS: Final = (b"mbrtu", b"mbtcp", b"mbudp", b"data")  # dissectors of bytes that may be Modbus


@dataclass(frozen=True, slots=True, eq=False)
class SerialReads:
    """What packets of a serial line carried: packet, place and size of bytes, Mark, and whether all are in error."""

    packet: Ints
    begin: Ints
    size: Ints
    mark: Ints
    wrong: NDArray[np.bool_]
    lost: int = 0  # packets that say that bytes were lost
    other: int = 0  # packets of something else


def serial_reads(packets: Packets, chosen: Ints, link: int) -> SerialReads:
    """The bytes of these packets, whose link type is one of SERIAL."""
    at, size = packets.at[chosen], packets.size[chosen]
    direction = packets.flags[chosen] & 3
    mark = np.where(direction == OUTBOUND, int(Mark.TX), np.where(direction == INBOUND, int(Mark.RX), 0))
    wrong = np.zeros(len(chosen), np.bool_)
    head = np.zeros(len(chosen), np.int64)
    lost = int((packets.missing[chosen] > 0).sum())
    if link == RTAC:
        head[:] = _RTAC_HEADER
        event = take_bytes(packets.data, at + 8)
        mark = np.where(np.isin(event, _RTAC_TX), int(Mark.TX), np.where(np.isin(event, _RTAC_RX), int(Mark.RX), 0))
        wrong = np.isin(event, _RTAC_ERRORS)
        lost += int(np.isin(event, _RTAC_LOST).sum())
    elif link == UPPER_PDU:
        head = _tags(packets.data, at, size)
    sound = (size > head) & (head >= 0)
    foreign = int((head < 0).sum())
    begin = (at + head)[sound]
    return SerialReads(chosen[sound], begin, (size - head)[sound], mark[sound], wrong[sound], lost, foreign)


def _tags(data: Bytes, at: Ints, size: Ints) -> Ints:
    """Bytes of tags before an upper PDU of Modbus; -1 for one of something else, or without an end of its tags."""
    octets = data.tobytes()
    alike: set[bytes] = set()  # whole lists of tags; most files have two or three
    last = 0
    heads = np.empty(len(at), np.int64)
    for i, (begin, length) in enumerate(zip(at.tolist(), size.tolist(), strict=True)):
        if not (0 < last <= length and octets[begin : begin + last] in alike):
            last = _tag_bytes(octets[begin : begin + length])
            alike.add(octets[begin : begin + max(last, 0)])
        heads[i] = last
    return heads


def _tag_bytes(packet: bytes) -> int:
    at, dissector = 0, b""
    while at + 4 <= len(packet):
        tag, width = int.from_bytes(packet[at : at + 2], "big"), int.from_bytes(packet[at + 2 : at + 4], "big")
        at += 4
        if tag == 0:
            return at if dissector in _MODBUS else -1
        if tag == _TAG_DISSECTOR:
            dissector = packet[at : at + width].rstrip(b"\x00")
        at += width
    return -1


@dataclass(frozen=True, slots=True, eq=False)
class Segments:
    """TCP segments and UDP datagrams, in packet order.

    `key` is source, destination (16 bytes each, IPv4 mapped), their ports (2 each) and the protocol's number (4).
    `begin` and `size` are the payload as captured, `missing` what the snap length cut off it. Datagrams have no `seq`,
    `ack` and `flags`.
    """

    packet: Ints
    key: Bytes  # n rows of KEY bytes
    seq: Ints
    ack: Ints
    flags: Ints
    begin: Ints
    size: Ints
    missing: Ints
    other: int  # packets of something else

    @property
    def datagrams(self) -> NDArray[np.bool_]:
        """Which are of UDP."""
        datagrams: NDArray[np.bool_] = self.key[:, KEY - 1] == UDP
        return datagrams


def segments_of(packets: Packets, chosen: Ints, link: int) -> Segments:
    """The segments and datagrams of these packets, whose link type is one of NETWORK."""
    data, at = packets.data, packets.at[chosen]
    end = at + packets.size[chosen]
    ip = _ip(data, at, link)
    version = take_bytes(data, ip) >> 4
    parts = []
    four = np.flatnonzero((version == 4) & (ip + 20 <= end))
    if len(four):
        begins = ip[four]
        header = (take_bytes(data, begins) & 15) * 4
        total = take_number(data, begins + 2, 2)
        carried = take_bytes(data, begins + 9)
        intact = np.isin(carried, (_TCP, UDP)) & (take_number(data, begins + 6, 2) & 0x3FFF == 0) & (header >= 20)
        # a length of 0: the network card was to cut the segment
        length = np.where(total == 0, end[four] - begins, total)
        ends = _Ends(begins + header, begins + length, carried, range(12, 20))
        parts.append(_of_version(data, four[intact], begins[intact], ends, intact))
    six = np.flatnonzero((version == 6) & (ip + 40 <= end))
    if len(six):
        begins = ip[six]
        following, tcp = take_bytes(data, begins + 6), begins + 40
        for _ in range(4):
            extended = np.isin(following, _V6_EXTENSIONS) & (tcp < end[six])
            following = np.where(extended, take_bytes(data, tcp), following)
            tcp = np.where(extended, tcp + 8 * (take_bytes(data, tcp + 1) + 1), tcp)
        intact = np.isin(following, (_TCP, UDP))
        ends = _Ends(tcp, begins + 40 + take_number(data, begins + 4, 2), following, range(8, 40))
        parts.append(_of_version(data, six[intact], begins[intact], ends, intact))
    return _segments_of_all(packets, chosen, end, parts)


def _ip(data: Bytes, at: Ints, link: int) -> Ints:
    """Where the IP headers would begin; where the type says something else, at a byte that is no IP version."""
    if link in _IP_AT:
        return at + _IP_AT[link]
    types, behind = at + _TYPE_AT[link], at + _BEHIND[link]
    kind = take_number(data, types, 2)
    for _ in range(_VLANS):
        tagged = np.isin(kind, _VLAN)
        if not tagged.any():
            break
        kind = np.where(tagged, take_number(data, behind + 2, 2), kind)
        behind = np.where(tagged, behind + 4, behind)
    return np.where((kind == 0x0800) | (kind == 0x86DD), behind, len(data) + 64)


@dataclass(frozen=True, slots=True, eq=False)
class _Ends:
    """Where IP packets' payloads begin and end, of which protocol they are, and which bytes their addresses are."""

    begin: Ints
    end: Ints
    carried: Ints
    addresses: range


@dataclass(frozen=True, slots=True, eq=False)
class _VersionSegments:
    """Segments of one IP version: `which` of the chosen packets, and their keys."""

    which: Ints
    keys: Bytes
    tcp: Ints
    end: Ints


def _of_version(data: Bytes, which: Ints, ip: Ints, ends: _Ends, intact: NDArray[np.bool_]) -> _VersionSegments:
    tcp, end = ends.begin[intact], ends.end[intact]
    keys = np.zeros((len(tcp), KEY), np.uint8)
    width = len(ends.addresses) // 2
    for side in (0, 1):
        indices = ip[:, None] + np.array(ends.addresses[side * width : (side + 1) * width])
        keys[:, 16 * side + 16 - width : 16 * side + 16] = data.take(indices, mode="clip")
        if width < 16:
            keys[:, 16 * side + 10 : 16 * side + 12] = 0xFF
    keys[:, 32:36] = data.take(tcp[:, None] + np.arange(4), mode="clip")
    keys[:, KEY - 1] = ends.carried[intact]
    return _VersionSegments(which, keys, tcp, end)


def _segments_of_all(packets: Packets, chosen: Ints, captured: Ints, parts: list[_VersionSegments]) -> Segments:
    data = packets.data
    none = [np.zeros(0, np.int64)]
    keys = np.concatenate([part.keys for part in parts] or [np.zeros((0, KEY), np.uint8)])
    which = np.concatenate([part.which for part in parts] or none)
    tcp = np.concatenate([part.tcp for part in parts] or none)
    end = np.concatenate([part.end for part in parts] or none)
    if len(parts) > 1:
        order = np.argsort(which, kind="stable")
        which, tcp, end, keys = which[order], tcp[order], end[order], keys[order]
    datagram = keys[:, KEY - 1] == UDP
    header = np.where(datagram, _UDP_HEADER, _TCP_HEADER)
    begin = tcp + np.where(datagram, header, (take_bytes(data, tcp + 12) >> 4) * 4)
    captured_to = captured[which]
    sound = (tcp + header <= captured_to) & (begin >= tcp + header) & (begin <= end)
    if not sound.all():
        which, tcp, end, begin, captured_to, keys, datagram = (
            column[sound] for column in (which, tcp, end, begin, captured_to, keys, datagram)
        )
    stop = np.minimum(end, captured_to)
    begin = np.minimum(begin, stop)
    return Segments(
        packet=chosen[which],
        key=keys,
        seq=np.where(datagram, 0, take_number(data, tcp + 4, 4)),
        ack=np.where(datagram, 0, take_number(data, tcp + 8, 4)),
        flags=np.where(datagram, 0, take_bytes(data, tcp + 13)),
        begin=begin,
        size=stop - begin,
        missing=end - stop,
        other=len(chosen) - len(which),
    )
