"""The channels of an MCAP file that this tool writes: raw chunks, a block as bytes and back; log messages; one topic
alone.

Logs are `foxglove.Log` in protobuf, the well-known schema of log messages, which viewers show as a log. Messages of
one topic are read out of the records of a file, whatever stands beside them.
"""

from __future__ import annotations

import base64
import binascii
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import orjson
from mcap.opcode import Opcode
from mcap.records import Channel
from numpy.typing import NDArray

from ...chunks import Block, columns
from ...errors import CaptureError
from ...limits import TIME_LIMIT
from ...line import LineSettings
from .protobuf import ENCODING, Message, MessageField, Type, delimited, fields_in, text_field, varint_field
from .records import MESSAGE, METADATA, RECORD, TOPIC, DamagedRecordError, chunk_limit, one_line, records_in
from .scanning import ScannedRecord, stream_of

if TYPE_CHECKING:
    from mcap.writer import Writer

    from .writer import ArrayWriter

LOG_NAME: Final = "foxglove.Log"
_INT64, _INT32, _FIXED32, _STRING, _MESSAGE, _ENUM = 3, 5, 7, 9, 11, 14  # types of a field descriptor
_LEVELS: Final = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")


def log_schema() -> bytes:
    """The schema as a serialised FileDescriptorSet; it brings google.protobuf.Timestamp along."""
    stamp = text_field(1, "Timestamp") + _field("seconds", 1, _INT64) + _field("nanos", 2, _INT32)
    levels = b"".join(delimited(2, text_field(1, name) + varint_field(2, n)) for n, name in enumerate(_LEVELS))
    log = b"".join(
        (
            text_field(1, "Log"),
            _field("timestamp", 1, _MESSAGE, ".google.protobuf.Timestamp"),
            _field("level", 2, _ENUM, ".foxglove.Log.Level"),
            _field("message", 3, _STRING),
            _field("name", 4, _STRING),
            _field("file", 5, _STRING),
            _field("line", 6, _FIXED32),
            delimited(4, text_field(1, "Level") + levels),
        )
    )
    return _file("google/protobuf/timestamp.proto", "google.protobuf", stamp) + _file(
        "foxglove/Log.proto", "foxglove", log, "google/protobuf/timestamp.proto"
    )


def log_message(t_ns: int, level: int, message: str, name: str) -> bytes:
    """One message; `level` 1 debug, 2 info, 3 warning, 4 error."""
    seconds, nanos = divmod(max(t_ns, 0), 1_000_000_000)
    stamp = varint_field(1, seconds) + varint_field(2, nanos)
    return delimited(1, stamp) + varint_field(2, level) + text_field(3, message) + text_field(4, name)


def _field(name: str, number: int, kind: int, type_name: str = "") -> bytes:
    parts = (text_field(1, name), varint_field(3, number), varint_field(4, 1), varint_field(5, kind))
    return delimited(2, b"".join((*parts, text_field(6, type_name) if type_name else b"")))


def _file(name: str, package: str, message: bytes, *needs: str) -> bytes:
    depends = b"".join(text_field(3, need) for need in needs)
    return delimited(
        1, text_field(1, name) + text_field(2, package) + depends + delimited(4, message) + text_field(12, "proto3")
    )


BATCH_BYTES: Final = 1 << 14  # of a message, about: what damage costs
BATCH_NS: Final = 10_000_000_000
CHUNK_MESSAGE: Final = Message(
    "rtuscope.Chunks",
    (
        MessageField("t_ns", Type.SFIXED64),
        MessageField("after_ns", Type.SFIXED64, repeated=True),
        MessageField("sizes", Type.FIXED32, repeated=True),
        MessageField("data", Type.BYTES),
        MessageField("port", Type.BYTES),
        MessageField("mark", Type.BYTES),
        MessageField("errors", Type.FIXED32, repeated=True),
    ),
)
_NUMBER: Final = CHUNK_MESSAGE.numbers
_COLUMNS: Final = {_NUMBER["after_ns"]: "<i8", _NUMBER["sizes"]: "<u4", _NUMBER["errors"]: "<u4"}
_BYTES: Final = {_NUMBER["data"], _NUMBER["port"], _NUMBER["mark"]}
_CHUNK_BYTES: Final = 12  # that a chunk takes in a message besides its data
_SIGN: Final = 1 << 63
_TIME: Final = bytes((_NUMBER["t_ns"] << 3 | 1,))
_NAMES: Final = {number: name for name, number in _NUMBER.items()}


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
        schema = writer.register_schema(CHUNK_MESSAGE.name, ENCODING, CHUNK_MESSAGE.schema())
        self._channel = writer.register_channel(TOPIC, ENCODING, schema, settings)
        self._writer = writer
        self._sequence = 0

    def write(self, block: Block) -> None:
        """Adds the chunks of a block, in one or more messages; CaptureError for one that no reader would unpack."""
        if not len(block):
            return
        longest = int(np.diff(block.offsets).max())
        if longest + BATCH_BYTES > chunk_limit():
            raise CaptureError(f"a read of {longest:,} bytes is too large for an MCAP file")
        cuts = _cuts(block)
        times = np.maximum(block.t_ns[cuts[:-1]], 0).tolist()
        for time, message in zip(times, chunk_messages(block, cuts), strict=True):
            self._writer.add_message(self._channel, time, message, time, self._sequence)
            self._sequence = (self._sequence + 1) & 0xFFFFFFFF


