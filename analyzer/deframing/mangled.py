"""Frames that came damaged: the CRC is wrong, but the rest speaks for itself.

An answer whose header is the one that a request asked for: unit, function and byte count are 24 bits that chance does
not give, so such a stretch competes in the lattice with whatever a chance CRC inside it would make of it. A request
that stands alone between two silences and has the length that its header predicts, or nearly.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence, Set
from typing import Final

from dissectors.adu import MAX_ADU
from dissectors.answers import expectation
from dissectors.length_rules import Role

from .broken import BROKEN
from .candidates import CRC_BITS, GLITCHES, KNOWN_BITS, predicted_length
from .conversation import OpenRequest
from .crc_windows import CrcWindows
from .lattice import GLITCH_RUN
from .paths import Candidate, holds_a_frame
from .possible_edges import PossibleEdges

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
                most = start + (2 * length + _MORE if len(header) >= _LEAST else length)
                least = start + (_LEAST if len(header) >= _LEAST else length)
                for end in ends[bisect_left(ends, least) : bisect_right(ends, most)]:
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
