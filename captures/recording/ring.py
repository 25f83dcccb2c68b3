"""Names and limits of a recording's files: when to begin the next one, and which of the old ones to give up.

Files of a ring are named by the UTC time of their beginning, NAME-20261121T104500.123Z.mcap, so that they sort by age
and a restarted recorder goes on where it was.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from .mcapfile import PART

SUFFIX: Final = ".mcap"
_LONGEST_S: Final = 86_400.0  # of one file, asked or not: its index is in memory
_LARGEST: Final = 1 << 30
_SHARES: Final = 20  # files of a ring, at least
_LEAST: Final = 1 << 20


@dataclass(frozen=True, slots=True)
class Limits:
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


class Ring:
    """The files of one recording."""

    def __init__(self, path: Path, limits: Limits) -> None:
        self.path = path
        self.limits = limits
        self._pattern = re.compile(rf"{re.escape(path.stem)}-\d{{8}}T\d{{6}}\.\d{{3}}Z{re.escape(path.suffix)}")

    def next_name(self, t_s: float, *, first: bool) -> Path:
        """The name of a file that begins at this time."""
        if first and not self.limits.rotates:
            return self.path
        at = datetime.fromtimestamp(t_s, UTC)
        while True:
            stamp = at.isoformat(timespec="milliseconds").replace("-", "").replace(":", "").replace("+0000", "Z")
            name = self.path.with_name(f"{self.path.stem}-{stamp}{self.path.suffix}")
            if not name.exists() and not name.with_name(name.name + PART).exists():
                return name
            at += timedelta(milliseconds=1)

    def files(self) -> list[Path]:
        """The whole files, oldest first."""
        return sorted(path for path in self.path.parent.iterdir() if self._pattern.fullmatch(path.name))

    def cut(self) -> Iterator[Path]:
        """Files that a recorder before this one could not close."""
        for path in sorted(self.path.parent.glob(f"*{PART}")):
            name = path.name.removesuffix(PART)
            if self._pattern.fullmatch(name) or name == self.path.name:
                yield path

    def surplus(self, now_s: float, current: int) -> list[Path]:
        """The files to give up now, beside one of `current` bytes that is being written."""
        limits, files = self.limits, self.files()
        gone = []
        if limits.keep_s is not None:
            gone = [path for path in files if path.stat().st_mtime < now_s - limits.keep_s]
        if limits.keep_bytes is not None:
            left = [path for path in files if path not in gone]
            total = current + sum(path.stat().st_size for path in left)
            for path in left:
                if total <= limits.keep_bytes:
                    break
                total -= path.stat().st_size
                gone.append(path)
        return gone
