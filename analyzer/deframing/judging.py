"""What check values say of bytes: the judge that the readers of text ask which characters are bytes.

A stretch is right when it is an RTU frame whose CRC is right at the length that its header predicts (or over all of the
bytes, whatever the header says), an ASCII frame with a right LRC, or Modbus TCP: headers from the first byte on, end to
end, each with protocol 0 and the length that its function predicts. Plain Python, at a bounded price.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, Literal

from captures.checked import Checked
from dissectors.crc import crc_bytes, crc_ok
from dissectors.envelopes import MBAP, ascii_frames, tcp_frames
from dissectors.lengths import Role, declared_roles, expectation, pdu_length, plausibility, rule, sound_roles
from dissectors.limits import CRC_SIZE, EXCEPTION, LAST_UNIT, MAX_ADU, MIN_ADU, OVERHEAD

from .weighing import tells_ascii

_REACH: Final = 20  # places, behind the last right frame, at which another may begin
_LAST_EXCEPTION: Final = 0x0B
_LEAST_DAMAGED: Final = 6  # bytes that a header speaks for
_LEAST_BARE: Final = 3  # bytes of a frame without its CRC
_MOST_DAMAGED: Final = 1024


def predicted(data: bytes, role: Role) -> int | None:
    """Length of the RTU ADU that begins with `data`: None while its header is not whole, -1 where none can be told."""
    if len(data) > 1 and rule(data[1], role) is None:
        return -1
    length = pdu_length(data[1:], role)
    return length if length in (None, -1) else length + OVERHEAD


def judge(data: bytes, *, damaged: bool = False) -> list[Checked]:
    """The stretches of these bytes whose check value is right, or turned round, in order; none overlaps another.

    `damaged`: where there are none, all of it if frames are as long as their headers say, with a wrong CRC or without.
    """
    return _right(data) or _turned(data) or (_as_announced(data) if damaged else [])


def _turned(data: bytes) -> list[Checked]:
    """Frames end to end whose CRC has its bytes the wrong way round, as programs send it that mistake their order."""
    frames: list[Checked] = []
    at = 0
    while MIN_ADU <= len(data) - at <= _MOST_DAMAGED:
        head = data[at : at + MAX_ADU]
        lengths = (predicted(head, role) or 0 for role in Role)
        length = next((size for size in lengths if MIN_ADU <= size <= len(head) and _is_turned(head[:size])), 0)
        if not length:
            return []
        frames.append(Checked(at, at + length, _answers_itself(head[: length - CRC_SIZE]), "rtu", turned=True))
        at += length
    return frames if at == len(data) else []


def _is_turned(adu: bytes) -> bool:
    return crc_bytes(adu[:-CRC_SIZE]) == adu[: -CRC_SIZE - 1 : -1]


def _as_announced(data: bytes) -> list[Checked]:
    if not _LEAST_DAMAGED <= len(data) <= _MOST_DAMAGED:
        return []
    return _end_to_end(data, CRC_SIZE) or _end_to_end(data, 0)


def _end_to_end(data: bytes, behind: int) -> list[Checked]:
    """Frames of legal values one after another, each with so many bytes behind its PDU; none where some are left."""
    ways: dict[int, int] = {0: 0}  # where a frame may begin, and where the one before it does
    for at in range(len(data) - 1):
        if at not in ways or not 0 < data[at] <= LAST_UNIT:
            continue
        for role in Role:
            end = at + 1 + (pdu_length(data[at + 1 : at + MAX_ADU], role) or 0) + behind
            if at + _LEAST_BARE + behind <= end <= len(data) and not plausibility(data[at + 1 : end - behind], role):
                ways.setdefault(end, at)
    frames: list[Checked] = []
    end = len(data)
    del ways[0]
    while end in ways:
        frames.append(Checked(ways[end], end, _answers_itself(data[ways[end] : end - behind]), "rtu"))
        end = ways[end]
    return frames[::-1]


def _right(data: bytes) -> list[Checked]:
    if len(data) < MIN_ADU:
        return []
    if b":" in data[:_REACH] or data[:1] == b">":
        right = [adu for adu in ascii_frames(data) if adu.check_ok and sound_roles(adu.pdu)]
        if right:
            ends = ((adu.start, adu.start + adu.length, _answers_itself(adu.data[:-1])) for adu in right)
            return [Checked(*end, "ascii") for end in ends]
    return list(_rtu(data)) or list(_tcp(data))


def envelope_of(data: bytes) -> Literal["rtu", "ascii", "tcp"] | None:
    """The envelope in which these bytes have a right check value; None where there is none."""
    if any(_rtu(data)):
        return "rtu"
    if any(tells_ascii(adu, data) for adu in ascii_frames(data)):
        return "ascii"
    return "tcp" if any(_tcp(data)) else None


def _rtu(data: bytes) -> Iterator[Checked]:
    if len(data) <= MAX_ADU and crc_ok(data) and predicted_roles(data):
        yield Checked(0, len(data), _repeats(data), "rtu")
        return
    at, tried, right = 0, 0, False
    while at <= len(data) - MIN_ADU and tried < _REACH:
        length = 0
        for role in _may_begin(data, at):
            expected = (pdu_length(data[at + 1 : at + MAX_ADU], role) or 0) + OVERHEAD
            if MIN_ADU <= expected <= len(data) - at and crc_ok(data[at : at + expected]):
                length = expected
                break
        if length:
            yield Checked(at, at + length, _repeats(data[at : at + length]), "rtu")
            right, tried = True, 0
        tried += 1
        at += length or 1
    if not right and len(data) <= MAX_ADU and crc_ok(data) and data[1] not in (0, EXCEPTION):
        yield Checked(0, len(data), envelope="rtu", odd=True)


def _may_begin(data: bytes, at: int) -> tuple[Role, ...]:
    """The roles of frames that are known how to measure and can begin here."""
    code, roles = data[at + 1], declared_roles(data[at + 1])
    known = 0 < data[at + 2] <= _LAST_EXCEPTION if code & EXCEPTION else Role.REQUEST in roles
    return roles * known


def predicted_roles(data: bytes) -> tuple[Role, ...]:
    """The roles in which the header of these bytes predicts just their number."""
    return tuple(role for role in Role if predicted(data, role) == len(data))


def _repeats(adu: bytes) -> bool:
    """Whether the answer to these bytes may be the same bytes again."""
    return predicted_roles(adu) == tuple(Role) and _answers_itself(adu[:-2])


def _answers_itself(body: bytes) -> bool:
    """The same of unit and PDU."""
    alike = all(pdu_length(body[1:], role) == len(body) - 1 for role in Role)
    return alike and expectation(body).fits(body)


def _tcp(data: bytes) -> Iterator[Checked]:
    if predicted_roles(data):
        return  # as well an RTU frame that was damaged
    for adu in tcp_frames(data):
        if len(adu.data) != MBAP - 1 + int.from_bytes(adu.data[4:6], "big") or not sound_roles(adu.pdu):
            return
        yield Checked(adu.start, adu.start + adu.length, _answers_itself(adu.data[MBAP - 1 :]), "tcp")
