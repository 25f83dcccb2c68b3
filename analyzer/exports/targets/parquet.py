"""Parquet: a row a frame in typed columns (`analyzer.exports.arrow`), for pandas, polars, DuckDB and their like."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from ..chosen import chosen_names
from ..rowgroups import GROUP, RowGroups, arrow_imported
from ..sink import ExportOptions, OutputStream, Sink

if TYPE_CHECKING:
    from captures import Capture

    from ...core import Analysed

BINARY: Final = True
TAKES: Final = frozenset({"noise", "explain", "fields"})
_GROWING: Final = ("index", "start", "t_start_ns", "t_end_ns", "request_start")  # from row to row
_INSIDE: Final = {name: f"{name}.list.element" for name in ("values", "findings")}  # what Parquet calls their items
_VARIED: Final = ("response_time_ns", "bytes", "values")  # of which a dictionary would help nobody
_SOUGHT: Final = (*_GROWING, "response_time_ns", "unit", "function", "address")  # least and greatest let readers skip


def frames_writer(out: Any, schema: Any, **settings: Any) -> Any:
    """A ParquetWriter of frames, its columns encoded as their values are; `settings` are further ones of pyarrow's."""
    from pyarrow.parquet import ParquetWriter

    few = [name for name in schema.names if name not in (*_GROWING, *_VARIED)]
    growing = [_INSIDE.get(name, name) for name in (*_GROWING, "values") if name in schema.names]
    return ParquetWriter(
        out,
        schema,
        use_dictionary=[_INSIDE.get(name, name) for name in few],
        column_encoding=dict.fromkeys(growing, "DELTA_BINARY_PACKED"),
        write_statistics=[name for name in _SOUGHT if name in schema.names],
        **settings,
    )


class _Groups(Sink):
    def __init__(self, out: OutputStream, options: ExportOptions) -> None:
        pa = arrow_imported()
        from analyzer.exports import arrow

        self._options = options
        self._record_batch = arrow.record_batch
        self._schema = arrow.schema(explain=options.explain)
        names = chosen_names(options.fields, self._schema.names)
        self._schema = pa.schema([self._schema.field(name) for name in names])
        self._groups = RowGroups(frames_writer(pa.PythonFile(out, mode="w"), self._schema), 2 * GROUP)

    def batch(self, analysed: Analysed) -> None:
        """Its rows in columns, written once there are enough."""
        options = self._options
        part = self._record_batch(analysed.batch, noise=options.noise, explain=options.explain)
        self._groups.add(part.select(self._schema.names))

    def close(self) -> None:
        """The rest, and the file's footer."""
        self._groups.close()


def open_sink(out: OutputStream, capture: Capture, options: ExportOptions) -> _Groups:  # noqa: ARG001
    """Row groups onto `out`."""
    return _Groups(out, options)
