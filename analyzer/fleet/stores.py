"""Where a lake's files lie, a folder or an object store (`s3://` and what else fsspec knows), and which of them count.

A file appears whole or not at all: renamed in a folder once it is on the disk, put in one piece into an object store.
Names are relative to the lake, with slashes.

An entry of the manifest, one a finished task, is a small JSON file `manifest/NUMBER-LINE.json` that is only ever added;
it names the task's files. Readers take what the entries name and nothing else, so a lake is whole at each moment. An
entry that goes on from an earlier one (`after`) takes the place of that one's tail, the rows that were not yet certain
at the end of its last slice; one that does not takes the place of all earlier ones of its line.
"""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, Protocol
from uuid import uuid4

from captures.errors import os_reason

from ..extras import needs
from . import FleetError

PART = ".part"  # the end of names of files that are not whole yet


class LakeStore(Protocol):
    """Files of a lake by name."""

    root: str

    def names(self, folder: str) -> list[str]:
        """All files below a folder, sorted; none where it is not there."""
        ...

    def read(self, name: str) -> bytes: ...

    def write(self, name: str, data: bytes) -> None:
        """A whole file at once."""
        ...

    def put(self, name: str, path: Path) -> None:
        """Give a file that was written below `scratch` its name."""
        ...

    def remove(self, name: str) -> None: ...

    def url(self, name: str) -> str:
        """How other programs find it."""
        ...

    def scratch(self) -> Path:
        """A name for a file to write, from where `put` takes it."""
        ...


def is_remote(url: str) -> bool:
    """Whether it names something in an object store, and not a file of this machine."""
    return "://" in url and not url.startswith("file://")


def filesystem(url: str) -> tuple[Any, str]:
    """The fsspec filesystem of a URL, and the path in it. Raises FleetError where a library for it is missing."""
    try:
        from fsspec.core import url_to_fs
    except ImportError as error:
        raise FleetError(needs(url, "fsspec", "fleet")) from error
    try:
        system, path = url_to_fs(url)
    except ImportError as error:
        raise FleetError(f"{url}: {error}") from error
    except ValueError as error:
        raise FleetError(f"{url}: no such kind of store: {error}") from error
    return system, str(path)


def store(url: str) -> LakeStore:
    """The store at a path or a URL."""
    return ObjectStore(url) if is_remote(url) else FolderStore(url.removeprefix("file://"))


