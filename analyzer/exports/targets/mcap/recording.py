"""The one writer of an exported MCAP: blocks and batches come, lots of messages go to the file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import orjson

from analyzer.columns import decode
from analyzer.exports.output import Output
from analyzer.exports.sink import ExportOptions
from analyzer.exports.targets.mcap import schemas
from analyzer.exports.targets.mcap.findings import Log, on_frames
from analyzer.exports.targets.mcap.frames import frame_lot, noise_lot
from analyzer.exports.targets.mcap.transactions import transaction_lot
from analyzer.exports.targets.mcap.values import PollGroups
from analyzer.frames import ROW, Batch, Rows
from analyzer.transactions import Transactions
from analyzer.version import __version__
from captures.formats.mcap import METADATA
from captures.formats.mcap.channel import ChunkChannel
from captures.formats.mcap.packing import Lot, packed
from captures.formats.mcap.protobuf import ENCODING, Message
from captures.formats.mcap.writer import ArrayWriter

if TYPE_CHECKING:
    from captures import Block, Capture

LEFT_OUT: Final = f"{METADATA}/left out"  # name of the metadata record that says what is not on any topic
_NOTHING: Final = Batch(np.zeros(0, ROW), np.zeros(0, np.uint8))


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
        self._settling = Transactions()
        self._held: tuple[Batch, int] | None = None  # a batch of which so many rows have come

    def block(self, block: Block) -> None:
        """Raw chunks."""
        self._chunks.write(block)

    def rows(self, batch: Batch, first: int, last: int) -> None:  # noqa: ARG002 - the protocol's signature
        """Rows are written with their whole batch, or as far as they came."""
        self._held = (batch, last)

    def batch(self, batch: Batch) -> None:
        """All rows of it, with the transactions that they settle."""
        self._held = None
        self._write(batch, self._settling.feed(batch))

    def close(self) -> None:
        """What is left, and the index."""
        if self._held is not None:
            batch, last = self._held
            self._write(replace(batch, rows=batch.rows[:last]), self._settling.close())
        else:
            self._write(_NOTHING, self._settling.close())
        left_out = {
            "values": f"{self._values.left_out} messages: too many poll groups" if self._values.left_out else "",
            "findings": f"{self._log.left_out} messages: too many of a kind" if self._log.left_out else "",
        }
        if any(left_out.values()):
            self._writer.add_metadata(LEFT_OUT, {key: what for key, what in left_out.items() if what})
        self._writer.finish()

    def _write(self, batch: Batch, settled: Rows) -> None:
        decoded, findings = decode(batch), getattr(batch, "findings", None)
        lots: list[Lot] = [
            transaction_lot(settled, batch, self._transaction, self._transactions),
            frame_lot(batch, decoded, self._frame, self._frames, on_frames(findings, batch)),
            *self._values.lots(batch, decoded),
        ]
        if self._noise is not None:
            lots.append(noise_lot(batch, self._noise))
        if findings is not None:
            lots.append(self._log.lot(findings, batch))
        self._writer.add(packed(lots, max(len(batch), 1)))

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
