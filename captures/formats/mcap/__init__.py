"""This tool's own MCAP: raw chunks without loss, in a file that any MCAP viewer opens.

One channel, `/rtuscope/chunks`, whose messages are protobuf with their schema in the file. A message holds many chunks
as columns (some 16 KiB or ten seconds of the bus), since a message each would be mostly overhead, and packed numbers of
a fixed width, since those are arrays as they stand:

    t_ns      time of the first chunk, ns; the message's log_time is the same (0 where it is negative)
    after_ns  each chunk's time after t_ns, ns
    sizes     each chunk's number of bytes
    data      the bytes of all of them
    port      each chunk's port, a byte each; left out where all are 0
    mark      each chunk's direction mark, a byte each: 1 for tx, 2 for rx; left out where all are 0
    errors    positions in data of bytes with parity or framing errors

Files of before had the same columns in JSON, `data` in base64; they are read as well.

Settings of the line are in a metadata record named `rtuscope`, written before anything else so that a file that was cut
has them, and again in the channel's metadata. Other channels in the file are no concern of this reader.

`channel` is these messages and their channel beside whatever else a file holds, `reading` the way back, `scanning` the
records of a file that may be damaged, `records` how records are laid out and packed, `writer` a file by arrays,
`protobuf` messages of a constant layout. They are loaded when they are used.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from ...chunks import Block, Source
from ...line import LineSettings
from .. import Format
from .records import MAGIC

if TYPE_CHECKING:
    from ...recording.notes import Note


def _read(path: Path) -> Source:
    from .reading import read_source

    return read_source(path)


def _write(
    file: BinaryIO, line: LineSettings, blocks: Iterable[Block], timed: bool, *, notes: Sequence[Note] = ()
) -> None:
    from ...recording.notes import NoteChannel
    from .channel import ChunkChannel
    from .writer import ArrayWriter

    writer = ArrayWriter(file)
    writer.start(library="rtuscope")
    channel = ChunkChannel(writer, line, timed=timed)
    for block in blocks:
        channel.write(block)
    if notes:
        note_channel = NoteChannel(writer)
        for note in notes:
            note_channel.write(note)
    writer.finish()


def _sniff(head: bytes) -> float:
    return 1.0 if head.startswith(MAGIC) else 0.0


FORMAT = Format("mcap", (".mcap",), _sniff, _read, _write)
