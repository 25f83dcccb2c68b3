"""What the frames of a batch say, as columns: addresses, quantities and values, decoded without an object a frame.

Where things stand in a frame comes from the declarations (`dissectors.layout`), so that a vendor's function is decoded
like a public one; annotation of a single frame gives the same answer. A number that a cut frame does not reach is -1,
and of a cut block the whole values that are there are given, as annotation does.

Array code reads PDUs where they stand: those of RTU and TCP in the batch's own bytes. What does not stand there is put
behind them: the PDUs of ASCII frames, and those of requests in a batch before.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.ragged import copy_pieces, counted_on
from dissectors.columnar import register_runs
from dissectors.envelopes import MBAP
from dissectors.layout import Contents, NumberRef, ValueRun, contents, values_listed
from dissectors.length_rules import Role
from dissectors.limits import EXCEPTION

from .batch import Batch, adu_of
from .schema import Kind, Protocol

_Ints = NDArray[np.int64]
_CHECK: Final = 2  # bytes of the CRC


class Pdus:
    """The PDUs of a batch: of row i `data[begins[i] : ends[i]]`, the function code first.

    `asked_begins` and `asked_ends` are those of its request, -1 where none is known. Noise rows have no meaning.
    """

    def __init__(self, batch: Batch) -> None:
        rows = batch.rows
        self.batch = batch
        self._more: list[bytes] = []
        self._size = len(batch.data)
        self.begins: _Ints = rows.at + 1  # behind the unit
        self.ends: _Ints = rows.at + rows.length - _CHECK
        if (protocol := rows.protocol).any():
            networked = protocol == Protocol.TCP
            self.begins[networked] += MBAP - 1
            self.ends[networked] += _CHECK
            self._spelt()
        self.asked_begins, self.asked_ends = self._requests()
        self.data = batch.data
        if self._more:
            self.data = np.concatenate((batch.data, np.frombuffer(b"".join(self._more), np.uint8)))

    @cached_property
    def words(self) -> NDArray[np.uint16]:
        """The big-endian number that begins at each byte."""
        return words_of(self.data)

    def number(self, offset: int, width: int, rows: _Ints, *, asked: bool = False) -> _Ints:
        """A number of 1 or 2 bytes at this offset of some rows' PDUs, or of their requests'; -1 where there is none."""
        begins, ends = (self.asked_begins, self.asked_ends) if asked else (self.begins, self.ends)
        at = begins[rows]
        at += offset
        short = at + width > ends[rows]
        at[short] = 0
        value: _Ints = (self.data if width == 1 else self.words).take(at).astype(np.int64)
        value[short] = -1
        return value

    def _requests(self) -> tuple[_Ints, _Ints]:
        """Where the PDU of each row's request begins and ends in the bytes; -1 and -1 for none."""
        rows = self.batch.rows
        begins, ends = np.full(len(rows), -1, np.int64), np.full(len(rows), -1, np.int64)
        requested = rows.request.copy()
        answers = np.flatnonzero(requested >= 0)
        if not len(answers):
            return begins, ends
        index = rows.index.copy()
        frames = np.flatnonzero(index >= 0)
        requested = requested[answers]
        numbers = index[frames]
        if numbers[-1] - numbers[0] == len(frames) - 1:  # one after the other, as long as nobody took some away
            at = requested - numbers[0]
            inside = (at >= 0) & (at < len(frames))
        else:
            at = np.searchsorted(numbers, requested)
            inside = numbers[np.minimum(at, len(frames) - 1)] == requested
        request = frames[np.where(inside, at, 0)]
        if not inside.all():
            begins[answers[inside]], ends[answers[inside]] = self.begins[request[inside]], self.ends[request[inside]]
        else:
            begins[answers], ends[answers] = self.begins[request], self.ends[request]
        for row, index in zip(answers[~inside].tolist(), requested[~inside].tolist(), strict=True):
            if (captured := self.batch.earlier.get(index)) is not None:
                adu = adu_of(captured, int(rows.protocol[row]))
                begins[row], ends[row] = self._put(adu.pdu)
        return begins, ends

    def _spelt(self) -> None:
        """ASCII frames as the bytes that their digits stand for."""
        for row in np.flatnonzero(self.batch.rows.protocol == Protocol.ASCII).tolist():
            if self.batch.rows.kind[row] != Kind.NOISE:
                adu = adu_of(self.batch.bytes_of(row), Protocol.ASCII)
                self.begins[row], self.ends[row] = self._put(adu.pdu)

    def _put(self, pdu: bytes) -> tuple[int, int]:
        """A PDU put behind the batch's bytes: where it begins and ends."""
        self._more.append(pdu)
        self._size += len(pdu)
        return self._size - len(pdu), self._size


