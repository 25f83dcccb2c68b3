"""The analyzer in a notebook: a capture opened, its frames, its columns."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from importlib import import_module
from os import PathLike, fspath
from sys import maxsize
from typing import TYPE_CHECKING, Any

import captures
from captures.chunks import Capture, Damage
from captures.line import LineSettings

from .core import Analysed, analyse, deframe
from .errors import stream_under_base, under_base
from .extras import needs
from .html_text import ShownList, Stream, html_page, html_table
from .options import Options
from .tables.batch import Batch, Frame
from .tables.findings import Finding, described
from .tables.schema import Rows
from .tables.transactions import TransactionRows, Transactions

if TYPE_CHECKING:
    from dissectors.maps.files import UnitMaps

    from .causes.registry import Cause
    from .exports.running import Exported
    from .filters import Filter
    from .plots import Plots
    from .reports.model import Report


class Analysis:
    """What happened on the bus of one capture. Nothing is read until it is asked for; every call reads anew.

    `batches` and `frames` stream in flat memory; `rows` and `transactions` hold the whole capture as one array.
    """

    def __init__(
        self,
        capture: Capture,
        options: Options = Options(),  # noqa: B008 - frozen
        *,
        only: Filter | None = None,
        maps: UnitMaps | None = None,
    ) -> None:
        self.capture = capture
        self.options = options
        self.only = only
        self.maps = maps

    def __repr__(self) -> str:
        name = self.capture.path.name if self.capture.path is not None else "in memory"
        narrowed = f", only {self.only.text}" if self.only is not None else ""
        return f"<Analysis of {name}: {self.capture.format}, {self.line.baud or 'unknown'} bit/s{narrowed}>"

    def _repr_html_(self) -> str:
        """For notebooks: what it is, and its first frames."""
        line = self.line
        known = [
            ("format", self.capture.format),
            ("bit/s", line.baud),
            ("parity", line.parity),
            ("tap", line.tap),
            ("only", self.only.text if self.only is not None else None),
        ]
        about = html_table((), [each for each in known if each[1] is not None])
        name = self.capture.path.name if self.capture.path is not None else "capture in memory"
        return html_page(name, about, self.frames()._repr_html_())

    @property
    def plot(self) -> Plots:
        """Pictures of it: `timeline()`, `response_times()`, `register(unit, address)`. Needs `rtuscope[plot]`."""
        from .plots import Plots

        return Plots(self)

    def filter(self, text: str) -> Analysis:
        """The same capture narrowed to what passes a display filter. Raises FilterError where the filter is wrong."""
        from .filters import compile_filter

        wanted = text if self.only is None else f"({self.only.text}) and ({text})"
        chosen = compile_filter(wanted, charts=self.maps)
        return Analysis(self.capture, self.options, only=chosen, maps=self.maps)

    def with_maps(self, *maps: str) -> Analysis:
        """The same with the names of register maps, `MAP@UNIT` or `MAP` each: in `records`, `to_arrow`, `export`,
        `report`, and in filters to come. Raises MapError."""
        from dissectors.maps.files import unit_maps

        with under_base():
            return Analysis(self.capture, self.options, only=self.only, maps=unit_maps(maps))

    def report(self) -> Report:
        """The bus on one page, as `rtuscope report` has it; `to_json()` of it is that of `--json`."""
        from .reports import summarize

        watch = None
        if self.maps:
            from .registers.watch import ValueWatch

            watch = ValueWatch(self.maps)
        name = str(self.capture.path or "")
        with under_base():
            return summarize(self.capture, source=name, options=self.options, filter=self.only, values=watch)

    def export(
        self,
        out: str | PathLike[str],
        *,
        format: str | None = None,
        table: str = "frames",
        noise: bool = False,
        fields: Sequence[str] = (),
        count: int = maxsize,
    ) -> Exported:
        """Write it as `rtuscope export` does, by suffix or by the format's name; `table`, `fields` (names of columns)
        and `count` (of frames) as in its options."""
        from .exports import ExportOptions, export

        options = ExportOptions(
            noise=noise, filter=self.only, table=table, charts=self.maps or None, fields=tuple(fields), count=count
        )
        with under_base():
            return export(self.capture, fspath(out), name=format, options=options, limits=self.options)

    @property
    def line(self) -> LineSettings:
        """Line settings, as far as the capture knows them."""
        return self.capture.line

    @property
    def damage(self) -> list[Damage]:
        """What the newest pass over the capture could not read, and where."""
        return self.capture.damage

    def batches(self) -> Iterator[Batch]:
        """Rows with their bytes, batch after batch in wire order."""
        if self.only is not None:
            return (part.batch for part in self.analysed())
        return stream_under_base(deframe(self.capture, self.options))

    def analysed(self) -> Iterator[Analysed]:
        """The same batches, diagnosed, with the transactions and findings that belong to them."""
        stream = analyse(self.capture, self.options)
        if self.only is None:
            return stream_under_base(stream)
        from .filters.evaluation import filtered

        return stream_under_base(filtered(stream, self.only, self.line))

    def frames(self) -> Stream[Frame]:
        """Every frame, in wire order, with its findings."""
        from .exports.encoding import FramesAhead

        def frames() -> Iterator[Frame]:
            told = FramesAhead().of
            return (frame for analysed in self.analysed() for frame in analysed.batch.frames(told))

        return Stream(frames, ("frame", "t_start_ns", "direction", "unit", "summary", "findings"), _frame_line)

    def findings(self) -> Stream[Finding]:
        """What is wrong, in wire order batch by batch; what concerns the bus as a whole comes last."""
        return Stream(
            lambda: (finding for analysed in self.analysed() for finding in described(analysed.findings)),
            ("severity", "finding", "frame", "text"),
            lambda finding: (finding.severity.name.lower(), finding.code, finding.index, finding.text),
        )

    def causes(self) -> ShownList[Cause]:
        """What explains the findings, best first; nothing on a healthy bus, nor of one that is narrowed by a filter."""
        return ShownList(self.report().causes)

    def rows(self) -> Rows:
        """All frames and noise as columns; `at` is for batches only."""
        return Rows.joined([batch.rows for batch in self.batches()])

    def transactions(self) -> TransactionRows:
        """Requests with their answers as columns."""
        if self.only is not None:
            return TransactionRows.joined([part.transactions for part in self.analysed()])
        open_ones = Transactions()
        parts = [open_ones.feed(batch) for batch in self.batches()]
        return TransactionRows.joined([TransactionRows.zeros(0), *parts, open_ones.close()])

    def records(self, table: str) -> Stream[dict[str, Any]]:
        """The rows of a table (`transactions`, `values`, `findings`) as dictionaries, as `--table` writes them.

        Raises ExportError where there is no such table.
        """

        from .exports.records import table_named

        def records() -> Iterator[dict[str, Any]]:
            for columns in self.columns(table):
                yield from (dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True))

        kinds = table_named(table, self.maps).kinds
        return Stream(records, tuple(kinds), lambda record: tuple(record.values()))

    def columns(self, table: str) -> Iterator[Mapping[str, list[Any]]]:
        """The same as columns, part by part."""
        from .exports.records import table_named

        columns_of = table_named(table, self.maps).columns
        return (columns_of(part) for part in self.analysed())

    def to_arrow(self, table: str = "frames", *, noise: bool = False) -> Any:
        """All frames as a pyarrow Table with the columns of `exports.arrow`, with `noise` the bytes between too; or
        another table of `records`.

        Needs `rtuscope[columns]`; an ImportError says so.
        """
        from .exports import arrow

        if table == "frames":
            return arrow.table((analysed.batch for analysed in self.analysed()), noise=noise)
        from .exports.records import records_arrow, table_named

        chosen = table_named(table, self.maps)
        return records_arrow(chosen, (chosen.made(part) for part in self.analysed()))

    def to_polars(self, *, noise: bool = False) -> Any:
        """The same as a polars DataFrame."""
        return _installed("polars").from_arrow(self.to_arrow(noise=noise))

    def to_pandas(self, *, noise: bool = False) -> Any:
        """The same as a pandas DataFrame."""
        _installed("pandas")
        return self.to_arrow(noise=noise).to_pandas()


def _frame_line(frame: Frame) -> tuple[object, ...]:
    found = ", ".join(finding.code for finding in frame.findings)
    return frame.index, frame.t_start_ns, frame.direction, frame.unit, frame.summary(), found


def _installed(name: str) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(needs(f"a {name} table", name), name=name) from error


def open(
    path: str | PathLike[str],
    options: Options = Options(),  # noqa: B008 - frozen
    **reading: Any,
) -> Analysis:
    """Open a capture of any format that `captures` reads; CaptureError says in one line why it can't be.

    `reading`: what `captures.open` takes besides: `format`, `baud`, `parity`, `bits`, `stop`, `polarity`, `tz`,
    `sample_rate`, `only_port`.
    """
    from .paste import judge

    with under_base():
        return Analysis(captures.open(path, judge=judge, **reading), options)
