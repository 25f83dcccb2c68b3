"""Packets that Wireshark wrote out, as PDML, as JSON or as text with their bytes, put back into a pcap.

Of PDML and JSON it is one of raw IP: of each packet the time, the addresses, where it stands in its stream and what it
carries, which is all that a stream is made of again.
"""

from __future__ import annotations

import codecs
import json
import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress
from decimal import Decimal, InvalidOperation
from ipaddress import ip_address
from socket import IPPROTO_TCP, IPPROTO_UDP
from typing import Any, BinaryIO, Final

_PIECE: Final = 1 << 18
_RAW_IP: Final = 101  # the link type
_HEAD: Final = struct.Struct("<IHHiIII")
_NS: Final = 0xA1B23C4D, 2, 4, 0, 0, 1 << 18  # times in ns
_MOST: Final = 1 << 15  # bytes that a packet carries


def pdml_packets(file: BinaryIO) -> Iterator[bytes]:
    """The packets of a PDML file as a pcap."""
    from xml.etree import ElementTree

    def fields() -> Iterator[Mapping[str, str]]:
        events = ElementTree.iterparse(file, ("start", "end"))
        _, root = next(events)
        for event, element in events:
            if event == "end" and element.tag == "packet":
                yield {
                    field.get("name", ""): field.get("value" if field.get("name") in _BY_VALUE else "show", "")
                    for field in element.iter("field")
                }
                root.clear()

    return _pcap(fields())


def json_packets(file: BinaryIO) -> Iterator[bytes]:
    """The packets of a JSON file of Wireshark's as a pcap."""

    def packets() -> Iterator[Any]:
        decoder, source, size = json.JSONDecoder(), codecs.getreader("utf-8")(file, "replace"), _PIECE
        text = source.read(size)
        while True:
            text = text.lstrip("[, \r\n\t")
            try:
                packet, end = decoder.raw_decode(text)
            except json.JSONDecodeError:
                size *= 2
                more = source.read(size)
                if not more:
                    return
                text += more
                continue
            yield packet
            text, size = text[end:], _PIECE

    return _pcap(dict(_flat(packet)) for packet in packets())


def dissected_packets(file: BinaryIO) -> Iterator[bytes]:
    """The packets of `tshark -V -x`, and of what Wireshark exports as text with details and bytes, as a pcap.

    All are of the first one's encapsulation. Of a packet's dumps the first is the packet.
    """
    size, octets = 0, b""
    link: int | None = None
    time: Decimal | None = None
    for line in file:
        name, _, told = line.strip().partition(b":")
        with suppress(LookupError, ValueError, InvalidOperation):
            if line.startswith(b"Frame "):
                size, octets, time = int(told.split(b", ")[1].split()[0]), b"", None
            elif name == b"Encapsulation type" and link is None:
                link = _LINKS.get(int(told.rpartition(b"(")[2].rstrip(b")")), _UNKNOWN)
                yield _HEAD.pack(*_NS, link)
            elif name in _EPOCHS:
                time = Decimal(told.split()[0].decode())
            elif size and time is not None and link is not None:
                place, _, row = line.partition(b"  ")
                octets = octets[: int(place, 16)] + bytes.fromhex(row.partition(b"   ")[0].decode())
                if len(octets) >= size:
                    head = struct.pack("<IIII", *divmod(int(time * 10**9), 10**9), size, size)
                    size, octets = 0, octets[:size]
                    yield head + octets


def _flat(tree: object) -> Iterator[tuple[str, str]]:
    """The fields of a packet, wherever in its tree they stand; of several of a name the last."""
    waiting = [tree]
    while waiting:
        node = waiting.pop()
        for name, value in node.items() if isinstance(node, dict) else ():
            first = value[0] if isinstance(value, list) and value else value
            if isinstance(first, str):
                yield name, first
            elif isinstance(first, dict):
                waiting.append(first)


_EPOCHS: Final = frozenset((b"Epoch Time", b"Epoch Arrival Time"))  # until Wireshark 4.0, and since
_LINKS: Final = {  # Wireshark's numbers of encapsulations: link types
    1: 1, 7: _RAW_IP, 15: 0, 25: 113, 45: 147, 95: 189, 115: 220, 129: 228, 130: 229, 152: 249, 153: 250, 155: 252,
    174: 108, 210: 276,
}  # fmt: skip
_UNKNOWN: Final = 0xFFFF  # no link type
_BY_VALUE: Final = frozenset(("timestamp", "tcp.payload", "udp.payload"))  # which PDML shows otherwise
_TIMES: Final = "frame.time_epoch", "timestamp"


def _pcap(packets: Iterator[Mapping[str, str]]) -> Iterator[bytes]:
    """A pcap of packets that are given by the names of their fields; what carries neither TCP nor UDP is left out."""
    yield _HEAD.pack(*_NS, _RAW_IP)
    for fields in packets:
        with suppress(KeyError, ValueError, InvalidOperation, OverflowError, struct.error):
            t_ns = int(Decimal(next(fields[name] for name in _TIMES if name in fields)) * 10**9)
            octets = _ip(fields)
            yield struct.pack("<IIII", *divmod(t_ns, 10**9), len(octets), len(octets)) + octets


def _ip(fields: Mapping[str, str]) -> bytes:
    """A packet of raw IP; KeyError or ValueError where a field that it needs is missing or none."""
    version = "ip" if "ip.src" in fields else "ipv6"
    source, target = (ip_address(fields[f"{version}.{end}"]).packed for end in ("src", "dst"))
    kind = "udp" if "udp.srcport" in fields else "tcp"
    carried = bytes.fromhex(fields.get(f"{kind}.payload", "").replace(":", ""))[:_MOST]
    ports = struct.pack(">HH", int(fields[f"{kind}.srcport"]), int(fields[f"{kind}.dstport"]))
    if kind == "udp":
        protocol, head = IPPROTO_UDP, struct.pack(">HH", 8 + len(carried), 0)
    else:
        place, heard = (int(fields.get(f"tcp.{name}_raw") or fields[f"tcp.{name}"]) for name in ("seq", "ack"))
        flags = int(fields["tcp.flags"], 16) & 0x3F
        protocol, head = IPPROTO_TCP, struct.pack(">IIBBHHH", place, heard, 0x50, flags, 0, 0, 0)
    whole = ports + head + carried
    if version == "ipv6":
        return struct.pack(">IHBB", 6 << 28, len(whole), protocol, 64) + source + target + whole
    return struct.pack(">BBHHHBBH", 0x45, 0, 20 + len(whole), 0, 0x4000, 64, protocol, 0) + source + target + whole
