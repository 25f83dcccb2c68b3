"""Registers and bits on one line (`text` of their parts), put together from pieces; the same in JSON and in CSV."""

from __future__ import annotations

import numpy as np

from dissectors.blocks import Bits, Registers

from .forms import Held
from .jsontext import inside, insides
from .pieces import Ints, Store, without
from .sheet import Cursor, within
from .source import Source


class RegisterText:
    """The line of a block of registers: `44609 22098 17216`."""

    def __init__(self, part: Registers, store: Store) -> None:
        self._shown = part.shown
        self._part = part
        self._between = _more(part.text([0, 0]), part.text([0]))[:-1]
        self._said = store.table_of_many(self._digits, (Registers, "said"))
        self._more = store.table(lambda n: _more(part.text([0] * n), part.text([0] * part.shown)))

    def sizes(self, held: Held) -> Ints:
        """Pieces of each line."""
        return 1 + np.minimum(held.counts, self._shown)

    def put(self, held: Held, source: Source, cursor: Cursor) -> None:
        """The pieces of these blocks' lines."""
        shown = np.minimum(held.counts, self._shown)
        i = within(shown)
        values = source.words(np.repeat(held.begins, shown) + 2 * i)
        said = self._said.take(values)
        cursor.spread(shown, np.where(i > 0, said, without(said, len(self._between))))
        cursor.put(self._more.take(np.maximum(held.counts, self._shown)))

    def _digits(self, values: list[int]) -> list[bytes]:
        """Each value as one of a line that is not its first."""
        between = self._between
        return [between + said for said in insides(list(map(self._part.digits, values)))]


class BitText:
    """The line of a block of bits: `11001101 011`."""

    def __init__(self, part: Bits, store: Store) -> None:
        self._shown = part.shown
        self._part = part
        self._said = store.table(self._digits, (Bits, "said"))
        self._more = store.table(lambda n: _more(part.text([False] * n), part.text([False] * part.shown)))

    def sizes(self, held: Held) -> Ints:
        """Pieces of each line."""
        return 1 + ((np.minimum(held.counts, self._shown) + 7) >> 3)

    def put(self, held: Held, source: Source, cursor: Cursor) -> None:
        """The pieces of these blocks' lines."""
        shown = np.minimum(held.counts, self._shown)
        groups = (shown + 7) >> 3
        i = within(groups)
        bits = np.minimum(np.repeat(shown, groups) - 8 * i, 8)
        byte = source.octets(np.repeat(held.begins, groups) + i)
        cursor.spread(groups, self._said.take(byte << 5 | bits << 1 | (i > 0)))
        cursor.put(self._more.take(np.maximum(held.counts, self._shown)))

    def _digits(self, key: int) -> bytes:
        before = [False] * (8 * (key & 1))
        return _more(self._part.text(before + bits_of(key >> 5)[: key >> 1 & 0xF]), self._part.text(before))


def block_text(part: Registers | Bits, store: Store) -> RegisterText | BitText:
    """The line of a block."""
    return BitText(part, store) if isinstance(part, Bits) else RegisterText(part, store)


def bits_of(byte: int) -> list[bool]:
    """The bits of a byte, least significant first."""
    return [bool(byte >> bit & 1) for bit in range(8)]


def _more(text: str, known: str) -> bytes:
    """What a text has beyond one that it begins with."""
    if not text.startswith(known):
        raise AssertionError(f"{text!r} does not begin with {known!r}")
    return inside(text[len(known) :])
