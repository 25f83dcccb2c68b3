"""This tool's own MCAP: raw chunks without loss, in a file that any MCAP viewer opens.

One channel, `/rtuscope/chunks`, messages in JSON with their JSON Schema in the file. A message holds many chunks as
columns (up to 64 KiB or one second of the bus), since a message each would be mostly overhead:

    t_ns      time of the first chunk, ns; the message's log_time is the same (0 where it is negative)
    after_ns  each chunk's time after t_ns, ns
    sizes     each chunk's number of bytes
    data      the bytes of all of them, base64
    port      each chunk's port; left out where all are 0
    mark      each chunk's direction mark, 1 for tx, 2 for rx; left out where all are 0
    errors    positions in data of bytes with parity or framing errors; left out where there are none

Settings of the line are in a metadata record named `rtuscope`, written before anything else so that a file that was cut
has them, and again in the channel's metadata. Other channels in the file are no concern of this reader.

Reading takes record by record, so that damage costs only the record that it hit, and a file without its end gives all
that was complete. The parts come from the mcap library; the walk over records is here because the library's readers
stop at the first damage and parse every message of every channel.
"""

from __future__ import annotations

import base64
import binascii
import struct
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import orjson
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Metadata
from mcap.records import Chunk as McapChunk
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import Writer

from captures.chunks import TIME_LIMIT, Block, Note, columns
from captures.errors import CaptureError
from captures.files import opened
from captures.formats import Format
from captures.line import LineSettings

TOPIC = "/rtuscope/chunks"
METADATA = "rtuscope"
MAGIC = b"\x89MCAP0\r\n"
BATCH_BYTES = 1 << 16
BATCH_NS = 1_000_000_000
RECORD_LIMIT = 1 << 30  # bytes of one record, packed or not: nothing that this tool writes comes near

_HEAD = struct.Struct("<BQ")  # opcode and length of every record
_MESSAGE_HEAD = 22  # channel id, sequence, log time, publish time
_WHOLE = {"type": "array", "items": {"type": "integer"}}
SCHEMA = {
    "$schema": "https://json-schema.org/draft/2020-12/schema",
    "title": "rtuscope.Chunks",
    "description": "Reads of a serial tap, as columns",
    "type": "object",
    "properties": {
        "t_ns": {"type": "integer", "description": "time of the first read, ns"},
        "after_ns": {**_WHOLE, "description": "time of each read after t_ns, ns"},
        "sizes": {**_WHOLE, "description": "bytes of each read"},
        "data": {"type": "string", "contentEncoding": "base64", "description": "bytes of all reads"},
        "port": {**_WHOLE, "description": "port of each read; all 0 if absent"},
        "mark": {**_WHOLE, "description": "direction mark of each read: 0 none, 1 tx, 2 rx; all 0 if absent"},
        "errors": {**_WHOLE, "description": "positions in data of bytes with a parity or framing error"},
    },
    "required": ["t_ns", "after_ns", "sizes", "data"],
}


class ChunkChannel:
    """The raw chunks' channel in an MCAP file that a started `writer` writes, beside whatever else it writes.

    Making one writes the metadata record (settings of the line, and `about`: tool version, time base and the like) and
    registers schema and channel; do that before any message is added. OSError passes.
    """

    def __init__(
        self, writer: Writer, line: LineSettings, *, timed: bool = True, about: Mapping[str, str] | None = None
    ) -> None:
        settings = _settings_record(line, timed)
        writer.add_metadata(METADATA, {**(about or {}), **settings})
        schema = writer.register_schema("rtuscope.Chunks", "jsonschema", orjson.dumps(SCHEMA))
        self._channel = writer.register_channel(TOPIC, "json", schema, settings)
        self._writer = writer
        self._sequence = 0

    def write(self, block: Block) -> None:
        """Adds the chunks of a block, in one or more messages."""
        newest = np.maximum.accumulate(block.t_ns)
        first = 0
        while first < len(block):
            by_size = int(np.searchsorted(block.offsets, block.offsets[first] + BATCH_BYTES, side="right")) - 1
            by_time = int(np.searchsorted(newest, newest[first] + BATCH_NS, side="left"))
            last = max(min(by_size, by_time), first + 1)
            self._add(block.slice(first, last))
            first = last

    def _add(self, batch: Block) -> None:
        start = int(batch.t_ns[0])
        message: dict[str, Any] = {
            "t_ns": start,
            "after_ns": (batch.t_ns - start).tolist(),
            "sizes": np.diff(batch.offsets).tolist(),
            "data": base64.b64encode(batch.data.tobytes()).decode(),
        }
        for key, column in (("port", batch.port), ("mark", batch.mark)):
            if column.any():
                message[key] = column.tolist()
        if len(batch.errors):
            message["errors"] = batch.errors.tolist()
        time = max(start, 0)
        self._writer.add_message(self._channel, time, orjson.dumps(message), time, self._sequence)
        self._sequence = (self._sequence + 1) & 0xFFFFFFFF


