"""Values by register maps, as columns: of every answer the mapped values that it holds whole, in their units.

One pass a map row over all the answers that hold it; nothing is an object a value.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from captures.ragged import Ints
from dissectors.maps.model import MappedValue, RegisterMap
from dissectors.values import Order

from ..tables.batch import Batch
from ..tables.columns import AreaCode, Decoded
from ..tables.values import ConfirmedValues, confirmed_values
from .hypotheses import numbers, patterns
from .readings import AREA_OF_CODE

_COUNT_BITS: Final = 11
_ADDRESS_BITS: Final = 16


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
    keys = (units << 3 | confirmed.area) << _ADDRESS_BITS | confirmed.address
    keys = keys << _COUNT_BITS | confirmed.counts
    order = np.argsort(keys, kind="stable")
    cuts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    for part in np.split(order, cuts[1:]):
        if len(part) and (chart := charts.get(int(units[part[0]]))) is not None:
            yield from _block(confirmed, part, int(units[part[0]]), chart, wanted)


def _block(
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
