"""What is heard, onto the disk, for days: rotated, kept in a ring, safe within a second, and never corrupt.

`write` only takes blocks in; `tick`, called at least every second, puts them on the disk. A full disk costs the oldest
file of the ring; where there is none, recording pauses with what was heard in memory, as far as that goes, and goes on
by itself when there is room. A file that someone takes away, or that can no longer be written, is followed by another.
Everything that happens is said (`tell`) and noted in the record.
"""

from __future__ import annotations

import errno
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

from ..chunks import Block
from ..errors import CaptureError, os_reason
from ..files import refuse_device_name
from ..line import LineSettings
from .mcapfile import FileIdentity, RecordingFile, file_identity
from .mending import FULL, mend_cut
from .notekinds import CLOSED
from .notes import Note
from .ring import SUFFIX, Ring, RingLimits

_PERIOD_S: Final = 0.5  # between commits
_PENDING: Final = 1 << 18  # bytes that are committed at once
_MEMORY: Final = 64 << 20  # bytes kept while the disk takes nothing
_NOTES: Final = 10_000  # kept
_READ_BYTES: Final = 18  # that a read costs besides its data
_LUMP: Final = 256  # blocks that are joined


@dataclass(slots=True)
class _Waiting:
    """What waits for the disk; `bytes` of the line."""

    blocks: list[Block] = field(default_factory=list)
    notes: list[Note] = field(default_factory=list)
    bytes: int = 0
    lumps: int = 0  # of the blocks, those that were joined already

    @property
    def memory(self) -> int:
        """Bytes of memory that it takes, about."""
        return self.bytes + _READ_BYTES * sum(map(len, self.blocks))


