"""Values by register maps, as columns: of every answer the mapped values that it holds whole, in their units.

One pass a map row over all the answers that hold it; nothing is an object a value.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, cast

import numpy as np
from numpy.typing import NDArray

from dissectors.maps import RegisterMap
from dissectors.maps.decoding import read_mapped
from dissectors.maps.model import MappedValue
from dissectors.values import Order

from ..registers.hypotheses import numbers, patterns
from ..tables.columns import AreaCode, Decoded, decode
from ..tables.values import ConfirmedValues, confirmed_values
from .records import AREA_NAMES, TABLES, Columns, RecordTable
from .records import Kind as ColumnKind

if TYPE_CHECKING:
    from ..core import Analysed
    from ..tables.batch import Batch

Ints = NDArray[np.int64]
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


def mapped_columns(batch: Batch, decoded: Decoded, charts: Mapping[int, RegisterMap]) -> Iterator[MappedColumn]:
    """Every mapped value that the answers of a batch hold, by unit and block."""
    confirmed = confirmed_values(batch, decoded)
    units = batch.rows["unit"][confirmed.rows].astype(np.int64)
    keys = (units << 3 | confirmed.area) << _ADDRESS_BITS | confirmed.address
    keys = keys << _COUNT_BITS | confirmed.counts
    order = np.argsort(keys, kind="stable")
    cuts = np.flatnonzero(np.diff(keys[order], prepend=-1))
    for part in np.split(order, cuts[1:]):
        if len(part) and (chart := charts.get(int(units[part[0]]))) is not None:
            yield from _block(confirmed, part, int(units[part[0]]), chart)


def _block(confirmed: ConfirmedValues, part: Ints, unit: int, chart: RegisterMap) -> Iterator[MappedColumn]:
    area = AREA_NAMES[AreaCode(int(confirmed.area[part[0]]))]
    address, count = int(confirmed.address[part[0]]), int(confirmed.counts[part[0]])
    table = confirmed.values[confirmed.begins[part][:, None] + np.arange(count)]
    for row in chart.within(area, address, count):
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
        tens = np.array([10**place for place in range(4 * row.length)], np.float64)
        found = np.where((digits > 9).any(axis=1), np.nan, digits @ tens)
    else:
        found = numbers(words, order, is_float=row.is_float, signed=row.is_signed)
    with np.errstate(all="ignore"):
        scaled: NDArray[np.float64] = found * row.scale + row.offset
        if power is not None:
            exponent = power.view(np.int16).astype(np.float64)
            scaled = np.where(np.abs(exponent) <= 10, found * row.scale * 10.0**exponent + row.offset, np.nan)
    return scaled


def mapped_table(charts: Mapping[int, RegisterMap]) -> RecordTable:
    """The table `values` with what a map says: mapped values one row each, registers that no map has as they are."""
    plain = TABLES["values"]
    kinds: dict[str, ColumnKind] = {name: kind for name, kind in plain.kinds.items() if name != "index"}
    kinds |= {"words": "integer", "name": "text", "value": "number", "unit_of_measure": "text", "text": "text"}
    kinds["index"] = "integer"
    return RecordTable(kinds, lambda analysed: _columns(analysed, charts))


def _columns(analysed: Analysed, charts: Mapping[int, RegisterMap]) -> Columns:
    batch = analysed.batch
    decoded = decode(batch)
    found: list[tuple[Any, ...]] = []
    taken: set[tuple[int, str, int]] = set()
    for column in mapped_columns(batch, decoded, charts):
        found += _records(batch, column)
        for held in range(column.row.address, column.row.end):
            taken.update((answer, column.row.area, held) for answer in column.answers.tolist())
    confirmed = confirmed_values(batch, decoded)
    rows, address, values = confirmed.spread()
    areas = np.repeat(confirmed.area, confirmed.counts)
    times, ports, units = (batch.rows[name][rows].tolist() for name in ("t_end", "port", "unit"))
    numbered = batch.rows["index"][rows].tolist()
    for row, area, at, raw, t, port, unit, index in zip(
        rows.tolist(), areas.tolist(), address.tolist(), values.tolist(), times, ports, units, numbered, strict=True
    ):
        name = AREA_NAMES[AreaCode(area)]
        if (row, name, at) not in taken:
            found.append((row, t, port, unit, name, at, raw, 1, None, None, None, None, index))
    found.sort(key=lambda record: (record[0], record[4], record[5]))
    table = mapped_table(charts)
    columns = list(zip(*found, strict=True))[1:] if found else [()] * len(table.kinds)
    return {name: list(column) for name, column in zip(table.kinds, columns, strict=True)}


def _records(batch: Batch, column: MappedColumn) -> list[tuple[Any, ...]]:
    row = column.row
    found = []
    for answer, words, value in zip(
        column.answers.tolist(), column.words.tolist(), column.values.tolist(), strict=True
    ):
        reading = read_mapped(row, words, None if row.scale_address is not None else 0)
        about = batch.rows[answer]
        raw = (
            sum(word << 16 * (len(words) - 1 - place) for place, word in enumerate(words)) if len(words) <= 4 else None
        )
        number = None if np.isnan(value) else value
        text = reading.text if row.type in ("enum", "bits", "text", "time") else None
        found.append(
            (answer, int(about["t_end"]), int(about["port"]), column.unit, row.area, row.address, raw, len(words),
             row.name, number, row.unit or None, text, int(about["index"]))
        )  # fmt: skip
    return found
