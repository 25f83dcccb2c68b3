"""Small files of a lake made into fewer, larger ones, so that a question opens dozens and not thousands.

A pack `TABLE/packed/NAME.parquet` holds the rows of many files, of any lines, sites and days: `site` and `day` are
columns of it, and `part` says of which file a row is, by its number among the pack's members. Rows are sorted by site,
day and the table's own `order`, so that least and greatest values of a row group tell what it cannot hold. An entry of
the manifest names new packs and their members in one step; the files that they replace go when the next batch begins.
A line that is done anew or goes on leaves rows in packs that are the lake's no more: readers leave those parts out, and
the next packing drops them.

A pack is a task like those that take in captures, for whatever runs them: full ones are made while these go on.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import dataclass
from datetime import date
from operator import attrgetter
from typing import Any, Final
from urllib.parse import unquote

from ..extras import needs
from . import FleetError

try:
    import numpy as np
    import pyarrow as pa
    import pyarrow.compute as pc
    from pyarrow.parquet import ParquetFile
except ImportError as error:
    raise FleetError(needs("a lake", "pyarrow", "fleet")) from error

from .datasets import DATASETS, GROUP, NewRows, lake_writing, pack_schema, rows_writer
from .manifest import Manifest
from .stores import LakeStore, PackMember, fetched, store

FULL: Final = 1 << 20  # rows of a pack: what memory holds and sorts at once
SMALL: Final = FULL // 2  # files of fewer rows are packed
MANY: Final = 64  # small files of a table that are worth it
A_FILE: Final = FULL // 256  # rows that cost as much as to open a file
_STALE: Final = 0.25  # share of a pack's rows that are the lake's no more: it is made anew


@dataclass(frozen=True, slots=True)
class SmallFile:
    """A file to be packed: the members of it that are the lake's, with the numbers they have in it if it is a pack.

    `stale`: rows of it that are the lake's no more.
    """

    file: str
    members: tuple[PackMember, ...]
    numbers: tuple[int, ...] | None = None
    stale: int = 0

    @property
    def rows(self) -> int:
        return sum(rows for _, rows in self.members)

    @property
    def price(self) -> int:
        """What packing it costs, in rows."""
        return self.rows + A_FILE


@dataclass(frozen=True, slots=True)
class LakePacking:
    """What a packing came to: how many files there were of it, and how many there are now."""

    before: int = 0
    after: int = 0

    def __add__(self, more: LakePacking) -> LakePacking:
        return LakePacking(self.before + more.before, self.after + more.after)


@dataclass(frozen=True, slots=True)
class PackTask:
    """Small files of a table to be made into one."""

    lake: str
    table: str
    group: tuple[SmallFile, ...]

    @property
    def key(self) -> tuple[str, str]:
        """What tells it from other tasks."""
        return self.table, self.group[0].file

    @property
    def price(self) -> int:
        """What it costs, in rows."""
        return sum(small.price for small in self.group)

    def run(self) -> dict[str, Any]:
        """Do it; what the manifest is to say."""
        return _write(store(self.lake), self.table, self.group)

    def enter(self, manifest: Manifest, pack: dict[str, Any]) -> LakePacking:
        """From now on the pack takes the place of its files."""
        manifest.add([], [pack])
        return LakePacking(len(self.group), 1)


def pack_tasks(manifest: Manifest, least: int | None = None) -> Iterator[PackTask]:
    """What there is to pack of the tables that have at least so many small files, `MANY` if not given.

    The caller has the lake to itself (`writing`).
    """
    least = MANY if least is None else least
    for table in DATASETS:
        smalls, settled = _small(manifest, table)
        if len(settled) >= least:
            for group in _groups(smalls, attrgetter("rows")):
                if len(group) > 1 or group[0].stale:
                    yield PackTask(manifest.store.root, table, tuple(group))


class FullPacks:
    """Packs of new files that are full already while more is being taken in: the price goes by what is new alone."""

    def __init__(self, lake: str) -> None:
        self._lake = lake
        self._new: dict[str, list[SmallFile]] = defaultdict(list)  # not handed out yet, by table
        self._price = Counter[str]()  # of these

    def entered(self, entries: Iterable[dict[str, Any]], packs: Iterable[dict[str, Any]]) -> None:
        """What a task has made; of a line that goes on the tail is soon replaced."""
        alone: list[tuple[str, PackMember]] = []
        live: set[str] = set()
        for entry in entries:
            for part in ("files", "tail"):
                made = [(table, (name, rows)) for table, files in entry[part].items() for name, rows in files]
                live |= {name for _, (name, _) in made}
                alone += made if part == "files" or not entry["state"] else []
        packed = {name for pack in packs for name, _ in pack["members"]}
        for table, member in alone:
            if member[1] < SMALL and member[0] not in packed:
                self._add(table, SmallFile(member[0], (member,)))
        for pack in packs:
            parts = [(number, (name, rows)) for number, (name, rows) in enumerate(pack["members"]) if name in live]
            numbers, members = zip(*parts, strict=True) if parts else ((), ())
            self._add(pack["table"], SmallFile(pack["name"], members, numbers))

    def _add(self, table: str, small: SmallFile) -> None:
        self._new[table].append(small)
        self._price[table] += small.price

    def tasks(self) -> Iterator[PackTask]:
        """Those that are full now, each once."""
        for table, new in self._new.items():
            if len(new) >= MANY and self._price[table] > FULL:
                *full, rest = _groups(sorted(new, key=lambda small: small.file), attrgetter("price"))
                self._new[table] = rest  # it has room
                self._price[table] = sum(small.price for small in rest)
                yield from (PackTask(self._lake, table, tuple(group)) for group in full)


def _small(manifest: Manifest, table: str) -> tuple[list[SmallFile], set[str]]:
    """What is worth packing, by site and day; and those of it that a line that goes on will not soon replace."""
    catalog = manifest.catalog
    smalls = [SmallFile(name, ((name, rows),)) for name, rows in catalog.loose(table).items() if rows < SMALL]
    settled = {small.file for small in smalls} - catalog.passing(table)
    for pack in catalog.packs(table):
        dead = pack.rows - pack.live_rows
        if pack.live_rows < SMALL or dead > _STALE * pack.live_rows:
            members = catalog.members(pack.name)
            smalls.append(SmallFile(pack.name, tuple(members.values()), tuple(members), dead))
            settled.add(pack.name)
    return sorted(smalls, key=lambda small: min(small.members)), settled  # names begin with site and day


def _groups(smalls: Iterable[SmallFile], size: Callable[[SmallFile], int]) -> Iterator[list[SmallFile]]:
    """Those that make a pack together: `FULL` by their size at most."""
    group: list[SmallFile] = []
    whole = 0
    for small in smalls:
        if group and whole + size(small) > FULL:
            yield group
            group, whole = [], 0
        group.append(small)
        whole += size(small)
    if group:
        yield group


def _write(lake: LakeStore, table: str, group: Collection[SmallFile]) -> dict[str, Any]:
    """Make one pack; what the manifest is to say of it."""
    schema = pack_schema(table)
    parts: list[Any] = []
    members: list[PackMember] = []
    for small in group:
        with fetched(lake.url(small.file)) as path, ParquetFile(path) as file:
            rows = file.read()
        parts.append(_own(rows, small, len(members)).select(schema.names).cast(schema))
        members += small.members
    return _written(lake, table, pa.concat_tables(parts), members)


def new_packs(lake: LakeStore, new: Iterable[NewRows]) -> list[dict[str, Any]]:
    """Packs of rows that are in no file yet; what the manifest is to say of them. Raises LakeWriteError."""
    tables: dict[str, list[NewRows]] = defaultdict(list)
    for each in new:
        tables[each.table].append(each)
    with lake_writing():
        return [
            _written(lake, table, _gathered(table, new), [(each.name, each.rows) for each in new])
            for table, new in tables.items()
        ]


def _gathered(table: str, new: list[NewRows]) -> Any:
    """These rows with all columns of a pack."""
    rows = pa.Table.from_batches([part for each in new for part in each.parts])
    part = np.repeat(np.arange(len(new), dtype=np.int32), [each.rows for each in new])
    own = pa.array(part)
    names = sorted({each.line for each in new})
    numbers = np.array([names.index(each.line) for each in new], np.int32)
    lines = pa.DictionaryArray.from_arrays(pa.array(numbers[part]), pa.array(names, pa.string()))
    places = [_site_and_day(each.name) for each in new]
    columns = {"line": lines, "part": own}
    for column in places[0]:
        columns[column] = pa.array([place[column] for place in places]).take(own)
    schema = pack_schema(table)
    return pa.table([columns[name] if name in columns else rows.column(name) for name in schema.names], schema)


def _written(lake: LakeStore, table: str, rows: Any, members: list[PackMember]) -> dict[str, Any]:
    path = lake.scratch()
    with rows_writer(table, path, pack_schema(table)) as writer:
        writer.write_table(_sorted(rows, table), row_group_size=GROUP)
    name = lake.fresh(f"{table}/packed/rows", ".parquet")
    lake.put(name, path)
    return {"table": table, "name": name, "members": members}


def _own(rows: Any, small: SmallFile, first: int) -> Any:
    """The rows of a file that are the lake's, with all columns of a pack; its parts numbered from `first`."""
    if small.numbers is None:
        for column, value in {**_site_and_day(small.file), "part": pa.scalar(first, pa.int32())}.items():
            rows = rows.append_column(column, pa.repeat(value, len(rows)))
        return rows
    numbers = pc.index_in(rows.column("part"), pa.array(small.numbers, pa.int32()))
    rows = rows.set_column(rows.column_names.index("part"), "part", pc.add(numbers, pa.scalar(first, pa.int32())))
    return rows.filter(pc.is_valid(numbers))


def _site_and_day(name: str) -> dict[str, Any]:
    """Site and day, as the name of a file of one line has them."""
    keys = dict(folder.split("=", 1) for folder in name.split("/")[1:-1])
    place: dict[str, Any] = {"site": unquote(keys["site"])}
    return place | ({"day": date.fromisoformat(keys["day"])} if "day" in keys else {})


def _sorted(rows: Any, table: str) -> Any:
    """By site, day and the table's own order; what is alike there stays as it was."""
    names = [name for name in ("site", "day", *DATASETS[table].order) if name in rows.column_names]
    keys = [rows.column(name) for name in names]
    plain = [key.cast(key.type.value_type) if pa.types.is_dictionary(key.type) else key for key in keys]
    order = pc.sort_indices(pa.table(plain, names), sort_keys=[(name, "ascending") for name in names])
    return rows.take(order)
