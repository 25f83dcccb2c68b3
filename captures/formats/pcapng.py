"""pcapng, `.pcapng`: packets on several interfaces, with comments; read, and written so that nothing is lost.

What is in the packets is known in `captures.network`. A file of frames that this tool exported holds the raw reads as
well, which are then what is read (unless another program wrote it anew). What is written here: a packet a read, of link
type 252 (upper PDU) for Wireshark's plain `data` dissector, an interface a port named `port N`, the direction mark as
the direction of the packet, bytes in error and notes as comments, the line's settings as JSON in the section's comment.
Times are in ns; those before 1970 by an offset of the interface.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO, Final

import numpy as np
from numpy.typing import NDArray

from captures.network import blocks as ng

from ..chunks import Block, Mark, Note, Source
from ..errors import CaptureError
from ..files import opened, read_head
from ..limits import TIME_LIMIT
from ..line import LineSettings
from ..network.blocks import errors_comments, note_comment
from ..network.packets import INBOUND, LONGEST, OUTBOUND, UPPER_PDU, Interface, Ints, Packets
from ..recording.notes import Note as LineNote
from ..text.judging import ByteJudge, no_judge
from . import Format

_MAGIC: Final = b"\x0a\x0d\x0d\x0a"
_ORDERS: Final = {b"\x4d\x3c\x2b\x1a": "<", b"\x1a\x2b\x3c\x4d": ">"}
_PACKETS: Final = (ng.ENHANCED_PACKET, ng.OLD_PACKET, ng.SIMPLE_PACKET)
_PIECE: Final = 1 << 21
_SECOND: Final = 1_000_000_000
_HEAD: Final = 28  # bytes of a packet block before the packet


@dataclass(frozen=True, slots=True)
class _InterfaceClock:
    """How an interface counts time: units in a second, and seconds to add."""

    units: int = 1_000_000
    offset_s: int = 0

    def nanoseconds(self, stamps: NDArray[np.uint64]) -> Ints:
        """Times in ns; those out of range are the last in it."""
        scale, offset = _SECOND // self.units, self.offset_s * _SECOND
        if self.units * scale == _SECOND and int(stamps.max()) * scale + abs(offset) < TIME_LIMIT:
            return stamps.astype(np.int64) * scale + offset
        exact = (stamp * _SECOND // self.units + offset for stamp in stamps.tolist())
        return np.array([min(max(stamp, 1 - TIME_LIMIT), TIME_LIMIT - 1) for stamp in exact], np.int64)


@dataclass(slots=True)
class _PcapngFile:
    path: Path
    interfaces: list[Interface] = field(default_factory=list)
    header: dict[str, object] = field(default_factory=dict)
    _clocks: list[_InterfaceClock] = field(default_factory=list)
    _order: str = "<"
    _base: int = 0  # the first interface of this section

    def packets(self, note: Note) -> Iterator[Packets]:
        self.interfaces.clear()
        self._clocks.clear()
        for data, blocks, _ in self._pieces(note):
            yield from self._batches(data, blocks, note)

    def _pieces(self, note: Note) -> Iterator[tuple[bytes, list[tuple[int, int, int]], int]]:
        """The file in pieces: bytes, kind, place and length of the whole blocks in them, place of the piece."""
        with opened(self.path) as file:
            rest, base = b"", 0
            while piece := file.read(_PIECE):
                rest += piece
                blocks, readable = [(0, 0, 0)], True
                while blocks and readable:
                    blocks, at, readable = self._walk(rest, base, note)
                    yield rest, blocks, base
                    rest, base = rest[at:], base + at
                if not readable:
                    return
            if rest:
                note(f"byte {base}", f"{len(rest):,} bytes that are not a whole block: the file was cut off")

    def _walk(self, data: bytes, base: int, note: Note) -> tuple[list[tuple[int, int, int]], int, bool]:
        """Kind, place and length of whole blocks of one byte order, where they end, and whether it goes on there."""
        blocks: list[tuple[int, int, int]] = []
        at, head = 0, struct.Struct(f"{self._order}II").unpack_from
        while at + 12 <= len(data):
            if data[at : at + 4] == _MAGIC and (order := _ORDERS.get(data[at + 8 : at + 12])) != self._order:
                if order is None:
                    note(f"byte {base + at}", "a section of unknown byte order: the rest of the file is skipped")
                    return blocks, at, False
                if blocks:
                    break
                self._order, head = order, struct.Struct(f"{order}II").unpack_from
            kind, length = head(data, at)
            if not 12 <= length <= LONGEST:
                note(f"byte {base + at}", f"a block of {length:,} bytes is impossible: the rest of the file is skipped")
                return blocks, at, False
            after = at + (length + 3 & ~3)
            if after > len(data):
                break
            blocks.append((kind, at, length))
            at = after
        return blocks, at, True

    def reads(self, note: Note) -> Iterator[Block]:
        """The raw reads that this tool put into the file."""
        for data, blocks, base in self._pieces(note):
            for kind, at, length in blocks:
                if kind == ng.READS:
                    try:
                        yield ng.reads_in(data[at + 8 : at + length - 4])
                    except ValueError as error:
                        note(f"byte {base + at}", f"a block of reads is damaged ({error}): skipped")

    def _batches(self, data: bytes, blocks: list[tuple[int, int, int]], note: Note) -> Iterator[Packets]:
        """Packets, as many at once as stand between blocks that say how they are to be read."""
        batch: list[tuple[int, int]] = []
        for kind, at, length in blocks:
            if kind in _PACKETS:
                batch.append((at, kind))
            elif kind in (ng.SECTION, ng.INTERFACE):
                yield from self._columns(data, batch, note)
                batch = []
                body = data[at + 8 : at + length - 4]
                if kind == ng.SECTION:
                    self._base = len(self.interfaces)
                    self._section(body)
                else:
                    self._interface(body)
        yield from self._columns(data, batch, note)

    def _section(self, body: bytes) -> None:
        comments = [_comment_text(value) for code, value in ng.options(body[16:], self._order) if code == ng.COMMENT]
        if not self.header:
            self.header.update(ng.settings_in(comments))

    def _interface(self, body: bytes) -> None:
        if len(body) < 8:
            body = body.ljust(8, b"\x00")
        (link,) = struct.unpack_from(f"{self._order}H", body)
        by_code = dict(reversed(list(ng.options(body[8:], self._order))))
        speed, resolution, offset = (
            by_code.get(ng.SPEED, b""),
            by_code.get(ng.RESOLUTION, b""),
            by_code.get(ng.OFFSET, b""),
        )
        baud = struct.unpack(f"{self._order}Q", speed)[0] if len(speed) == 8 else 0
        units = 10**6
        if len(resolution) == 1:
            units = 2 ** (resolution[0] & 0x7F) if resolution[0] & 0x80 else 10 ** min(resolution[0], 30)
        seconds = struct.unpack(f"{self._order}q", offset)[0] if len(offset) == 8 else 0
        name = _comment_text(by_code[ng.NAME]) if ng.NAME in by_code else None
        serial = link == UPPER_PDU and 0 < baud < 10**8  # an Ethernet card's speed is no baud rate
        self.interfaces.append(Interface(link, name, baud if serial else None))
        self._clocks.append(_InterfaceClock(units, seconds))

    def _columns(self, data: bytes, batch: list[tuple[int, int]], note: Note) -> Iterator[Packets]:
        if not batch:
            return
        at, kind = np.array(batch, np.int64).T
        octets = np.frombuffer(data, np.uint8)
        words = octets.take(at[:, None] + np.arange(_HEAD), mode="clip").view(f"{self._order}u4").astype(np.int64)
        interface, high, low, size, original = words[:, 2].copy(), words[:, 3], words[:, 4], words[:, 5], words[:, 6]
        begin = at + _HEAD
        if (old := kind == ng.OLD_PACKET).any():
            interface[old] = interface[old] & 0xFFFF if self._order == "<" else interface[old] >> 16
        if (simple := kind == ng.SIMPLE_PACKET).any():
            begin[simple], original[simple] = at[simple] + 12, words[simple, 2]
            size[simple] = np.minimum(words[simple, 2], words[simple, 1] - 16)
            interface[simple] = high[simple] = low[simple] = 0
        interface += self._base
        end = at + words[:, 1] - 4
        valid = (interface < len(self.interfaces)) & (begin + size <= end) & (size >= 0)
        if not valid.all():
            first = int(np.argmin(valid))
            note(f"packet {first} of {len(at):,}", f"{int((~valid).sum()):,} packets are damaged: skipped")
            at, begin, size, original, end = at[valid], begin[valid], size[valid], original[valid], end[valid]
            interface, high, low, kind = interface[valid], high[valid], low[valid], kind[valid]
        if not len(at):
            return
        stamps = high.astype(np.uint64) << np.uint64(32) | low.astype(np.uint64)
        t_ns = np.zeros(len(at), np.int64)
        for number in np.flatnonzero(np.bincount(interface)).tolist():
            mine = interface == number
            t_ns[mine] = self._clocks[number].nanoseconds(stamps[mine])
        flags, comments = _remarks(data, begin + (size + 3 & ~3), end, kind != ng.SIMPLE_PACKET, self._order)
        yield Packets(octets, begin, size, np.maximum(original - size, 0), t_ns, interface, flags, comments)


def _remarks(
    data: bytes,
    begins: Ints,
    ends: Ints,
    may: NDArray[np.bool_],
    order: str,
) -> tuple[Ints, dict[int, list[str]]]:
    """Flags and comments of packets, whose options lie between these places."""
    flags = np.zeros(len(begins), np.int64)
    comments: dict[int, list[str]] = {}
    rows = np.flatnonzero(may & (ends - begins >= 4))
    if not len(rows):
        return flags, comments
    octets = np.frombuffer(data, np.uint8)
    first = octets.take(begins[rows][:, None] + np.arange(12), mode="clip").view(f"{order}u4").astype(np.int64)
    word = 4 << 16 | ng.FLAGS if order == "<" else ng.FLAGS << 16 | 4
    plain = (first[:, 0] == word) & (first[:, 2] == 0) & (ends[rows] - begins[rows] >= 12)
    flags[rows[plain]] = first[plain, 1]
    for row in rows[~plain].tolist():
        for code, value in ng.options(data[int(begins[row]) : int(ends[row])], order):
            if code == ng.FLAGS and len(value) == 4:
                flags[row] = struct.unpack(f"{order}I", value)[0]
            elif code == ng.COMMENT:
                comments.setdefault(row, []).append(_comment_text(value))
    return flags, comments


def _comment_text(data: bytes) -> str:
    return data.decode("utf-8", "replace")


@dataclass(frozen=True, slots=True)
class _OwnReads:
    """The raw reads in a file of frames that this tool exported."""

    file: _PcapngFile
    line: LineSettings
    timed: bool
    notices: tuple[str, ...]

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - as they were written
        yield from self.file.reads(note)

    def notes(self) -> list[LineNote]:
        from ..network.source import packet_notes

        return packet_notes(self.file)


def _sniff(head: bytes) -> float:
    return 1.0 if head.startswith(_MAGIC) and head[8:12] in _ORDERS else 0.0


def _read(path: Path, *, judge: ByteJudge = no_judge) -> Source:
    from ..network.source import packet_source

    if not _sniff(read_head(path)):
        raise CaptureError(f"{path}: not a pcapng file")
    file = _PcapngFile(path)
    for _ in file.packets(lambda *_: None):
        break  # the section's header was met by then
    if file.header.pop("reads", False) and next(file.reads(lambda *_: None), None) is not None:
        line, complaints = LineSettings.from_header({key: file.header[key] for key in file.header if key != "timed"})
        return _OwnReads(file, line, file.header.get("timed") is not False, tuple(complaints))
    return packet_source(path, file, judge)


_TAGS: Final = struct.pack(">HH4sI", 12, 4, b"data", 0)  # the dissector's name, the end of the tags
_WAYS: Final = {Mark.NONE: 0, Mark.TX: OUTBOUND, Mark.RX: INBOUND}


@dataclass(slots=True)
class _Writer:
    file: BinaryIO
    line: LineSettings
    interfaces: dict[int, tuple[int, int]] = field(default_factory=dict)  # port: its interface, its first second

    def packet(self, port: int, t_ns: int, data: bytes, mark: Mark, comments: Sequence[str]) -> None:
        if port not in self.interfaces:
            self._interface(port, t_ns)
        interface, begin_s = self.interfaces[port]
        stamp = max(t_ns - begin_s * _SECOND, 0)
        packet = _TAGS + data
        head = struct.pack("<IIIII", interface, stamp >> 32, stamp & 0xFFFFFFFF, len(packet), len(packet))
        options = b"".join(ng.pcapng_option(ng.COMMENT, text.encode()[: ng.TEXT]) for text in comments)
        if mark:
            options += ng.pcapng_option(ng.FLAGS, struct.pack("<I", _WAYS[mark]))
        options += bytes(4) if options else b""
        self.file.write(ng.pcapng_block(ng.ENHANCED_PACKET, head + packet + bytes(-len(packet) % 4) + options))

    def _interface(self, port: int, t_ns: int) -> None:
        begin_s = min(t_ns // _SECOND, 0)
        self.interfaces[port] = (len(self.interfaces), begin_s)
        options = ng.pcapng_option(ng.NAME, f"port {port}".encode()) + ng.pcapng_option(ng.RESOLUTION, b"\x09")
        if begin_s:
            options += ng.pcapng_option(ng.OFFSET, struct.pack("<q", begin_s))
        if self.line.baud is not None:
            options += ng.pcapng_option(ng.SPEED, struct.pack("<Q", self.line.baud))
        self.file.write(ng.pcapng_block(ng.INTERFACE, struct.pack("<HHI", UPPER_PDU, 0, 0) + options + bytes(4)))


def _write(
    file: BinaryIO, line: LineSettings, blocks: Iterable[Block], timed: bool, *, notes: Sequence[LineNote] = ()
) -> None:
    file.write(ng.section(line, timed=timed, reads=False))
    writer = _Writer(file, line)
    pending = sorted(notes, key=lambda note: note.t_ns, reverse=True)
    port = 0
    for block in blocks:
        for i in range(len(block)):
            chunk = block.chunk(i)
            while pending and pending[-1].t_ns <= chunk.t_ns:
                note = pending.pop()
                writer.packet(chunk.port, note.t_ns, b"", Mark.NONE, [note_comment(note)])
            comments = errors_comments(chunk.errors)
            writer.packet(chunk.port, chunk.t_ns, chunk.data, chunk.mark, comments)
            port = chunk.port
    for note in reversed(pending):
        writer.packet(port, note.t_ns, b"", Mark.NONE, [note_comment(note)])


FORMAT = Format("pcapng", (".pcapng", ".ntar"), _sniff, _read, _write)
