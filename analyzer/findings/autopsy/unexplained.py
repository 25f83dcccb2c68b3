"""crc-error: a frame is there, its CRC is wrong, and nothing simple explains it.

The other explanations have to beat this one: several bits flipped, a burst, a check value that is merely wrong. What
the header should have been is known where an answer was due; each bit of it that differs has to be one of the few that
flipped.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import log2

from .case import Case
from .sent import BYTE, WRONG_LENGTH, as_captured
from .verdict import Verdict


def unexplained(case: Case) -> Iterator[Verdict]:
    """The verdict that is always possible."""
    data = case.data
    bits = as_captured(data, case)
    if case.header:
        bits = max(bits, _answer(case))
    yield Verdict("crc-error", bits)


def _answer(case: Case) -> float:
    """log2 of how likely this is the answer that was due, a few bits of it flipped."""
    header, data = case.header, case.data
    flipped = differing(header, data)
    bits = BYTE * min(len(header), len(data)) - flipped * log2(8 * len(data))
    return bits if case.due in (None, len(data)) else bits + WRONG_LENGTH


def differing(one: bytes, other: bytes) -> int:
    """Bits that differ, as far as both go."""
    return sum((a ^ b).bit_count() for a, b in zip(one, other, strict=False))