class Recorder:
    """Records blocks to `path`, or to files named after it where `limits` ask for several.

    CaptureError where it can't begin. `tell` gets one line for a person each time something happens.
    """

    def __init__(
        self,
        path: Path,
        line: LineSettings,
        *,
        limits: RingLimits = RingLimits(),  # noqa: B008 - frozen
        about: Mapping[str, str] | None = None,
        overwrite: bool = False,
        tell: Callable[[str], None] = print,
    ) -> None:
        if path.suffix.lower() != SUFFIX:
            raise CaptureError(f"{path}: a recording is an MCAP file: give it the suffix {SUFFIX}")
        refuse_device_name(path)
        if not path.parent.is_dir():
            raise CaptureError(f"{path}: cannot be written: no folder {path.parent}")
        if path.exists() and not limits.rotates and not overwrite:
            raise CaptureError(f"{path}: already exists: give another name, or --overwrite")
        self.bytes = 0  # of the line, safe on the disk
        self.lost = 0  # of the line, given up for want of room or with a file that could not be kept
        self.taken = 0  # of the line, on the disk until someone took the file away
        self._line, self._about, self._tell = line, dict(about or {}), tell
        self._line_due = line  # what it is by now
        self._line_known = line != LineSettings()  # until then the file may have to begin anew
        self._replaced: FileIdentity = file_identity(path) if overwrite else ()
        self._file: RecordingFile | None = None
        self._files = 0
        self._waiting = _Waiting()
        self._handed: _Waiting | None = None  # what the file holds and the disk has not taken
        self._memory = 0  # bytes that wait for the disk, about
        self._lost_from = 0
        self._committed = time.monotonic()
        self._complaint = ""
        self._upkeep = ""  # what is wrong with the ring's old files or its list
        self._ring = Ring(path, limits, self._about.get("ports", ""))
        try:
            self._begin()
        except BaseException:
            self._ring.release()
            raise

    def _begin(self) -> None:
        """The first file. A ring on a full disk waits for room; CaptureError where there is nothing to wait for."""
        path, rotates = self._ring.path, self._ring.limits.rotates
        try:
            if rotates:
                self._ring.claim(self._tell)
                self._tell_strangers()
            mend_cut(self._ring, self._tell, lambda: self._gave_up_oldest(errno.ENOSPC))
            self._file = self._open()
        except FileExistsError as error:
            raise CaptureError(f"{path}: another recorder is writing it") from error
        except OSError as error:
            if not rotates or error.errno not in FULL:
                raise CaptureError(f"{path}: cannot be written: {os_reason(error)}") from error
            self._commit()

    def _tell_strangers(self) -> None:
        strangers = self._ring.strangers()
        if strangers and self._ring.limits.ring:
            self._tell(
                f"recording: files named like this ring's, but not from it: {len(strangers):,} (the first: "
                f"{strangers[0].name}): they are kept, and --keep does not count them"
            )

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

    @property
    def result(self) -> str:
        """What was recorded, and what not, for a last line."""
        removed = f", {self.taken:,} deleted by someone" if self.taken else ""
        lost = f", LOST {self.lost:,}" if self.lost else ""
        return f"recorded {self.bytes:,} bytes of the line{removed}{lost}"

    def write(self, block: Block) -> None:
        """Take a block; not while so much waits for a full disk that memory would run out."""
        self._take_settings()
        size = len(block.data)
        memory = size + _READ_BYTES * len(block)
        if self._memory + memory > _MEMORY:
            if not self._lost_from:
                self._lost_from = int(block.t_ns[0])
                self._tell("recording: the memory buffer for a stalled disk is full: bytes are being lost")
            self.lost += size
            return
        waiting = self._waiting
        waiting.blocks.append(block)
        waiting.bytes += size
        self._memory += memory
        if len(waiting.blocks) - waiting.lumps >= _LUMP:  # each has a price of its own
            waiting.blocks[waiting.lumps :] = [Block.joined(waiting.blocks[waiting.lumps :])]
            waiting.lumps += 1

    def note(self, note: Note) -> None:
        """Take a note."""
        if len(self._waiting.notes) < _NOTES:
            self._waiting.notes.append(note)

    def tick(self) -> None:
        """Put on the disk what has waited long enough, begin the next file when it is time."""
        now = time.monotonic()
        if now - self._committed < _PERIOD_S and self._waiting.bytes < _PENDING:
            return
        self._committed = now
        self._commit()
        if self._file is not None and not self.paused:
            limits = self._ring.limits
            if now - self._file.opened >= limits.file_s or self._file.size >= limits.file_bytes:
                self._next()

    def settings(self, line: LineSettings) -> None:
        """The line is another from now on. The first bytes begin another file: a client that sets its port and sets it
        back says nothing meanwhile."""
        self._line_known = True
        self._line_due = line

    def _take_settings(self) -> None:
        if self._line_due == self._line:
            return
        if self._file is not None and not (self._file.bytes or self._waiting.bytes or self._handed):
            self._waiting.notes[:0] = self._file.notes  # nothing was received with the old ones
            self._discard(self._file)
            self._file = None
        else:
            self._commit()
            self._finish()
        self._line = self._line_due
        self._commit()

    def close(self, heard_ns: int | None = None) -> None:
        """Put all on the disk and finish the file. What a full disk keeps from it is told, and the file is readable.

        `heard_ns`: until when was listened; silence behind the last bytes is a fact of the record, too.
        """
        if heard_ns is not None:
            self.note(Note(heard_ns, CLOSED, "listening ended"))
        self._line_known = True
        self._take_settings()
        self._commit()
        self._finish()
        left = self._waiting.bytes
        if left:
            self.lost += left
            self._tell(f"recording: {left:,} bytes of the line that were waiting for the disk are lost")
        self._ring.release()

    def _commit(self) -> None:
        """Put all that waits on the disk, as far as it takes it."""
        while True:
            try:
                if self._file is not None and self._file.missing:
                    self._leave_missing(self._file)
                if self._file is None:
                    self._file = self._open()
                while self._handed is not None or self._hand_over(self._file):
                    self._file.commit()
                    self._settle(self._file)
                return
            except OSError as error:
                if not self._goes_on(error):
                    return

    def _hand_over(self, file: RecordingFile) -> bool:
        """Give the file what waits; whether there was anything."""
        waiting = self._waiting
        if not (waiting.blocks or (waiting.notes and self._line_known)):
            return False
        if self._lost_from and waiting.blocks:
            text = f"{self.lost:,} bytes were lost while the disk was full"
            waiting.notes.append(Note(max(self._lost_from, int(waiting.blocks[-1].t_ns[-1])), "gap", text))
            self._lost_from = 0
        file.write(waiting.blocks, waiting.notes)
        self._handed, self._waiting = waiting, _Waiting()
        return True

    def _take_back(self) -> None:
        """What the file holds and the disk has not taken waits again, for another file."""
        if self._handed is not None:
            first, second = self._handed, self._waiting
            self._waiting = _Waiting(
                first.blocks + second.blocks, first.notes + second.notes, first.bytes + second.bytes, len(first.blocks)
            )
            self._handed = None

    def _settle(self, file: RecordingFile) -> None:
        """What was handed over is safe."""
        if self._handed is not None:
            self.bytes += self._handed.bytes
            file.bytes += self._handed.bytes
            self._handed = None
        self._memory = self._waiting.memory
        if self._complaint:
            self._complaint = ""
            self._tell("recording: resumed")

    def _goes_on(self, error: OSError) -> bool:
        """Whether to try again at once after this error: the oldest file was given up, or this one left for another."""
        if self._gave_up_oldest(error.errno):
            return True
        if self._file is not None and self._file.bytes and error.errno not in FULL:  # it is not for want of room
            self._leave(self._file, os_reason(error))
            return True
        if not self._complaint:
            self._complaint = os_reason(error)
            self._tell(
                f"recording: {self._ring.path}: {self._complaint}: paused; new bytes wait in memory until there is room"
            )
        return False

    def _gave_up_oldest(self, number: int | None) -> bool:
        if number in FULL and self._ring.limits.ring:
            with suppress(OSError):
                for path in self._ring.files()[:1]:
                    if self._ring.give_up(path):
                        return False
                    self._tell(f"recording: disk full: deleted the oldest file, {path}")
                    return True
        return False

    def _next(self) -> None:
        """Finish this file and begin another; what goes wrong with the old ones is told, and recording goes on."""
        self._finish()
        self._commit()
        wrong = ""
        try:
            for path in self._ring.surplus(self.size):
                if reason := self._ring.give_up(path):
                    wrong = f"{path}: {reason}"
        except OSError as error:
            wrong = f"{self._ring.path.parent}: {os_reason(error)}"
        self._told_upkeep(wrong and f"recording: {wrong}: old files are kept")

    def _told_upkeep(self, wrong: str) -> None:
        """Tell what is wrong with the ring once."""
        if wrong and wrong != self._upkeep:
            self._tell(wrong)
        self._upkeep = wrong

    def _finish(self) -> None:
        """Give the file its index and its name, or leave it without: what was not on the disk waits for the next."""
        file = self._file
        if file is None:
            return
        if file.missing:
            self._leave_missing(file)
            return
        if file.empty:
            self._discard(file)
            self._file = None
            return
        while True:
            try:
                file.finish()
                break
            except OSError as error:
                if not self._gave_up_oldest(error.errno):
                    self._leave(file, os_reason(error))
                    return
        self._settle(file)
        self._file = None
        file.close()
        self._list(file.path)
        try:
            path = file.take_name(self._ring.free_names(time.time()), instead_of=self._replaced)
        except OSError as error:
            self._tell(f"recording: {file.part}: {os_reason(error)}: the file is complete, but keeps this name")
            return
        if path != file.path:
            self._tell(f"recording: {file.path} is a different file now: the recording is in {path}")
            self._list(path)
        self._ring.ended(path)

    def _list(self, path: Path) -> None:
        """Enter a file in the ring's list, before it has its name: what is in no list is never given up."""
        try:
            self._ring.listed(path)
        except OSError as error:
            self._tell(f"recording: the list of the ring could not be written: {os_reason(error)}: will retry")

    def _leave(self, file: RecordingFile, reason: str) -> None:
        """Give up a file that can no longer be written, which is readable as it is."""
        self._take_back()
        self._file = None
        with suppress(OSError):
            file.close()
        self._tell(
            f"recording: {file.part}: {reason}: left without its index; it opens as it is, and `rtuscope repair` "
            "completes it"
        )

    def _leave_missing(self, file: RecordingFile) -> None:
        """Give up a file that someone has taken away; one that is only elsewhere now is finished there."""
        moved = False
        with suppress(OSError):
            if not file.deleted:
                file.finish()
                moved = True
        if moved:
            self._settle(file)
            what = f"was moved: it is finished where it is, with {file.bytes:,} bytes of the line"
        else:
            self._take_back()
            self.bytes -= file.bytes
            self.taken += file.bytes
            what = f"was taken away, and {file.bytes:,} bytes of the line with it"
        self._file = None
        with suppress(OSError):
            file.close()
        self._tell(f"recording: {file.part} {what}; recording goes on in a new file")

    def _discard(self, file: RecordingFile) -> None:
        """Leave nothing of a file that holds nothing."""
        file.discard()
        self._files -= 1

    def _open(self) -> RecordingFile:
        """The next file; its folder is made anew where it was taken away."""
        if self._files:
            self._ring.path.parent.mkdir(parents=True, exist_ok=True)
        if self._ring.limits.rotates:
            self._ring.claim(self._tell)
        path = self._ring.begin(first=not self._files)
        file = RecordingFile(path, self._line, {**self._about, **self._ring.metadata()})
        self._files += 1
        return file
