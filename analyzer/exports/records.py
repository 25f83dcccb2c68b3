"""The tables beside the frames: transactions, values and findings, as columns of plain values.

A table is an entry of `TABLES`: its columns with their kinds, and a function that makes them of what was analysed. The
names and units are those of JSON lines, Parquet and Python alike; None is what is not there or not known.
`recordfiles` writes them to files.

Where register maps are given, the table of values has what they say of them, too.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Final, Literal

import numpy as np
import orjson
from numpy.typing import NDArray

from dissectors.functions import function_name
from dissectors.maps import RegisterMap
from dissectors.maps.model import read_mapped

from ..registers.readings import MappedColumn, mapped_columns
from ..tables.columns import AreaCode, decode
from ..tables.findings import described
from ..tables.transactions import Status
from ..tables.values import confirmed_values
from ..words import clock_text
from .chosen import chosen_names
from .sink import ExportError

if TYPE_CHECKING:
    from ..core import Analysed
    from ..tables.batch import Batch

Kind = Literal["integer", "number", "text", "flag", "time"]  # a time is ns since the epoch, or since the capture's zero
Columns = Mapping[str, list[Any]]
MadeColumns = Mapping[str, Any]  # lists, or arrays; masked ones where a value may be missing

AREA_NAMES: Final = {
    AreaCode.COILS: "coil",
    AreaCode.DISCRETE_INPUTS: "discrete",
    AreaCode.INPUT_REGISTERS: "input",
    AreaCode.HOLDING_REGISTERS: "holding",
}


@dataclass(frozen=True, slots=True)
class RecordTable:
    """A table: the kind of each column, in their order, and what makes them, all of one length."""

    kinds: Mapping[str, Kind]
    made: Callable[[Analysed], MadeColumns]

    def columns(self, analysed: Analysed) -> Columns:
        """Its columns as lists, None where a value is missing."""
        return {name: _listed(values) for name, values in self.made(analysed).items()}

    def chosen(self, fields: Sequence[str]) -> RecordTable:
        """The same of some columns; `time`, where asked for, puts its times as wall clock. Raises ExportError."""
        names = chosen_names(fields, (*self.kinds, "time"))
        clock = next(name for name, kind in self.kinds.items() if kind == "time")
        parts: dict[str, Callable[[MadeColumns], Any]] = {name: itemgetter(name) for name in self.kinds}
        parts["time"] = lambda columns: [clock_text(t_ns) or None for t_ns in _listed(columns[clock])]

        def narrowed(analysed: Analysed) -> MadeColumns:
            columns = self.made(analysed)
            return {name: parts[name](columns) for name in names}

        return RecordTable({name: self.kinds.get(name, "text") for name in names}, narrowed)


def _listed(values: Any) -> list[Any]:
    return values if isinstance(values, list) else values.tolist()


def _worded(codes: NDArray[Any], word: Callable[[int], str]) -> NDArray[np.object_]:
    """The word of each code, looked up once."""
    seen, which = np.unique(codes, return_inverse=True)
    return np.array([word(code) for code in seen.tolist()], object)[which]


def _transactions(analysed: Analysed) -> MadeColumns:
    rows = analysed.transactions
    answered = rows.response >= 0
    exact, low, high = rows.response_times(analysed.off_ns)
    return {
        "request": rows.request,
        "request_start": rows.start,
        "port": rows.port,
        "t_start_ns": rows.t_start_ns,
        "unit": rows.unit,
        "function": rows.function,
        "name": _worded(rows.function, function_name),
        "status": _worded(rows.status, lambda code: Status(code).name.lower()),
        "exception": np.ma.masked_array(rows.exception, rows.exception == 0),
        "retry": rows.retry,
        "late": rows.late,
        "mistaken": rows.mistaken,
        "unsure": rows.unsure,
        "response": np.ma.masked_array(rows.response, ~answered),
        "response_start": np.ma.masked_array(rows.response_start, ~answered),
        "response_time_ns": np.ma.masked_array(exact, exact < 0),
        "response_time_low_ns": np.ma.masked_array(low, low < 0),
        "response_time_high_ns": np.ma.masked_array(high, high < 0),
    }


def _values(analysed: Analysed) -> MadeColumns:
    batch = analysed.batch
    confirmed = confirmed_values(batch, decode(batch))
    rows, address, values = confirmed.spread()
    areas = np.array([AREA_NAMES.get(AreaCode(code), "") for code in range(len(AreaCode))], object)
    return {
        "t_ns": batch.rows.t_end_ns[rows],
        "port": batch.rows.port[rows],
        "unit": batch.rows.unit[rows],
        "area": areas[np.repeat(confirmed.area, confirmed.counts)],
        "address": address,
        "raw": values,
        "index": batch.rows.index[rows],
    }


def _findings(analysed: Analysed) -> Columns:
    records: list[dict[str, Any]] = [
        {name: getattr(finding, name) for name in TABLES["findings"].kinds} for finding in described(analysed.findings)
    ]
    for record in records:
        of_bus = {"start": None, "length": None} if record["start"] < 0 else {}
        untold = {name: record[name] or None for name in ("cause", "remedy", "clause")}
        numbers = orjson.dumps(dict(record["numbers"])).decode()
        record |= of_bus | untold | {"severity": record["severity"].name.lower(), "numbers": numbers}
    return {name: [record[name] for record in records] for name in TABLES["findings"].kinds}


TABLES: Final[Mapping[str, RecordTable]] = {
    "transactions": RecordTable(
        {
            "request": "integer",  # index of the request's frame
            "request_start": "integer",
            "port": "integer",
            "t_start_ns": "time",
            "unit": "integer",
            "function": "integer",
            "name": "text",
            "status": "text",
            "exception": "integer",
            "retry": "flag",
            "late": "flag",
            "mistaken": "flag",  # the client took the answer for that to another request
            "unsure": "flag",  # nobody can tell whether this is its answer
            "response": "integer",  # index of the answer's frame
            "response_start": "integer",
            "response_time_ns": "integer",  # where the tap's clock carries it; else it lies between the next two
            "response_time_low_ns": "integer",
            "response_time_high_ns": "integer",
        },
        _transactions,
    ),
    "values": RecordTable(
        {
            "t_ns": "time",  # end of the answer that tells it
            "port": "integer",
            "unit": "integer",
            "area": "text",  # coil, discrete, input, holding
            "address": "integer",  # zero-based
            "raw": "integer",
            "index": "integer",  # of the answer's frame
        },
        _values,
    ),
    "findings": RecordTable(
        {
            "code": "text",
            "severity": "text",
            "t_ns": "time",
            "index": "integer",  # of the frame; none for noise and the bus as a whole
            "port": "integer",
            "start": "integer",
            "length": "integer",
            "text": "text",
            "cause": "text",
            "remedy": "text",
            "clause": "text",
            "numbers": "text",  # JSON
        },
        _findings,
    ),
}


def table_named(name: str, charts: Mapping[int, RegisterMap] | None) -> RecordTable:
    """A table of records, `values` by the register maps of units if there are any. Raises ExportError."""
    if name not in TABLES:
        raise ExportError(f"no table {name!r}; besides frames, available: {', '.join(TABLES)}")
    return _mapped(charts) if charts and name == "values" else TABLES[name]


def _mapped(charts: Mapping[int, RegisterMap]) -> RecordTable:
    """The table `values` with what a map says: mapped values one row each, registers that no map has as they are."""
    plain = TABLES["values"]
    kinds: dict[str, Kind] = {name: kind for name, kind in plain.kinds.items() if name != "index"}
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


def record_schema(table: RecordTable) -> Any:
    """The Arrow schema of a table."""
    import pyarrow as pa

    kinds = {
        "integer": pa.int64(),
        "number": pa.float64(),
        "text": pa.string(),
        "flag": pa.bool_(),
        "time": pa.timestamp("ns", "UTC"),
    }
    return pa.schema([(name, kinds[kind]) for name, kind in table.kinds.items()])


def record_arrow(schema: Any, columns: MadeColumns) -> Any:
    """Columns as an Arrow RecordBatch."""
    import pyarrow as pa

    return pa.record_batch([_arrow(columns[field.name], field.type) for field in schema], schema=schema)


def _arrow(values: Any, kind: Any) -> Any:
    import pyarrow as pa

    if isinstance(values, list):
        return pa.array(values, kind)
    missing = np.ma.getmaskarray(values) if isinstance(values, np.ma.MaskedArray) else None
    made = pa.array(np.asarray(values), mask=missing)
    return made if made.type == kind else made.cast(kind)


def records_arrow(table: RecordTable, parts: Iterable[MadeColumns]) -> Any:
    """A table in memory, as an Arrow Table."""
    import pyarrow as pa

    schema = record_schema(table)
    return pa.Table.from_batches([record_arrow(schema, columns) for columns in parts], schema)
