"""byte-missing: one byte was lost; the CRC, being linear, tells its value for each place where it could have stood.

At one place in 256 a value exists at all, so that in a long frame a few places fit by chance: those that would make a
frame which nobody sends fall away, and the rest are all said. In a run of equal bytes every place gives the same frame.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf, log2

from dissectors.syndromes import byte_between

from .case import MAX_ADU, Case
from .places import gathered
from .sent import likelihood
from .verdict import Place, Verdict


def missing(case: Case) -> Iterator[Verdict]:
    """One byte put in, wherever that makes length and CRC right."""
    data = case.data
    if len(data) >= MAX_ADU:
        return
    fits: list[tuple[float, Place, bytes]] = []
    for at, (before, after) in enumerate(zip(case.before, case.needed, strict=True)):
        value = byte_between(before, after)
        if value is None or (at and data[at - 1] == value):
            continue  # none here, or the same run as the place before
        last = at
        while last < len(data) and data[last] == value:
            last += 1
        frame = data[:at] + bytes((value,)) + data[at:]
        bits = 8.0 + likelihood(frame, case) + log2(last - at + 1) - log2(len(frame))
        if bits > -inf:
            fits.append((bits, Place(at, last, value), frame))
    yield from gathered("byte-missing", fits)
