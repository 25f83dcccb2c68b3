"""Frames of Modbus TCP in pasted bytes, by their MBAP headers ([3] 3.1.3)."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from itertools import accumulate
from typing import Final

from dissectors.envelopes import MBAP, Adu, tcp
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length

from ..deframing.weighing import rtu_bits, rtu_head_bits, tcp_bits, tcp_head_bits
from .model import PastedFrame, PastePart, Piece, tiled
from .rtu import BOTH, Turn, possible, turns

LENGTH_END: Final = 6  # bytes of an MBAP header, up to its length
_MOST_TCP: Final = 254  # what the length in an MBAP header can be


def may_show_headers(parts: Sequence[PastePart]) -> bool:
    """Whether any part begins as an MBAP header does."""
    return any(len(part.data) >= LENGTH_END and _begins_mbap(part.data) for part in parts)


def mbap_frames(data: bytes, parts: Sequence[PastePart], roles: Sequence[Role]) -> tuple[Piece, ...]:
    """MBAP frames one after another; where no header stands, or one cannot be whole, it begins anew with a part."""
    edges = [*accumulate(len(part.data) for part in parts)] or [len(data)]
    marks = {end - len(part.data): part.mark for end, part in zip(edges, parts, strict=False)}
    frames: list[Turn] = []
    at = 0
    while at < len(data):
        edge = edges[bisect_right(edges, at)]
        if not _begins_mbap(data[at : at + MBAP]):
            at = edge
            continue
        end = (
            at + MBAP - 1 + int.from_bytes(data[at + 4 : at + 6], "big") if len(data) - at >= LENGTH_END else len(data)
        )
        adu = tcp(data[at : min(end, len(data))], at)
        complete = any(pdu_length(adu.pdu, role) == len(adu.pdu) for role in BOTH)
        if end > edge and edge < len(data) and not complete:  # a line's end in it
            adu = tcp(data[at:edge], at)
        frames.append(Turn(adu, at, possible(adu.pdu, roles), _cut(adu), marks.get(at, 0)))
        at += len(adu.data)
    return tiled(data, turns(frames))


def _begins_mbap(data: bytes) -> bool:
    """Whether a few bytes can be the beginning of an MBAP header: protocol 0, a length of at least 2."""
    if len(data) < LENGTH_END:
        return len(data) > 2 and not any(data[2:4]) and not any(data[4:5])
    return not any(data[2:5]) and 1 < data[5] <= _MOST_TCP


def _cut(adu: Adu) -> int:
    """Bytes that an MBAP header announces and that are not there; at least what makes it whole."""
    if len(adu.data) <= MBAP:
        return MBAP + 1 - len(adu.data)
    return int.from_bytes(adu.data[4:6], "big") + MBAP - 1 - len(adu.data)


def left_over(pieces: Sequence[Piece]) -> bool:
    """Whether headers leave bytes over, or announce some that are not there."""
    return any(not isinstance(piece, PastedFrame) or piece.missing for piece in pieces)


def is_tcp(data: bytes, parts: Sequence[PastePart]) -> bool:
    """Whether headers speak for these bytes more than their being RTU, damaged, does: at once, or part by part."""
    rtu_alone = max(rtu_bits(data), sum(rtu_bits(part.data) for part in parts))
    return max(tcp_bits(data), 0.0) > rtu_alone


def begins_tcp(data: bytes) -> bool:
    """The same of bytes whose first header announces more of them, or fewer."""
    return tcp_head_bits(data) > rtu_head_bits(data)
