"""A paste read as RTU: frames end to end, whose turn each was, and what a lone damaged or cut frame still says.

A window is a frame if its CRC is right and its length is the one that its header predicts, or the one that the paste
itself delimits (a line of a log) where the function has none. If the windows tile the paste in exactly one way, that is
its reading and nothing else need be asked; if not, the deframer has to weigh. Plain Python, no arrays.

Directions follow from what the bytes can be, then from the open request that they answer, then from the log's marks,
then from likelihood; in the last case alone the other direction stays possible and is shown beside.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import Final, NamedTuple

from dissectors.crc import crc_ends, crc_ok
from dissectors.envelopes import Adu, rtu
from dissectors.functions import function
from dissectors.length_rules import Role
from dissectors.lengths import expectation, miscounted_role, pdu_length, plausibility, rule
from dissectors.limits import CRC_SIZE, EXCEPTION, MAX_ADU, MIN_ADU, OVERHEAD

from .model import PastedFrame, PastedNoise, PastePart, Piece

LIMIT: Final = 1024  # bytes; a longer paste is the deframer's
_WINDOWS: Final = 1 << 12  # from edge to edge: of so many one in sixteen times has a right CRC by chance


class Window(NamedTuple):
    """Bytes [start, end) whose CRC is right, and the roles that they can have."""

    start: int
    end: int
    roles: tuple[Role, ...]


def predicted(data: bytes, role: Role) -> int | None:
    """Length of the ADU that begins with `data`: None while the header is not whole, -1 where there is none to tell."""
    declared = rule(data[1], role) if len(data) > 1 else None
    if len(data) > 1 and declared is None:
        return -1
    length = pdu_length(data[1:], role) if len(data) > 1 else None
    if length is None:
        return None
    return length + OVERHEAD if length >= 0 else -1


def windows(data: bytes, cuts: Iterable[int], roles: Sequence[Role]) -> list[Window]:
    """All windows that can be frames; `cuts` are the offsets at which the paste itself is divided.

    Over a cut none is a frame that breaks a limit, nor over the end of one that breaks none: a right answer and the 00
    behind it have a right CRC together.
    """
    edges = sorted({0, len(data), *cuts})
    candidates: dict[tuple[int, int], list[Role]] = {}
    for start in range(len(data) - MIN_ADU + 1):
        head = data[start : start + MAX_ADU]
        right: list[tuple[int, Role, bool]] = []
        for role in roles:
            length = predicted(head, role)
            if length is None or not MIN_ADU <= length <= len(data) - start:
                continue
            end = start + length
            if crc_ok(data[start:end]):
                right.append((end, role, not plausibility(data[start + 1 : end - CRC_SIZE], role)))
        limit = min((end for end, _, legal in right if legal), default=edges[bisect_right(edges, start)])
        for end, role, legal in right:
            if legal or end <= limit:
                candidates.setdefault((start, end), []).append(role)
    for start, end in pairwise(edges):
        if (
            MIN_ADU <= end - start <= MAX_ADU
            and crc_ok(data[start:end])
            and not any(start <= w[0] and w[1] <= end for w in candidates)
        ):
            candidates[start, end] = [role for role in roles if role is Role.RESPONSE or data[start + 1] < EXCEPTION]
    return [Window(start, end, tuple(roles)) for (start, end), roles in sorted(candidates.items()) if roles]


def tiling(windows: Sequence[Window], length: int) -> list[Window] | None:
    """The one way to tile [0, length) with windows; None where there is none, or several."""
    ways = {length: 1}
    following: dict[int, Window] = {}
    for window in sorted(windows, reverse=True):
        if onward := ways.get(window.end, 0):
            ways[window.start] = ways.get(window.start, 0) + onward
            following[window.start] = window
    if ways.get(0, 0) != 1:
        return None
    path = []
    at = 0
    while at < length:
        path.append(following[at])
        at = following[at].end
    return path


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
        elif marked is not None:
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
    return first.mark + second.mark == TX + RX and first.adu.data == second.adu.data


def _answers(request: Adu, response: Adu) -> bool:
    """Whether one frame can be the answer to another: unit, transaction (TCP), and what the function echoes."""
    if request.protocol == "tcp" and request.data[:2] != response.data[:2]:
        return False
    if "pdu" in (request.protocol, response.protocol):
        unit = other = 0
    elif request.unit is None or response.unit is None:
        return False
    else:
        unit, other = request.unit, response.unit
    return bool(request.pdu) and expectation(bytes([unit]) + request.pdu).fits(bytes([other]) + response.pdu)


def exact(data: bytes, parts: Sequence[PastePart], roles: Sequence[Role]) -> list[PastedFrame] | None:
    """The frames of a paste that whole frames tile in one way; None for any other."""
    if not MIN_ADU <= len(data) <= LIMIT:
        return None
    cuts = edges_of(parts)
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
    edged = _mended(PastedNoise(0, data), edges_of(parts))
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
    frame = unchecked(data[: len(data) - spare], 0, role, missing)
    pieces: list[Piece] = [replace(frame, also=also)]
    return pieces if not spare else [*pieces, PastedNoise(frame.length, data[frame.length :])]


def mended(pieces: Sequence[Piece], parts: Sequence[PastePart]) -> list[Piece]:
    """The deframer's pieces, with frames in their noise that only a paste's own edges show.

    A right CRC from one edge to the next is a frame of whatever length: where the noise begins or ends, or a line does.
    """
    edges = edges_of(parts)
    repaired: list[Piece] = []
    for piece in pieces:
        repaired.extend(_mended(piece, edges) if isinstance(piece, PastedNoise) else [piece])
    marks = dict(zip(edges, (part.mark for part in parts), strict=False))
    frames = iter(by_marks([piece for piece in repaired if isinstance(piece, PastedFrame)], marks))
    return [next(frames) if isinstance(piece, PastedFrame) else piece for piece in repaired]


def _mended(noise: PastedNoise, edges: Sequence[int]) -> list[Piece]:
    data, at = noise.data, 0
    split: list[Piece] = []
    inner = [edge - noise.start for edge in edges if 0 < edge - noise.start < noise.length]
    reach = max(_WINDOWS // (len(inner) + 1), 1)
    while len(data) - at >= MIN_ADU:
        right = crc_ends(data, at, MAX_ADU)
        ahead = bisect_right(inner, at)
        shown = {*inner[ahead : ahead + reach], len(data)}
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
        split.append(
            replace(unchecked(adu, noise.start + at, role, 0), also=None if adu[1] & EXCEPTION else other(role))
        )
        at = end
    return [*split, PastedNoise(noise.start + at, data[at:])] if at < len(data) else split


def unchecked(data: bytes, start: int, role: Role, missing: int) -> PastedFrame:
    """A frame at an offset of the paste, of which so many bytes are missing; 0: its CRC may be right or wrong."""
    adu = _placed(data, start)
    predictable = predicted(data, role) is not None
    if missing:  # its last two bytes are no check value yet
        half = int(missing == 1)
        adu = replace(adu, pdu=data[1 : len(data) - half], check_ok=False, check_received=None, check_computed=None)
    return PastedFrame(adu, role, start, len(data), missing=missing, length_known=predictable, confidence=0.5)


def edges_of(parts: Sequence[PastePart]) -> list[int]:
    """Where parts begin, and the end of the last."""
    return [0, *accumulate(len(part.data) for part in parts)]


def _placed(data: bytes, start: int) -> Adu:
    return replace(rtu(data), start=start)
