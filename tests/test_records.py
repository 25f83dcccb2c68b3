"""Moving rows as opaque bytes gives what numpy gives field by field."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from analyzer.tables.schema import join_rows, take_rows

PAIR = np.dtype([("a", np.int64), ("b", np.uint8), ("c", np.float64, (2,))])


def rows(count: int) -> np.ndarray:
    made = np.zeros(count, PAIR)
    made["a"], made["b"], made["c"] = np.arange(count), np.arange(count) % 7, np.arange(count)[:, None] / 3
    return made


@given(st.lists(st.integers(0, 9), min_size=1, max_size=5))
def test_joined_rows_are_those_of_concatenate(counts: list[int]) -> None:
    parts = [rows(20)[::2][:count] if count % 2 else rows(count) for count in counts]
    assert repr(join_rows(parts).tolist()) == repr(np.concatenate(parts).tolist())
    assert join_rows(parts).dtype == PAIR


@given(st.lists(st.booleans(), max_size=30))
def test_picked_rows_are_those_of_an_index(mask: list[bool]) -> None:
    some = rows(len(mask))
    which = np.array(mask, np.bool_)
    for places in (which, np.flatnonzero(which), np.flatnonzero(which)[::-1]):
        taken = take_rows(some, places)
        assert repr(taken.tolist()) == repr(some[places].tolist())
        taken["a"] = -1
        assert (some["a"] >= 0).all()
