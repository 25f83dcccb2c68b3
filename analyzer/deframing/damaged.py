"""Frames that came damaged: the CRC is wrong, but the rest speaks for itself.

An answer whose header is the one that a request asked for: unit, function and byte count are 24 bits that chance does
not give, so such a stretch competes in the lattice with whatever a chance CRC inside it would make of it. A request
that stands alone between two silences and has the length that its header predicts, or nearly. Both end where something
else begins.
"""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import Final

from dissectors.answers import expectation
from dissectors.lengths import Role

from .candidates import GLITCHES, predicted
from .lattice import GLITCH_RUN, Candidate, Pending
from .places import Places
from .rules import MAX_ADU

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


def damaged_answers(
    data: bytes, places: Places, candidates: Sequence[Candidate], pending: Sequence[Pending]
) -> list[Candidate]:
    """Candidates for damaged answers to the pending request or to requests in `data`."""
    taken = {c.start for c in candidates if c.role == Role.RESPONSE}
    asked = [(0, p.adu) for p in pending[-1:]]
    asked += [
        (c.end, data[c.start : c.end]) for c in candidates if c.role == Role.REQUEST and c.declared and data[c.start]
    ]
    found: dict[tuple[int, int], Candidate] = {}
    for begin, request in asked:
        starts = _starts(data, begin, request[:2], taken)
        if not starts:
            continue
        header = expectation(request).header
        due = predicted(header, 0, Role.RESPONSE) if len(header) >= _LEAST else None
        for start in starts:
            if data.startswith(header, start):
                length = predicted(data, start, Role.RESPONSE) or MAX_ADU
                for end in places.ends:
                    most = start + (2 * length + _MORE if len(header) >= _LEAST else length)
                    least = start + (_LEAST if len(header) >= _LEAST else length)
                    if least <= end <= most and not places.parted(start, end):
                        found[start, end] = Candidate(
                            start, end, Role.RESPONSE, _bits(end - start, length), damaged=True
                        )
            end = start + (due or 0)
            if due and (start, end) not in found and end in places.ends and not places.parted(start, end):
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


def _bits(length: int, predicted: int) -> float:
    """What the length of a damaged answer says."""
    bits = _DAMAGED + _BYTE * length
    if length != predicted:
        more = max(0, length - predicted)
        bits += _LENGTH + _LONGER * min(more, _SPARE) + _MUCH_LONGER * max(0, more - _SPARE)
    return bits


def damaged_requests(data: bytes, places: Places, candidates: Sequence[Candidate]) -> list[Candidate]:
    """Candidates for damaged requests in `data`."""
    taken = {c.start for c in candidates}
    found = []
    for start in sorted(places.begins - taken):
        length = predicted(data, start, Role.REQUEST) if start + _LEAST < len(data) else None
        if length is None:
            continue
        for end in (start + length, start + length - 1, start + length + 1):
            if end in places.ends and not places.parted(start, end):
                bits = _bits(end - start, length) + (0.0 if end == start + length else _NEARLY)
                found.append(Candidate(start, end, Role.REQUEST, bits, damaged=True))
    return found
