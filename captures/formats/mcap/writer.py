"""An MCAP file written forwards: like the library's `Writer`, which takes message after message, but by arrays too.

Records are the library's, but for chunk bodies and the indexes of their messages, which `records` packs, and for those
of which there may be thousands: schemas, channels, chunk indexes. A schema or channel goes into the first chunk that
needs it. Every chunk is complete in itself and has its CRC, so has the summary;
the data section has none of its own, as with the library, since every byte of it would be summed twice.

Single messages (`add_message`) are collected and written as a chunk of their own once they are large, before `add`, or
on `flush`: so that what one channel's reader needs is not spread over the chunks of all others.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import IO, Any, Final, Protocol

import numpy as np
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Chunk,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Statistics,
    SummaryOffset,
)
from numpy.typing import NDArray

from ...ragged import Ints
from .records import HEAD, MAGIC, MESSAGE, RECORD, Packed, index_records

CHUNK_SIZE: Final = 1 << 20  # bytes of a chunk before compression, about
SINGLES_SIZE: Final = 1 << 13  # of one of single messages, the raw chunks above all: damage costs a chunk
COMPRESSIONS: Final = ("zstd", "lz4", "")
_LEVEL: Final = -1  # of zstd: little dearer than lz4, and half as large; its default costs twice the time
_FAST: Final = -2  # of lz4: faster than its default, as large
_IDS: Final = 1 << 16
_INDEXES_AT_ONCE: Final = 1 << 10


class Out(Protocol):
    """What is written to: a file, or a pipe that counts."""

    def write(self, data: bytes, /) -> Any: ...

    def tell(self) -> int: ...

    def flush(self) -> Any: ...


class TopicWriter(Protocol):
    """What takes schemas, channels and messages: an `ArrayWriter`, or a server."""

    def register_schema(self, name: str, encoding: str, data: bytes) -> int: ...

    def register_channel(
        self, topic: str, message_encoding: str, schema_id: int, metadata: dict[str, str] | None = None
    ) -> int: ...

    def add(self, messages: Packed) -> None: ...


class ArrayWriter:
    """Writes one MCAP file onto `out`, which is not closed. OSError passes."""

    def __init__(self, out: Out | IO[bytes], *, chunk_size: int = CHUNK_SIZE, compression: str = "zstd") -> None:
        self._out = out
        self._chunk_size = chunk_size
        self._compression = compression
        self._compress = _compressor(compression)
        self._schemas: dict[int, bytes] = {}  # the records, by id
        self._channels: dict[int, bytes] = {}
        self._schema_of: dict[int, int] = {}  # by channel; 0 for none
        self._undeclared: set[int] = set()  # channels that no chunk has declared yet
        self._declared: set[int] = set()  # schemas that a chunk has
        self._single: list[bytes] = []
        self._single_size = 0
        self._single_entries: list[tuple[int, int, int]] = []  # channel, log time, offset of each single message
        self._counts = np.zeros(_IDS, np.int64)
        self._times: tuple[int, int] | None = None
        self._chunk_indexes = ChunkIndexes()
        self._metadata_indexes: list[MetadataIndex] = []

    def start(self, profile: str = "", library: str = "") -> None:
        """Writes what the file begins with."""
        self._out.write(MAGIC + _bytes(Header(profile, library)))

    def register_schema(self, name: str, encoding: str, data: bytes) -> int:
        """A new schema's id."""
        number = len(self._schemas) + 1
        content = (struct.pack("<H", number), _sized_text(name), _sized_text(encoding), _sized(data))
        self._schemas[number] = _record(Opcode.SCHEMA, content)
        return number

    def register_channel(
        self, topic: str, message_encoding: str, schema_id: int, metadata: dict[str, str] | None = None
    ) -> int:
        """A new channel's id, 1 to 65535; ValueError when there are no more."""
        number = len(self._channels) + 1
        if number >= _IDS:
            raise ValueError("an MCAP file has at most 65535 channels")
        about = b"".join(_sized_text(key) + _sized_text(value) for key, value in (metadata or {}).items())
        content = (
            struct.pack("<HH", number, schema_id),
            _sized_text(topic),
            _sized_text(message_encoding),
            _sized(about),
        )
        self._channels[number] = _record(Opcode.CHANNEL, content)
        self._schema_of[number] = schema_id
        self._undeclared.add(number)
        return number

    def add_metadata(self, name: str, data: dict[str, str]) -> None:
        """A metadata record, written at once."""
        record = _bytes(Metadata(name=name, metadata=data))
        self._metadata_indexes.append(MetadataIndex(offset=self._out.tell(), length=len(record), name=name))
        self._out.write(record)

    def add_message(self, channel_id: int, log_time: int, data: bytes, publish_time: int, sequence: int = 0) -> None:
        """One message."""
        self._single_entries.append((channel_id, log_time, self._single_size))
        head = MESSAGE.pack(Opcode.MESSAGE, HEAD.itemsize - 9 + len(data), channel_id, sequence, log_time, publish_time)
        self._single += (head, data)
        self._single_size += len(head) + len(data)
        if self._single_size > min(self._chunk_size, SINGLES_SIZE):
            self._end_single()

    def add(self, messages: Packed) -> None:
        """Many messages, in chunks of their own of about the chunk size."""
        self._end_single()
        first, count = 0, len(messages)
        while first < count:
            low = int(messages.offsets[first])
            last = max(int(np.searchsorted(messages.offsets, low + self._chunk_size)), first + 1)
            high = int(messages.offsets[last]) if last < count else len(messages.data)
            here = slice(first, last)
            offsets = messages.offsets[here] - low
            self._chunk(messages.data[low:high], messages.channels[here], messages.log_times[here], offsets)
            first = last

    def flush(self) -> None:
        """Ends the chunk in progress and hands all to the operating system: what is cut after this is not lost."""
        self._end_single()
        self._out.flush()

    def finish(self) -> None:
        """Ends the last chunk and writes the summary."""
        self._end_single()
        self._out.write(_bytes(DataEnd(0)))
        start = at = self._out.tell()
        groups, crc = bytearray(), 0
        for opcode, records in self._summary():
            begin = at
            for record in records:
                self._out.write(record)
                crc, at = zlib.crc32(record, crc), at + len(record)
            if at > begin:
                groups += _bytes(SummaryOffset(opcode, begin, at - begin))
        footer = _bytes(Footer(start, at, 0))
        crc = zlib.crc32(footer[:-4], zlib.crc32(groups, crc))
        self._out.write(bytes(groups) + _bytes(Footer(start, at, crc)) + MAGIC)

    def _summary(self) -> Iterable[tuple[Opcode, Iterable[bytes]]]:
        first, last = self._times or (0, 0)
        used = np.flatnonzero(self._counts)
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(zip(used.tolist(), self._counts[used].tolist(), strict=True)),
            chunk_count=len(self._chunk_indexes),
            message_count=int(self._counts.sum()),
            message_end_time=last,
            message_start_time=first,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )
        return (
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [_bytes(statistics)]),
            (Opcode.CHUNK_INDEX, self._chunk_indexes),
            (Opcode.METADATA_INDEX, [_bytes(index) for index in self._metadata_indexes]),
        )

    def _end_single(self) -> None:
        if not self._single_entries:
            return
        entries = np.array(self._single_entries, dtype=np.uint64)
        body = b"".join(self._single)
        self._single_entries, self._single, self._single_size = [], [], 0
        channels, times = entries[:, 0].astype(np.uint16), entries[:, 1]
        self._chunk(np.frombuffer(body, np.uint8), channels, times, entries[:, 2].astype(np.int64))

    def _chunk(
        self, body: NDArray[np.uint8], channels: NDArray[np.uint16], times: NDArray[np.uint64], offsets: Ints
    ) -> None:
        """A chunk with its message indexes."""
        if declarations := self._declarations(channels):
            offsets = offsets + len(declarations)
            body = np.frombuffer(declarations + body.tobytes(), np.uint8)
        first, last = int(times.min()), int(times.max())
        data = self._compress(body)
        chunk = Chunk(
            compression=self._compression,
            data=b"",
            message_end_time=last,
            message_start_time=first,
            uncompressed_crc=zlib.crc32(body.data),
            uncompressed_size=len(body),
        )
        indexes, places = index_records(channels, times, offsets)
        start = self._out.tell()
        length = self._write_chunk(chunk, data)
        places["offset"] += start + length
        self._out.write(indexes)
        self._chunk_indexes.append(_chunk_index(chunk, start, length, len(data), places.tobytes(), len(indexes)))
        counts = np.bincount(channels)
        self._counts[: len(counts)] += counts
        before = self._times or (first, last)
        self._times = min(before[0], first), max(before[1], last)

    def _write_chunk(self, chunk: Chunk, data: bytes) -> int:
        """The library's record, its empty data put right: so megabytes are not copied in between. Returns its size."""
        head = bytearray(_bytes(chunk))
        RECORD.pack_into(head, 0, Opcode.CHUNK, len(head) - RECORD.size + len(data))
        head[-8:] = len(data).to_bytes(8, "little")
        self._out.write(bytes(head))
        self._out.write(data)
        return len(head) + len(data)

    def _declarations(self, channels: NDArray[np.uint16]) -> bytes:
        """The channels of this chunk that none before has declared, with their schemas."""
        if not self._undeclared:
            return b""
        out = bytearray()
        for number in sorted(self._undeclared.intersection(np.flatnonzero(np.bincount(channels)).tolist())):
            schema = self._schema_of[number]
            if schema and schema not in self._declared:
                out += self._schemas[schema]
                self._declared.add(schema)
            out += self._channels[number]
            self._undeclared.discard(number)
        return bytes(out)


