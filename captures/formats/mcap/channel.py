"""Writing raw chunks into an MCAP file, beside whatever else is written there."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
import orjson

from captures.chunks import Block
from captures.formats.mcap import METADATA, TOPIC
from captures.formats.mcap.messages import MESSAGE, encoded
from captures.formats.mcap.protobuf import ENCODING
from captures.line import LineSettings

if TYPE_CHECKING:
    from mcap.writer import Writer

    from captures.formats.mcap.writer import ArrayWriter

BATCH_BYTES: Final = 1 << 16
BATCH_NS: Final = 10_000_000_000


class ChunkChannel:
    """The raw chunks' channel in an MCAP file that a started `writer` writes, beside whatever else it writes.

    Making one writes the metadata record (settings of the line, and `about`: tool version, time base and the like) and
    registers schema and channel; do that before any message is added. After the writer's `flush`, what was written
    here can be read whatever happens to the rest of the file. OSError passes.
    """

    def __init__(
        self,
        writer: ArrayWriter | Writer,
        line: LineSettings,
        *,
        timed: bool = True,
        about: Mapping[str, str] | None = None,
    ) -> None:
        settings = _settings_record(line, timed)
        writer.add_metadata(METADATA, {**(about or {}), **settings})
        schema = writer.register_schema(MESSAGE.name, ENCODING, MESSAGE.schema())
        self._channel = writer.register_channel(TOPIC, ENCODING, schema, settings)
        self._writer = writer
        self._sequence = 0

    def write(self, block: Block) -> None:
        """Adds the chunks of a block, in one or more messages."""
        if not len(block):
            return
        cuts = _cuts(block)
        times = np.maximum(block.t_ns[cuts[:-1]], 0).tolist()
        for time, message in zip(times, encoded(block, cuts), strict=True):
            self._writer.add_message(self._channel, time, message, time, self._sequence)
            self._sequence = (self._sequence + 1) & 0xFFFFFFFF


def _cuts(block: Block) -> list[int]:
    """Where messages begin among the chunks, and where the last ends: each at so many bytes or after so much time."""
    newest = np.maximum.accumulate(block.t_ns)
    spans, pieces = (newest - newest[0]) // BATCH_NS, block.offsets[:-1] // BATCH_BYTES
    new = np.flatnonzero((spans[1:] != spans[:-1]) | (pieces[1:] != pieces[:-1])) + 1
    return [0, *new.tolist(), len(block)]


def _settings_record(line: LineSettings, timed: bool) -> dict[str, str]:
    """Settings as MCAP metadata: one key each for people, and all of them, typed, in `line`."""
    header = line.to_header()
    plain = {key: str(value) for key, value in header.items() if key not in line.notes}
    return {**plain, "timed": "true" if timed else "false", "line": orjson.dumps(header).decode()}
