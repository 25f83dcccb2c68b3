"""The JSON of registers and of bits, put together from tables: one by the place, one by the value, one by the address.

All text comes from what the parts of a declaration say of one register or bit (`child`) and of a row of them (`text`);
an address stands before the value in such a text, which is held to be so when the piece is made.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from typing import Final

import numpy as np

from dissectors.blocks import Bits, Registers
from dissectors.slots import Block

from .pieces import Cursor, Ints, Store, encoded, inside, middle, parted, within
from .source import Source

_LAST: Final = 0xFFFF  # the last address
_WORDS, _FIRST, _LATER = 1, 2, 3  # places of a register's pieces behind the first of them
_AFTER: Final = 1
_FIELDS: Final = b'","fields":['


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """The blocks of some rows: where their bytes begin, how many those are, the first address (-1 unknown)."""

    begins: Ints
    octets: Ints
    first: Ints
    counts: Ints  # registers or bits

    def addresses(self, i: Ints) -> Ints:
        """A number for the address of each value: 0 for none, else one more than the address."""
        first = np.repeat(self.first, self.counts)
        address = first + i
        address[(first < 0) | (address > _LAST)] = -1
        address += 1
        return address


class RegisterPieces:
    """The JSON of a block of registers."""

    def __init__(self, block: Block, part: Registers, store: Store) -> None:
        self._block = block
        self._part = part
        at = 1 + block.offset
        self._head = store.table(lambda octets: _head(block, octets))
        self._more = store.table(lambda n: _more(part.text([0] * n), part.text([0] * part.shown)))
        self._place = store.table(lambda i: (b"," if i else _FIELDS) + parted(part.child(at + 2 * i, 0, "", None))[0])
        self._between = _more(part.text([0, 0]), part.text([0]))[:-1]
        self._value = store.table(self._valued, (Registers, "value"))
        self._address = store.table(self._addressed, (Registers, part.area))

    def fits(self, octets: Ints, quantity: Ints | None) -> Ints:  # noqa: ARG002
        """How many registers these bytes are; 0 where only annotation can tell."""
        return np.where(octets & 1, 0, octets >> 1)

    def sizes(self, held: Held) -> Ints:
        """Pieces of each block."""
        return 5 + np.minimum(held.counts, self._part.shown) + 5 * held.counts

    def put(self, held: Held, source: Source, cursor: Cursor) -> None:
        """The pieces of these blocks."""
        cursor.put(self._head.take(held.octets))
        cursor.put_texts(source.hex(held.begins, held.octets))
        cursor.put(b'","text":"')
        i = within(held.counts)
        values = source.words(np.repeat(held.begins, held.counts) + 2 * i)
        value, address = self._value.take(values), self._address.take(held.addresses(i))
        shown = i < self._part.shown
        cursor.spread(np.minimum(held.counts, self._part.shown), value[shown] + np.where(i[shown], _LATER, _FIRST))
        cursor.put(self._more.take(np.where(held.counts > self._part.shown, held.counts, self._part.shown)))
        cursor.spread(held.counts, self._place.take(i), value, address, value + _WORDS, address + _AFTER)
        cursor.put(b"]}")

    def _valued(self, value: int) -> tuple[bytes, ...]:
        """What hangs on a value: what stands before its text, its text, and itself in the line of all: first, later."""
        said = inside(self._part.text([value]))
        return middle(value, f"{value:04x}"), inside(self._part.words(value)), said, self._between + said

    def _addressed(self, key: int) -> tuple[bytes, ...]:
        """What hangs on a register's address: what stands before its value in words, and what behind them."""
        _, _, known, _ = parted(self._part.child(0, 0, "", None))
        _, _, words, behind = parted(self._part.child(0, 0, "", key - 1 if key else None))
        return _before(words, known), behind


