"""Does this response answer that request? The relations of the declarations, for one pair and for arrays of pairs.

An RTU answer carries no address: all that ties it to its request is unit, function, the byte count that the quantity
asked for, and whatever the function echoes. `dissectors.lengths.relations` states that for each function.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Asked, Echo, relations

from .rules import Bytes, Index, Mask, asked_bytes, field

_EXCEPTION = 0x80


@dataclass(frozen=True, slots=True)
class Expectation:
    """What the answer to one request must look like."""

    unit: int
    function: int
    marks: tuple[tuple[int, bytes], ...]  # (offset in the ADU, the bytes that must stand there)

    def fits(self, adu: bytes) -> bool:
        """Whether a response (the whole ADU, or its beginning) answers the request; an exception always may."""
        if len(adu) < 2 or adu[0] != self.unit:
            return False
        if adu[1] == self.function | _EXCEPTION:
            return True
        return adu[1] == self.function and all(adu[at : at + len(mark)] == mark for at, mark in self.marks)

    @property
    def header(self) -> bytes:
        """The first bytes that such an answer (no exception) must have."""
        head = bytes((self.unit, self.function))
        for at, mark in self.marks:
            if at != len(head):
                break
            head += mark
        return head


@lru_cache(maxsize=4096)
def expectation(request: bytes) -> Expectation:
    """The expectation that a request (ADU) raises."""
    function = request[1]
    marks = []
    for relation in relations(function):
        if isinstance(relation, Asked):
            quantity = int.from_bytes(request[relation.quantity_offset + 1 : relation.quantity_offset + 3], "big")
            count = (quantity + 7) // 8 if relation.bits else quantity * 2
            marks.append((relation.count_offset + 1, bytes([count & 0xFF])))
        else:
            at = relation.request_offset + 1
            marks.append((relation.response_offset + 1, request[at : at + relation.width]))
    return Expectation(request[0], function, tuple(sorted(marks)))


def fitting(data: Bytes, requests: Index, responses: Index) -> Mask:
    """For pairs of ADU starts: whether the response answers the request. Shape: that of the two arrays."""
    function = data.take(requests + 1)
    answer = data.take(responses + 1)
    fits: NDArray[np.bool_] = (data.take(requests) == data.take(responses)) & ((answer & 0x7F) == function)
    plain = fits & (answer == function)
    for code in np.flatnonzero(np.bincount(function[plain], minlength=256)).tolist():
        which = np.flatnonzero(plain & (function == code))
        request, response = requests[which], responses[which]
        agree = np.ones(len(which), np.bool_)
        for relation in relations(code):
            if isinstance(relation, Asked):
                quantity = field(data, request + relation.quantity_offset + 1, 2)
                count = field(data, response + relation.count_offset + 1, 1)
                agree &= count == (asked_bytes(quantity, relation.bits) & 0xFF)
            else:
                agree &= _echoed(data, request, response, relation)
        fits[which] = agree
    return fits


def _echoed(data: Bytes, request: Index, response: Index, echo: Echo) -> Mask:
    same = np.ones(len(request), np.bool_)
    for i in range(echo.width):
        same &= data.take(request + (echo.request_offset + 1 + i)) == data.take(
            response + (echo.response_offset + 1 + i)
        )
    return same
