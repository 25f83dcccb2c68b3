"""Which TCP connections carry Modbus, by what they carry: no port number tells, for gateways use any.

Modbus TCP shows by its headers (protocol 0, a length that ends where the next header or the segment does), whatever the
functions are; ASCII mode by its signs; RTU over TCP by right check values, where a judge is given that knows them, else
by answers that begin as their requests do. What else a plant's network carries is known in `neighbours`.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from itertools import accumulate, pairwise
from typing import Final

from ..chunks import Mark
from ..text.judging import ByteJudge, no_judge

MBAP: Final = 7  # bytes of a header: transaction, protocol, length, unit
SAMPLE: Final = 64  # reads of a connection by which it is judged
SAMPLE_BYTES: Final = 1 << 12
_LENGTHS: Final = range(2, 255)  # that a header may give: unit and PDU
_LENGTH_END: Final = 6  # bytes of a header that end with the length
_LONGEST: Final = 256  # bytes of an RTU frame
_LEAST: Final = 4
_SHARE: Final = 0.6  # of the bytes, or reads, that must look like it
_CHECKED: Final = 0.3  # of the bytes, in frames with a right check value: lines are damaged, such values are no chance
_ASCII: Final = re.compile(rb"[:>](?:[0-9A-Fa-f]{2}){3,256}\r?\n?")
_FUNCTIONS: Final = frozenset({*range(1, 9), 11, 12, *range(15, 18), *range(20, 25), 43})
_UNITS: Final = range(248)

Reads = Sequence[tuple[Mark, bytes]]


def whole_adus(data: bytes) -> int:
    """How many of these bytes are Modbus TCP frames, one after the other from the first byte on, each of them whole."""
    at = 0
    while (size := _announced(data, at)) and at + size <= len(data):
        at += size
    return at


def may_begin(data: bytes) -> bool:
    """Whether these bytes, fewer than a frame, may be the beginning of a Modbus TCP frame."""
    if len(data) < _LENGTH_END:
        return not any(data[2:4])
    return _announced(data, 0) > 0


def _announced(data: bytes, at: int) -> int:
    """The bytes of the frame that a header at this place announces; 0 where none stands there, or not all of it."""
    if at + _LENGTH_END > len(data) or data[at + 2] or data[at + 3] or data[at + 4]:
        return 0
    return _LENGTH_END + data[at + 5] if data[at + 5] in _LENGTHS else 0


def kind_of(reads: Reads, judge: ByteJudge = no_judge) -> str | None:
    """`tcp`, `ascii` or `rtu` for what the reads of a connection carry; None for something else."""
    if not reads:
        return None
    if _looks_tcp(reads):
        return "tcp"
    turns = _turns(reads)
    if sum(_ASCII.fullmatch(data) is not None for _, data in turns) >= _SHARE * len(turns):
        return "ascii"
    if judge is not no_judge:
        return "rtu" if _checked(turns, judge) else None
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
    """Whether what both sides sent is mostly frames end to end, wherever the capture began."""
    framed = octets = 0
    for mark in (Mark.TX, Mark.RX):
        mine = [data for one, data in reads if one == mark]
        framed += _framed(b"".join(mine), set(accumulate(map(len, mine), initial=0)))
        octets += sum(map(len, mine))
    return 0 < framed >= _SHARE * octets


def _framed(stream: bytes, edges: Collection[int]) -> int:
    """How many bytes are whole frames that end where a read does or another header begins."""
    at = framed = 0
    follows = True  # a frame ends here, or the stream begins
    while at + MBAP < len(stream):
        end = at + _announced(stream, at)
        ends = end in edges or (end + _LENGTH_END <= len(stream) and _announced(stream, end) > 0)
        if at < end <= len(stream) and ends and (follows or at in edges or end in edges):
            framed, at, follows = framed + end - at, end, True
        else:
            at, follows = at + 1, False
    return framed


def _checked(turns: Reads, judge: ByteJudge) -> bool:
    """Whether frames with a right check value make a good part of what was said."""
    right = sum(span.end - span.start for _, data in turns for span in judge(data) if span.envelope == "rtu")
    return 0 < right >= _CHECKED * sum(len(data) for _, data in turns)


def _looks_rtu(turns: Reads) -> bool:
    """The same for those who know no check values: functions in use, and answers that begin as their requests do."""
    pairs = [(request, answer) for (one, request), (two, answer) in pairwise(turns) if (one, two) == (Mark.TX, Mark.RX)]
    if pairs:
        fitting = sum(
            _may_be_rtu(request)
            and len(answer) >= _LEAST
            and request[0] == answer[0]
            and request[1] == answer[1] & 0x7F
            for request, answer in pairs
        )
        return fitting >= _SHARE * len(pairs)
    likely = sum(_may_be_rtu(data) for _, data in turns)
    return likely >= 2 and likely >= 0.9 * len(turns)


def _may_be_rtu(data: bytes) -> bool:
    return _LEAST <= len(data) <= _LONGEST and data[0] in _UNITS and data[1] & 0x7F in _FUNCTIONS
