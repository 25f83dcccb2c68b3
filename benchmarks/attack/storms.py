"""Storms: a recorder under disks that are full or fail, files taken away, clocks that are set, and restarts, at random.

What was written must be in its files in order and once, but for what was told to be lost or was taken away; a ring
gives up its oldest files only; what others put there is left alone; and nothing is raised.
"""

from __future__ import annotations

import errno
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from random import Random
from types import SimpleNamespace
from typing import Final
from unittest import mock

import captures
from attack.target import Outcome
from captures import Block, Chunk, LineSettings
from captures.recording import mcapfile, recorder, ring
from captures.recording.mcapfile import PART
from captures.recording.notes import Note
from captures.recording.recorder import Recorder
from captures.recording.ring import RingLimits

_LINE: Final = LineSettings(baud=19200, char_bits=11)
_STEPS: Final = 60
_LIMITS: Final = (
    RingLimits(),
    RingLimits(),
    RingLimits(size=4000),
    RingLimits(every_s=20),
    RingLimits(size=4000, keep_bytes=40_000),
    RingLimits(every_s=60, keep_s=600),
)
_PRECIOUS: Final = b"another program's"


class _Disk:
    """What stands between a recorder and the disk: errors to order, and clocks to set."""

    def __init__(self) -> None:
        self.error = 0
        self.room = 0  # bytes that are still taken
        self.wall_s, self.monotonic_s = 1.8e9, 100.0
        self._write = os.write

    def write(self, descriptor: int, data: bytes) -> int:
        if self.error and self.room < len(data):
            if self.room:
                part, self.room = self.room, 0
                return self._write(descriptor, data[:part])
            raise OSError(self.error, os.strerror(self.error))
        self.room -= min(self.room, len(data))
        return self._write(descriptor, data)

    @contextmanager
    def used(self) -> Iterator[None]:
        """The recorder's modules see this disk and these clocks."""
        clock = SimpleNamespace(time=lambda: self.wall_s, monotonic=lambda: self.monotonic_s)
        mine = SimpleNamespace(**{name: getattr(os, name) for name in dir(os)})
        mine.write, mine.fsync = self.write, lambda _: None
        with ExitStack() as replaced:
            replaced.enter_context(mock.patch.object(mcapfile, "os", mine))
            for module in (mcapfile, recorder, ring):
                replaced.enter_context(mock.patch.object(module, "time", clock))
            yield


def attack(seed: int, storms: int) -> Outcome:
    """So many storms of sixty steps."""
    outcome, seen = Outcome("storms"), [0, 0, 0]
    for number in range(storms):
        with tempfile.TemporaryDirectory() as folder:
            storm = _Storm(Path(folder), Random(f"{seed} storm {number}"))
            try:
                wrong = storm.run()
            except Exception as error:
                wrong = [f"{type(error).__name__}: {error}"]
            outcome.failures += [f"storm {number} of seed {seed}: {each}" for each in wrong]
            seen = [one + two for one, two in zip(seen, (storm.errors, storm.restarts, storm.taken), strict=True)]
    outcome.tried = storms
    outcome.figures = f"seed {seed}: {seen[0]} disk errors, {seen[1]} restarts, {seen[2]} files taken away"
    return outcome


