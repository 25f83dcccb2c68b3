"""Which files of a lake count: its manifest.

An entry, one a finished task, is a small JSON file `manifest/NUMBER.json` that is only ever added; it names the task's
files: those of a line, or under `lines` those of several, and under `packs` the files that hold their rows. Readers
take what the entries name and nothing else, so a lake is whole at each moment. An entry that goes on from an earlier
one (`after`) takes the place of that one's tail, the rows that were not yet certain at the end of its last slice; one
that does not takes the place of all earlier ones of its line.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

from . import FleetError
from .entries import FOLDER, entry_names, lines_in, listed_in, read_entry, reading_many
from .stores import LakeStore, PackMember


@dataclass(slots=True)
class LakeLine:
    """One line of a lake, as its entries have it."""

    site: str
    line: str
    entries: list[Mapping[str, Any]] = field(default_factory=list)
    numbers: list[int] = field(default_factory=list)

    @property
    def last(self) -> Mapping[str, Any]:
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
    """The entries of a lake, each read once; `add` writes one more."""

    def __init__(self, store: LakeStore) -> None:
        self.store = store
        self._forget()
        self.read_on()

    def _forget(self) -> None:
        self.lines: dict[tuple[str, str], LakeLine] = {}
        self.packs: dict[str, Pack] = {}
        self._numbers: set[int] = set()
        self._packed: dict[str, tuple[str, int]] = {}  # pack and part that hold a file's rows
        self.listed: set[str] = set()  # all files that an entry ever named
        self.newest = 0
        self._newest_entry = b""

    def read_on(self) -> Manifest:
        """The same with the entries that came since it was read; all anew where it is another's by now."""
        there = dict(entry_names(self.store))
        if not self._is_that(there):
            self._forget()
        try:
            with reading_many():
                for number, name in there.items():
                    if number not in self._numbers:
                        self._take(number, *read_entry(self.store, name))
            self._newest_entry = self.store.read(there[self.newest]) if there else b""
        except BaseException:
            self._forget()  # half an entry would make its files nobody's
            raise
        return self

    def _is_that(self, there: Mapping[int, str]) -> bool:
        """Whether the entries that were read are among these: the newest holds names that no other lake has."""
        if not self._numbers <= there.keys():
            return False
        with suppress(FleetError, OSError):
            return not self._numbers or self.store.read(there[self.newest]) == self._newest_entry
        return False

    @classmethod
    def of(cls, store: LakeStore) -> Manifest:
        """That of a lake. Raises FleetError where there is none."""
        manifest = cls(store)
        if not manifest.newest:
            raise FleetError(f"{store.root}: is not a lake: create one with rtuscope batch")
        return manifest

    def add(self, lines: Sequence[dict[str, Any]], packs: Sequence[dict[str, Any]] = ()) -> None:
        """One more entry, of lines and of packs: from now on their files are the lake's."""
        entry = lines[0] if len(lines) == 1 and not packs else {"packs": packs} | ({"lines": lines} if lines else {})
        number = self.newest + 1
        name = f"{FOLDER}/{number:08d}.json"
        data = json.dumps(entry, separators=(",", ":")).encode()
        self.store.write(name, data)
        self._take(number, entry, listed_in(entry))
        self._newest_entry = data

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
        lines = self.lines.values()
        named = {line.last["state"] for line in lines if line.last["state"]}
        for line in lines:
            for files in (*(entry["files"] for entry in line.entries), line.last["tail"]):
                named.update([name for members in files.values() for name, _ in members])
        packed = named & self._packed.keys()
        return (named - packed) | {self._packed[name][0] for name in packed}

    def _take(self, number: int, entry: Mapping[str, Any], listed: set[str]) -> None:
        self.newest = max(self.newest, number)
        self._numbers.add(number)
        self.listed |= listed
        self._take_packs(entry.get("packs", ()))
        for line in lines_in(entry):
            self._take_line(number, line)

    def _take_line(self, number: int, entry: Mapping[str, Any]) -> None:
        key, after = (entry["site"], entry["line"]), entry["after"]
        if after is not None and after not in self._numbers:
            raise FleetError(f"{self.store.root}: entry {after} of its manifest is missing")
        line = self.lines.get(key)
        if line is None or after is None or after != line.numbers[-1]:
            line = self.lines[key] = LakeLine(*key)
        line.entries.append(entry)
        line.numbers.append(number)

    def _take_packs(self, packs: Iterable[dict[str, Any]]) -> None:
        for pack in packs:
            members = tuple((name, rows) for name, rows in pack["members"])
            self.packs[pack["name"]] = Pack(pack["table"], members)
            self._packed |= {name: (pack["name"], part) for part, (name, _) in enumerate(members)}
