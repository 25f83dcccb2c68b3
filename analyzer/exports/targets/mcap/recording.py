"""The one writer of an exported MCAP: blocks and batches come, chunks of messages go to the file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Final

import orjson

from analyzer.columns import decode
from analyzer.exports.output import Output
from analyzer.exports.sink import ExportOptions
from analyzer.exports.targets.mcap import schemas
from analyzer.exports.targets.mcap.findings import Log, on_frames
from analyzer.exports.targets.mcap.frames import frame_messages, noise_messages
from analyzer.exports.targets.mcap.transactions import transaction_messages
from analyzer.exports.targets.mcap.values import PollGroups
from analyzer.frames import Batch
from analyzer.recorded import notes_of
from analyzer.version import __version__
from captures.formats.mcap import METADATA
from captures.formats.mcap.channel import ChunkChannel
from captures.formats.mcap.protobuf import ENCODING, Message
from captures.formats.mcap.writer import ArrayWriter
from captures.recording.notes import NoteChannel

if TYPE_CHECKING:
    from analyzer.pipeline import Analysed
    from captures import Block, Capture

LEFT_OUT: Final = f"{METADATA}/left out"  # name of the metadata record that says what is not on any topic


class Recording:
    """A sink (`analyzer.exports.sink`) onto one file."""

    def __init__(self, out: Output, capture: Capture, options: ExportOptions) -> None:
        self._writer = ArrayWriter(out, compression="lz4")
        self._writer.start(library=f"rtuscope {__version__}")
        self._chunks = ChunkChannel(self._writer, capture.line, timed=capture.timed, about=_about(capture))
        self._frame, self._transaction = schemas.frame(explain=options.explain), schemas.transaction()
        self._frames = self._channel("/frames", self._frame)
        self._transactions = self._channel("/transactions", self._transaction)
        self._log = Log(self._json_channel("/findings", schemas.LOG))
        self._noise = self._channel("/noise", schemas.NOISE) if options.noise else None
        self._values = PollGroups(self._writer)
        if notes := notes_of(capture):
            channel = NoteChannel(self._writer)
            for note in notes:
                channel.write(note)

    def block(self, block: Block) -> None:
        """Raw chunks."""
        self._chunks.write(block)

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """Rows are written with their batch, each topic by itself."""

    def batch(self, analysed: Analysed) -> None:
        """A chunk or more of each topic, so that who reads one topic does not unpack the others."""
        batch, findings = analysed.batch, analysed.batch.findings
        decoded = decode(batch)
        add = self._writer.add
        for messages in transaction_messages(analysed.transactions, self._transaction, self._transactions):
            add(messages)
        counts = on_frames(findings, batch)
        for messages in frame_messages(batch, decoded, self._frame, self._frames, counts):
            add(messages)
        add(self._values.messages(batch, decoded))
        if self._noise is not None:
            add(noise_messages(batch, self._noise))
        if findings is not None:
            add(self._log.messages(findings, batch))

    def close(self) -> None:
        """What is left out, and the index."""
        left_out = {
            "values": f"{self._values.left_out} messages: too many poll groups" if self._values.left_out else "",
            "findings": f"{self._log.left_out} messages: too many of a kind" if self._log.left_out else "",
        }
        if any(left_out.values()):
            self._writer.add_metadata(LEFT_OUT, {key: what for key, what in left_out.items() if what})
        self._writer.finish()

    def _channel(self, topic: str, message: Message) -> int:
        schema = self._writer.register_schema(message.name, ENCODING, message.schema())
        return self._writer.register_channel(topic, ENCODING, schema)

    def _json_channel(self, topic: str, content: Mapping[str, Any]) -> int:
        schema = self._writer.register_schema(content["title"], "jsonschema", orjson.dumps(content))
        return self._writer.register_channel(topic, "json", schema)


def _about(capture: Capture) -> dict[str, str]:
    return {
        "tool": f"rtuscope {__version__}",
        "source_format": capture.format,
        "time_base": "ns on the capture's clock; log_time of a frame is its last stop bit"
        if capture.timed
        else "none: the capture has no times",
    }
