"""Pieces of any length moved about in byte arrays, without a Python object a piece.

A piece of n bytes is an item of the type `V<n>`, and all stretches of n bytes of an array are items in its own memory:
so numpy copies pieces of one length in one go, and lengths are few.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]
_WIDE: Final = 1 << 16
_STEP: Final = 16  # bytes that `copy_spilling` copies at a time, at least


def windows(data: Bytes, width: int) -> NDArray[np.void]:
    """All stretches of this many bytes, each as one item, in the same memory."""
    return np.ndarray((len(data) - width + 1,), f"V{width}", data, 0, (1,))


def scatter(out: Bytes, at: Ints, items: NDArray[np.void]) -> None:
    """Each item's bytes to its place in `out`."""
    if len(items):
        width = items.dtype.itemsize
        windows(out, width)[at] = np.ascontiguousarray(items).view(f"V{width}")


def copy_pieces(out: Bytes, at: Ints, data: Bytes, begins: Ints, sizes: Ints) -> None:
    """Pieces of `data` to their places in `out`, all those of one size at once."""
    if not len(sizes):
        return
    keys = sizes.astype(np.uint16) if sizes.max() < _WIDE else sizes  # short keys sort in linear time
    order = np.argsort(keys, kind="stable")
    at, begins, ordered = at[order], begins[order], sizes[order]
    cuts = np.flatnonzero(np.diff(ordered, prepend=-1, append=-1)).tolist()
    for first, last in pairwise(cuts):
        width = int(ordered[first])
        if width:
            windows(out, width)[at[first:last]] = windows(data, width)[begins[first:last]]


def copy_spilling(out: Bytes, at: Ints, data: Bytes, begins: Ints, sizes: Ints) -> None:
    """The same with fewer widths: up to 15 bytes behind a piece's place in `out` may be overwritten too.

    So between two places there must be 15 bytes or more, to be written later.
    """
    steps = np.minimum(-(-sizes // _STEP), _WIDE // _STEP).astype(np.uint16)
    room = np.minimum(len(out) - at, len(data) - begins) // _STEP
    steps[(room < steps) | (sizes >= _WIDE)] = 0
    for count in np.flatnonzero(np.bincount(steps)).tolist():
        selected = np.flatnonzero(steps == count)
        if count:
            width = count * _STEP
            windows(out, width)[at[selected]] = windows(data, width)[begins[selected]]
        else:
            copy_pieces(out, at[selected], data, begins[selected], sizes[selected])


def sums(counts: Ints) -> Ints:
    """What comes before each of these, and all of it at the end."""
    ends = np.zeros(len(counts) + 1, np.int64)
    np.cumsum(counts, out=ends[1:])
    return ends


def counted_on(counts: Ints) -> Ints:
    """0, 1, 2 … of each of some counts, end to end."""
    ends = np.cumsum(counts)
    indices: Ints = np.arange(int(ends[-1]) if len(ends) else 0)
    indices -= np.repeat(ends - counts, counts)
    return indices
