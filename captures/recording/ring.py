"""Names and limits of a recording's files: when to begin the next one, and which of the old ones to give up.

Files of a ring are named by the UTC time of their beginning, NAME-20261121T104500.123Z.mcap, which is for people only:
clocks are set, forwards and back. What is old is told by the ring's own account, which each file has in its metadata:
its number, and for how long had been recorded when it began. So a time to keep counts time of recording, and a recorder
that is started again goes on where it was.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path
from typing import Final

from ..formats.mcap.reading import first_metadata, log_time_span
from .mcapfile import PART

SUFFIX: Final = ".mcap"
_LONGEST_S: Final = 86_400.0  # of one file, asked or not: its index is in memory
_LARGEST: Final = 1 << 30
_SHARES: Final = 20  # files of a ring, at least
_LEAST: Final = 1 << 20
_NUMBER: Final = "ring_number"  # in a file's metadata
_BEGUN: Final = "ring_begun_s"


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
    """The files of one recording. `entry` is that of the newest file, or of one to come."""

    def __init__(self, path: Path, limits: RingLimits) -> None:
        self.path = path
        self.limits = limits
        self._pattern = re.compile(rf"{re.escape(path.stem)}-\d{{8}}T\d{{6}}\.\d{{3}}Z{re.escape(path.suffix)}")
        self._entries: dict[Path, RingEntry] = {}
        self.entry = RingEntry()
        self._recorded_s, self._since = 0.0, time.monotonic()  # seconds recorded until then
        if limits.rotates and (files := self.files()):
            self.entry = self._entries[files[-1]]
            self._recorded_s = self.entry.begun_s + min(log_time_span(files[-1]) / 1e9, _LONGEST_S)

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
        """The whole files, oldest first."""
        files = [path for path in self.path.parent.iterdir() if self._pattern.fullmatch(path.name)]
        self._entries = {
            path: self._entries.get(path) or RingEntry.from_metadata(first_metadata(path)) for path in files
        }
        return sorted(files, key=lambda path: (self._entries[path], path.name))

    def ended(self, path: Path) -> None:
        """The newest file has this name for good."""
        self._entries[path] = self.entry

    def cut(self) -> list[Path]:
        """Files that a recorder before this one could not close."""
        names = ((path, path.name.removesuffix(PART)) for path in self.path.parent.glob(f"*{PART}"))
        return sorted(path for path, name in names if self._pattern.fullmatch(name) or name == self.path.name)

    def surplus(self, current: int) -> list[Path]:
        """The files to give up now, beside one of `current` bytes that is being written."""
        limits, files = self.limits, self.files()
        gone = []
        if limits.keep_s is not None:
            before_s = self.recorded_s() - limits.keep_s
            ends = [*(self._entries[path].begun_s for path in files[1:]), self.entry.begun_s]  # when the next begins
            gone = [path for path, end in zip(files, ends, strict=True) if end < before_s]
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
