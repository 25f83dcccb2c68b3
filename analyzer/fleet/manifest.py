"""Which files of a lake count: its manifest.

An entry, one a finished task, is a small JSON file `manifest/NUMBER.json` that is only ever added; it names the task's
files: those of a line, or under `lines` those of several, and under `packs` the files that hold their rows. Readers
take what the entries name and nothing else, so a lake is whole at each moment. An entry that goes on from an earlier
one (`after`) takes the place of that one's tail, the rows that were not yet certain at the end of its last slice; one
that does not takes the place of all earlier ones of its line.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Final

from . import FleetError
from .catalog import Catalog
from .checkpoints import NEW_ENTRIES, NEW_SHARE, Entries, newest_checkpoint, write_checkpoint
from .entries import FOLDER, entries_there, in_lake, lines_in, read_entry, reading_many
from .stores import LakeStore, PackMember

_RECENT: Final = 64  # entries that are kept as they are, once a line of theirs was asked for


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
    """The entries of a lake; `add` writes one more.

    What they come to is kept in a catalog, of which `checkpoint` writes down what the next reader then need not read.
    """

    def __init__(self, store: LakeStore) -> None:
        self.store = store
        self._forget()
        self.read_on()

    def _forget(self) -> None:
        self.catalog = Catalog(self.store.root)
        self._names: dict[int, str] = {}  # of the entries that were taken
        self._recent: dict[int, dict[str, Any]] = {}  # of these some, as they are
        self.newest = 0  # the number of the last entry
        self._newest_entry = b""
        self._held = 0  # entries that a checkpoint holds, by the number of the last

    def read_on(self) -> Manifest:
        """The same with the entries that came since it was read; all anew where it is another's by now."""
        there = dict(entries_there(self.store))
        if not self._is_that(there):
            self._forget()
        if not self._names and (found := newest_checkpoint(self.store, there)) is not None:
            self.catalog, self._held = found
            self.newest = self._held
            self._names = {number: name for number, (name, _) in there.items() if number <= self._held}
        fresh = [(number, name) for number, (name, _) in there.items() if number not in self._names]
        try:
            with reading_many(), self.catalog.changing():
                for number, name in fresh:
                    self._take(number, name, read_entry(self.store, name))
            self._newest_entry = self.store.read(self._names[self.newest]) if there else b""
        except BaseException:
            self._forget()  # half an entry would make its files nobody's
            raise
        return self

    def _is_that(self, there: Entries) -> bool:
        """Whether the entries that were read are among these: the newest holds names that no other lake has."""
        if not self._names.keys() <= there.keys():
            return False
        with suppress(FleetError, OSError):
            return not self._names or self.store.read(self._names[self.newest]) == self._newest_entry
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
        self._write(
            lines[0] if len(lines) == 1 and not packs else {"packs": packs} | ({"lines": lines} if lines else {})
        )

    def _write(self, entry: dict[str, Any]) -> None:
        number = self.newest + 1
        name = f"{FOLDER}/{number:08d}.json"
        data = json.dumps(entry, separators=(",", ":")).encode()
        self.store.write(name, data)
        with self.catalog.changing():
            self._take(number, name, entry)
        self._newest_entry = data

    def _take(self, number: int, name: str, entry: Mapping[str, Any]) -> None:
        for line in lines_in(entry):
            if line["after"] is not None and line["after"] not in self._names:
                raise FleetError(f"{self.store.root}: entry {line['after']} of its manifest is missing")
        self.catalog.take(number, lines_in(entry), entry.get("packs", ()), entry.get("checkpoint"))
        self._names[number] = name
        self.newest = max(self.newest, number)

    def checkpoint(self) -> None:
        """Write down what the entries come to, where many are new since that was done; none is needed.

        The caller has the lake to itself.
        """
        there = dict(entries_there(self.store))
        fresh = self.newest - self._held
        if there.keys() != self._names.keys() or fresh < max(NEW_ENTRIES, self.newest // NEW_SHARE):
            return
        with suppress(FleetError):
            name, self._held = write_checkpoint(self.store, self.catalog, there), self.newest
            self._write({"packs": [], "checkpoint": name})

    @property
    def lines(self) -> list[tuple[str, str]]:
        """Site and name of each line, in their order."""
        return self.catalog.lines()

    def line(self, site: str, line: str) -> LakeLine | None:
        """A line as its entries have it; None where there is none of this name. Raises FleetError."""
        numbers = self.catalog.entries(site, line)
        entries = [
            next(each for each in self._lines_of(number) if each["site"] == site and each["line"] == line)
            for number in numbers
        ]
        return LakeLine(site, line, entries, numbers) if numbers else None

    def _lines_of(self, number: int) -> Sequence[Mapping[str, Any]]:
        if number not in self._recent:
            if len(self._recent) >= _RECENT:
                self._recent.clear()
            self._recent[number] = read_entry(self.store, self._names[number])
        return lines_in(self._recent[number])

    def rows(self, table: str) -> dict[str, int]:
        """How many rows each file has that was made of a table, in the order of sites, lines and rows."""
        return self.catalog.rows(table)

    def files(self, table: str) -> TableFiles:
        """The files to read for a table. Raises FleetError."""
        loose, packs = [*self.catalog.loose(table)], self.catalog.packs(table)
        if not in_lake([*loose, *(pack.name for pack in packs)]):
            raise FleetError(f"{self.store.root}: its manifest is damaged: it names files outside of the lake")
        return TableFiles(
            loose,
            {
                pack.name: sorted({*range(pack.members)} - self.catalog.members(pack.name).keys())
                if pack.live < pack.members
                else []
                for pack in packs
            },
        )

    def named(self) -> set[str]:
        """All files that are the lake's."""
        return self.catalog.named()
