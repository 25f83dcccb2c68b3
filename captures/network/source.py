"""A network capture as a capture of lines: each serial interface a port, each Modbus connection (TCP, UDP) another.

The file is read twice. The first time says which connections there are, which of them carry Modbus and how many are
open at once, so that ports have numbers and names before the first byte is given; the second time gives the bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..chunks import Block, Note, columns
from ..errors import CaptureError
from ..line import LineSettings
from ..ragged import copy_pieces
from ..recording.notes import Note as LineNote
from ..text.judging import ByteJudge, no_judge
from .blocks import errors_of
from .choosing import may_begin, whole_adus
from .packets import (
    NETWORK,
    SERIAL,
    Bytes,
    Interface,
    Ints,
    PacketFile,
    Packets,
    Segments,
    segments_of,
    serial_reads,
    take_number,
)
from .survey import (
    FOREIGN_DATAGRAMS,
    NAMED,
    NO_TRANSPORT,
    PacketSurvey,
    by_interface,
    known_of_ports,
    notes_on,
    nothing_words,
    surveyed,
    unheard,
)
from .tcp import Half, Reassembly
from .usb import USB, UsbLines

TAP: Final = "network"  # the line's `tap`, where bytes came over TCP
_NO_PORT: Final = 256
_HOLES: Final = 256  # in the capture that are noted one by one


def packet_source(path: Path, file: PacketFile, judge: ByteJudge = no_judge) -> _PacketSource:
    """The capture in a packet file; CaptureError where it holds nothing that may be Modbus.

    `judge` knows right check values, by which RTU over TCP is told from what else a network carries.
    """
    survey = surveyed(file, judge)
    if not survey.serial and not survey.ports and any(one.link in USB for one in file.interfaces):
        file = UsbLines(file, judge)
        survey = surveyed(file, judge) if file.interfaces else survey
    if not survey.serial and not survey.ports:
        raise CaptureError(f"{path}: {nothing_words(survey)}")
    header = dict(file.header)
    timed = header.pop("timed", True) is not False
    line, complaints = LineSettings.from_header(header)
    bauds = {file.interfaces[interface].baud for interface in survey.serial}
    if line.baud is None and len(bauds) == 1 and not survey.ports:
        line = replace(line, baud=bauds.pop())
    if survey.ports:
        names = {f"port {port}": name for port, name in sorted(survey.names.items())}
        line = replace(line, tap=line.tap or TAP, notes={**names, **known_of_ports(survey), **line.notes})
    return _PacketSource(file, line, timed, survey, tuple(complaints))


@dataclass(slots=True)
class _PacketSource:
    """The capture in a packet file that was surveyed."""

    file: PacketFile
    line: LineSettings
    timed: bool
    survey: PacketSurvey
    complaints: tuple[str, ...] = ()

    @property
    def notices(self) -> list[str]:
        """What of the file is left out, a line each."""
        out = [one for one in self.survey.groups if one.group.number not in self.survey.ports]
        words = list(self.complaints)
        if out:
            names = ", ".join(one.words for one in out[:NAMED])
            more = f" and {len(out) - NAMED:,} more" if len(out) > NAMED else ""
            words.append(f"TCP connections without Modbus are skipped: {names}{more}")
        if self.survey.serial or out or self.survey.others.keys() - {NO_TRANSPORT, FOREIGN_DATAGRAMS}:
            words += [f"{count:,} packets of {name} are skipped" for name, count in self.survey.others.most_common()]
        return words

    def notes(self) -> list[LineNote]:
        return sorted([*self.survey.notes, *_holes(self.survey)], key=lambda note: note.t_ns)

    def blocks(self, max_bytes: int, note: Note) -> Iterator[Block]:  # noqa: ARG002 - as the file comes
        taker = _PacketBlocks(self.survey)
        for packets in self.file.packets(note):
            yield taker.block(packets, self.file.interfaces)
        yield taker.rest()
        if taker.lost:
            note("capture", f"{taker.lost:,} packets say that bytes of the line were lost there")
        for group in taker.reassembly.groups:
            if group.missing and group.number in self.survey.ports:
                note(group.name, f"{group.missing:,} bytes of this connection are not in the capture")


class _PacketBlocks:
    """Packets in, blocks out: the second reading of a file."""

    def __init__(self, survey: PacketSurvey) -> None:
        self._survey = survey
        # of these ADUs are put together from segments; a datagram is whole
        self._framed = {one.group.number for one in survey.groups if one.kind == "tcp" and not one.group.of_datagrams}
        self.reassembly = Reassembly(self)
        self.lost = 0
        self._data = b""
        self._late = bytearray()  # bytes that no longer lie in the data, put behind it
        self._parts: list[Ints] = []  # columns: packet, begin, size, port, mark
        self._pieces: list[tuple[int, int, int, int, int]] = []  # the same one by one
        self._packet: Ints = np.zeros(1, np.int64)  # of the segments that are fed; -1: the newest
        self._whole: NDArray[np.bool_] = np.zeros(1, np.bool_)  # which of them are one whole Modbus TCP frame
        self._segments: Segments | None = None
        self._t_ns = 0

    def block(self, packets: Packets, interfaces: list[Interface]) -> Block:
        """The reads of these packets, in their order."""
        self._data = packets.data.tobytes()
        self._packet = np.array([len(packets) - 1])
        wrong: list[Ints] = []
        for interface, chosen in by_interface(packets):
            link = interfaces[interface].link
            if link in SERIAL and interface in self._survey.serial:
                reads = serial_reads(packets, chosen, link)
                self.lost += reads.lost
                port = np.full(len(reads.packet), self._survey.serial[interface])
                self._parts.append(np.stack((reads.packet, reads.begin, reads.size, port, reads.mark)))
                wrong.append(reads.packet[reads.wrong])
            elif link in NETWORK and self._survey.ports:
                self._segments = segments = segments_of(packets, chosen, link)
                self._packet = np.append(segments.packet, len(packets) - 1)
                self._whole = _one_frame(packets.data, segments)
                self.reassembly.feed(segments, self._data)
        if len(packets):
            self._t_ns = int(packets.t_ns[-1])
        return self._taken(packets.data, packets.t_ns, _errors(packets, wrong))

    def rest(self) -> Block:
        """What was kept back."""
        self._data, self._packet = b"", np.zeros(1, np.int64)
        self.reassembly.close()
        return self._taken(np.zeros(0, np.uint8), np.array([self._t_ns]), {})

    def _taken(self, data: Bytes, t_ns: Ints, errors: Mapping[int, list[int]]) -> Block:
        parts = [*self._parts, *([np.array(self._pieces, np.int64).T] if self._pieces else [])]
        if not parts:
            return columns(b"", [], [], timed=True)
        segments = np.concatenate(parts, axis=1)
        packet, begin, size, port, mark = segments[:, np.argsort(segments[0], kind="stable")]
        if self._late:
            data = np.concatenate((data, np.frombuffer(self._late, np.uint8)))
        ends = np.cumsum(size)
        out = np.empty(int(ends[-1]) if len(ends) else 0, np.uint8)
        copy_pieces(out, ends - size, data, begin, size)
        marked = [
            int(ends[i] - size[i]) + offset
            for i in np.flatnonzero(np.isin(packet, list(errors))).tolist()
            for offset in errors[int(packet[i])] or range(int(size[i]))
            if offset < size[i]
        ]
        self._parts, self._pieces, self._late = [], [], bytearray()
        extras = {"port": port, "mark": mark, "errors": np.array(sorted(marked), np.int64)}
        return columns(out.tobytes(), size, t_ns[packet], timed=True, extras=extras)

    def _port(self, half: Half) -> int | None:
        """The port of a connection, numbered from 0; None for one that is left out."""
        if half.port < 0:
            ports = self._survey.ports.get(half.group.number)
            half.port = _NO_PORT if ports is None else ports[half.connection.lane % len(ports)]
        return None if half.port == _NO_PORT else half.port

    def run(self, half: Half, which: Ints) -> None:
        assert self._segments is not None
        begins, sizes = self._segments.begin[which], self._segments.size[which]
        if (port := self._port(half)) is None:
            return
        whole = bool(self._whole[which].all())
        if half.group.number in self._framed and (half.rest or not whole):
            for i, begin, size in zip(which.tolist(), begins.tolist(), sizes.tolist(), strict=True):
                self.piece(half, i, begin, size)
            return
        half.in_step = half.in_step or whole
        same = np.full((2, len(which)), [[port], [half.mark]])
        self._parts.append(np.concatenate((np.stack((self._packet[which], begins, sizes)), same)))

    def piece(self, half: Half, i: int, begin: int, size: int) -> None:
        if (port := self._port(half)) is None:
            return
        half.in_step = half.in_step or bool(self._whole[i])
        if self._is_assembled(half) and (half.rest or not self._whole[i]):
            self.late(half, i, self._data[begin : begin + size])
        else:
            self._pieces.append((int(self._packet[i]), begin, size, port, half.mark))

    def _is_assembled(self, half: Half) -> bool:
        """Whether frames are put together from segments: where one begins is known; else bytes go as they came."""
        return half.in_step and half.group.number in self._framed

    def late(self, half: Half, i: int, octets: bytes) -> None:
        if self._is_assembled(half):
            octets = half.rest + octets
            size = whole_adus(octets)
            if not may_begin(octets[size:]):
                size = len(octets)
            octets, half.rest = octets[:size], octets[size:]
        self._put(half, i, octets)

    def hole(self, half: Half, i: int, missing: int) -> None:  # noqa: ARG002 - the protocol's signature
        """What is kept back of a frame is all that there is of it."""
        octets, half.rest, half.in_step = half.rest, b"", False
        self._put(half, i, octets)

    def ended(self, half: Half) -> None:
        self.hole(half, -1, 0)

    def _put(self, half: Half, i: int, octets: bytes) -> None:
        if octets and (port := self._port(half)) is not None:
            begin = len(self._data) + len(self._late)
            self._late += octets
            self._pieces.append((int(self._packet[i]), begin, len(octets), port, half.mark))


def _holes(survey: PacketSurvey) -> Iterator[LineNote]:
    """When bytes of Modbus connections are missing; of many holes the last ones as one time in which all may be."""
    for one in survey.groups:
        if one.group.number not in survey.ports:
            continue
        words = f"{one.group.name}: bytes of this connection are not in the capture"
        holes: list[tuple[int, int]] = []
        for begin, end in sorted(one.holes):
            if holes and begin <= holes[-1][1]:
                holes[-1] = holes[-1][0], max(end, holes[-1][1])
            else:
                holes.append((begin, end))
        if len(holes) > _HOLES:
            holes[_HOLES:] = [(holes[_HOLES][0], holes[-1][1])]
        for begin, end in holes:
            yield from (LineNote(begin, "lost", words), LineNote(end, "opened", words))


def packet_notes(file: PacketFile) -> list[LineNote]:
    """What is noted in a file, in order of time."""
    notes = [note for packets in file.packets(unheard) for note in notes_on(packets)]
    return sorted(notes, key=lambda note: note.t_ns)


def _one_frame(data: Bytes, segments: Segments) -> NDArray[np.bool_]:
    """Which segments carry one whole Modbus TCP frame and nothing else."""
    begin = segments.begin
    length = take_number(data, begin + 4, 2)
    fits: NDArray[np.bool_] = (segments.size == length + 6) & (length >= 2) & (length <= 254)
    fits &= take_number(data, begin + 2, 2) == 0
    return fits


def _errors(packets: Packets, wrong: list[Ints]) -> dict[int, list[int]]:
    """Offsets of bytes in error, by packet; none of them said: all of its bytes."""
    errors: dict[int, list[int]] = {packet: [] for part in wrong for packet in part.tolist()}
    for i, comments in packets.comments.items():
        for text in comments:
            if (offsets := errors_of(text)) is not None:
                errors.setdefault(i, []).extend(offsets)
    return errors
