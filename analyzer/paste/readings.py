"""The table of readings: what bytes may be that no right frame explains, each with its price in bits.

A deframer weighs bytes as a line carries them. A text leaves out and cuts: a CRC, the end of a frame, the beginning of
an answer. Of a stretch (the bytes of one part, between frames) every reading of the table names frames; those that fit
end to end with the greatest sum are taken; what nothing speaks for stays noise. So nothing stands above the sum: a
reading that explains more beats one that is tried before it.
"""

# ruff: noqa: ARG005 - a row of a table is a function whether it needs its arguments or not

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from math import log2
from typing import Final, NamedTuple

from dissectors.crc import INIT, byte_between, crc_ends, needed
from dissectors.envelopes import Adu, ascii_frames, rtu, tcp
from dissectors.foreign import is_undeclared
from dissectors.functions import function
from dissectors.length_rules import Role
from dissectors.lengths import expectation, miscounted_role, pdu_length, plausibility
from dissectors.limits import CRC_SIZE, EXCEPTION, MAX_ADU, MIN_ADU

from ..deframing.judging import judge, predicted, predicted_roles
from ..deframing.weighing import begins_tcp, rtu_bits, rtu_head_bits, tcp_head_bits, tells_ascii
from .model import Envelope, PastedFrame

BOTH: Final = (Role.REQUEST, Role.RESPONSE)
_LEAST: Final = 3  # bytes, from which on a rest is a beginning rather than a glitch
_MOST_BEFORE: Final = 8  # bytes before an answer that are none of it: what a receiver had left over
_LAST_CODE: Final = 0x0B  # of exceptions
_ALIKE: Final = 4.0  # bits: one limit broken, with which the other direction is still possible
_UNCHECKED: Final = 8.0  # for a limit that is broken where no check value is there
_FUNCTION: Final = 4.0  # a score of 256
_MISSING: Final = 0.5  # for twice as many bytes that are missing
_LEFT: Final = 2.0  # for a byte that is left
_NAMED: Final = 8.0  # the user says that it is Modbus TCP
_ENDS: Final = 3.5  # a length that counts just what there is
_HEADED: Final = 0.5  # a header, however little fits behind it, over noise
_MARKED: Final = 6.0  # against another direction than a line is marked with
_OTHERS: Final = 8.0  # against another envelope than that of the rest
_LRC_BITS: Final = 12.0  # as of a line that speaks ASCII mode
_SHOWN: Final = 6.0  # a frame in ASCII mode whose LRC is wrong, where the text shows that it is one
_WINDOWS: Final = 64  # with a right CRC that are looked at
_ODD: Final = 8.0  # a right CRC where nothing says that the frame ends
_EITHER, _SURE = 0.5, 0.9999
_MBAP_LENGTH: Final = 6  # bytes of an MBAP header that end with the length


class LeftBytes(NamedTuple):
    """Bytes of one part of a paste that are no right frame, and what is known beside them.

    `request`: the one that may be answered here. `damaged`: what the deframer made of them. `side`: who speaks, by the
    text's marks. `spoken`: envelopes that are proven elsewhere in the paste. `counted`: nothing of the paste is right,
    and half of its parts or more are as long as their headers say. `whole`: all of a part; `last`: they end the paste;
    `alone`: they are all of it; `colon`: the text shows ASCII mode.
    """

    data: bytes
    start: int
    roles: Sequence[Role] = ()
    envelope: Envelope = "auto"
    request: PastedFrame | None = None
    damaged: Sequence[PastedFrame] = ()
    side: Role | None = None
    spoken: Collection[str] = ()
    counted: bool = False
    whole: bool = False
    last: bool = False
    alone: bool = False
    colon: bool = False


class ReadFrame(NamedTuple):
    """Bytes [at, end) of a stretch as a frame of which so many bytes are missing; `bits` speak for it."""

    at: int
    end: int
    bits: float
    frame: PastedFrame


