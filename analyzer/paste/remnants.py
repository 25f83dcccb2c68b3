"""What is left of frames in a paste: an answer that came cut, shifted or without its CRC, a request that came back cut.

The deframer weighs bytes as a line carries them. A paste says more: it is divided, and whole frames of it show where
frames begin and end. So bytes of one part that are no frame are read by what was asked before them: as the answer that
was due, wherever in the part it begins, or as the request's own echo; and a whole part is read as a frame without a
CRC, as many programs print it, where it is one in all else. A damaged frame that runs on from one part into another, or
breaks the rules of its function, stands back behind such a reading.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from typing import Final

from dissectors.crc import crc_bytes
from dissectors.functions import function
from dissectors.length_rules import Role
from dissectors.lengths import Expectation, expectation, pdu_length, plausibility, rule
from dissectors.limits import CRC_SIZE, EXCEPTION, LAST_UNIT

from .model import PastedFrame, PastedNoise, PastePart, Piece
from .rtu import edges_of, other, predicted, unchecked

_LEAST: Final = 3  # bytes, from which on a rest is a beginning rather than a glitch
_MOST_BEFORE: Final = 8  # bytes before an answer that are none of it: what a receiver had left over
_LAST_CODE: Final = 0x0B  # of exceptions


def completed(pieces: Sequence[Piece], parts: Sequence[PastePart], roles: Sequence[Role]) -> list[Piece]:
    """The pieces, those that are no right frame as what they are left of, where that can be told."""
    edges = edges_of(parts) if _are_divided(pieces, parts) else []
    done: list[Piece] = []
    last: PastedFrame | None = None
    for raw, neighbours in groupby(pieces, lambda piece: _is_raw(piece, edges)):
        group = list(neighbours)
        read = _reread(group, edges, last, roles) if raw else group
        done.extend(read)
        last = _last_frame(read, last)
    return _tied([*done[:-1], _cut(done[-1], roles)]) if done else done


def _are_divided(pieces: Sequence[Piece], parts: Sequence[PastePart]) -> bool:
    """Whether frames of a paste end where its parts do."""
    right = [piece for piece in pieces if isinstance(piece, PastedFrame) and piece.check_ok]
    if not right:
        return len(parts) > 1 and all(len(part.data) >= _LEAST for part in parts)
    ends = set(edges_of(parts))
    return all({frame.start, frame.start + frame.length} <= ends for frame in right)


def _is_raw(piece: Piece, edges: Sequence[int]) -> bool:
    """Whether a piece is no frame, or one with a wrong CRC that another reading may beat."""
    if isinstance(piece, PastedNoise):
        return True
    if piece.check_ok is not False or not piece.adu.pdu:
        return False
    crosses = bool(edges) and edges[bisect_right(edges, piece.start)] < piece.start + piece.length
    length = predicted(piece.adu.data, piece.role)
    return crosses or length not in (piece.length, -1) or bool(plausibility(piece.adu.pdu, piece.role))


def _reread(
    group: Sequence[Piece],
    edges: Sequence[int],
    last: PastedFrame | None,
    roles: Sequence[Role],
) -> Sequence[Piece]:
    """Neighbouring pieces that are no right frames, as what they are left of; `last`: the frame before them."""
    read: list[Piece] = []
    told = any(isinstance(piece, PastedFrame) for piece in group)
    for stretch, own, whole in _stretches(group, edges):
        answer = _reading(stretch, _open_request(last), roles, whole)
        told = told or bool(answer)
        read.extend(answer or own)
        last = _last_frame(answer or own, last)
    return read if told else group


def _stretches(group: Sequence[Piece], edges: Sequence[int]) -> Iterator[tuple[PastedNoise, Sequence[Piece], bool]]:
    """The bytes of neighbouring pieces by the parts that they stand in: as bytes, as the pieces that they were (one
    that goes on in the next part falls apart), and whether they are all of a part."""
    start = group[0].start
    data = b"".join(piece.data if isinstance(piece, PastedNoise) else piece.adu.data for piece in group)
    end = start + len(data)
    inner = edges[bisect_right(edges, start) : bisect_right(edges, end - 1)]
    begins = bool(edges) and edges[bisect_right(edges, start) - 1] == start
    ends = bool(edges) and edges[bisect_left(edges, end)] == end
    at = 0
    for low, high in pairwise([start, *inner, end]):
        stretch = PastedNoise(low, data[low - start : high - start])
        own: list[Piece] = []
        while at < len(group) and group[at].start < high:
            own.append(group[at])
            at += 1
        if not own or own[0].start < low or own[-1].start + own[-1].length > high:
            own = [stretch]
        yield stretch, own, (low > start or begins) and (high < end or ends)


def _last_frame(pieces: Sequence[Piece], before: PastedFrame | None) -> PastedFrame | None:
    return next((piece for piece in reversed(pieces) if isinstance(piece, PastedFrame)), before)


def _open_request(last: PastedFrame | None) -> PastedFrame | None:
    """The last frame, if it is a request whose unit and function are known."""
    if last is None or last.role is not Role.REQUEST or len(last.adu.pdu) < _LEAST or not last.adu.unit:
        return None
    return last


def _due(request: PastedFrame) -> Expectation:
    return expectation(bytes([request.adu.unit or 0]) + request.adu.pdu)


def _reading(stretch: PastedNoise, request: PastedFrame | None, roles: Sequence[Role], whole: bool) -> list[Piece]:
    """A stretch as what it is left of; nothing where it may be anything."""
    if request is not None:
        if _LEAST <= stretch.length < request.length and request.adu.data.startswith(stretch.data):
            return [unchecked(stretch.data, stretch.start, Role.REQUEST, request.length - stretch.length)]
        if Role.RESPONSE in roles and (answer := _answer(stretch, request)):
            return answer
    return _without_crc(stretch, roles) if whole else []


def _answer(stretch: PastedNoise, request: PastedFrame) -> list[Piece]:
    """The answer that was due, if it begins in the stretch: cut, or with a wrong CRC; and what is around it."""
    due = _due(request)
    for at in range(min(stretch.length - _LEAST, _MOST_BEFORE) + 1):
        data = stretch.data[at:]
        refused = data[1] == due.function | EXCEPTION and 0 < data[2] <= _LAST_CODE
        if not (data.startswith(due.header) or refused):
            continue
        length = predicted(data, Role.RESPONSE)
        if length is None or length < 0:
            continue
        frame = replace(
            unchecked(data[:length], stretch.start + at, Role.RESPONSE, max(0, length - len(data))),
            request=request.adu.pdu,
            request_start=request.start,
        )
        before = [PastedNoise(stretch.start, stretch.data[:at])] if at else []
        behind = [PastedNoise(stretch.start + at + length, data[length:])] if len(data) > length else []
        return [*before, frame, *behind]
    return []


def _without_crc(part: PastedNoise, roles: Sequence[Role]) -> list[Piece]:
    """A part as a frame whose CRC is not shown: a unit and a whole PDU that breaks no rule."""
    data = part.data
    if not len(data) >= _LEAST or not 0 < data[0] <= LAST_UNIT or data[1] & EXCEPTION:
        return []
    pdu = data[1:]
    can_be = [
        role
        for role in roles
        if rule(pdu[0], role) is not None and pdu_length(pdu, role) == len(pdu) and not plausibility(pdu, role)
    ]
    if not can_be:
        return []
    role = can_be[0]
    also = other(role) if len(can_be) > 1 else None
    return [replace(unchecked(data, part.start, role, CRC_SIZE), also=also)]


def _tied(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces, answers that nobody seemed to have asked for tied to the request right before them."""
    tied: list[Piece] = []
    for piece in pieces:
        request = _open_request(_last_frame(tied[-1:], None))
        if (
            isinstance(piece, PastedFrame)
            and piece.role is Role.RESPONSE
            and piece.request is None
            and request is not None
            and _due(request).fits(piece.adu.data)
        ):
            piece = replace(piece, request=request.adu.pdu, request_start=request.start)
        tied.append(piece)
    return tied


def _cut(last: Piece, roles: Sequence[Role]) -> Piece:
    """The end of a paste as a frame that was cut, where it begins like one and is no whole one."""
    if isinstance(last, PastedFrame):
        length = predicted(last.adu.data, last.role)
        missing = 1 if length is None else length - last.length
        begun = (
            length is None or missing > 1 or (missing == 1 and crc_bytes(last.adu.data[:-1])[:1] == last.adu.data[-1:])
        )
        if last.check_ok is not False or last.missing or not begun:
            return last
        cut = unchecked(last.adu.data, last.start, last.role, missing)
        return replace(last, adu=cut.adu, missing=missing, length_known=cut.length_known, confidence=cut.confidence)
    if last.length >= _LEAST and last.data[0] <= LAST_UNIT:
        for role in roles:
            missing = (predicted(last.data, role) or 0) - last.length
            if missing > 0 and not plausibility(last.data[1:], role) and function(last.data[1]) is not None:
                return unchecked(last.data, last.start, role, missing)
    return last
