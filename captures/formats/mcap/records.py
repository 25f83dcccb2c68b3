"""Records of an MCAP file, as far as they are laid out here and not by the mcap library: heads, chunks, the footer.

A chunk is believed only where its CRC is right, and unpacked only as far as it claims to go: what a few bytes unpack to
is bounded for a chunk, for a whole file, and in the number of records in it.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from mcap.opcode import Opcode

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
                f"{need} MiB unpacked are more than {self._limit // _MIB}: {_LIMIT_SETTING}={need} allows it"
            )
        if size > self._left:
            raise DamagedRecordError("all chunks together unpack to more than a file of this size can mean")
        self._left -= size
        try:
            data = self._decompressed(head.compression, content, size)
        except DamagedRecordError:
            raise
        except Exception as error:  # of the libraries below, each of its own kind
            raise DamagedRecordError(one_line(error)) from error
        if len(data) != size:
            raise DamagedRecordError("its size unpacked is not what it says")
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
            raise DamagedRecordError("more records than so few bytes can mean")
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
            yield opcode, at, at + length
        at, most = at + length, most - 1


def one_line(error: Exception) -> str:
    """What went wrong, on one line of at most 120 characters."""
    return (" ".join(str(error).split()) or type(error).__name__)[:120]
