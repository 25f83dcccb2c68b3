"""What happened during a recording besides bytes: an adapter unplugged, a clock set, bytes that could not be kept.

Notes are messages of the well-known schema `foxglove.Log` on a topic of their own, so that any viewer shows them in
time; this tool reads them back with `read`.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

if TYPE_CHECKING:
    from mcap.writer import Writer

    from captures.formats.mcap.writer import ArrayWriter

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
    from mcap.reader import McapReader, NonSeekingReader, SeekingReader

    notes: list[Note] = []
    try:
        with path.open("rb") as file:
            reader: McapReader = SeekingReader(file)
            try:
                summary = reader.get_summary()
            except Exception:  # cut: read from its beginning as far as it goes
                summary = None
            if summary is None:
                file.seek(0)
                reader = NonSeekingReader(file)
            elif all(channel.topic != TOPIC for channel in summary.channels.values()):
                return []
            for _, _, message in reader.iter_messages(topics=[TOPIC], log_time_order=False):
                said: dict[str, Any] = json.loads(message.data)
                notes.append(Note(message.log_time, str(said["name"]), str(said["message"])))
    except Exception:  # a damaged or foreign file: what was whole is given
        pass
    return sorted(notes, key=lambda note: note.t_ns)
