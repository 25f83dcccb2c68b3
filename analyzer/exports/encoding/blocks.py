"""The JSON of registers and of bits, put together from tables: one by the place, one by the value, one by the address.

All text comes from what the parts of a declaration say of one register or bit (`child`) and of a row of them (`text`);
an address stands before the value in such a text, which is held to be so when the piece is made.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import Final

import numpy as np

from captures.ragged import counted_on
from dissectors.blocks import Bits, EachByte, Registers
from dissectors.fields import ENGLISH
from dissectors.layout import CountedBlock, Slot

from .forms import BatchBytes, FormBlocks, FormRows, looked
from .sheet import Cursor, Ints, Store, encoded, inside, insides, middle, parted, without

_FIELDS: Final = b'","fields":['
_VALUE: Final = b'%d,"raw":"%04x","text":"'  # `middle` of a register


class _BlockPieces:
    """The JSON of a block up to its values' fields."""

    def __init__(self, block: CountedBlock, text: RegisterText | BitText, store: Store) -> None:
        self._at = 1 + block.offset
        self._head = store.table(lambda octets: _head(block, octets))
        self._text = text

    def sizes(self, rows: FormRows) -> Ints:
        """Pieces of each block up to there."""
        return 3 + self._text.sizes(rows.blocks)

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """These pieces."""
        blocks = rows.blocks
        cursor.put(self._head.take_pieces(blocks.octets))
        cursor.put(source.hex(blocks.begins, blocks.octets, cursor.sheet))
        cursor.put(b'","text":"')
        self._text.put(blocks, source, cursor)


class RegisterPieces(_BlockPieces):
    """The JSON of a block of registers."""

    def __init__(self, block: CountedBlock, part: Registers, store: Store) -> None:
        super().__init__(block, RegisterText(part, store), store)
        self._part = part
        self._zero_words = inside(part.words(0))
        self._opening = store.table(self._placed)
        self._value = store.table_of_many(_register_values, "register")
        self._words = store.table_of_many(lambda values: insides(list(map(part.words, values))), (Registers, "words"))
        self._before = store.table(self._before_words, (Registers, "before", part.area))
        self._behind = store.table(self._behind_words, (Registers, "behind", part.area))

    def sizes(self, rows: FormRows) -> Ints:
        """Pieces of each block."""
        return super().sizes(rows) + 5 * rows.blocks.counts + 1

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """The pieces of these blocks."""
        super().put(rows, source, cursor)
        blocks = rows.blocks
        i = counted_on(blocks.counts)
        values = source.words(np.repeat(blocks.begins, blocks.counts) + 2 * i)
        addresses = blocks.addresses(i)
        cursor.spread(
            blocks.counts,
            self._opening.take_pieces(i),
            self._value.take_pieces(values),
            self._before.take_pieces(addresses),
            self._words.take_pieces(values),
            self._behind.take_pieces(addresses),
        )
        cursor.put(b"]}")

    def _placed(self, i: int) -> bytes:
        return (b"," if i else _FIELDS) + parted(self._part.child(self._at + 2 * i, 0, "", None))[0]

    def _before_words(self, key: int) -> bytes:
        """What a text has before a register's value in words: its address."""
        words = inside(self._part.child(0, 0, "", key - 1 if key else None).text)
        if not words.endswith(self._zero_words):
            raise AssertionError(f"{words!r} does not end with {self._zero_words!r}")
        return words[: len(words) - len(self._zero_words)]

    def _behind_words(self, key: int) -> bytes:
        return parted(self._part.child(0, 0, "", key - 1 if key else None))[3]


def _register_values(values: list[int]) -> list[bytes]:
    return [_VALUE % (value, value) for value in values]


def register_rests(part: Registers, values: list[int]) -> list[bytes]:
    """The fields of registers whose address nobody knows, from the value on."""
    end = parted(part.child(0, 0, "", None))[3]
    told = zip(_register_values(values), insides(list(map(part.words, values))), strict=True)
    return [value + words + end for value, words in told]


