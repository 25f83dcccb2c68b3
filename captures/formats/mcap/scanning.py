"""The records of an MCAP file, whole, cut or damaged: what is damaged costs only what it hit.

The index at a file's end is believed where its CRC is right: it says where chunks begin, so that after damage reading
goes on at the next, and a chunk is one whatever its opcode has become. Without it records are taken one after the
other; one that is not what it must be is not stepped over, but the next chunk sought whose lengths agree and whose CRC
is right. Parts come from the mcap library; its readers stop at the first damage.
"""

from __future__ import annotations

import errno
import re
import struct
import zlib
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import BytesIO
from typing import Any, BinaryIO, Final

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Header, Metadata, Schema, Statistics

from ...chunks import Note
from .records import (
    CHUNK_HEAD,
    FOOTER,
    MAGIC,
    RECORD,
    ChunkHead,
    DamagedRecordError,
    Unpacker,
    chunk_head,
    chunk_limit,
    one_line,
)

_BLOCK: Final = 1 << 20  # bytes read at once
_SECTOR: Final = 1 << 12  # that a disk cannot give, at the least
_SUMMARY_LIMIT: Final = 1 << 28  # bytes of a summary that are worth reading
_INDEX: Final = struct.Struct("<QQQQI")  # of a chunk index: times, start and length of the chunk, bytes of what follows
_INDEXED: Final = struct.Struct("<HQ")  # a channel and where its message index begins
_PARSED: Final[dict[int, Any]] = {  # records of a few fields each, which must take up all of their length
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
}
# A chunk's opcode, a length under 2^40, times, an unpacked size under 2^40, a CRC, a compression with its magic.
_CHUNK_BEGINS: Final = re.compile(
    rb"\x06.{5}\0{3}.{21}\0{3}.{4}"
    rb"(?:\x04\0{3}zstd.{5}\0{3}\x28\xb5\x2f\xfd|\x03\0{3}lz4.{5}\0{3}\x04\x22\x4d\x18|\0{4}.{5}\0{3})",
    re.DOTALL,
)
_LONGEST_MATCH: Final = CHUNK_HEAD + 4
_DATA_END: Final = struct.Struct("<BQI")
_CUT: Final = "a record reaches past the file's end"


class FileBytes:
    """The bytes of a file by their positions, `block` of them read at once; what the disk cannot give reads as zeros.

    Other OSErrors pass.
    """

    def __init__(self, file: BinaryIO, *, block: int = _BLOCK) -> None:
        self._file, self._at_once = file, block
        self.size = file.seek(0, 2)
        self._start, self._block = 0, b""

    def read(self, at: int, length: int) -> bytes:
        """So many bytes, fewer at the file's end."""
        first = at - self._start
        if first < 0 or first + length > len(self._block):
            length = max(0, min(length, self.size - at))
            self._start, self._block, first = at, self._from_disk(at, max(length, self._at_once)), 0
        return self._block[first : first + length]

    def _from_disk(self, at: int, length: int) -> bytes:
        try:
            self._file.seek(at)
            return self._file.read(length)
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            length = max(0, min(length, self.size - at))
            if length <= _SECTOR:
                return bytes(length)
            half = length // 2 // _SECTOR * _SECTOR or _SECTOR
            return self._from_disk(at, half) + self._from_disk(at + half, length - half)


@dataclass(frozen=True, slots=True)
class ScannedRecord:
    """A chunk, unpacked, or a channel, message or metadata record that stands by itself; `at` is its byte in the file.

    `packed` is the number of bytes that the content takes in the file.
    """

    at: int
    opcode: int
    content: bytes
    packed: int


@dataclass(frozen=True, slots=True)
class Loss:
    """Something that the file held and that cannot be given; `last_ns` is the last log time in it, if that is known."""

    at: int
    what: str
    last_ns: int | None = None


