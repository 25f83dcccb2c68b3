"""The one writer of an exported MCAP: blocks and batches come, chunks of messages go to the file."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

from analyzer.exports.targets.mcap import schemas
from captures.formats.mcap.channel import ChunkChannel
from captures.formats.mcap.log_messages import LOG_NAME, log_schema
from captures.formats.mcap.protobuf import ENCODING, Message
from captures.formats.mcap.records import METADATA
from captures.formats.mcap.writer import ArrayWriter, TopicWriter
from captures.recording.notes import NoteChannel

from ....outages import notes_of
from ....tables.batch import Batch
from ....tables.columns import decode
from ....tables.findings import Findings
from ....version import __version__
from ...output import OutputStream
from ...sink import ExportOptions
from .frames import frame_messages, noise_messages, transaction_messages
from .logs import Log, Stories
from .values import MappedTopics, UnitAreas

if TYPE_CHECKING:
    from captures import Block, Capture
    from dissectors.maps import RegisterMap

    from ....core import Analysed

LEFT_OUT: Final = f"{METADATA}/left out"  # name of the metadata record that says what is not on any topic


class Topics:
    """The topics of what was analysed, as messages."""

    def __init__(
        self, writer: TopicWriter, *, explain: bool, noise: bool, charts: Mapping[int, RegisterMap] | None
    ) -> None:
        self._writer = writer
        self._frame, self._transaction = schemas.frame(explain=explain), schemas.transaction()
        self._frames = self._channel("/frames", self._frame)
        self._transactions = self._channel("/transactions", self._transaction)
        schema = writer.register_schema(LOG_NAME, ENCODING, log_schema())
        self._log = Log(writer.register_channel("/findings", ENCODING, schema))
        self._noise = self._channel("/noise", schemas.NOISE) if noise else None
        self._values = UnitAreas(writer)
        self._mapped = MappedTopics(writer, charts) if charts else None

    def batch(self, analysed: Analysed, findings: Findings | None = None) -> None:
        """A chunk or more of each topic, so that who reads one topic does not unpack the others.

        `findings`: those that are told, where they are others than those on the batch's rows.
        """
        batch = analysed.batch
        findings = batch.findings if findings is None else findings
        decoded = decode(batch)
        add = self._writer.add
        for messages in transaction_messages(
            analysed.transactions, analysed.off_ns, self._transaction, self._transactions
        ):
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

    def left_out(self) -> dict[str, str]:
        """What is on no topic, in words."""
        left_out = {
            "values": f"{self._values.left_out} messages: too many addresses" if self._values.left_out else "",
            "findings": f"{self._log.left_out} messages: too many of a kind" if self._log.left_out else "",
        }
        return {key: words for key, words in left_out.items() if words}

    def _channel(self, topic: str, message: Message) -> int:
        schema = self._writer.register_schema(message.name, ENCODING, message.schema())
        return self._writer.register_channel(topic, ENCODING, schema)


class Recording:
    """A sink (`analyzer.exports.sink`) onto one file."""

    def __init__(self, out: OutputStream, capture: Capture, options: ExportOptions) -> None:
        self._writer = ArrayWriter(out, compression="lz4")
        self._writer.start(library=f"rtuscope {__version__}")
        self._chunks = ChunkChannel(self._writer, capture.line, timed=capture.timed, about=_about(capture))
        self._topics = Topics(self._writer, explain=options.explain, noise=options.noise, charts=options.charts)
        self._stories = Stories(self._writer, capture, whole=options.filter is None)
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
        """All topics of a batch."""
        self._topics.batch(analysed)
        self._stories.batch(analysed)

    def close(self) -> None:
        """The causes, what is left out, and the index."""
        self._stories.close()
        if left_out := self._topics.left_out():
            self._writer.add_metadata(LEFT_OUT, left_out)
        self._writer.finish()


def _about(capture: Capture) -> dict[str, str]:
    return {
        "tool": f"rtuscope {__version__}",
        "source_format": capture.format,
        "time_base": "ns on the capture's clock; log_time of a frame is its last stop bit"
        if capture.timed
        else "none: the capture has no times",
    }
