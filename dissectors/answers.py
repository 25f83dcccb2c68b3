"""Does this response answer that request? The relations of the declarations, for one pair.

A serial answer carries no address: all that ties it to its request is unit, function, the byte count that the quantity
asked for, and whatever the function echoes. Frames are given here as unit and PDU; what follows (a CRC) does no harm.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

from .adu import EXCEPTION
from .lengths import relations
from .limits import RequestedByteCount, taken
from .registry import revision


@dataclass(frozen=True, slots=True)
class Expectation:
    """What the answer to one request must look like."""

    unit: int
    function: int
    marks: tuple[tuple[int, bytes], ...]  # (offset, the unit's being 0, and the bytes that must stand there)

    def fits(self, response: bytes) -> bool:
        """Whether a response (the whole one, or its beginning) answers the request; an exception always may."""
        if len(response) < 2 or response[0] != self.unit:
            return False
        if response[1] == self.function | EXCEPTION:
            return True
        if response[1] != self.function:
            return False
        for at, mark in self.marks:  # noqa: SIM110 - the lattice asks this for every path
            if response[at : at + len(mark)] != mark:
                return False
        return True

    @property
    def header(self) -> bytes:
        """The first bytes that such an answer (no exception) must have."""
        head = bytes((self.unit, self.function))
        for at, mark in self.marks:
            if at != len(head):
                break
            head += mark
        return head


def expectation(request: bytes) -> Expectation:
    """The expectation that a request raises."""
    return _expectation(request, revision())


@lru_cache(maxsize=4096)
def _expectation(request: bytes, _revision: int) -> Expectation:
    marks = []
    for relation in relations(request[1]):
        if isinstance(relation, RequestedByteCount):
            at = relation.quantity_offset + 1
            count = taken(int.from_bytes(request[at : at + 2], "big"), relation.bits) & 0xFF
            marks.append((relation.count_offset + 1, bytes([count])))
        else:
            at = relation.request_offset + 1
            marks.append((relation.response_offset + 1, request[at : at + relation.width]))
    return Expectation(request[0], request[1], tuple(sorted(marks)))
