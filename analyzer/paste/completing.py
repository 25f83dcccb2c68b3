"""What the deframer leaves of a paste, read by the table: each stretch by what stands before it and beside it."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import groupby, pairwise
from typing import Final

from dissectors.length_rules import Role
from dissectors.limits import MIN_ADU

from ..deframing.judging import judge
from .model import Envelope, PastedFrame, PastedNoise, PastePart, Piece, edges_of, frames_of, right_frames, tiled
from .readings import BOTH, LeftBytes, answers, chosen, possible

_NO_PART: Final = PastePart(b"")
_LEAST: Final = 3  # bytes of parts that may be frames
_SENT, _RECEIVED = 1, 2  # marks


def completed(
    pieces: Sequence[Piece], parts: Sequence[PastePart], envelope: Envelope, roles: Sequence[Role]
) -> list[Piece]:
    """The deframer's pieces, those that are no right frame as what they are left of, where that can be told."""
    data, edges = b"".join(part.data for part in parts), edges_of(parts)
    right = right_frames(pieces)
    divided = edges if _are_divided(right, parts) else [0, len(data)]
    by_start = dict(zip(edges, parts, strict=False))
    spoken, sides = {frame.adu.protocol for frame in right}, _sides(right, by_start)
    counted = _are_counted(right, parts)
    done: list[Piece] = []
    for settled, group in groupby(_on_their_sides(pieces, by_start, sides), _is_right):
        own = list(group)
        if settled:
            for piece in own:
                done.append(_tied(piece, done[-1:]))
            continue
        read: list[Piece] = []
        for stretch in _stretches(own, data, divided):
            part, before = by_start.get(stretch.start, _NO_PART), [*done[-1:], *read]
            beside = stretch._replace(
                roles=roles, envelope=envelope, request=_asked(before, "rtu"), side=sides.get(part.mark),
                spoken=spoken, counted=counted, colon=part.ascii,
            )  # fmt: skip
            read += _read(beside, before)
        silent = all(isinstance(piece, PastedNoise) for piece in [*own, *read])
        done += [each for piece in own for each in _by_line(piece, edges)] if silent else read
    return done


def _read(stretch: LeftBytes, before: Sequence[Piece]) -> list[Piece]:
    read: list[Piece] = []
    for piece in tiled(stretch.data, stretch.start, [one.frame for one in chosen(stretch)]):
        read.append(_tied(piece, [*before[-1:], *read][-1:]))
    return read


def _is_right(piece: Piece) -> bool:
    return isinstance(piece, PastedFrame) and piece.is_right


def _are_divided(right: Sequence[PastedFrame], parts: Sequence[PastePart]) -> bool:
    """Whether no frame goes over the edges of a paste's parts; where none is right, whether parts may be frames."""
    edges = edges_of(parts)
    if not right:
        return min(len(part.data) for part in parts) >= _LEAST
    return all(bisect_right(edges, frame.start) == bisect_left(edges, frame.start + frame.length) for frame in right)


def _are_counted(right: Sequence[PastedFrame], parts: Sequence[PastePart]) -> bool:
    """Whether no frame is right, and half of the parts or more are as long as their headers say."""
    return not right and 2 * sum(bool(judge(part.data, damaged=True)) for part in parts) >= len(parts)


def _stretches(group: Sequence[Piece], data: bytes, edges: Sequence[int]) -> Iterator[LeftBytes]:
    """The bytes of neighbouring pieces by the parts that they stand in, with the damaged frames that end there, too."""
    start, end = group[0].start, group[-1].start + group[-1].length
    damaged = frames_of(group)
    inner = edges[bisect_right(edges, start) : bisect_left(edges, end)]
    bounds = {start, end}.intersection(edges).union(inner)
    for low, high in pairwise([start, *inner, end]):
        inside = [frame for frame in damaged if low <= frame.start < frame.start + frame.length <= high]
        whole = {low, high} <= bounds
        yield LeftBytes(data[low:high], low, damaged=inside, whole=whole, last=high == len(data))


def _by_line(noise: Piece, edges: Sequence[int]) -> Iterator[Piece]:
    """Noise, that of several parts as one of each; a byte or two stay together."""
    end = noise.start + noise.length
    if not isinstance(noise, PastedNoise) or noise.length < MIN_ADU:
        yield noise
        return
    for low, high in pairwise([noise.start, *edges[bisect_right(edges, noise.start) : bisect_left(edges, end)], end]):
        yield PastedNoise(low, noise.data[low - noise.start : high - noise.start])


def _sides(frames: Sequence[PastedFrame], by_start: Mapping[int, PastePart]) -> dict[int, Role]:
    """Who speaks in lines of a mark: a server's log has the marks the other way round, a sniffer's tell nothing."""
    sure = [frame for frame in frames if len(possible(frame.adu.pdu, BOTH)) == 1]
    said = {(by_start.get(frame.start, _NO_PART).mark, frame.role) for frame in sure}
    turned = said & {(_SENT, Role.RESPONSE), (_RECEIVED, Role.REQUEST)}
    plain = said & {(_SENT, Role.REQUEST), (_RECEIVED, Role.RESPONSE)}
    if turned and plain:
        return {}
    return dict(zip((_SENT, _RECEIVED), BOTH[::-1] if turned else BOTH, strict=True))


def _on_their_sides(
    pieces: Sequence[Piece], by_start: Mapping[int, PastePart], sides: Mapping[int, Role]
) -> Iterator[Piece]:
    """The pieces; right frames that may go either way, that answer nothing and are not answered, as marks have it."""
    right = right_frames(pieces)
    tied = {frame.request_start for frame in right} | {
        frame.start for frame in right if frame.request_start is not None
    }
    side_of = {frame.start: sides.get(by_start.get(frame.start, _NO_PART).mark) for frame in right}
    for piece in pieces:
        side = side_of.get(piece.start)
        if side is not None and isinstance(piece, PastedFrame) and piece.start not in tied:
            piece = replace(piece, role=side if side in possible(piece.adu.pdu, BOTH) else piece.role)
        yield piece


def _asked(before: Sequence[Piece], protocol: str) -> PastedFrame | None:
    """The last frame, if it is a request of an envelope that a unit may answer."""
    last = next((piece for piece in reversed(before) if isinstance(piece, PastedFrame)), None)
    if last is None or last.role is not Role.REQUEST or not last.adu.unit or last.adu.protocol != protocol:
        return None
    return last if len(last.adu.pdu) >= _LEAST else None


def _tied(piece: Piece, before: Sequence[Piece]) -> Piece:
    """A piece; an answer that nobody seemed to have asked for tied to the request right before it."""
    if not isinstance(piece, PastedFrame) or piece.role is Role.REQUEST or piece.request is not None:
        return piece
    asked = _asked(before, piece.adu.protocol)
    if asked is None or not answers(asked.adu, piece.adu):
        return piece
    return replace(piece, request=asked.adu.pdu, request_start=asked.start, also=None)
