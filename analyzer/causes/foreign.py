"""Other protocols that share a pair with Modbus, known by a structure that chance does not give.

Each counts its frames in bytes; a frame is one whose own check value is right.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from typing import Final

from dissectors.crc import crc16, lrc
from dissectors.crc_variants import ALGORITHMS, Algorithm

_X25: Final = next(one for one in ALGORITHMS if isinstance(one, Algorithm) and one.name == "CRC-16/X-25")
_ASCII_FRAME: Final = re.compile(rb":((?:[0-9A-Fa-f]{2}){3,255})\r\n?")
_DCON: Final = re.compile(rb"[#$%@~][0-9A-F]{2}[0-9A-Z]{0,12}\r|[!>?][0-9A-Z+\-.]{2,60}\r")
_MODBUS: Final = (1, 2, 3, 4, 5, 6, 7, 8, 15, 16, 17, 22, 23, 43)
_IDENTIFICATION: Final = re.compile(rb"/[A-Z]{2}[A-Za-z][0-9A-Z][ -~]{1,16}\r\n")


def _mstp(data: bytes) -> int:
    """BACnet MS/TP: preamble 55 FF, a header with its own check value."""
    return sum(_header_check(data[at + 2 : at + 7]) == data[at + 7] for at in _places(data, b"\x55\xff", 8))


def _header_check(header: bytes) -> int:
    check = 0xFF
    for byte in header:
        check ^= byte
        bits = check ^ check << 1 ^ check << 2 ^ check << 3 ^ check << 4 ^ check << 5 ^ check << 6 ^ check << 7
        check = (bits & 0xFE) ^ (bits >> 8 & 1)
    return ~check & 0xFF


def _hdlc(data: bytes) -> int:
    """HDLC frames of type 3 (DLMS/COSEM): 7E, A and a length, the check value of X.25, 7E."""
    count = 0
    for at in _places(data, b"\x7e\xa0", 9):
        length = (data[at + 1] & 7) << 8 | data[at + 2]
        frame = data[at + 1 : at + 1 + length]
        right = len(frame) == length > 4 and _X25(frame[:-2]) == int.from_bytes(frame[-2:], "little")
        count += right and data[at + 1 + length : at + 2 + length] == b"\x7e"
    return count


def _mbus(data: bytes) -> int:
    """M-Bus: long frames 68 L L 68 ... sum 16, short frames 10 C A sum 16."""
    count = 0
    for at in _places(data, b"\x68", 9):
        length = data[at + 1]
        end = at + 4 + length
        if data[at + 2] == length >= 3 and data[at + 3] == 0x68 and end + 1 < len(data) and data[end + 1] == 0x16:
            count += sum(data[at + 4 : end]) & 0xFF == data[end]
    for at in _places(data, b"\x10", 5):
        count += data[at + 4] == 0x16 and sum(data[at + 1 : at + 3]) & 0xFF == data[at + 3]
    return count


def _ascii(data: bytes) -> int:
    """Modbus ASCII: a colon, hex, LRC, CR LF."""
    decoded = (bytes.fromhex(found.group(1).decode()) for found in _ASCII_FRAME.finditer(data))
    return sum(lrc(frame[:-1]) == frame[-1] for frame in decoded)


def _dcon(data: bytes) -> int:
    """DCON: lines that begin with # $ % @ ~ or ! > ? and end with CR."""
    return len(_DCON.findall(data))


def _meter_readout(data: bytes) -> int:
    """IEC 62056-21: identification lines."""
    return len(_IDENTIFICATION.findall(data))


def _serial_number(data: bytes) -> int:
    """Meters with an address of four bytes, a command, and the CRC of Modbus: the same first four bytes, and it checks."""
    heads: dict[bytes, int] = {}
    for at in range(len(data) - 6):
        for length in (7, 8, 9, 10, 11, 14, 22):
            if at + length <= len(data) and crc16(data[at : at + length]) == 0:
                heads[data[at : at + 4]] = heads.get(data[at : at + 4], 0) + 1
    return max((count for head, count in heads.items() if count >= 4 and head[1] & 0x7F not in _MODBUS), default=0)


def _places(data: bytes, mark: bytes, length: int) -> list[int]:
    """Where a mark stands with so many bytes behind its beginning."""
    places, at = [], data.find(mark)
    while at >= 0 and at + length <= len(data):
        places.append(at)
        at = data.find(mark, at + 1)
    return places


PROTOCOLS: Final[Mapping[str, Callable[[bytes], int]]] = {
    "BACnet MS/TP": _mstp,
    "HDLC (DLMS/COSEM meters)": _hdlc,
    "M-Bus": _mbus,
    "Modbus ASCII": _ascii,
    "DCON": _dcon,
    "IEC 62056-21 (meters)": _meter_readout,
    "a meter's own protocol with the CRC of Modbus": _serial_number,
}
