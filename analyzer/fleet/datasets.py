"""The tables of a lake: those of an export, with the line beside each row, and what a fleet needs besides.

A large table lies in Parquet files `TABLE/site=SITE/day=YYYY-MM-DD/NAME.parquet`; the day is that of the row's own
time, UTC, and captures without a clock count from 1970-01-01. A small one has a file a task,
`TABLE/site=SITE/NAME.parquet`: by days as well it would be files of a few rows, and opening them all that a question
costs. Small files of either kind are made into larger ones by and by (`packs`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final
from urllib.parse import quote

import numpy as np

from captures.errors import os_reason

from ..exports.records import TABLES
from ..extras import needs
from ..version import RULES
from ..words import DAY_NS, moment_of
from . import FleetError, LakeWriteError

if TYPE_CHECKING:
    from .stores import LakeStore

try:
    import pyarrow as pa
    from pyarrow.parquet import ParquetWriter

    from ..exports.arrow import SCHEMA
    from ..exports.records import record_schema
    from ..exports.targets.parquet import frames_writer
except ImportError as error:
    raise FleetError(needs("a lake", "pyarrow", "fleet")) from error

GROUP: Final = 1 << 16  # rows of a row group, at least
_TIME: Final = pa.timestamp("ns", "UTC")
_LINE: Final = pa.field("line", pa.dictionary(pa.int8(), pa.string()))

CAUSES: Final = pa.schema(
    [
        ("t_ns", _TIME),  # since when, as far as that is known; else the beginning of what was looked at
        ("cause", pa.string()),
        ("severity", pa.string()),
        ("units", pa.list_(pa.uint8())),
        ("blame", pa.string()),
        ("text", pa.string()),
        ("share", pa.string()),
        ("since_ns", _TIME),
        ("until_ns", _TIME),
        ("period_s", pa.float64()),
        ("confidence", pa.float64()),
        ("runner_up", pa.string()),
        ("deciding_test", pa.string()),
        ("remedy", pa.string()),
        ("lost_answers", pa.int64()),
        ("lost_ms", pa.float64()),
        ("frames", pa.list_(pa.int64())),
        ("bits", pa.float64()),
        ("numbers", pa.string()),  # that the words are filled with, as JSON: so it can be told in another language
    ]
)
CAPTURES: Final = pa.schema(
    [
        ("t_ns", _TIME),  # of the first byte
        ("t_last_ns", _TIME),
        ("source", pa.string()),
        ("sha256", pa.string()),
        ("size", pa.int64()),
        ("format", pa.string()),
        ("bytes", pa.int64()),  # of the line
        ("baud", pa.int64()),
        ("char_bits", pa.int64()),
        ("parity", pa.string()),
        ("tap", pa.string()),
        ("version", pa.string()),  # that analysed it
        ("state", pa.string()),  # whole, damaged, unreadable or twice
        ("damage_count", pa.int64()),
        ("damage", pa.list_(pa.string())),  # the first hundred
    ]
)
HOURS: Final = pa.schema(
    [
        ("t_ns", _TIME),  # when the hour began
        ("unit", pa.uint8()),
        ("requests", pa.int64()),
        ("answered", pa.int64()),  # what became of them, as the column `status` of transactions
        ("exception", pa.int64()),
        ("unanswered", pa.int64()),
        ("broadcast", pa.int64()),
        ("damaged", pa.int64()),
        ("unheard", pa.int64()),
        ("retries", pa.int64()),
        ("late", pa.int64()),
        ("timed", pa.int64()),  # answers of which is known how long they took, or between what
        ("response_time_low_sum_ns", pa.int64()),  # the same sum twice where all are exact
        ("response_time_high_sum_ns", pa.int64()),
        ("response_time_high_max_ns", pa.int64()),
    ]
)


@dataclass(frozen=True, slots=True)
class Dataset:
    """A table of a lake: its columns, the rules (`version.RULES`) that its rows hang on, and how they lie."""

    schema: Any
    rules: tuple[str, ...]
    time: str | None = None  # of a large one: the column by which a row has its day
    order: tuple[str, ...] = ()  # within a site and day; what is alike in these stays in the order of time


def _with_line(schema: Any) -> Any:
    return pa.schema([_LINE, *schema])


_FRAMED: Final = ("reading", "framing")
_PAIRED: Final = (*_FRAMED, "pairing")
_FOUND: Final = (*_PAIRED, "findings")
DATASETS: Final[Mapping[str, Dataset]] = {
    "frames": Dataset(_with_line(SCHEMA), _FOUND, "t_start_ns"),  # the codes of findings stand beside each
    "transactions": Dataset(_with_line(record_schema(TABLES["transactions"])), _PAIRED, "t_start_ns", ("unit",)),
    "values": Dataset(_with_line(record_schema(TABLES["values"])), _FRAMED, "t_ns", ("unit", "address")),
    "findings": Dataset(_with_line(record_schema(TABLES["findings"])), _FOUND, "t_ns"),
    "causes": Dataset(_with_line(CAUSES), (*_PAIRED, "causes")),
    "captures": Dataset(_with_line(CAPTURES), ("reading",)),
    "hours": Dataset(_with_line(HOURS), _FOUND, order=("line", "unit")),  # the rule `echo` tells what was asked once
}


def touched(made: Mapping[str, int]) -> frozenset[str]:
    """The tables whose rows may be others now than those that rules of these numbers made."""
    changed = {name for name, number in RULES.items() if made.get(name) != number}
    return frozenset(table for table, dataset in DATASETS.items() if changed & set(dataset.rules))


def pack_schema(table: str) -> Any:
    """The columns of a file that holds rows of many lines, sites and days."""
    dataset = DATASETS[table]
    line = pa.field("line", pa.dictionary(pa.int32(), pa.string()))
    day = [] if dataset.time is None else [pa.field("day", pa.date32())]
    return pa.schema(
        [line, *list(dataset.schema)[1:], pa.field("site", pa.string()), *day, pa.field("part", pa.int32())]
    )


@cache
def day_name(day: int) -> str:
    """`2026-11-22`, of a day since the epoch."""
    return f"{moment_of(day * 86_400):%Y-%m-%d}"


def _folder_name(site: str) -> str:
    """Percent-encoded where a store or a reader could take a character for its own; letters of any language stay."""
    return "".join(each if ord(each) > 127 and each.isprintable() else quote(each, safe="") for each in site)


@dataclass(frozen=True, slots=True)
class NewRows:
    """Rows of a line, and a day of a large table, as record batches without the column `line`; they wait to be written
    with those of others, and `name` is that of the file that they would be alone."""

    table: str
    name: str
    line: str
    parts: list[Any]
    rows: int


@dataclass(slots=True)
class _DayFile:
    """A file to be: its rows, and once they are many what writes them."""

    parts: list[Any] = field(default_factory=list)
    waiting: int = 0
    rows: int = 0
    path: Path | None = None
    writer: Any = None


class LakeFiles:
    """Rows of one line into files of a lake, a file a table and day; memory holds a row group of each.

    `tables`: those that are wanted; rows of others are let go. `waiting`: where files so small that they are best
    written with those of other lines go instead, if given; no more rows than a row group.
    """

    def __init__(
        self, store: LakeStore, site: str, line: str, prefix: str, waiting: list[NewRows] | None = None
    ) -> None:
        self.tables = frozenset(DATASETS)
        self._store, self._site, self._line, self._prefix = store, site, line, prefix
        self._waiting, self._room = waiting, GROUP
        self._open: dict[tuple[str, int | None], _DayFile] = {}
        self._days: dict[str, int] = {}  # the newest, by table
        self._done: dict[str, list[tuple[str, int]]] = {}

    def add(self, table: str, part: Any) -> None:
        """A RecordBatch of rows of a table, its column `line` left out. Raises LakeWriteError."""
        if not len(part) or table not in self.tables:
            return
        time = DATASETS[table].time
        with lake_writing():
            if time is None:
                self._add(table, None, part)
                return
            days = part.column(time).view(pa.int64()).to_numpy(zero_copy_only=False) // DAY_NS
            if days.min() == days.max():
                self._add(table, int(days[0]), part)
                return
            for day in np.unique(days).tolist():
                self._add(table, day, part.filter(pa.array(days == day)))

    def _add(self, table: str, day: int | None, part: Any) -> None:
        if day is not None:
            newest = self._days.get(table, day)
            for of, old in list(self._open):
                if of == table and old is not None and old < newest < day:
                    self._close(of, old)  # a line's times hardly ever go back, and no further than a day
            self._days[table] = max(newest, day)
        file = self._open.setdefault((table, day), _DayFile())
        file.parts.append(part)
        file.waiting += len(part)
        if file.waiting >= GROUP:
            self._flush(table, file)

    def _flush(self, table: str, file: _DayFile) -> None:
        """Rows into the file, which begins with the first of them."""
        schema = DATASETS[table].schema
        if file.writer is None:
            file.path = self._store.scratch()
            file.writer = rows_writer(table, file.path, schema)
        if file.parts:
            rows = pa.Table.from_batches(file.parts)
            line = pa.DictionaryArray.from_arrays(pa.array(np.zeros(len(rows), np.int8)), pa.array([self._line]))
            file.writer.write_table(rows.add_column(0, schema.field(0), line), row_group_size=2 * GROUP)
        file.rows += file.waiting
        file.parts, file.waiting = [], 0

    def _close(self, table: str, day: int | None) -> None:
        file = self._open.pop((table, day))
        folder = f"{table}/site={_folder_name(self._site)}" + ("" if day is None else f"/day={day_name(day)}")
        name = self._store.fresh(f"{folder}/{self._prefix}", ".parquet")
        if self._waiting is not None and file.writer is None and file.waiting <= self._room:
            self._room -= file.waiting
            self._waiting.append(NewRows(table, name, self._line, file.parts, file.waiting))
            file.rows = file.waiting
        else:
            self._flush(table, file)
            file.writer.close()
            assert file.path is not None
            self._store.put(name, file.path)
        self._done.setdefault(table, []).append((name, file.rows))

    def close(self) -> dict[str, list[tuple[str, int]]]:
        """The names of all files by table, each with its count of rows. Raises LakeWriteError."""
        with lake_writing():
            for key in list(self._open):
                self._close(*key)
        done, self._done, self._days = self._done, {}, {}
        return done


def rows_writer(table: str, path: Path, schema: Any) -> Any:
    """A ParquetWriter of rows of a table."""
    make: Callable[..., Any] = frames_writer if table == "frames" else ParquetWriter
    return make(str(path), schema, compression="zstd")


@contextmanager
def lake_writing() -> Iterator[None]:
    """What a disk or a store says of a failure, as a LakeWriteError."""
    try:
        yield
    except (FleetError, OSError) as error:
        words = os_reason(error) if isinstance(error, OSError) else str(error)
        raise LakeWriteError(f"the lake cannot be written: {words}") from error
