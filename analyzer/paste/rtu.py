"""A paste read as RTU: frames end to end, and what a lone damaged or cut frame still says."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from itertools import accumulate
from typing import Final

from dissectors.adu import EXCEPTION, MAX_ADU, MIN_ADU
from dissectors.crc import crc_bytes, crc_ends
from dissectors.envelopes import Adu, rtu
from dissectors.functions import function
from dissectors.length_rules import Role
from dissectors.lengths import miscounted_role, plausibility

from .model import PastedFrame, PastedNoise, PastePart, Piece
from .tiling import LIMIT, predicted, tiling, windows
from .turns import Turn, by_marks, other, turns

_BEGINNING: Final = 3  # bytes, from which on a rest is a beginning rather than a glitch


def exact(data: bytes, parts: Sequence[PastePart], roles: Sequence[Role]) -> list[PastedFrame] | None:
    """The frames of a paste that whole frames tile in one way; None for any other."""
    if not MIN_ADU <= len(data) <= LIMIT:
        return None
    cuts = _edges(parts)
    tiles = tiling(windows(data, cuts, roles), len(data))
    if tiles is None:
        return None
    marks = {at: part.mark for at, part in zip(cuts, parts, strict=False)}
    return turns(
        [Turn(_placed(data[start:end], start), start, can_be, mark=marks.get(start, 0)) for start, end, can_be in tiles]
    )


def lone(data: bytes, parts: Sequence[PastePart], roles: Sequence[Role]) -> list[Piece] | None:
    """A paste without a frame of a predicted length, as the one damaged or cut frame that it reads like.

    None where it reads like none, and where more than one frame must be looked for.
    """
    if len(parts) > 1 or not 0 < len(data) <= LIMIT or windows(data, [0], roles):
        return None
    edged = _mended(PastedNoise(0, data), _edges(parts))
    if any(isinstance(piece, PastedFrame) for piece in edged):
        return edged
    readings = []
    for role in roles:
        length = predicted(data, role)
        if length == -1 or (length is not None and length > MAX_ADU):
            continue
        missing = max(MIN_ADU - len(data), 1) if length is None else max(length - len(data), 0)
        spare = 0 if length is None else max(len(data) - length, 0)
        broken = len(plausibility(data[1 : len(data) - spare - (0 if missing else 2)], role))
        if broken and (missing or spare or data[1] & EXCEPTION):
            continue  # neither CRC nor length nor content speak for it
        readings.append(((bool(missing or spare), bool(spare), broken, missing + spare, role), role, missing, spare))
    if not readings:
        return None
    readings.sort()
    _, role, missing, spare = readings[0]
    also = other(role) if len(readings) > 1 and readings[1][2:] == (missing, spare) else None
    frame = _frame(data[: len(data) - spare], 0, role, missing)
    pieces: list[Piece] = [replace(frame, also=also)]
    return pieces if not spare else [*pieces, PastedNoise(frame.length, data[frame.length :])]


def mended(pieces: Sequence[Piece], parts: Sequence[PastePart], roles: Sequence[Role]) -> list[Piece]:
    """The deframer's pieces, with frames in their noise that only a paste's own edges show.

    A right CRC from one edge to the next is a frame of whatever length: where the noise begins or ends, or a line does.
    A rest that begins like a frame is one that was cut.
    """
    edges = _edges(parts)
    repaired: list[Piece] = []
    for piece in pieces:
        repaired.extend(_mended(piece, edges) if isinstance(piece, PastedNoise) else [piece])
    marks = dict(zip(edges, (part.mark for part in parts), strict=False))
    frames = iter(by_marks([piece for piece in repaired if isinstance(piece, PastedFrame)], marks))
    repaired = _answering([next(frames) if isinstance(piece, PastedFrame) else piece for piece in repaired])
    return [*repaired[:-1], _cut(repaired[-1], roles)] if repaired else repaired


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
        cut = _frame(last.adu.data, last.start, last.role, missing)
        return replace(last, adu=cut.adu, missing=missing, length_known=cut.length_known, confidence=cut.confidence)
    if last.length >= _BEGINNING:
        for role in roles:
            missing = (predicted(last.data, role) or 0) - last.length
            if missing > 0 and not plausibility(last.data[1:], role) and function(last.data[1]) is not None:
                return _frame(last.data, last.start, role, missing)
    return last


def _answering(pieces: Sequence[Piece]) -> list[Piece]:
    """The pieces, those of either direction as answers where they follow the request of their unit and function."""
    directed: list[Piece] = []
    pending: PastedFrame | None = None
    for piece in pieces:
        if isinstance(piece, PastedFrame):
            if piece.also is not None and pending is not None and _same(pending, piece) and len(piece.adu.pdu) > 1:
                piece = replace(
                    piece, role=Role.RESPONSE, also=None, request=pending.adu.pdu, request_start=pending.start
                )
            pending = piece if piece.role is Role.REQUEST else None
        directed.append(piece)
    return directed


def _same(request: PastedFrame, piece: PastedFrame) -> bool:
    return (request.adu.unit, request.function) == (piece.adu.unit, piece.function)


def _mended(noise: PastedNoise, edges: Sequence[int]) -> list[Piece]:
    data, at = noise.data, 0
    split: list[Piece] = []
    inner = [edge - noise.start for edge in edges if 0 < edge - noise.start < noise.length]
    while len(data) - at >= MIN_ADU:
        right = crc_ends(data, at, MAX_ADU)
        ahead = bisect_right(inner, at)
        shown = {*inner[ahead : ahead + MAX_ADU], len(data)}
        end = next((end for end in right if end in shown), None)
        if end is None and right and function(data[at + 1]) is not None:
            end = right[0]  # an end that nothing shows needs a function that is in use
        if end is None:
            if ahead == len(inner):
                break
            following = inner[ahead]
            split.append(PastedNoise(noise.start + at, data[at:following]))
            at = following
            continue
        adu = data[at:end]
        role = Role.RESPONSE if adu[1] & EXCEPTION else miscounted_role(adu[1])
        split.append(replace(_frame(adu, noise.start + at, role, 0), also=None if adu[1] & EXCEPTION else other(role)))
        at = end
    return [*split, PastedNoise(noise.start + at, data[at:])] if at < len(data) else split


def _frame(data: bytes, start: int, role: Role, missing: int) -> PastedFrame:
    adu = _placed(data, start)
    predictable = predicted(data, role) is not None
    if missing:  # its last two bytes are no check value yet
        half = 1 if missing == 1 and predictable else 0
        adu = replace(adu, pdu=data[1 : len(data) - half], check_ok=False, check_received=None, check_computed=None)
    return PastedFrame(adu, role, start, len(data), missing=missing, length_known=predictable, confidence=0.5)


def _edges(parts: Sequence[PastePart]) -> list[int]:
    """Where parts begin, and the end of the last."""
    return [0, *accumulate(len(part.data) for part in parts)]


def _placed(data: bytes, start: int) -> Adu:
    return replace(rtu(data), start=start)
