"""Which envelope a paste is in: RTU, ASCII or MBAP. Each is tried; the one whose check explains the bytes is taken.

Runs of bytes whose own check values say different envelopes (a gateway's log has RTU and TCP lines) are read each in
its own. Else, in order: frames of ASCII mode, which show themselves; RTU frames whose right CRCs tile all of it; MBAP
headers whose lengths do; RTU frames among other bytes; and where no check value is right at all, what reads like a
frame that was damaged or cut, in the envelope for which more speaks. The choice is always told, with its reason.
Frames that are all as they should be need no diagnosis, and start faster without.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TYPE_CHECKING, Final, Literal

from dissectors.envelopes import ascii_frames, bare
from dissectors.functions import function_class
from dissectors.length_rules import Role
from dissectors.lengths import pdu_length, plausibility, rule, sound_roles
from dissectors.limits import LAST_UNIT, MAX_ADU

from ..deframing.weighing import bare_bits, tells_ascii
from ..errors import RtuscopeError
from ..languages import counted, tr
from . import rtu
from .mbap import LENGTH_END, begins_tcp, is_tcp, left_over, may_show_headers, mbap_frames
from .mixing import Envelope, kinds_of, mixed
from .model import Paste, PastedFrame, PastedNoise, PastePart, Piece, Unread, tiled
from .remnants import completed
from .rtu import BOTH, Turn, possible, turns

if TYPE_CHECKING:
    from datetime import tzinfo

_ROLES: Final = {"auto": BOTH, "request": (Role.REQUEST,), "response": (Role.RESPONSE,)}
LONGEST: Final = 1 << 20  # bytes
_PAIR: Final = 2  # hex digits of a byte
_COARSE_NS: Final = 10**8  # as of captures (`deframing.tap_clock`), which is more than a paste loads
_LATE_NS: Final = 10**8  # as of captures (`deframing.writes`)
_CRC: Final = 2  # bytes
_SENT, _RECEIVED = 1, 2  # marks
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
    if envelope == "auto" and not all(isinstance(piece, PastedFrame) and _is_plain(piece) for piece in paste.pieces):
        from .foreign import as_foreign

        paste = as_foreign(paste, parts)
    pieces = _as_written(paste.pieces, parts)
    if role == "auto" and _has_late_echo(pieces) and not any(part.mark for part in parts):
        pieces = _as_written(_by_silence(paste.pieces, parts), parts)
    return with_findings(replace(paste, pieces=pieces, unread=unread))


def _has_late_echo(pieces: Sequence[Piece]) -> bool:
    """Whether a frame of RTU is the one before it once more, so late that it may be no answer."""
    return any(
        isinstance(first, PastedFrame)
        and isinstance(again, PastedFrame)
        and again.adu.data == first.adu.data
        and again.adu.protocol == "rtu"
        and again.t_start_ns is not None
        and first.t_end_ns is not None
        and again.t_start_ns - first.t_end_ns >= _LATE_NS
        for first, again in pairwise(pieces)
    )


def _by_silence(pieces: Sequence[Piece], parts: Sequence[PastePart]) -> tuple[Piece, ...]:
    """The same frames, each in the direction that it has in a capture with these times."""
    from .deframed import weighed

    frames = [piece for piece in weighed(parts) if isinstance(piece, PastedFrame)]
    said = {(frame.start, frame.length): frame for frame in frames}
    return tuple(
        replace(piece, role=found.role, request=found.request, request_start=found.request_start, also=None)
        if isinstance(piece, PastedFrame) and (found := said.get((piece.start, piece.length))) is not None
        else piece
        for piece in pieces
    )


def _as_written(pieces: Sequence[Piece], parts: Sequence[PastePart]) -> tuple[Piece, ...]:
    """The pieces; a frame that begins with a line of the text has that line's mark and time, and that of the line it
    ends in.

    An answer's time is that between the two lines, as for a capture of unknown speed. Times that are written to a tenth
    of a second or less fine tell none.
    """
    starts = list(accumulate((len(part.data) for part in parts), initial=0))
    times = dict(zip(starts, (part.t_ns for part in parts), strict=False))
    coarse = all(part.t_ns is None or part.t_ns % _COARSE_NS == 0 for part in parts)
    ends: dict[int, int] = {}  # of frames, by their starts
    timed: list[Piece] = []
    for piece in pieces:
        start_ns = times.get(piece.start)
        if isinstance(piece, PastedFrame):
            piece = replace(piece, mark=parts[bisect_right(starts, piece.start) - 1].mark)
        if isinstance(piece, PastedFrame) and piece.t_start_ns is None and start_ns is not None:
            end_ns = parts[bisect_right(starts, piece.start + piece.length - 1) - 1].t_ns
            if end_ns is not None:
                ends[piece.start] = end_ns
            asked_ns = None if coarse or piece.request_start is None else ends.get(piece.request_start)
            took_ns = None if asked_ns is None or asked_ns > start_ns else start_ns - asked_ns
            timed.append(replace(piece, t_start_ns=start_ns, t_end_ns=end_ns, response_time_ns=took_ns))
        else:
            timed.append(piece)
    return tuple(timed)


def _parts(text: str, zone: tzinfo | None) -> tuple[list[PastePart], tuple[Unread, ...]]:
    """The bytes in a text; what is nothing but pairs of digits needs no look at all the ways of writing bytes."""
    words = text.split()
    if "\n" not in text.strip() and len(words) > 1 and all(len(word) == _PAIR for word in words):
        with suppress(ValueError):
            return [PastePart(bytes.fromhex(text))], ()
    from captures.hexwords import read_paste

    from .evidence import judge

    parsed = read_paste(text, judge, zone)
    parts = [PastePart(item.data, item.mark, item.t_ns, item.ascii) for item in parsed.words]
    return parts, tuple(Unread(one.line, one.text, one.why, one.empty) for one in parsed.unread)


def read_parts(parts: Sequence[PastePart], envelope: Envelope, roles: Sequence[Role]) -> Paste:
    """Bytes with their marks and times as frames."""
    if envelope == "auto" and len(parts) > 1:
        kinds = kinds_of(parts)
        if len(set(kinds)) > 1:
            return mixed(parts, kinds, lambda mine, kind: _alike(mine, kind, roles))
    return _alike(parts, envelope, roles)


def _alike(parts: Sequence[PastePart], envelope: Envelope, roles: Sequence[Role]) -> Paste:
    """Parts of one envelope."""
    data = b"".join(part.data for part in parts)
    if envelope == "ascii":
        return Paste("ascii", _why_ascii(frames := _ascii(data, roles)), tiled(data, frames))
    if envelope == "tcp":
        return Paste("tcp", tr("TCP: MBAP headers (protocol 0, a length)"), mbap_frames(data, parts, roles))
    if envelope == "pdu":
        return _bare(parts, roles)
    if envelope == "auto":
        frames = _ascii(data, roles)
        if frames and (any(tells_ascii(frame.adu, data) for frame in frames) or _shows_ascii(parts)):
            return Paste("ascii", _why_ascii(frames), tiled(data, frames))
    exact = rtu.exact(data, parts, roles)
    if exact is not None:
        why = (
            tr("RTU: correct CRC at the predicted length, {cover}", cover=_cover(exact, data))
            if all(map(_sound, exact))
            else tr(
                "RTU: correct CRC, but not at the length that its function predicts, {cover}", cover=_cover(exact, data)
            )
        )
        return Paste("rtu", why, tuple(exact))
    if envelope == "auto":
        mbap = mbap_frames(data, parts, roles)
        whole = all(isinstance(piece, PastedFrame) and not piece.missing and _sound(piece) for piece in mbap)
        if whole and is_tcp(data, parts):
            cover = _cover(mbap, data)
            why = tr("TCP: MBAP headers (protocol 0, correct length), {cover}; no CRC matches", cover=cover)
            return Paste("tcp", why, mbap)
    return _inexact(data, parts, envelope, roles)


def _shows_ascii(parts: Sequence[PastePart]) -> bool:
    """Whether parts are written as frames of ASCII mode, and none has a right check value of another envelope."""
    if not any(part.ascii for part in parts):
        return False
    from .evidence import envelope_of

    return all(envelope_of(part.data) is None for part in parts if not part.ascii)


def _inexact(data: bytes, parts: Sequence[PastePart], envelope: Envelope, roles: Sequence[Role]) -> Paste:
    """A paste that no envelope explains whole."""
    from .foreign import are_no_headers, without_chance

    alone, checked = rtu.lone(data, parts, roles), 0
    if alone is None:
        from .deframed import weighed

        pieces = completed(rtu.mended(weighed(parts), parts), parts, roles)
        checked = _right(pieces)
        if envelope == "auto":
            pieces = without_chance(pieces, parts)
        if right := _right(pieces):
            rest = sum(piece.length for piece in pieces if not isinstance(piece, PastedFrame) or not piece.check_ok)
            frames, octets = counted(right, "frame", "frames"), _octets(data)
            why = (
                tr(
                    "RTU: correct CRC in {frames}, which leaves {rest} of {bytes}",
                    frames=frames,
                    rest=rest,
                    bytes=octets,
                )
                if rest
                else tr("RTU: correct CRC in {frames}, over all {bytes}", frames=frames, bytes=octets)
            )
            return Paste("rtu", why, tuple(pieces))
        alone = pieces
    if _right(alone):
        return Paste("rtu", tr("RTU: a correct CRC, but not at the length that its function predicts"), tuple(alone))
    if envelope == "auto" and len(data) >= LENGTH_END:
        mbap = mbap_frames(data, parts, roles)
        whole = [piece for piece in mbap if isinstance(piece, PastedFrame) and not piece.missing and _sound(piece)]
        if whole and 2 * sum(frame.length for frame in whole) > len(data) and is_tcp(data, parts):
            frames = counted(len(whole), "frame", "frames")
            why = tr("TCP: MBAP headers (protocol 0, correct length) in {frames}; no CRC matches", frames=frames)
            return Paste("tcp", why, mbap)
        heads = isinstance(mbap[0], PastedFrame) and not are_no_headers(mbap)
        framed = any(isinstance(piece, PastedFrame) for piece in alone)
        if heads and (begins_tcp(parts[0].data) or not (framed or left_over(mbap))):
            return Paste("tcp", tr("TCP: begins with an MBAP header (protocol 0, a length); no CRC matches"), mbap)
    if envelope == "auto" and any(isinstance(piece, PastedNoise) for piece in alone):
        bare_alone = _surely_bare(parts, roles)
        if bare_alone is not None:
            return bare_alone
    return Paste("rtu", _why_unchecked(parts, alone, checked=bool(checked)), tuple(alone))


def _why_unchecked(parts: Sequence[PastePart], pieces: Sequence[Piece], *, checked: bool) -> str:
    """Why these pieces, in which no check value is right; `checked`: one was, and is chance."""
    if any(isinstance(piece, PastedFrame) for piece in pieces):
        return _why_likely(parts)
    if checked:
        return tr("no frame: a correct CRC among so many other bytes is chance")
    if may_show_headers(parts):
        return tr("no frame: no correct CRC, no ASCII frame, and what may be an MBAP header does not fit")
    return tr("no frame: no correct CRC, no MBAP header, no ASCII frame")


def _surely_bare(parts: Sequence[PastePart], roles: Sequence[Role]) -> Paste | None:
    """Parts that are a whole PDU, or one and its answer, rarer than chance gives them; lines of a log never are."""
    if len(parts) > len(BOTH) or any(part.mark or part.t_ns is not None for part in parts):
        return None
    weights = [bare_bits(part.data) for part in parts]
    if not all(weights) or sum(weights) < _SURELY_BARE:
        return None
    paste = _bare(parts, roles)
    _, *answers = paste.frames()
    return paste if all(frame.request_start is not None for frame in answers) else None


def _bare(parts: Sequence[PastePart], roles: Sequence[Role]) -> Paste:
    """A PDU a part."""
    starts = accumulate((len(part.data) for part in parts), initial=0)
    frames = turns(
        [
            Turn(bare(part.data, at), at, possible(part.data, roles), mark=part.mark)
            for at, part in zip(starts, parts, strict=False)
        ]
    )
    return Paste("pdu", tr("PDU: function code and data alone, without unit and check value"), tuple(frames))


def _right(pieces: Sequence[Piece]) -> int:
    """How many frames have a right CRC."""
    return sum(1 for piece in pieces if isinstance(piece, PastedFrame) and piece.check_ok)


def _why_likely(parts: Sequence[PastePart]) -> str:
    """Why bytes are taken for RTU that have no right CRC."""
    if may_show_headers(parts):
        return tr("RTU: the header fits, but no CRC matches, and what may be an MBAP header does not fit")
    return tr("RTU: the header fits, but no CRC matches, and there is no MBAP header")


def _why_ascii(frames: Sequence[PastedFrame]) -> str:
    number, right = counted(len(frames), "frame", "frames"), sum(1 for frame in frames if frame.check_ok)
    if not right:
        return tr("ASCII: {frames} between colon and line end, LRC wrong", frames=number)
    if right == len(frames):
        return tr("ASCII: {frames} between colon and line end, LRC correct", frames=number)
    return tr("ASCII: {frames} between colon and line end, LRC correct in {right}", frames=number, right=right)


def _ascii(data: bytes, roles: Sequence[Role]) -> list[PastedFrame]:
    return turns([Turn(adu, adu.start, possible(adu.pdu, roles)) for adu in ascii_frames(data)])


def _sound(frame: PastedFrame) -> bool:
    """Whether a PDU is as long as its function predicts, if it predicts any length."""
    pdu = frame.adu.pdu
    declared = rule(pdu[0], frame.role) if pdu else None
    return declared is None or declared.variable or pdu_length(pdu, frame.role) == len(pdu)


def _is_plain(frame: PastedFrame) -> bool:
    """Whether nothing of a frame speaks for its being no Modbus."""
    if frame.check_ok is False:
        return False
    return function_class(frame.adu.pdu[0]) != "user-defined" and bool(sound_roles(frame.adu.pdu))


def _cover(frames: Sequence[Piece], data: bytes) -> str:
    return tr("{frames} over all {bytes}", frames=counted(len(frames), "frame", "frames"), bytes=_octets(data))


def _octets(data: bytes) -> str:
    return counted(len(data), "byte", "bytes")


_CONVERSATION = 2  # frames, beyond which somebody may have gone unanswered


def with_findings(paste: Paste) -> Paste:
    """The paste, its frames with what is wrong with them."""
    frames = list(paste.frames())
    if (
        not frames
        or paste.protocol == "pdu"
        or not (len(frames) > _CONVERSATION or any(map(_suspicious, frames)) or _heard_back(frames))
    ):
        return paste
    from .deframed import findings

    diagnosed = iter(findings(paste.pieces))
    pieces = tuple(
        replace(piece, findings=next(diagnosed)) if isinstance(piece, PastedFrame) else piece for piece in paste.pieces
    )
    return replace(paste, pieces=pieces)


def _heard_back(frames: Sequence[PastedFrame]) -> bool:
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
