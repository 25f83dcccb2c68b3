"""A lake, read: its tables as DuckDB views, polars lazy frames, Dask dataframes. Only what the manifest names is read.

lake = analyzer.lake("lake")
lake.sql("SELECT site, count(*) FROM frames GROUP BY site").show()
lake.polars("transactions").filter(...).collect()
"""

from __future__ import annotations

import json
from collections.abc import Collection, Iterator
from importlib import import_module
from os import PathLike, fspath
from typing import Any, Final

from ..extras import needs
from . import FleetError
from .datasets import DATASETS
from .manifest import Manifest, TableFiles
from .stores import FolderStore, filesystem, store

MEMORY: Final = "1500MB"  # that DuckDB may take; beyond it works on the disk
_QUERIES: Final = frozenset({"SELECT_NODE", "SET_OPERATION_NODE", "RECURSIVE_CTE_NODE", "CTE_NODE"})  # of DuckDB's tree
_RUN_TEXT: Final = frozenset({"query", "json_execute_serialized_sql"})  # what they run stands in no tree


class Lake:
    """A lake as it is now; open it anew to see what a batch added since."""

    def __init__(self, path: str) -> None:
        """Raises FleetError where there is no lake."""
        self.store = store(path)
        self.manifest = Manifest.of(self.store)
        self._connection: Any = None
        self._offered: frozenset[str] = frozenset()  # the tables that have a view there

    def __repr__(self) -> str:
        return f"<Lake {self.store.root}: {len(self.manifest.lines)} lines>"

    @property
    def sites(self) -> list[str]:
        """Their names."""
        return sorted({site for site, _ in self.manifest.lines})

    def files(self, table: str) -> TableFiles:
        """The Parquet files of a table, as paths or URLs. Raises FleetError where there is no such table."""
        if table not in DATASETS:
            raise FleetError(f"no table {table!r}: choose from {', '.join(DATASETS)}")
        files, url = self.manifest.files(table), self.store.url
        return TableFiles([url(name) for name in files.loose], {url(name): part for name, part in files.packs.items()})

    def duckdb(self) -> Any:
        """A DuckDB connection with a view a table, which opens no file but those of the lake's tables.

        `sql` and `arrow` write none of these either; who asks the connection itself answers for that.
        """
        return self._offering(frozenset(DATASETS))

    def _offering(self, tables: frozenset[str]) -> Any:
        """A connection with the views of these tables at least: of many files a view alone takes seconds."""
        if self._connection is None or not tables <= self._offered:
            self._offered |= tables
            self._connection = _connected(self, self._offered)
        return self._connection

    def sql(self, text: str, parameters: dict[str, Any] | None = None) -> Any:
        """The relation that a query gives. Raises FleetError for what is no query, or a wrong one."""
        duckdb = _duckdb()
        more = {"params": parameters} if parameters else {}
        try:
            named = _tables_read(duckdb.connect(":memory:"), text)
            try:
                return self._offering(named).sql(text, **more)
            except duckdb.CatalogException:  # it reads a table whose name stands nowhere
                return self.duckdb().sql(text, **more)
        except duckdb.Error as error:
            raise FleetError(_sql_error_line(error)) from error

    def arrow(self, text: str, parameters: dict[str, Any] | None = None) -> Any:
        """The answer to a query as an Arrow table. Raises FleetError as `sql` does."""
        duckdb = _duckdb()
        try:
            relation = self.sql(text, parameters)
            return relation.to_arrow_table()
        except duckdb.Error as error:
            raise FleetError(_sql_error_line(error)) from error

    def polars(self, table: str) -> Any:
        """A polars LazyFrame."""
        polars = _imported("polars", "a polars frame", "polars")
        files = self.files(table)
        scans = [polars.scan_parquet(files.loose, hive_partitioning=True)] if files.loose else []
        for packs, stale in files.alike():
            scan = polars.scan_parquet(packs)
            scans.append((scan.filter(~polars.col("part").is_in(stale)) if stale else scan).drop("part"))
        if not scans:
            return polars.from_arrow(_empty(table)).lazy()
        text = polars.col("line", "site").cast(polars.String)
        return polars.concat([scan.with_columns(text) for scan in scans])

    def dask(self, table: str) -> Any:
        """A Dask dataframe, on whatever cluster there is."""
        dask = _imported("dask.dataframe", "a Dask dataframe", "dask[dataframe]", "cluster")
        files = self.files(table)
        parts = [dask.read_parquet(files.loose, filesystem="fsspec")] if files.loose else []
        for packs, stale in files.alike():
            live = [("part", "not in", stale)] if stale else None
            parts.append(dask.read_parquet(packs, filesystem="fsspec", filters=live).drop(columns="part"))
        if not parts:
            return dask.from_pandas(_empty(table).to_pandas(), npartitions=1)
        columns = list(parts[0].columns)
        text = {name: "string[pyarrow]" for name in ("line", "site", "day") if name in columns}
        return dask.concat([part[columns].astype(text) for part in parts])


