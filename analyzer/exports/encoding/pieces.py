"""Pieces of text that were made once and are looked up by number; what is kept of them is bounded.

A `Line`s' text is a row of such pieces. Tables are arrays of objects, so that the pieces of thousands of lines are
taken, put in their places and joined without a step of Python a piece.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

from dissectors.fields import Field

Ints = NDArray[np.int64]
Objects = NDArray[np.object_]

_KEPT: Final = 48 << 20  # bytes of all pieces
_OVERHEAD: Final = 33 + 8  # of a bytes object, and of the reference to it
_DENSE: Final = 1 << 21  # numbers up to this are places in an array, which grows as they come
_LEAST: Final = 1 << 8


class Store:
    """All tables of one export, forgotten together when they have grown too large."""

    def __init__(self, kept: int = _KEPT) -> None:
        self._tables: list[Pieces] = []
        self._kept = kept
        self._size = 0

    def table(self, make: Callable[[int], bytes]) -> Pieces:
        """A table of pieces, made by number (0 or more) when they are first asked for."""
        self._tables.append(Pieces(self, make))
        return self._tables[-1]

    def grown(self, size: int) -> None:
        """So many bytes more are kept."""
        self._size += size
        if self._size > self._kept:
            self._size = 0
            for table in self._tables:
                table.forget()


class Pieces:
    """A table of pieces by number."""

    def __init__(self, store: Store, make: Callable[[int], bytes]) -> None:
        self._store = store
        self._make = make
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._made: Objects = np.empty(0, object)
        self._known = np.zeros(0, np.bool_)
        self._far: dict[int, bytes] = {}

    def take(self, numbers: Ints) -> Objects:
        """The pieces of these numbers."""
        if not len(numbers):
            return np.empty(0, object)
        largest = int(numbers.max())
        if largest >= _DENSE:
            return self._take_far(numbers)
        if largest >= len(self._known):
            self._widen(max(_LEAST, 1 << largest.bit_length()))
        known = self._known.take(numbers)
        grown = 0
        if not known.all():
            for number in np.unique(numbers[~known]).tolist():
                self._made[number] = piece = self._make(number)
                self._known[number] = True
                grown += len(piece) + _OVERHEAD
        found: Objects = self._made.take(numbers)
        self._store.grown(grown)
        return found

    def _widen(self, size: int) -> None:
        made, known = np.empty(size, object), np.zeros(size, np.bool_)
        made[: len(self._made)], known[: len(self._known)] = self._made, self._known
        self._made, self._known = made, known

    def _take_far(self, numbers: Ints) -> Objects:
        distinct, places = np.unique(numbers, return_inverse=True)
        pieces = np.empty(len(distinct), object)
        grown = 0
        for i, number in enumerate(distinct.tolist()):
            if (piece := self._far.get(number)) is None:
                self._far[number] = piece = self._make(number)
                grown += len(piece) + _OVERHEAD
            pieces[i] = piece
        self._store.grown(grown)
        return pieces.take(places)


class Cursor:
    """Where the next piece of each of some lines goes, in the array that has the pieces of all."""

    def __init__(self, sheet: Objects, at: Ints) -> None:
        self.sheet = sheet
        self.at = at

    def of(self, lines: Ints | NDArray[np.bool_]) -> Cursor:
        """A cursor over some of the lines."""
        return Cursor(self.sheet, self.at[lines])

    def put(self, pieces: Objects | bytes | list[bytes]) -> None:
        """A piece a line, or the same for all."""
        self.sheet[self.at] = pieces
        self.at += 1

    def spread(self, counts: Ints, *columns: Objects) -> None:
        """Several pieces a line, `counts` times as many as there are columns: the first of each, the second of each."""
        width = len(columns)
        at = np.repeat(self.at - width * (np.cumsum(counts) - counts), counts)
        at += width * np.arange(len(at))
        for column in columns:
            self.sheet[at] = column
            at += 1
        self.at += width * counts


def within(counts: Ints) -> Ints:
    """0, 1, 2 … of each of some counts, end to end."""
    ends = np.cumsum(counts)
    found: Ints = np.arange(int(ends[-1]) if len(ends) else 0)
    found -= np.repeat(ends - counts, counts)
    return found


def encoded(value: Any) -> bytes:
    """A value as JSON."""
    return orjson.dumps(value)


def inside(text: str) -> bytes:
    """What stands between the quotes of a text in JSON."""
    return orjson.dumps(text)[1:-1]


def parted(field: Field) -> tuple[bytes, bytes, bytes, bytes]:
    """A field's JSON in four: up to its value, up to its text, its text, the rest."""
    whole = orjson.dumps(field.to_json())
    value = whole.index(b'"value":') + len(b'"value":')
    text = whole.index(b'"text":"', value) + len(b'"text":"')
    end = text + len(inside(field.text))
    return whole[:value], whole[value:text], whole[text:end], whole[end:]
