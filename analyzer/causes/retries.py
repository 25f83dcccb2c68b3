"""Requests asked again that read like answers: where the answer is the request once more, and came damaged.

A client that gets such an answer damaged repeats its request, and that repetition is just what the answer should have
been. It is told by what stands around it: a damaged answer before it, and another one, or a good one, behind.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Kind
from ..tables.transactions import ECHOED
from .exchanges import RowColumns

_LEAST: Final = 4  # bytes of a damaged answer: fewer may be noise,
_LEAST_ALIKE: Final = 2  # but not twice the same
_NOISE, _REQUEST, _RESPONSE = int(Kind.NOISE), int(Kind.REQUEST), int(Kind.RESPONSE)


def as_asked_again(table: RowColumns) -> RowColumns:
    """The same rows, with repetitions that were taken for answers as the requests that they are."""
    rows = table.rows
    good = rows.check & (rows.kind != _NOISE)
    may = good & (rows.kind == _RESPONSE) & ECHOED[rows.function] & (rows.exception == 0)
    may &= ~np.concatenate(([True], good[:-1]))
    if not may.any():
        return table
    rows = rows.copy()
    for i in may.nonzero()[0].tolist():
        before, behind = _next_good(good, i, -1), _next_good(good, i, 1)
        data = table.bytes_of(i)
        if before < 0 or rows.kind[before] != _REQUEST or table.bytes_of(before) != data:
            continue
        answered = behind == i + 1 < len(rows) and table.bytes_of(behind) == data
        one, two = _between(table, before, i), _between(table, i, behind)
        alike = len(one) >= _LEAST_ALIKE and one == two
        if not alike and (len(one) < _LEAST or (not answered and len(two) < _LEAST)):
            continue
        rows.kind[i], rows.request[i], rows.response_ns[i] = _REQUEST, -1, -1
        if answered:
            rows.kind[behind], rows.request[behind] = _RESPONSE, rows.index[i]
            rows.response_ns[behind] = max(rows.t_start_ns[behind] - rows.t_end_ns[i], 0)
    return RowColumns(rows, table.data)


def _next_good(good: NDArray[np.bool_], i: int, step: int) -> int:
    """The next row to that side that is a right frame, or the end."""
    i += step
    while 0 <= i < len(good) and not good[i]:
        i += step
    return i


def _between(table: RowColumns, first: int, last: int) -> bytes:
    """What stands between two rows; of much no more than the beginning."""
    return b"".join(table.bytes_of(row) for row in range(first + 1, min(last, first + 1 + _LEAST)))
