"""Tables of records (`records.TABLES`) as files: CSV, JSON lines and Parquet, a writer each."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, Final

import orjson

from ..extras import needs
from .output import ExportError, OutputStream
from .records import Columns, RecordTable
from .sink import ExportOptions
from .targets.csv import safe

if TYPE_CHECKING:
    from captures import Block, Capture

    from ..core import Analysed
    from ..tables.batch import Batch

_GROUP: Final = 1 << 16  # rows of a Parquet row group, at least


class RecordSink:
    """A table being written; a subclass says how its columns go into a file."""

    def __init__(self, out: OutputStream, table: RecordTable, options: ExportOptions) -> None:
        self.out, self.table, self.options = out, table, options

    def block(self, block: Block) -> None:
        """Raw chunks are not in a table."""

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """Records are written with their batch."""

    def batch(self, analysed: Analysed) -> None:
        """The records of a batch."""
        columns = self.table.columns(analysed)
        if next(iter(columns.values())):
            self.write(columns)

    def write(self, columns: Columns) -> None:
        """Some records, at least one."""
        raise NotImplementedError

    def close(self) -> None:
        """What is left."""


class CsvRecords(RecordSink):
    """A line a record; text that a spreadsheet would run is made harmless."""

    def __init__(self, out: OutputStream, table: RecordTable, options: ExportOptions) -> None:
        super().__init__(out, table, options)
        self.out.write(b"\xef\xbb\xbf" if options.bom else b"")
        self._line([list(table.kinds)])

    def write(self, columns: Columns) -> None:
        cells = [
            list(map(_cell, column)) if kind in ("text", "flag") else column
            for column, kind in zip(columns.values(), self.table.kinds.values(), strict=True)
        ]
        self._line([list(row) for row in zip(*cells, strict=True)])

    def _line(self, rows: list[list[Any]]) -> None:
        text = io.StringIO()
        csv.writer(text, delimiter=self.options.delimiter, lineterminator="\n").writerows(rows)
        self.out.write(text.getvalue().encode())


def _cell(value: Any) -> Any:
    if isinstance(value, str):
        return safe(value)
    return str(value).lower() if isinstance(value, bool) else value


class JsonRecords(RecordSink):
    """An object a record."""

    def write(self, columns: Columns) -> None:
        names = list(columns)
        self.out.write(
            b"".join(
                orjson.dumps(dict(zip(names, row, strict=True))) + b"\n" for row in zip(*columns.values(), strict=True)
            )
        )


class ParquetRecords(RecordSink):
    """Typed columns; times are timestamps in UTC."""

    def __init__(self, out: OutputStream, table: RecordTable, options: ExportOptions) -> None:
        super().__init__(out, table, options)
        try:
            import pyarrow as pa
            from pyarrow.parquet import ParquetWriter
        except ImportError as error:
            raise ExportError(needs("parquet", "pyarrow", "columns")) from error
        self._pa = pa
        self._schema = record_schema(table)
        self._parts: list[Any] = []
        self._count = 0
        self._writer = ParquetWriter(pa.PythonFile(out, mode="w"), self._schema)

    def write(self, columns: Columns) -> None:
        self._parts.append(record_arrow(self._schema, columns))
        self._count += len(self._parts[-1])
        if self._count >= _GROUP:
            self._flush()

    def close(self) -> None:
        self._flush()
        self._writer.close()

    def _flush(self) -> None:
        if self._parts:
            self._writer.write_table(self._pa.Table.from_batches(self._parts, self._schema))
        self._parts, self._count = [], 0


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


def record_arrow(schema: Any, columns: Columns) -> Any:
    """Columns as an Arrow RecordBatch."""
    import pyarrow as pa

    return pa.record_batch([pa.array(columns[field.name], field.type) for field in schema], schema=schema)


def records_arrow(table: RecordTable, parts: Iterable[Columns]) -> Any:
    """A table in memory, as an Arrow Table."""
    import pyarrow as pa

    schema = record_schema(table)
    return pa.Table.from_batches([record_arrow(schema, columns) for columns in parts], schema)


_WRITERS: Final = {"csv": CsvRecords, "jsonl": JsonRecords, "parquet": ParquetRecords}


def open_records(out: OutputStream, capture: Capture, options: ExportOptions, name: str) -> RecordSink:  # noqa: ARG001
    """The sink of a table other than the frames, in the format of that name. Raises ExportError."""
    from .records import table_named

    table = table_named(options.table, options.charts)
    writer = _WRITERS.get(name)
    if writer is None:
        raise ExportError(f"the table {options.table} can be written as {', '.join(_WRITERS)}, not as {name}")
    return writer(out, table, options)
