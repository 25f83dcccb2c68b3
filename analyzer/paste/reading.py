"""Which envelope a paste is in: RTU, ASCII or MBAP. Each is tried; the one whose check explains the bytes is taken.

In order: frames of ASCII mode, which show themselves; RTU frames whose right CRCs tile all of it; MBAP headers whose
lengths do; RTU frames among other bytes; and where no check value is right at all, what reads like a frame that was
damaged or cut. The choice is always told, with its reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Literal

from dissectors.envelopes import MBAP, Adu, ascii_frames, tcp, tcp_frames
from dissectors.lengths import Role

from . import rtu
from .model import Found, Noise, Paste, Piece
from .turns import BOTH, Turn, possible, turns

if TYPE_CHECKING:
    from captures.hexwords import Words

Envelope = Literal["auto", "rtu", "ascii", "tcp"]
_ROLES: Final = {"auto": BOTH, "request": (Role.REQUEST,), "response": (Role.RESPONSE,)}
LONGEST: Final = 1 << 20


class PasteError(Exception):
    """A paste that cannot be read at all, in one line."""


def read(text: str, envelope: Envelope = "auto", role: Literal["auto", "request", "response"] = "auto") -> Paste:
    """Pasted text as frames. Raises PasteError, or captures.hexwords.HexError where its digits are no bytes."""
    from captures.hexwords import read_text

    parts = read_text(text)
    size = sum(len(part.data) for part in parts)
    if size > LONGEST:
        raise PasteError(f"{size:,} bytes are too many to annotate; save them to a file and use rtuscope export")
    return read_parts(parts, envelope, _ROLES[role])


def read_parts(parts: Sequence[Words], envelope: Envelope, roles: Sequence[Role]) -> Paste:
    """Bytes with their marks and times as frames."""
    data = b"".join(part.data for part in parts)
    if envelope == "ascii":
        return Paste("ascii", "ASCII: as asked", _tiled(data, _ascii(data, roles)))
    if envelope == "tcp":
        return Paste("tcp", "TCP: as asked", _tcp(data, roles))
    if envelope == "auto":
        found = _ascii(data, roles)
        if found and (any(part.ascii for part in parts) or any(frame.check_ok for frame in found)):
            why = f"ASCII: {_frames(len(found))} between colon and line end, {_verdict(found, 'LRC')}"
            return Paste("ascii", why, _tiled(data, found))
    whole = rtu.exact(data, parts, roles)
    if whole is not None:
        right = f"right CRC at the predicted length, {_frames(len(whole))} over all {len(data)} bytes"
        return Paste("rtu", f"RTU: {right}", tuple(whole))
    if envelope == "auto":
        mbap = _tcp(data, roles)
        if all(isinstance(piece, Found) and not piece.missing for piece in mbap):
            why = f"TCP: MBAP headers (protocol 0, right length) over all {len(data)} bytes, {_frames(len(mbap))}; no CRC fits"
            return Paste("tcp", why, mbap)
    return _inexact(data, parts, envelope, roles)


def _inexact(data: bytes, parts: Sequence[Words], envelope: Envelope, roles: Sequence[Role]) -> Paste:
    """A paste that no envelope explains whole."""
    alone = rtu.lone(data, parts, roles)
    if alone is None:
        from .weighed import weighed

        pieces = rtu.with_cut_end(weighed(parts), roles)
        right = sum(1 for piece in pieces if isinstance(piece, Found) and piece.check_ok)
        if right:
            return Paste("rtu", f"RTU: right CRC in {_frames(right)}, other bytes around", tuple(pieces))
        alone = pieces
    if envelope == "auto":
        mbap = _tcp(data, roles)
        if isinstance(mbap[0], Found):
            return Paste("tcp", "TCP: begins with an MBAP header (protocol 0, a length); no CRC is right", mbap)
    if any(isinstance(piece, Found) for piece in alone):
        return Paste("rtu", "RTU: reads like it by its header; no CRC is right, and there is no MBAP header", tuple(alone))
    return Paste("rtu", "no frame: no right CRC, no MBAP header, no ASCII frame", tuple(alone))


def _ascii(data: bytes, roles: Sequence[Role]) -> list[Found]:
    return turns([Turn(adu, adu.start, possible(adu.pdu, roles)) for adu in ascii_frames(data)])


def _tcp(data: bytes, roles: Sequence[Role]) -> tuple[Piece, ...]:
    frames = tcp_frames(data)
    rest = frames[-1].start + frames[-1].length if frames else 0
    left = data[rest:]
    if left and len(left) <= MBAP and not any(left[2:4]):
        frames.append(tcp(left, rest))
    return _tiled(data, turns([Turn(adu, adu.start, possible(adu.pdu, roles), _cut(adu)) for adu in frames]))


def _cut(adu: Adu) -> int:
    """Bytes that an MBAP header announces and that are not there; at least what makes it whole."""
    if len(adu.data) <= MBAP:
        return MBAP + 1 - len(adu.data)
    return int.from_bytes(adu.data[4:6], "big") + MBAP - 1 - len(adu.data)


def _tiled(data: bytes, frames: Sequence[Found]) -> tuple[Piece, ...]:
    """The frames with the bytes between them."""
    pieces: list[Piece] = []
    at = 0
    for frame in frames:
        if frame.start > at:
            pieces.append(Noise(at, data[at : frame.start]))
        pieces.append(frame)
        at = frame.start + frame.length
    if at < len(data):
        pieces.append(Noise(at, data[at:]))
    return tuple(pieces)


def _verdict(frames: Sequence[Found], check: str) -> str:
    right = sum(1 for frame in frames if frame.check_ok)
    if right == len(frames):
        return f"{check} right"
    return f"{check} wrong" if not right else f"{check} right in {right}"


def _frames(count: int) -> str:
    return f"{count} frame" if count == 1 else f"{count} frames"
