"""MCAP: one self-contained file for any viewer, and a capture that every command reads again.

Raw chunks go in as they were captured, by the same code that records them; beside them frames, transactions, register
values and findings, a topic each, JSON with its schema in the file (docs/mcap.md). log_time is when it was on the wire.
Chunks are compressed and each is complete in itself, so that a file that was cut still gives all before the cut.
"""

from __future__ import annotations

from typing import IO, TYPE_CHECKING, Any, Final, cast

import orjson
from mcap.writer import CompressionType, Writer

from analyzer.exports import schemas
from analyzer.exports.encoding import Encoder, explain_json, noise_json
from analyzer.exports.output import Output
from analyzer.exports.sink import ExportOptions
from analyzer.frames import Batch, Frame, Kind, Rows
from analyzer.transactions import Status, Transactions
from analyzer.version import __version__
from captures.formats.mcap import ChunkChannel

if TYPE_CHECKING:
    from captures import Block, Capture

WHOLE: Final = "an MCAP file holds the whole capture, raw bytes included; write jsonl or csv, or filter what is read"
_CHUNK: Final = 1 << 20


class _Recording:
    def __init__(self, out: Output, capture: Capture, options: ExportOptions) -> None:
        self._options = options
        self._encoder = Encoder(values=True)
        self._writer = Writer(cast(IO[Any], out), chunk_size=_CHUNK, compression=CompressionType.ZSTD)
        self._writer.start(library=f"rtuscope {__version__}")
        self._chunks = ChunkChannel(self._writer, capture.line, timed=capture.timed, about=_about(capture))
        self._frames = self._channel("/frames", schemas.FRAME)
        self._transactions = self._channel("/transactions", schemas.TRANSACTION)
        self._findings = self._channel("/findings", schemas.LOG)
        self._noise = self._channel("/noise", schemas.NOISE) if options.noise else 0
        self._values: dict[str, int] = {}
        self._settling = Transactions()

    def block(self, block: Block) -> None:
        """Raw chunks."""
        self._chunks.write(block)

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """Frames and their values; noise if asked."""
        for row, kind in enumerate(batch.rows["kind"][first:last].tolist(), first):
            if kind != Kind.NOISE:
                self._frame(batch.frame(row))
            elif self._options.noise:
                line = noise_json(batch, row)
                self._add(self._noise, line["t_end_ns"], line)

    def batch(self, batch: Batch) -> None:
        """Transactions that are settled by then."""
        self._settle(self._settling.feed(batch))

    def close(self) -> None:
        """Transactions still open, and the index."""
        self._settle(self._settling.close())
        self._writer.finish()  # type: ignore[no-untyped-call]

    def _frame(self, frame: Frame) -> None:
        line = self._encoder.line(frame)
        line["summary"] = frame.summary()
        if self._options.explain:
            line["explain"] = explain_json(frame)
        self._add(self._frames, frame.t_end_ns, line)
        for finding in line["findings"]:
            self._finding(frame.t_end_ns, finding)
        encoded = self._encoder.encoded(frame)
        if encoded.area is not None:
            self._write(self._value_channel(frame.unit, encoded.area, encoded.values), frame.t_end_ns, encoded.values)

    def _finding(self, t_ns: int, finding: dict[str, Any]) -> None:
        seconds, nanoseconds = divmod(max(t_ns, 0), 1_000_000_000)
        message = {
            "timestamp": {"sec": seconds, "nsec": nanoseconds},
            "level": schemas.LEVELS[finding["severity"]],
            "message": finding["text"],
            "name": finding["code"],
            "file": "",
            "line": 0,
        }
        self._add(self._findings, t_ns, message)

    def _settle(self, settled: Rows) -> None:
        for row in settled:
            answered = int(row["response"]) >= 0
            measured = int(row["response_ns"])
            message = {
                "request": int(row["request"]),
                "response": int(row["response"]) if answered else None,
                "unit": int(row["unit"]),
                "function": int(row["function"]),
                "status": Status(int(row["status"])).name.lower(),
                "response_time_ms": measured / 1e6 if measured >= 0 else None,
                "retry": bool(row["retry"]),
                "late": bool(row["late"]),
            }
            self._add(self._transactions, int(row["t_response"] if answered else row["t_request"]), message)

    def _value_channel(self, unit: int, area: str, first: bytes) -> int:
        topic = f"/unit/{unit}/{area}"
        channel = self._values.get(topic)
        if channel is None:
            channel = self._values[topic] = self._channel(topic, schemas.values(unit, area, orjson.loads(first)))
        return channel

    def _channel(self, topic: str, schema: dict[str, Any]) -> int:
        schema_id = self._writer.register_schema(schema["title"], "jsonschema", orjson.dumps(schema))
        return self._writer.register_channel(topic, "json", schema_id)

    def _add(self, channel: int, t_ns: int, message: object) -> None:
        self._write(channel, t_ns, orjson.dumps(message))

    def _write(self, channel: int, t_ns: int, message: bytes) -> None:
        at = max(t_ns, 0)  # the format has no times before its epoch
        self._writer.add_message(channel, at, message, at)


def _about(capture: Capture) -> dict[str, str]:
    return {
        "tool": f"rtuscope {__version__}",
        "source_format": capture.format,
        "time_base": "ns on the capture's clock; log_time of a frame is its last stop bit"
        if capture.timed
        else "none: the capture has no times",
    }


def open_sink(out: Output, capture: Capture, options: ExportOptions) -> _Recording:
    """A recording onto `out`."""
    return _Recording(out, capture, options)
