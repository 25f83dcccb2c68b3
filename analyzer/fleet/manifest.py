"""What a lake consists of: entries, one a finished task, in the order in which they were made.

An entry is a small JSON file `manifest/NUMBER-LINE.json` that is only ever added; it names the task's files. Readers
take what the entries name and nothing else, so a lake is whole at each moment. An entry that goes on from an earlier
one (`after`) takes the place of that one's tail, the rows that were not yet certain at the end of its last slice; one
that does not takes the place of all earlier ones of its line.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from .errors import FleetError
from .stores import FolderStore, LakeStore

FOLDER: Final = "manifest"


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

    def files(self, table: str) -> Iterator[str]:
        """The names of the files of a table."""
        for entry in self.entries:
            yield from (name for name, _ in entry["files"].get(table, ()))
        yield from (name for name, _ in self.last["tail"].get(table, ()))

    def rows(self, table: str) -> int:
        """How many rows of a table there are."""
        parts = [*(entry["files"] for entry in self.entries), self.last["tail"]]
        return sum(count for part in parts for _, count in part.get(table, ()))


class Manifest:
    """The entries of a lake, read once; `add` writes one more."""

    def __init__(self, store: LakeStore) -> None:
        self.store = store
        self.lines: dict[tuple[str, str], LakeLine] = {}
        self.newest = 0
        for name in store.names(FOLDER):
            if name.endswith(".json"):
                self._take(_number(name), _entry(store, name))

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

    def files(self, table: str) -> list[str]:
        """The names of the files of a table, in the order of sites, lines and rows."""
        return [name for _, line in sorted(self.lines.items()) for name in line.files(table)]

    def named(self) -> set[str]:
        """All files that are the lake's."""
        named = {line.last["state"] for line in self.lines.values() if line.last["state"]}
        for line in self.lines.values():
            for part in [*(entry["files"] for entry in line.entries), line.last["tail"]]:
                named |= {name for files in part.values() for name, _ in files}
        return named

    def _take(self, number: int, entry: dict[str, Any]) -> None:
        self.newest = max(self.newest, number)
        key = (entry["site"], entry["line"])
        line = self.lines.get(key)
        if line is None or entry["after"] is None or entry["after"] != line.numbers[-1]:
            line = self.lines[key] = LakeLine(*key)
        line.entries.append(entry)
        line.numbers.append(number)


def _number(name: str) -> int:
    stem = name.rpartition("/")[2].removesuffix(".json")
    return int(stem) if stem.isdecimal() else 0


def _entry(store: LakeStore, name: str) -> dict[str, Any]:
    try:
        entry = json.loads(store.read(name))
        if isinstance(entry, dict) and {"site", "line", "after", "slices", "files", "tail", "state"} <= entry.keys():
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