class ChunkIndexes:
    """The ChunkIndex records of a file: all but the newest packed, as a recorder adds two a second for a day."""

    def __init__(self) -> None:
        self._packed: list[bytes] = []
        self._newest: list[bytes] = []
        self._count = 0

    def __len__(self) -> int:
        return self._count

    def append(self, record: bytes) -> None:
        """One more."""
        self._newest.append(record)
        self._count += 1
        if len(self._newest) == _INDEXES_AT_ONCE:
            self._packed.append(zlib.compress(b"".join(self._newest), 1))
            self._newest = []

    def __iter__(self) -> Iterator[bytes]:
        """Records end to end, in parts of many."""
        yield from map(zlib.decompress, self._packed)
        yield b"".join(self._newest)


def _chunk_index(chunk: Chunk, start: int, length: int, size: int, places: bytes, indexes: int) -> bytes:
    """A ChunkIndex record: not the library's, which takes a mapping, since there may be thousands of channels."""
    content = (
        struct.pack("<QQQQ", chunk.message_start_time, chunk.message_end_time, start, length),
        _sized(places),
        struct.pack("<Q", indexes),
        _sized_text(chunk.compression),
        struct.pack("<QQ", size, chunk.uncompressed_size),
    )
    return _record(Opcode.CHUNK_INDEX, content)


def _record(opcode: Opcode, content: Sequence[bytes]) -> bytes:
    return b"".join((RECORD.pack(opcode, sum(map(len, content))), *content))


def _sized(content: bytes) -> bytes:
    return len(content).to_bytes(4, "little") + content


def _sized_text(text: str) -> bytes:
    return _sized(text.encode())


def _compressor(name: str) -> Callable[[Any], bytes]:
    if name == "zstd":
        import zstandard

        return zstandard.ZstdCompressor(level=_LEVEL).compress
    if name == "lz4":
        import lz4.frame  # type: ignore[import-untyped]

        return partial(lz4.frame.compress, compression_level=_FAST)
    if name:
        raise ValueError(f"no compression {name!r}: there are {COMPRESSIONS}")
    return bytes


def _bytes(record: McapRecord) -> bytes:
    builder = RecordBuilder()
    record.write(builder)
    found: bytes = builder.end()  # type: ignore[no-untyped-call]
    return found
