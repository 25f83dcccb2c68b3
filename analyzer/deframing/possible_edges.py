"""Where a frame that nothing predicts may begin and end: next to silences and to other frames, glitches aside."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from .candidates import GLITCHES
from .gaps import MAY_PART, GapStatistics, silence_positions
from .lattice import GLITCH_RUN
from .paths import Candidate


class PossibleEdges(NamedTuple):
    """Offsets in a stretch."""

    begins: frozenset[int]
    ends: frozenset[int]
    cuts: tuple[int, ...] = ()  # sorted: silences that surely part what stands on their sides
    silences: tuple[int, ...] = ()  # sorted: those that frames hardly ever have inside

    def behind(self, candidates: Sequence[Candidate]) -> PossibleEdges:
        """These, and the ends of candidates: what is decided up to such an end begins there anew."""
        return self._replace(begins=self.begins | {c.end for c in candidates})

    def parted(self, start: int, end: int) -> bool:
        """Whether such a silence stands inside [start, end)."""
        return any(start < cut < end for cut in self.cuts)


def possible_edges(
    data: bytes,
    classes: bytearray,
    candidates: Sequence[Candidate],
    idle: Sequence[int],
    statistics: GapStatistics,
    *,
    first: bool,
    over: bool,
) -> PossibleEdges:
    """Edges in `data`; `classes`: of the silence before each of its bytes.

    `idle`: where the line was quiet, its end too maybe; `over`: it is quiet behind the end.
    `first`: the capture begins with these bytes, which parts no less where nothing but one frame follows.
    """
    gaps = silence_positions(classes, 1, MAY_PART)
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
    cuts, silences = silence_positions(classes, 1, statistics.parts), silence_positions(classes, 0, statistics.trusted)
    if over:
        silences = [0] * (first and not silences) + silences + [len(data)]
    return PossibleEdges(frozenset(begins), frozenset(ends), tuple(cuts), tuple(silences))


def next_byte(data: bytes, place: int) -> int:
    """The first byte from `place` on that is no glitch, within the length of a run of them; else `place`."""
    for at in range(place, min(place + GLITCH_RUN, len(data))):
        if data[at] not in GLITCHES:
            return at
    return place
