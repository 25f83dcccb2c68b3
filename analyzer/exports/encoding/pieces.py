"""Pieces of text that were made once and are looked up by number, and lines set from them.

A line is a row of pieces. Each piece that was ever made has a place in one array, the store; tables give the places of
those that hang on a number, so that a sheet of thousands of lines is set, taken and joined without a step of Python a
piece. What is kept is bounded: a store that has grown too large is begun anew before the next sheet.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

Ints = NDArray[np.int64]
Places = NDArray[np.int32]
Make = Callable[[int], bytes | tuple[bytes, ...]]

_KEPT: Final = 48 << 20  # bytes of all pieces
_OVERHEAD: Final = 33 + 8  # of a bytes object, and of the reference to it
_DENSE: Final = 1 << 21  # numbers up to this have their place in an array, which grows as they come
_LEAST: Final = 1 << 8
_JOINED: Final = 4096  # pieces at once: what they make stays in the processor's cache
_UNKNOWN: Final = -1


class Store:
    """All pieces, and the tables of their places."""

    def __init__(self, kept: int = _KEPT) -> None:
        self._kept = kept
        self._tables: dict[Hashable, Table] = {}
        self._fixed: dict[bytes, int] = {}
        self._begin()

    def _begin(self) -> None:
        self._pieces = np.empty(_LEAST, object)
        self._count = 0
        self._size = 0

    def table(self, make: Make, name: Hashable = None) -> Table:
        """A table of pieces, made by number (0 or more) when they are first asked for; of one name there is one."""
        if name is None:
            name = len(self._tables)
        if name not in self._tables:
            self._tables[name] = Table(self, make)
        return self._tables[name]

    def fixed(self, piece: bytes) -> int:
        """The place of a piece that is always the same."""
        if piece not in self._fixed:
            self._fixed[piece] = self.add([piece])
        return self._fixed[piece]

    def add(self, pieces: list[bytes]) -> int:
        """Keep some pieces in neighbouring places; the first one's."""
        first = self._count
        self._count += len(pieces)
        if self._count > len(self._pieces):
            self._pieces = np.concatenate((self._pieces, np.empty(self._count, object)))
        self._pieces[first : self._count] = pieces
        self._size += sum(map(len, pieces)) + _OVERHEAD * len(pieces)
        return first

    def settle(self) -> None:
        """Between two sheets: forget all if it is too much."""
        if self._size > self._kept:
            self._begin()
            self._fixed.clear()
            for table in self._tables.values():
                table.forget()

    def taken(self, places: Ints, texts: list[bytes]) -> Iterator[bytes]:
        """The pieces at some places joined, in parts; -1 and down are the last, the last but one … of `texts`."""
        spare = len(self._pieces) - self._count
        if len(texts) > spare:
            self._pieces = np.concatenate((self._pieces, np.empty(len(texts), object)))
        if texts:
            self._pieces[-len(texts) :] = texts
        for first in range(0, len(places), _JOINED):
            yield b"".join(self._pieces.take(places[first : first + _JOINED]).tolist())
        if texts:
            self._pieces[-len(texts) :] = None


class Table:
    """The places of pieces by number; where several are made for a number, of the first one, and the others follow."""

    def __init__(self, store: Store, make: Make) -> None:
        self._store = store
        self._make = make
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._near: Places = np.empty(0, np.int32)
        self._far: dict[int, int] = {}

    def take(self, numbers: Ints) -> Places:
        """The places of the pieces of these numbers."""
        if not len(numbers):
            return np.empty(0, np.int32)
        largest = int(numbers.max())
        if largest >= _DENSE:
            return self._take_far(numbers)
        if largest >= len(self._near):
            wider = np.full(max(_LEAST, 1 << largest.bit_length()), _UNKNOWN, np.int32)
            wider[: len(self._near)] = self._near
            self._near = wider
        places: Places = self._near.take(numbers)
        if int(places.min()) == _UNKNOWN:
            unknown = np.unique(numbers[places == _UNKNOWN])
            self._near[unknown] = self._added(unknown.tolist())
            places = self._near.take(numbers)
        return places

    def _take_far(self, numbers: Ints) -> Places:
        distinct, where = np.unique(numbers, return_inverse=True)
        unknown = [number for number in distinct.tolist() if number not in self._far]
        self._far.update(zip(unknown, self._added(unknown).tolist(), strict=True))
        return np.array([self._far[number] for number in distinct.tolist()], np.int32).take(where)

    def _added(self, numbers: list[int]) -> Ints:
        """The first places of the pieces of these numbers."""
        made = [one if isinstance(one, tuple) else (one,) for one in map(self._make, numbers)]
        first = self._store.add([piece for pieces in made for piece in pieces])
        return first + (len(made[0]) if made else 0) * np.arange(len(made))


class Sheet:
    """Lines to be set: `sizes` is how many pieces each has."""

    def __init__(self, store: Store, sizes: Ints) -> None:
        self.store = store
        self.ends: Ints = np.cumsum(sizes)
        self._begins = self.ends - sizes
        self._texts: list[bytes] = []
        self.places: Ints = np.empty(int(self.ends[-1]) if len(sizes) else 0, np.int64)

    def at(self, lines: Ints, piece: int = 0) -> Cursor:
        """A cursor on piece number `piece` of some lines; negative ones count from the end."""
        return Cursor(self, (self.ends if piece < 0 else self._begins)[lines] + piece)

    def texts(self, texts: list[bytes]) -> Ints:
        """The places of pieces that are for this sheet only."""
        before = len(self._texts)
        self._texts += texts
        return np.arange(-1 - before, -1 - len(self._texts), -1)

    def parts(self) -> Iterator[bytes]:
        """The text of all lines, in parts."""
        return self.store.taken(self.places, self._texts[::-1])


class Cursor:
    """Where on a sheet the next piece of each of some lines goes."""

    def __init__(self, sheet: Sheet, at: Ints) -> None:
        self.sheet = sheet
        self._at = at

    def put(self, pieces: Ints | Places | bytes) -> None:
        """A piece a line, by their places, or the same for all."""
        self.sheet.places[self._at] = self.sheet.store.fixed(pieces) if isinstance(pieces, bytes) else pieces
        self._at += 1

    def put_texts(self, texts: list[bytes]) -> None:
        """A piece a line, for this sheet only."""
        self.put(self.sheet.texts(texts))

    def spread(self, counts: Ints, *columns: Places) -> None:
        """Several pieces a line, `counts` times as many as there are columns: the first of each, the second of each."""
        width = len(columns)
        at = np.repeat(self._at - width * (np.cumsum(counts) - counts), counts)
        at += width * np.arange(len(at))
        for column in columns:
            self.sheet.places[at] = column
            at += 1
        self._at += width * counts


def within(counts: Ints) -> Ints:
    """0, 1, 2 … of each of some counts, end to end."""
    ends = np.cumsum(counts)
    found: Ints = np.arange(int(ends[-1]) if len(ends) else 0)
    found -= np.repeat(ends - counts, counts)
    return found
