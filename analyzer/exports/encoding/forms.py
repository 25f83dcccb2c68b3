"""Frames whose parts lie in fixed places (`dissectors.layout`) or are found for all at once (`dissectors.columnar`).

A form is what the frames of one direction and function code have in common, for those who set them from pieces:
those of its frames that are whole and neither odd nor too long. The others are left to the annotation of each.
"""

from __future__ import annotations

import typing
from binascii import hexlify
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.blocks import Bits
from dissectors.columnar import Spot, spots
from dissectors.functions import function
from dissectors.layout import CountedBlock, FieldRef, Slots, Tail, exception_slots, slots
from dissectors.length_rules import Role
from dissectors.limits import EXCEPTION

from ...tables.batch import Batch, Frame
from ...tables.columns import Pdus
from ...tables.schema import Kind, Protocol, Rows
from ...tables.schema import Protocol as Envelope
from ...tables.schema import Rows as BatchRows
from .sheet import Cursor, Ints, Pieces, Sheet, pieces

_LEAST: Final = 4  # bytes of an RTU frame that has a check value
_LAST: Final = 0xFFFF  # the last address


@dataclass(frozen=True, slots=True, eq=False)
class FormBlocks:
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


@dataclass(frozen=True, slots=True, eq=False)
class FormRows:
    """Rows of one form: where they stand in the batch, and their blocks or all their parts, if any."""

    here: Ints
    held: FormBlocks | None = None
    spots: Sequence[Spot] = ()

    @property
    def blocks(self) -> FormBlocks:
        """The blocks, of a form that has them."""
        if self.held is None:
            raise AssertionError("a form without a block")
        return self.held


class FormPart(typing.Protocol):
    """A stretch of a form's text."""

    def sizes(self, rows: FormRows) -> Ints:
        """Pieces of each row."""

    def put(self, rows: FormRows, source: BatchBytes, cursor: Cursor) -> None:
        """These pieces."""


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """Rows of one form and the lines that they are to make."""

    parts: tuple[FormPart, ...]
    lines: Ints
    rows: FormRows

    def sizes(self) -> Ints:
        """Pieces of each line."""
        return sum((part.sizes(self.rows) for part in self.parts), np.zeros(len(self.lines), np.int64))

    def put(self, source: BatchBytes, cursor: Cursor) -> None:
        """The pieces of all lines, from the cursor's place on."""
        for part in self.parts:
            part.put(self.rows, source, cursor)


class Forms:
    """All forms; `parts` gives what the text of one is made of, None where it cannot be."""

    def __init__(self, parts: Callable[[int, Role, Slots], tuple[FormPart, ...] | None]) -> None:
        self._parts = parts
        self._forms: dict[int, tuple[Slots, tuple[FormPart, ...]] | None] = {}

    def groups(self, rows: BatchRows, row_numbers: Ints, source: BatchBytes) -> list[Group]:
        """The rows, which are `row_numbers` of the batch, that are set from pieces, by form."""
        able = np.flatnonzero((rows.kind != Kind.NOISE) & (rows.protocol == Envelope.RTU) & (rows.length >= _LEAST))
        keys = rows.kind[able].astype(np.int64) << 8 | source.octets(source.pdus.begins[row_numbers[able]])
        groups = []
        for key in np.flatnonzero(np.bincount(keys)).tolist():
            if key not in self._forms:
                self._forms[key] = self._form(key & 0xFF, Role.REQUEST if key >> 8 == Kind.REQUEST else Role.RESPONSE)
            if (form := self._forms[key]) is not None:
                lines = able[keys == key]
                form_rows, fits = _split(form[0], key & 0xFF, row_numbers[lines], source)
                groups.append(Group(form[1], lines[fits], form_rows))
        return groups

    def _form(self, code: int, role: Role) -> tuple[Slots, tuple[FormPart, ...]] | None:
        declared = function(code)
        if code & EXCEPTION:
            form_slots = exception_slots() if role is Role.RESPONSE else None
        else:
            form_slots = None if declared is None else slots(declared, role)
        parts = None if form_slots is None else self._parts(code, role, form_slots)
        return None if form_slots is None or parts is None else (form_slots, parts)


def looked(reference: FieldRef, row_numbers: Ints, source: BatchBytes) -> Ints:
    """The number that is looked at, of each row; -1 where there is none."""
    return source.pdus.number(reference.offset, reference.width, row_numbers, asked=reference.asked)


def _split(form: Slots, code: int, row_numbers: Ints, source: BatchBytes) -> tuple[FormRows, NDArray[np.bool_]]:
    """Of these rows those that are set from pieces, and a mask of them."""
    pdus = source.pdus
    sizes = pdus.ends[row_numbers] - pdus.begins[row_numbers]
    fits = np.ones(len(row_numbers), np.bool_)
    if form.asks:  # a request of another function would tell nothing
        request_begins = pdus.asked_begins[row_numbers]
        fits = (request_begins < 0) | (
            (pdus.asked_ends[row_numbers] > request_begins) & (pdus.data.take(np.maximum(request_begins, 0)) == code)
        )
    if form.tail is not None:
        return _split_tail(form.tail, row_numbers, fits, pdus)
    if form.block is None:
        fits &= sizes == form.size
        return FormRows(row_numbers[fits]), fits
    block = form.block
    octets = sizes - form.size
    count = pdus.number(block.count.offset, block.count.part.width, row_numbers)
    fits &= (octets > 0) & (octets == count * block.part.scale - block.part.less)
    counts = _counts(block, np.where(fits, octets, 0), row_numbers, source)
    fits &= counts > 0
    fitting = row_numbers[fits]
    first = np.full(len(fitting), -1) if block.start is None else looked(block.start, fitting, source)
    blocks = FormBlocks(pdus.begins[fitting] + block.offset, octets[fits], first, counts[fits])
    return FormRows(fitting, blocks), fits