class _Storm:
    def __init__(self, folder: Path, chance: Random) -> None:
        self._folder, self._chance = folder / "recordings", chance
        self._folder.mkdir()
        self._archive = folder / "archive"
        self._archive.mkdir()
        self._path = self._folder / "bus.mcap"
        self._limits = chance.choice(_LIMITS)
        self._disk = _Disk()
        self._sent = 0  # numbers of two bytes each
        self._lost = 0  # bytes, as told
        self._recorder: Recorder | None = None
        self._gone: set[int] = set()  # numbers that were in files taken away
        self.errors = self.restarts = self.taken = 0

    def run(self) -> list[str]:
        """All steps; what did not hold."""
        steps = (
            self._talk,
            self._talk,
            self._talk,
            self._talk,
            self._fail,
            self._recover,
            self._clock,
            self._restart,
            self._take,
            self._put,
        )
        with self._disk.used():
            self._start()
            for _ in range(_STEPS):
                self._chance.choice(steps)()
                self._disk.monotonic_s += 1
                self._disk.wall_s += 1
                assert self._recorder is not None
                self._recorder.tick()
            self._recover()
            assert self._recorder is not None
            self._recorder.tick()
            self._end()
            self.restarts += 1
            self._start()  # which mends what was left
            self._end()
        return self._judged()

    def _start(self) -> None:
        """As after a restart of the computer; a file that is in the way is put away, as its user has to."""
        self._folder.mkdir(exist_ok=True)
        if self._path.exists() and not self._limits.rotates:
            self._path.replace(self._archive / f"{self.restarts}.mcap")
        self._recorder = Recorder(self._path, _LINE, limits=self._limits, tell=lambda _: None)

    def _end(self) -> None:
        assert self._recorder is not None
        self._recorder.close()
        self._lost += self._recorder.lost

    def _talk(self) -> None:
        assert self._recorder is not None
        for _ in range(self._chance.randint(1, 5)):
            count = self._chance.randint(1, 200)
            data = b"".join(number.to_bytes(2, "big") for number in range(self._sent, self._sent + count))
            self._recorder.write(Block.from_chunks([Chunk(10**18 + self._sent * 10**6, data)]))
            self._sent += count
        if self._chance.random() < 0.2:
            self._recorder.note(Note(10**18 + self._sent * 10**6, "clock", "the clock was set"))

    def _fail(self) -> None:
        self._disk.error = self._chance.choice((errno.ENOSPC, errno.ENOSPC, errno.EIO, errno.EROFS, errno.EDQUOT))
        self._disk.room = self._chance.choice((0, 10, 1000, 5000))
        self.errors += 1

    def _recover(self) -> None:
        self._disk.error = self._disk.room = 0

    def _clock(self) -> None:
        self._disk.wall_s += self._chance.choice((-3e5, 3e5, -1e9, 1e9, 5))
        self._disk.wall_s = max(0.0, self._disk.wall_s)

    def _restart(self) -> None:
        self._end()
        if self._chance.random() < 0.5:
            self._disk.monotonic_s = 1.0
        self._recover()
        self.restarts += 1
        self._start()

    def _take(self) -> None:
        """Away with the file being written, or with the folder."""
        if self._limits.ring or self._chance.random() < 0.7:
            return
        folder_too = self._chance.random() < 0.3
        paths = list(self._folder.iterdir()) if folder_too else list(self._folder.glob(f"*{PART}"))
        for path in paths:
            self._gone.update(_numbers(path))
            path.unlink()
        if folder_too:
            shutil.rmtree(self._folder)
        self.taken += len(paths)

    def _put(self) -> None:
        """Another program's files, where ours will want to be."""
        if self._folder.is_dir() and self._chance.random() < 0.3:
            (self._folder / "bus-notes.mcap").write_bytes(_PRECIOUS)
            if not self._path.exists():
                self._path.write_bytes(_PRECIOUS)

    def _judged(self) -> list[str]:
        wrong = []
        kept: list[int] = []
        for path in (*self._folder.iterdir(), *self._archive.iterdir()):
            if path.read_bytes() == _PRECIOUS:
                continue
            kept += _numbers(path)
            if path.name.endswith(PART):
                wrong.append(f"{path.name} was left")
        if len(set(kept)) < len(kept):
            wrong.append("bytes were recorded twice")
        missing = set(range(self._sent)) - set(kept) - self._gone
        if self._limits.ring:
            missing = {number for number in missing if number > min(kept, default=self._sent)}
        if 2 * len(missing) > self._lost:
            wrong.append(f"{2 * len(missing)} bytes are missing, {self._lost} told: {sorted(missing)[:5]}")
        return wrong


def _numbers(path: Path) -> list[int]:
    try:
        data = b"".join(block.data.tobytes() for block in captures.open(path, format="mcap").blocks())
    except captures.CaptureError:
        return []
    return [int.from_bytes(data[i : i + 2], "big") for i in range(0, len(data), 2)]
