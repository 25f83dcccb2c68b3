"""A network capture as a capture of lines: each serial interface a port, each Modbus connection (TCP, UDP) another.

The file is read twice. The first time says which connections there are, which of them carry Modbus and how many are
open at once, so that ports have numbers and names before the first byte is given; the second time gives the bytes.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..chunks import Block, Mark, Note, columns
from ..errors import CaptureError
from ..line import BY_MARKS, DIRECTIONS_NOTE, PROTOCOLS_NOTE, LineSettings
from ..ragged import copy_pieces
from ..recording.notes import Note as LineNote
from ..text.judging import ByteJudge, no_judge
from .blocks import errors_of, note_of
from .choosing import MBAP, SAMPLE, SAMPLE_BYTES, kind_of, may_begin, whole_adus
from .neighbours import TLS, neighbour
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
from .tcp import ConnectionGroup, Half, Reassembly

TAP: Final = "network"  # the line's `tap`, where bytes came over TCP
_PORTS: Final = 256
_NO_PORT: Final = 256
_NO_TRANSPORT: Final = "neither TCP nor UDP"
_FOREIGN_DATAGRAMS: Final = "UDP without Modbus"
_NAMED: Final = 4  # of what is left out, named one by one
_UNKNOWN: Final = "unknown"  # what a connection may be that is the only one
_TLS_PORT: Final = 802  # of Modbus/TCP Security
_LONGEST_HOLE_NS: Final = 10_000_000_000  # what is older is not said to be missing
_HOLES: Final = 256  # in the capture that are noted one by one
_LINKS: Final = {
    105: "IEEE 802.11", 127: "IEEE 802.11 with radiotap", 189: "USB (usbmon)", 195: "IEEE 802.15.4",
    220: "USB (usbmon)", 227: "CAN", 249: "USB (USBPcap)",
}  # fmt: skip


@dataclass(slots=True)
class _Judged:
    """A group of connections while it is judged."""

    group: ConnectionGroup
    sample: list[tuple[int, Mark, bytes]] = field(default_factory=list)  # its first reads, by their place in the file
    octets: int = 0
    packets: int = 0  # that carried them
    kind: str | None = None
    neighbour: str = ""  # what it speaks instead, where that is known
    holes: list[tuple[int, int]] = field(default_factory=list)  # ns, between which bytes are missing

    @property
    def reads(self) -> list[tuple[Mark, bytes]]:
        """Its first reads, in the file's order."""
        return [(mark, data) for _, mark, data in sorted(self.sample, key=lambda read: read[0])]

    @property
    def words(self) -> str:
        """What it is, for people who wonder why it is left out."""
        known = self.neighbour
        if known == TLS and self.group.server_port == _TLS_PORT:
            known = "Modbus/TCP Security: encrypted, nothing can be read of it"
        return f"{self.group.name} ({self.octets:,} bytes{', ' if known else ''}{known})"


@dataclass(slots=True)
class _Survey:
    """What the first reading of a file found."""

    serial: dict[int, int] = field(default_factory=dict)  # interface: port
    groups: list[_Judged] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)  # packets of what is not read, by name
    ports: dict[int, range] = field(default_factory=dict)  # group's number: ports of its lanes
    names: dict[int, str] = field(default_factory=dict)  # port: what it is


def packet_source(path: Path, file: PacketFile, judge: ByteJudge = no_judge) -> _PacketSource:
    """The capture in a packet file; CaptureError where it holds nothing that may be Modbus.

    `judge` knows right check values, by which RTU over TCP is told from what else a network carries.
    """
    survey = _surveyed(file, judge)
    if not survey.serial and not survey.ports:
        raise CaptureError(f"{path}: {_nothing(survey)}")
    header = dict(file.header)
    timed = header.pop("timed", True) is not False
    line, complaints = LineSettings.from_header(header)
    bauds = {file.interfaces[interface].baud for interface in survey.serial}
    if line.baud is None and len(bauds) == 1 and not survey.ports:
        line = replace(line, baud=bauds.pop())
    if survey.ports:
        names = {f"port {port}": name for port, name in sorted(survey.names.items())}
        line = replace(line, tap=line.tap or TAP, notes={**names, **_known(survey), **line.notes})
    return _PacketSource(file, line, timed, survey, tuple(complaints))


def _known(survey: _Survey) -> dict[str, str]:
    """What is known of each port, so that nobody asks again: its protocol, and that marks say who asks."""
    ports = range(max(survey.ports[number].stop for number in survey.ports))
    kinds = {port: one.kind for one in survey.groups for port in survey.ports.get(one.group.number, ())}
    spoken = {port: "" if kind in (None, _UNKNOWN) else str(kind) for port, kind in kinds.items()}
    known = {
        PROTOCOLS_NOTE: ",".join(spoken.get(port, "") for port in ports),
        DIRECTIONS_NOTE: ",".join(BY_MARKS if spoken.get(port) == "tcp" else "" for port in ports),
    }
    return {name: words for name, words in known.items() if words.strip(",")}


