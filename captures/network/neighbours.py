"""What a plant's network carries beside Modbus, by how its packets begin: named where a connection is left out.

EtherNet/IP (ODVA volume 2, 2-3), ISO on TCP (RFC 1006: S7 and others), OPC UA (IEC 62541-6), IEC 60870-5-104, DNP3
(IEEE 1815), TLS (RFC 8446), DCE RPC (OPC classic), FINS, MQTT, text.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final

from ..chunks import Mark

_SHARE: Final = 0.6  # of the reads that must begin so
_LOOKED_AT: Final = 64  # bytes of a read
_ENIP_HEADER: Final = 24
_ENIP_COMMANDS: Final = frozenset({0x01, 0x04, 0x63, 0x64, 0x65, 0x66, 0x6F, 0x70, 0x72, 0x73})
_APCI_LEAST: Final = 6
_TEXT: Final = (b"GET ", b"POST ", b"PUT ", b"HEAD ", b"HTTP/", b"SSH-", b"220 ", b"USER ", b"+OK ", b"RTSP/")
_TLS_RECORDS: Final = range(0x14, 0x18)


def _enip(data: bytes) -> bool:
    size = int.from_bytes(data[2:4], "little")
    return len(data) >= _ENIP_HEADER and data[1] == 0 and data[0] in _ENIP_COMMANDS and size == len(data) - _ENIP_HEADER


def _tpkt(data: bytes) -> bool:
    return data[:2] == b"\x03\x00" and int.from_bytes(data[2:4], "big") == len(data)


def _apci(data: bytes) -> bool:
    """Frames of IEC 104 end to end, of which each says how long it is."""
    at = 0
    while at + _APCI_LEAST <= len(data) and data[at] == 0x68 and data[at + 1] >= _APCI_LEAST - 2:
        at += 2 + data[at + 1]
    return at == len(data)


def _tls(data: bytes) -> bool:
    return len(data) > 5 and data[0] in _TLS_RECORDS and data[1] == 3 and data[2] <= 4


Begins = Callable[[bytes], bool]
TLS: Final = "TLS"
_NEIGHBOURS: Final[tuple[tuple[str, Begins], ...]] = (
    ("EtherNet/IP", _enip),
    ("ISO on TCP, as S7 uses it", _tpkt),
    ("OPC UA", lambda data: data[:3] in (b"HEL", b"ACK", b"OPN", b"MSG", b"CLO", b"ERR") and data[3:4] in b"FCA"),
    ("IEC 60870-5-104", _apci),
    ("DNP3", lambda data: data[:2] == b"\x05\x64" and len(data) >= 10),
    (TLS, _tls),
    ("DCE RPC, as OPC classic uses it", lambda data: data[:2] == b"\x05\x00" and data[4:5] in b"\x10\x00"),
    ("FINS", lambda data: data[:4] == b"FINS"),
    ("text", lambda data: data.startswith(_TEXT)),
)


def neighbour(reads: Sequence[tuple[Mark, bytes]]) -> str:
    """The protocol that most reads of a connection begin like; nothing for none that is known."""
    heads = [data for _, data in reads if data]
    for name, begins in _NEIGHBOURS:
        if heads and sum(map(begins, heads)) >= _SHARE * len(heads):
            return name
    return "text" if heads and heads[0].startswith(_TEXT) else ""
