"""What the frames of a batch say, as columns: addresses, quantities and values, decoded without an object a frame.

Where things stand in a frame comes from the declarations (`dissectors.layout`), so that a vendor's function is
decoded like a public one; annotation of a single frame gives the same answer. A number that a cut frame does not reach
is -1, and of a cut block the whole values that are there are given, as annotation does.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import copy_pieces
from dissectors.adu import EXCEPTION
from dissectors.layout import Contents, NumberRef, ValueRun, contents, values_listed
from dissectors.length_rules import Role

from .batch import Batch
from .pdus import Pdus
from .schema import Kind

_Ints = NDArray[np.int64]
_WORD: Final = 2  # bytes of a register
_ROLES: Final = {int(Kind.NOISE): None, int(Kind.REQUEST): Role.REQUEST, int(Kind.RESPONSE): Role.RESPONSE}


class AreaCode(IntEnum):
    """The data model's tables, as numbers."""

    NONE = 0
    COILS = 1
    DISCRETE_INPUTS = 2
    INPUT_REGISTERS = 3
    HOLDING_REGISTERS = 4


AREA_CODES: Final[dict[str | None, AreaCode]] = {
    None: AreaCode.NONE,
    "0x": AreaCode.COILS,
    "1x": AreaCode.DISCRETE_INPUTS,
    "3x": AreaCode.INPUT_REGISTERS,
    "4x": AreaCode.HOLDING_REGISTERS,
}


@dataclass(frozen=True, slots=True, eq=False)
class Decoded:
    """What each row of a batch speaks of; n rows, noise among them (-1 and no values).

    `address` (n) the physical starting address, of a response what it answers; `quantity` (n) how many; -1 for none.
    `area` (n) an `AreaCode`. Values are ragged: those of row i are `values[offsets[i] : offsets[i + 1]]`, registers as
    unsigned numbers, coils and inputs as 0 or 1; `value_address` (n) is the address of the first, -1 where unknown.
    An exception has the address and quantity of its request.
    """

    address: NDArray[np.int32]
    quantity: NDArray[np.int32]
    area: NDArray[np.uint8]
    value_address: NDArray[np.int32]
    offsets: NDArray[np.int64]
    values: NDArray[np.uint16]

    def values_of(self, row: int) -> NDArray[np.uint16]:
        """The values of one row."""
        return self.values[int(self.offsets[row]) : int(self.offsets[row + 1])]


def decode(batch: Batch, pdus: Pdus | None = None) -> Decoded:
    """The columns of a batch; `pdus` are its own, where somebody has them already."""
    return _Decoding(batch, Pdus(batch) if pdus is None else pdus).decoded()


@dataclass(frozen=True, slots=True, eq=False)
class _ValueSpans:
    """The values of some rows: where the first of each row's begins in the bytes, and how many there are."""

    rows: _Ints
    begins: _Ints
    counts: _Ints
    read: Callable[[_Decoding, _Ints, _Ints], NDArray[np.uint16]] | None
    """(begins, number of the value) to values; None for registers, which are copied as they stand."""


