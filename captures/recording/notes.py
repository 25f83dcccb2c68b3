"""What happened during a recording besides bytes: an adapter unplugged, a clock set, bytes that could not be kept.

Notes are messages of the well-known schema `foxglove.Log` on a topic of their own, so that any viewer shows them in
time; this tool reads them back with `read`.
"""

from __future__ import annotations

import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

import orjson

from ..errors import CaptureError
from ..files import opened
from ..formats.mcap.channel import TopicMessage, messages_in
from ..formats.mcap.records import DamagedRecordError
from ..formats.mcap.scanning import FileBytes, ScannedRecord, lacks, read_summary, walk

if TYPE_CHECKING:
    from mcap.writer import Writer

    from ..formats.mcap.writer import ArrayWriter

TOPIC: Final = "/rtuscope/notes"
_WARNING: Final = 3  # of foxglove.Log's levels
_SCHEMA: Final = {
    "title": "foxglove.Log",
    "type": "object",
    "properties": {
        "timestamp": {"type": "object", "properties": {"sec": {"type": "integer"}, "nsec": {"type": "integer"}}},
        "level": {"type": "integer"},
        "message": {"type": "string"},
        "name": {"type": "string"},
        "file": {"type": "string"},
        "line": {"type": "integer"},
    },
}


@dataclass(frozen=True, slots=True)
class Note:
    """Something that happened at `t_ns`; `kind` is one word, such as `lost` or `gap`."""

    t_ns: int
    kind: str
    text: str


class NoteChannel:
    """The notes' channel in a file that a started `writer` writes; registers its schema when it is made."""

    def __init__(self, writer: ArrayWriter | Writer) -> None:
        schema = writer.register_schema("foxglove.Log", "jsonschema", json.dumps(_SCHEMA).encode())
        self._channel = writer.register_channel(TOPIC, "json", schema)
        self._writer = writer

    def write(self, note: Note) -> None:
        """Adds a note."""
        seconds, nanoseconds = divmod(note.t_ns, 1_000_000_000)
        message = {
            "timestamp": {"sec": seconds, "nsec": nanoseconds},
            "level": _WARNING,
            "message": note.text,
            "name": note.kind,
            "file": "",
            "line": 0,
        }
        self._writer.add_message(self._channel, note.t_ns, json.dumps(message).encode(), note.t_ns)


def read(path: Path) -> list[Note]:
    """The notes of a recording in time order, as far as the file is whole; none where it is no recording.

    Of a whole file only the parts that hold notes are read.
    """
    notes: list[Note] = []
    with suppress(CaptureError), opened(path) as file:
        data = FileBytes(file)
        if lacks(data, TOPIC):
            return []
        summary = read_summary(data, TOPIC)
        channels = dict(summary.channels) if summary else {}
        for item in walk(data, summary, _ignore):
            if isinstance(item, ScannedRecord):
                with suppress(DamagedRecordError):
                    for message in messages_in(item, channels, TOPIC):
                        if (note := _note_of(message)) is not None:
                            notes.append(note)
    return sorted(notes, key=lambda note: note.t_ns)


def _note_of(message: TopicMessage) -> Note | None:
    """A note, None for a message that is none: its channel's declaration may be lost."""
    try:
        content = orjson.loads(message.data)
        return Note(message.log_time, str(content["name"]), str(content["message"]))
    except (ValueError, TypeError, KeyError):
        return None


def _ignore(where: str, what: str) -> None:
    """Damage is for the reading of the capture to tell."""
