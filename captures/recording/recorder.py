"""What is heard, onto the disk, for days: rotated, kept in a ring, safe within a second, and never corrupt.

`write` only takes blocks in; `tick`, called at least every second, puts them on the disk. A full disk costs the oldest
file of the ring; where there is none, recording pauses with what was heard in memory, as far as that goes, and goes on
by itself when there is room. Everything that happens is said (`tell`) and noted in the record.
"""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Final

from captures.chunks import Block
from captures.errors import CaptureError, os_reason
from captures.line import LineSettings

from .committed import is_written
from .mcapfile import PART, RecordingFile
from .notes import Note
from .repair import repair
from .ring import SUFFIX, Limits, Ring

_PERIOD_S: Final = 0.5  # between commits
_PENDING: Final = 1 << 18  # bytes that are committed at once
_MEMORY: Final = 64 << 20  # bytes kept while the disk takes nothing
_READ_BYTES: Final = 18  # that a read costs besides its data
_LUMP: Final = 256  # blocks that are joined
_FULL: Final = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


class Recorder:
    """Records blocks to `path`, or to files named after it where `limits` ask for several.

    CaptureError where it can't begin. `tell` gets one line for a person each time something happens.
    """

    def __init__(
        self,
        path: Path,
        line: LineSettings,
        *,
        limits: Limits = Limits(),  # noqa: B008 - frozen
        about: Mapping[str, str] | None = None,
        overwrite: bool = False,
        tell: Callable[[str], None] = print,
    ) -> None:
        if path.suffix.lower() != SUFFIX:
            raise CaptureError(f"{path}: a recording is an MCAP file: give it the suffix {SUFFIX}")
        if not path.parent.is_dir():
            raise CaptureError(f"{path}: cannot be written: no such folder as {path.parent}")
        if path.exists() and not limits.rotates and not overwrite:
            raise CaptureError(f"{path}: is there already: give another name, or --overwrite")
        self.bytes = 0  # of the line, safe on the disk
        self.lost = 0  # of the line, given up while the disk was full
        self._ring = Ring(path, limits)
        self._line, self._about, self._tell = line, dict(about or {}), tell
        self._line_known = line != LineSettings()  # until then the file may have to begin anew
        self._file: RecordingFile | None = None
        self._files = 0
        self._blocks: list[Block] = []
        self._notes: list[Note] = []
        self._lumps = 0  # of the blocks, those that were joined already
        self._pending = 0  # bytes of the line in them
        self._memory = 0  # bytes that wait for the disk, about
        self._uncommitted: int | None = None  # bytes of the line that the file holds and the disk has not taken
        self._lost_from = 0
        self._committed = time.monotonic()
        self._complaint = ""
        self._mend_cut()
        try:
            self._file = self._open()
        except OSError as error:
            raise CaptureError(f"{path}: cannot be written: {os_reason(error)}") from error

    @property
    def path(self) -> Path | None:
        """The file that is being written, by the name that it will have."""
        return None if self._file is None else self._file.path

    @property
    def size(self) -> int:
        """Bytes of the present file on the disk."""
        return 0 if self._file is None else self._file.size

    @property
    def paused(self) -> bool:
        """Whether the disk takes nothing at present."""
        return bool(self._complaint)

    def write(self, block: Block) -> None:
        """Take a block; not while so much waits for a full disk that memory would run out."""
        size = len(block.data)
        if self._memory + size + _READ_BYTES * len(block) > _MEMORY:
            if not self._lost_from:
                self._lost_from = int(block.t_ns[0])
                self._tell("recording: memory for what the disk does not take is used up: bytes are lost from now on")
            self.lost += size
            return
        self._blocks.append(block)
        self._pending += size
        self._memory += size + _READ_BYTES * len(block)
        if len(self._blocks) - self._lumps >= _LUMP:  # each has a price of its own
            self._blocks[self._lumps :] = [Block.joined(self._blocks[self._lumps :])]
            self._lumps += 1

    def note(self, note: Note) -> None:
        """Take a note."""
        if len(self._notes) < 10_000:
            self._notes.append(note)

    def tick(self) -> None:
        """Put on the disk what has waited long enough, begin the next file when it is time."""
        now = time.monotonic()
        if now - self._committed < _PERIOD_S and self._pending < _PENDING:
            return
        self._committed = now
        self._commit()
        if self._file is not None and not self.paused:
            limits = self._ring.limits
            if now - self._file.opened >= limits.file_s or self._file.size >= limits.file_bytes:
                self._next()

    def settings(self, line: LineSettings) -> None:
        """The line is another from now on: that begins another file."""
        self._line_known = True
        if line == self._line:
            return
        self._line = line
        if self.bytes or self._pending or self._uncommitted or self._file is None:
            self._commit()
            self._next()
        else:  # nothing was heard with the old ones
            self._discard(self._file)
            self._file = self._open()

    def close(self) -> None:
        """Put all on the disk and finish the file. What a full disk keeps from it is told, and the file is readable."""
        self._line_known = True
        self._commit()
        self._finish()

    def _commit(self) -> None:
        try:
            if self._file is None:
                self._file = self._open()
            if self._uncommitted is None:
                self._hand_over()
            self._file.commit()
            self._settle()
            if self._blocks:  # what came while the disk was full
                self._hand_over()
                self._file.commit()
                self._settle()
        except OSError as error:
            if self._make_room(error):
                self._commit()

    def _hand_over(self) -> None:
        """Give the file what is pending."""
        if self._file is None or not (self._blocks or (self._notes and self._line_known)):
            return
        if self._lost_from and self._blocks:
            text = f"{self.lost:,} bytes were lost while the disk was full"
            self._notes.append(Note(max(self._lost_from, int(self._blocks[-1].t_ns[-1])), "gap", text))
            self._lost_from = 0
        self._file.write(self._blocks, self._notes)
        self._uncommitted = self._pending
        self._blocks, self._notes, self._pending, self._lumps = [], [], 0, 0

    def _settle(self) -> None:
        self.bytes += self._uncommitted or 0
        self._uncommitted = None
        self._memory = sum(len(block.data) + _READ_BYTES * len(block) for block in self._blocks)
        if self._complaint:
            self._complaint = ""
            self._tell("recording: goes on")

    def _make_room(self, error: OSError) -> bool:
        """Give up the oldest file for a full disk; False where there is none, and recording pauses."""
        if self._gave_up_oldest(error):
            return True
        if not self._complaint:
            self._complaint = os_reason(error)
            self._tell(
                f"recording: {self._ring.path}: {self._complaint}: paused; what is heard waits in memory and is "
                "written when there is room"
            )
        return False

    def _gave_up_oldest(self, error: OSError) -> bool:
        if error.errno in _FULL and self._ring.limits.ring:
            for path in self._ring.files():
                with suppress(OSError):
                    path.unlink()
                    self._tell(f"recording: disk full: gave up the oldest file, {path}")
                    return True
        return False

    def _next(self) -> None:
        """Finish this file and begin another."""
        self._finish()
        try:
            self._file = self._open()
        except OSError as error:
            self._make_room(error)
        for path in self._ring.surplus(time.time(), self.size):
            with suppress(OSError):
                path.unlink()

    def _finish(self) -> None:
        file, self._file = self._file, None
        if file is None:
            return
        if file.empty and not self._blocks:
            self._discard(file)
            return
        while True:
            try:
                file.finish()
                file.close()
                break
            except OSError as error:
                if self._gave_up_oldest(error):
                    continue
                file.close(whole=False)
                kept = (self._uncommitted or 0) + self._pending
                lost = f", {kept:,} bytes of the line that waited are lost" if kept else ""
                self._tell(
                    f"recording: {file.part}: {os_reason(error)}: left without its index{lost}; it opens as it is, and "
                    "`rtuscope repair` makes it whole"
                )
                break
        self._uncommitted = None

    def _discard(self, file: RecordingFile) -> None:
        """Leave nothing of a file that holds nothing."""
        file.close(whole=False)
        file.part.unlink()
        self._files -= 1

    def _open(self) -> RecordingFile:
        path = self._ring.next_name(time.time(), first=not self._files)
        file = RecordingFile(path, self._line, self._about)
        self._files += 1
        return file

    def _mend_cut(self) -> None:
        """Make whole what a recorder before this one had no time to close."""
        for part in self._ring.cut():
            if is_written(part):
                continue
            whole = part.with_name(part.name.removesuffix(PART))
            if whole.exists() or whole == self._ring.path:  # that name is for what comes now
                whole = self._ring.next_name(part.stat().st_mtime, first=False)
            try:
                done = repair(part, whole)
                part.unlink()
            except (CaptureError, OSError) as error:
                self._tell(f"recording: {part} was cut and could not be mended: {error}")
            else:
                self._tell(f"recording: {whole} was cut and is whole again: {done.bytes:,} bytes of the line")
