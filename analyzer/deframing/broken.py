"""Frames that their sender made wrong: the CRC is right, the frame breaks a rule that the search takes for granted.

A byte count that contradicts the quantity beside it, more than 256 bytes, a function code that no request can have.
Such frames are rare and their windows few, so they are looked for only where whole stretches would else be noise, at
places where a frame may begin; an impossible function needs a known end as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from dissectors.declaration import EXCEPTION
from dissectors.lengths import Role, Sized, rule
from dissectors.limits import taken

from .candidates import GLITCHES, KNOWN_BITS, predicted
from .lattice import Candidate
from .places import Places
from .prefix import Windows
from .rules import MAX_ADU, MIN_ADU, OVERHEAD, Mask

LONGEST: Final = MAX_ADU + 64  # what a firmware makes of a byte count, or of a buffer
_BROKEN: Final = -12.0  # bits: few senders break such a rule
_IMPOSSIBLE: Final = -10.0  # or send a request that is none


def broken_windows(
    data: bytes, crc: Windows, at: int, places: Places, candidates: Sequence[Candidate], may: Mask
) -> list[Candidate]:
    """Candidates in `data`, which begins at index `at` of the windows; `may` as `prefix.opening` tells."""
    taken_starts = {c.start for c in candidates}
    found: dict[tuple[int, int, Role], Candidate] = {}
    for start in sorted(places.begins - taken_starts):
        if start + MIN_ADU > len(data) or not may[start]:
            continue
        head = crc.heads[at + start]
        for length, role, bits in _lengths(data, start, places):
            end = start + length
            if MIN_ADU <= length <= LONGEST and end <= len(data) and crc.tails[at + end] == head:
                found[start, end, role] = Candidate(start, end, role, bits)
    return [c for c in found.values() if not GLITCHES.issuperset(data[c.start : c.end])]


def _lengths(data: bytes, start: int, places: Places) -> Iterator[tuple[int, Role, float]]:
    """Lengths that a frame at `start` could have if it breaks a rule, with their structural bits."""
    function = data[start + 1]
    request = rule(function, Role.REQUEST)
    if request is None:
        if function & EXCEPTION or not function:
            for end in sorted(places.ends):
                if start + MIN_ADU <= end <= start + MAX_ADU:
                    yield end - start, Role.REQUEST, _IMPOSSIBLE
        return
    for check in request.checks:
        if isinstance(check, Sized) and request.count is not None and request.base is not None:
            quantity = int.from_bytes(
                data[start + check.quantity_offset + 1 : start + check.quantity_offset + 3], "big"
            )
            counted = data[start + check.count_offset + 1 : start + check.count_offset + 2]
            for octets in {*counted, taken(quantity, check.bits)}:
                yield request.base + OVERHEAD + octets, Role.REQUEST, KNOWN_BITS + _BROKEN
    for role in Role:
        length = predicted(data, start, role)
        if length is not None and length > MAX_ADU:
            yield length, role, KNOWN_BITS + _BROKEN
