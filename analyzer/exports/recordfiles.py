"""The tables beside the frames as files: CSV, JSON lines and Parquet, a writer each."""

from __future__ import annotations

import csv
import io
from typing import TYPE_CHECKING, Any, ClassVar, Final

import orjson

from .records import Columns, RecordTable, record_arrow, record_schema, table_named
from .rowgroups import RowGroups, arrow_imported
from .sink import ExportError, ExportOptions, OutputStream, Sink
from .targets.csv import safe

if TYPE_CHECKING:
    from captures import Capture

    from ..core import Analysed


class RecordSink(Sink):
    """A table being written; a subclass says how its columns go into a file, and which it has besides the table's."""

    MORE: ClassVar[tuple[str, ...]] = ()

    def __init__(self, out: OutputStream, table: RecordTable, options: ExportOptions) -> None:
        self.out, self.options = out, options
        self.table = table.chosen(options.fields or (*table.kinds, *self.MORE))
        self._left = options.count

    def batch(self, analysed: Analysed) -> None:
        """The records of a batch."""
        columns = self.table.columns(analysed)
        columns = {name: values[: self._left] for name, values in columns.items()}
        self._left -= len(next(iter(columns.values())))
        self.full = self._left == 0
        if next(iter(columns.values())):
            self.write(columns)

    def write(self, columns: Columns) -> None:
        """Some records, at least one."""
        raise NotImplementedError


class CsvRecords(RecordSink):
    """A line a record, with its time for people at its end; text that a spreadsheet would run is made harmless."""

    MORE = ("time",)

    def __init__(self, out: OutputStream, table: RecordTable, options: ExportOptions) -> None:
        super().__init__(out, table, options)
        self.out.write(b"\xef\xbb\xbf" if options.bom else b"")
        self._line([list(self.table.kinds)])

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
        arrow = arrow_imported()
        self._schema = record_schema(self.table)
        self._groups = RowGroups(arrow.parquet.ParquetWriter(arrow.PythonFile(out, mode="w"), self._schema))

    def write(self, columns: Columns) -> None:
        self._groups.add(record_arrow(self._schema, columns))

    def close(self) -> None:
        self._groups.close()


_WRITERS: Final = {"csv": CsvRecords, "jsonl": JsonRecords, "parquet": ParquetRecords}
TABULAR: Final = tuple(_WRITERS)  # formats that hold them


def open_records(out: OutputStream, capture: Capture, options: ExportOptions, name: str) -> RecordSink:  # noqa: ARG001
    """The sink of a table other than the frames, in the format of that name. Raises ExportError."""

    table = table_named(options.table, options.charts)
    writer = _WRITERS.get(name)
    if writer is None:
        raise ExportError(f"the table {options.table} can be written as {', '.join(_WRITERS)}, not as {name}")
    return writer(out, table, options)
