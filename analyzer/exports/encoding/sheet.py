"""Pieces of text that were made once and are looked up by number, and lines set from them, thousands at once.

The bytes of all pieces ever made stand in one array, the store. A piece is a number: where it begins there and how
many bytes it has. Tables give the pieces that hang on a number; so thousands of lines are set and copied without a
step of Python a piece. What is kept is bounded: a store that has grown too large is begun anew before the next sheet.

Every piece is copied with the `REACH` bytes from its beginning on, in the order of the text: what was too much of one
is written over by the next. So numpy moves pieces of any size in one go; longer ones get their rest behind that.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, Final

import numpy as np
import orjson
from numpy.typing import NDArray

from captures.ragged import windows
from dissectors.fields import Field

Ints = NDArray[np.int64]
Bytes = NDArray[np.uint8]
Pieces = NDArray[np.int64]  # as the tables below give them
Make = Callable[[int], bytes]
MakeAll = Callable[[list[int]], list[bytes]]

REACH: Final = 128

_MOST_BYTES: Final = 16 << 20  # bytes of all pieces
_DENSE: Final = 1 << 21  # numbers up to this have their piece in an array, which grows as they come
_LEAST: Final = 1 << 8
_SIZE_BITS: Final = 24
_UNKNOWN: Final = 0  # no piece: the store's first byte is not used


def pieces(begins: Ints, sizes: Ints) -> Pieces:
    """Pieces from where they begin and how many bytes they have."""
    return np.asarray(begins, np.int64) << _SIZE_BITS | sizes


def begins_of(pieces: Pieces) -> Ints:
    """Where pieces begin."""
    return pieces >> _SIZE_BITS


def sizes_of(pieces: Pieces) -> Ints:
    """How many bytes they have."""
    return pieces & ((1 << _SIZE_BITS) - 1)


class Store:
    """The bytes of all pieces, and the tables of them."""

    def __init__(self, kept: int = _MOST_BYTES) -> None:
        self._most_bytes = kept
        self._tables: dict[Hashable, TextTable] = {}
        self._keyed: list[KeyedTable] = []
        self._fixed: dict[bytes, int] = {}
        self._bytes: Bytes = np.empty(1 << 16, np.uint8)
        self._used = 1

    def table(self, make: Make, name: Hashable = None) -> TextTable:
        """A table of pieces, made by number (0 or more) when they are first asked for; of one name there is one."""
        return self.table_of_many(lambda numbers: list(map(make, numbers)), name)

    def table_of_many(self, make: MakeAll, name: Hashable = None) -> TextTable:
        """The same, of pieces that are made faster many at once."""
        if name is None:
            name = len(self._tables)
        if name not in self._tables:
            self._tables[name] = TextTable(self, make)
        return self._tables[name]

    def table_by_key(self, make: Callable[[Any], bytes]) -> KeyedTable:
        """A table of pieces that hang on something else than a number."""
        self._keyed.append(KeyedTable(self, make))
        return self._keyed[-1]

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
        if self._used > self._most_bytes:
            self._used = 1
            self._fixed.clear()
            for table in self._tables.values():
                table.forget()
            for keyed in self._keyed:
                keyed.forget()

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


class TextTable:
    """Pieces by number."""

    def __init__(self, store: Store, make: MakeAll) -> None:
        self._store = store
        self._make = make
        self.forget()

    def forget(self) -> None:
        """Begin anew."""
        self._near: Pieces = np.empty(0, np.int64)
        self._far: dict[int, int] = {}

    def take_pieces(self, numbers: Ints) -> Pieces:
        """The pieces of these numbers."""
        if not len(numbers):
            return np.empty(0, np.int64)
        largest = int(numbers.max())
        if largest >= _DENSE:
            return self._far_texts(numbers)
        if largest >= len(self._near):
            wider = np.zeros(max(_LEAST, 1 << largest.bit_length()), np.int64)
            wider[: len(self._near)] = self._near
            self._near = wider
        texts: Pieces = self._near.take(numbers)
        if not texts.all():
            unknown = self._once(numbers[texts == _UNKNOWN])
            self._near[unknown] = self._added(unknown.tolist())
            texts = self._near.take(numbers)
        return texts

    def _once(self, unknown: Ints) -> Ints:
        """Each of these numbers once: where one stands several times, its place keeps what was written there last."""
        marks = np.arange(len(unknown))
        self._near[unknown] = marks
        once: Ints = unknown[self._near.take(unknown) == marks]
        return once

    def _far_texts(self, numbers: Ints) -> Pieces:
        distinct, where = np.unique(numbers, return_inverse=True)
        unknown = [number for number in distinct.tolist() if number not in self._far]
        self._far.update(zip(unknown, self._added(unknown).tolist(), strict=True))
        return np.array([self._far[number] for number in distinct.tolist()], np.int64).take(where)

    def _added(self, numbers: list[int]) -> Pieces:
        """The pieces of these numbers, made now."""
        return self._store.add(self._make(numbers))


class KeyedTable:
    """Pieces by what they hang on."""

    def __init__(self, store: Store, make: Callable[[Any], bytes]) -> None:
        self._store = store
        self._make = make
        self._known: dict[Hashable, int] = {}
        self.forget = self._known.clear

    def take_pieces(self, keys: Sequence[Hashable]) -> Pieces:
        """The pieces of these."""
        unknown = [key for key in dict.fromkeys(keys) if key not in self._known]
        added = self._store.add(list(map(self._make, unknown)))
        self._known.update(zip(unknown, added.tolist(), strict=True))
        return np.fromiter(map(self._known.__getitem__, keys), np.int64, len(keys))


def sizes_in(texts: list[bytes]) -> Ints:
    """The length of each text."""
    return np.fromiter(map(len, texts), np.int64, len(texts))


def without(pieces: Pieces, head: int) -> Pieces:
    """The same pieces without so many of their first bytes."""
    return pieces + ((head << _SIZE_BITS) - head)


# Numbers as decimal text, thousands at once: four digits at a time, looked up in a table.


_Ints = NDArray[np.int64]
_DIGITS: Final = 4
_UNIT: Final = 10**_DIGITS
_MINUS: Final = ord("-")
_tables: list[NDArray[np.uint32]] = []


def decimals(numbers: _Ints) -> tuple[NDArray[np.uint8], _Ints, _Ints]:
    """The digits of these numbers: a text, and where each begins there and how many characters it has.

    The least of the 64-bit numbers, which has no counterpart, is not among them.
    """
    if not len(numbers):
        return np.zeros(0, np.uint8), numbers, numbers
    negative = numbers < 0
    rest: _Ints = np.abs(numbers)
    least, most = len(str(int(rest.min()))), len(str(int(rest.max())))
    sizes = np.full(len(numbers), least, np.int64)
    for digits in range(least, most):
        sizes += rest >= 10**digits
    words = most // _DIGITS + 1  # room for a sign
    text = np.empty((len(numbers), words), np.uint32)
    for word in range(words - 1, -1, -1):
        above = rest // _UNIT
        rest -= _UNIT * above
        text[:, word] = _table().take(rest)
        rest = above
    width = _DIGITS * words
    begins = width * np.arange(1, len(numbers) + 1) - sizes
    flat = text.reshape(-1).view(np.uint8)
    if negative.any():
        begins -= negative
        sizes += negative
        flat[begins[negative]] = _MINUS
    return flat, begins, sizes


def _table() -> NDArray[np.uint32]:
    """`0000` to `9999`, each as one word of memory."""
    if not _tables:
        digits = np.arange(_UNIT)[:, None] // 10 ** np.arange(_DIGITS - 1, -1, -1) % 10 + ord("0")
        _tables.append(digits.astype(np.uint8).view(np.uint32)[:, 0])
    return _tables[0]


# JSON of fields, whole and in the parts that hang on different things.


def encoded(value: Any) -> bytes:
    """A value as JSON."""
    return orjson.dumps(value)


def inside(text: str) -> bytes:
    """What stands between the quotes of a text in JSON."""
    return orjson.dumps(text)[1:-1]


def insides(texts: list[str]) -> list[bytes]:
    """What stands between the quotes of each of some texts; a quote in one would have a backslash before it."""
    return orjson.dumps(texts)[2:-2].split(b'","') if texts else []


def middle(value: int | bool, raw: str) -> bytes:
    """What `parted` gives as the second part, for a number or truth value."""
    literal = ("true" if value else "false") if value is True or value is False else value
    return f'{literal},"raw":"{raw}","text":"'.encode()


def parted(field: Field) -> tuple[bytes, bytes, bytes, bytes]:
    """A field's JSON in four: up to its value, up to its text, its text, the rest."""
    line = orjson.dumps(field.to_json())
    value = line.index(b'"value":') + len(b'"value":')
    text = line.index(b'"text":"', value) + len(b'"text":"')
    end = text + len(inside(field.text))
    return line[:value], line[value:text], line[text:end], line[end:]


_COPIED: Final = 16384  # pieces at once: what they make stays in the processor's cache


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

    @contextmanager
    def part(self, lines: Ints) -> Iterator[Cursor]:
        """A cursor on some of the lines, by place; the others stay where they are."""
        mine = Cursor(self.sheet, self._at[lines])
        yield mine
        self._at[lines] = mine._at

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
