"""Pieces of text that were made once and are looked up by number.

The bytes of all pieces ever made stand in one array, the store. A piece is a number: where it begins there and how many
bytes it has. Tables give the pieces that hang on a number; so thousands of lines are set and copied (`sheet`) without
a step of Python a piece. What is kept is bounded: a store that has grown too large is begun anew before the next sheet.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Final

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Pieces = NDArray[np.int64]  # as `pieces` makes them
Make = Callable[[int], bytes]
MakeAll = Callable[[list[int]], list[bytes]]

REACH: Final = 128

_KEPT: Final = 16 << 20  # bytes of all pieces
_DENSE: Final = 1 << 21  # numbers up to this have their piece in an array, which grows as they come
_LEAST: Final = 1 << 8
_SIZE_BITS: Final = 24
_UNKNOWN: Final = 0  # no piece: the store's first byte is not used


def pieces(begins: Ints, sizes: Ints) -> Pieces:
    """Pieces from where they begin and how many bytes they have."""
    return begins << _SIZE_BITS | sizes


def begins_of(pieces: Pieces) -> Ints:
    """Where pieces begin."""
    return pieces >> _SIZE_BITS


def sizes_of(pieces: Pieces) -> Ints:
    """How many bytes they have."""
    return pieces & ((1 << _SIZE_BITS) - 1)


class Store:
    """The bytes of all pieces, and the tables of them."""

    def __init__(self, kept: int = _KEPT) -> None:
        self._kept = kept
        self._tables: dict[Hashable, Table] = {}
        self._fixed: dict[bytes, int] = {}
        self._bytes: Bytes = np.empty(1 << 16, np.uint8)
        self._used = 1

    def table(self, make: Make, name: Hashable = None) -> Table:
        """A table of pieces, made by number (0 or more) when they are first asked for; of one name there is one."""
        return self.table_of_many(lambda numbers: list(map(make, numbers)), name)

    def table_of_many(self, make: MakeAll, name: Hashable = None) -> Table:
        """The same, of pieces that are made faster many at once."""
        if name is None:
            name = len(self._tables)
        if name not in self._tables:
            self._tables[name] = Table(self, make)
        return self._tables[name]

    def fixed(self, text: bytes) -> int:
        """The piece of a text that is always the same."""
        if text not in self._fixed:
            self._fixed[text] = int(self.add([text])[0])
        return self._fixed[text]

    def add(self, texts: list[bytes]) -> Pieces:
        """Keep some texts."""
        sizes = sizes_in(texts)
        begins = self._used + np.cumsum(sizes) - sizes
        text = b"".join(texts)
        self._reserve(len(text))
        self._bytes[self._used : self._used + len(text)] = np.frombuffer(text, np.uint8)
        self._used += len(text)
        return pieces(begins, sizes)

    def settle(self) -> None:
        """Between two sheets: forget all if it is too much."""
        if self._used > self._kept:
            self._used = 1
            self._fixed.clear()
            for table in self._tables.values():
                table.forget()

    def with_lent(self, lent: list[Bytes]) -> Bytes:
        """The store, and at its end what is lent to it until the next sheet, the first last; `REACH` bytes follow."""
        self._reserve(sum(map(len, lent)))
        end = len(self._bytes) - REACH + 1
        for text in lent:
            self._bytes[end - len(text) : end] = text
            end -= len(text)
        return self._bytes

    def _reserve(self, size: int) -> None:
        """Room for some more bytes."""
        needed = self._used + size + REACH
        if needed > len(self._bytes):
            wider: Bytes = np.empty(needed + needed // 2, np.uint8)
            wider[: self._used] = self._bytes[: self._used]
            self._bytes = wider


class Table:
    """Pieces by number."""

    def __init__(self, store: Store, make: MakeAll) -> None:
        self._store = store
        self._make = make
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._near: Pieces = np.empty(0, np.int64)
        self._far: dict[int, int] = {}

    def take(self, numbers: Ints) -> Pieces:
        """The pieces of these numbers."""
        if not len(numbers):
            return np.empty(0, np.int64)
        largest = int(numbers.max())
        if largest >= _DENSE:
            return self._take_far(numbers)
        if largest >= len(self._near):
            wider = np.zeros(max(_LEAST, 1 << largest.bit_length()), np.int64)
            wider[: len(self._near)] = self._near
            self._near = wider
        found: Pieces = self._near.take(numbers)
        if not found.all():
            unknown = self._once(numbers[found == _UNKNOWN])
            self._near[unknown] = self._added(unknown.tolist())
            found = self._near.take(numbers)
        return found

    def _once(self, unknown: Ints) -> Ints:
        """Each of these numbers once: where one stands several times, its place keeps what was written there last."""
        marks = np.arange(len(unknown))
        self._near[unknown] = marks
        once: Ints = unknown[self._near.take(unknown) == marks]
        return once

    def _take_far(self, numbers: Ints) -> Pieces:
        distinct, where = np.unique(numbers, return_inverse=True)
        unknown = [number for number in distinct.tolist() if number not in self._far]
        self._far.update(zip(unknown, self._added(unknown).tolist(), strict=True))
        return np.array([self._far[number] for number in distinct.tolist()], np.int64).take(where)

    def _added(self, numbers: list[int]) -> Pieces:
        """The pieces of these numbers, made now."""
        return self._store.add(self._make(numbers))


def sizes_in(texts: list[bytes]) -> Ints:
    """The length of each text."""
    return np.fromiter(map(len, texts), np.int64, len(texts))


def without(pieces: Pieces, head: int) -> Pieces:
    """The same pieces without so many of their first bytes."""
    return pieces + ((head << _SIZE_BITS) - head)
