"""A whole file of a recording that was cut or damaged: everything that can be read, with its index.

Raw chunks, settings and notes are kept; frames and the like that an export had besides follow from them again. What is
lost in between is in the notes, from when to when.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ..chunks import Capture, Damage
from ..files import replacing
from ..formats.mcap.channel import ChunkChannel
from ..formats.mcap.reading import first_metadata
from ..formats.mcap.writer import ArrayWriter
from ..io import open
from .notes import Note, NoteChannel, read


@dataclass(frozen=True, slots=True)
class Repaired:
    """What a repair has saved, and what it could not."""

    chunks: int
    bytes: int
    notes: int
    damage: list[Damage]
    damage_count: int


def repair(source: Path, target: Path) -> Repaired:
    """Write all of `source` that can be read to `target`, whole. CaptureError where there is nothing to read."""
    capture = open(source)
    with replacing(target) as file:
        chunks, octets, notes = _copy(capture, source, file)
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
