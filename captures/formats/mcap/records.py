"""Records of an MCAP file, as far as they are laid out here and not by the mcap library; and messages packed as arrays.

A chunk is believed only where its CRC is right, and unpacked only as far as it claims to go: what a few bytes unpack to
is bounded for a chunk, for a whole file, and in the number of records in it.

A message's bytes are a head, which is its record's head and whatever is of constant width, and maybe a tail of any
length out of one buffer. So sizes give offsets by one cumulative sum, and bytes go to their places in groups of one
width, without a Python object a message. Where all messages have one head and no tail, the array of their heads is the
records as they stand. What is worked on at once should stay in the processor's cache: whoever has many messages packs
them `AT_ONCE`.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from mcap.opcode import Opcode
from numpy.typing import NDArray

from ...ragged import Bytes, Ints, copy_spilling, scatter, sums

MAGIC: Final = b"\x89MCAP0\r\n"
TOPIC: Final = "/rtuscope/chunks"
METADATA: Final = "rtuscope"

RECORD: Final = struct.Struct("<BQ")  # opcode and length of every record
MESSAGE: Final = struct.Struct("<BQHIQQ")  # what every message record begins with, its publish time included
FOOTER: Final = struct.Struct("<BQQQI")
_CHUNK: Final = struct.Struct("<QQQII")  # first and last log time, unpacked size, CRC, length of the compression's name
_LENGTH: Final = struct.Struct("<Q")
_NAMES: Final = (b"", b"lz4", b"zstd")
CHUNK_HEAD: Final = RECORD.size + _CHUNK.size + max(map(len, _NAMES)) + _LENGTH.size  # bytes, at the most

_MIB: Final = 1 << 20
_LIMIT_MIB: Final = 64  # of one chunk unpacked; nothing that this tool writes comes near
_LIMIT_SETTING: Final = "RTUSCOPE_CHUNK_MIB"
_RATIO: Final = 250  # that a file's chunks unpack to beyond that, all together; recordings have 2 to 40
_RECORDS: Final = 1000  # in a chunk, and one for every two packed bytes: each has a time of its own


class DamagedRecordError(ValueError):
    """A record that does not hold what it must; one line says what is wrong."""


@dataclass(frozen=True, slots=True)
class ChunkHead:
    """What a chunk record says before its content: sizes in bytes, `start` of the content in the record."""

    first_ns: int
    last_ns: int
    unpacked: int
    crc: int
    compression: bytes
    start: int
    packed: int

    @property
    def length(self) -> int:
        """Bytes of the whole record."""
        return self.start + self.packed


def chunk_head(data: bytes) -> ChunkHead | None:
    """The head of a chunk record, from its first `CHUNK_HEAD` bytes, whatever opcode they begin with.

    None where no chunk has such a head: an unknown compression, or lengths that contradict each other.
    """
    if len(data) < CHUNK_HEAD - max(map(len, _NAMES)):
        return None
    _, length = RECORD.unpack_from(data)
    first, last, unpacked, crc, named = _CHUNK.unpack_from(data, RECORD.size)
    at = RECORD.size + _CHUNK.size
    if named > 4 or (name := data[at : at + named]) not in _NAMES or len(data) < at + named + _LENGTH.size:
        return None
    (packed,) = _LENGTH.unpack_from(data, at + named)
    start = at + named + _LENGTH.size
    if RECORD.size + length != start + packed:
        return None
    return ChunkHead(first, last, unpacked, crc, name, start, packed)


def chunk_limit() -> int:
    """Bytes that one chunk may unpack to."""
    setting = os.environ.get(_LIMIT_SETTING, "")
    return (int(setting) if setting.isascii() and setting.isdecimal() and len(setting) < 9 else _LIMIT_MIB) * _MIB


class Unpacker:
    """Unpacks the chunks of one file of `size` bytes, and no more of them than a file of that size can mean."""

    def __init__(self, size: int) -> None:
        self._limit = chunk_limit()
        self._left = self._limit + _RATIO * size
        self._zstd: Any = None

    def unpacked(self, head: ChunkHead, content: bytes) -> bytes:
        """The records inside a chunk; DamagedRecordError where they are not what its head says."""
        size = head.unpacked
        if size > self._limit:
            need = -(-size // _MIB)
            raise DamagedRecordError(
                f"it unpacks to {need} MiB, over {self._limit // _MIB}: {_LIMIT_SETTING}={need} allows it"
            )
        if size > self._left:
            raise DamagedRecordError("its chunks unpack to more than a file of this size can hold")
        self._left -= size
        try:
            data = self._decompressed(head.compression, content, size)
        except DamagedRecordError:
            raise
        except Exception as error:  # of the libraries below, each of its own kind
            raise DamagedRecordError(one_line(error)) from error
        if len(data) != size:
            raise DamagedRecordError("its unpacked size is not the declared one")
        if head.crc and zlib.crc32(data) != head.crc:
            raise DamagedRecordError("its CRC is wrong")
        return data

    def _decompressed(self, compression: bytes, content: bytes, size: int) -> bytes:
        """At most `size` bytes and one more: frames have a size of their own, which need not be that of the chunk."""
        if not compression or not size:
            return content[: size + 1]
        if compression == b"zstd":
            import zstandard

            if self._zstd is None:
                self._zstd = zstandard.ZstdDecompressor()
            if zstandard.get_frame_parameters(content).content_size == size:
                return bytes(self._zstd.decompress(content))
            with self._zstd.stream_reader(content, read_across_frames=True) as stream:
                return bytes(stream.read(size + 1))
        import lz4.frame  # type: ignore[import-untyped]

        return bytes(lz4.frame.LZ4FrameDecompressor().decompress(content, max_length=size + 1))


def records_in(data: bytes, packed: int) -> Iterator[tuple[int, int, int]]:
    """Opcode, start and end of each record in a chunk of so many bytes packed; DamagedRecordError ends it."""
    at, size, most = 0, len(data), _RECORDS + packed // 2
    while at < size:
        if at + RECORD.size > size:
            raise DamagedRecordError("a record is cut at the chunk's end")
        opcode, length = RECORD.unpack_from(data, at)
        at += RECORD.size
        if at + length > size:
            raise DamagedRecordError("a record reaches past the chunk's end")
        if not most:
            raise DamagedRecordError("more records than its bytes can hold")
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            yield opcode, at, at + length
        at, most = at + length, most - 1


def one_line(error: Exception) -> str:
    """What went wrong, on one line of at most 120 characters."""
    return (" ".join(str(error).split()) or type(error).__name__)[:120]


AT_ONCE: Final = 1 << 12  # messages: their heads and what they are made of are some hundred KiB
_RECORD: Final = 9  # bytes of an opcode and a length

# What every message record begins with. The log time is the publish time too.
HEAD: Final = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("sequence", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
_INDEX_HEAD: Final = np.dtype([("opcode", "u1"), ("length", "<u8"), ("channel", "<u2"), ("bytes", "<u4")])
_INDEX_ENTRY: Final = np.dtype([("log_time", "<u8"), ("offset", "<u8")])
_PLACE: Final = np.dtype([("channel", "<u2"), ("offset", "<u8")])


@dataclass(frozen=True, slots=True, eq=False)
class Tails:
    """What follows each head: `sizes` bytes of `data` from `begins` on."""

    data: Bytes
    begins: Ints
    sizes: Ints


@dataclass(frozen=True, slots=True, eq=False)
class PackedPart:
    """Messages that have a head of one width: their numbers among all (None for all of them) and their heads."""

    which: Ints | None
    heads: NDArray[np.void]  # as `heads` makes them


@dataclass(frozen=True, slots=True, eq=False)
class Packed:
    """n message records end to end in `data`; of each its channel, its log time, and where it begins."""

    data: Bytes
    channels: NDArray[np.uint16]
    log_times: NDArray[np.uint64]
    offsets: Ints

    def __len__(self) -> int:
        return len(self.offsets)


def heads(layout: NDArray[np.void], count: int) -> NDArray[np.void]:
    """So many copies of a one-row layout that begins with `record`, of type HEAD, as heads of messages."""
    row = layout.copy()
    row["record"]["opcode"], row["record"]["length"] = Opcode.MESSAGE, row.dtype.itemsize - _RECORD
    return np.repeat(row, count)


def packed(channels: Any, times: Ints, parts: Sequence[PackedPart], tails: Tails | None = None) -> Packed:
    """Messages as records, in this order; their heads get what the record says here.

    `channels` (n, or one for all) and `times` (n, ns); times before 0, which the format has not, become 0.
    """
    channels = np.broadcast_to(np.asarray(channels, np.uint16), len(times))
    log_times = np.maximum(times, 0).astype(np.uint64)
    sizes = np.zeros(len(times), np.int64)
    for part in parts:
        pick = slice(None) if part.which is None else part.which
        sizes[pick] = part.heads.dtype.itemsize
        record = part.heads["record"]
        record["channel"] = channels[pick]
        record["log_time"] = record["publish_time"] = log_times[pick]
    if tails is not None:
        sizes += tails.sizes
        for part in parts:
            part.heads["record"]["length"] = sizes[slice(None) if part.which is None else part.which] - _RECORD
    ends = sums(sizes)
    return Packed(_records(parts, tails, ends), channels, log_times, ends[:-1])


def _records(parts: Sequence[PackedPart], tails: Tails | None, ends: Ints) -> Bytes:
    if tails is None and len(parts) == 1 and parts[0].which is None:
        return parts[0].heads.view(np.uint8)
    data = np.empty(int(ends[-1]), np.uint8)
    if tails is not None:  # before the heads: what is copied beyond a tail is put right by the next head
        copy_spilling(data, ends[1:] - tails.sizes, tails.data, tails.begins, tails.sizes)
    for part in parts:
        scatter(data, ends[:-1] if part.which is None else ends[part.which], part.heads)
    return data


def index_records(channels: NDArray[np.uint16], log_times: NDArray[np.uint64], offsets: Ints) -> tuple[bytes, Any]:
    """The message index records of one chunk, and the offset of each channel's among them as (channel, offset)."""
    if (channels[1:] < channels[:-1]).any():
        order = np.argsort(channels, kind="stable")
        channels, log_times, offsets = channels[order], log_times[order], offsets[order]
    firsts = np.flatnonzero(np.diff(channels.astype(np.int64), prepend=-1))
    counts = np.diff(firsts, append=len(channels))
    heads = np.zeros(len(firsts), _INDEX_HEAD)
    heads["opcode"] = Opcode.MESSAGE_INDEX
    heads["channel"] = channels[firsts]
    heads["bytes"] = counts * _INDEX_ENTRY.itemsize
    heads["length"] = heads["bytes"] + np.uint64(_INDEX_HEAD.itemsize - _RECORD)
    entries = np.empty(len(channels), _INDEX_ENTRY)
    entries["log_time"], entries["offset"] = log_times, offsets
    places = np.empty(len(firsts), _PLACE)
    places["channel"] = heads["channel"]
    places["offset"] = firsts * _INDEX_ENTRY.itemsize + np.arange(len(firsts)) * _INDEX_HEAD.itemsize
    return _interleaved(heads.tobytes(), _INDEX_HEAD.itemsize, entries.tobytes(), heads["bytes"].tolist()), places


def _interleaved(heads: bytes, width: int, bodies: bytes, sizes: Sequence[int]) -> bytes:
    """Each head, of one width, with the body behind it."""
    parts: list[bytes] = []
    at = 0
    for i, size in enumerate(sizes):
        parts += (heads[i * width : (i + 1) * width], bodies[at : at + size])
        at += size
    return b"".join(parts)
