"""Names and limits of a recording's files: when to begin the next one, and which of the old ones to give up.

Files of a ring are named by the UTC time of their beginning, NAME-20261121T104500.123Z.mcap, which is for people only:
clocks are set, forwards and back. What is old is told by the ring's own account, which each file has in its metadata:
its number, and for how long had been recorded when it began. So a time to keep counts time of recording, and a recorder
that is started again goes on where it was. Given up are only files that the ring's list names (`ringlist`) and whose
own metadata has the ring's id and ports.
"""

from __future__ import annotations

import re
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Final

from ..disposal import remove_listed
from ..formats.mcap.reading import first_metadata, log_time_span
from .mcapfile import PART
from .ringlist import RingList

SUFFIX: Final = ".mcap"
_LONGEST_S: Final = 86_400.0  # of one file, asked or not: its index is in memory
_LARGEST: Final = 1 << 30
_SHARES: Final = 20  # files of a ring, at least
_LEAST: Final = 1 << 20
_NUMBER: Final = "ring_number"  # in a file's metadata
_BEGUN: Final = "ring_begun_s"
_RING: Final = "ring"
_PORTS: Final = "ports"


@dataclass(frozen=True, slots=True)
class RingLimits:
    """What was asked; None for what was not. Seconds and bytes."""

    every_s: float | None = None  # begin a new file so often
    size: int | None = None  # or when it has this size
    keep_s: float | None = None  # give up files that ended so long ago
    keep_bytes: int | None = None  # or the oldest while all together are larger

    @property
    def ring(self) -> bool:
        """Whether old files are given up."""
        return self.keep_s is not None or self.keep_bytes is not None

    @property
    def rotates(self) -> bool:
        """Whether there will be several files."""
        return self.ring or self.every_s is not None or self.size is not None

    @property
    def file_s(self) -> float:
        """The longest time of one file."""
        share = _LONGEST_S if self.keep_s is None else max(60.0, self.keep_s / _SHARES)
        return min(_LONGEST_S, self.every_s or share)

    @property
    def file_bytes(self) -> int:
        """The largest size of one file, about."""
        share = _LARGEST if self.keep_bytes is None else max(_LEAST, self.keep_bytes // _SHARES)
        return min(_LARGEST, self.size or share)


@dataclass(frozen=True, slots=True, order=True)
class RingEntry:
    """A file's place in the account: its number, and seconds recorded before it began. Files of before have none."""

    number: int = 0
    begun_s: float = 0.0

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str]) -> RingEntry:
        """What a file says of itself; an entry before all others where it says nothing that is one."""
        try:
            number, begun_s = int(metadata[_NUMBER]), float(metadata[_BEGUN])
        except (KeyError, ValueError):
            return cls()
        return cls(number, begun_s) if number > 0 and 0 <= begun_s < float("inf") else cls()

    def metadata(self) -> dict[str, str]:
        """The same for a file to say."""
        return {_NUMBER: str(self.number), _BEGUN: f"{self.begun_s:.1f}"}


