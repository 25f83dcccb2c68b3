"""The list of a ring's files, `NAME.ring` beside them: what its recorders made, so that nothing else is given up.

One name may hold the rings of several ports, one recorder after the other; each ring has an id that nothing else has.
A file is a ring's where this list names it and its own metadata has the ring's id. The list is JSON, a line each: what
it is, then a ring (`ring`, its id, and `ports`) followed by its files (`file`, a name in the same folder). Lines are
only ever added. Whoever records holds its lock.
"""

from __future__ import annotations

import errno
import os
from collections import defaultdict
from collections.abc import Callable
from contextlib import suppress
from itertools import count
from pathlib import Path, PurePath
from typing import Any, Final
from uuid import uuid4

import orjson

from ..disposal import cut_back, made, move_to_free_name, part_of, put_in_place, remove_made
from ..locks import LockedElsewhereError, lock, opened_and_locked
from .mcapfile import write_behind

SUFFIX: Final = ".ring"
_HEAD: Final = {"format": "rtuscope-ring", "version": 1}
_GONE: Final = 2000  # names of files that are there no more: beyond that the list is written anew
_OPEN_STAYS: Final = os.name == "nt"  # a file that is open can be neither renamed nor replaced


class RingList:
    """The list beside a recording, of one ring in it: that of these ports."""

    def __init__(self, recording: Path, ports: str) -> None:
        """What it says now: nothing, where it is none or cannot be read."""
        self.path = recording.with_suffix(SUFFIX)
        self.ports = ports
        self.id = ""  # until there is a ring of these ports
        self._rings: dict[str, str] = {}  # ports by id
        self._files: defaultdict[str, set[str]] = defaultdict(set)
        self._descriptor = -1
        self._size = 0  # bytes that are safe
        self._waiting = b""  # lines that the disk has not taken
        self._load()

    @property
    def files(self) -> set[str]:
        """The names of the files that this ring's recorders made, there or not."""
        return self._files[self.id] if self.id else set()

    def claim(self, tell: Callable[[str], None]) -> bool:
        """Record this ring from now on, nobody else meanwhile. OSError where that cannot be, or another does.

        False where it was claimed already.
        Another file under the list's name is set aside, and told.
        """
        if self._descriptor >= 0:
            return False
        self._descriptor = self._locked()
        try:
            if not self._load():
                tell(f"recording: {self.path} is not the list of a ring: set aside as {self._set_aside()}")
                self._descriptor = self._locked()
                self._load()
            cut_back(self._descriptor, self._size)
        except OSError:
            self.close()
            raise
        self.id = self.id or uuid4().hex
        self._rings.setdefault(self.id, self.ports)
        self._waiting = self._head + _line({"ring": self.id, "ports": self.ports})
        with suppress(OSError):  # a full disk: it goes there with the next file
            self.save()
        self._compact()
        return True

    def _set_aside(self) -> Path:
        """Give the file another name, and let its lock go."""
        if _OPEN_STAYS:  # and no other recorder has it open, or it would not be renamed
            self._release()
        aside = move_to_free_name(self.path, (self.path.with_name(f"{self.path.name}.{n}") for n in count(1)))
        self._release()
        return aside

    def _release(self) -> None:
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)

    def _locked(self) -> int:
        try:
            return opened_and_locked(self.path)
        except LockedElsewhereError as error:
            raise OSError(errno.EBUSY, "another recorder is writing this ring") from error

    def add(self, name: str) -> None:
        """This ring made the file; `save` puts that on the disk."""
        if name not in self._files[self.id]:
            self._files[self.id].add(name)
            self._waiting += _line({"file": name})

    def save(self) -> None:
        """Put on the disk what it has not taken; OSError where it takes nothing now, which then can be tried again."""
        if self._descriptor < 0 or not self._waiting:
            return
        self._renew()
        write_behind(self._descriptor, self._size, self._waiting)
        self._size += len(self._waiting)
        self._waiting = b""

    def close(self) -> None:
        """Let the ring go."""
        with suppress(OSError):
            self.save()
        self._release()

    def _renew(self) -> None:
        """A list that someone has taken away is made again of what is known."""
        with suppress(OSError):
            if self.path.exists() and os.path.samestat(self.path.stat(), os.fstat(self._descriptor)):
                return
        descriptor = self._locked()
        os.close(self._descriptor)
        self._descriptor = descriptor
        self._size = os.fstat(descriptor).st_size
        self._waiting = self._head + self._told(self._files[self.id])

    @property
    def _head(self) -> bytes:
        """What begins the list, where nothing does yet."""
        return b"" if self._size else _line(_HEAD)

    def _told(self, names: set[str]) -> bytes:
        ring = {"ring": self.id, "ports": self.ports}
        return _line(ring) + b"".join(_line({"file": name}) for name in sorted(names))

    def _compact(self) -> None:
        """Without the names of files that are there no more, where there are very many."""
        folder = self.path.parent
        there = {ring: {name for name in names if (folder / name).exists()} for ring, names in self._files.items()}
        if _OPEN_STAYS or sum(map(len, self._files.values())) - sum(map(len, there.values())) < _GONE:
            return
        lines = [_line(_HEAD)]
        for ring, names in there.items():
            if ring != self.id:
                lines.append(_line({"ring": ring, "ports": self._rings[ring]}))
                lines += [_line({"file": name}) for name in sorted(names)]
        text = b"".join([*lines, self._told(there[self.id])])
        with suppress(OSError):  # a full disk: the next recorder tries it again
            descriptor, part = part_of(self.path)
            mine = made(part)
            try:
                lock(descriptor)
                write_behind(descriptor, 0, text)
                put_in_place(part, self.path)
            except (OSError, LockedElsewhereError):
                os.close(descriptor)
                remove_made(part, mine)
                return
            self._release()
            self._descriptor, self._size = descriptor, len(text)
            self._files = defaultdict(set, there)

    def _load(self) -> bool:
        """Read it, but for a line that was cut; False where it is no such list."""
        try:
            data = self.path.read_bytes()
        except OSError:
            data = b""
        whole = data[: data.rfind(b"\n") + 1]
        head, *entries = [_entry(line) for line in whole.splitlines()] or [None]
        if head != _HEAD:
            return _line(_HEAD).startswith(data)
        self._size = len(whole)
        ring = ""
        for entry in filter(None, entries):
            name = entry.get("file")
            if isinstance(entry.get("ring"), str) and isinstance(entry.get("ports"), str):
                ring = entry["ring"]
                self._rings[ring] = entry["ports"]
            elif ring and isinstance(name, str) and PurePath(name).name == name:
                self._files[ring].add(name)
        self.id = next((ring for ring, ports in self._rings.items() if ports == self.ports), self.id)
        return True


def _line(entry: dict[str, Any]) -> bytes:
    return orjson.dumps(entry) + b"\n"


def _entry(line: bytes) -> dict[str, Any] | None:
    with suppress(ValueError):
        entry = orjson.loads(line)
        return entry if isinstance(entry, dict) else None
    return None
