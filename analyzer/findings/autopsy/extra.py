"""byte-extra: one byte too many, and the frame is right without it."""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, log2

from .case import MAX_ADU, Case
from .places import gathered
from .sent import likelihood
from .verdict import Place, Verdict

_PRIOR = -1.0


def extra(case: Case) -> Iterator[Verdict]:
    """One byte taken out, wherever that makes length and CRC right."""
    data, before, needed = case.data, case.before, case.needed
    if len(data) > MAX_ADU + 1:
        return
    fits: list[tuple[float, Place, bytes]] = []
    for at, value in enumerate(data):
        if before[at] != needed[at + 1] or (at and data[at - 1] == value):
            continue  # not right without it, or the same run as the place before
        last = at
        while last + 1 < len(data) and data[last + 1] == value:
            last += 1
        frame = data[:at] + data[at + 1 :]
        bits = _PRIOR + 16.0 + likelihood(frame, case) + log2(last - at + 1) - log2(len(data))
        if bits > -inf:
            fits.append((bits, Place(at, last, value), frame))
    yield from gathered("byte-extra", fits)