def _nothing(survey: _Survey) -> str:
    others = [f"{count:,} packets of {name}" for name, count in survey.others.most_common(_NAMED)]
    if survey.groups:
        names = [one.words for one in sorted(survey.groups, key=lambda one: -one.octets)]
        more = f" and {len(names) - _NAMED:,} more" if len(names) > _NAMED else ""
        return f"no Modbus in its {len(names):,} TCP connections: {', '.join(names[:_NAMED])}{more}"
    return f"it has no serial line, no TCP data and no Modbus over UDP: {', '.join(others) or 'no packets'}"


class _ConnectionSurvey:
    """Takes what connections carry as far as it takes to judge them."""

    def __init__(self) -> None:
        self.judged: dict[int, _Judged] = {}  # by the group's number
        self.data = b""
        self.t_ns: Ints = np.zeros(1, np.int64)
        self.segments: Segments | None = None
        self.base = 0  # segments before those

    def _of(self, half: Half) -> _Judged:
        return self.judged.setdefault(half.group.number, _Judged(half.group))

    def run(self, half: Half, which: Ints) -> None:
        assert self.segments is not None
        begins, sizes = self.segments.begin[which], self.segments.size[which]
        one = self._of(half)
        room = SAMPLE - len(one.sample) if one.octets < SAMPLE_BYTES else 0
        for i, begin, size in zip(which[:room].tolist(), begins[:room].tolist(), sizes[:room].tolist(), strict=True):
            one.sample.append((self.base + i, half.mark, self.data[begin : begin + size]))
        one.octets += int(sizes.sum())
        one.packets += len(which)
        half.heard_ns = int(self.t_ns[self.segments.packet[which[-1]]])

    def piece(self, half: Half, i: int, begin: int, size: int) -> None:
        self.late(half, i, self.data[begin : begin + size])

    def late(self, half: Half, i: int, octets: bytes) -> None:
        one = self._of(half)
        if len(one.sample) < SAMPLE and one.octets < SAMPLE_BYTES:
            one.sample.append((self.base + i, half.mark, octets))
        one.octets += len(octets)
        one.packets += 1
        assert self.segments is not None
        half.heard_ns = int(self.t_ns[self.segments.packet[i]])

    def hole(self, half: Half, i: int, missing: int) -> None:
        """A read is judged as if it were whole; a hole that no header explains is remembered."""
        one = self._of(half)
        if one.sample and one.octets < SAMPLE_BYTES and one.sample[-1][1] == half.mark:
            place, _, octets = one.sample[-1]
            one.sample[-1] = place, half.mark, octets + bytes(min(missing, SAMPLE_BYTES))
        assert self.segments is not None
        begin, size = int(self.segments.begin[i]), int(self.segments.size[i])
        if not (self.segments.missing[i] and size > MBAP and may_begin(self.data[begin : begin + size])):
            t_ns = int(self.t_ns[self.segments.packet[i]])
            if i < 0 and half.heard_ns:  # nothing that came later shows it
                t_ns = min(t_ns, half.heard_ns + _LONGEST_HOLE_NS)
            one.holes.append((max(half.heard_ns, t_ns - _LONGEST_HOLE_NS), t_ns))

    def ended(self, half: Half) -> None:
        """Nothing is kept back here."""


def _surveyed(file: PacketFile, judge: ByteJudge) -> _Survey:
    """Read the whole file for what is in it."""
    survey, listener = _Survey(), _ConnectionSurvey()
    reassembly = Reassembly(listener)
    for packets in file.packets(_unheard):
        listener.data, listener.t_ns = packets.data.tobytes(), packets.t_ns
        for interface, chosen in _by_interface(packets):
            link = file.interfaces[interface].link
            if link in SERIAL:
                reads = serial_reads(packets, chosen, link)
                if len(reads.packet):
                    survey.serial.setdefault(interface, len(survey.serial))
                if reads.other:
                    survey.others["other dissectors than mbrtu, mbtcp and data"] += reads.other
            elif link in NETWORK:
                listener.segments = segments_of(packets, chosen, link)
                reassembly.feed(listener.segments, listener.data)
                listener.base += len(listener.segments.packet)
                if listener.segments.other:
                    survey.others[_NO_TRANSPORT] += listener.segments.other
            else:
                survey.others[f"link type {link}" + (f" ({_LINKS[link]})" if link in _LINKS else "")] += len(chosen)
    reassembly.close()
    survey.groups = list(listener.judged.values())
    _give_ports(survey, file.interfaces, judge)
    return survey


def _unheard(_where: str, _what: str) -> None:
    """Damage is for the second reading to say."""


