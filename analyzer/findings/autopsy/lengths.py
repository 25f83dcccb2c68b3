"""How long the frame should be that these bytes begin."""

from __future__ import annotations

from typing import NamedTuple

from dissectors.lengths import MAX_PDU, Role, pdu_length, rule

from .case import OVERHEAD, Case


class Length(NamedTuple):
    """An ADU's length; `least` where the bytes end before all of it is told: it is at least that."""

    length: int
    least: bool = False


def told(data: bytes, role: Role) -> Length | None:
    """The length that a frame's first bytes tell for a role, 0 where they can't be one; None where nothing tells."""
    pdu = data[1:MAX_PDU]
    if not pdu:
        return None
    length = pdu_length(pdu, role)
    if length is not None:
        return Length(length + OVERHEAD if length > 0 else 0)
    declared = rule(pdu[0], role)
    if declared is None or (declared.base is None and declared.walk is None):
        return None
    # With more bytes behind, something tells or breaks, unless these go on to an end that nobody counts.
    if pdu_length(pdu + bytes(MAX_PDU - len(pdu)), role) is None:
        return None
    return Length(max(declared.base or 0, len(pdu) + 1) + OVERHEAD, least=True)


def answer_length(case: Case) -> Length | None:
    """The length of the answer that is due, as its request or its own header tell."""
    if case.expected is None:
        return None
    if case.due is not None:
        return Length(case.due)
    return told(case.data, Role.RESPONSE) if case.expected.fits(case.data) else None


def agrees(length: Length | None, data: bytes) -> bool:
    """Whether these bytes are as long as that, for all that is known."""
    return length is None or length.length == len(data) or (length.least and length.length < len(data))
