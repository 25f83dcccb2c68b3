"""How a paste is read: one frame, or a request with its answer, at once; all else by the deframer.

Bytes that right check values explain to the last one need nobody else, if whoever speaks is plain: that is what people
paste all day, and it starts without arrays. Anything else is the deframer's, as it would be in a capture of the same
text; what it leaves over is read by the table of `readings`. The envelope is always told, with its reason.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING, Final, Literal

from dissectors.envelopes import Adu, ascii_frames, bare, rtu, tcp
from dissectors.functions import function_class
from dissectors.length_rules import Role
from dissectors.lengths import plausibility
from dissectors.limits import LAST_UNIT, MAX_ADU

from ..deframing.judging import judge
from ..deframing.weighing import bare_bits
from ..errors import RtuscopeError
from .completing import completed
from .model import Envelope, Paste, PastedFrame, PastePart, Piece, edges_of, frames_of, right_frames, tiled
from .readings import BOTH, LeftBytes, answers, chosen, directed, other, possible
from .words import why

if TYPE_CHECKING:
    from datetime import tzinfo

    from captures.checked import Checked
    from captures.text.logs import UnreadLine

_ROLES: Final = {"auto": BOTH, "request": (Role.REQUEST,), "response": (Role.RESPONSE,)}
LONGEST: Final = 1 << 20  # bytes
_PAIR: Final = 2  # hex digits of a byte; frames of an exchange
_AT_ONCE: Final = 1024  # bytes
_COARSE_NS: Final = 10**8  # as of captures (`deframing.tap_clock`), which is more than a paste loads
_SENT, _RECEIVED = 1, 2  # marks
_BY_MARK: Final = (BOTH, (Role.REQUEST,), (Role.RESPONSE,))
_SURE, _EITHER = 0.9999, 0.5
_SURELY_BARE: Final = 12.0  # bits


class PasteError(RtuscopeError):
    """A paste that cannot be read at all, in one line."""


def read(
    text: str,
    envelope: Envelope = "auto",
    role: Literal["auto", "request", "response"] = "auto",
    zone: tzinfo | None = None,
) -> Paste:
    """Pasted text as frames; `zone` is that of dates without one (None: this machine's).

    Raises PasteError, or captures.hexwords.HexError where it holds no bytes.
    """
    parts, unread = _parts(text, zone)
    size = sum(len(part.data) for part in parts)
    if size > LONGEST:
        raise PasteError(f"{size:,} bytes is too much to annotate; save them to a file and use rtuscope export")
    paste = read_parts(parts, envelope, _ROLES[role])
    return with_findings(replace(paste, pieces=_as_written(paste.pieces, parts), unread=unread))


def _parts(text: str, zone: tzinfo | None) -> tuple[list[PastePart], tuple[UnreadLine, ...]]:
    """The bytes in a text; what is nothing but pairs of digits needs no look at all the ways of writing bytes."""
    words = text.split()
    if "\n" not in text.strip() and len(words) > 1 and all(len(word) == _PAIR for word in words):
        with suppress(ValueError):
            return [PastePart(bytes.fromhex(text))], ()
    from captures.hexwords import read_paste

    parsed = read_paste(text, judge, zone)
    parts = [PastePart(item.data, item.mark, item.t_ns, item.ascii) for item in parsed.words]
    return parts, parsed.unread


def read_parts(parts: Sequence[PastePart], envelope: Envelope, roles: Sequence[Role]) -> Paste:
    """Bytes with their marks and times as frames."""
    if envelope == "pdu":
        return _bare(parts, roles)
    pieces = _at_once(parts, envelope, roles)
    if pieces is None:
        from .deframed import deframed

        pieces = completed(deframed(parts, envelope, roles), parts, envelope, roles)
        if envelope == "auto":
            from .foreign import as_foreign, without_chance

            pieces = without_chance(pieces, parts)
            if (foreign := as_foreign(pieces, parts)) is not None:
                return foreign
            if (pdus := _surely_bare(pieces, parts, roles)) is not None:
                return pdus
    protocol, words = why(pieces, parts, envelope)
    return Paste(protocol, words, _unchecked(_either_way(pieces, parts, roles)))


def _unchecked(pieces: Sequence[Piece]) -> tuple[Piece, ...]:
    """The pieces; where most frames, and several, lack their CRCs, the text leaves them out, and none is wrong."""
    frames = frames_of(pieces)
    bare: dict[int, Piece] = {frame.start: replace(frame, unchecked=True) for frame in frames if frame.lacks_crc}
    several = len({frame.adu.data for frame in frames if frame.start in bare}) > 1
    left_out = several and 2 * len(bare) > len(frames)
    return tuple(bare.get(piece.start, piece) if left_out else piece for piece in pieces)


def _either_way(pieces: Sequence[Piece], parts: Sequence[PastePart], roles: Sequence[Role]) -> list[Piece]:
    """The pieces; where a text says nothing of who speaks, frames that may go either way show both."""
    frames = right_frames(pieces)
    if len(frames) < len(pieces) or not _is_silent(parts):
        return list(pieces)
    tied = {frame.request_start for frame in frames} | {frame.start for frame in frames if frame.request is not None}
    loose = {frame.start for frame in frames if directed(frame.adu, roles).also is not None} - tied
    return [
        replace(frame, also=other(frame.role), confidence=_EITHER) if frame.start in loose else frame
        for frame in frames
    ]


def _is_silent(parts: Sequence[PastePart]) -> bool:
    """Whether a text says neither who speaks nor when."""
    return all((part.mark, part.t_ns) == (0, None) for part in parts)


def _at_once(parts: Sequence[PastePart], envelope: Envelope, roles: Sequence[Role]) -> list[Piece] | None:
    """The frame or the exchange that these bytes are, or the one frame that they are left of; None for any other."""
    data = b"".join(part.data for part in parts)
    if len(data) > _AT_ONCE:
        return None
    adus = [_adu(data[span.start : span.end], span) for span in judge(data) if not span.turned]
    if not adus:
        return _left_alone(parts, envelope, roles)
    tiles = sum(adu.length for adu in adus) == len(data) and len(adus) <= _PAIR
    named = envelope in ("auto", adus[0].protocol)
    return _exchanged(adus, parts, roles) if tiles and named and all(map(_is_legal, adus)) else None


def _left_alone(parts: Sequence[PastePart], envelope: Envelope, roles: Sequence[Role]) -> list[Piece] | None:
    """Bytes without a right frame, all in one part, as what they are left of; None where nothing tells."""
    data, *others = (part.data for part in parts)
    alone = LeftBytes(data, 0, roles, envelope, whole=True, last=True, alone=True, colon=parts[0].ascii)
    frames = [] if others else [one.frame for one in chosen(alone)]
    return tiled(data, 0, frames) if frames else None


def _adu(data: bytes, span: Checked) -> Adu:
    adu = ascii_frames(data)[0] if span.envelope == "ascii" else tcp(data) if span.envelope == "tcp" else rtu(data)
    return replace(adu, start=span.start, length=len(data))


def _is_legal(adu: Adu) -> bool:
    """Whether a frame breaks no limit in one direction: a right answer and the 00 behind it have a right CRC, too."""
    return any(not plausibility(adu.pdu, role) for role in possible(adu.pdu, BOTH))


def _exchanged(adus: Sequence[Adu], parts: Sequence[PastePart], roles: Sequence[Role]) -> list[Piece] | None:
    """One frame or two with their directions; None where the times and marks of a text may say otherwise."""
    if len(adus) == 1:
        marked = [role for role in _BY_MARK[parts[0].mark] if role in possible(adus[0].pdu, roles)]
        return [directed(adus[0], marked or roles)]
    asked, answer = (directed(adu, (role,)) for adu, role in zip(adus, BOTH, strict=True))
    plain = _is_silent(parts) or all(len(possible(adu.pdu, roles)) == 1 for adu in adus)
    if not plain or roles != BOTH or (asked.role, answer.role) != BOTH or not answers(*adus):
        return None
    return [asked, replace(answer, request=asked.adu.pdu, request_start=asked.start)]


def _surely_bare(pieces: Sequence[Piece], parts: Sequence[PastePart], roles: Sequence[Role]) -> Paste | None:
    """Parts that are a whole PDU, or one and its answer, rarer than chance gives them; lines of a log never are."""
    weights = [bare_bits(part.data) for part in parts]
    framed = all(isinstance(piece, PastedFrame) for piece in pieces) or right_frames(pieces)
    if framed or len(parts) > _PAIR or not _is_silent(parts) or not min(weights) or sum(weights) < _SURELY_BARE:
        return None
    paste = _bare(parts, roles)
    _, *answers = paste.frames()
    return paste if all(frame.request_start is not None for frame in answers) else None


def _bare(parts: Sequence[PastePart], roles: Sequence[Role]) -> Paste:
    """A PDU a part."""
    done: list[PastedFrame] = []
    for start, part in zip(edges_of(parts), parts, strict=False):
        frame = directed(bare(part.data, start), roles)
        asked = done[-1] if done and done[-1].role is Role.REQUEST else None
        if asked is not None and Role.RESPONSE in (frame.role, frame.also) and answers(asked.adu, frame.adu):
            done[-1] = replace(asked, also=None, confidence=_SURE)
            frame = replace(directed(frame.adu, (Role.RESPONSE,)), request=asked.adu.pdu, request_start=asked.start)
        done.append(frame)
    protocol, words = why(done, parts, "pdu")
    return Paste(protocol, words, tuple(done))


def _as_written(pieces: Sequence[Piece], parts: Sequence[PastePart]) -> tuple[Piece, ...]:
    """The pieces; a frame that begins with a line of the text has that line's mark and time, and that of the line it
    ends in.

    An answer's time is that between the two lines, as for a capture of unknown speed. Times that are written to a tenth
    of a second or less fine tell none.
    """
    edges = edges_of(parts)
    coarse = not any((part.t_ns or 0) % _COARSE_NS for part in parts)
    ends: dict[int | None, int] = {}  # of frames, by their starts
    timed: list[Piece] = []
    for piece in pieces:
        if isinstance(piece, PastedFrame):
            first, last = (bisect_right(edges, at) - 1 for at in (piece.start, piece.start + piece.length - 1))
            piece = replace(piece, mark=parts[first].mark)
            times = (parts[first].t_ns, parts[last].t_ns, piece.t_start_ns)
            if edges[first] == piece.start and times[0] is not None and times[1] is not None and times[2] is None:
                piece = _timed(piece, times[0], times[1], None if coarse else ends.get(piece.request_start))
            if piece.t_end_ns is not None:
                ends[piece.start] = piece.t_end_ns
        timed.append(piece)
    return tuple(timed)


def _timed(frame: PastedFrame, start_ns: int, end_ns: int, asked_ns: int | None) -> PastedFrame:
    took_ns = None if asked_ns is None or asked_ns > start_ns else start_ns - asked_ns
    return replace(frame, t_start_ns=start_ns, t_end_ns=end_ns, response_time_ns=took_ns)


_CONVERSATION: Final = 2  # frames, beyond which somebody may have gone unanswered


def with_findings(paste: Paste) -> Paste:
    """The paste, its pieces with what is wrong with them; frames that are all as they should be need no diagnosis."""
    frames = list(paste.frames())
    odd = len(frames) > _CONVERSATION or any(map(_suspicious, frames)) or _heard(frames)
    if paste.protocol == "pdu" or not (odd or len(frames) < len(paste.pieces)):
        return paste
    from .deframed import findings

    diagnosed = zip(paste.pieces, findings(paste.pieces), strict=True)
    return replace(paste, pieces=tuple(replace(piece, findings=found) for piece, found in diagnosed))


def _heard(frames: Sequence[PastedFrame]) -> bool:
    """Whether a request is marked as received right behind one that is marked as sent."""
    return any(
        second.role is Role.REQUEST and (first.mark, second.mark) == (_SENT, _RECEIVED)
        for first, second in pairwise(frames)
    )


def _suspicious(frame: PastedFrame) -> bool:
    """Whether anything about a frame alone may deserve a finding."""
    adu = frame.adu
    if not adu.pdu or frame.check_ok is False or frame.exception is not None or not adu.unit:
        return True
    if adu.unit > LAST_UNIT or len(adu.data) > MAX_ADU or frame.request is not None:
        return True
    return function_class(adu.pdu[0]) not in ("public", "user-defined") or bool(plausibility(adu.pdu, frame.role))
