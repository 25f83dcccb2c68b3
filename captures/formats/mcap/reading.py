"""Reading raw chunks out of an MCAP file, whole, cut or damaged.

Reading takes record by record, so that damage costs only the record that it hit, and a file without its end gives all
that was complete. The parts come from the mcap library; the walk over records is here because the library's readers
stop at the first damage and parse every message of every channel. Chunks that by a summary with a right CRC hold none
of our messages are stepped over.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import BinaryIO

import orjson
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata
from mcap.records import Chunk as McapChunk
from mcap.stream_reader import get_chunk_data_stream

from captures.chunks import Block, Note
from captures.errors import CaptureError
from captures.files import opened
from captures.formats.mcap import MAGIC, METADATA, TOPIC
from captures.formats.mcap.messages import decoded, one_line
from captures.formats.mcap.summary import Summary, summary_of
from captures.line import LineSettings

RECORD_LIMIT = 1 << 30  # bytes of one record, packed or not: nothing that this tool writes comes near

_HEAD = struct.Struct("<BQ")  # opcode and length of every record
_MESSAGE_HEAD = 22  # channel id, sequence, log time, publish time


@dataclass(frozen=True, slots=True)
class _Reader:
    path: Path
    line: LineSettings
    timed: bool
    complaints: tuple[str, ...]

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - a chunk's messages stay together
        for complaint in self.complaints:
            note(f"metadata {METADATA!r}", complaint)
        with opened(self.path) as file:
            summary = summary_of(file)
            encodings = dict(summary.ours) if summary else {}
            for where, opcode, content in _records(file, note, summary):
                found = list(_blocks(where, opcode, content, encodings, self.timed, note))
                if found:
                    yield Block.joined(found)


def read(path: Path) -> _Reader:
    """The raw chunks of a file; CaptureError where it has none."""
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
    for _, opcode, content in _records(file, _ignore, None):
        try:
            if opcode == Opcode.METADATA:
                record = Metadata.read(ReadDataStream(BytesIO(content)))
                if record.name == METADATA:
                    return dict(record.metadata)
            elif opcode in (Opcode.CHUNK, Opcode.CHANNEL):
                if not asked:
                    # An intact file of other origin says so in its summary: no need to unpack all of it.
                    asked = True
                    summary = summary_of(file)
                    if summary is not None and not summary.ours:
                        return None
                for inner, data, start, length in _inner(opcode, content):
                    if inner == Opcode.CHANNEL and (channel := _channel(data, start, length)).topic == TOPIC:
                        return dict(channel.metadata)
        except Exception:  # a damaged record is the walk's to report
            continue
    return None


def _ignore(where: str, what: str) -> None:
    """For a first look, whose damage the reading itself will note."""


def _records(file: BinaryIO, note: Note, summary: Summary | None) -> Iterator[tuple[str, int, bytes]]:
    """Each chunk, channel, message and metadata record of the data section, as (where, opcode, content)."""
    size = file.seek(0, 2)
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        note("byte 0", "no MCAP magic: the file's beginning is damaged")
        return
    others = summary.others if summary else {}
    at, complete = len(MAGIC), False
    while True:
        while at in others:
            at = others[at]
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


def _blocks(
    where: str, opcode: int, content: bytes, encodings: dict[int, str], timed: bool, note: Note
) -> Iterator[Block]:
    """The messages of our channel in one record; `encodings` collects its ids, with how each is encoded."""
    try:
        for inner, data, start, length in _inner(opcode, content):
            if inner == Opcode.CHANNEL:
                channel = _channel(data, start, length)
                if channel.topic == TOPIC:
                    encodings[channel.id] = channel.message_encoding
                else:
                    encodings.pop(channel.id, None)
            elif inner == Opcode.MESSAGE:
                encoding = encodings.get(int.from_bytes(data[start : start + 2], "little"))
                if encoding is not None:
                    try:
                        yield decoded(data[start + _MESSAGE_HEAD : start + length], encoding, timed)
                    except ValueError as error:
                        note(where, f"a message on {TOPIC} is damaged ({error}): its chunks are lost")
    except Exception as error:  # the libraries below raise many kinds, none of which is a reason to stop
        kind = "chunk" if opcode == Opcode.CHUNK else "record"
        note(where, f"a damaged {kind} ({one_line(error)}): what it held is lost")


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
