"""Frames made wrong: the CRC is right, and a rule is broken that the search for frames takes for granted.

A byte count that contradicts the quantity beside it or the bytes that are there, more than 256 bytes, a function code
that no request can have. They are rare and their windows few: such a frame begins at a possible edge; where nothing in
it tells its length it ends at one, too. What fills all that lies between two silences which this tap has earned trust
for is a frame whatever its counts say.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.adu import EXCEPTION, MAX_ADU, MIN_ADU, OVERHEAD
from dissectors.answers import expectation
from dissectors.length_rules import Role
from dissectors.lengths import miscounted_role, rule
from dissectors.limits import Sized, taken

from .candidates import GLITCHES, KNOWN_BITS, predicted_length
from .conversation import OpenRequest
from .crc_windows import CrcWindows
from .paths import Candidate, holds_a_frame
from .possible_edges import PossibleEdges

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
