"""Where a lake's files lie: a folder, or an object store that fsspec knows (`s3://`, `gs://`, `az://` ...).

A file appears whole or not at all: renamed in a folder once it is on the disk, put in one piece into an object store.
Names are relative to the lake, with slashes.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Protocol
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
