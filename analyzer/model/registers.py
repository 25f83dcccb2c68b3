"""The newest value of every register, coil and input that was seen, and what it was before that.

Values come from good answers to reads, and from writes that were answered. Memory grows by pages of 256 addresses of
one unit and area, where something was seen.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from analyzer.columns import Decoded, decode
from analyzer.frames import Batch, Kind

if TYPE_CHECKING:
    from .bus import Bus

_PAGE: Final = 256
_PAGES: Final = 1 << 18  # 256 units, 4 areas, 256 pages each
_Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Reading:
    """A value as it was seen: at `t_ns`, in the frame at `row`."""

    t_ns: int
    row: int
    value: int


@dataclass(frozen=True, slots=True)
class Register:
    """One register, coil or input. `area` is an AreaCode less 1; `before` is None where it was seen once."""

    unit: int
    area: int
    address: int
    value: int
    before: int | None
    t_ns: int
    row: int

    @property
    def changed(self) -> bool:
        """Whether the newest value differs from the one before it."""
        return self.before is not None and self.before != self.value


class Registers:
    """All of them."""

    def __init__(self) -> None:
        self._page_of = np.full(_PAGES, -1, np.int32)
        self._pages: list[int] = []
        self._value = np.zeros(0, np.uint16)
        self._before = np.zeros(0, np.int32)
        self._t = np.zeros(0, np.int64)
        self._row = np.zeros(0, np.int32)

    def __len__(self) -> int:
        return int((self._row >= 0).sum())

    def feed(self, bus: Bus, batch: Batch, first: int) -> None:
        """Take in the values of a batch, whose rows stand in the model from `first` on."""
        keys, values, rows = _confirmed(bus, batch)
        if not len(keys):
            return
        slots = self._slots(keys)
        n = len(slots)
        newest = np.full(len(self._row), -1, np.int64)
        newest[slots] = np.arange(n)  # of several values of one register the last one stays
        seen = np.flatnonzero(newest >= 0)
        last = newest[seen]
        older = np.ones(n, np.bool_)
        older[last] = False
        before = np.where(self._row >= 0, self._value.astype(np.int32), -1)
        before[slots[older]] = values[older]
        self._before[seen] = before[seen]
        self._value[seen] = values[last]
        self._t[seen] = batch.rows["t_end"][rows[last]]
        self._row[seen] = rows[last] + first

    def all(self) -> list[Register]:
        """Every one, by unit, area and address."""
        slots = np.flatnonzero(self._row >= 0)
        keys = np.array(self._pages, np.int64)[slots // _PAGE] * _PAGE + slots % _PAGE
        order = np.argsort(keys)
        columns = (keys, self._value[slots], self._before[slots], self._t[slots], self._row[slots])
        return [
            Register(key >> 18, key >> 16 & 3, key & 0xFFFF, value, None if before < 0 else before, t, row)
            for key, value, before, t, row in zip(*(column[order].tolist() for column in columns), strict=True)
        ]

    def _slots(self, keys: _Ints) -> _Ints:
        pages = keys // _PAGE
        missing = np.unique(pages[self._page_of[pages] < 0])
        if len(missing):
            room = len(missing) * _PAGE
            self._page_of[missing] = len(self._pages) + np.arange(len(missing))
            self._value = np.concatenate((self._value, np.zeros(room, np.uint16)))
            self._before = np.concatenate((self._before, np.full(room, -1, np.int32)))
            self._t = np.concatenate((self._t, np.zeros(room, np.int64)))
            self._row = np.concatenate((self._row, np.full(room, -1, np.int32)))
            self._pages.extend(missing.tolist())
        return self._page_of[pages].astype(np.int64) * _PAGE + keys % _PAGE

    @property
    def nbytes(self) -> int:
        return int(self._page_of.nbytes + self._value.nbytes + self._before.nbytes + self._t.nbytes + self._row.nbytes)


def history(bus: Bus, register: Register, most: int = 512, stop: Callable[[], bool] = lambda: False) -> list[Reading]:
    """What a register's value was, oldest first: the newest `most` readings, of the newest million rows at most."""
    found: list[Reading] = []
    key = register.unit << 18 | register.area << 16 | register.address
    last, limit = bus.count, max(0, bus.count - (1 << 20))
    while last > limit and len(found) < most and not stop():
        begin = max(limit, last - (1 << 13))
        for first, batch in reversed(list(bus.batches(begin, last))):
            keys, values, rows = _confirmed(bus, batch, register.unit)
            here = np.flatnonzero(keys == key)[::-1]
            found.extend(
                Reading(int(batch.rows["t_end"][rows[i]]), first + int(rows[i]), int(values[i])) for i in here.tolist()
            )
        last = begin
    return found[:most][::-1]


def _confirmed(bus: Bus, batch: Batch, unit: int | None = None) -> tuple[_Ints, _Ints, _Ints]:
    """Values that stand for what a register is: key (unit, area, address), value, and place of the answer."""
    parts = list(_answers(bus, batch, unit))
    if not parts:
        nothing = np.zeros(0, np.int64)
        return nothing, nothing, nothing
    keys, values, rows = (np.concatenate(column) for column in zip(*parts, strict=True))
    order = np.argsort(rows, kind="stable") if len(parts) > 1 else slice(None)
    return keys[order], values[order], rows[order]


def _answers(bus: Bus, batch: Batch, unit: int | None) -> Iterator[tuple[_Ints, _Ints, _Ints]]:
    rows, decoded = batch.rows, decode(batch)
    good = (rows["kind"] == Kind.RESPONSE) & (rows["request"] >= 0) & rows["check"] & (rows["exception"] == 0)
    if unit is not None:
        good &= rows["unit"] == unit
    answers = np.flatnonzero(good)
    yield _spread(batch, decoded, answers, answers)
    # What an answer confirms: the values of its request.
    frames = np.flatnonzero(rows["index"] >= 0)
    at = np.searchsorted(rows["index"][frames], rows["request"][answers])
    asked = frames[np.minimum(at, len(frames) - 1)] if len(frames) else answers
    here = rows["index"][asked] == rows["request"][answers]
    yield _spread(batch, decoded, asked[here], answers[here])
    away = answers[~here]  # few: their requests came in batches before
    numbers = bus.table.rows_of_frames(rows["request"][away])
    for number, answer in zip(numbers.tolist(), away.tolist(), strict=True):
        if number >= 0:
            request = bus.batch(np.array([number]))
            yield _spread(request, decode(request), np.array([0]), np.array([answer]))


def _spread(batch: Batch, decoded: Decoded, rows: _Ints, answers: _Ints) -> tuple[_Ints, _Ints, _Ints]:
    """The values of `rows`, said at `answers`."""
    known = (decoded.area[rows] > 0) & (decoded.value_address[rows] >= 0)
    rows, answers = rows[known], answers[known]
    counts = decoded.offsets[rows + 1] - decoded.offsets[rows]
    within = np.arange(int(counts.sum())) - np.repeat(np.cumsum(counts) - counts, counts)
    base = batch.rows["unit"][rows].astype(np.int64) << 18 | (decoded.area[rows].astype(np.int64) - 1) << 16
    address = np.repeat(decoded.value_address[rows], counts) + within
    keys = np.repeat(base, counts) | (address & 0xFFFF)
    values = decoded.values[np.repeat(decoded.offsets[rows], counts) + within].astype(np.int64)
    return keys, values, np.repeat(answers, counts)
