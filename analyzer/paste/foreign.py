"""Whether a paste is Modbus at all: bytes of other protocols are named, by the recognisers that captures have, too."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Final

from dissectors.foreign import checked_frames, foreign_bytes, is_undeclared, session_of
from dissectors.lengths import is_open, sound_roles
from dissectors.limits import CRC_SIZE
from dissectors.unnamed import TrafficSoFar

from ..languages import counted, phrase, tr
from .model import Paste, PastedFrame, PastedNoise, PastePart, Piece
from .rtu import edges_of

_SEVERAL: Final = 4  # headers
_PART: Final = 2  # one byte in so many must be of a frame of it


def as_foreign(paste: Paste, parts: Sequence[PastePart]) -> Paste:
    """The paste, its bytes as no frames of Modbus where they are those of another protocol."""
    data = b"".join(part.data for part in parts)
    if paste.protocol != "rtu" or not data:
        return paste
    frames = [frame for part in parts for frame in checked_frames(part.data)] or checked_frames(data)
    name = session_of(frames)
    if name and _PART * sum(map(len, frames)) >= len(data):
        return Paste("rtu", _words(name, len(frames)), _cut(frames, data, parts))
    if any(isinstance(piece, PastedFrame) and piece.check_ok for piece in paste.pieces):
        return paste
    name, count, covered = foreign_bytes(data)
    if _PART * covered < len(data):
        return paste
    return Paste("rtu", _words(name, count), _cut((), data, parts))


def are_no_headers(pieces: Sequence[Piece]) -> bool:
    """Whether what reads like headers of MBAP is none: several, no frame of them whole, most of functions that nobody
    has declared."""
    frames = [piece for piece in pieces if isinstance(piece, PastedFrame)]
    undeclared = sum(is_undeclared(frame.function or 0) for frame in frames)
    return len(frames) >= _SEVERAL and all(frame.missing for frame in frames) and 2 * undeclared > len(frames)


def without_chance(pieces: Sequence[Piece], parts: Sequence[PastePart]) -> list[Piece]:
    """The pieces, frames that are chance among other bytes as noise.

    A whole line, or several, that is a right frame of a predicted length is none; of other functions whole lines tell,
    where there are lines: from one line to a later one too many windows may be right.
    """
    frames = [piece for piece in pieces if isinstance(piece, PastedFrame)]
    right = {frame.adu.data for frame in frames if frame.check_ok}
    legal = {adu for adu in right if _has_its_length(adu)}
    alone = right - legal if len(parts) == 1 else (right - legal).intersection(part.data for part in parts)
    kin = Counter(adu[:2] for adu in alone)
    octets, edges = sum(len(part.data) for part in parts), {*edges_of(parts)}
    heard = TrafficSoFar(len(legal), octets, sum(frame.length for frame in frames))
    kept: list[Piece] = []
    for piece in pieces:
        if isinstance(piece, PastedFrame):
            adu = piece.adu.data
            written = adu in legal and {piece.start, piece.start + piece.length} <= edges
            if not written and heard.is_chance(len(adu), kin[adu[:2]] - (adu in alone)):
                piece = PastedNoise(piece.start, adu)
        kept.append(piece)
    return kept


def _has_its_length(adu: bytes) -> bool:
    """Whether a right frame is of a declared function, and as long as that predicts."""
    return any(not is_open(adu[1], role) for role in sound_roles(adu[1:-CRC_SIZE]))


def _words(name: str, count: int) -> str:
    frames = counted(count, "frame", "frames")
    return tr("not Modbus, but {name}: {frames}", name=phrase("{name}", name=name), frames=frames)


def _cut(frames: Sequence[bytes], data: bytes, parts: Sequence[PastePart]) -> tuple[Piece, ...]:
    """The bytes frame by frame where those are all of them, else line by line."""
    pieces = frames if b"".join(frames) == data else [part.data for part in parts]
    noise: list[Piece] = []
    at = 0
    for octets in pieces:
        noise.append(PastedNoise(at, octets))
        at += len(octets)
    return tuple(noise)
