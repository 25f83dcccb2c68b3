"""Parquet: a row a frame in typed columns (`analyzer.tables`), for pandas, polars, DuckDB and their like."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

import numpy as np

from analyzer.exports.output import ExportError, Output
from analyzer.exports.sink import ExportOptions
from analyzer.frames import Batch

if TYPE_CHECKING:
    from captures import Block, Capture

_GROUP: Final = 1 << 17  # rows of a row group
_GROWING: Final = ("index", "start", "t_start_ns", "t_end_ns", "request_start")  # from row to row
_VARIED: Final = ("response_time_ns", "bytes", "values")  # of which a dictionary would help nobody


class _Groups:
    def __init__(self, out: Output, options: ExportOptions) -> None:
        try:
            from pyarrow import PythonFile, Table
            from pyarrow.parquet import ParquetWriter

            from analyzer import tables
        except ImportError as error:
            raise ExportError("parquet needs pyarrow: pip install 'rtuscope[columns]'") from error

        self._options = options
        self._record_batch = tables.record_batch
        self._schema = tables.schema(explain=options.explain)
        self._table = Table.from_batches
        self._parts: list[Any] = []
        self._count = 0
        self._batch: Batch | None = None
        self._chosen = np.zeros(0, np.bool_)
        few = [name for name in self._schema.names if name not in (*_GROWING, *_VARIED)]
        self._writer = ParquetWriter(
            PythonFile(out, mode="w"),
            self._schema,
            use_dictionary=[*few, "findings.list.element"],
            column_encoding=dict.fromkeys(_GROWING, "DELTA_BINARY_PACKED"),
            write_statistics=[name for name in self._schema.names if name not in ("bytes", "values", "findings")],
        )

    def block(self, block: Block) -> None:
        """Raw chunks are not in this format."""

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """Rows wait for the whole batch."""
        if self._batch is not batch:
            self._batch, self._chosen = batch, np.zeros(len(batch), np.bool_)
        self._chosen[first:last] = True

    def batch(self, batch: Batch) -> None:  # noqa: ARG002
        """The rows that came of it, in columns."""
        if self._batch is None:
            return
        options = self._options
        part = self._record_batch(self._batch, self._chosen, noise=options.noise, explain=options.explain)
        self._batch = None
        self._parts.append(part)
        self._count += len(part)
        if self._count >= _GROUP:
            self._write()

    def close(self) -> None:
        """The rest, and the file's footer."""
        if self._batch is not None:
            self.batch(self._batch)
        self._write()
        self._writer.close()

    def _write(self) -> None:
        if self._parts:
            self._writer.write_table(self._table(self._parts, self._schema), row_group_size=2 * _GROUP)
        self._parts, self._count = [], 0


def open_sink(out: Output, capture: Capture, options: ExportOptions) -> _Groups:  # noqa: ARG001
    """Row groups onto `out`."""
    return _Groups(out, options)
