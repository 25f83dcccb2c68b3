"""Frames of undeclared functions, and the possible edges of frames that nothing predicts.

Nothing predicts where such a frame ends, and one window in 65,536 checks by chance, so only windows count that begin
at a possible edge (next to silences and to other frames, glitches aside) and end at one, or where another such window
begins, and so on: chains of them tile the bytes. Of functions that this bus has used before, windows count wherever
they stand.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence, Set
from heapq import heappop, heappush
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.declaration import USER_DEFINED
from dissectors.length_rules import Role
from dissectors.lengths import is_open
from dissectors.limits import EXCEPTION, MAX_ADU, MIN_ADU

from ..tables.schema import GLITCHES
from .candidates import ZERO_BITS
from .conversation import Candidate
from .gaps import MAY_PART, GapStatistics, silence_positions
from .lattice import GLITCH_RUN
from .rules import CrcWindows


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


_UNHEARD: Final = -8.0  # bits: functions that nobody declared are rare
_HEARD: Final = 2.0  # this one was on this bus before
_LINKS: Final = 16  # windows of undeclared functions in a stretch, and one more for every four bytes
_ENDS: Final = 6  # of them at one place
_USER_BITS: Final = 3.0


def unknown_windows(
    data: bytes,
    crc: CrcWindows,
    at: int,
    edges: PossibleEdges,
    candidates: Sequence[Candidate],
    heard: Set[int],
    may: frozenset[int],
) -> list[Candidate]:
    """Candidates of undeclared length in `data`, which begins at index `at` of the windows.

    `heard` are such functions that this bus has used before, `may` tells where windows may check (`possible_starts`).
    """
    links = _links(data, crc.tails[at : at + len(data) + 1], crc.heads[at:], edges, candidates, heard, may)
    chained: set[int] = set()
    found: dict[tuple[int, int], None] = {}
    for begin, ends in sorted(links.items()):
        function = data[begin + 1]
        for end in ends:
            follow = [start for start in _starts_behind(data, end) if start in links]
            if begin in chained or function in heard:
                good = True
            elif begin in edges.begins:
                good = end in edges.ends or bool(follow)
            else:  # a request and its answer, of which nothing but the end is known
                follow = [s for s in follow if data[s : s + 2] == data[begin : begin + 2] and edges.ends & {*links[s]}]
                good = bool(follow)
            if good and not GLITCHES.issuperset(data[begin:end]):
                found[begin, end] = None
                chained.update(follow)
    result = []
    for begin, end in found:
        function = data[begin + 1]
        bits = (_HEARD if function in heard else _UNHEARD) + (_USER_BITS if function in USER_DEFINED else 0.0)
        bits += ZERO_BITS * _zeros(data, begin, end, found)
        doubtful = function not in heard and function not in USER_DEFINED
        result += [
            Candidate(begin, end, role, bits, declared=False, doubtful=doubtful)
            for role in Role
            if is_open(function, role)
        ]
    return result


def _links(
    data: bytes,
    tails: NDArray[np.uint16],
    heads: NDArray[np.uint16],
    edges: PossibleEdges,
    candidates: Sequence[Candidate],
    heard: Set[int],
    may: frozenset[int],
) -> dict[int, list[int]]:
    """Windows of functions of undeclared length, ends by start: from edges, from where others end, from known
    functions.

    Where such frames follow each other each begins where the one before ends: a chain of right CRCs that tile the bytes
    is no chance, though nothing else marks their ends.
    """
    n = len(data)
    begins = {c.start for c in candidates}
    waiting = sorted(i for i in may if i in edges.begins or (i + 1 < n and _is_loose(data[i + 1], heard)))
    links: dict[int, list[int]] = {}
    room = _LINKS + n // 4
    while waiting and room > 0:
        begin = heappop(waiting)
        if begin in links or begin in begins or begin + MIN_ADU > n or not _is_open(data[begin + 1]):
            continue
        right = tails[begin + MIN_ADU : begin + MAX_ADU + 1] == heads[begin]
        ends = (right.nonzero()[0][:_ENDS] + (begin + MIN_ADU)).tolist()
        if not ends:
            continue
        links[begin] = ends
        room -= len(ends)
        for end in ends:
            for start in _starts_behind(data, end):
                if start in may:
                    heappush(waiting, start)
    return links


def _is_loose(function: int, heard: Set[int]) -> bool:
    """Whether frames of this function are looked for wherever they may stand."""
    return function in heard or function in USER_DEFINED


def _is_open(function: int) -> bool:
    """Whether frames of this function may have any length."""
    return 0 < function < EXCEPTION and any(is_open(function, role) for role in Role)


def _starts_behind(data: bytes, end: int) -> range:
    """Where the next frame may begin: right behind another one, or behind glitches."""
    return range(end, next_byte(data, end) + 1)


def _zeros(data: bytes, begin: int, end: int, found: Collection[tuple[int, int]]) -> int:
    """How many of the last bytes are zeros behind a window that checks as well: likelier stray bytes than a CRC."""
    count = 0
    while data[end - 1 - count] == 0 and (begin, end - 1 - count) in found:
        count += 1
    return count
