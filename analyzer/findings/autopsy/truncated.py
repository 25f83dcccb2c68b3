"""truncated: it starts like a frame of N bytes and ends after M.

N is what the pending request asked for, or what the header predicts. One byte short is byte-missing's as well, which
says more: here at least two are.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import log2

from dissectors.lengths import Role, pdu_length

from .case import MAX_ADU, OVERHEAD, Case
from .sent import BYTE, header
from .verdict import Verdict

_PRIOR = -1.0
_OTHER_ROLE = -6.0
_ONE_SHORT = -3.0  # and no byte makes it right: then more than the end is wrong


def truncated(case: Case) -> Iterator[Verdict]:
    """The frame that these bytes begin."""
    data, found = case.data, []
    if case.due is not None and len(data) < case.due and _same_start(case.header, data):
        found.append((BYTE * min(len(case.header), len(data)), case.due))
    for role in Role:
        length = pdu_length(data[1:], role) if len(data) > 1 else None
        if length is None or not len(data) < length + OVERHEAD <= MAX_ADU:
            continue
        told = case.expected is not None and role is Role.RESPONSE and case.expected.fits(data)
        bits = 2 * BYTE if told else header(data, case) + (_OTHER_ROLE if case.expected is not None else 0.0)
        found.append((bits + (0.0 if case.role in (None, role) else _OTHER_ROLE), length + OVERHEAD))
    if found:
        bits, length = max(found)
        bits += _PRIOR - log2(length) + (_ONE_SHORT if length == len(data) + 1 else 0.0)
        yield Verdict("truncated", bits, length=length)


def _same_start(one: bytes, other: bytes) -> bool:
    length = min(len(one), len(other))
    return one[:length] == other[:length]
