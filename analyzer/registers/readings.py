"""What the registers of a bus were: the readings of each polled block as one table, in bounded memory; and by maps.

A block is what one request asks for (unit, area, address, quantity), or writes. Its readings are rows, its registers
columns. Of a block of which there were few readings all rows stay; of one of many the first stay, and rows evenly
apart over the whole time. Which stay depends on their number alone, so that a capture and the live bus, whatever the
sizes of their batches, end with the same tables. Counts, extremes and the newest words are exact.

By a map, a batch's answers are columns of the values that each holds whole, in their units of measure: one pass a map
row over all the answers that hold it; nothing is an object a value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints
from dissectors.maps.model import MapArea, MappedValue, RegisterMap
from dissectors.values import Order

from ..tables.batch import Batch
from ..tables.columns import AreaCode, Decoded, decode
from ..tables.values import ConfirmedValues, confirmed_values
from .hypotheses import numbers, patterns

Words = NDArray[np.uint16]
_FIRST: Final = 64  # readings of a block that stay, from its beginning
_APART: Final = 128  # and at most so many, evenly apart
_WAITING: Final = 1 << 22  # values that wait to be sorted into blocks, at most
AREA_OF_CODE: Final[dict[int, MapArea]] = {
    AreaCode.COILS: "coil",
    AreaCode.DISCRETE_INPUTS: "discrete",
    AreaCode.INPUT_REGISTERS: "input",
    AreaCode.HOLDING_REGISTERS: "holding",
}
_PAIR_FORMS: Final = (("u32", np.uint32), ("s32", np.int32), ("f32", np.float32))
_WRITES: Final = (5, 6, 15, 16, 22)  # functions whose answers confirm what a master wrote
_COUNT_BITS, _ADDRESS_BITS, _UNIT_BITS, _AREA_BITS = 16, 16, 8, 3
_FRAMES_AT_FIRST: Final = 48  # frames before anything is told
_FRAMES_MORE: Final = 1.5


def is_due(asked_at: int, frames: int) -> bool:
    """Whether there is so much more than when types were asked for; both in frames."""
    return frames >= max(_FRAMES_AT_FIRST, int(asked_at * _FRAMES_MORE) + 1)


@dataclass(slots=True, eq=False)
class BlockReadings:
    """The readings of one block. Rows of `words` are readings, columns registers; `times` are ns."""

    unit: int
    area: MapArea
    address: int
    quantity: int
    written: bool
    most: int = _APART
    count: int = 0
    first: list[Words] = field(default_factory=list)
    apart: Words = field(init=False)
    times: Ints = field(init=False)
    stride: int = 1
    changes: Ints = field(init=False)
    least: Words = field(init=False)
    greatest: Words = field(init=False)
    last: Words = field(init=False)
    first_ns: int = 0
    last_ns: int = 0
    extremes: dict[str, tuple[NDArray[Any], NDArray[Any]]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        width = self.quantity
        self.apart = np.zeros((0, width), np.uint16)
        self.times = np.zeros(0, np.int64)
        self.changes = np.zeros(width, np.int64)
        self.least = np.full(width, 0xFFFF, np.uint16)
        self.greatest = np.zeros(width, np.uint16)
        self.last = np.zeros(width, np.uint16)

    @property
    def key(self) -> tuple[int, MapArea, int, int]:
        return self.unit, self.area, self.address, self.quantity

    def add(self, rows: Words, times: Ints) -> None:
        """More readings, in the order of time."""
        if not self.count:
            self.first_ns = int(times[0])
            self.last = rows[0].copy()
        self.changes += rows[0] != self.last
        if len(rows) > 1:
            self.changes += (rows[1:] != rows[:-1]).sum(axis=0)
        np.minimum(self.least, rows.min(axis=0), out=self.least)
        np.maximum(self.greatest, rows.max(axis=0), out=self.greatest)
        self._add_extremes(rows)
        if self.count < _FIRST:
            self.first.append(rows[: _FIRST - self.count].copy())
        self._add_apart(rows, times)
        self.count += len(rows)
        self.last, self.last_ns = rows[-1].copy(), int(times[-1])

    def _add_apart(self, rows: Words, times: Ints) -> None:
        total, stride = self.count + len(rows), self.stride
        while -(-total // stride) > self.most:
            stride *= 2
        begin = -self.count % stride
        thin = stride // self.stride
        self.apart = np.concatenate((self.apart[::thin], rows[begin::stride]))
        self.times = np.concatenate((self.times[::thin], times[begin::stride]))
        self.stride = stride

    def _add_extremes(self, rows: Words) -> None:
        """Least and greatest of each register as a signed number, and of each two as numbers of 32 bits."""
        views: dict[str, NDArray[Any]] = {"s16": rows.view(np.int16)}
        if self.quantity > 1:
            first, second = rows[:, :-1].astype(np.uint32), rows[:, 1:].astype(np.uint32)
            for order, pair in (("ABCD", first << 16 | second), ("CDAB", second << 16 | first)):
                views |= {f"{kind} {order}": pair.view(form) for kind, form in _PAIR_FORMS}
        for name, view in views.items():
            low, high = np.fmin.reduce(view), np.fmax.reduce(view)
            if name in self.extremes:
                low, high = np.fmin(self.extremes[name][0], low), np.fmax(self.extremes[name][1], high)
            self.extremes[name] = low, high

    @property
    def series(self) -> tuple[Words, int]:
        """The rows that evidence is taken from, in order, and how many of them are the beginning: behind those, time
        goes back. All of a few readings; of many always the same number."""
        if self.count <= 2 * _FIRST and self.stride == 1:
            return self.apart, len(self.apart)
        first = np.concatenate(self.first)
        rows = np.linspace(0, len(self.apart) - 1, _FIRST).astype(np.int64)
        return np.concatenate((first, self.apart[rows])), len(first)


class RegisterReadings:
    """The blocks of a whole bus; `feed` takes batches as they come. Of a block `most` rows evenly apart stay."""

    def __init__(self, most: int = _APART) -> None:
        self._most = most
        self._waiting: list[tuple[Ints, Ints, Ints, Words]] = []
        self._count = 0
        self._blocks: dict[int, BlockReadings] = {}
        self.frames = 0

    def feed(self, batch: Batch) -> None:
        """Take in what the answers of a batch say."""
        self.frames += int(np.count_nonzero(batch.rows.index >= 0))
        values = confirmed_values(batch, decode(batch))
        if not len(values.rows):
            return
        written = np.isin(batch.rows.function[values.rows], _WRITES)
        keys = written.astype(np.int64) << _AREA_BITS | values.area
        keys = keys << _UNIT_BITS | batch.rows.unit[values.rows]
        keys = (keys << _ADDRESS_BITS | values.address) << _COUNT_BITS | values.counts
        self._waiting.append((keys, values.begins, batch.rows.t_end_ns[values.rows], values.values))
        self._count += len(values.values)
        if self._count >= _WAITING:
            self._sort()

    def _sort(self) -> None:
        """Put what waits into its blocks."""
        waiting, self._waiting, self._count = self._waiting, [], 0
        if not waiting:
            return
        shifts = np.cumsum([0, *(len(values) for _, _, _, values in waiting)])
        keys = np.concatenate([part[0] for part in waiting])
        begins = np.concatenate([part[1] + shift for part, shift in zip(waiting, shifts.tolist(), strict=False)])
        times = np.concatenate([part[2] for part in waiting])
        values = np.concatenate([part[3] for part in waiting])
        order = np.argsort(keys, kind="stable")
        ordered = keys[order]
        cuts = np.flatnonzero(ordered[1:] != ordered[:-1]) + 1
        for part in np.split(order, cuts):
            key = int(keys[part[0]])
            if key not in self._blocks:
                self._blocks[key] = _block(key, self._most)
            block = self._blocks[key]
            rows = np.lib.stride_tricks.sliding_window_view(values, block.quantity)[begins[part]]
            block.add(rows, times[part])

    def put(self, unit: int, area: MapArea, address: int, rows: Words, times: Ints | None = None) -> None:
        """Readings of one block that did not come in a batch."""
        code = next(code for code, name in AREA_OF_CODE.items() if name == area)
        key = ((int(code) << _UNIT_BITS | unit) << _ADDRESS_BITS | address) << _COUNT_BITS | rows.shape[1]
        if key not in self._blocks:
            self._blocks[key] = _block(key, self._most)
        self._blocks[key].add(rows, np.arange(len(rows), dtype=np.int64) if times is None else times)

    def __iter__(self) -> Iterator[BlockReadings]:
        """The blocks, by unit, area and address."""
        self._sort()
        return iter(sorted(self._blocks.values(), key=lambda block: (*block.key, block.written)))

    def __len__(self) -> int:
        self._sort()
        return len(self._blocks)


def _block(key: int, most: int) -> BlockReadings:
    quantity, key = key & (1 << _COUNT_BITS) - 1, key >> _COUNT_BITS
    address, key = key & (1 << _ADDRESS_BITS) - 1, key >> _ADDRESS_BITS
    unit, key = key & (1 << _UNIT_BITS) - 1, key >> _UNIT_BITS
    area, written = AREA_OF_CODE[key & (1 << _AREA_BITS) - 1], bool(key >> _AREA_BITS)
    return BlockReadings(unit, area, address, quantity, written, most)


@dataclass(frozen=True, slots=True, eq=False)
class MappedColumn:
    """The readings of one mapped value in a batch: the rows of its answers, its registers (n, length), its numbers in
    the unit of measure (NaN for a text, and where its scale register was not read with it)."""

    unit: int
    row: MappedValue
    answers: Ints
    words: NDArray[np.uint16]
    values: NDArray[np.float64]


def mapped_columns(
    batch: Batch,
    decoded: Decoded,
    charts: Mapping[int, RegisterMap],
    wanted: Callable[[MappedValue], bool] = lambda _: True,
) -> Iterator[MappedColumn]:
    """Every mapped value that the answers of a batch hold, or those that are `wanted`, by unit and block."""
    confirmed = confirmed_values(batch, decoded)
    units = batch.rows.unit[confirmed.rows].astype(np.int64)
    keys = (units << _AREA_BITS | confirmed.area) << _ADDRESS_BITS | confirmed.address
    keys = keys << _COUNT_BITS | confirmed.counts
    order = np.argsort(keys, kind="stable")
    cuts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    for part in np.split(order, cuts[1:]):
        if len(part) and (chart := charts.get(int(units[part[0]]))) is not None:
            yield from _columns_of_block(confirmed, part, int(units[part[0]]), chart, wanted)


def _columns_of_block(
    confirmed: ConfirmedValues, part: Ints, unit: int, chart: RegisterMap, wanted: Callable[[MappedValue], bool]
) -> Iterator[MappedColumn]:
    area = AREA_OF_CODE[AreaCode(int(confirmed.area[part[0]]))]
    address, count = int(confirmed.address[part[0]]), int(confirmed.counts[part[0]])
    rows = [row for row in chart.within(area, address, count) if wanted(row)]
    if not rows:
        return
    table = confirmed.values[confirmed.begins[part][:, None] + np.arange(count)]
    for row in rows:
        words = table[:, row.address - address : row.end - address]
        power: NDArray[np.uint16] | None = None
        if row.scale_address is not None and address <= row.scale_address < address + count:
            power = table[:, row.scale_address - address]
        yield MappedColumn(unit, row, confirmed.rows[part], words, mapped_numbers(row, words, power))


def mapped_numbers(
    row: MappedValue, words: NDArray[np.uint16], power: NDArray[np.uint16] | None = None
) -> NDArray[np.float64]:
    """The numbers that registers (n, length) hold by a map; NaN where there is none."""
    nothing: NDArray[np.float64] = np.full(len(words), np.nan)
    if row.type == "text" or (row.scale_address is not None and power is None):
        return nothing
    if row.length not in (1, 2, 4):
        return nothing
    order = cast(Order, row.order)
    if row.type.startswith("bcd"):
        digits = patterns(words, order)[:, None] >> np.arange(0, 16 * row.length, 4, dtype=np.uint64) & np.uint64(15)
        tens = np.array([10**digit for digit in range(4 * row.length)], np.float64)
        values = np.where((digits > 9).any(axis=1), np.nan, digits @ tens)
    else:
        values = numbers(words, order, is_float=row.is_float, signed=row.is_signed)
    with np.errstate(all="ignore"):
        scaled: NDArray[np.float64] = values * row.scale + row.offset
        if power is not None:
            exponent = power.view(np.int16).astype(np.float64)
            scaled = np.where(np.abs(exponent) <= 10, values * row.scale * 10.0**exponent + row.offset, np.nan)
    return scaled


def limits_broken(column: MappedColumn) -> NDArray[np.bool_]:
    """Which readings lie outside the limits of their map, by more than their last digit."""
    row = column.row
    edge = max(abs(row.minimum or 0), abs(row.maximum or 0), 1e-6)
    slack = 1e-6 * edge if row.is_float else abs(row.scale) * 0.51
    broken = np.zeros(len(column.values), np.bool_)
    with np.errstate(invalid="ignore"):
        if row.minimum is not None:
            broken |= column.values < row.minimum - slack
        if row.maximum is not None:
            broken |= column.values > row.maximum + slack
    return broken
