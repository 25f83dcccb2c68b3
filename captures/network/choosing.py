"""Which TCP connections carry Modbus, by what they carry: no port number tells, for gateways use any.

Modbus TCP shows by its header (protocol 0, a length that ends where the segment does), ASCII mode by its signs, RTU
over TCP by answers that begin as their requests do: unit and function are the first two bytes of both.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from itertools import pairwise
from typing import Final

from ..chunks import Mark

MBAP: Final = 7  # bytes of a header: transaction, protocol, length, unit
SAMPLE: Final = 64  # reads of a connection by which it is judged
SAMPLE_BYTES: Final = 1 << 12
_LENGTHS: Final = range(2, 255)  # that a header may give: unit and PDU
_LONGEST: Final = 256  # bytes of an RTU frame
_LEAST: Final = 4
_SHARE: Final = 0.6  # of the reads, or bytes, that must look like it
_STARTS: Final = 4  # reads of a side, one of which begins a frame
_FOREIGN: Final = (b"GET ", b"POST ", b"HTTP/", b"SSH-", b"\x16\x03", b"\x14\x03", b"\x17\x03")
_ASCII: Final = re.compile(rb"[:>](?:[0-9A-Fa-f]{2}){3,256}\r?\n?")
_FUNCTIONS: Final = frozenset({*range(1, 9), 11, 12, *range(15, 18), *range(20, 25), 43})
_UNITS: Final = range(248)

Reads = Sequence[tuple[Mark, bytes]]


def whole_adus(data: bytes) -> int:
    """How many of these bytes are Modbus TCP frames, one after the other from the first byte on, each of them whole."""
    at = 0
    while at + MBAP < len(data):
        length = data[at + 4] << 8 | data[at + 5]
        if data[at + 2] or data[at + 3] or length not in _LENGTHS or at + 6 + length > len(data):
            break
        at += 6 + length
    return at


def may_begin(data: bytes) -> bool:
    """Whether these bytes, fewer than a frame, may be the beginning of a Modbus TCP frame."""
    if len(data) < MBAP - 1:
        return not any(data[2:4])
    return not any(data[2:4]) and (data[4] << 8 | data[5]) in _LENGTHS


def kind_of(reads: Reads) -> str | None:
    """`tcp`, `ascii` or `rtu` for what the reads of a connection carry; None for something else."""
    if not reads:
        return None
    if _looks_tcp(reads):
        return "tcp"
    turns = _turns(reads)
    if sum(_ASCII.fullmatch(data) is not None for _, data in turns) >= _SHARE * len(turns):
        return "ascii"
    return "rtu" if _looks_rtu(turns) else None


def _turns(reads: Reads) -> list[tuple[Mark, bytes]]:
    """What each side said before the other spoke: gateways cut frames anywhere."""
    turns: list[tuple[Mark, bytes]] = []
    for mark, data in reads:
        if turns and turns[-1][0] == mark and len(turns[-1][1]) < _LONGEST:
            turns[-1] = (mark, turns[-1][1] + data)
        else:
            turns.append((mark, data))
    return turns


def _looks_tcp(reads: Reads) -> bool:
    """Whether what either side sent is frames end to end, from one of its first reads on."""
    framed = octets = 0
    for mark in (Mark.TX, Mark.RX):
        mine = [data for one, data in reads if one == mark]
        starts = [sum(map(len, mine[:count])) for count in range(min(len(mine), _STARTS))]
        stream = b"".join(mine)
        framed += max((whole_adus(stream[start:]) for start in starts), default=0)
        octets += len(stream)
    return 0 < framed >= _SHARE * octets


def looks_foreign(reads: Reads) -> bool:
    """Whether a connection plainly carries something else than a serial line: text, TLS."""
    return any(data.startswith(_FOREIGN) or len(data) > _LONGEST for _, data in reads)


def _looks_rtu(turns: Reads) -> bool:
    pairs = [(request, answer) for (one, request), (two, answer) in pairwise(turns) if (one, two) == (Mark.TX, Mark.RX)]
    if pairs:
        fitting = sum(
            min(len(request), len(answer)) >= _LEAST
            and request[0] == answer[0]
            and request[1] == answer[1] & 0x7F
            and len(request) <= _LONGEST
            for request, answer in pairs
        )
        return fitting >= _SHARE * len(pairs)
    likely = sum(
        _LEAST <= len(data) <= _LONGEST and data[0] in _UNITS and data[1] & 0x7F in _FUNCTIONS for _, data in turns
    )
    return likely >= 2 and likely >= 0.9 * len(turns)
