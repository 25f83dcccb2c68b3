"""truncated: it starts like a frame of N bytes and ends after M.

N is what the pending request asked for, what the header predicts, or the length of a frame that was seen before and
began so. One byte short is byte-missing's as well, which says more where a byte makes it right.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import log2

from dissectors.lengths import Role

from .case import MAX_ADU, Case
from .lengths import Length, answer_length, told
from .sent import BYTE, RECURS, opening
from .verdict import Verdict

_PRIOR = -1.0
_ONE_SHORT = -3.0  # and no byte makes it right: then more than its end is wrong
_LEAST = 2  # bytes, to be known by


def truncated(case: Case) -> Iterator[Verdict]:
    """The frame that these bytes begin."""
    data = case.data
    if len(data) < _LEAST:
        return
    found = [(bits, length) for bits, length in _beginnings(case) if len(data) < length.length <= MAX_ADU]
    if found:
        bits, length = max(found)
        bits += _PRIOR - log2(length.length) + (_ONE_SHORT if length.length == len(data) + 1 else 0.0)
        yield Verdict("truncated", bits, length=length.length, at_least=length.least)


def _beginnings(case: Case) -> Iterator[tuple[float, Length]]:
    """What these bytes may begin, with the bits for it."""
    data = case.data
    due = answer_length(case)
    if due is not None and case.header[: len(data)] == data[: len(case.header)]:
        yield BYTE * min(len(case.header), len(data)), due
    for role in Role:
        length = told(data, role)
        if length is not None:
            yield opening(data, role, case), length
    same = [frame for frame in case.known if frame.startswith(data) and len(frame) > len(data)]
    if same:
        longest = max(same, key=len)
        yield BYTE * len(data) + log2(len(same) / len(case.known)) + RECURS, Length(len(longest))
