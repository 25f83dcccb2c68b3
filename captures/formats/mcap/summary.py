"""What a file's summary tells about the chunks in it, believed only where its CRC is right."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO, Final

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel

from captures.formats.mcap import MAGIC, TOPIC

_LIMIT: Final = 1 << 28  # bytes of a summary that are worth reading
_HEAD: Final = struct.Struct("<BQ")
_FOOTER: Final = struct.Struct("<BQQQI")
_CHUNK: Final = struct.Struct("<16xQQI")  # of a chunk index: start and length of the chunk, bytes of what follows
_OFFSETS: Final = np.dtype([("channel", "<u2"), ("offset", "<u8")])


@dataclass(frozen=True, slots=True)
class Summary:
    """`ours`: encodings of the channels that hold raw chunks, by id; `others`: where chunks without any of them begin,
    and where what follows their message indexes does."""

    ours: Mapping[int, str]
    others: Mapping[int, int]


def summary_of(file: BinaryIO) -> Summary | None:
    """The summary of a whole file; None where there is none to trust. The file's position is kept."""
    at = file.tell()
    try:
        content = _content(file)
        return None if content is None else _told(content)
    except Exception:  # a damaged one that has a right CRC: the records decide
        return None
    finally:
        file.seek(at)


def _content(file: BinaryIO) -> bytes | None:
    """The records of the summary section, when the footer's CRC says that they are right."""
    tail = _FOOTER.size + len(MAGIC)
    size = file.seek(0, 2)
    if size < tail:
        return None
    file.seek(size - tail)
    end = file.read(tail)
    opcode, _, start, _, crc = _FOOTER.unpack_from(end)
    if opcode != Opcode.FOOTER or end[_FOOTER.size :] != MAGIC or not crc or not 0 < start <= size - tail:
        return None
    length = size - tail - start
    if length > _LIMIT:
        return None
    file.seek(start)
    content = file.read(length)
    return content if zlib.crc32(end[: _FOOTER.size - 4], zlib.crc32(content)) == crc else None


def _told(content: bytes) -> Summary | None:
    ours: dict[int, str] = {}
    indexes: list[tuple[int, int]] = []
    topic = TOPIC.encode()
    channels = 0
    for opcode, start, end in _records(content):
        if opcode == Opcode.CHANNEL:
            channels += 1
            if topic in content[start:end]:
                channel: Channel = Channel.read(ReadDataStream(BytesIO(content[start:end])))
                if channel.topic == TOPIC:
                    ours[channel.id] = channel.message_encoding
        elif opcode == Opcode.CHUNK_INDEX:
            indexes.append((start, end))
    if not channels:  # a summary need not repeat them
        return None
    wanted = np.array(sorted(ours), np.uint16)
    others: dict[int, int] = {}
    for start, _ in indexes:
        chunk_start, chunk_length, size = _CHUNK.unpack_from(content, start)
        offsets = np.frombuffer(content, _OFFSETS, size // _OFFSETS.itemsize, start + _CHUNK.size)
        (indexed,) = struct.unpack_from("<Q", content, start + _CHUNK.size + size)
        if chunk_length > _HEAD.size and len(offsets) and not np.isin(wanted, offsets["channel"]).any():
            others[chunk_start] = chunk_start + chunk_length + indexed
    return Summary(ours, others)


def _records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, start and end of each record."""
    at = 0
    while at < len(content):
        opcode, length = _HEAD.unpack_from(content, at)
        at += _HEAD.size
        yield opcode, at, at + length
        at += length