class Ring:
    """The files of one recording of these ports. `entry` is that of the newest file, or of one to come."""

    def __init__(self, path: Path, limits: RingLimits, ports: str = "") -> None:
        self.path = path
        self.limits = limits
        self._pattern = re.compile(rf"{re.escape(path.stem)}-\d{{8}}T\d{{6}}\.\d{{3}}Z{re.escape(path.suffix)}")
        self._list = RingList(path, ports)
        self._entries: dict[Path, RingEntry] = {}
        self.entry = RingEntry()
        self._recorded_s, self._since = 0.0, time.monotonic()  # seconds recorded until then
        self._go_on()

    def claim(self, tell: Callable[[str], None]) -> None:
        """Record it from now on; nobody else does meanwhile. OSError where that cannot be, or another does."""
        if self._list.claim(tell):
            self._go_on()

    def _go_on(self) -> None:
        """Where the recorder before this one was."""
        if self.limits.rotates and (files := self.files()):
            self.entry = self._entries[files[-1]]
            self._recorded_s = self.entry.begun_s + min(log_time_span(files[-1]) / 1e9, _LONGEST_S)
            self._since = time.monotonic()

    def release(self) -> None:
        """Nobody records it any more."""
        self._list.close()

    def metadata(self) -> dict[str, str]:
        """What the newest file says of itself, where there will be several."""
        if not self.limits.rotates:
            return {}
        return {**self.entry.metadata(), _RING: self._list.id, _PORTS: self._list.ports}

    def recorded_s(self) -> float:
        """For how long has been recorded, by all recorders of this ring one after the other."""
        return self._recorded_s + time.monotonic() - self._since

    def begin(self, *, first: bool) -> Path:
        """The name of a file that begins now; `entry` is its own from then on."""
        self.entry = RingEntry(self.entry.number + 1, self.recorded_s())
        return self.path if first and not self.limits.rotates else next(self.free_names(time.time()))

    def free_names(self, t_s: float) -> Iterator[Path]:
        """Names for a file that began at this time, as yet free."""
        try:
            begun = datetime.fromtimestamp(t_s, UTC)
        except (OverflowError, ValueError, OSError):  # a clock that is far off
            begun = datetime.fromtimestamp(0, UTC)
        for milliseconds in count():
            at = begun + timedelta(milliseconds=milliseconds)
            stamp = at.isoformat(timespec="milliseconds").replace("-", "").replace(":", "").replace("+0000", "Z")
            name = self.path.with_name(f"{self.path.stem}-{stamp}{self.path.suffix}")
            if not name.exists() and not name.with_name(name.name + PART).exists():
                yield name

    def files(self) -> list[Path]:
        """The whole files that are this ring's, oldest first."""
        return self._sorted()[0]

    def strangers(self) -> list[Path]:
        """Files with a name like the ring's that are not its own: another's, or of before rings had lists."""
        return self._sorted()[1]

    def _sorted(self) -> tuple[list[Path], list[Path]]:
        files = [path for path in self.path.parent.iterdir() if self._pattern.fullmatch(path.name)]
        listed = self._list.files
        known = {path: entry for path in files if (entry := self._entries.get(path) or self._entry(path, listed))}
        self._entries = known
        return sorted(known, key=lambda path: (known[path], path.name)), sorted({*files} - {*known})

    def _entry(self, path: Path, listed: set[str]) -> RingEntry | None:
        """The entry of a file; None of one that is not this ring's."""
        if path.name not in listed or path.is_symlink():
            return None
        metadata = first_metadata(path)
        own = (metadata.get(_RING), metadata.get(_PORTS)) == (self._list.id, self._list.ports)
        return RingEntry.from_metadata(metadata) if own else None

    def listed(self, path: Path) -> None:
        """A file with this name is the ring's. OSError where the list could not be written, which is tried again."""
        if self.limits.rotates:
            self._list.add(path.name)
            self._list.save()

    def ended(self, path: Path) -> None:
        """The newest file has this name for good."""
        if self.limits.rotates:
            self._entries[path] = self.entry

    def give_up(self, path: Path) -> str:
        """Take a file of the ring away; why it stays where it does, nothing where it is gone."""
        self._entries.pop(path, None)
        if path.exists() and self._entry(path, self._list.files) is None:
            return "is a different file now"
        return remove_listed(path.parent, [path.name]).get(path.name, "")

    def cut(self) -> list[Path]:
        """Files that a recorder before this one could not close, but for those that others' rings will."""
        names = [(path, path.name.removesuffix(PART)) for path in self.path.parent.glob(f"*{PART}")]
        own = [path for path, name in names if self._pattern.fullmatch(name) or name == self.path.name]
        return sorted(path for path in own if self.limits.rotates or _RING not in first_metadata(path))

    def surplus(self, current: int) -> list[Path]:
        """The files to give up now, beside one of `current` bytes that is being written."""
        limits, files = self.limits, self.files()
        gone = []
        if limits.keep_s is not None:
            before_s = self.recorded_s() - limits.keep_s
            begun = [*(self._entries[path].begun_s for path in files), self.entry.begun_s]
            gone = [path for path, end in zip(files, begun[1:], strict=True) if end < before_s]  # when the next began
        if limits.keep_bytes is not None:
            left = [path for path in files if path not in gone]
            sizes = {path: _size(path) for path in left}
            total = current + sum(sizes.values())
            for path in left:
                if total <= limits.keep_bytes:
                    break
                total -= sizes[path]
                gone.append(path)
        return gone


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:  # given up by someone else meanwhile
        return 0