@dataclass(frozen=True, slots=True, eq=False)
class TopicSummary:
    """What a file's summary, whose CRC is right, says of one topic.

    `channels` are the encodings of all channels by id, None for those of other topics; `settings` the metadata of the
    topic's channel; `messages` how many there are, None where that is not said; `span_ns` from the first log time of
    all topics to the last. Of n chunks in the order of the file:
    where each starts, its length, where what follows it and its message indexes starts, its last log time, and whether
    it has messages of the topic.
    """

    start: int
    channels: Mapping[int, str | None]
    settings: Mapping[str, str]
    messages: int | None
    span_ns: int
    starts: list[int]
    lengths: list[int]
    nexts: list[int]
    last_ns: list[int]
    wanted: list[bool]


def read_summary(data: FileBytes, topic: str) -> TopicSummary | None:
    """The summary of a whole file; None where there is none, or none to trust."""
    footer = _footer(data)
    if footer is None or not footer.content or footer.crc != footer.told_crc:
        return None
    try:
        return _summary(footer.start, footer.content, topic)
    except Exception:  # a damaged one that has a right CRC: the records decide
        return None


def lacks(data: FileBytes, topic: str) -> bool:
    """Whether a whole file's summary declares channels, but none of this topic. Its chunks are not looked at."""
    footer = _footer(data)
    if footer is None or footer.crc != footer.told_crc or topic.encode() in footer.content:
        return False
    content, at = footer.content, 0
    while at + RECORD.size <= len(content):
        opcode, length = RECORD.unpack_from(content, at)
        if opcode == Opcode.CHANNEL:
            return True
        at += RECORD.size + length
    return False


@dataclass(frozen=True, slots=True)
class _Footer:
    """Where the summary starts, its records (none where there can be no such), and their CRC if it is told."""

    start: int
    content: bytes
    crc: int
    told_crc: int


def _footer(data: FileBytes, start: int | None = None) -> _Footer | None:
    """The end of a file; None for one that was cut. `start`: where the summary begins, if not where the footer says."""
    tail = FOOTER.size + len(MAGIC)
    end = data.read(data.size - tail, tail) if data.size >= tail else b""
    if len(end) < tail or end[FOOTER.size :] != MAGIC:
        return None
    opcode, length, told_start, _, crc = FOOTER.unpack_from(end)
    start = told_start if start is None else start
    if opcode != Opcode.FOOTER or length != FOOTER.size - RECORD.size:
        return None
    size = data.size - tail - start
    content = data.read(start, size) if start > 0 and 0 <= size <= _SUMMARY_LIMIT else b""
    return _Footer(start, content, zlib.crc32(end[: FOOTER.size - 4], zlib.crc32(content)), crc)


def _summary(start: int, content: bytes, topic: str) -> TopicSummary | None:
    channels: dict[int, str | None] = {}
    settings: dict[str, str] = {}
    chunks: list[tuple[int, int, int, int, bytes]] = []
    statistics: Statistics | None = None
    at, name = 0, topic.encode()
    while at < len(content):
        opcode, length = RECORD.unpack_from(content, at)
        at += RECORD.size
        if opcode == Opcode.CHANNEL:
            channels[int.from_bytes(content[at : at + 2], "little")] = None
            if name in content[at : at + length]:
                channel = Channel.read(stream_of(content[at : at + length]))
                if channel.topic == topic:
                    channels[channel.id] = channel.message_encoding
                    settings = dict(channel.metadata)
        elif opcode == Opcode.STATISTICS:
            statistics = Statistics.read(stream_of(content[at : at + length]))
        elif opcode == Opcode.CHUNK_INDEX:
            _, last, begin, size, sized = _INDEX.unpack_from(content, at)
            behind = at + _INDEX.size + sized
            indexes = content[at + _INDEX.size : behind]
            chunks.append(
                (begin, size, begin + size + int.from_bytes(content[behind : behind + 8], "little"), last, indexes)
            )
        at += length
    if not channels:  # a summary need not repeat them
        return None
    chunks.sort()
    ids = {number for number, encoding in channels.items() if encoding is not None}
    return TopicSummary(
        start,
        channels,
        settings,
        None if statistics is None else sum(statistics.channel_message_counts.get(number, 0) for number in ids),
        0 if statistics is None else max(0, statistics.message_end_time - statistics.message_start_time),
        [chunk[0] for chunk in chunks],
        [chunk[1] for chunk in chunks],
        [chunk[2] for chunk in chunks],
        [chunk[3] for chunk in chunks],
        [not chunk[4] or any(number in ids for number, _ in _INDEXED.iter_unpack(chunk[4])) for chunk in chunks],
    )


