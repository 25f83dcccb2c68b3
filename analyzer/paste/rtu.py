"""A paste read as RTU: frames end to end, and what a lone damaged or cut frame still says."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from dissectors.envelopes import Adu, rtu
from dissectors.lengths import Role, plausibility

from .model import Found, Noise, Piece
from .tiling import LEAST, LIMIT, MOST, predicted, tiling, windows
from .turns import Turn, other, turns

if TYPE_CHECKING:
    from captures.hexwords import Words


def exact(data: bytes, parts: Sequence[Words], roles: Sequence[Role]) -> list[Found] | None:
    """The frames of a paste that whole frames tile in one way; None for any other."""
    if not LEAST <= len(data) <= LIMIT:
        return None
    cuts = [0]
    for part in parts:
        cuts.append(cuts[-1] + len(part.data))
    tiles = tiling(windows(data, cuts, roles), len(data))
    if tiles is None:
        return None
    marks = {at: part.mark for at, part in zip(cuts, parts, strict=False)}
    return turns(
        [
            Turn(_placed(data[start:end], start), start, can_be, mark=marks.get(start, 0))
            for start, end, can_be in tiles
        ]
    )


def lone(data: bytes, parts: Sequence[Words], roles: Sequence[Role]) -> list[Piece] | None:
    """A paste without any right CRC in it, as the one damaged or cut frame that it reads like; None where it doesn't."""
    if len(parts) > 1 or not 0 < len(data) <= LIMIT or windows(data, [0], roles):
        return None
    readings = []
    for role in roles:
        length = predicted(data, role)
        if length == -1 or (length is not None and length > MOST):
            continue
        missing = max(LEAST - len(data), 1) if length is None else max(length - len(data), 0)
        spare = 0 if length is None else max(len(data) - length, 0)
        weight = plausibility(data[1 : len(data) - spare - (0 if missing else 2)], role)
        if weight < 0 or (spare and weight <= 0):
            continue
        readings.append(((bool(missing or spare), -weight, missing + spare, role), role, missing, spare))
    if not readings:
        return None
    readings.sort()
    _, role, missing, spare = readings[0]
    also = other(role) if len(readings) > 1 and readings[1][2:] == (missing, spare) else None
    frame = _frame(data[: len(data) - spare], 0, role, missing)
    pieces: list[Piece] = [replace(frame, also=also)]
    return pieces if not spare else [*pieces, Noise(frame.length, data[frame.length :])]


def with_cut_end(pieces: Sequence[Piece], roles: Sequence[Role]) -> list[Piece]:
    """The pieces, the last noise read as the frame that it begins, where it begins one."""
    if not pieces or not isinstance(pieces[-1], Noise):
        return list(pieces)
    last = pieces[-1]
    missing = {role: (predicted(last.data, role) or 0) - last.length for role in roles}
    starts = [role for role in roles if 0 < missing[role] and plausibility(last.data[1:], role) > 0]
    if not starts:
        return list(pieces)
    role = max(starts, key=lambda r: plausibility(last.data[1:], r))
    return [*pieces[:-1], _frame(last.data, last.start, role, missing[role])]


def _frame(data: bytes, start: int, role: Role, missing: int) -> Found:
    adu = _placed(data, start)
    if missing:  # its last two bytes are no check value yet
        adu = replace(adu, pdu=data[1:], check_ok=False, check_received=None, check_computed=None)
    return Found(adu, role, start, len(data), missing=missing, confidence=0.5)


def _placed(data: bytes, start: int) -> Adu:
    return replace(rtu(data), start=start)