def _settings_record(line: LineSettings, timed: bool) -> dict[str, str]:
    """Settings as MCAP metadata: one key each for people, and all of them, typed, in `line`."""
    header = line.to_header()
    plain = {key: str(value) for key, value in header.items() if key not in line.notes}
    return {**plain, "timed": "true" if timed else "false", "line": orjson.dumps(header).decode()}


def _write(file: BinaryIO, line: LineSettings, blocks: Iterable[Block], timed: bool) -> None:
    writer = Writer(file)
    writer.start(profile="", library="rtuscope")
    channel = ChunkChannel(writer, line, timed=timed)
    for block in blocks:
        channel.write(block)
    writer.finish()  # type: ignore[no-untyped-call]


@dataclass(frozen=True, slots=True)
class _Reader:
    path: Path
    line: LineSettings
    timed: bool
    complaints: tuple[str, ...]

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - a message's chunks stay together
        for complaint in self.complaints:
            note(f"metadata {METADATA!r}", complaint)
        channels: set[int] = set()
        with opened(self.path) as file:
            for where, opcode, content in _records(file, note):
                for payload in _messages(where, opcode, content, channels, note):
                    try:
                        yield _block(payload, self.timed)
                    except ValueError as error:
                        note(where, f"a message on {TOPIC} is damaged ({error}): its chunks are lost")


def _read(path: Path) -> _Reader:
    with opened(path) as file:
        settings = _find_settings(file)
        if settings is None:
            raise CaptureError(
                f"{path}: an MCAP file without raw chunks (no channel {TOPIC}): only one recorded or exported by "
                "rtuscope can be read, or it was cut before its settings"
            )
    try:
        header = orjson.loads(settings.get("line", "{}"))
    except orjson.JSONDecodeError:
        header = None
    if not isinstance(header, dict):
        return _Reader(path, LineSettings(), True, ("the settings of the line are damaged: not known",))
    line, complaints = LineSettings.from_header(header)
    return _Reader(path, line, settings.get("timed") != "false", tuple(complaints))


def _find_settings(file: BinaryIO) -> dict[str, str] | None:
    """The settings record of a file, from the metadata or else from the channel; None where there is neither."""
    asked = False
    for _, opcode, content in _records(file, _ignore):
        try:
            if opcode == Opcode.METADATA:
                record = Metadata.read(ReadDataStream(BytesIO(content)))
                if record.name == METADATA:
                    return dict(record.metadata)
            elif opcode in (Opcode.CHUNK, Opcode.CHANNEL):
                if not asked:
                    # An intact file of other origin says so in its summary: no need to unpack all of it.
                    asked = True
                    if _summary_denies(file):
                        return None
                for inner, data, start, length in _inner(opcode, content):
                    if inner == Opcode.CHANNEL and (channel := _channel(data, start, length)).topic == TOPIC:
                        return dict(channel.metadata)
        except Exception:  # a damaged record is the walk's to report
            continue
    return None


def _summary_denies(file: BinaryIO) -> bool:
    at = file.tell()
    try:
        summary = make_reader(file).get_summary()
        return summary is not None and all(channel.topic != TOPIC for channel in summary.channels.values())
    except Exception:  # no summary, or a damaged one: the records decide
        return False
    finally:
        file.seek(at)


def _ignore(where: str, what: str) -> None:
    """For a first look, whose damage the reading itself will note."""