def lake(path: str | PathLike[str]) -> Lake:
    """The lake at a path or URL. Raises FleetError where there is none."""
    return Lake(fspath(path))


def _connected(lake: Lake, tables: Collection[str]) -> Any:
    duckdb = _duckdb()
    connection = duckdb.connect(":memory:", config={"memory_limit": MEMORY, "autoinstall_known_extensions": "false"})
    local = isinstance(lake.store, FolderStore)
    if not local:
        connection.register_filesystem(filesystem(lake.store.root)[0])
    connection.execute("SET TimeZone = 'UTC'")
    opened: list[str] = []
    for table in tables:
        files = lake.files(table)
        opened += [*files.loose, *files.packs]
        rows = _select_all(lake, table)
        if rows is None:
            connection.register(f"empty_{table}", _empty(table))
        connection.execute(f"CREATE VIEW {table} AS {rows or f'SELECT * FROM empty_{table}'}")
    if local:  # the very files, not their folder: a new one cannot be written
        connection.execute(f"SET allowed_paths = {_list(opened)}::VARCHAR[]")
        connection.execute("SET enable_external_access = false")
    connection.execute("SET lock_configuration = true")
    return connection


def _select_all(lake: Lake, table: str) -> str | None:
    """What selects all rows of a table; None where it has no file."""
    files, days = lake.files(table), DATASETS[table].time is not None
    placed, selected = "site, day" if days else "site", []  # which stand last, wherever the rows lie
    if files.loose:
        types = "'site': VARCHAR" + (", 'day': DATE" if days else "")
        selected.append(
            f"SELECT * EXCLUDE ({placed}), {placed} "
            f"FROM read_parquet({_list(files.loose)}, hive_partitioning = true, hive_types = {{{types}}})"
        )
    for packs, stale in files.alike():
        live = f" WHERE part NOT IN ({', '.join(map(str, stale))})" if stale else ""
        columns = f"* EXCLUDE (part, {placed}), {placed}"
        selected.append(f"SELECT {columns} FROM read_parquet({_list(packs)}, hive_partitioning = false){live}")
    return " UNION ALL BY NAME ".join(selected) or None


def _list(files: list[str]) -> str:
    return f"[{', '.join(map(sql_text, files))}]"


def _sql_error_line(error: Exception) -> str:
    """What DuckDB says, in a line; not all the functions that it has instead."""
    return " ".join(str(error).partition("Candidate functions:")[0].split())


def sql_text(text: str) -> str:
    """A text as SQL has it."""
    return "'" + text.replace("'", "''") + "'"


def _empty(table: str) -> Any:
    import pyarrow as pa

    dataset = DATASETS[table]
    more = [("site", pa.string())] + ([] if dataset.time is None else [("day", pa.date32())])
    return pa.schema([*dataset.schema, *(pa.field(*each) for each in more)]).empty_table()


def _tables_read(connection: Any, text: str) -> frozenset[str]:
    """The tables of a lake that a query names; all where it names none. Raises FleetError for what is no query.

    What DuckDB's own parser finds in it must be queries alone.

    The type of a statement does not say: `EXPLAIN ANALYZE COPY` is carried out, and DuckDB 2 has `WITH t AS (COPY ...)
    SELECT`. The parser gives a tree of queries alone, or an error.
    """
    statements = connection.extract_statements(text)
    refused = FleetError("one query at a time, and only SELECT or WITH ... SELECT")
    if len(statements) != 1:
        raise refused
    [(tree,)] = connection.execute("SELECT json_serialize_sql($1::VARCHAR)", [statements[0].query]).fetchall()
    found = json.loads(tree)
    parts = list(_objects(found))
    kinds = {str(part.get("type")) for part in parts}
    functions = {str(part.get("function_name")).lower() for part in parts}
    others = {kind for kind in kinds if kind.endswith("_NODE")} - _QUERIES
    if found["error"] or others or functions & _RUN_TEXT:
        raise refused
    named = {str(part.get("table_name")).strip('"').lower() for part in parts}
    return frozenset(named.intersection(DATASETS) or DATASETS)


def _objects(tree: Any) -> Iterator[dict[str, Any]]:
    """All objects in a tree of JSON."""
    waiting: list[Any] = [tree]
    while waiting:
        part = waiting.pop()
        if isinstance(part, dict):
            yield part
            waiting += part.values()
        elif isinstance(part, list):
            waiting += part


def _duckdb() -> Any:
    try:
        return import_module("duckdb")
    except ImportError as error:
        raise FleetError(needs("asking a lake", "duckdb", "fleet")) from error


def _imported(name: str, what: str, library: str, extra: str | None = None) -> Any:
    try:
        return import_module(name)
    except ImportError as error:
        raise ImportError(needs(what, library, extra), name=name.partition(".")[0]) from error
