"""The JSON of registers and of bits, put together from tables: one by the place, one by the value, one by the address.

All text comes from what the parts of a declaration say of one register or bit (`child`) and of a row of them (`text`);
an address stands before the value in such a text, which is held to be so when the piece is made.
"""

from __future__ import annotations

from functools import cache
from typing import Final

import numpy as np

from dissectors.blocks import Bits, Registers
from dissectors.slots import Block

from .forms import Rows
from .jsontext import encoded, inside, middle, parted
from .pieces import Cursor, Ints, Store, within
from .source import Source
from .texts import BitText, RegisterText, bits_of

_SECOND: Final = 1  # place of the second of two pieces behind the first
_FIELDS: Final = b'","fields":['


class RegisterPieces:
    """The JSON of a block of registers."""

    def __init__(self, block: Block, part: Registers, store: Store) -> None:
        self._block = block
        self._part = part
        at = 1 + block.offset
        self._head = store.table(lambda octets: _head(block, octets))
        self._text = RegisterText(part, store)
        self._place = store.table(lambda i: (b"," if i else _FIELDS) + parted(part.child(at + 2 * i, 0, "", None))[0])
        self._value = store.table(self._valued, (Registers, "value"))
        self._address = store.table(self._addressed, (Registers, part.area))

    def sizes(self, rows: Rows) -> Ints:
        """Pieces of each block."""
        held = rows.blocks
        return 4 + self._text.sizes(held) + 5 * held.counts

    def put(self, rows: Rows, source: Source, cursor: Cursor) -> None:
        """The pieces of these blocks."""
        held = rows.blocks
        cursor.put(self._head.take(held.octets))
        cursor.put_texts(source.hex(held.begins, held.octets))
        cursor.put(b'","text":"')
        self._text.put(held, source, cursor)
        i = within(held.counts)
        values = source.words(np.repeat(held.begins, held.counts) + 2 * i)
        value, address = self._value.take(values), self._address.take(held.addresses(i))
        cursor.spread(held.counts, self._place.take(i), value, address, value + _SECOND, address + _SECOND)
        cursor.put(b"]}")

    def _valued(self, value: int) -> tuple[bytes, ...]:
        """What hangs on a value: what stands before its text, and its text."""
        return middle(value, f"{value:04x}"), inside(self._part.words(value))

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
        self._text = BitText(part, store)
        self._place = store.table(self._placed)
        self._rest = store.table(self._addressed, (Bits, part.area))
        self._padding = store.table(self._padded)

    def sizes(self, rows: Rows) -> Ints:
        """Pieces of each block."""
        held = rows.blocks
        return 5 + self._text.sizes(held) + 2 * held.counts

    def put(self, rows: Rows, source: Source, cursor: Cursor) -> None:
        """The pieces of these blocks."""
        held = rows.blocks
        cursor.put(self._head.take(held.octets))
        cursor.put_texts(source.hex(held.begins, held.octets))
        cursor.put(b'","text":"')
        self._text.put(held, source, cursor)
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
        return b"," + encoded(self._part.padding(self._at + octet, f"{byte:02x}", bits_of(byte), bit).to_json())


def block_pieces(block: Block, store: Store) -> RegisterPieces | BitPieces:
    """The tables of a block."""
    part = block.part
    return BitPieces(block, part, store) if isinstance(part, Bits) else RegisterPieces(block, part, store)


def _head(block: Block, octets: int) -> bytes:
    """A block's field up to its bytes."""
    first, middle, _, _ = parted(block.described(bytes(octets)))
    return b"," + first + middle[: middle.index(b'"raw":"') + len(b'"raw":"')]


def _before(words: bytes, known: bytes) -> bytes:
    """What a text has before one that it ends with."""
    if not words.endswith(known):
        raise AssertionError(f"{words!r} does not end with {known!r}")
    return words[: len(words) - len(known)]