def _cuts(block: Block) -> list[int]:
    """Where messages begin among the chunks, and where the last ends: each at so many bytes or after so much time."""
    newest = np.maximum.accumulate(block.t_ns)
    written = block.offsets[:-1] + _CHUNK_BYTES * np.arange(len(block))
    spans, portions = (newest - newest[0]) // BATCH_NS, written // BATCH_BYTES
    new = np.flatnonzero((spans[1:] != spans[:-1]) | (portions[1:] != portions[:-1])) + 1
    return [0, *new.tolist(), len(block)]


def _settings_record(line: LineSettings, timed: bool) -> dict[str, str]:
    """Settings as MCAP metadata: one key each for people, and all of them, typed, in `line`."""
    header = line.to_header()
    plain = {key: str(value) for key, value in header.items() if key not in line.notes}
    return {**plain, "timed": "true" if timed else "false", "line": orjson.dumps(header).decode()}


def chunk_messages(block: Block, cuts: Sequence[int]) -> Iterator[bytes]:
    """A message for the chunks from each cut to the next; cuts ascend from 0 to the number of chunks.

    Columns are made for the whole block and only cut for a message, as there are thousands of those.
    """
    firsts = np.asarray(cuts[:-1], np.intp)
    starts = block.t_ns[firsts]
    counts = np.diff(np.asarray(cuts))
    after = memoryview((block.t_ns - np.repeat(starts, counts)).astype("<i8", copy=False).tobytes())
    sizes = memoryview(np.diff(block.offsets).astype("<u4").tobytes())
    data = memoryview(block.data.tobytes())
    begins = block.offsets[np.asarray(cuts, np.intp)]
    wrong = np.searchsorted(block.errors, begins).tolist()
    bounds = (begins - block.offsets[0]).tolist()
    marked = [
        (name, np.logical_or.reduceat(column != 0, firsts).tolist(), memoryview(column.tobytes()))
        for name, column in (("port", block.port), ("mark", block.mark))
        if column.any()
    ]
    for i, (first, last) in enumerate(pairwise(cuts)):
        parts = [
            _TIME,
            int(starts[i]).to_bytes(8, "little", signed=True),
            delimited(_NUMBER["after_ns"], after[8 * first : 8 * last]),
            delimited(_NUMBER["sizes"], sizes[4 * first : 4 * last]),
            delimited(_NUMBER["data"], data[bounds[i] : bounds[i + 1]]),
        ]
        parts += [delimited(_NUMBER[name], column[first:last]) for name, present, column in marked if present[i]]
        if wrong[i] < wrong[i + 1]:
            errors = block.errors[wrong[i] : wrong[i + 1]] - begins[i]
            parts.append(delimited(_NUMBER["errors"], errors.astype("<u4").tobytes()))
        yield b"".join(parts)


