"""The table of values with what register maps say of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from dissectors.maps import RegisterMap
from dissectors.maps.decoding import read_mapped

from ..registers.mapped import MappedColumn, mapped_columns
from ..tables.columns import AreaCode, decode
from ..tables.values import confirmed_values
from .output import ExportError
from .records import AREA_NAMES, TABLES, Columns, RecordTable
from .records import Kind as ColumnKind

if TYPE_CHECKING:
    from ..core import Analysed
    from ..tables.batch import Batch


def table_named(name: str, charts: Mapping[int, RegisterMap] | None) -> RecordTable:
    """A table of records, `values` by the register maps of units if there are any. Raises ExportError."""
    if name not in TABLES:
        raise ExportError(f"no table {name!r}; besides frames there are {', '.join(TABLES)}")
    return _mapped(charts) if charts and name == "values" else TABLES[name]


def _mapped(charts: Mapping[int, RegisterMap]) -> RecordTable:
    """The table `values` with what a map says: mapped values one row each, registers that no map has as they are."""
    plain = TABLES["values"]
    kinds: dict[str, ColumnKind] = {name: kind for name, kind in plain.kinds.items() if name != "index"}
    kinds |= {"words": "integer", "name": "text", "value": "number", "unit_of_measure": "text", "text": "text"}
    kinds["index"] = "integer"
    return RecordTable(kinds, lambda analysed: _columns(analysed, charts))


def _columns(analysed: Analysed, charts: Mapping[int, RegisterMap]) -> Columns:
    batch = analysed.batch
    decoded = decode(batch)
    records: list[tuple[Any, ...]] = []
    mapped: set[tuple[int, str, int]] = set()
    for column in mapped_columns(batch, decoded, charts):
        records += _records(batch, column)
        for register in range(column.row.address, column.row.end):
            mapped.update((answer, column.row.area, register) for answer in column.answers.tolist())
    confirmed = confirmed_values(batch, decoded)
    rows, address, values = confirmed.spread()
    areas = np.repeat(confirmed.area, confirmed.counts)
    times, ports, units = (batch.rows.column(name)[rows].tolist() for name in ("t_end_ns", "port", "unit"))
    numbered = batch.rows.index[rows].tolist()
    for row, area, at, raw, t, port, unit, index in zip(
        rows.tolist(), areas.tolist(), address.tolist(), values.tolist(), times, ports, units, numbered, strict=True
    ):
        name = AREA_NAMES[AreaCode(area)]
        if (row, name, at) not in mapped:
            records.append((row, t, port, unit, name, at, raw, 1, None, None, None, None, index))
    records.sort(key=lambda record: (record[0], record[4], record[5]))
    table = _mapped(charts)
    columns = list(zip(*records, strict=True))[1:] if records else [()] * len(table.kinds)
    return {name: list(column) for name, column in zip(table.kinds, columns, strict=True)}


def _records(batch: Batch, column: MappedColumn) -> list[tuple[Any, ...]]:
    row = column.row
    records = []
    for answer, words, value in zip(
        column.answers.tolist(), column.words.tolist(), column.values.tolist(), strict=True
    ):
        reading = read_mapped(row, words, None if row.scale_address is not None else 0)
        about = batch.rows.row(answer)
        raw = (
            sum(word << 16 * (len(words) - 1 - position) for position, word in enumerate(words))
            if len(words) <= 4
            else None
        )
        number = None if np.isnan(value) else value
        text = reading.text if row.type in ("enum", "bits", "text", "time") else None
        records.append(
            (answer, about.t_end_ns, about.port, column.unit, row.area, row.address, raw, len(words),
             row.name, number, row.unit or None, text, about.index)
        )  # fmt: skip
    return records
