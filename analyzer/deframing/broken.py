"""Frames made wrong, and frames that came damaged: what the search for frames takes for granted does not hold of them.

Made wrong: the CRC is right, but a byte count contradicts the quantity beside it or the bytes that are there, there are
more than 256 bytes, or a function code that no request can have. They are rare and their windows few: such a frame
begins at a possible edge; where nothing in it tells its length it ends at one, too. What fills all that lies between
two silences which this tap has earned trust for is a frame whatever its counts say.

Damaged: the CRC is wrong, but the rest speaks for itself. An answer whose header is the one that a request asked for:
unit, function and byte count are 24 bits that chance does not give, so such a stretch competes in the lattice with
whatever a chance CRC inside it would make of it. A request that stands alone between two silences and has the length
that its header predicts, or nearly.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterator, Sequence, Set
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.length_rules import Role
from dissectors.lengths import expectation, miscounted_role, rule
from dissectors.limits import EXCEPTION, MAX_ADU, MIN_ADU, OVERHEAD, Sized, taken

from ..tables.schema import GLITCHES
from .candidates import CRC_BITS, KNOWN_BITS, predicted_length
from .conversation import Candidate, OpenRequest, holds_a_frame
from .lattice import GLITCH_RUN
from .rules import CrcWindows
from .unpredicted import PossibleEdges

_LONGEST: Final = MAX_ADU + 64  # what a firmware makes of a byte count, or of a buffer
_SILENT_BITS: Final = 4.0  # a right CRC between two silences
_FIXED: Final = -8.0  # bits: one that needs no count is hardly made longer or shorter
_IMPOSSIBLE: Final = -10.0  # or send a request that is none
_HEADER: Final = 3  # bytes of an answer that a request tells: unit, function, byte count
BROKEN: Final = -12.0  # bits: few senders break such a rule


def broken_windows(
    data: bytes,
    crc: CrcWindows,
    at: int,
    edges: PossibleEdges,
    candidates: Sequence[Candidate],
    open_requests: Sequence[OpenRequest],
    may: frozenset[int],
) -> list[Candidate]:
    """Candidates in `data`, which begins at index `at` of the windows; `may` as `possible_starts` tells."""
    taken_starts = {c.start for c in candidates}
    found: dict[tuple[int, int, Role], Candidate] = {}
    for start in sorted(edges.begins - taken_starts):
        if start + MIN_ADU > len(data) or start not in may:
            continue
        head = crc.heads[at + start]
        for length, role, bits in _lengths(data, start, edges):
            end = start + length
            if MIN_ADU <= length <= _LONGEST and end <= len(data) and crc.tails[at + end] == head:
                found[start, end, role] = Candidate(start, end, role, bits, doubtful=True)
        for end in _right_ends(data, head, crc.tails[at:], start, edges):
            if holds_a_frame(candidates, start, end):
                continue
            for role in Role:
                declared = rule(data[start + 1], role)
                counted = declared is not None and declared.count is not None
                if counted and (role is Role.REQUEST or not _as_asked(data, start, candidates, open_requests)):
                    bits = KNOWN_BITS + BROKEN
                    found.setdefault((start, end, role), Candidate(start, end, role, bits, doubtful=True))
    return [c for c in found.values() if not GLITCHES.issuperset(data[c.start : c.end])]


def _right_ends(data: bytes, head: int, tails: NDArray[np.uint16], start: int, edges: PossibleEdges) -> list[int]:
    """Edges at which a window that begins at another edge checks, but for zeros behind one that does."""
    right = tails[start + MIN_ADU : min(start + _LONGEST, len(data)) + 1] == head
    ends = (right.nonzero()[0] + (start + MIN_ADU)).tolist()
    return [end for end in ends if end in edges.ends and (data[end - 1] or end - 1 not in ends)]


def _as_asked(data: bytes, start: int, candidates: Sequence[Candidate], open_requests: Sequence[OpenRequest]) -> bool:
    """Whether the header there is one that a request asked for: then what has another length was cut, or joined."""
    asked = [p.adu for p in open_requests]
    asked += [data[c.start : c.end] for c in candidates if c.role == Role.REQUEST and c.declared and c.end <= start]
    headers = (expectation(adu).header for adu in asked if adu[:2] == data[start : start + 2])
    return any(len(header) >= _HEADER and data.startswith(header, start) for header in headers)


def silent_windows(
    data: bytes, crc: CrcWindows, at: int, edges: PossibleEdges, candidates: Sequence[Candidate]
) -> list[Candidate]:
    """Candidates of declared functions that fill what lies between two silences, whatever their counts say."""
    windows = []
    taken_ones = {(c.start, c.end) for c in candidates}
    for start, end in pairwise(edges.silences):
        if not MIN_ADU <= end - start <= _LONGEST or crc.heads[at + start] != crc.tails[at + end]:
            continue
        function = data[start + 1]
        if (start, end) in taken_ones or holds_a_frame(candidates, start, end) or rule(function, Role.REQUEST) is None:
            continue
        likelier = miscounted_role(function)
        windows += [
            Candidate(start, end, role, _SILENT_BITS + (0.0 if role is likelier else _FIXED), doubtful=True)
            for role in Role
        ]
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
                yield request.base + OVERHEAD + octets, Role.REQUEST, KNOWN_BITS + BROKEN
    for role in Role:
        length = predicted_length(data, start, role)
        if length is not None and length > MAX_ADU:
            yield length, role, KNOWN_BITS + BROKEN


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
_AS_LONG: Final = 6.0  # a right CRC, and just as many bytes as were asked for


def _ends_near(ends: Sequence[int], start: int, length: int, *, sure: bool) -> Sequence[int]:
    """The edges at which an answer that should be so long may end; `sure`: its beginning tells that it is one."""
    least, most = (_LEAST, 2 * length + _MORE) if sure else (length, length)
    return ends[bisect_left(ends, start + least) : bisect_right(ends, start + most)]


def damaged_answers(
    data: bytes,
    crc: CrcWindows,
    at: int,
    edges: PossibleEdges,
    candidates: Sequence[Candidate],
    open_requests: Sequence[OpenRequest],
) -> list[Candidate]:
    """Candidates for damaged answers to the pending request or to requests in `data`, at index `at` of the windows.

    Among them whole ones that are as long as they should be, though their byte count says otherwise.
    """
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
                for end in _ends_near(ends, start, length, sure=len(header) >= _LEAST):
                    if not edges.parted(start, end):
                        bits = _bits(end - start, length)
                        if end - start == length and crc.heads[at + start + 1] == crc.tails[at + end]:
                            bits = CRC_BITS + KNOWN_BITS + BROKEN  # the check value is that of all but the unit
                        found[start, end] = Candidate(start, end, Role.RESPONSE, bits, damaged=True)
            end = start + (due or 0)
            if not due or (start, end) in found or end > len(data):
                continue
            if crc.heads[at + start] == crc.tails[at + end]:
                found[start, end] = Candidate(start, end, Role.RESPONSE, KNOWN_BITS + BROKEN + _AS_LONG, doubtful=True)
            elif end in edges.ends and not edges.parted(start, end):
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
            if end in edges.ends and not edges.parted(start, end) and not holds_a_frame(candidates, start, end):
                bits = _bits(end - start, length) + (0.0 if end == start + length else _NEARLY)
                found.append(Candidate(start, end, Role.REQUEST, bits, damaged=True))
    return found