class FolderStore:
    """A folder of this machine, or of one that all machines share."""

    def __init__(self, path: str) -> None:
        self.root = str(Path(path).resolve())
        self._folder = Path(self.root)

    def names(self, folder: str) -> list[str]:
        files = (path for path in (self._folder / folder).rglob("*") if path.is_file())
        return sorted(path.relative_to(self._folder).as_posix() for path in files)

    def read(self, name: str) -> bytes:
        return (self._folder / name).read_bytes()

    def write(self, name: str, data: bytes) -> None:
        path = self.scratch()
        with _as_fleet_error(self.url(name)):
            path.write_bytes(data)
        self.put(name, path)

    def put(self, name: str, path: Path) -> None:
        target = self._folder / name
        with _as_fleet_error(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            with path.open("rb+") as file:
                os.fsync(file.fileno())
            path.replace(target)
            _sync_folder(target.parent)

    def remove(self, name: str) -> None:
        with suppress(FileNotFoundError):
            (self._folder / name).unlink()

    def url(self, name: str) -> str:
        return f"{self.root}/{name}"

    def scratch(self) -> Path:
        folder = self._folder / "scratch"
        with _as_fleet_error(folder):
            folder.mkdir(parents=True, exist_ok=True)
        return folder / f"{uuid4().hex}{PART}"


class ObjectStore:
    """A prefix in an object store."""

    def __init__(self, url: str) -> None:
        self.root = url.rstrip("/")
        self._system, self._path = filesystem(self.root)
        self._temporary: tempfile.TemporaryDirectory[str] | None = None

    def names(self, folder: str) -> list[str]:
        self._system.invalidate_cache()
        with _as_fleet_error(f"{self.root}/{folder}"):
            paths = self._system.find(f"{self._path}/{folder}")
        return sorted(path[len(self._path) + 1 :] for path in paths)

    def read(self, name: str) -> bytes:
        with _as_fleet_error(self.url(name)):
            return bytes(self._system.cat_file(f"{self._path}/{name}"))

    def write(self, name: str, data: bytes) -> None:
        with _as_fleet_error(self.url(name)):
            self._system.pipe_file(f"{self._path}/{name}", data)

    def put(self, name: str, path: Path) -> None:
        with _as_fleet_error(self.url(name)):
            self._system.put_file(str(path), f"{self._path}/{name}")
        path.unlink()

    def remove(self, name: str) -> None:
        with suppress(FileNotFoundError):
            self._system.rm_file(f"{self._path}/{name}")

    def url(self, name: str) -> str:
        return f"{self.root}/{name}"

    def scratch(self) -> Path:
        if self._temporary is None:
            self._temporary = tempfile.TemporaryDirectory(prefix="rtuscope-lake-")
        return Path(self._temporary.name) / f"{uuid4().hex}{PART}"


@contextmanager
def fetched(url: str) -> Iterator[Path]:
    """A source as a file of this machine, for as long as the block lasts. Raises FleetError where it is gone."""
    if not is_remote(url):
        yield Path(url)
        return
    system, path = filesystem(url)
    with tempfile.TemporaryDirectory(prefix="rtuscope-source-") as folder:
        target = Path(folder) / (Path(path).name or "capture")
        with _as_fleet_error(url):
            system.get_file(path, str(target))
        yield target


@contextmanager
def _as_fleet_error(where: object) -> Iterator[None]:
    """What an operating system, or a store's library, says of a failure, as a FleetError."""
    try:
        yield
    except OSError as error:
        raise FleetError(f"{where}: {os_reason(error)}") from error
    except Exception as error:
        if type(error).__module__.partition(".")[0] not in ("botocore", "aiohttp", "google", "gcsfs", "azure"):
            raise
        raise FleetError(f"{where}: {' '.join(str(error).split())}") from error


def _sync_folder(folder: Path) -> None:
    from captures.recording.mcapfile import sync_folder

    sync_folder(folder)


FOLDER: Final = "manifest"
_TASK: Final = {"site", "line", "after", "slices", "files", "tail", "state"}  # the keys of a finished task's entry
PackMember = tuple[str, int]  # the name of a file that was packed, and how many rows it had


@dataclass(slots=True)
class LakeLine:
    """One line of a lake, as its entries have it."""

    site: str
    line: str
    entries: list[dict[str, Any]] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)

    @property
    def last(self) -> dict[str, Any]:
        """The newest entry."""
        return self.entries[-1]

    def slices(self) -> Iterator[dict[str, Any]]:
        """What is known of each of its sources, in order."""
        for entry in self.entries:
            yield from entry["slices"]

    def files(self, table: str) -> Iterator[PackMember]:
        """The names of the files that were made of a table, and how many rows each has."""
        yield from self.settled(table)
        yield from self.tail(table)

    def settled(self, table: str) -> Iterator[PackMember]:
        """Of these those that stay, whatever slices come."""
        for entry in self.entries:
            yield from ((name, rows) for name, rows in entry["files"].get(table, ()))

    def tail(self, table: str) -> Iterator[PackMember]:
        """Of these those that the next slice replaces."""
        yield from ((name, rows) for name, rows in self.last["tail"].get(table, ()))


@dataclass(frozen=True, slots=True)
class Pack:
    """A file with the rows of others, its members; a row's `part` is the number of its member."""

    table: str
    members: tuple[PackMember, ...]


@dataclass(frozen=True, slots=True)
class TableFiles:
    """Where a table's rows lie: files of one line each; packs, with the parts of each that are the lake's no more."""

    loose: list[str]
    packs: dict[str, list[int]]

    @property
    def names(self) -> list[str]:
        """All of them."""
        return [*self.loose, *self.packs]

    def alike(self) -> Iterator[tuple[list[str], list[int]]]:
        """Packs to be read in one go, with the parts to leave out: those that are whole together, each other alone."""
        if whole := [name for name, stale in self.packs.items() if not stale]:
            yield whole, []
        yield from (([name], stale) for name, stale in self.packs.items() if stale)


