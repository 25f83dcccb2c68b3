"""Raw bytes, `.bin`: one stream without times, settings or marks.

Any bytes may be such a file, so it is never recognised by content: only by suffix, or when asked for by name.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ..chunks import Block, Note, columns
from ..files import opened, read_head
from ..line import LineSettings
from . import Format

CHUNK_BYTES = 1 << 16
_ANY_BYTES = 0.01  # likelihood: its suffix decides, not its content


@dataclass(frozen=True, slots=True)
class _BinaryReader:
    path: Path
    line: LineSettings
    timed: bool = False

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - raw bytes are never damaged
        with opened(self.path) as file:
            while data := file.read(max(max_bytes // CHUNK_BYTES, 1) * CHUNK_BYTES):
                sizes = [len(data[i : i + CHUNK_BYTES]) for i in range(0, len(data), CHUNK_BYTES)]
                yield columns(data, sizes, [0] * len(sizes), timed=False)


def _read(path: Path) -> _BinaryReader:
    read_head(path)
    return _BinaryReader(path, LineSettings())


def _write(file: BinaryIO, line: LineSettings, blocks: Iterable[Block], timed: bool) -> None:  # noqa: ARG001
    for block in blocks:
        file.write(block.data.tobytes())


FORMAT = Format("bin", (".bin", ".raw", ".dat"), lambda _: _ANY_BYTES, _read, _write)
