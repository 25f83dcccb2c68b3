"""One recording: raw chunks and notes in an MCAP file that is readable up to its last commit, and indexed once closed.

And a whole file of a recording that was cut or damaged: everything that can be read, with its index.
"""

from __future__ import annotations

import os
import time
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import BinaryIO, Final

from ..chunks import Block, Capture, Damage
from ..disposal import cut_back, is_open_elsewhere, made, move_to_free_name, put_in_place, remove_made
from ..files import PRIVATE, replacing
from ..formats.mcap.channel import ChunkChannel
from ..formats.mcap.reading import first_metadata
from ..formats.mcap.writer import ArrayWriter
from ..io import open
from ..line import LineSettings
from .notes import Note, NoteChannel, read

PART: Final = ".part"
FileIdentity = tuple[int, ...]


class CommittedFile:
    """A new file at `path`, which must not exist. OSError passes."""

    def __init__(self, path: Path) -> None:
        self.path = path
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
        self._descriptor = os.open(path, flags, PRIVATE)
        with suppress(ImportError, OSError):  # so that others see that it is in work
            import fcntl

            fcntl.flock(self._descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        self._held = bytearray()
        self.size = 0  # bytes that are safe
        stat = os.fstat(self._descriptor)
        self._identity = (stat.st_dev, stat.st_ino)
        self.made = made(path)
        self._identified = self.made == self._identity  # not on every file system of a network

    def write(self, data: bytes) -> int:
        """Hold it."""
        self._held += data
        return len(data)

    def tell(self) -> int:
        """Bytes written, held ones included."""
        return self.size + len(self._held)

    def flush(self) -> None:
        """For writers that ask; `commit` is what counts."""

    def commit(self) -> None:
        """Put all that is held on the disk; OSError where it could not be, which then can be tried again."""
        if not self._held:
            return
        write_behind(self._descriptor, self.size, self._held)
        self.size += len(self._held)
        self._held.clear()

    @property
    def missing(self) -> bool:
        """Whether there is nothing under its name any more, or another file: someone has taken it away."""
        try:
            identity = file_identity(self.path)
        except OSError:  # not to be known at present
            return False
        return not identity or (self._identified and identity[:2] != self._identity)

    @property
    def deleted(self) -> bool:
        """Whether it has no name at all any more, so that what is written is lost."""
        return not os.fstat(self._descriptor).st_nlink

    def close(self) -> None:
        """Let go of the file; what is still held is given up. Again it does nothing."""
        descriptor, self._descriptor = self._descriptor, -1
        if descriptor >= 0:
            os.close(descriptor)


class RecordingFile:
    """A file being recorded. OSError passes; after one from `commit`, what it holds can be committed later."""

    def __init__(self, path: Path, line: LineSettings, about: Mapping[str, str]) -> None:
        self.path = path
        self.part = path.with_name(path.name + PART)
        self.opened = time.monotonic()
        self.bytes = 0  # of the line, safe on the disk
        self._file = CommittedFile(self.part)
        self._writer = ArrayWriter(self._file)
        self._writer.start(library=about.get("tool", "rtuscope"))
        self._chunks = ChunkChannel(self._writer, line, about=about)
        self._notes = NoteChannel(self._writer)
        self._finished = False
        self.empty = True  # but for settings
        self.notes: list[Note] = []  # since the last bytes of the line
        try:
            self._file.commit()
        except OSError:
            self.discard()
            raise
        sync_folder(path.parent)

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return self._file.size

    @property
    def missing(self) -> bool:
        """Whether someone has taken it away."""
        return self._file.missing

    @property
    def deleted(self) -> bool:
        """Whether it is nowhere any more."""
        return self._file.deleted

    def write(self, blocks: Sequence[Block], notes: Sequence[Note]) -> None:
        """Takes blocks and notes, which `commit` makes safe."""
        self.empty = False
        self.notes += notes
        if blocks:
            self.notes.clear()
            self._chunks.write(Block.joined(blocks))
        for note in notes:
            self._notes.write(note)
        self._writer.flush()

    def commit(self) -> None:
        """Puts on the disk what was written."""
        self._file.commit()

    def finish(self) -> None:
        """Writes the index; after an OSError it can be tried again."""
        if not self._finished:
            self._writer.finish()
            self._finished = True
        self._file.commit()

    def close(self) -> None:
        """Lets go of the file, which stays NAME.part until `take_name`."""
        self._file.close()

    def discard(self) -> None:
        """Leave nothing of it, unless something else has its name by now."""
        with suppress(OSError):
            self._file.close()
        with suppress(OSError):
            remove_made(self.part, self._file.made)

    def take_name(self, others: Iterable[Path], *, instead_of: FileIdentity = ()) -> Path:
        """Gives it its name; where another file has that, the first of `others` that is free, unless it is this one."""
        if instead_of and file_identity(self.path) == instead_of:
            put_in_place(self.part, self.path)
            path = self.path
        else:
            path = move_to_free_name(self.part, chain((self.path,), others))
        sync_folder(path.parent)
        return path


def file_identity(path: Path) -> FileIdentity:
    """What tells a file from any other, and from itself once it was changed; empty where there is none."""
    try:
        stat = path.stat()
    except (FileNotFoundError, NotADirectoryError):
        return ()
    return stat.st_dev, stat.st_ino, stat.st_size, stat.st_mtime_ns


def is_written(path: Path) -> bool:
    """Whether a `CommittedFile` of some process is writing this file now; on Windows, whether anybody has it open."""
    if os.name == "nt":
        return is_open_elsewhere(path)
    import fcntl

    with suppress(OSError), path.open("rb") as file:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return True
    return False


def write_behind(descriptor: int, size: int, data: bytes | bytearray) -> None:
    """Put bytes on the disk behind the `size` that are safe there, or cut the file back to those. OSError passes."""
    try:
        os.lseek(descriptor, size, os.SEEK_SET)
        with memoryview(data) as view:
            written = 0
            while written < len(view):
                written += os.write(descriptor, view[written:])
        os.fsync(descriptor)
    except OSError:
        with suppress(OSError):
            cut_back(descriptor, size)
        raise


def sync_folder(folder: Path) -> None:
    """Make new names in a folder last through a power cut, where the system has a way."""
    with suppress(OSError):  # Windows opens no folders
        descriptor = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@dataclass(frozen=True, slots=True)
class Repaired:
    """What a repair has saved, and what it could not."""

    chunks: int
    bytes: int
    notes: int
    damage: list[Damage]
    damage_count: int


class _IntactError(Exception):
    """What was to be repaired is whole."""


def repair(source: Path, target: Path, *, least: int = 0) -> Repaired:
    """Write all of `source` that can be read to `target`, whole. CaptureError where there is nothing to read.

    Where fewer than `least` places of the source are damaged, nothing is written.
    """
    capture = open(source)
    with suppress(_IntactError), replacing(target, private=True) as file:
        chunks, octets, notes = _copy(capture, source, file)
        if capture.damage_count < least:
            raise _IntactError
    return Repaired(chunks, octets, notes, capture.damage, capture.damage_count)


def _copy(capture: Capture, source: Path, file: BinaryIO) -> tuple[int, int, int]:
    writer = ArrayWriter(file)
    writer.start(library="rtuscope")
    about = {**first_metadata(source), "repaired_from": str(source)}
    channel = ChunkChannel(writer, capture.line, timed=capture.timed, about=about)
    notes = read(source)
    chunks = octets = damage = 0
    newest: int | None = None
    for block in capture.blocks():
        if newest is not None and capture.damage_count > damage:
            what = capture.damage[-1] if len(capture.damage) == capture.damage_count else "damaged"
            notes.append(Note(newest, "gap", f"{source.name}: {what}"))
        channel.write(block)
        chunks += len(block)
        octets += len(block.data)
        newest, damage = int(block.t_ns.max()), capture.damage_count
    if notes:
        note_channel = NoteChannel(writer)
        for note in sorted(notes, key=lambda note: note.t_ns):
            note_channel.write(note)
    writer.finish()
    return chunks, octets, len(notes)