def _give_ports(survey: _Survey, interfaces: list[Interface], judge: ByteJudge) -> None:
    """Give ports: serial interfaces first, as they are named by this tool, then connections in order of appearance."""
    named = {}
    for interface in survey.serial:
        word, _, number = (interfaces[interface].name or "").partition(" ")
        if word == "port" and number.isdecimal() and int(number) < _PORTS:
            named[interface] = int(number)
    if len(named) == len(survey.serial) and len(set(named.values())) == len(named):
        survey.serial = named
    survey.serial = {interface: port for interface, port in survey.serial.items() if port < _PORTS}
    for one in survey.groups:
        reads = one.reads
        one.neighbour = neighbour(reads)
        one.kind = None if one.neighbour else kind_of(reads, judge)
        if one.group.of_datagrams and one.kind != "tcp":  # answers of DNS, too, begin as they were asked
            survey.others[_FOREIGN_DATAGRAMS] += one.packets
    survey.groups = [one for one in survey.groups if one.kind == "tcp" or not one.group.of_datagrams]
    if not survey.serial and len(survey.groups) == 1 and not survey.groups[0].neighbour:
        survey.groups[0].kind = survey.groups[0].kind or _UNKNOWN  # there is nothing else that could be meant
    following = max(survey.serial.values(), default=-1) + 1
    modbus = [one.group for one in survey.groups if one.kind is not None][: _PORTS - following]
    wanted = sum(group.lanes for group in modbus)
    for group in modbus:
        lanes = group.lanes if wanted <= _PORTS - following else 1
        survey.ports[group.number] = range(following, following + lanes)
        for port in survey.ports[group.number]:
            survey.names[port] = group.name
        wanted -= group.lanes
        following += lanes


def _by_interface(packets: Packets) -> Iterator[tuple[int, Ints]]:
    counts = np.bincount(packets.interface)
    present = np.flatnonzero(counts).tolist()
    for interface in present:
        chosen = packets.interface == interface
        yield interface, np.flatnonzero(chosen) if len(present) > 1 else np.arange(len(packets))


@dataclass(slots=True)
class _PacketSource:
    """The capture in a packet file that was surveyed."""

    file: PacketFile
    line: LineSettings
    timed: bool
    survey: _Survey
    complaints: tuple[str, ...] = ()

    @property
    def notices(self) -> list[str]:
        """What of the file is left out, a line each."""
        out = [one for one in self.survey.groups if one.group.number not in self.survey.ports]
        words = list(self.complaints)
        if out:
            names = ", ".join(one.words for one in out[:_NAMED])
            more = f" and {len(out) - _NAMED:,} more" if len(out) > _NAMED else ""
            words.append(f"TCP connections without Modbus are skipped: {names}{more}")
        if self.survey.serial or out or self.survey.others.keys() - {_NO_TRANSPORT, _FOREIGN_DATAGRAMS}:
            words += [f"{count:,} packets of {name} are skipped" for name, count in self.survey.others.most_common()]
        return words

    def notes(self) -> list[LineNote]:
        return sorted([*packet_notes(self.file), *_holes(self.survey)], key=lambda note: note.t_ns)

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

    def __init__(self, survey: _Survey) -> None:
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
        for interface, chosen in _by_interface(packets):
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
        if half.group.number in self._framed and (half.rest or not self._whole[which].all()):
            for i, begin, size in zip(which.tolist(), begins.tolist(), sizes.tolist(), strict=True):
                self.piece(half, i, begin, size)
            return
        same = np.full((2, len(which)), [[port], [half.mark]])
        self._parts.append(np.concatenate((np.stack((self._packet[which], begins, sizes)), same)))

    def piece(self, half: Half, i: int, begin: int, size: int) -> None:
        if (port := self._port(half)) is None:
            return
        if half.group.number not in self._framed or (not half.rest and self._whole[i]):
            self._pieces.append((int(self._packet[i]), begin, size, port, half.mark))
        else:
            self.late(half, i, self._data[begin : begin + size])

    def late(self, half: Half, i: int, octets: bytes) -> None:
        if half.group.number in self._framed:
            octets = half.rest + octets
            size = whole_adus(octets)
            if not may_begin(octets[size:]):
                size = len(octets)
            octets, half.rest = octets[:size], octets[size:]
        self._put(half, i, octets)

    def hole(self, half: Half, i: int, missing: int) -> None:  # noqa: ARG002 - the protocol's signature
        """What is kept back of a frame is all that there is of it."""
        octets, half.rest = half.rest, b""
        self._put(half, i, octets)

    def ended(self, half: Half) -> None:
        self.hole(half, -1, 0)

    def _put(self, half: Half, i: int, octets: bytes) -> None:
        if octets and (port := self._port(half)) is not None:
            begin = len(self._data) + len(self._late)
            self._late += octets
            self._pieces.append((int(self._packet[i]), begin, len(octets), port, half.mark))


def _holes(survey: _Survey) -> Iterator[LineNote]:
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
    """Comments on packets, and what this tool noted of a recording, in order of time."""
    notes = []
    for packets in file.packets(_unheard):
        for i, comments in packets.comments.items():
            notes += [note_of(int(packets.t_ns[i]), text) for text in comments if errors_of(text) is None]
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
