"""Lines set from pieces, thousands at once, and copied into one text.

Every piece is copied with the `REACH` bytes from its beginning on, in the order of the text: what was too much of one
is written over by the next. So numpy moves pieces of any size in one go; longer ones get their rest behind that.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from captures.ragged import windows

from .pieces import REACH, Bytes, Ints, Pieces, Store, begins_of, decimals, pieces, sizes_in, sizes_of

_COPIED: Final = 4096  # pieces at once: what they make stays in the processor's cache


class Sheet:
    """Lines to be set: `counts` is how many pieces each has."""

    def __init__(self, store: Store, counts: Ints) -> None:
        self.store = store
        self._ends: Ints = np.cumsum(counts)
        self._begins = self._ends - counts
        self._lent: list[Bytes] = []
        self._lent_size = 0
        self.pieces: Pieces = np.empty(int(self._ends[-1]) if len(counts) else 0, np.int64)

    def at(self, lines: Ints, piece: int = 0) -> Cursor:
        """A cursor on piece number `piece` of some lines."""
        return Cursor(self, self._begins[lines] + piece)

    def before_end(self, lines: Ints, pieces: Ints | int) -> Cursor:
        """A cursor on the last pieces of some lines, so many of each."""
        return Cursor(self, self._ends[lines] - pieces)

    def lend(self, text: bytes | Bytes) -> int:
        """Where a text begins (counted from the store's end) that is for this sheet only."""
        lent = np.frombuffer(text, np.uint8)
        self._lent.append(lent)
        self._lent_size += len(lent)
        return -self._lent_size

    def texts(self, texts: list[bytes]) -> Pieces:
        """Pieces that are for this sheet only."""
        sizes = sizes_in(texts)
        return pieces(self.lend(b"".join(texts)) + np.cumsum(sizes) - sizes, sizes)

    def numbers(self, numbers: Ints) -> Pieces:
        """Numbers in decimal."""
        text, begins, sizes = decimals(numbers)
        return pieces(self.lend(text) + begins, sizes)

    def parts(self) -> Iterator[memoryview]:
        """The text of all lines, in parts; take them before another sheet is begun."""
        source = windows(self.store.with_lent(self._lent), REACH)
        for first in range(0, len(self.pieces), _COPIED):
            segment = self.pieces[first : first + _COPIED]
            begins, sizes = begins_of(segment), sizes_of(segment)
            at = np.cumsum(sizes)
            size = int(at[-1])
            at -= sizes
            page: Bytes = np.empty(size + REACH, np.uint8)
            target = windows(page, REACH)
            target[at] = source[begins]
            copied = REACH
            while len(longer := np.flatnonzero(sizes > copied)):
                begins, sizes, at = begins[longer], sizes[longer], at[longer]
                rest = np.minimum(copied, sizes - REACH)  # the last stretch ends where the piece does
                target[at + rest] = source[begins + rest]
                copied += REACH
            yield page[:size].data


class Cursor:
    """Where on a sheet the next piece of each of some lines goes."""

    def __init__(self, sheet: Sheet, at: Ints) -> None:
        self.sheet = sheet
        self._at = at

    def put(self, piece: Pieces | bytes) -> None:
        """A piece a line, or the same text for all."""
        self.sheet.pieces[self._at] = self.sheet.store.fixed(piece) if isinstance(piece, bytes) else piece
        self._at += 1

    def put_texts(self, texts: list[bytes]) -> None:
        """A piece a line, for this sheet only."""
        self.put(self.sheet.texts(texts))

    def put_numbers(self, numbers: Ints) -> None:
        """A number a line."""
        self.put(self.sheet.numbers(numbers))

    def put_known(self, numbers: Ints, otherwise: bytes) -> None:
        """A number a line, or another text where it is negative."""
        texts = np.full(len(numbers), self.sheet.store.fixed(otherwise), np.int64)
        valid = numbers >= 0
        texts[valid] = self.sheet.numbers(numbers[valid])
        self.put(texts)

    def spread(self, counts: Ints, *columns: Pieces) -> None:
        """Several pieces a line, `counts` times as many as there are columns: the first of each, the second of each."""
        width = len(columns)
        at = np.repeat(self._at - width * (np.cumsum(counts) - counts), counts)
        at += width * np.arange(len(at))
        for column in columns:
            self.sheet.pieces[at] = column
            at += 1
        self._at += width * counts


def within(counts: Ints) -> Ints:
    """0, 1, 2 … of each of some counts, end to end."""
    ends = np.cumsum(counts)
    indices: Ints = np.arange(int(ends[-1]) if len(ends) else 0)
    indices -= np.repeat(ends - counts, counts)
    return indices
