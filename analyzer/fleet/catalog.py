"""What the entries of a manifest come to: lines, sources, files and packs, in tables of SQLite that are asked by name.

The database is in memory. It is made of the entries alone and can be made of them again; `to_bytes` and `of_bytes`
carry it from one process to the next (`checkpoints`).
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any, Final, NamedTuple

from . import FleetError
from .stores import PackMember

PORTABLE: Final = hasattr(sqlite3.Connection, "serialize")  # not with each SQLite before 3.36
HAVE_ROWS: Final = ("whole", "damaged")  # states of captures
SCHEMA: Final = """\
CREATE TABLE line (id INTEGER PRIMARY KEY, site TEXT, line TEXT, state TEXT, UNIQUE (site, line));
CREATE TABLE entry (line INTEGER, number INTEGER, made TEXT, PRIMARY KEY (line, number)) WITHOUT ROWID;
CREATE TABLE slice (line INTEGER, url BLOB, size INTEGER, stamp TEXT, sha256 TEXT);
CREATE INDEX slice_of ON slice (line);
CREATE INDEX slice_size ON slice (size) WHERE sha256 IS NOT NULL;
CREATE INDEX slice_content ON slice (sha256) WHERE sha256 IS NOT NULL;
CREATE TABLE file (place INTEGER PRIMARY KEY, name TEXT UNIQUE, kind TEXT, rows INTEGER, line INTEGER, part INTEGER,
 pack INTEGER, number INTEGER);
CREATE INDEX file_of ON file (line);
CREATE INDEX file_loose ON file (kind) WHERE pack IS NULL;
CREATE INDEX file_packed ON file (pack, rows) WHERE pack IS NOT NULL;
CREATE TABLE pack (id INTEGER PRIMARY KEY, name TEXT UNIQUE, kind TEXT, members INTEGER, rows INTEGER);
CREATE TABLE checkpoint (name TEXT);
CREATE TABLE replaced (name TEXT PRIMARY KEY) WITHOUT ROWID;
"""
_SETTLED: Final = 0  # parts of a line's files: those that stay whatever slices come
_TAIL: Final = 1  # those that the next slice replaces
_OLD: Final = 2  # those of before, while an entry is taken
_OF_LINES: Final = "FROM file JOIN line ON file.line = line.id"
_IN_ORDER: Final = "ORDER BY site, line.line, part, place"
_OF_SOURCES: Final = "FROM slice JOIN line ON slice.line = line.id WHERE site = ? AND sha256 IS NOT NULL AND"
_NAMING: Final = ("replaced", "file", "pack", "checkpoint")
_LOOSE: Final = (None, None)
_Place = tuple[int | None, int | None]  # the number of a pack, and of a member of it
_Rows = list[tuple[Any, ...]]


class PackState(NamedTuple):
    """A pack: how many members it has, and how many rows; how many of each are the lake's."""

    name: str
    members: int
    rows: int
    live: int
    live_rows: int


class KnownLine(NamedTuple):
    """What of a line tells whether anything of it is new: by what it was made, if by one thing (`made_by`); name, size
    and stamp of its sources."""

    made: str | None
    sources: frozenset[tuple[str, int, str]]


