"""bytes-repeated: a slice of the frame came twice in a row (a buffer bug in a converter), and it is right with one."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from math import inf, log2

from .case import MAX_ADU, Case
from .sent import likelihood
from .verdict import Verdict

_PRIOR = -2.0
_LENGTH = 6.0  # bits: how long the slice is
_SHORTEST = 2


def repeated(case: Case) -> Iterator[Verdict]:
    """One copy of a doubled slice taken out, wherever that makes length and CRC right; the likeliest."""
    data = case.data
    if len(data) > 2 * MAX_ADU:
        return
    ends: defaultdict[int, list[int]] = defaultdict(list)
    for place, register in enumerate(case.needed):
        ends[register].append(place)
    best: Verdict | None = None
    for start, register in enumerate(case.before):
        for end in ends.get(register, ()):
            length = end - start
            if length < _SHORTEST or data[start:end] != data[end : end + length]:
                continue
            frame = data[:start] + data[end:]
            bits = _PRIOR - _LENGTH + 8.0 * (length + 2) + likelihood(frame, case) - log2(len(data))
            if bits > -inf and (best is None or bits > best.bits):
                best = Verdict("bytes-repeated", bits, repaired=frame, byte=start, length=length)
    if best is not None:
        yield best