class ReadingRow(NamedTuple):
    """A row: its name, the envelope that it is of, the bits that it has or costs besides those of the bytes, where it
    is tried, and how it reads."""

    name: str
    envelope: Envelope
    bits: float
    applies: Callable[[LeftBytes], bool]
    read: Callable[[LeftBytes], Iterator[ReadFrame]]


def _due_answer(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """The answer that was due, wherever it begins: whole, cut, or with a wrong CRC."""
    asked = stretch.request
    if asked is None or Role.RESPONSE not in stretch.roles:
        return
    due = expectation(bytes([asked.adu.unit or 0]) + asked.adu.pdu)
    for at in range(min(len(stretch.data) - _LEAST, _MOST_BEFORE) + 1):
        data = stretch.data[at:]
        named = bytes((due.unit, due.function | EXCEPTION))
        refused = data.startswith(named) and 0 < data[2] <= _LAST_CODE
        length = predicted(data, Role.RESPONSE) or -1
        if length > 0 and (refused or data.startswith(due.header)):
            found = _candidate(stretch, at, length, Role.RESPONSE, 8.0 * len(named if refused else due.header) - at)
            yield found._replace(frame=replace(found.frame, request=asked.adu.pdu, request_start=asked.start))


def _own_echo(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """The request itself, come back cut, or as it was, with a wrong CRC."""
    asked = stretch.request
    for at in range(min(len(stretch.data) - _LEAST, _MOST_BEFORE) + 1):
        if asked is not None and asked.adu.data.startswith(stretch.data[at:]):
            whole = asked.length + asked.missing
            yield _candidate(stretch, at, whole, Role.REQUEST, 8.0 * (len(stretch.data) - at) - at)


def _as_deframed(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """A damaged frame of the deframer's, also in the other direction where that is as long."""
    for frame in stretch.damaged:
        at = frame.start - stretch.start
        for role in stretch.roles:
            if role is frame.role or predicted(frame.adu.data, role) == frame.length:
                bits = max(rtu_bits(frame.adu.data, (role,)), 0.0) - (_ALIKE + 1) * (role is not frame.role)
                yield ReadFrame(at, at + frame.length, bits, replace(frame, role=role))


def _end_to_end(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """Frames as long as their headers say, one behind the other, all with wrong CRCs."""
    for span in judge(stretch.data, damaged=True):
        data = stretch.data[span.start : span.end]
        for role in sorted({*stretch.roles} & {*predicted_roles(data)}):
            yield _candidate(stretch, span.start, len(data), role, rtu_bits(data, (role,)))


def _right_crc(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """Frames of whatever length with a right CRC, up to the edge of a text, or of a function in use."""
    data, starts = stretch.data, [0]
    for at in starts:
        for end in crc_ends(data, at, MAX_ADU) if len(starts) < _WINDOWS else ():
            code, odd = data[at + 1], end < len(data)
            if odd and function(code) is None:
                continue
            starts.append(end)
            likelier = Role.RESPONSE if code & EXCEPTION else miscounted_role(code)
            for role in stretch.roles:
                yield _candidate(stretch, at, end - at, role, -_ODD * odd - (role is not likelier))


def _begun(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """The beginning of a frame, or one with more behind it; of one that breaks a limit only its CRC would tell."""
    size = len(stretch.data)
    for role in stretch.roles:
        length = predicted(stretch.data, role)
        if (length is not None and not 0 < length <= MAX_ADU) or not _is_in_use(stretch.data[1:2]):
            continue
        whole = length or max(MIN_ADU, size + 1)
        bits = rtu_bits(stretch.data, (role,))
        if length is None or whole - size not in (0, CRC_SIZE):
            off = _MISSING * log2(1 + max(whole - size, 0)) + _LEFT * max(size - whole, 0)
            bits = rtu_head_bits(stretch.data, (role,)) + _FUNCTION - off
        if whole != size:
            bits -= _UNCHECKED * len(plausibility(stretch.data[1 : whole - CRC_SIZE * (whole < size)], role))
        yield _candidate(stretch, 0, whole, role, bits, known=length is not None)


def _is_in_use(code: bytes) -> bool:
    """Whether a function byte, where there is one, is of a function in use, or of its exception."""
    return not code or function(code[0] & ~EXCEPTION) is not None


def _without_crc(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """A unit and a whole PDU, as many programs print it."""
    return (one for one in _begun(stretch) if one.frame.length_known and one.frame.missing == CRC_SIZE)


def _headed(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """MBAP headers from the first byte on, each where the frame before it ends."""
    at, data = 0, stretch.data
    while begins_tcp(data, at):
        end = at + _MBAP_LENGTH + data[at + 5]
        adu = tcp(data[at:end], stretch.start + at)
        bits = tcp_head_bits(data[at:end]) + _ENDS * (end == len(data))
        if end == len(data) or not adu.pdu or not is_undeclared(adu.pdu[0] & ~EXCEPTION):
            bits = max(bits, _HEADED)
        frame = directed(adu, stretch.roles, missing=end - at - adu.length)
        yield ReadFrame(at, at + adu.length, bits + _NAMED * (stretch.envelope == "tcp"), frame)
        at = end


def _colons(stretch: LeftBytes) -> Iterator[ReadFrame]:
    """Frames of ASCII mode: with a right LRC, or where the text or the user says that they are."""
    shown = _SHOWN if stretch.colon or stretch.envelope == "ascii" else 0.0
    for adu in ascii_frames(stretch.data):
        frame = directed(replace(adu, start=stretch.start + adu.start), stretch.roles)
        bits = _LRC_BITS if tells_ascii(adu, stretch.data) else shown
        yield ReadFrame(adu.start, adu.start + adu.length, bits, frame)


READINGS: Final = (
    ReadingRow("due answer", "rtu", 0.0, lambda s: True, _due_answer),
    ReadingRow("own echo", "rtu", 0.0, lambda s: True, _own_echo),
    ReadingRow("as deframed", "rtu", 4.0, lambda s: bool(s.damaged), _as_deframed),
    ReadingRow("end to end", "rtu", 0.0, lambda s: s.whole and (s.counted or s.alone), _end_to_end),
    ReadingRow("right CRC", "rtu", 16.0, lambda s: s.whole, _right_crc),
    ReadingRow("without CRC", "rtu", 0.0, lambda s: s.whole, _without_crc),
    ReadingRow("cut", "rtu", 0.0, lambda s: s.alone or (s.last and len(s.data) >= _LEAST), _begun),
    ReadingRow("MBAP", "tcp", 0.0, lambda s: s.whole, _headed),
    ReadingRow("colon", "ascii", 0.0, lambda s: True, _colons),
)


def chosen(stretch: LeftBytes) -> list[ReadFrame]:
    """The frames of a stretch that fit end to end with the greatest sum, in order; none where noise costs less, or a
    frame that lacks its unit."""
    found = [
        candidate._replace(bits=candidate.bits + row.bits + _beside(candidate.frame, stretch))
        for row in READINGS
        if stretch.envelope in ("auto", row.envelope) and row.applies(stretch)
        for candidate in row.read(stretch)
    ]
    ends, sums, before, best = [0], [0.0], [0], [0]  # of the way that each candidate ends; `best` of those so far
    ordered = sorted(found, key=lambda one: one.end)
    for number, one in enumerate(ordered, 1):
        before.append(best[bisect_right(ends, one.at) - 1])
        sums.append(sums[before[-1]] + one.bits)
        ends.append(one.end)
        best.append(number if sums[-1] > sums[best[-1]] else best[-1])
    way: list[ReadFrame] = []
    at = best[-1] if sums[best[-1]] > _without_unit(stretch.data) else 0
    while at:
        way.append(ordered[at - 1])
        at = before[at]
    return _either_way(way[::-1], found)


def _without_unit(data: bytes) -> float:
    """What speaks for a PDU and its CRC, which is right with the unit's byte that is missing before them."""
    unit = byte_between(INIT, needed(data)[0])
    return 0.0 if unit is None else max(rtu_bits(bytes((unit,)) + data), 0.0)


def _beside(frame: PastedFrame, stretch: LeftBytes) -> float:
    """What the rest of a text speaks for a frame: whose line it stands in, and the envelope of the others."""
    others = bool(stretch.spoken) and frame.adu.protocol not in stretch.spoken
    return -_MARKED * (stretch.side not in (None, frame.role)) - _OTHERS * others


def _either_way(way: Sequence[ReadFrame], found: Sequence[ReadFrame]) -> list[ReadFrame]:
    """Frames, with the other direction beside those for which it has nearly as many bits."""
    other_bits = {_extent(one.frame, one.frame.role): one.bits for one in sorted(found, key=lambda one: one.bits)}
    both: list[ReadFrame] = []
    for one in way:
        role = other(one.frame.role)
        alike = other_bits.get(_extent(one.frame, role), one.bits - 2 * _ALIKE) >= one.bits - _ALIKE
        also = role if alike and one.frame.request is None else one.frame.also
        both.append(one._replace(frame=replace(one.frame, also=also)))
    return both


def _extent(frame: PastedFrame, role: Role) -> tuple[int, int, int, str, Role]:
    return frame.start, frame.length, frame.missing, frame.adu.protocol, role


def _candidate(stretch: LeftBytes, at: int, length: int, role: Role, bits: float, *, known: bool = True) -> ReadFrame:
    data = stretch.data[at : at + length]
    frame = unchecked(data, stretch.start + at, role, length - len(data), known=known)
    return ReadFrame(at, at + len(data), bits, frame)


def unchecked(data: bytes, start: int, role: Role, missing: int, *, known: bool = True) -> PastedFrame:
    """A frame at an offset of the paste, of which so many bytes are missing; 0: its CRC may be right or wrong."""
    adu: Adu = replace(rtu(data), start=start)
    if missing:  # its last two bytes are no check value yet
        half = int(missing == 1)
        adu = replace(adu, pdu=data[1 : len(data) - half], check_ok=False, check_received=None, check_computed=None)
    return PastedFrame(adu, role, start, len(data), missing=missing, length_known=known, confidence=0.5)


def possible(pdu: bytes, roles: Sequence[Role]) -> Sequence[Role]:
    """The roles whose predicted length is that of the PDU, of these if any is; these if none is."""
    fits = [role for role in Role if pdu and pdu_length(pdu, role) == len(pdu)]
    return [role for role in roles if role in fits] or fits or roles


def other(role: Role) -> Role:
    """The other direction."""
    return Role.RESPONSE if role is Role.REQUEST else Role.REQUEST


def answers(request: Adu, response: Adu) -> bool:
    """Whether one frame can be the answer to another: unit, transaction (TCP), and what the function echoes."""
    tied = request.protocol != "tcp" or request.data[:2] == response.data[:2]
    if request.protocol != response.protocol or not request.pdu or not tied:
        return False
    head, tail = (bytes([adu.unit or 0]) + adu.pdu for adu in (request, response))
    return expectation(head).fits(tail)


def directed(adu: Adu, roles: Sequence[Role], *, missing: int = 0) -> PastedFrame:
    """A frame in the direction in which its PDU breaks fewer limits, the request if neither; of another length than
    both, in the one that counts."""
    can_be = possible(adu.pdu, roles)
    role = min(can_be, key=lambda role: (len(plausibility(adu.pdu, role)), role))
    if len(can_be) > 1 and adu.pdu and pdu_length(adu.pdu, role) != len(adu.pdu):
        role = miscounted_role(adu.pdu[0])
    also = other(role) if len(can_be) > 1 else None
    sure = _SURE if also is None and adu.check_ok is not False and not missing else _EITHER
    return PastedFrame(adu, role, adu.start, adu.length, also=also, missing=missing, confidence=sure)