class BitPieces(_BlockPieces):
    """The JSON of a block of coils or inputs."""

    def __init__(self, block: CountedBlock, part: Bits, store: Store) -> None:
        super().__init__(block, BitText(part, store), store)
        self._part = part
        self._opening = store.table(self._placed)
        self._rest = store.table(self._addressed, (Bits, part.area))
        self._padding = store.table(self._padded)
        self._heads = cache(self._head_of)  # as long as the table: a cache on the method would keep it for ever

    def sizes(self, rows: FormRows) -> Ints:
        """Pieces of each block."""
        return super().sizes(rows) + 2 * rows.blocks.counts + 2

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """The pieces of these blocks."""
        super().put(rows, source, cursor)
        blocks = rows.blocks
        i = counted_on(blocks.counts)
        octet, bit = i >> 3, i & 7
        byte = source.octets(np.repeat(blocks.begins, blocks.counts) + octet)
        on = byte >> bit & 1
        openings = self._opening.take_pieces(octet << 12 | byte << 4 | bit << 1 | (i > 0))
        cursor.spread(blocks.counts, openings, self._rest.take_pieces(blocks.addresses(i) << 4 | bit << 1 | on))
        last = blocks.octets - 1
        padding = last << 12 | source.octets(blocks.begins + last) << 4 | (blocks.counts & 7)
        cursor.put(self._padding.take_pieces(np.where(blocks.counts & 7, padding, 0)))
        cursor.put(b"]}")

    def _placed(self, key: int) -> bytes:
        octet, byte, bit = key >> 12, key >> 4 & 0xFF, key >> 1 & 7
        return (b"," if key & 1 else _FIELDS) + self._heads(octet) + middle(bool(byte >> bit & 1), f"{byte:02x}")

    def _head_of(self, octet: int) -> bytes:
        return parted(self._part.child(self._at + octet, False, "", 0, None))[0]

    def _addressed(self, key: int) -> bytes:
        address, bit, on = (key >> 4) - 1, key >> 1 & 7, bool(key & 1)
        return b"".join(parted(self._part.child(0, on, "", bit, None if address < 0 else address))[2:])

    def _padded(self, key: int) -> bytes:
        octet, byte, bit = key >> 12, key >> 4 & 0xFF, key & 7
        if not bit:
            return b""
        return b"," + encoded(self._part.padding(self._at + octet, f"{byte:02x}", bits_of(byte), bit).to_json())


def block_pieces(block: CountedBlock, store: Store) -> RegisterPieces | BitPieces:
    """The tables of a block."""
    part = block.part
    return BitPieces(block, part, store) if isinstance(part, Bits) else RegisterPieces(block, part, store)


def _head(block: CountedBlock, octets: int) -> bytes:
    """A block's field up to its bytes."""
    first, middle, _, _ = parted(block.described(bytes(octets)))
    return b"," + first + middle[: middle.index(b'"raw":"') + len(b'"raw":"')]


# The fields of a form's frames as pieces of JSON, from behind the function code to before the check value.
#
# A number's piece hangs on its value; where it looks at another number, or repeats the request's, that is part of the
# piece's number too.


class NumberJson:
    """The JSON of one number."""

    def __init__(self, slot: Slot, store: Store) -> None:
        self._slot = slot
        self._bits = 8 * slot.part.width
        # Request and response often are one declaration, and then say the same.
        self._texts = store.table(self._described, (slot.name, slot.offset, slot.part, slot.looks))
        self._unlike = store.table(self._unlike_requested)

    def sizes(self, rows: FormRows) -> Ints:
        """One piece a row."""
        return np.ones(len(rows.here), np.int64)

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """The piece of each row."""
        slot, row_numbers = self._slot, rows.here
        number = numbers(slot, row_numbers, source)
        texts = self._texts.take_pieces(number)
        if slot.echo is not None:
            requested = looked(slot.echo, row_numbers, source)
            value = number & ((1 << self._bits) - 1)
            unlike = np.flatnonzero((requested >= 0) & (requested != value))
            texts[unlike] = self._unlike.take_pieces(number[unlike] << 16 | requested[unlike])
        cursor.put(texts)

    def _described(self, number: int, requested: int = -1) -> bytes:
        return b"," + encoded(self._slot.described(*taken_apart(self._slot, number), requested).to_json())

    def _unlike_requested(self, number: int) -> bytes:
        return self._described(number >> 16, number & 0xFFFF)


def numbers(slot: Slot, row_numbers: Ints, source: BatchBytes) -> Ints:
    """What a number's description hangs on, of each row, as one number: its value, and what it looks at."""
    number = source.pdus.number(slot.offset, slot.part.width, row_numbers)
    for reference in slot.looks:
        number = number | (looked(reference, row_numbers, source) + 1) << 8 * slot.part.width
    return number


def taken_apart(slot: Slot, number: int) -> tuple[int, list[int]]:
    """The value, and what it looks at (-1 unknown), of one of `numbers`."""
    bits = 8 * slot.part.width
    return number & ((1 << bits) - 1), [(number >> bits) - 1] * len(slot.looks)


