"""The newest value of every register, coil and input that was seen, what it was before that, and how it went so far.

Values come from good answers to reads, and from writes that were answered. Memory grows by the registers that were
seen; they are found by pages of 256 addresses of one unit and area. What registers mean is told by `meanings`.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.batch import Batch
from ..tables.columns import Decoded, decode
from ..tables.values import confirmed_values
from .table import PIECE

if TYPE_CHECKING:
    from .bus import Bus

_PAGE_BITS: Final = 8
_PAGE: Final = 1 << _PAGE_BITS
_ADDRESSES: Final = 1 << 16
_PAGES: Final = 1 << 18  # 256 units, 4 areas, 256 pages each
_AT_ONCE: Final = 1 << 13  # rows
_SAMPLES: Final = 32  # of each, an even number: the newest value in each of so many stretches of as many rows
_NO_SAMPLE: Final = -1
_Ints = NDArray[np.int64]


Spot = tuple[int, int, int]  # unit, area (an AreaCode less 1), address


@dataclass(frozen=True, slots=True)
class WatchedRegister:
    """One register, coil or input. `area` is an AreaCode less 1; `before` is None where it was seen once."""

    unit: int
    area: int
    address: int
    value: int
    before: int | None
    t_ns: int
    row: int

    @property
    def spot(self) -> Spot:
        """Where it is."""
        return self.unit, self.area, self.address

    @property
    def changed(self) -> bool:
        """Whether the newest value differs from the one before it."""
        return self.before is not None and self.before != self.value


class RegisterLog:
    """All of them."""

    def __init__(self) -> None:
        self._page_of = np.zeros(_PAGES, np.int32)  # by unit, area and the address's first byte
        self._slot_of = np.full(_PAGE, -1, np.int32)  # by page and second byte; the first page is of all not seen
        self._keys = np.zeros(0, np.int64)
        self._value = np.zeros(0, np.uint16)
        self._before = np.zeros(0, np.int32)
        self._t = np.zeros(0, np.int64)
        self._row = np.zeros(0, np.int32)
        self._samples = np.zeros((0, _SAMPLES), np.int32)
        self._first = -1  # the row where the first stretch begins
        self._last = -1  # the newest row
        self._stretch = 1  # rows in a stretch, a power of two

    def __len__(self) -> int:
        return int((self._row >= 0).sum())

    def feed(self, batch: Batch, numbers: _Ints, decoded: Decoded | None = None) -> None:
        """Take in the values of a batch; `numbers` are those of its rows in the model, `decoded` what they say."""
        keys, values, rows = _readings(batch, decoded)
        if not len(keys):
            return
        slots = self._slots(keys)
        n = len(slots)
        self._sample(slots, values, numbers[rows])
        newest = np.full(len(self._row), -1, np.int64)
        newest[slots] = np.arange(n)  # of several values of one register the last one stays
        fresh = np.flatnonzero(newest >= 0)
        last = newest[fresh]
        older = np.ones(n, np.bool_)
        older[last] = False
        before = np.where(self._row >= 0, self._value.astype(np.int32), -1)
        before[slots[older]] = values[older]
        self._before[fresh] = before[fresh]
        self._value[fresh] = values[last]
        self._t[fresh] = batch.rows.t_end_ns[rows[last]]
        self._row[fresh] = numbers[rows[last]]

    def _sample(self, slots: _Ints, values: _Ints, rows: _Ints) -> None:
        """Keep the newest value in each stretch of rows; these are twice as long when there is no room for more."""
        begins = self._first < 0
        if begins:
            self._first = int(rows[0])
        self._last = max(self._last, int(rows.max()))
        while self._last - self._first >= self._stretch * _SAMPLES:
            if begins:  # nothing is kept yet
                self._stretch *= 2
                continue
            pairs = self._samples.reshape(len(self._samples), -1, 2)
            merged = np.where(pairs[..., 1] == _NO_SAMPLE, pairs[..., 0], pairs[..., 1])
            self._samples = np.concatenate((merged, np.full_like(merged, _NO_SAMPLE)), axis=1)
            self._stretch *= 2
        places = np.maximum(rows - self._first, 0)
        places >>= self._stretch.bit_length() - 1
        places += slots * _SAMPLES
        self._samples.reshape(-1)[places] = values  # the last of several stays

    def samples(self, unit: int, area: int, address: int, words: int) -> tuple[int, NDArray[np.uint16]]:
        """What so many registers were in each stretch of the capture that one of them was told in, or between such.

        A line a stretch, and which stretch the first of them is; before it not all of them were known. No lines where
        some lie beyond the last address.
        """
        if address + words > _ADDRESSES:
            return 0, np.zeros((0, words), np.uint16)
        slots = self._known_slots((unit << 18 | area << 16) + address + np.arange(words))
        if slots.min() < 0:
            return 0, np.zeros((0, words), np.uint16)
        held = self._samples[slots]
        told = np.where(held == _NO_SAMPLE, 0, np.arange(_SAMPLES) + 1)
        newest = np.maximum.accumulate(told, axis=1) - 1  # a stretch without one is as the one before it
        end, known = int(told.max()), np.flatnonzero((newest >= 0).all(axis=0))
        begin = int(known[0]) if len(known) else end
        samples = np.take_along_axis(held, np.maximum(newest, 0), axis=1)[:, begin:end]
        return begin, samples.T.astype(np.uint16)

    @property
    def stretches(self) -> int:
        """How many stretches the capture has by now, of those that `samples` speaks of."""
        return (self._last - self._first) // self._stretch + 1

    def spots(self) -> list[Spot]:
        """Where each of them is, by unit, area and address."""
        keys = np.sort(self._keys[self._row >= 0])
        return list(zip(*((part).tolist() for part in (keys >> 18, keys >> 16 & 3, keys & 0xFFFF)), strict=True))

    def at(self, spot: Spot) -> WatchedRegister | None:
        """What is known of one; None where it was not seen."""
        key = (spot[0] << 18 | spot[1] << 16) + spot[2]
        slot = int(self._known_slots(np.array([key]))[0])
        row = -1 if slot < 0 else int(self._row[slot])
        if row < 0:
            return None
        before = int(self._before[slot])
        return WatchedRegister(
            *spot, int(self._value[slot]), None if before < 0 else before, int(self._t[slot]), row
        )  # fmt: skip

    def all(self) -> list[WatchedRegister]:
        """Every one, by unit, area and address."""
        return [register for spot in self.spots() if (register := self.at(spot)) is not None]

    def _places(self, keys: _Ints) -> _Ints:
        """Where `_slot_of` tells of registers."""
        return self._page_of.take(keys >> _PAGE_BITS).astype(np.int64) << _PAGE_BITS | keys & _PAGE - 1

    def _known_slots(self, keys: _Ints) -> _Ints:
        """Where registers are kept, -1 for those that were not seen."""
        places = self._places(keys)  # first: `_slot_of` has room for any page that there is
        return self._slot_of.take(places).astype(np.int64)

    def _slots(self, keys: _Ints) -> _Ints:
        """Where registers are kept from now on."""
        places = self._places(keys)
        if places.min() < _PAGE:
            self._add_pages(np.unique(keys[places < _PAGE] >> _PAGE_BITS))
        slots = self._known_slots(keys)
        if slots.min() < 0:
            self._add_registers(np.unique(keys[slots < 0]))
            slots = self._known_slots(keys)
        return slots

    def _add_pages(self, missing: _Ints) -> None:
        begin = len(self._slot_of) >> _PAGE_BITS
        self._slot_of = np.concatenate((self._slot_of, np.full(len(missing) * _PAGE, -1, np.int32)))
        self._page_of[missing] = begin + np.arange(len(missing))  # at last: another thread may look

    def _add_registers(self, keys: _Ints) -> None:
        room, begin = len(keys), len(self._keys)
        self._value = np.concatenate((self._value, np.zeros(room, np.uint16)))
        self._before = np.concatenate((self._before, np.full(room, -1, np.int32)))
        self._t = np.concatenate((self._t, np.zeros(room, np.int64)))
        self._samples = np.concatenate((self._samples, np.full((room, _SAMPLES), _NO_SAMPLE, np.int32)))
        self._keys = np.concatenate((self._keys, keys))
        self._row = np.concatenate((self._row, np.full(room, -1, np.int32)))
        self._slot_of[self._places(keys)] = begin + np.arange(room)  # at last: another thread may look

    @property
    def nbytes(self) -> int:
        columns = (
            self._page_of,
            self._slot_of,
            self._keys,
            self._value,
            self._before,
            self._t,
            self._row,
            self._samples,
        )
        return sum(column.nbytes for column in columns)


class RegisterSeries:
    """What `words` registers from an address on were, every reading of them: the answers of one unit that tell any."""

    def __init__(self, unit: int, area: int, address: int, words: int = 1) -> None:
        self.unit, self.area, self.address, self.words = unit, area, address, words
        self._parts: list[tuple[_Ints, _Ints, NDArray[np.uint16]]] = []
        self._last = np.full(words, -1, np.int64)
        self._rows_read = 0  # rows of the bus that were read
        self._reading = threading.Lock()  # a reading that nobody waits for any more ends at its next slice

    def extend(self, bus: Bus, stop: Callable[[], bool] = lambda: False) -> RegisterSeries:
        """Read on to the newest row, or until `stop`; of several threads one after the other."""
        with self._reading:
            for number, low, high in bus.table.slices(self._rows_read, bus.count):
                if stop():
                    break
                own = np.flatnonzero(bus.table.column(number, "unit")[low:high] == self.unit) + low
                for part in np.array_split(own, -(-len(own) // _AT_ONCE)) if len(own) else ():
                    self._add(bus.batch(part + number * PIECE), part + number * PIECE)
                self._rows_read = number * PIECE + high
        return self

    def _add(self, batch: Batch, rows: _Ints) -> None:
        keys, values, at = _readings(batch)
        area = self.unit << 18 | self.area << 16
        first, end = area + self.address, area + min(self.address + self.words, _ADDRESSES)
        mine = (keys >= first) & (keys < end)
        keys, values, at = keys[mine] - first, values[mine], at[mine]
        if not len(keys):
            return
        answers, line = np.unique(at, return_inverse=True)
        table = np.full((len(answers), self.words), -1, np.int64)
        table[line, keys] = values
        table = np.concatenate((self._last[None], table))
        newest = np.where(table >= 0, np.arange(len(table))[:, None], 0)  # a word that an answer lacks stays as it was
        table = np.take_along_axis(table, np.maximum.accumulate(newest), axis=0)
        self._last = table[-1]
        complete = (table[1:] >= 0).all(axis=1)
        answers = answers[complete]
        self._parts.append((batch.rows.t_end_ns[answers], rows[answers], table[1:][complete].astype(np.uint16)))

    def readings(self) -> tuple[_Ints, _Ints, NDArray[np.uint16]]:
        """Times in ns, rows of the answers, and the registers, one line a reading; oldest first."""
        empty = np.zeros(0, np.int64)
        nothing = empty, empty, np.zeros((0, self.words), np.uint16)
        t_ns, rows, values = zip(nothing, *self._parts, strict=True)
        return np.concatenate(t_ns), np.concatenate(rows), np.concatenate(values)


def _readings(batch: Batch, decoded: Decoded | None = None) -> tuple[_Ints, _Ints, _Ints]:
    """Values that stand for what a register is: key (unit, area, address), value, and row of the answer."""
    confirmed = confirmed_values(batch, decode(batch) if decoded is None else decoded)
    base = batch.rows.unit[confirmed.rows].astype(np.int64) << 18 | (confirmed.area.astype(np.int64) - 1) << 16
    rows, address, values = confirmed.spread()
    return np.repeat(base, confirmed.counts) | address, values.astype(np.int64), rows


AREA_WORDS: Final = ("coil", "discrete", "input", "holding")


def own_words(types: Mapping[Spot, str]) -> dict[tuple[int, str, int], str]:
    """The user's words as notes keep them, by unit, area's name and address."""
    return {(unit, AREA_WORDS[area], address): words for (unit, area, address), words in types.items()}
