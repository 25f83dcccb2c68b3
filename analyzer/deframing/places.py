"""Where frames that nothing predicts may begin and end: next to silences and to other candidates, glitches aside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .candidates import GLITCHES
from .lattice import GLITCH_RUN, Candidate

SILENT: Final = 3  # the silence class from which a gap may part frames: 1 is none, 2 a character's worth of jitter


class Places(NamedTuple):
    """Offsets in a stretch."""

    begins: frozenset[int]
    ends: frozenset[int]
    cuts: tuple[int, ...] = ()  # sorted: silences that surely part what stands on their sides

    def parted(self, start: int, end: int) -> bool:
        """Whether such a silence stands inside [start, end)."""
        return any(start < cut < end for cut in self.cuts)


def places(
    data: bytes,
    classes: NDArray[np.uint8],
    candidates: Sequence[Candidate],
    idle: Sequence[int],
    parts: NDArray[np.bool_],
) -> Places:
    """Places in `data`; `idle`: where the line was quiet, its end too maybe; `parts`: classes of silence that part."""
    gaps = (1 + np.flatnonzero(classes[1 : len(data)] >= SILENT)).tolist()
    begins = {0, *gaps, *(c.end for c in candidates)}
    ends = {*gaps, *idle, *(c.start for c in candidates)}
    for place in list(begins):
        for at in range(place, min(place + GLITCH_RUN, len(data))):
            if data[at] not in GLITCHES:
                break
            begins.add(at + 1)
    for place in list(ends):
        for at in range(place - 1, max(place - 1 - GLITCH_RUN, -1), -1):
            if data[at] not in GLITCHES:
                break
            ends.add(at)
    cuts = (1 + np.flatnonzero(parts[classes[1 : len(data)]])).tolist()
    return Places(frozenset(begins), frozenset(ends), tuple(cuts))


def next_byte(data: bytes, place: int) -> int:
    """The first byte from `place` on that is no glitch, within the length of a run of them; else `place`."""
    for at in range(place, min(place + GLITCH_RUN, len(data))):
        if data[at] not in GLITCHES:
            return at
    return place