class Manifest:
    """The entries of a lake, read once; `add` writes one more."""

    def __init__(self, store: LakeStore) -> None:
        self.store = store
        self.lines: dict[tuple[str, str], LakeLine] = {}
        self.packs: dict[str, Pack] = {}
        self._packed: dict[str, tuple[str, int]] = {}  # pack and part that hold a file's rows
        self.newest = 0
        for name in store.names(FOLDER):
            if name.endswith(".json"):
                self._take(_entry_number(name), _entry(store, name))

    @classmethod
    def of(cls, store: LakeStore) -> Manifest:
        """That of a lake. Raises FleetError where there is none."""
        manifest = cls(store)
        if not manifest.newest:
            raise FleetError(f"{store.root}: is no lake: rtuscope batch makes one")
        return manifest

    def add(self, entry: dict[str, Any]) -> None:
        """One more entry: from now on its files are the lake's."""
        number = self.newest + 1
        name = f"{FOLDER}/{number:08d}.json"
        self.store.write(name, json.dumps(entry, separators=(",", ":")).encode())
        self._take(number, entry)

    def rows(self, table: str) -> dict[str, int]:
        """How many rows each file has that was made of a table, in the order of sites, lines and rows."""
        return {name: rows for _, line in sorted(self.lines.items()) for name, rows in line.files(table)}

    def files(self, table: str) -> TableFiles:
        """The files to read for a table."""
        loose: list[str] = []
        live: dict[str, set[int]] = {}
        for name in self.rows(table):
            if (where := self._packed.get(name)) is None:
                loose.append(name)
            else:
                live.setdefault(where[0], set()).add(where[1])
        stale = {pack: sorted(set(range(len(self.packs[pack].members))) - parts) for pack, parts in live.items()}
        return TableFiles(loose, stale)

    def named(self) -> set[str]:
        """All files that are the lake's."""
        named = {line.last["state"] for line in self.lines.values() if line.last["state"]}
        tables = {table for line in self.lines.values() for entry in line.entries for table in entry["files"]}
        tables |= {table for line in self.lines.values() for table in line.last["tail"]}
        return named.union(*(self.files(table).names for table in tables))

    def _take(self, number: int, entry: dict[str, Any]) -> None:
        self.newest = max(self.newest, number)
        if "packs" in entry:
            self._take_packs(entry["packs"])
            return
        key = (entry["site"], entry["line"])
        line = self.lines.get(key)
        if line is None or entry["after"] is None or entry["after"] != line.numbers[-1]:
            line = self.lines[key] = LakeLine(*key)
        line.entries.append(entry)
        line.numbers.append(number)

    def _take_packs(self, packs: list[dict[str, Any]]) -> None:
        for pack in packs:
            members = tuple((name, rows) for name, rows in pack["members"])
            self.packs[pack["name"]] = Pack(pack["table"], members)
            self._packed |= {name: (pack["name"], part) for part, (name, _) in enumerate(members)}


def _entry_number(name: str) -> int:
    stem = name.rpartition("/")[2].removesuffix(".json")
    return int(stem) if stem.isdecimal() else 0


def _entry(store: LakeStore, name: str) -> dict[str, Any]:
    try:
        entry = json.loads(store.read(name))
        if isinstance(entry, dict) and (entry.keys() >= _TASK or {"packs"} == entry.keys()):
            return entry
    except ValueError:
        pass
    raise FleetError(f"{store.url(name)}: is no entry of a lake's manifest")


@contextmanager
def writing(store: LakeStore) -> Iterator[None]:
    """Only one batch writes a lake at a time, as far as the system can tell. Raises FleetError where one does."""
    if not isinstance(store, FolderStore):
        yield
        return
    try:
        import fcntl
    except ImportError:  # Windows
        yield
        return
    folder = Path(store.root)
    folder.mkdir(parents=True, exist_ok=True)
    descriptor = os.open(folder / ".writing", os.O_RDWR | os.O_CREAT, 0o644)
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FleetError(f"{store.root}: another batch writes this lake now") from None
        yield
    finally:
        os.close(descriptor)