def block_of(payload: bytes | memoryview, encoding: str, timed: bool) -> Block:
    """The chunks of a message; ValueError where it is not one that this module writes, or wrote."""
    message = _from_json(payload) if encoding == "json" else _from_protobuf(payload)
    start, after, sizes, data = message["t_ns"], message["after_ns"], message["sizes"], message["data"]
    extras = {key: message[key] for key in ("port", "mark") if key in message}
    errors = message.get("errors", np.zeros(0, np.int64))
    if sizes.ndim != 1 or any(column.shape != sizes.shape for column in (after, *extras.values())):
        raise ValueError("its columns do not fit together")
    if (len(sizes) and int(sizes.min()) <= 0) or int(sizes.sum(dtype=np.int64)) != len(data):
        raise ValueError("its columns do not fit together")
    if len(errors) and (errors.ndim != 1 or errors.min() < 0 or errors.max() >= len(data)):
        raise ValueError("error positions outside its data")
    if len(sizes) and not -TIME_LIMIT < start + int(after.min()) <= start + int(after.max()) < TIME_LIMIT:
        raise ValueError("times out of range")
    if "mark" in extras and extras["mark"].max(initial=0) > 2:
        raise ValueError("an unknown direction mark")
    if len(errors):
        extras["errors"] = np.unique(errors)
    t_ns = after + start if len(sizes) else after
    return columns(data, sizes, t_ns, timed=timed, extras=extras)


def _from_protobuf(payload: bytes | memoryview) -> Mapping[str, Any]:
    message: dict[str, Any] = {"t_ns": 0, "after_ns": _packed(b"", "<i8"), "sizes": _packed(b"", "<u4"), "data": b""}
    for number, value in fields_in(payload):
        name = _NAMES.get(number)
        if name is None:
            continue
        if isinstance(value, int):
            if name != "t_ns":
                raise ValueError(f"{name} is a number")
            message[name] = value - (value >= _SIGN) * 2 * _SIGN
        elif name == "data":
            message[name] = value
        elif number in _COLUMNS:
            message[name] = _packed(value, _COLUMNS[number])
        elif number in _BYTES:
            message[name] = np.frombuffer(value, np.uint8)
        else:
            raise ValueError(f"{name} is not a number")
    return message


def _packed(value: bytes | memoryview, dtype: str) -> NDArray[Any]:
    return np.frombuffer(value, dtype)


def _from_json(payload: bytes | memoryview) -> Mapping[str, Any]:
    message = orjson.loads(payload)
    try:
        columns: dict[str, Any] = {
            "t_ns": int(np.int64(int(message["t_ns"]))),
            "after_ns": np.array(message["after_ns"], dtype=np.int64),
            "sizes": np.array(message["sizes"], dtype=np.int64),
            "data": base64.b64decode(message["data"], validate=True),
        }
        for key in ("port", "mark"):
            if key in message:
                columns[key] = np.array(message[key], dtype=np.uint8)
        columns["errors"] = np.array(message.get("errors", []), dtype=np.int64)
    except (TypeError, KeyError, IndexError, OverflowError, binascii.Error) as error:
        raise ValueError(f"not as its schema says: {one_line(error)}") from error
    return columns


UNDECLARED: Final = ""  # encoding of messages whose channel's declaration is lost
_HEAD: Final = MESSAGE.size - RECORD.size  # of a message, before its data


@dataclass(frozen=True, slots=True)
class TopicMessage:
    """A message of the topic that was asked for, or of a channel that is not declared; `log_time` in ns."""

    log_time: int
    encoding: str
    data: memoryview


def messages_in(record: ScannedRecord, channels: dict[int, str | None], topic: str) -> Iterator[TopicMessage]:
    """The messages in a record; DamagedRecordError ends it where there may be more.

    `channels` collects the encodings of declared channels by id, None for those of other topics.
    """
    content = memoryview(record.content)
    inner: Iterator[tuple[int, int, int]] = iter([(record.opcode, 0, len(content))])
    if record.opcode == Opcode.CHUNK:
        inner = records_in(record.content, record.packed)
    for opcode, start, end in inner:
        if opcode == Opcode.CHANNEL:
            channel = channel_in(record.content[start:end])
            channels[channel.id] = channel.message_encoding if channel.topic == topic else None
        elif opcode == Opcode.MESSAGE and end - start >= _HEAD:
            encoding = channels.get(int.from_bytes(content[start : start + 2], "little"), UNDECLARED)
            if encoding is not None:
                log_time = int.from_bytes(content[start + 6 : start + 14], "little")
                yield TopicMessage(log_time, encoding, content[start + _HEAD : end])


def channel_in(content: bytes) -> Channel:
    """A channel record inside a chunk; DamagedRecordError where it is none."""
    try:
        channel: Channel = Channel.read(stream_of(content))
    except Exception as error:  # the library's, of many kinds
        raise DamagedRecordError(f"a damaged channel: {one_line(error)}") from error
    return channel
