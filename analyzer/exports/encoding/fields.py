"""The fields of frames whose declaration gives them fixed places (`dissectors.slots`), as pieces of JSON.

A form is what the frames of one direction and function code have in common. A number's piece hangs on its value; where
it looks at another number, or repeats the request's, that is part of the piece's number too.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analyzer.frames import Kind
from dissectors.declaration import EXCEPTION
from dissectors.functions import function
from dissectors.lengths import Role
from dissectors.slots import Look, Slot, Slots, exception_slots, slots

from .blocks import BitPieces, Held, RegisterPieces, block_pieces
from .pieces import Cursor, Ints, Places, Store, encoded
from .source import Source


@dataclass(frozen=True, slots=True, eq=False)
class Rows:
    """Rows of one form: where they stand in the batch, and their blocks, if they have any."""

    here: Ints
    held: Held | None


class Form:
    """The frames of one direction and function code."""

    def __init__(self, made: Slots, code: int, store: Store) -> None:
        self._slots = made
        self._code = code
        self._numbers = [_NumberPieces(slot, store) for slot in made.numbers]
        looks = [look for slot in made.numbers for look in (*slot.looks, slot.echo)]
        looks += [] if made.block is None else [made.block.start, made.block.quantity]
        self._asks = any(look is not None and look.asked for look in looks)
        self._block: RegisterPieces | BitPieces | None = None if made.block is None else block_pieces(made.block, store)

    def split(self, here: Ints, source: Source) -> tuple[Rows, NDArray[np.bool_]]:
        """Of these rows those that are put together from pieces, and a mask of them: not the cut and the odd ones."""
        pdus = source.pdus
        sizes = pdus.ends[here] - pdus.begins[here]
        fits = np.ones(len(here), np.bool_)
        if self._asks:  # a request of another function would tell nothing
            asked = pdus.asked_begins[here]
            fits = (asked < 0) | (
                (pdus.asked_ends[here] > asked) & (pdus.data.take(np.maximum(asked, 0)) == self._code)
            )
        if self._block is None or self._slots.block is None:
            fits &= sizes == self._slots.size
            return Rows(here[fits], None), fits
        block = self._slots.block
        octets = sizes - self._slots.size
        count = pdus.number(block.count.offset, block.count.part.width, here)
        fits &= (octets > 0) & (octets == count * block.part.scale - block.part.less)
        quantity = None if block.quantity is None else _looked(block.quantity, here, source)
        counts = self._block.fits(np.where(fits, octets, 0), quantity)
        fits &= counts > 0
        kept = here[fits]
        first = np.full(len(kept), -1) if block.start is None else _looked(block.start, kept, source)
        held = Held(pdus.begins[kept] + block.offset, octets[fits], first, counts[fits])
        return Rows(kept, held), fits

    def sizes(self, rows: Rows) -> Ints:
        """Pieces of each row."""
        sizes = np.full(len(rows.here), len(self._numbers))
        return sizes if self._block is None or rows.held is None else sizes + self._block.sizes(rows.held)

    def put(self, rows: Rows, source: Source, cursor: Cursor) -> None:
        """The pieces of the fields, from behind the function code to before the check value."""
        for number in self._numbers:
            cursor.put(number.take(rows.here, source))
        if self._block is not None and rows.held is not None:
            self._block.put(rows.held, source, cursor)


class _NumberPieces:
    """The JSON of one number."""

    def __init__(self, slot: Slot, store: Store) -> None:
        self._slot = slot
        self._bits = 8 * slot.part.width
        # Request and response often are one declaration, and then say the same.
        self._pieces = store.table(self._described, (slot.name, slot.offset, slot.part, slot.looks))
        self._unlike = store.table(self._unlike_asked)

    def take(self, here: Ints, source: Source) -> Places:
        """The pieces of some rows."""
        slot = self._slot
        value = source.pdus.number(slot.offset, slot.part.width, here)
        number = value
        for look in slot.looks:
            number = number | (_looked(look, here, source) + 1) << self._bits
        found = self._pieces.take(number)
        if slot.echo is not None:
            asked = _looked(slot.echo, here, source)
            unlike = np.flatnonzero((asked >= 0) & (asked != value))
            found[unlike] = self._unlike.take(number[unlike] << 16 | asked[unlike])
        return found

    def _described(self, number: int, asked: int = -1) -> bytes:
        value, looked = number & ((1 << self._bits) - 1), (number >> self._bits) - 1
        return b"," + encoded(self._slot.described(value, [looked] * len(self._slot.looks), asked).to_json())

    def _unlike_asked(self, number: int) -> bytes:
        return self._described(number >> 16, number & 0xFFFF)


def _looked(look: Look, here: Ints, source: Source) -> Ints:
    return source.pdus.number(look.offset, look.width, here, asked=look.asked)


def form(kind: int, code: int, store: Store) -> Form | None:
    """The form of the frames with this kind of row and function byte; None where there is none."""
    role = Role.REQUEST if kind == Kind.REQUEST else Role.RESPONSE
    declared = function(code)
    if code & EXCEPTION:
        made = exception_slots() if role is Role.RESPONSE else None
    else:
        made = None if declared is None else slots(declared, role)
    return None if made is None else Form(made, code, store)
