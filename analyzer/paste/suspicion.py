"""Whether a paste needs a diagnosis: frames that are all as they should be need none, and start faster without."""

from __future__ import annotations

from dataclasses import replace

from dissectors.adu import LAST_UNIT, MAX_ADU
from dissectors.functions import function_class
from dissectors.lengths import plausibility

from .model import Paste, PastedFrame

_CONVERSATION = 2  # frames, beyond which somebody may have gone unanswered


def with_findings(paste: Paste) -> Paste:
    """The paste, its frames with what is wrong with them."""
    frames = list(paste.frames())
    if not frames or not (len(frames) > _CONVERSATION or any(map(_suspicious, frames))):
        return paste
    from .diagnosing import findings

    diagnosed = iter(findings(frames))
    pieces = tuple(
        replace(piece, findings=next(diagnosed)) if isinstance(piece, PastedFrame) else piece for piece in paste.pieces
    )
    return replace(paste, pieces=pieces)


def _suspicious(frame: PastedFrame) -> bool:
    """Whether anything about a frame alone may deserve a finding."""
    adu = frame.adu
    if not adu.pdu or frame.check_ok is False or frame.exception is not None or not adu.unit:
        return True
    if adu.unit > LAST_UNIT or len(adu.data) > MAX_ADU or frame.request is not None:
        return True
    return function_class(adu.pdu[0]) not in ("public", "user-defined") or bool(plausibility(adu.pdu, frame.role))
