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
from .jsontext import encoded, inside, insides, middle, parted
from .pieces import Ints, Store
from .sheet import Cursor, within
from .source import Source
from .texts import BitText, RegisterText, bits_of

_FIELDS: Final = b'","fields":['
_VALUE: Final = b'%d,"raw":"%04x","text":"'  # `middle` of a register


class _BlockPieces:
    """The JSON of a block up to its values' fields."""

    def __init__(self, block: Block, text: RegisterText | BitText, store: Store) -> None:
        self._at = 1 + block.offset
        self._head = store.table(lambda octets: _head(block, octets))
        self._text = text

    def sizes(self, rows: Rows) -> Ints:
        """Pieces of each block up to there."""
        return 3 + self._text.sizes(rows.blocks)

    def put(self, rows: Rows, source: Source, cursor: Cursor) -> None:
        """These pieces."""
        held = rows.blocks
        cursor.put(self._head.take(held.octets))
        cursor.put(source.hex(held.begins, held.octets, cursor.sheet))
        cursor.put(b'","text":"')
        self._text.put(held, source, cursor)


class RegisterPieces(_BlockPieces):
    """The JSON of a block of registers."""

    def __init__(self, block: Block, part: Registers, store: Store) -> None:
        super().__init__(block, RegisterText(part, store), store)
        self._part = part
        self._known = inside(part.words(0))
        self._place = store.table(self._placed)
        self._value = store.table_of_many(lambda values: [_VALUE % (value, value) for value in values], "register")
        self._words = store.table_of_many(lambda values: insides(list(map(part.words, values))), (Registers, "words"))
        self._before = store.table(self._before_words, (Registers, "before", part.area))
        self._behind = store.table(self._behind_words, (Registers, "behind", part.area))

    def sizes(self, rows: Rows) -> Ints:
        """Pieces of each block."""
        return super().sizes(rows) + 5 * rows.blocks.counts + 1

    def put(self, rows: Rows, source: Source, cursor: Cursor) -> None:
        """The pieces of these blocks."""
        super().put(rows, source, cursor)
        held = rows.blocks
        i = within(held.counts)
        values = source.words(np.repeat(held.begins, held.counts) + 2 * i)
        addresses = held.addresses(i)
        cursor.spread(
            held.counts,
            self._place.take(i),
            self._value.take(values),
            self._before.take(addresses),
            self._words.take(values),
            self._behind.take(addresses),
        )
        cursor.put(b"]}")

    def _placed(self, i: int) -> bytes:
        return (b"," if i else _FIELDS) + parted(self._part.child(self._at + 2 * i, 0, "", None))[0]

    def _before_words(self, key: int) -> bytes:
        """What a text has before a register's value in words: its address."""
        words = inside(self._part.child(0, 0, "", key - 1 if key else None).text)
        if not words.endswith(self._known):
            raise AssertionError(f"{words!r} does not end with {self._known!r}")
        return words[: len(words) - len(self._known)]

    def _behind_words(self, key: int) -> bytes:
        return parted(self._part.child(0, 0, "", key - 1 if key else None))[3]


class BitPieces(_BlockPieces):
    """The JSON of a block of coils or inputs."""

    def __init__(self, block: Block, part: Bits, store: Store) -> None:
        super().__init__(block, BitText(part, store), store)
        self._part = part
        self._place = store.table(self._placed)
        self._rest = store.table(self._addressed, (Bits, part.area))
        self._padding = store.table(self._padded)

    def sizes(self, rows: Rows) -> Ints:
        """Pieces of each block."""
        return super().sizes(rows) + 2 * rows.blocks.counts + 2

    def put(self, rows: Rows, source: Source, cursor: Cursor) -> None:
        """The pieces of these blocks."""
        super().put(rows, source, cursor)
        held = rows.blocks
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