class _Decoding:
    """One batch on its way to columns."""

    def __init__(self, batch: Batch, pdus: Pdus) -> None:
        n = len(batch.rows)
        self.batch, self.pdus = batch, pdus
        self.address = np.full(n, -1, np.int32)
        self.quantity = np.full(n, -1, np.int32)
        self.area = np.zeros(n, np.uint8)
        self.value_address = np.full(n, -1, np.int32)
        self.counts = np.zeros(n, np.int64)
        self.blocks: list[_ValueSpans] = []

    def decoded(self) -> Decoded:
        """The columns."""
        rows, known = self.batch.rows, contents()
        kind = rows["kind"].astype(np.uint16)
        keys = kind << 8 | rows["function"]
        keys[(rows["exception"] > 0) & (kind == Kind.RESPONSE)] |= EXCEPTION
        for key in np.flatnonzero(np.bincount(keys)).tolist():
            code, role = key & 0xFF, _ROLES[key >> 8]
            found = None if role is None else known.get((code & ~EXCEPTION, role))
            if role is None or found is None:
                continue
            here = np.flatnonzero(keys == key)
            self.area[here] = AREA_CODES[found.area]
            if code & EXCEPTION:
                self._exceptions(known[code & ~EXCEPTION, Role.REQUEST], here)
            else:
                self._frames(found, here)
        offsets = np.concatenate(([0], np.cumsum(self.counts)))
        return Decoded(self.address, self.quantity, self.area, self.value_address, offsets, self._joined(offsets))

    def _exceptions(self, request: Contents, here: _Ints) -> None:
        """What their requests spoke of."""
        for place, column in ((request.address, self.address), (request.quantity, self.quantity)):
            if place is not None:
                column[here] = self._number(NumberRef(place.offset, asked=True), here)

    def _frames(self, found: Contents, here: _Ints) -> None:
        if found.address is not None:
            self.address[here] = self._number(found.address, here)
        if found.held is not None:
            self._values(found.held, here)
        elif found.listed:
            self._annotated(found.listed, here)
        if found.quantity is not None:
            self.quantity[here] = self._number(found.quantity, here)
        elif found.held is not None or found.listed:
            self.quantity[here] = self.counts[here]

    def _values(self, held: ValueRun, here: _Ints) -> None:
        begins = self.pdus.begins[here] + held.offset
        room = np.maximum(self.pdus.ends[here] - begins, 0)
        if held.count is None:
            counts, read = (room >= _WORD).astype(np.int64), _outputs if held.bits else None
        else:
            taken = self._number(NumberRef(held.count.offset), here, held.count.width) * held.count.scale - held.less
            octets = np.minimum(np.maximum(taken, 0), room)
            counts, read = (octets * 8, _bits) if held.bits else (octets // _WORD, None)
        if held.quantity is not None:
            wanted = self._number(held.quantity, here)
            counts = np.where(wanted >= 0, np.minimum(counts, wanted), counts)
        self.counts[here] = counts
        self.blocks.append(_ValueSpans(here, begins, counts, read))
        if held.start is not None:
            self.value_address[here] = self._number(held.start, here)

    def _annotated(self, names: frozenset[str], here: _Ints) -> None:
        """Values that have no fixed place, frame by frame: functions that do this are rare on a bus."""
        found = [list(values_listed(self.batch.frame(row).fields(), names)) for row in here.tolist()]
        counts = np.array([len(values) for values in found], np.int64)
        flat = np.array([value for values in found for value in values], np.uint16)
        self.counts[here] = counts
        self.blocks.append(_ValueSpans(here, np.cumsum(counts) - counts, counts, lambda _, begins, i: flat[begins + i]))

    def _number(self, place: NumberRef, here: _Ints, width: int = _WORD) -> _Ints:
        return self.pdus.number(place.offset, width, here, asked=place.asked)

    def _joined(self, offsets: _Ints) -> NDArray[np.uint16]:
        values = np.empty(int(offsets[-1]), ">u2")
        for block in self.blocks:
            to = offsets[block.rows]
            if block.read is None:
                octets = values.view(np.uint8)
                copy_pieces(octets, _WORD * to, self.pdus.data, block.begins, _WORD * block.counts)
                continue
            ends = np.cumsum(block.counts)
            within = np.arange(int(ends[-1]) if len(ends) else 0)
            within -= np.repeat(ends - block.counts, block.counts)
            out = np.repeat(to, block.counts)
            out += within
            values[out] = block.read(self, np.repeat(block.begins, block.counts), within)
        return values.astype(np.uint16)


def _bits(decoding: _Decoding, begins: _Ints, i: _Ints) -> NDArray[np.uint16]:
    begins += i >> 3
    found: NDArray[np.uint16] = (decoding.pdus.data.take(begins) >> (i & 7).astype(np.uint8) & 1).astype(np.uint16)
    return found


def _outputs(decoding: _Decoding, begins: _Ints, i: _Ints) -> NDArray[np.uint16]:
    begins += _WORD * i
    return (decoding.pdus.words.take(begins) > 0).astype(np.uint16)
