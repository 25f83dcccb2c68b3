"""Where frames that nothing predicts may begin and end: next to silences and to other candidates, glitches aside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from .candidates import GLITCHES
from .lattice import GLITCH_RUN, Candidate

SILENT: Final = 3  # the silence class from which a gap may part frames: 1 is none, 2 a character's worth of jitter


class Places(NamedTuple):
    """Offsets in a stretch."""

    begins: frozenset[int]
    ends: frozenset[int]


def places(data: bytes, classes: Sequence[int], candidates: Sequence[Candidate], *, closed: bool) -> Places:
    """Places in `data`; `closed`: its end is an end of a frame too."""
    gaps = [i for i in range(1, len(data)) if classes[i] >= SILENT]
    begins = {0, *gaps, *(c.end for c in candidates)}
    ends = {*gaps, *(c.start for c in candidates)}
    if closed:
        ends.add(len(data))
    for place in list(begins):
        while place < len(data) and data[place] in GLITCHES:
            place += 1
            begins.add(place)
    for place in list(ends):
        while place > 0 and data[place - 1] in GLITCHES:
            place -= 1
            ends.add(place)
    return Places(frozenset(begins), frozenset(ends))


def next_byte(data: bytes, place: int) -> int:
    """The first byte from `place` on that is no glitch, within the length of a run of them; else `place`."""
    for at in range(place, min(place + GLITCH_RUN, len(data))):
        if data[at] not in GLITCHES:
            return at
    return place
