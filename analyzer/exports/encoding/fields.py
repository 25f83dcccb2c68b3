"""The fields of a form's frames as pieces of JSON, from behind the function code to before the check value.

A number's piece hangs on its value; where it looks at another number, or repeats the request's, that is part of the
piece's number too.
"""

from __future__ import annotations

import numpy as np

from dissectors.lengths import Role
from dissectors.slots import Slot, Slots

from .blocks import block_pieces
from .forms import Part, Rows, looked
from .jsontext import encoded
from .pieces import Ints, Store
from .sheet import Cursor
from .source import Source


class Number:
    """The JSON of one number."""

    def __init__(self, slot: Slot, store: Store) -> None:
        self._slot = slot
        self._bits = 8 * slot.part.width
        # Request and response often are one declaration, and then say the same.
        self._pieces = store.table(self._described, (slot.name, slot.offset, slot.part, slot.looks))
        self._unlike = store.table(self._unlike_asked)

    def sizes(self, rows: Rows) -> Ints:
        """One piece a row."""
        return np.ones(len(rows.here), np.int64)

    def put(self, rows: Rows, source: Source, cursor: Cursor) -> None:
        """The piece of each row."""
        slot, here = self._slot, rows.here
        number = numbers(slot, here, source)
        found = self._pieces.take(number)
        if slot.echo is not None:
            asked = looked(slot.echo, here, source)
            value = number & ((1 << self._bits) - 1)
            unlike = np.flatnonzero((asked >= 0) & (asked != value))
            found[unlike] = self._unlike.take(number[unlike] << 16 | asked[unlike])
        cursor.put(found)

    def _described(self, number: int, asked: int = -1) -> bytes:
        return b"," + encoded(self._slot.described(*taken_apart(self._slot, number), asked).to_json())

    def _unlike_asked(self, number: int) -> bytes:
        return self._described(number >> 16, number & 0xFFFF)


def numbers(slot: Slot, here: Ints, source: Source) -> Ints:
    """What a number's description hangs on, of each row, as one number: its value, and what it looks at."""
    number = source.pdus.number(slot.offset, slot.part.width, here)
    for look in slot.looks:
        number = number | (looked(look, here, source) + 1) << 8 * slot.part.width
    return number


def taken_apart(slot: Slot, number: int) -> tuple[int, list[int]]:
    """The value, and what it looks at (-1 unknown), of one of `numbers`."""
    bits = 8 * slot.part.width
    return number & ((1 << bits) - 1), [(number >> bits) - 1] * len(slot.looks)


def fields(store: Store, code: int, role: Role, form: Slots) -> tuple[Part, ...]:  # noqa: ARG001
    """The parts of a form."""
    parts: list[Part] = [Number(slot, store) for slot in form.numbers]
    return (*parts, block_pieces(form.block, store)) if form.block is not None else tuple(parts)
