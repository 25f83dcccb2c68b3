"""A whole file of a recording that was cut or damaged: everything that can be read, with its index.

Raw chunks, settings and notes are kept; frames and the like that an export had besides follow from them again.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast

from mcap.writer import CompressionType, Writer

from captures.chunks import Capture, Damage
from captures.files import replacing
from captures.formats.mcap import ChunkChannel
from captures.io import open

from . import notes


@dataclass(frozen=True, slots=True)
class Repaired:
    """What a repair has saved, and what it could not."""

    chunks: int
    bytes: int
    damage: list[Damage]
    damage_count: int


def repair(source: Path, target: Path) -> Repaired:
    """Write all of `source` that can be read to `target`, whole. CaptureError where there is nothing to read."""
    capture = open(source)
    with replacing(target) as file:
        chunks, octets = _copy(capture, file, notes.read(source))
    return Repaired(chunks, octets, capture.damage, capture.damage_count)


def _copy(capture: Capture, file: IO[bytes], said: list[notes.Note]) -> tuple[int, int]:
    writer = Writer(cast(IO[Any], file), compression=CompressionType.ZSTD)
    writer.start(library="rtuscope")
    channel = ChunkChannel(writer, capture.line, timed=capture.timed, about={"repaired_from": str(capture.path)})
    if said:
        note_channel = notes.NoteChannel(writer)
    chunks = octets = 0
    for block in capture.blocks():
        channel.write(block)
        chunks += len(block)
        octets += len(block.data)
    for note in said:
        note_channel.write(note)
    writer.finish()  # type: ignore[no-untyped-call]
    return chunks, octets
