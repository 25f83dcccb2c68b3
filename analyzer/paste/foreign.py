"""Whether a paste is Modbus at all: bytes of other protocols are named, by the recognisers that captures have, too."""

from __future__ import annotations

from collections.abc import Sequence

from dissectors.foreign import checked_frames, foreign_bytes, session_of

from ..languages import counted, phrase, tr
from .model import Paste, PastedFrame, PastedNoise, PastePart, Piece

_PART = 2  # one byte in so many must be of a frame of it


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