def words_of(data: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """The big-endian number that begins at each byte, the last one's with a zero behind it; one at least."""
    words = np.zeros(max(len(data), 1), np.uint16)
    words[: len(data)] = data
    words <<= 8
    words[: max(len(data) - 1, 0)] |= data[1:]
    return words


_WORD: Final = 2  # bytes of a register
_ROLES: Final = {int(Kind.NOISE): None, int(Kind.REQUEST): Role.REQUEST, int(Kind.RESPONSE): Role.RESPONSE}
_KINDS: Final = {role: kind for kind, role in _ROLES.items() if role is not None}


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
class ValueSpans:
    """The values of some rows: where the first of each row's begins in the bytes, and how many there are."""

    rows: _Ints
    begins: _Ints
    counts: _Ints
    read: Callable[[Pdus, _Ints, _Ints], NDArray[np.uint16]] | None
    """(bytes, begins, number of the value) to values; None for registers, which stand there as they are."""
    area: AreaCode

    @property
    def is_bits(self) -> bool:
        """Whether no value is but 0 or 1."""
        return self.read in (_bits, _outputs)

    def each(self, pdus: Pdus) -> tuple[_Ints, _Ints, NDArray[np.uint16]]:
        """Value by value: which of `rows` it is of, its number there, itself. Not of registers."""
        assert self.read is not None
        within = counted_on(self.counts)
        return (
            np.repeat(np.arange(len(self.rows)), self.counts),
            within,
            self.read(pdus, np.repeat(self.begins, self.counts), within),
        )


class HeldValues:
    """Where the values of a batch's rows lie in its bytes: for who only asks which rows have some, or such ones."""

    def __init__(self, batch: Batch) -> None:
        self._batch = batch
        self.pdus = Pdus(batch)

    def spans(self, among: NDArray[np.bool_] | None = None) -> list[ValueSpans]:
        """The places of the values that `decode` gives.

        `among` is a mask of rows that are enough (None: all); values without a fixed place come in any case.
        """
        return _Decoding(self._batch, self.pdus).held(among)


def unplaced_keys() -> NDArray[np.bool_]:
    """By `kind << 8 | function`: whether values of such frames have no fixed place."""
    unplaced = np.zeros(len(_ROLES) << 8, np.bool_)
    for (code, role), content in contents().items():
        unplaced[_KINDS[role] << 8 | code] = bool(content.listed)
    return unplaced


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
        self.blocks: list[ValueSpans] = []

    def decoded(self) -> Decoded:
        """The columns."""
        declared = contents()
        for code, content, selected in self._sides():
            self.area[selected] = AREA_CODES[content.area]
            if code & EXCEPTION:
                self._exceptions(declared[code & ~EXCEPTION, Role.REQUEST], selected)
            else:
                self._frames(content, selected)
        offsets = np.concatenate(([0], np.cumsum(self.counts)))
        return Decoded(self.address, self.quantity, self.area, self.value_address, offsets, self._joined(offsets))

    def held(self, among: NDArray[np.bool_] | None) -> list[ValueSpans]:
        """The values' places alone."""
        for code, content, selected in self._sides(among):
            if not code & EXCEPTION:
                self._contained(content, selected)
        return self.blocks

    def _sides(self, among: NDArray[np.bool_] | None = None) -> Iterator[tuple[int, Contents, _Ints]]:
        """The rows (ascending) of each declared function code and role, exceptions by their code with the high bit.

        `among`: of those rows alone, where values have their place.
        """
        rows, declared = self.batch.rows, contents()
        keys = rows.kind.astype(np.uint16) << 8 | rows.function
        keys[(rows.exception > 0) & (rows.kind == Kind.RESPONSE)] |= EXCEPTION
        chosen = None
        if among is not None:
            unplaced = unplaced_keys()
            chosen = np.flatnonzero(among | unplaced[keys] if unplaced.any() else among)
            keys = keys[chosen]
        order = np.argsort(keys, kind="stable")  # short keys sort in linear time
        ordered = keys[order]
        order = order if chosen is None else chosen[order]
        cuts = [0, *(np.flatnonzero(ordered[1:] != ordered[:-1]) + 1).tolist(), len(ordered)]
        for first, last in pairwise(cuts):
            key = int(ordered[first]) if first < last else 0
            code, side = key & 0xFF, _ROLES[key >> 8]
            said = None if side is None else declared.get((code & ~EXCEPTION, side))
            if said is not None:
                yield code, said, order[first:last]

    def _exceptions(self, request: Contents, rows: _Ints) -> None:
        """What their requests spoke of."""
        for reference, column in ((request.address, self.address), (request.quantity, self.quantity)):
            if reference is not None:
                column[rows] = self._number(NumberRef(reference.offset, asked=True), rows)

    def _frames(self, content: Contents, rows: _Ints) -> None:
        if content.address is not None:
            self.address[rows] = self._number(content.address, rows)
        self._contained(content, rows)
        if content.held is not None and content.held.start is not None:
            self.value_address[rows] = self._number(content.held.start, rows)
        if content.quantity is not None:
            self.quantity[rows] = self._number(content.quantity, rows)
        elif content.held is not None or content.listed:
            self.quantity[rows] = self.counts[rows]

    def _contained(self, content: Contents, rows: _Ints) -> None:
        if content.held is not None:
            self._values(content.held, rows, AREA_CODES[content.area])
        elif content.listed:
            self._listed(content, rows)

    def _values(self, run: ValueRun, rows: _Ints, area: AreaCode) -> None:
        begins = self.pdus.begins[rows] + run.offset
        room = np.maximum(self.pdus.ends[rows] - begins, 0)
        if run.count is None:
            counts, read = (room >= _WORD).astype(np.int64), _outputs if run.bits else None
        else:
            stated = self._number(NumberRef(run.count.offset), rows, run.count.width) * run.count.scale - run.less
            octets = np.minimum(np.maximum(stated, 0), room)
            counts, read = (octets * 8, _bits) if run.bits else (octets // _WORD, None)
        if run.quantity is not None:
            wanted = self._number(run.quantity, rows)
            counts = np.where(wanted >= 0, np.minimum(counts, wanted), counts)
        self.counts[rows] = counts
        self.blocks.append(ValueSpans(rows, begins, counts, read, area))

    def _listed(self, content: Contents, rows: _Ints) -> None:
        """Values that have no fixed place: found in arrays, or frame by frame where only annotation can."""
        if (runs := register_runs(content.declaration)) is None:
            frames = map(self.batch.frame, rows.tolist())
            listings = [list(values_listed(frame.fields(), content.listed)) for frame in frames]
            counts = np.array([len(values) for values in listings], np.int64)
            flat = np.array([value for values in listings for value in values], np.uint16)
        else:
            pdus = self.pdus
            begins = pdus.begins[rows]
            is_other = pdus.data.take(begins) & EXCEPTION > 0  # a request of a code that no request has
            pdu, begins, lengths = runs(pdus.data, begins + 1, np.where(is_other, begins, pdus.ends[rows]))
            counts = np.bincount(pdu, lengths, len(rows)).astype(np.int64)
            flat = pdus.words.take(np.repeat(begins, lengths) + 2 * counted_on(lengths))
        self.counts[rows] = counts
        begins = np.cumsum(counts) - counts
        area = AREA_CODES[content.area]
        self.blocks.append(ValueSpans(rows, begins, counts, lambda _, begins, i: flat[begins + i], area))

    def _number(self, reference: NumberRef, rows: _Ints, width: int = _WORD) -> _Ints:
        return self.pdus.number(reference.offset, width, rows, asked=reference.asked)

    def _joined(self, offsets: _Ints) -> NDArray[np.uint16]:
        values = np.empty(int(offsets[-1]), ">u2")
        for block in self.blocks:
            to = offsets[block.rows]
            if block.read is None:
                octets = values.view(np.uint8)
                copy_pieces(octets, _WORD * to, self.pdus.data, block.begins, _WORD * block.counts)
                continue
            of, within, told = block.each(self.pdus)
            values[to[of] + within] = told
        return values.astype(np.uint16)


def _bits(pdus: Pdus, begins: _Ints, i: _Ints) -> NDArray[np.uint16]:
    begins += i >> 3
    bits: NDArray[np.uint16] = (pdus.data.take(begins) >> (i & 7).astype(np.uint8) & 1).astype(np.uint16)
    return bits


def _outputs(pdus: Pdus, begins: _Ints, i: _Ints) -> NDArray[np.uint16]:
    begins += _WORD * i
    return (pdus.words.take(begins) > 0).astype(np.uint16)