def _records(file: BinaryIO, note: Note) -> Iterator[tuple[str, int, bytes]]:
    """Each chunk, channel, message and metadata record of the data section, as (where, opcode, content)."""
    size = file.seek(0, 2)
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        note("byte 0", "no MCAP magic: the file's beginning is damaged")
        return
    at, complete = len(MAGIC), False
    while True:
        file.seek(at)
        head = file.read(_HEAD.size)
        if len(head) < _HEAD.size:
            break
        opcode, length = _HEAD.unpack(head)
        where = f"byte {at}"
        if not (Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode >= 0x80):
            note(where, f"no record can begin with {opcode:02X}: what follows is damaged and not read")
            return
        if at + _HEAD.size + length > size:
            break
        at += _HEAD.size + length
        complete = complete or opcode == Opcode.DATA_END
        if opcode == Opcode.FOOTER:
            if file.seek(at) == at and file.read(len(MAGIC)) == MAGIC:
                return
            break
        if complete or opcode not in (Opcode.CHUNK, Opcode.CHANNEL, Opcode.MESSAGE, Opcode.METADATA):
            continue
        if length > RECORD_LIMIT:
            note(where, f"a record of {length} bytes is too large: skipped")
            continue
        yield where, opcode, file.read(length)
    lost = "all chunks are whole" if complete else "what was complete before is given"
    note(f"byte {at}", f"file ends at byte {size} without a footer: {lost}")


def _messages(where: str, opcode: int, content: bytes, channels: set[int], note: Note) -> Iterator[bytes]:
    """The payloads of our channel in one record; `channels` collects its ids."""
    try:
        for inner, data, start, length in _inner(opcode, content):
            if inner == Opcode.CHANNEL:
                channel = _channel(data, start, length)
                (channels.add if channel.topic == TOPIC else channels.discard)(channel.id)
            elif inner == Opcode.MESSAGE and int.from_bytes(data[start : start + 2], "little") in channels:
                yield data[start + _MESSAGE_HEAD : start + length]
    except Exception as error:  # the libraries below raise many kinds, none of which is a reason to stop
        kind = "chunk" if opcode == Opcode.CHUNK else "record"
        note(where, f"a damaged {kind} ({_one_line(error)}): what it held is lost")


def _channel(data: bytes, start: int, length: int) -> Channel:
    channel: Channel = Channel.read(ReadDataStream(BytesIO(data[start : start + length])))
    return channel


def _inner(opcode: int, content: bytes) -> Iterator[tuple[int, bytes, int, int]]:
    """The records inside a chunk, or any other record itself: opcode, the bytes it lies in, start and length there."""
    if opcode != Opcode.CHUNK:
        yield opcode, content, 0, len(content)
        return
    data, at = _unpacked(content), 0
    while at < len(data):
        inner, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        if at + length > len(data):
            raise ValueError("a record reaches past the chunk's end")
        yield inner, data, at, length
        at += length


def _unpacked(content: bytes) -> bytes:
    """The records inside a chunk record; any exception where it is damaged."""
    chunk = McapChunk.read(ReadDataStream(BytesIO(content)))
    if chunk.uncompressed_size > RECORD_LIMIT:
        raise ValueError(f"{chunk.uncompressed_size} bytes unpacked are too many")
    stream, length = get_chunk_data_stream(chunk, validate_crc=True)
    return stream.read(length)


def _block(payload: bytes, timed: bool) -> Block:
    """The chunks of one message; ValueError where it is not one that this module writes."""
    message = orjson.loads(payload)
    try:
        data = base64.b64decode(message["data"], validate=True)
        sizes = np.array(message["sizes"], dtype=np.int64)
        start = int(message["t_ns"])
        t_ns = np.array(message["after_ns"], dtype=np.int64) + np.int64(start)
        extras = {key: np.array(message[key], dtype=np.uint8) for key in ("port", "mark") if key in message}
        errors = np.array(message.get("errors", []), dtype=np.int64)
    except (TypeError, KeyError, IndexError, OverflowError, binascii.Error) as error:
        raise ValueError(f"not as its schema says: {_one_line(error)}") from error
    shapes_fit = all(column.shape == (len(sizes),) for column in (t_ns, *extras.values()))
    if sizes.ndim != 1 or not shapes_fit or (sizes <= 0).any() or int(sizes.sum()) != len(data):
        raise ValueError("its columns do not fit together")
    if len(errors) and (errors.ndim != 1 or errors.min() < 0 or errors.max() >= len(data)):
        raise ValueError("error positions outside its data")
    if len(sizes) and (t_ns.min() <= -TIME_LIMIT or t_ns.max() >= TIME_LIMIT):
        raise ValueError("times out of range")
    if "mark" in extras and extras["mark"].max(initial=0) > 2:
        raise ValueError("an unknown direction mark")
    return columns(data, sizes, t_ns, timed=timed, extras={**extras, "errors": np.unique(errors)})


def _one_line(error: Exception) -> str:
    return (" ".join(str(error).split()) or type(error).__name__)[:120]


def _sniff(head: bytes) -> float:
    return 1.0 if head.startswith(MAGIC) else 0.0


FORMAT = Format("mcap", (".mcap",), _sniff, _read, _write)
