"""bit-flip: one bit, named by the CRC's syndrome, was not received as sent; it may be one of the CRC's own."""

from __future__ import annotations

from collections.abc import Iterator
from math import log2

from dissectors.syndromes import flipped_bit

from .case import MAX_ADU, Case
from .sent import likelihood
from .verdict import Verdict

_MARKED = 6.0  # bits: the UART complained of that very byte


def flipped(case: Case) -> Iterator[Verdict]:
    """The one bit that makes the CRC right, if there is one and the frame could have been sent."""
    data = case.data
    if len(data) > MAX_ADU or (found := flipped_bit(case.before[-1], len(data))) is None:
        return
    byte, bit = found
    sent = bytearray(data)
    sent[byte] ^= 1 << bit
    frame = bytes(sent)
    bits = 16.0 + likelihood(frame, case) - log2(8 * len(data)) + (_MARKED if byte in case.errors else 0.0)
    yield Verdict("bit-flip", bits, repaired=frame, byte=byte, bit=bit)
