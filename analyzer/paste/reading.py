"""Which envelope a paste is in: RTU, ASCII or MBAP. Each is tried; the one whose check explains the bytes is taken.

In order: frames of ASCII mode, which show themselves; RTU frames whose right CRCs tile all of it; MBAP headers whose
lengths do; RTU frames among other bytes; and where no check value is right at all, what reads like a frame that was
damaged or cut. The choice is always told, with its reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from typing import Final, Literal

from dissectors.envelopes import MBAP, Adu, ascii_frames, tcp, tcp_frames
from dissectors.lengths import Role, pdu_length, rule

from . import rtu
from .model import Found, Noise, Part, Paste, Piece
from .suspicion import with_findings
from .turns import BOTH, Turn, possible, turns

Envelope = Literal["auto", "rtu", "ascii", "tcp"]
_ROLES: Final = {"auto": BOTH, "request": (Role.REQUEST,), "response": (Role.RESPONSE,)}
LONGEST: Final = 1 << 20  # bytes
_PAIR: Final = 2  # hex digits of a byte
_LENGTH_END: Final = 6  # bytes of an MBAP header, up to its length


class PasteError(Exception):
    """A paste that cannot be read at all, in one line."""


def read(text: str, envelope: Envelope = "auto", role: Literal["auto", "request", "response"] = "auto") -> Paste:
    """Pasted text as frames. Raises PasteError, or captures.hexwords.HexError where its digits are no bytes."""
    parts = _parts(text)
    size = sum(len(part.data) for part in parts)
    if size > LONGEST:
        raise PasteError(f"{size:,} bytes are too many to annotate; save them to a file and use rtuscope export")
    return with_findings(read_parts(parts, envelope, _ROLES[role]))


def _parts(text: str) -> list[Part]:
    """The bytes in a text; what is nothing but pairs of digits needs no look at all the ways of writing bytes."""
    words = text.split()
    if "\n" not in text.strip() and len(words) > 1 and all(len(word) == _PAIR for word in words):
        with suppress(ValueError):
            return [Part(bytes.fromhex(text))]
    from captures.hexwords import read_text

    return [Part(item.data, item.mark, item.t_ns, item.ascii) for item in read_text(text)]


def read_parts(parts: Sequence[Part], envelope: Envelope, roles: Sequence[Role]) -> Paste:
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
        length = (
            "at the predicted length"
            if all(map(_sound, whole))
            else "though not at the length that its function predicts"
        )
        return Paste("rtu", f"RTU: right CRC {length}, {_frames(len(whole))} over all {len(data)} bytes", tuple(whole))
    if envelope == "auto":
        mbap = _tcp(data, roles)
        if all(isinstance(piece, Found) and not piece.missing and _sound(piece) for piece in mbap):
            cover = f"{_frames(len(mbap))} over all {len(data)} bytes"
            return Paste("tcp", f"TCP: MBAP headers (protocol 0, right length), {cover}; no CRC fits", mbap)
    return _inexact(data, parts, envelope, roles)


def _inexact(data: bytes, parts: Sequence[Part], envelope: Envelope, roles: Sequence[Role]) -> Paste:
    """A paste that no envelope explains whole."""
    alone = rtu.lone(data, parts, roles)
    if alone is None:
        from .weighed import weighed

        pieces = rtu.mended(weighed(parts), parts, roles)
        right = sum(1 for piece in pieces if isinstance(piece, Found) and piece.check_ok)
        if right:
            rest = sum(piece.length for piece in pieces if not isinstance(piece, Found) or not piece.check_ok)
            around = f", which leaves {rest} of {len(data)} bytes" if rest else f", over all {len(data)} bytes"
            return Paste("rtu", f"RTU: right CRC in {_frames(right)}{around}", tuple(pieces))
        alone = pieces
    if any(isinstance(piece, Found) and piece.check_ok for piece in alone):
        return Paste("rtu", "RTU: a right CRC, though not at the length that its function predicts", tuple(alone))
    damaged = len(alone) == 1 and isinstance(alone[0], Found) and not alone[0].missing
    if envelope == "auto" and len(data) >= _LENGTH_END:
        mbap = _tcp(data, roles)
        first = mbap[0]
        if isinstance(first, Found) and (first.missing or _sound(first) or not damaged):
            return Paste("tcp", "TCP: begins with an MBAP header (protocol 0, a length); no CRC is right", mbap)
    if any(isinstance(piece, Found) for piece in alone):
        return Paste(
            "rtu", "RTU: reads like it by its header; no CRC is right, and there is no MBAP header", tuple(alone)
        )
    return Paste("rtu", "no frame: no right CRC, no MBAP header, no ASCII frame", tuple(alone))


def _ascii(data: bytes, roles: Sequence[Role]) -> list[Found]:
    return turns([Turn(adu, adu.start, possible(adu.pdu, roles)) for adu in ascii_frames(data)])


def _tcp(data: bytes, roles: Sequence[Role]) -> tuple[Piece, ...]:
    frames = tcp_frames(data)
    rest = frames[-1].start + frames[-1].length if frames else 0
    left = data[rest:]
    if left and len(left) <= MBAP and _begins_mbap(left):
        frames.append(tcp(left, rest))
    return _tiled(data, turns([Turn(adu, adu.start, possible(adu.pdu, roles), _cut(adu)) for adu in frames]))


def _begins_mbap(data: bytes) -> bool:
    """Whether a few bytes can be the beginning of an MBAP header: protocol 0, a length of at least 2."""
    return not any(data[2:4]) and (len(data) < _LENGTH_END or (data[4] == 0 and data[5] > 1))


def _sound(frame: Found) -> bool:
    """Whether a PDU is as long as its function predicts, if it predicts any length."""
    pdu = frame.adu.pdu
    declared = rule(pdu[0], frame.role) if pdu else None
    return declared is None or declared.variable or pdu_length(pdu, frame.role) == len(pdu)


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
