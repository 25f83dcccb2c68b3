"""Frames that no declaration predicts whole: undeclared functions, frames made wrong, frames that came damaged.

Where a frame's length and its CRC do not speak for each other, its neighbours must: such a frame begins and ends at
possible edges, next to silences and to other candidates, glitches aside.

Undeclared functions. Nothing predicts where such a frame ends, and one window in 65,536 checks by chance, so only
windows count that begin at a possible edge and end at one, or where another such window begins, and so on: chains of
them tile the bytes. Of functions that this bus has used before, windows count wherever they stand.

Broken frames: the CRC is right, the frame breaks a rule that the search takes for granted: a byte count that
contradicts the quantity beside it, more than 256 bytes, a function code that no request can have. They are rare and
their windows few; an impossible function needs a known end as well. What fills all that lies between two silences
which this tap has earned trust for is a frame whatever its counts say.

Damaged frames: the CRC is wrong, but the rest speaks for itself. An answer whose header is the one that a request asked
for: unit, function and byte count are 24 bits that chance does not give, so such a stretch competes in the lattice with
whatever a chance CRC inside it would make of it. A request that stands alone between two silences and has the length
that its header predicts, or nearly.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Collection, Iterator, Sequence, Set
from functools import lru_cache
from heapq import heappop, heappush
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.adu import EXCEPTION, MAX_ADU, MIN_ADU, OVERHEAD
from dissectors.answers import expectation
from dissectors.declaration import USER_DEFINED
from dissectors.length_rules import Role
from dissectors.lengths import rule
from dissectors.limits import Sized, taken

from .candidates import GLITCHES, KNOWN_BITS, ZERO_BITS, predicted_length
from .conversation import OpenRequest
from .crc_windows import CrcWindows
from .gaps import SILENT, GapStatistics
from .lattice import GLITCH_RUN
from .paths import Candidate
from .rules import Mask

_UNHEARD: Final = -8.0  # bits: functions that nobody declared are rare
_HEARD: Final = 2.0  # this one was on this bus before
_LINKS: Final = 16  # windows of undeclared functions in a stretch, and one more for every four bytes
_ENDS: Final = 6  # of them at one place
_USER_BITS: Final = 3.0
LONGEST: Final = MAX_ADU + 64  # what a firmware makes of a byte count, or of a buffer
_SILENT_BITS: Final = 4.0  # a right CRC between two silences
_BROKEN: Final = -12.0  # bits: few senders break such a rule
_IMPOSSIBLE: Final = -10.0  # or send a request that is none
_DAMAGED: Final = -9.0  # bits: answers are damaged now and then
_LENGTH: Final = -3.0  # and not of the length that they should be
_LONGER: Final = -2.0  # a byte too many
_MUCH_LONGER: Final = -0.5  # and more, where a slice came twice, or another sender joined in
_OTHER_COUNT: Final = -4.0  # as long as it should be, but its header says otherwise
_BYTE: Final = -39 / 64  # a byte that nothing vouches for
_SPARE: Final = 4  # bytes that a fault may have added
_MORE: Final = 48  # and another sender, beyond twice the length
_NEARLY: Final = -3.0  # a request that is a byte short or long: less sure to be one at all
_LEAST: Final = 3


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
    classes: NDArray[np.uint8],
    candidates: Sequence[Candidate],
    idle: Sequence[int],
    statistics: GapStatistics,
    *,
    over: bool,
) -> PossibleEdges:
    """Edges in `data`; `idle`: where the line was quiet, its end too maybe; `over`: it is quiet behind the end."""
    parts, trusted = statistics.parts(), statistics.trusted
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
    silences = np.flatnonzero(trusted[classes[: len(data)]]).tolist()
    silences += [len(data)] * over
    return PossibleEdges(frozenset(begins), frozenset(ends), tuple(cuts), tuple(silences))


def next_byte(data: bytes, place: int) -> int:
    """The first byte from `place` on that is no glitch, within the length of a run of them; else `place`."""
    for at in range(place, min(place + GLITCH_RUN, len(data))):
        if data[at] not in GLITCHES:
            return at
    return place


def open_length(function: int, role: Role) -> bool:
    """Whether nothing says how long a frame of this function is."""
    declared = rule(function, role)
    return declared is None or declared.variable or (declared.base is None and declared.walk is None)


def unknown_windows(
    data: bytes,
    crc: CrcWindows,
    at: int,
    edges: PossibleEdges,
    candidates: Sequence[Candidate],
    heard: Set[int],
    may: Mask,
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
            if open_length(function, role)
        ]
    return result


def _links(
    data: bytes,
    tails: NDArray[np.uint16],
    heads: NDArray[np.uint16],
    edges: PossibleEdges,
    candidates: Sequence[Candidate],
    heard: Set[int],
    may: Mask,
) -> dict[int, list[int]]:
    """Windows of functions of undeclared length, ends by start: from edges, from where others end, from known
    functions.

    Where such frames follow each other each begins where the one before ends: a chain of right CRCs that tile the bytes
    is no chance, though nothing else marks their ends.
    """
    n = len(data)
    octets = np.frombuffer(data, np.uint8)
    begins = {c.start for c in candidates}
    loose = _loose_functions(frozenset(heard)).take(octets[1:]) & may[: n - 1]
    waiting = sorted({*loose.nonzero()[0].tolist(), *(i for i in edges.begins if i < n and may[i])})
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
                if start < n and may[start]:
                    heappush(waiting, start)
    return links


@lru_cache(maxsize=64)
def _loose_functions(heard: frozenset[int]) -> Mask:
    """By function, whether its frames are looked for wherever they may stand."""
    loose = np.zeros(256, np.bool_)
    loose[[*heard, *USER_DEFINED]] = True
    return loose


def _is_open(function: int) -> bool:
    """Whether frames of this function may have any length."""
    return 0 < function < EXCEPTION and any(open_length(function, role) for role in Role)


def _starts_behind(data: bytes, end: int) -> range:
    """Where the next frame may begin: right behind another one, or behind glitches."""
    return range(end, next_byte(data, end) + 1)


def _zeros(data: bytes, begin: int, end: int, found: Collection[tuple[int, int]]) -> int:
    """How many of the last bytes are zeros behind a window that checks as well: likelier stray bytes than a CRC."""
    count = 0
    while data[end - 1 - count] == 0 and (begin, end - 1 - count) in found:
        count += 1
    return count


def broken_windows(
    data: bytes, crc: CrcWindows, at: int, edges: PossibleEdges, candidates: Sequence[Candidate], may: Mask
) -> list[Candidate]:
    """Candidates in `data`, which begins at index `at` of the windows; `may` as `possible_starts` tells."""
    taken_starts = {c.start for c in candidates}
    found: dict[tuple[int, int, Role], Candidate] = {}
    for start in sorted(edges.begins - taken_starts):
        if start + MIN_ADU > len(data) or not may[start]:
            continue
        head = crc.heads[at + start]
        for length, role, bits in _lengths(data, start, edges):
            end = start + length
            if MIN_ADU <= length <= LONGEST and end <= len(data) and crc.tails[at + end] == head:
                found[start, end, role] = Candidate(start, end, role, bits, doubtful=True)
    return [c for c in found.values() if not GLITCHES.issuperset(data[c.start : c.end])]


def silent_windows(
    data: bytes, crc: CrcWindows, at: int, edges: PossibleEdges, candidates: Sequence[Candidate]
) -> list[Candidate]:
    """Candidates of declared functions that fill what lies between two silences, whatever their counts say."""
    windows = []
    taken_ones = {(c.start, c.end) for c in candidates}
    for start, end in pairwise(edges.silences):
        if not MIN_ADU <= end - start <= LONGEST or crc.heads[at + start] != crc.tails[at + end]:
            continue
        function = data[start + 1]
        if (start, end) in taken_ones or _holds_a_frame(candidates, start, end) or rule(function, Role.REQUEST) is None:
            continue
        windows += [Candidate(start, end, role, _SILENT_BITS, doubtful=True) for role in Role]
    return windows


def _lengths(data: bytes, start: int, edges: PossibleEdges) -> Iterator[tuple[int, Role, float]]:
    """Lengths that a frame at `start` could have if it breaks a rule, with their structural bits."""
    function = data[start + 1]
    request = rule(function, Role.REQUEST)
    if request is None:
        if function & EXCEPTION or not function:
            for end in sorted(edges.ends):
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
        length = predicted_length(data, start, role)
        if length is not None and length > MAX_ADU:
            yield length, role, KNOWN_BITS + _BROKEN


def damaged_answers(
    data: bytes, edges: PossibleEdges, candidates: Sequence[Candidate], open_requests: Sequence[OpenRequest]
) -> list[Candidate]:
    """Candidates for damaged answers to the pending request or to requests in `data`."""
    taken = {c.start for c in candidates if c.role == Role.RESPONSE}
    asked = [(0, p.adu) for p in open_requests[-1:]]
    asked += [
        (c.end, data[c.start : c.end]) for c in candidates if c.role == Role.REQUEST and c.declared and data[c.start]
    ]
    found: dict[tuple[int, int], Candidate] = {}
    ends = sorted(edges.ends)
    for begin, request in asked:
        starts = _starts(data, begin, request[:2], taken)
        if not starts:
            continue
        header = expectation(request).header
        due = predicted_length(header, 0, Role.RESPONSE) if len(header) >= _LEAST else None
        for start in starts:
            if data.startswith(header, start):
                length = predicted_length(data, start, Role.RESPONSE) or MAX_ADU
                most = start + (2 * length + _MORE if len(header) >= _LEAST else length)
                least = start + (_LEAST if len(header) >= _LEAST else length)
                for end in ends[bisect_left(ends, least) : bisect_right(ends, most)]:
                    if not edges.parted(start, end):
                        found[start, end] = Candidate(
                            start, end, Role.RESPONSE, _bits(end - start, length), damaged=True
                        )
            end = start + (due or 0)
            if due and (start, end) not in found and end in edges.ends and not edges.parted(start, end):
                bits = _bits(due, due) + _OTHER_COUNT
                found[start, end] = Candidate(start, end, Role.RESPONSE, bits, damaged=True)
    return list(found.values())


def _starts(data: bytes, begin: int, header: bytes, taken: Set[int]) -> list[int]:
    """Where, from `begin` on and behind glitches at most, a header stands that no right answer has."""
    found = []
    for start in range(begin, min(begin + GLITCH_RUN, len(data))):
        if start not in taken and data.startswith(header, start):
            found.append(start)
        if data[start] not in GLITCHES:
            break
    return found


def _bits(length: int, predicted_length: int) -> float:
    """What the length of a damaged answer says."""
    bits = _DAMAGED + _BYTE * length
    if length != predicted_length:
        more = max(0, length - predicted_length)
        bits += _LENGTH + _LONGER * min(more, _SPARE) + _MUCH_LONGER * max(0, more - _SPARE)
    return bits


def damaged_requests(data: bytes, edges: PossibleEdges, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Candidates for damaged requests in `data`."""
    taken = {c.start for c in candidates}
    found = []
    for start in sorted(edges.begins - taken):
        length = predicted_length(data, start, Role.REQUEST) if start + _LEAST < len(data) else None
        if length is None:
            continue
        for end in (start + length, start + length - 1, start + length + 1):
            if end in edges.ends and not edges.parted(start, end) and not _holds_a_frame(candidates, start, end):
                bits = _bits(end - start, length) + (0.0 if end == start + length else _NEARLY)
                found.append(Candidate(start, end, Role.REQUEST, bits, damaged=True))
    return found


def _holds_a_frame(candidates: Sequence[Candidate], start: int, end: int) -> bool:
    """Whether a whole frame takes most of these bytes: then the rest are strays."""
    return any(start <= c.start and c.end <= end and 2 * (c.end - c.start) > end - start for c in candidates)
