"""One recording: raw chunks and notes in an MCAP file that is readable up to its last commit, and indexed once closed.

While it is written it is called NAME.part; it takes its name when it is whole.
"""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO, Any, Final, cast

from mcap.writer import CompressionType, Writer

from captures.chunks import Block
from captures.formats.mcap import ChunkChannel
from captures.line import LineSettings

from .committed import CommittedFile, sync_folder
from .notes import Note, NoteChannel

PART: Final = ".part"


class RecordingFile:
    """A file being recorded. OSError passes; after one from `commit`, what it holds can be committed later."""

    def __init__(self, path: Path, line: LineSettings, about: Mapping[str, str]) -> None:
        self.path = path
        self.part = path.with_name(path.name + PART)
        self.opened = time.monotonic()
        self._file = CommittedFile(self.part)
        self._writer = Writer(cast(IO[Any], self._file), compression=CompressionType.ZSTD)
        self._writer.start(library=about.get("tool", "rtuscope"))
        self._chunks = ChunkChannel(self._writer, line, about=about)
        self._notes = NoteChannel(self._writer)
        self._finished = False
        self.empty = True  # but for settings
        try:
            self._file.commit()
        except OSError:
            self._file.close()
            with suppress(OSError):
                self.part.unlink()
            raise
        sync_folder(path.parent)

    @property
    def size(self) -> int:
        """Bytes on the disk."""
        return self._file.size

    def write(self, blocks: Sequence[Block], notes: Sequence[Note]) -> None:
        """Takes blocks and notes, which `commit` makes safe."""
        self.empty = False
        if blocks:
            self._chunks.write(Block.joined(blocks))
        for note in notes:
            self._notes.write(note)
        self._writer.flush()  # type: ignore[no-untyped-call]

    def commit(self) -> None:
        """Puts on the disk what was written."""
        self._file.commit()

    def finish(self) -> None:
        """Writes the index; after an OSError it can be tried again."""
        if not self._finished:
            self._writer.finish()  # type: ignore[no-untyped-call]
            self._finished = True
        self._file.commit()

    def close(self, *, whole: bool = True) -> None:
        """Lets go of the file and gives it its name; one that is not whole stays NAME.part."""
        self._file.close()
        if whole:
            self.part.replace(self.path)
            sync_folder(self.path.parent)