def _split_tail(
    tail: Tail, row_numbers: Ints, fits: NDArray[np.bool_], pdus: Pdus
) -> tuple[FormRows, NDArray[np.bool_]]:
    read = spots(tail.declaration)
    if read is None:
        fits[:] = False
        return FormRows(row_numbers[fits]), fits
    able = np.flatnonzero(fits)
    chosen = row_numbers[able]
    whole, found = read(pdus.data, pdus.begins[chosen] + 1, pdus.ends[chosen])
    fits[able] = whole
    return FormRows(chosen[whole], None, found), fits


def _counts(block: CountedBlock, octets: Ints, row_numbers: Ints, source: BatchBytes) -> Ints:
    """How many registers or bits these bytes are; 0 where only annotation can tell."""
    if not isinstance(block.part, Bits):
        return np.where(octets & 1, 0, octets >> 1)
    bits = 8 * octets
    if block.quantity is None:
        return bits
    quantity = looked(block.quantity, row_numbers, source)
    counts = np.where(quantity < 0, bits, np.minimum(quantity, bits))
    return np.where(bits - counts >= 8, 0, counts)


# Frames annotated whole, one by one, and what is kept of that.
#
# Polls repeat: the same request, and often the same answer, comes again and again, so the fields of frames
# seen are kept as text.


_MOST_CACHED: Final = 16 << 20  # bytes of text


class Whole:
    """What `make` says of a frame by its bytes (and its request's) alone, kept."""

    def __init__(self, make: Callable[[Frame], bytes]) -> None:
        self._make = make
        self._texts: dict[tuple[bytes, bytes | None, int, int], bytes] = {}
        self._size = 0

    def text(self, frame: Frame) -> bytes:
        """The frame's text."""
        key = (frame.captured, frame.request_bytes, frame.row.kind, frame.row.protocol)
        rendered = self._texts.get(key)
        if rendered is None:
            rendered = self._make(frame)
            self._size += len(rendered)
            if self._size > _MOST_CACHED:
                self._texts.clear()
                self._size = len(rendered)
            self._texts[key] = rendered
        return rendered


# The bytes of some rows of a batch, read by arrays: as numbers, and as hex.


class BatchBytes:
    """Bytes of a batch from `first` to `last` (excluded), which is as far as hex is asked for, for one sheet."""

    def __init__(self, pdus: Pdus, first: int, last: int) -> None:
        self.pdus = pdus
        self._first = first
        self._last = last
        self._hex: int | None = None  # where it begins among what the sheet was lent

    @classmethod
    def of(cls, pdus: Pdus, frames: Rows) -> BatchBytes:
        """The bytes of some frames of a batch, as far as they are captured as bytes."""
        plain = frames.protocol != Protocol.ASCII
        if not plain.any():
            return cls(pdus, 0, 0)
        begins = frames.at[plain]
        return cls(pdus, int(begins.min()), int((begins + frames.length[plain]).max()))

    def octets(self, at: Ints) -> Ints:
        """The byte at each place."""
        values: Ints = self.pdus.data.take(at).astype(np.int64)
        return values

    def words(self, at: Ints) -> Ints:
        """The two bytes at each place, as a number."""
        values: Ints = self.pdus.words.take(at).astype(np.int64)
        return values

    def hex(self, begins: Ints, lengths: Ints, sheet: Sheet) -> Pieces:
        """Stretches of bytes in hex."""
        if self._hex is None:
            self._hex = sheet.lend(hexlify(self._octets()))
        return pieces(self._hex + 2 * (begins - self._first), 2 * lengths)

    def spaced(self, begins: Ints, lengths: Ints, sheet: Sheet) -> Pieces:
        """Stretches of bytes in capital hex, spaces between the bytes."""
        begin = sheet.lend(hexlify(self._octets(), " ").upper())
        return pieces(begin + 3 * (begins - self._first), 3 * lengths - 1)

    def _octets(self) -> bytes:
        return self.pdus.data[self._first : self._last].tobytes()


def kept(batch: Batch, first: int, last: int, *, noise: bool) -> tuple[Ints, Rows]:
    """Of rows `first` to `last` (excluded) of a batch, their numbers and themselves; without `noise` only frames."""
    rows = batch.rows[first:last]
    if noise or (rows.kind != Kind.NOISE).all():
        return np.arange(first, last), rows
    row_numbers = first + np.flatnonzero(rows.kind != Kind.NOISE)
    return row_numbers, batch.rows[row_numbers]