def walk(data: FileBytes, summary: TopicSummary | None, note: Note) -> Iterator[ScannedRecord | Loss]:
    """What stands in the data section, in order, but for chunks that by the summary are no concern of its topic.

    What is wrong without a loss goes to `note`.
    """
    if data.read(0, len(MAGIC)) != MAGIC:
        note("byte 0", "no MCAP magic: the file's beginning is damaged")
    unpacker = Unpacker(data.size)
    if summary is None:
        return _by_records(data, unpacker, note)
    return _by_index(data, unpacker, summary)


def _by_index(data: FileBytes, unpacker: Unpacker, summary: TopicSummary) -> Iterator[ScannedRecord | Loss]:
    """With the index nothing but its chunks is needed; records between them may be damaged without a loss."""
    at = len(MAGIC)
    while at < summary.start:
        number = bisect_left(summary.starts, at)
        stop = min([summary.start, *summary.starts[number : number + 1]])
        if at < stop:
            try:
                item, at, _ = _record_at(data, unpacker, at, stop)
            except DamagedRecordError:
                item, at = None, stop
            if item is not None:
                yield item
            continue
        if summary.wanted[number]:
            head = chunk_head(data.read(at, CHUNK_HEAD))
            if head is not None and head.length == summary.lengths[number]:  # whatever its opcode has become
                yield _chunk(data, unpacker, at, head)
            else:
                yield Loss(at, "a damaged chunk (its header does not match the index)", summary.last_ns[number])
        at = max(summary.nexts[number], at + 1)


def _by_records(data: FileBytes, unpacker: Unpacker, note: Note) -> Iterator[ScannedRecord | Loss]:
    """One record after the other, to the end of the data section or of the file."""
    at, complete = len(MAGIC), False
    proven = 0  # up to there a CRC was right: of other records each byte may be another's
    if data.read(0, at) != MAGIC and (begin := _next_chunk(data, unpacker, 0, at)) is not None:
        at = begin  # the beginning is gone
    while at < data.size and not complete:
        why, item, after, sure = "", None, data.size, False
        try:
            item, after, sure = _record_at(data, unpacker, at, data.size)
        except DamagedRecordError as error:
            why = str(error)
        if sure:
            complete = item is None and data.read(at, 1)[0] == Opcode.DATA_END
            if isinstance(item, ScannedRecord) and item.opcode == Opcode.CHUNK:
                proven = after
        elif (begin := _next_chunk(data, unpacker, proven if why else at + 1, after)) is not None:
            if not isinstance(item, Loss):
                item = Loss(at, f"{why or 'no record has chunks in it'}: damaged up to byte {begin}")
            yield item
            at = begin
            continue
        elif why:  # to the end: of a file that was cut, or that is damaged there
            footer = _footer(data)
            complete = footer is not None and at + _DATA_END.size >= footer.start
            if not complete and (footer is not None or why != _CUT):
                yield Loss(at, f"{why}: what follows is damaged")
            break
        if item is not None:
            yield item
        at = after
    _check_end(data, at, complete, note)


def _check_end(data: FileBytes, at: int, complete: bool, note: Note) -> None:
    """Tells what is wrong with the end of a file whose records were read up to `at`, `complete` to the end of the data.

    An index that stands earlier than the footer says, and is right, proves that whole records are gone: where these are
    cut at their ends, nothing else looks damaged.
    """
    footer = _footer(data)
    if footer is None:
        lost = "all chunks are whole" if complete else "everything complete before it was read"
        note(f"byte {at}", f"file ends at byte {data.size} without a footer: {lost}")
        return
    if not footer.told_crc or footer.crc == footer.told_crc:
        return
    moved = _footer(data, at)
    if at < footer.start and moved is not None and moved.crc == moved.told_crc:
        note(f"byte {at}", f"{footer.start - at:,} bytes are missing before the index: what they held is lost")
    else:
        note(f"byte {footer.start}", "the index at the file's end is damaged: read without it")


