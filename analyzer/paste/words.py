"""Why a paste was read as it was, in words: the first row of an envelope whose condition holds."""

# ruff: noqa: ARG005 - a row of a table is a function whether it needs its arguments or not

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple, cast

from dissectors.lengths import pdu_length, rule

from ..deframing.weighing import begins_tcp
from ..languages import counted, tr
from .model import Envelope, PastedFrame, PastePart, Piece, frames_of


class _PieceCounts(NamedTuple):
    """Of one envelope: frames, cut ones, right ones (whole ones where there is no check value), those of the length
    that their function predicts; bytes, and those outside right frames."""

    frames: int
    cut: int
    right: int
    sound: int
    octets: int
    rest: int
    forced: bool
    headed: bool  # a part may begin with an MBAP header
    low: bool  # every byte is 00


class _Why(NamedTuple):
    envelope: str
    applies: Callable[[_PieceCounts], bool]
    words: str


_WHYS: Final = (
    _Why("rtu", lambda c: c.sound > 0 == c.rest and c.sound == c.right,
         "RTU: correct CRC at the predicted length, {cover}"),
    _Why("rtu", lambda c: c.right > 0 == c.rest,
         "RTU: correct CRC, but not at the length that its function predicts, {cover}"),
    _Why("rtu", lambda c: c.right > 0, "RTU: correct CRC in {correct}, which leaves {rest} of {bytes}"),
    _Why("rtu", lambda c: 0 < c.cut == c.frames and c.headed,
         "RTU: the header fits, the end with the CRC is cut off, and what may be an MBAP header does not fit"),
    _Why("rtu", lambda c: 0 < c.cut == c.frames,
         "RTU: the header fits, the end with the CRC is cut off, and there is no MBAP header"),
    _Why("rtu", lambda c: c.frames > 0 and c.headed,
         "RTU: the header fits, but no CRC matches, and what may be an MBAP header does not fit"),
    _Why("rtu", lambda c: c.frames > 0, "RTU: the header fits, but no CRC matches, and there is no MBAP header"),
    _Why("tcp", lambda c: c.frames == 0, "no frame: no MBAP header (protocol 0, a length)"),
    _Why("tcp", lambda c: c.forced, "TCP: MBAP headers (protocol 0, a length)"),
    _Why("tcp", lambda c: c.right > 0 == c.rest,
         "TCP: MBAP headers (protocol 0, correct length), {cover}; no CRC matches"),
    _Why("tcp", lambda c: c.right > 0,
         "TCP: MBAP headers (protocol 0, correct length) in {correct}; no CRC matches"),
    _Why("tcp", lambda c: True, "TCP: begins with an MBAP header (protocol 0, a length); no CRC matches"),
    _Why("ascii", lambda c: 0 < c.right == c.frames, "ASCII: {frames} between colon and line end, LRC correct"),
    _Why("ascii", lambda c: c.right > 0, "ASCII: {frames} between colon and line end, LRC correct in {right}"),
    _Why("ascii", lambda c: c.frames == 0, "no frame: no ASCII frame (colon to line end)"),
    _Why("ascii", lambda c: True, "ASCII: {frames} between colon and line end, LRC wrong"),
    _Why("pdu", lambda c: True, "PDU: function code and data alone, without unit and check value"),
    _Why("rtu", lambda c: c.low,
         "no frame: every byte is 00, as of a line that stays low: a break, A and B swapped, or no bias"),
    _Why("rtu", lambda c: c.headed,
         "no frame: no correct CRC, no ASCII frame, and what may be an MBAP header does not fit"),
    _Why("rtu", lambda c: True, "no frame: no correct CRC, no MBAP header, no ASCII frame"),
)  # fmt: skip


def why(pieces: Sequence[Piece], parts: Sequence[PastePart], envelope: Envelope) -> tuple[Envelope, str]:
    """The envelope of most frames, and the reasons for each that there is, the first one's first."""
    kinds = Counter(frame.adu.protocol for frame in frames_of(pieces))
    most = kinds.most_common(1)[0][0] if kinds else "rtu" if envelope == "auto" else envelope
    headed = any(begins_tcp(part.data) for part in parts)
    low = not any(map(any, (part.data for part in parts)))
    words = []
    for kind in kinds or (most,):
        mine = [piece for piece in pieces if (piece.adu.protocol if isinstance(piece, PastedFrame) else most) == kind]
        words.append(_words(kind, _counts(mine, forced=envelope == kind, headed=headed, low=low)))
    return cast(Envelope, most), "; ".join(words)


def _counts(pieces: Sequence[Piece], *, forced: bool, headed: bool, low: bool) -> _PieceCounts:
    frames = frames_of(pieces)
    right = [frame for frame in frames if frame.check_ok is not False]
    octets, framed = (sum(piece.length for piece in each) for each in (pieces, right))
    cut, sound = sum(frame.missing > 0 for frame in frames), sum(map(_sound, right))
    return _PieceCounts(len(frames), cut, len(right), sound, octets, octets - framed, forced, headed, low)


def _words(kind: str, counts: _PieceCounts) -> str:
    words = next(row.words for row in _WHYS if row.envelope == kind and row.applies(counts))
    frames, octets = counted(counts.frames, "frame", "frames"), counted(counts.octets, "byte", "bytes")
    cover = tr("{frames} over all {bytes}", frames=frames, bytes=octets)
    correct = counted(counts.right, "frame", "frames")
    return tr(words, frames=frames, cover=cover, correct=correct, right=counts.right, rest=counts.rest, bytes=octets)


def _sound(frame: PastedFrame) -> bool:
    """Whether a PDU is as long as its function predicts, if it predicts any length."""
    declared = rule(frame.adu.pdu[0], frame.role) if frame.adu.pdu else None
    return declared is None or declared.variable or pdu_length(frame.adu.pdu, frame.role) == len(frame.adu.pdu)