class Catalog:
    """The tables of a lake's manifest."""

    def __init__(self, root: str) -> None:
        self._root = root
        self._database = sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)
        self._database.executescript(SCHEMA)

    @classmethod
    def of_bytes(cls, root: str, data: bytes) -> Catalog:
        """That which `to_bytes` gave. Raises ValueError for tables that are others."""
        made, loaded = cls(root), sqlite3.connect(":memory:", isolation_level=None, check_same_thread=False)
        try:
            loaded.execute("PRAGMA trusted_schema = OFF")
            loaded.deserialize(data)
            loaded.execute("PRAGMA cell_size_check = ON")
            if _declared(loaded) != _declared(made._database):
                raise ValueError("other tables")
        except sqlite3.Error as error:
            raise ValueError(str(error)) from error
        made._database = loaded
        return made

    def to_bytes(self) -> bytes:
        """All of it."""
        return self._database.serialize()

    @contextmanager
    def changing(self) -> Iterator[None]:
        """What the block takes, all of it or nothing. Raises FleetError for what no table can hold."""
        self._database.execute("BEGIN")
        try:
            yield
        except BaseException as error:
            self._database.execute("ROLLBACK")
            if isinstance(error, sqlite3.Error | UnicodeError | OverflowError):
                raise FleetError(f"{self._root}: its manifest is damaged: {error}") from error
            raise
        self._database.execute("COMMIT")

    def take(
        self,
        number: int,
        lines: Iterable[Mapping[str, Any]],
        packs: Iterable[Mapping[str, Any]],
        checkpoint: str | None = None,
    ) -> None:
        """An entry of the manifest, by its number; it may name a checkpoint of those before it."""
        packed = {name: place for pack in packs for name, place in self._take_pack(pack)}
        for line in lines:
            self._take_line(number, line, packed)
        self._database.executemany(
            "UPDATE file SET pack = ?, number = ? WHERE name = ?", [(*place, name) for name, place in packed.items()]
        )
        if checkpoint is not None:
            self._database.execute("INSERT OR IGNORE INTO replaced SELECT name FROM checkpoint")
            self._database.execute("DELETE FROM checkpoint")
            self._database.execute("INSERT INTO checkpoint VALUES (?)", (checkpoint,))

    def _take_line(self, number: int, entry: Mapping[str, Any], packed: dict[str, _Place]) -> None:
        run, site, line = self._database.execute, entry["site"], entry["line"]
        key: Any = next((key for (key,) in run("SELECT id FROM line WHERE site = ? AND line = ?", (site, line))), None)
        if is_new := key is None:
            key = run("INSERT INTO line (site, line, state) VALUES (?, ?, ?)", (site, line, entry["state"])).lastrowid
        else:
            self._clear(key, entry)
        run("INSERT INTO entry VALUES (?, ?, ?)", (key, number, made_by(entry["options"], entry.get("rules", {}))))
        self._database.executemany(
            "INSERT INTO slice VALUES (?, ?, ?, ?, ?)",
            [
                (key, one["url"].encode("utf-8", "surrogateescape"), one["size"], one["stamp"],
                 one["sha256"] if one["state"] in HAVE_ROWS else None)
                for one in entry["slices"]
            ],
        )  # fmt: skip
        made = [
            (name, table, rows, key, part, *packed.pop(name, _LOOSE))
            for part, files in ((_SETTLED, entry["files"]), (_TAIL, entry["tail"]))
            for table, members in files.items()
            for name, rows in members
        ]
        [(place,)] = run("SELECT ifnull(max(place), 0) FROM file")
        self._database.executemany(
            "INSERT INTO file VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (name) DO UPDATE SET place = excluded.place, "
            "line = excluded.line, part = excluded.part, pack = ifnull(excluded.pack, pack), "
            "number = ifnull(excluded.number, number)",
            [(at, *file) for at, file in enumerate(made, place + 1)],
        )
        if not is_new:
            run("INSERT OR IGNORE INTO replaced SELECT name FROM file WHERE line = ? AND part = ?", (key, _OLD))
            run("DELETE FROM file WHERE line = ? AND part = ?", (key, _OLD))

    def _clear(self, key: int, entry: Mapping[str, Any]) -> None:
        """Make way for an entry: for one that goes on from the last of its line, what is settled stays."""
        run = self._database.execute
        [(last,)] = run("SELECT max(number) FROM entry WHERE line = ?", (key,))
        goes_on = entry["after"] is not None and entry["after"] == last
        run("UPDATE file SET part = ? WHERE line = ? AND part >= ?", (_OLD, key, _TAIL if goes_on else _SETTLED))
        if not goes_on:
            run("DELETE FROM entry WHERE line = ?", (key,))
            run("DELETE FROM slice WHERE line = ?", (key,))
        run(
            "INSERT OR IGNORE INTO replaced SELECT state FROM line WHERE id = ? AND state != ?",
            (key, entry["state"] or ""),
        )
        run("UPDATE line SET state = ? WHERE id = ?", (entry["state"], key))

    def _take_pack(self, pack: Mapping[str, Any]) -> Iterator[tuple[str, _Place]]:
        """Where each member of a new pack lies from now on."""
        members = pack["members"]
        key = self._database.execute(
            "INSERT INTO pack (name, kind, members, rows) VALUES (?, ?, ?, ?)",
            (pack["name"], pack["table"], len(members), sum(rows for _, rows in members)),
        ).lastrowid
        return ((name, (key, number)) for number, (name, _) in enumerate(members))

    def rows(self, table: str) -> dict[str, int]:
        """How many rows each file has that was made of a table, in the order of sites, lines and rows."""
        return dict(self._rows(f"SELECT name, rows {_OF_LINES} WHERE kind = ? {_IN_ORDER}", table))

    def loose(self, table: str) -> dict[str, int]:
        """Those of them that are in no pack."""
        return dict(self._rows(f"SELECT name, rows {_OF_LINES} WHERE kind = ? AND pack IS NULL {_IN_ORDER}", table))

    def passing(self, table: str) -> set[str]:
        """Those of them that a line that goes on soon replaces."""
        wanted = "WHERE kind = ? AND pack IS NULL AND part = ? AND state IS NOT NULL"
        return {name for (name,) in self._rows(f"SELECT name {_OF_LINES} {wanted}", table, _TAIL)}

    def packs(self, table: str) -> list[PackState]:
        """The packs with rows of a table that are the lake's."""
        return [
            PackState(*each)  # CROSS JOIN: in this order
            for each in self._rows(
                "SELECT pack.name, members, pack.rows, count(*), sum(file.rows) FROM pack CROSS JOIN file "
                "WHERE pack.kind = ? AND file.pack = pack.id GROUP BY pack.id ORDER BY pack.id",
                table,
            )
        ]

    def members(self, pack: str) -> dict[int, PackMember]:
        """The members of a pack that are the lake's, by their number in it."""
        return {
            number: (name, rows)
            for number, name, rows in self._rows(
                "SELECT number, file.name, file.rows FROM file JOIN pack ON file.pack = pack.id WHERE pack.name = ? "
                "AND file.pack IS NOT NULL ORDER BY number",
                pack,
            )
        }

    def named(self) -> set[str]:
        """All files that are the lake's."""
        return {
            name
            for (name,) in self._rows(
                "SELECT name FROM file WHERE pack IS NULL UNION ALL SELECT state FROM line WHERE state IS NOT NULL "
                "UNION ALL SELECT name FROM pack WHERE id IN (SELECT pack FROM file WHERE pack IS NOT NULL) "
                "UNION ALL SELECT name FROM checkpoint"
            )
        }

    def was_named(self, name: str) -> bool:
        """Whether an entry names a file, or did, which was not found to be gone since."""
        return any(self._rows(f"SELECT 1 FROM {kind} WHERE name = ?", name) for kind in _NAMING)

    def forget_replaced(self, there: Collection[str]) -> None:
        """Of what is the lake's no more these files are there still; the others are gone, and nobody asks for them."""
        with self.changing():
            kept = [(name,) for name in there if self.was_named(name)]
            self._database.execute("DELETE FROM replaced")
            self._database.execute("DELETE FROM pack WHERE id NOT IN (SELECT pack FROM file WHERE pack IS NOT NULL)")
            self._database.executemany("INSERT OR IGNORE INTO replaced VALUES (?)", kept)

    def lines(self) -> list[tuple[str, str]]:
        """Site and name of each line, in their order."""
        return [(site, line) for site, line in self._rows("SELECT site, line FROM line ORDER BY site, line")]

    def known(self, site: str, line: str) -> KnownLine | None:
        """What of a line tells what is new of it; None where the lake has none of this name."""
        if not (found := self._rows("SELECT id FROM line WHERE site = ? AND line = ?", site, line)):
            return None
        sources = self._rows("SELECT url, size, stamp FROM slice WHERE line = ?", found[0][0])
        made = self._rows("SELECT DISTINCT made FROM entry WHERE line = ?", found[0][0])
        return KnownLine(
            made[0][0] if len(made) == 1 else None,
            frozenset((url.decode("utf-8", "surrogateescape"), size, stamp) for url, size, stamp in sources),
        )

    def entries(self, site: str, line: str) -> list[int]:
        """The numbers of the entries that a line consists of."""
        wanted = "FROM entry JOIN line ON entry.line = line.id WHERE site = ? AND line.line = ? ORDER BY number"
        return [number for (number,) in self._rows(f"SELECT number {wanted}", site, line)]

    def of_size(self, site: str, size: int) -> list[tuple[str, str]]:
        """SHA-256 and line of each source of a site that the lake has rows of and that has so many bytes."""
        return [
            (sha256, line)
            for sha256, line in self._rows(f"SELECT sha256, line.line {_OF_SOURCES} size = ?", site, size)
        ]

    def with_content(self, site: str, sha256: str) -> set[str]:
        """The lines of a site that have rows of a source, by its SHA-256."""
        return {line for (line,) in self._rows(f"SELECT line.line {_OF_SOURCES} sha256 = ?", site, sha256)}

    def _rows(self, query: str, *given: Any) -> _Rows:
        try:
            return self._database.execute(query, given).fetchall()
        except sqlite3.Error as error:
            raise FleetError(f"{self._root}: its checkpoint is damaged: {error}") from error


def made_by(options: str, rules: Mapping[str, int]) -> str:
    """The options and rules that rows were made by, in one text."""
    return json.dumps([options, rules], sort_keys=True)


def _declared(database: sqlite3.Connection) -> _Rows:
    """All that is declared in a database: no more than these tables may be, least of all what runs by itself."""
    return database.execute("SELECT type, name, tbl_name, sql FROM sqlite_master ORDER BY name").fetchall()
