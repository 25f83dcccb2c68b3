"""Packet files made byte by byte: pcap and pcapng, TCP over Ethernet, VLAN, Linux cooked, raw IP; serial link types."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass, field

from captures.chunks import Capture

FIN, SYN, RST, PSH, ACK = 1, 2, 4, 8, 16
CLIENT, SERVER = ("10.0.0.1", 50001), ("10.0.0.9", 502)
Packet = tuple[int, bytes]  # time in ns, bytes
End = tuple[str, int]


def pcap(
    packets: Iterable[Packet], link: int = 1, order: str = "<", nanoseconds: bool = False, snap: int = 262144
) -> bytes:
    """A pcap file; packets longer than `snap` are cut."""
    magic, unit = (0xA1B23C4D, 1) if nanoseconds else (0xA1B2C3D4, 1000)
    out = [struct.pack(f"{order}IHHiIII", magic, 2, 4, 0, 0, snap, link)]
    for t_ns, packet in packets:
        cut = packet[:snap]
        out.append(struct.pack(f"{order}IIII", t_ns // 10**9, t_ns % 10**9 // unit, len(cut), len(packet)) + cut)
    return b"".join(out)


def pcapng_block(kind: int, body: bytes, order: str = "<") -> bytes:
    size = len(body) + 12
    return struct.pack(f"{order}II", kind, size) + body + struct.pack(f"{order}I", size)


def pcapng_option(code: int, value: bytes, order: str = "<") -> bytes:
    return struct.pack(f"{order}HH", code, len(value)) + value + bytes(-len(value) % 4)


def pcapng(
    packets: Iterable[tuple[int, int, bytes, bytes]], links: list[int], order: str = "<", resolution: int = 6
) -> bytes:
    """A pcapng file of packets (interface, time in ns, bytes, options); an interface a link type."""
    out = [pcapng_block(0x0A0D0D0A, struct.pack(f"{order}IHHq", 0x1A2B3C4D, 1, 0, -1), order)]
    resolved = pcapng_option(9, bytes([resolution]), order) + bytes(4)
    out += [pcapng_block(1, struct.pack(f"{order}HHI", link, 0, 0) + resolved, order) for link in links]
    for interface, t_ns, packet, options in packets:
        stamp = t_ns // 10 ** (9 - resolution)
        head = struct.pack(f"{order}IIIII", interface, stamp >> 32, stamp & 0xFFFFFFFF, len(packet), len(packet))
        out.append(pcapng_block(6, head + packet + bytes(-len(packet) % 4) + options, order))
    return b"".join(out)


def address(text: str) -> bytes:
    import ipaddress

    return ipaddress.ip_address(text).packed


def ip_packet(source: End, destination: End, seq: int, ack: int, flags: int, data: bytes) -> bytes:
    """IPv4 or IPv6 with a TCP segment."""
    tcp = struct.pack(
        ">HHIIBBHHH", source[1], destination[1], seq & 0xFFFFFFFF, ack & 0xFFFFFFFF, 5 << 4, flags, 8192, 0, 0
    )
    return _ip(source, destination, 6, tcp + data)


def udp_packet(source: End, destination: End, data: bytes) -> bytes:
    """IPv4 or IPv6 with a UDP datagram."""
    return _ip(source, destination, 17, struct.pack(">HHHH", source[1], destination[1], 8 + len(data), 0) + data)


def _ip(source: End, destination: End, protocol: int, payload: bytes) -> bytes:
    one, two = address(source[0]), address(destination[0])
    if len(one) == 4:
        return struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(payload), 0, 0x4000, 64, protocol, 0) + one + two + payload
    return struct.pack(">IHBB", 6 << 28, len(payload), protocol, 64) + one + two + payload


def framed(packet: bytes, link: int = 1, vlans: int = 0) -> bytes:
    """An IP packet as a link type carries it."""
    kind = 0x0800 if packet[0] >> 4 == 4 else 0x86DD
    tags = b"".join(struct.pack(">HH", 0x8100, 7 + i) for i in range(vlans))
    if link == 1:
        return (bytes(12) + tags + struct.pack(">H", kind) + packet).ljust(60, b"\x00")
    if link == 113:
        return bytes(14) + struct.pack(">H", kind) + packet
    if link == 276:
        return struct.pack(">H", kind) + bytes(18) + packet
    return struct.pack("<I", 2 if kind == 0x0800 else 30) + packet if link == 0 else packet


@dataclass
class Talk:
    """A TCP connection: call it to say something, take `packets`."""

    client: End = CLIENT
    server: End = SERVER
    t_ns: int = 1_700_000_000_000_000_000
    step_ns: int = 2_000_000
    link: int = 1
    vlans: int = 0
    seqs: list[int] = field(default_factory=lambda: [1000, 0xFFFFFFF0])  # the server's wraps soon
    packets: list[Packet] = field(default_factory=list)

    def begin(self) -> Talk:
        self.put(True, b"", SYN)
        self.put(False, b"", SYN | ACK)
        self.put(True, b"", ACK)
        return self

    def end(self) -> Talk:
        self.put(True, b"", FIN | ACK)
        self.put(False, b"", FIN | ACK)
        return self

    def put(self, from_client: bool, data: bytes, flags: int = PSH | ACK) -> None:
        self.t_ns += self.step_ns
        mine, theirs = (0, 1) if from_client else (1, 0)
        ends = (self.client, self.server) if from_client else (self.server, self.client)
        packet = ip_packet(*ends, self.seqs[mine], self.seqs[theirs], flags, data)
        self.packets.append((self.t_ns, framed(packet, self.link, self.vlans)))
        self.seqs[mine] += len(data) + bool(flags & (SYN | FIN))

    def ask(self, data: bytes) -> Talk:
        self.put(True, data)
        return self

    def answer(self, data: bytes) -> Talk:
        self.put(False, data)
        return self


def mbap(transaction: int, unit: int, pdu: bytes) -> bytes:
    return struct.pack(">HHHB", transaction, 0, len(pdu) + 1, unit) + pdu


def read_request(transaction: int, unit: int = 1, start: int = 0, count: int = 2) -> bytes:
    return mbap(transaction, unit, struct.pack(">BHH", 3, start, count))


def read_answer(transaction: int, unit: int = 1, values: Iterable[int] = (17, 18)) -> bytes:
    words = b"".join(struct.pack(">H", value) for value in values)
    return mbap(transaction, unit, bytes((3, len(words))) + words)


def names(capture: Capture) -> dict[str, str]:
    """The connections of a capture, by `port N`: what its notes say besides what each port speaks."""
    return {key: name for key, name in capture.line.notes.items() if key.startswith("port ")}