# Registers and bits on one line (`text` of their parts), put together from pieces; the same in JSON and in CSV.


class RegisterText:
    """The line of a block of registers: `44609 22098 17216`."""

    def __init__(self, part: Registers, store: Store) -> None:
        self._shown = part.shown
        self._part = part
        self._between = _more(part.text([0, 0]), part.text([0]))[:-1]
        self._texts = store.table_of_many(self._digits, (Registers, "said"))
        self._more = store.table(lambda n: _more(part.text([0] * n), part.text([0] * part.shown)))

    def sizes(self, blocks: FormBlocks) -> Ints:
        """Pieces of each line."""
        return 1 + np.minimum(blocks.counts, self._shown)

    def put(self, blocks: FormBlocks, source: BatchBytes, cursor: Cursor) -> None:
        """The pieces of these blocks' lines."""
        shown = np.minimum(blocks.counts, self._shown)
        i = counted_on(shown)
        values = source.words(np.repeat(blocks.begins, shown) + 2 * i)
        texts = self._texts.take_pieces(values)
        cursor.spread(shown, np.where(i > 0, texts, without(texts, len(self._between))))
        cursor.put(self._more.take_pieces(np.maximum(blocks.counts, self._shown)))

    def _digits(self, values: list[int]) -> list[bytes]:
        """Each value as one of a line that is not its first."""
        between = self._between
        return [between + digits for digits in insides(list(map(self._part.digits, values)))]


class BitText:
    """The line of a block of bits: `11001101 011`."""

    def __init__(self, part: Bits, store: Store) -> None:
        self._shown = part.shown
        self._part = part
        self._texts = store.table(self._digits, (Bits, "said"))
        self._more = store.table(lambda n: _more(part.text([False] * n), part.text([False] * part.shown)))

    def sizes(self, blocks: FormBlocks) -> Ints:
        """Pieces of each line."""
        return 1 + ((np.minimum(blocks.counts, self._shown) + 7) >> 3)

    def put(self, blocks: FormBlocks, source: BatchBytes, cursor: Cursor) -> None:
        """The pieces of these blocks' lines."""
        shown = np.minimum(blocks.counts, self._shown)
        groups = (shown + 7) >> 3
        i = counted_on(groups)
        bits = np.minimum(np.repeat(shown, groups) - 8 * i, 8)
        byte = source.octets(np.repeat(blocks.begins, groups) + i)
        cursor.spread(groups, self._texts.take_pieces(byte << 5 | bits << 1 | (i > 0)))
        cursor.put(self._more.take_pieces(np.maximum(blocks.counts, self._shown)))

    def _digits(self, key: int) -> bytes:
        before = [False] * (8 * (key & 1))
        return _more(self._part.text(before + bits_of(key >> 5)[: key >> 1 & 0xF]), self._part.text(before))


class EachText:
    """The line of a block of bytes that each stand for something: `sent, received: broadcast`."""

    def __init__(self, part: EachByte, store: Store, escape: Callable[[str], bytes]) -> None:
        self._shown = part.shown
        self._texts = store.table(lambda byte: escape(part.line(["", part.words(byte, ENGLISH)])))
        self._between = len(part.line(["", ""]))
        self._more = store.table(lambda n: _more(part.line([""] * n), part.line([""] * part.shown)))

    def sizes(self, blocks: FormBlocks) -> Ints:
        """Pieces of each line."""
        return 1 + np.minimum(blocks.counts, self._shown)

    def put(self, blocks: FormBlocks, source: BatchBytes, cursor: Cursor) -> None:
        """The pieces of these blocks' lines."""
        shown = np.minimum(blocks.counts, self._shown)
        i = counted_on(shown)
        texts = self._texts.take_pieces(source.octets(np.repeat(blocks.begins, shown) + i))
        cursor.spread(shown, np.where(i > 0, texts, without(texts, self._between)))
        cursor.put(self._more.take_pieces(np.maximum(blocks.counts, self._shown)))


def block_text(part: Registers | Bits, store: Store) -> RegisterText | BitText:
    """The line of a block."""
    return BitText(part, store) if isinstance(part, Bits) else RegisterText(part, store)


def bits_of(byte: int) -> list[bool]:
    """The bits of a byte, least significant first."""
    return [bool(byte >> bit & 1) for bit in range(8)]


def _more(text: str, beginning: str) -> bytes:
    """What a text has beyond one that it begins with."""
    if not text.startswith(beginning):
        raise AssertionError(f"{text!r} does not begin with {beginning!r}")
    return inside(text[len(beginning) :])
