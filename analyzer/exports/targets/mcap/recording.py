"""The one writer of an exported MCAP: blocks and batches come, chunks of messages go to the file."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import orjson

from analyzer.exports.targets.mcap import schemas
from captures.formats.mcap.channel import ChunkChannel
from captures.formats.mcap.log_messages import LOG_NAME, log_message, log_schema
from captures.formats.mcap.protobuf import ENCODING, Message
from captures.formats.mcap.records import METADATA
from captures.formats.mcap.writer import ArrayWriter
from captures.recording.notes import NoteChannel

from ....causes.ledger import Ledger
from ....causes.reasoning import causes_of
from ....outages import notes_of
from ....tables.batch import Batch
from ....tables.columns import decode
from ....tables.findings import Severity
from ....usernotes import Notes, marked_rows
from ....version import __version__
from ...output import OutputStream
from ...sink import ExportOptions
from .findings import Log
from .frames import frame_messages, noise_messages
from .mapped import MappedTopics
from .schemas import LEVELS
from .transactions import transaction_messages
from .values import UnitAreas

if TYPE_CHECKING:
    from collections.abc import Sequence

    from captures import Block, Capture

    from ....causes.model import Cause
    from ....core import Analysed

CAUSES: Final = f"{METADATA}/causes"  # name of the metadata record with what explains the findings
LEFT_OUT: Final = f"{METADATA}/left out"  # name of the metadata record that says what is not on any topic


class Recording:
    """A sink (`analyzer.exports.sink`) onto one file."""

    def __init__(self, out: OutputStream, capture: Capture, options: ExportOptions) -> None:
        self._writer = ArrayWriter(out, compression="lz4")
        self._writer.start(library=f"rtuscope {__version__}")
        self._chunks = ChunkChannel(self._writer, capture.line, timed=capture.timed, about=_about(capture))
        self._frame, self._transaction = schemas.frame(explain=options.explain), schemas.transaction()
        self._frames = self._channel("/frames", self._frame)
        self._transactions = self._channel("/transactions", self._transaction)
        self._log = Log(self._log_channel("/findings"))
        self._noise = self._channel("/noise", schemas.NOISE) if options.noise else None
        self._values = UnitAreas(self._writer)
        self._mapped = MappedTopics(self._writer, options.charts) if options.charts else None
        self._ledger = None if options.filter is not None else Ledger(capture.line)  # a part of a bus tells no story
        self._marks, self._marked = Notes.of_capture(capture.path), -1  # and the channel of them, once there is one
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
        counts = batch.finding_counts if len(batch.finding_rows) else None
        for messages in frame_messages(batch, decoded, self._frame, self._frames, counts):
            add(messages)
        add(self._values.messages(batch, decoded))
        if self._mapped is not None and (mapped := self._mapped.messages(batch, decoded)) is not None:
            add(mapped)
        if self._noise is not None:
            add(noise_messages(batch, self._noise))
        if findings is not None:
            add(self._log.messages(findings, batch))
        for row, comment in marked_rows(self._marks, batch.rows["port"], batch.rows["start"]).items():
            self._mark(int(batch.rows["t_end"][row]), int(batch.rows["index"][row]), comment)
        if self._ledger is not None:
            self._ledger.feed(batch, analysed.transactions)

    def close(self) -> None:
        """The causes, what is left out, and the index."""
        if self._ledger is not None:
            self._ledger.close()
            self._tell(causes_of(self._ledger), self._ledger.end)
        left_out = {
            "values": f"{self._values.left_out} messages: too many addresses" if self._values.left_out else "",
            "findings": f"{self._log.left_out} messages: too many of a kind" if self._log.left_out else "",
        }
        if any(left_out.values()):
            self._writer.add_metadata(LEFT_OUT, {key: what for key, what in left_out.items() if what})
        self._writer.finish()

    def _mark(self, t_ns: int, index: int, comment: str) -> None:
        """A bookmark of the user's, as a log message on its row's time."""
        if self._marked < 0:
            self._marked = self._log_channel("/bookmarks")
        name = f"frame {index}" if index >= 0 else "noise"
        message = log_message(t_ns, LEVELS[Severity.NOTE], comment or "bookmark", name)
        self._writer.add_message(self._marked, t_ns, message, t_ns)

    def _tell(self, causes: Sequence[Cause], end_ns: int) -> None:
        """The causes as log messages at the end of the capture, best first, and whole as JSON in a metadata record."""
        if not causes:
            return
        channel = self._log_channel("/causes")
        for cause in causes:
            text = f"{cause.text} ({cause.confidence:.0%} sure; to be sure: {cause.deciding_test}; do: {cause.remedy})"
            message = log_message(end_ns, LEVELS[Severity[cause.severity.upper()]], text, cause.cause)
            self._writer.add_message(channel, end_ns, message, end_ns)
        told = {
            f"{place:02d} {cause.cause}": orjson.dumps(cause.to_json()).decode()
            for place, cause in enumerate(causes, 1)
        }
        self._writer.add_metadata(CAUSES, told)

    def _channel(self, topic: str, message: Message) -> int:
        schema = self._writer.register_schema(message.name, ENCODING, message.schema())
        return self._writer.register_channel(topic, ENCODING, schema)

    def _log_channel(self, topic: str) -> int:
        schema = self._writer.register_schema(LOG_NAME, ENCODING, log_schema())
        return self._writer.register_channel(topic, ENCODING, schema)


def _about(capture: Capture) -> dict[str, str]:
    return {
        "tool": f"rtuscope {__version__}",
        "source_format": capture.format,
        "time_base": "ns on the capture's clock; log_time of a frame is its last stop bit"
        if capture.timed
        else "none: the capture has no times",
    }
