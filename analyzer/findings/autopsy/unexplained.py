"""crc-error: a frame is there, its CRC is wrong, and nothing simple explains it.

The other explanations have to beat this one: several bits flipped, a burst, a check value that is merely wrong. What
the header should have been is known where an answer was due; each bit of it that differs has to be one of the few that
flipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, log2

from dissectors.declaration import EXCEPTION
from dissectors.lengths import Role

from .case import Case
from .lengths import agrees, answer_length, told
from .sent import BYTE, LENGTH_TOLD, REFUSED, counted, opening
from .verdict import Verdict

_PRIOR = -1.0
_EXCEPTION_ADU = 5
_NO_HEADER = -3.0  # bytes that don't begin like anything
_WRONG_LENGTH = -10.0  # damage of no simple kind seldom changes how long a frame is


def unexplained(case: Case) -> Iterator[Verdict]:
    """The verdict that is always possible."""
    yield Verdict("crc-error", _PRIOR + max(_answer(case), _any(case)))


def _answer(case: Case) -> float:
    """log2 of how likely this is the answer that was due, or an exception, some bits of it flipped."""
    if case.expected is None:
        return -inf
    refused = bytes((case.expected.unit, case.expected.function | EXCEPTION))
    return max(
        _flips(case.header, case.data) + (0.0 if agrees(answer_length(case), case.data) else _WRONG_LENGTH),
        _flips(refused, case.data) + REFUSED + (0.0 if len(case.data) == _EXCEPTION_ADU else _WRONG_LENGTH),
    )


def _flips(due: bytes, data: bytes) -> float:
    """log2 of how likely bits flipped to make these bytes of ones that begin so."""
    flipped = sum((a ^ b).bit_count() for a, b in zip(due, data, strict=False))
    if flipped < 2 and len(due) >= len(data):
        flipped += 2  # nothing else of it can differ, and one bit would have been found
    return BYTE * min(len(due), len(data)) - flipped * log2(8 * len(data))


def _any(case: Case) -> float:
    """log2 of how likely any frame that was sent here begins, and is as long, as these bytes."""
    data, best = case.data, _NO_HEADER
    for role in Role:
        bits = opening(data, role, case)
        length = told(data, role)
        if not agrees(length, data):
            bits += _WRONG_LENGTH
        elif length is not None and counted(data[1], role):
            bits += LENGTH_TOLD
        best = max(best, bits)
    return best