def _record_at(
    data: FileBytes, unpacker: Unpacker, at: int, stop: int
) -> tuple[ScannedRecord | Loss | None, int, bool]:
    """A record: what it gives, where the next begins, and whether it is surely what it seems to be.

    DamagedRecordError where none can begin here that ends by `stop`.
    """
    head = data.read(at, CHUNK_HEAD)
    if len(head) < RECORD.size:
        raise DamagedRecordError(_CUT)
    opcode, length = RECORD.unpack_from(head)
    begin, after = at + RECORD.size, at + RECORD.size + length
    if after <= stop and (chunk := chunk_head(head)) is not None:
        item = _chunk(data, unpacker, at, chunk)
        if opcode == Opcode.CHUNK or isinstance(item, ScannedRecord):  # whatever its opcode has become
            return item, after, isinstance(item, ScannedRecord)
    if not (Opcode.HEADER <= opcode <= Opcode.DATA_END or opcode >= 0x80):
        raise DamagedRecordError(f"no record can begin with {opcode:02X}")
    if after > stop:
        raise DamagedRecordError(_CUT if length <= chunk_limit() else f"a record of {length:,} bytes is none")
    if opcode == Opcode.CHUNK:
        raise DamagedRecordError("a damaged chunk (its lengths contradict each other)")
    if length > chunk_limit():
        return (
            Loss(at, f"a record of {length:,} bytes is too large") if opcode == Opcode.MESSAGE else None,
            after,
            False,
        )
    if opcode == Opcode.MESSAGE:
        return ScannedRecord(at, opcode, data.read(begin, length), length), after, False
    if opcode == Opcode.DATA_END and length != _DATA_END.size - RECORD.size:
        raise DamagedRecordError("a damaged record")
    if opcode == Opcode.MESSAGE_INDEX and int.from_bytes(data.read(begin + 2, 4), "little") != length - 6:
        raise DamagedRecordError("a damaged message index")
    if opcode not in _PARSED:
        return None, after, opcode in (Opcode.DATA_END, Opcode.MESSAGE_INDEX)
    content = data.read(begin, length)
    stream = stream_of(content)
    try:
        _PARSED[opcode].read(stream)
    except Exception as error:  # the library's, of many kinds
        raise DamagedRecordError(f"a damaged record ({one_line(error)})") from error
    if stream.count != length:
        raise DamagedRecordError("a damaged record")
    wanted = opcode in (Opcode.CHANNEL, Opcode.METADATA)
    return ScannedRecord(at, opcode, content, length) if wanted else None, after, True


def _chunk(data: FileBytes, unpacker: Unpacker, at: int, head: ChunkHead) -> ScannedRecord | Loss:
    try:
        content = unpacker.unpacked(head, data.read(at + head.start, head.packed))
    except DamagedRecordError as error:
        return Loss(at, f"a damaged chunk ({error})", head.last_ns)
    return ScannedRecord(at, Opcode.CHUNK, content, head.packed)


def _next_chunk(data: FileBytes, unpacker: Unpacker, start: int, stop: int) -> int | None:
    """Where the next chunk with a right CRC begins, from `start` on and before `stop`."""
    at = start
    while at < stop:
        block = data.read(at, min(_BLOCK, stop - at) + _LONGEST_MATCH)
        position = -1
        while (match := _CHUNK_BEGINS.search(block, position + 1)) is not None:
            position = match.start()
            if position >= _BLOCK or at + position >= stop:
                break
            head = chunk_head(block[position : position + CHUNK_HEAD])
            if head is None or at + position + head.length > data.size:
                continue
            if isinstance(_chunk(data, unpacker, at + position, head), ScannedRecord):
                return at + position
        at += _BLOCK
    return None


def stream_of(content: bytes) -> ReadDataStream:
    """A record's content, for the library to read from."""
    return ReadDataStream(BytesIO(content))
