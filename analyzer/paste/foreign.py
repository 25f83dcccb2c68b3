"""Whether a paste is Modbus at all: bytes of other protocols are named, by the recognisers that captures have, too."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from dissectors.foreign import checked_frames, foreign_bytes, session_of
from dissectors.lengths import is_open, sound_roles
from dissectors.limits import CRC_SIZE
from dissectors.unnamed import TrafficSoFar

from ..languages import counted, phrase, tr
from .model import Paste, PastedFrame, PastedNoise, PastePart, Piece, edges_of, frames_of, right_frames

_PART: Final = 2  # one byte in so many must be of a frame of it


def as_foreign(pieces: Sequence[Piece], parts: Sequence[PastePart]) -> Paste | None:
    """A paste whose bytes are those of another protocol, as no frames of Modbus; None for any other."""
    data = b"".join(part.data for part in parts)
    frames = [frame for part in parts for frame in checked_frames(part.data)] or checked_frames(data)
    name, count, covered = session_of(frames), len(frames), sum(map(len, frames))
    if not name and not right_frames(pieces):
        frames, (name, count, covered) = [], foreign_bytes(data)
    if not name or _PART * covered < len(data):
        return None
    told = counted(count, "frame", "frames")
    words = tr("not Modbus, but {name}: {frames}", name=phrase("{name}", name=name), frames=told)
    own = frames if b"".join(frames) == data else [part.data for part in parts]
    starts = edges_of([PastePart(octets) for octets in own])
    return Paste("rtu", words, tuple(map(PastedNoise, starts, own)))


def without_chance(pieces: Sequence[Piece], parts: Sequence[PastePart]) -> list[Piece]:
    """The pieces, frames that are chance among other bytes as noise.

    A whole line, or several, that is a right frame of a predicted length is none; of other functions whole lines tell,
    where there are lines: from one line to a later one too many windows may be right.
    """
    framed = sum(frame.length for frame in frames_of(pieces))
    right = {frame.adu.data for frame in right_frames(pieces) if frame.adu.check_ok}
    legal = {*filter(_has_its_length, right)}
    lines = right if len(parts) == 1 else {part.data for part in parts}
    kin = Counter(adu[:2] for adu in (right - legal) & lines)
    edges = {*edges_of(parts)}
    heard = TrafficSoFar(len(legal), max(edges), framed)

    def is_chance(frame: PastedFrame) -> bool:
        adu = frame.adu.data
        written = adu in legal and {frame.start, frame.start + frame.length} <= edges
        return not written and heard.is_chance(len(adu), kin[adu[:2]] - (adu in lines - legal))

    return [
        PastedNoise(piece.start, piece.adu.data) if isinstance(piece, PastedFrame) and is_chance(piece) else piece
        for piece in pieces
    ]


def _has_its_length(adu: bytes) -> bool:
    """Whether a right frame is of a declared function, and as long as that predicts."""
    return any(not is_open(adu[1], role) for role in sound_roles(adu[1:-CRC_SIZE]))
