"""Whose turn was it? Directions of frames in a row, and which request an answer belongs to.

By what the bytes can be, then by the open request that they answer, then by the log's marks, then by likelihood; in the
last case alone the other direction stays possible and is shown beside.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

from dissectors.answers import expectation
from dissectors.envelopes import Adu
from dissectors.length_rules import Role
from dissectors.lengths import miscounted_role, pdu_length, plausibility

from .model import PastedFrame

BOTH: Final = (Role.REQUEST, Role.RESPONSE)
TX, RX = 1, 2  # the marks of a log, as `captures` numbers them
_SURE: Final = 0.9999
_EITHER: Final = 0.5
_MBAP_LENGTH: Final = 6  # bytes of an MBAP header that end with the length


@dataclass(frozen=True, slots=True)
class Turn:
    """A frame whose direction is to be found; `roles` are those that it can have, at least one."""

    adu: Adu
    start: int
    roles: Sequence[Role]
    missing: int = 0
    mark: int = 0


def turns(frames: Sequence[Turn]) -> list[PastedFrame]:
    """The frames with directions, answers tied to their requests."""
    sent = _senders(frames)
    telling = _telling_marks(frames)
    said_by: dict[int, int] = {}  # who, by the offsets of requests
    directed: list[PastedFrame] = []
    waiting: list[PastedFrame] = []
    for frame in frames:
        adu, roles = frame.adu, frame.roles
        request = next((earlier for earlier in reversed(waiting) if _answers(earlier.adu, adu)), None)
        marked = sent.get(frame.mark)
        if request is not None and len(roles) > 1 and frame.mark in telling and said_by[request.start] == frame.mark:
            request = None  # nobody answers himself
        also = None
        if len(roles) == 1:
            role = roles[0]
        elif request is not None:
            role = Role.RESPONSE
        elif marked is not None and marked in roles:
            role = marked
        else:
            role = _likelier(adu.pdu, roles)
            also = other(role)
        if role is Role.REQUEST:
            request = None
        sure = _EITHER if also is not None else _SURE
        directed.append(
            PastedFrame(
                adu,
                role,
                frame.start,
                adu.length,
                request=request.adu.pdu if request else None,
                request_start=request.start if request else None,
                also=also,
                missing=frame.missing,
                length_known=not frame.missing or len(adu.data) >= _MBAP_LENGTH,
                confidence=sure if adu.check_ok is not False and not frame.missing else _EITHER,
            )
        )
        if role is Role.REQUEST:
            said_by[frame.start] = frame.mark
            waiting = [*waiting, directed[-1]] if adu.protocol == "tcp" else [directed[-1]]
        elif request is not None:
            waiting.remove(request)
            slot = directed.index(request)
            directed[slot] = replace(request, also=None, confidence=directed[-1].confidence)  # its answer settles it
    return directed


def by_marks(frames: Sequence[PastedFrame], marks: Mapping[int, int]) -> list[PastedFrame]:
    """Frames in which either direction can be and that answer nothing, in the one that the log's marks say.

    `marks` are by the offsets at which the log's lines begin.
    """
    roles = [possible(frame.adu.pdu, BOTH) for frame in frames]
    turns = [
        Turn(
            frame.adu,
            frame.start,
            can_be if len(can_be) == 1 or frame.request is None else (frame.role,),
            mark=marks.get(frame.start, 0),
        )
        for frame, can_be in zip(frames, roles, strict=True)
    ]
    sent = _senders(turns)
    directed = []
    for frame, turn in zip(frames, turns, strict=True):
        role = sent.get(turn.mark, frame.role) if len(turn.roles) > 1 else frame.role
        directed.append(frame if role is frame.role else replace(frame, role=role, also=None))
    return directed


def possible(pdu: bytes, roles: Sequence[Role]) -> Sequence[Role]:
    """The roles whose predicted length is that of the PDU; all of them if none is."""
    return [role for role in roles if pdu and pdu_length(pdu, role) == len(pdu)] or roles


def other(role: Role) -> Role:
    """The other direction."""
    return Role.RESPONSE if role is Role.REQUEST else Role.REQUEST


def _likelier(pdu: bytes, roles: Sequence[Role]) -> Role:
    """The role of which the PDU breaks fewer rules, the request if neither; of another length, the one that counts."""
    if pdu and all(pdu_length(pdu, role) != len(pdu) for role in roles):
        return miscounted_role(pdu[0])
    return min(roles, key=lambda role: (len(plausibility(pdu, role)), role))


def _senders(frames: Sequence[Turn]) -> dict[int, Role]:
    """Which direction a mark means: a server's log has them the other way round.

    Frames of one kind only tell; where there are none, so do echoes: what comes twice was asked first.
    """
    for frame in frames:
        if frame.mark and len(frame.roles) == 1:
            return {frame.mark: frame.roles[0], TX + RX - frame.mark: other(frame.roles[0])}
    echoed = [first.mark for first, second in pairwise(frames) if _echoed(first, second)]
    asks = RX if 2 * echoed.count(RX) > len(echoed) else TX
    return {asks: Role.REQUEST, TX + RX - asks: Role.RESPONSE}


def _telling_marks(frames: Sequence[Turn]) -> frozenset[int]:
    """The marks that are a side's own: none that stands at requests as well as at answers, as a sniffer's does."""
    sides = {(frame.mark, frame.roles[0]) for frame in frames if frame.mark and len(frame.roles) == 1}
    return frozenset(mark for mark in (TX, RX) if len({role for one, role in sides if one == mark}) < len(BOTH))


def _echoed(first: Turn, second: Turn) -> bool:
    """Whether one side of a marked log says the same bytes right behind the other."""
    return first.mark + second.mark == TX + RX and 0 < first.mark < TX + RX and first.adu.data == second.adu.data


def _answers(request: Adu, response: Adu) -> bool:
    """Whether one frame can be the answer to another: unit, transaction (TCP), and what the function echoes."""
    if request.protocol == "tcp" and request.data[:2] != response.data[:2]:
        return False
    if request.unit is None or response.unit is None or not request.pdu:
        return False
    return expectation(bytes([request.unit]) + request.pdu).fits(bytes([response.unit]) + response.pdu)
