"""crc-variant: the check value is right by another convention: the device's firmware is wrong, the line is not."""

from __future__ import annotations

from collections.abc import Iterator
from math import log2

from dissectors.checks import crc_bytes
from dissectors.crc_variants import VARIANTS, matching

from .case import MAX_ADU, Case
from .sent import likelihood
from .verdict import Verdict

_PRIOR = -3.0


def other_conventions(case: Case) -> Iterator[Verdict]:
    """The conventions by which the last two bytes are right."""
    data = case.data
    if len(data) > MAX_ADU:
        return
    for variant in matching(data):
        frame = data[:-2] + crc_bytes(data[:-2])
        bits = _PRIOR + 16.0 + likelihood(frame, case) - log2(len(VARIANTS))
        yield Verdict("crc-variant", bits, repaired=frame, variant=variant.name)