class BitPieces:
    """The JSON of a block of coils or inputs."""

    def __init__(self, block: Block, part: Bits, store: Store) -> None:
        self._part = part
        self._at = 1 + block.offset
        self._head = store.table(lambda octets: _head(block, octets))
        self._more = store.table(lambda n: _more(part.text([False] * n), part.text([False] * part.shown)))
        self._said = store.table(self._digits, (Bits, "said"))
        self._place = store.table(self._placed)
        self._rest = store.table(self._addressed, (Bits, part.area))
        self._padding = store.table(self._padded)

    def fits(self, octets: Ints, quantity: Ints | None) -> Ints:
        """How many bits these bytes are; 0 where only annotation can tell."""
        bits = 8 * octets
        if quantity is None:
            return bits
        counts = np.where(quantity < 0, bits, np.minimum(quantity, bits))
        return np.where(bits - counts >= 8, 0, counts)

    def sizes(self, held: Held) -> Ints:
        """Pieces of each block."""
        shown = (np.minimum(held.counts, self._part.shown) + 7) >> 3
        return 6 + shown + 2 * held.counts

    def put(self, held: Held, source: Source, cursor: Cursor) -> None:
        """The pieces of these blocks."""
        cursor.put(self._head.take(held.octets))
        cursor.put_texts(source.hex(held.begins, held.octets))
        cursor.put(b'","text":"')
        self._put_text(held, source, cursor)
        i = within(held.counts)
        octet, bit = i >> 3, i & 7
        byte = source.octets(np.repeat(held.begins, held.counts) + octet)
        on = byte >> bit & 1
        place = self._place.take(octet << 12 | byte << 4 | bit << 1 | (i > 0))
        cursor.spread(held.counts, place, self._rest.take(held.addresses(i) << 4 | bit << 1 | on))
        last = held.octets - 1
        padding = last << 12 | source.octets(held.begins + last) << 4 | (held.counts & 7)
        cursor.put(self._padding.take(np.where(held.counts & 7, padding, 0)))
        cursor.put(b"]}")

    def _put_text(self, held: Held, source: Source, cursor: Cursor) -> None:
        shown = np.minimum(held.counts, self._part.shown)
        groups = (shown + 7) >> 3
        i = within(groups)
        bits = np.minimum(np.repeat(shown, groups) - 8 * i, 8)
        byte = source.octets(np.repeat(held.begins, groups) + i)
        cursor.spread(groups, self._said.take(byte << 5 | bits << 1 | (i > 0)))
        cursor.put(self._more.take(np.where(held.counts > self._part.shown, held.counts, self._part.shown)))

    def _digits(self, key: int) -> bytes:
        before = [False] * (8 * (key & 1))
        return _more(self._part.text(before + _bits(key >> 5)[: key >> 1 & 0xF]), self._part.text(before))

    def _placed(self, key: int) -> bytes:
        octet, byte, bit = key >> 12, key >> 4 & 0xFF, key >> 1 & 7
        return (b"," if key & 1 else _FIELDS) + self._heads(octet) + middle(bool(byte >> bit & 1), f"{byte:02x}")

    @cache  # noqa: B019 - as long as the table
    def _heads(self, octet: int) -> bytes:
        return parted(self._part.child(self._at + octet, False, "", 0, None))[0]

    def _addressed(self, key: int) -> bytes:
        address, bit, on = (key >> 4) - 1, key >> 1 & 7, bool(key & 1)
        return b"".join(parted(self._part.child(0, on, "", bit, None if address < 0 else address))[2:])

    def _padded(self, key: int) -> bytes:
        octet, byte, bit = key >> 12, key >> 4 & 0xFF, key & 7
        if not bit:
            return b""
        return b"," + encoded(self._part.padding(self._at + octet, f"{byte:02x}", _bits(byte), bit).to_json())


def block_pieces(block: Block, store: Store) -> RegisterPieces | BitPieces:
    """The tables of a block."""
    part = block.part
    return BitPieces(block, part, store) if isinstance(part, Bits) else RegisterPieces(block, part, store)


def _head(block: Block, octets: int) -> bytes:
    """A block's field up to its bytes."""
    first, middle, _, _ = parted(block.described(bytes(octets)))
    return b"," + first + middle[: middle.index(b'"raw":"') + len(b'"raw":"')]


def _more(text: str, known: str) -> bytes:
    """What a text has beyond one that it begins with."""
    if not text.startswith(known):
        raise AssertionError(f"{text!r} does not begin with {known!r}")
    return inside(text[len(known) :])


def _before(words: bytes, known: bytes) -> bytes:
    """What a text has before one that it ends with."""
    if not words.endswith(known):
        raise AssertionError(f"{words!r} does not end with {known!r}")
    return words[: len(words) - len(known)]


def _bits(byte: int) -> list[bool]:
    return [bool(byte >> bit & 1) for bit in range(8)]
