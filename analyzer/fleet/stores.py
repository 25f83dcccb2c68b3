"""Where a lake's files lie: a folder, or an object store (`s3://` and what else fsspec knows).

A file appears whole or not at all: renamed in a folder once it is on the disk, put in one piece into an object store.
Names are relative to the lake, with slashes. Each store object is a run: before its first file it enters itself in the
lake's account, and the names that it makes hold its number, which no other run has. So what a run left that was killed
is known as this program's; nothing else is ever taken away (`account`).
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, Protocol
from uuid import uuid4

from captures.disposal import TemporaryFolder, move_to_free_name, remove_listed, remove_objects
from captures.errors import os_reason
from captures.recording.mcapfile import sync_folder

from ..extras import needs
from ..version import __version__
from . import FleetError

PackMember = tuple[str, int]  # the name of a file that was packed, and how many rows it had
PART = ".part"  # the end of names of files that are not whole yet


class LakeStore(Protocol):
    """Files of a lake by name."""

    root: str

    def names(self, folder: str) -> list[str]:
        """All files below a folder, sorted; none where it is not there."""
        ...

    def stamps(self, folder: str) -> list[tuple[str, str]]:
        """The same, each with what changes when its content does: its size, and its time or entity tag."""
        ...

    def read(self, name: str) -> bytes: ...

    def write(self, name: str, data: bytes) -> None:
        """A whole file at once."""
        ...

    def put(self, name: str, path: Path) -> None:
        """Give a file that was written below `scratch` its name."""
        ...

    def remove(self, names: Iterable[str]) -> dict[str, str]:
        """Take these files away; why, of those that stay. Only `account` may."""
        ...

    def top(self) -> list[str]:
        """The names at the top of it, of files and folders; none where there is nothing yet."""
        ...

    def fresh(self, prefix: str, suffix: str = "") -> str:
        """A name of this run that no file has or will have: `PREFIX-RUN-NUMBER SUFFIX`."""
        ...

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
        raise FleetError(f"{url}: unknown kind of store: {error}") from error
    return system, str(path)


def store(url: str) -> LakeStore:
    """The store at a path or a URL."""
    return ObjectStore(url) if is_remote(url) else FolderStore(url.removeprefix("file://"))


ACCOUNT: Final = "account"  # the folder with a file a run
SCRATCH: Final = "scratch"


class _RunNames:
    """The names that one run gives; `enter` puts it in the account before the first."""

    def __init__(self, enter: Callable[[str, bytes], None]) -> None:
        self.run = uuid4().hex
        self._enter, self._count = enter, 0

    def fresh(self, prefix: str, suffix: str = "") -> str:
        if not self._count:
            self._enter(f"{ACCOUNT}/{self.run}.json", json.dumps({"run": self.run, "version": __version__}).encode())
        self._count += 1
        return f"{prefix}-{self.run}-{self._count}{suffix}"


class FolderStore:
    """A folder of this machine, or of one that all machines share."""

    def __init__(self, path: str) -> None:
        self.root = str(Path(path).resolve())
        self._folder = Path(self.root)
        self._names = _RunNames(self._put_now)
        self.fresh = self._names.fresh

    def names(self, folder: str) -> list[str]:
        return sorted(name for name, _ in _files_below(os.path.join(self.root, folder), folder))  # noqa: PTH118 - 10 times as fast

    def stamps(self, folder: str) -> list[tuple[str, str]]:
        return sorted((name, _stamp(file)) for name, file in _files_below(os.path.join(self.root, folder), folder))  # noqa: PTH118

    def read(self, name: str) -> bytes:
        with open(os.path.join(self.root, name), "rb", buffering=0) as file:  # noqa: PTH118, PTH123 - a third of its time
            return file.read()

    def write(self, name: str, data: bytes) -> None:
        path = self.scratch()
        with as_fleet_error(self.url(name)), path.open("xb") as file:
            file.write(data)
        self.put(name, path)

    def _put_now(self, name: str, data: bytes) -> None:
        """A small file of which the name is all that counts."""
        path = self._folder / name
        with as_fleet_error(path), suppress(FileExistsError):
            path.parent.mkdir(parents=True, exist_ok=True)
            with path.open("xb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            sync_folder(path.parent)

    def put(self, name: str, path: Path) -> None:
        target = self._folder / name
        with as_fleet_error(target):
            target.parent.mkdir(parents=True, exist_ok=True)
            with path.open("rb+") as file:
                os.fsync(file.fileno())
            move_to_free_name(path, (target,))
            sync_folder(target.parent)

    def remove(self, names: Iterable[str]) -> dict[str, str]:
        return remove_listed(self._folder, names)

    def top(self) -> list[str]:
        with as_fleet_error(self.root):
            return sorted(path.name for path in self._folder.iterdir()) if self._folder.exists() else []

    def url(self, name: str) -> str:
        return f"{self.root}/{name}"

    def scratch(self) -> Path:
        path = self._folder / self.fresh(f"{SCRATCH}/rows", PART)
        with as_fleet_error(path.parent):
            path.parent.mkdir(parents=True, exist_ok=True)
        return path


def _files_below(path: str, name: str) -> Iterator[tuple[str, os.DirEntry[str]]]:
    """The files below a folder that has this name; none where it is not there."""
    with suppress(FileNotFoundError, NotADirectoryError, PermissionError), os.scandir(path) as found:
        for each in found:
            if each.is_dir(follow_symlinks=False):
                yield from _files_below(each.path, f"{name}/{each.name}")
            elif each.is_file():
                yield f"{name}/{each.name}", each


def _stamp(file: os.DirEntry[str]) -> str:
    status = file.stat()
    return f"{status.st_size} {status.st_mtime_ns}"


class ObjectStore:
    """A prefix in an object store."""

    def __init__(self, url: str) -> None:
        self.root = url.rstrip("/")
        self._system, self._path = filesystem(self.root)
        self._temporary: TemporaryFolder | None = None
        self._names = _RunNames(self.write)
        self.fresh = self._names.fresh

    def names(self, folder: str) -> list[str]:
        self._system.invalidate_cache()
        with as_fleet_error(f"{self.root}/{folder}"):
            paths = self._system.find(f"{self._path}/{folder}")
        return sorted(path[len(self._path) + 1 :] for path in paths)

    def stamps(self, folder: str) -> list[tuple[str, str]]:
        self._system.invalidate_cache()
        with as_fleet_error(f"{self.root}/{folder}"):
            found = self._system.find(f"{self._path}/{folder}", detail=True)
        return sorted(
            (path[len(self._path) + 1 :], f"{file['size']} {entity_tag(file)}") for path, file in found.items()
        )

    def read(self, name: str) -> bytes:
        with as_fleet_error(self.url(name)):
            return bytes(self._system.cat_file(f"{self._path}/{name}"))

    def write(self, name: str, data: bytes) -> None:
        with as_fleet_error(self.url(name)):
            self._system.pipe_file(f"{self._path}/{name}", data)

    def put(self, name: str, path: Path) -> None:
        with as_fleet_error(self.url(name)):
            self._system.put_file(str(path), f"{self._path}/{name}")
        remove_listed(path.parent, [path.name])

    def remove(self, names: Iterable[str]) -> dict[str, str]:
        return remove_objects(self._system, self._path, names)

    def top(self) -> list[str]:
        self._system.invalidate_cache()
        with as_fleet_error(self.root), suppress(FileNotFoundError):
            paths = (path.rstrip("/") for path in self._system.ls(self._path, detail=False))
            return sorted(path.rpartition("/")[2] for path in paths if path != self._path.rstrip("/"))
        return []

    def url(self, name: str) -> str:
        return f"{self.root}/{name}"

    def scratch(self) -> Path:
        if self._temporary is None:
            self._temporary = TemporaryFolder("rtuscope-lake-")
        return self._temporary.path / f"{uuid4().hex}{PART}"


def entity_tag(file: Mapping[str, Any]) -> str:
    """What changes with the content of a file of an object store, as its library tells of it; or nothing."""
    return str(file.get("ETag") or file.get("etag") or file.get("md5Hash") or file.get("mtime") or "")


@contextmanager
def fetched(url: str) -> Iterator[Path]:
    """A source as a file of this machine, for as long as the block lasts. Raises FleetError where it is gone."""
    if not is_remote(url):
        yield Path(url)
        return
    system, path = filesystem(url)
    with TemporaryFolder("rtuscope-source-") as folder:
        target = folder / (Path(path).name or "capture")
        with as_fleet_error(url):
            system.get_file(path, str(target))
        yield target


@contextmanager
def as_fleet_error(where: object) -> Iterator[None]:
    """What an operating system, or a store's library, says of a failure, as a FleetError."""
    try:
        yield
    except OSError as error:
        raise FleetError(f"{where}: {os_reason(error)}") from error
    except Exception as error:
        if type(error).__module__.partition(".")[0] not in ("botocore", "aiohttp", "google", "gcsfs", "azure"):
            raise
        raise FleetError(f"{where}: {' '.join(str(error).split())}") from error
