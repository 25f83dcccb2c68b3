"""The first reading of a network capture: which connections there are, which of them carry Modbus, and their ports."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ..chunks import Mark
from ..line import BY_MARKS, DIRECTIONS_NOTE, PROTOCOLS_NOTE
from ..recording.notes import Note as LineNote
from ..text.judging import ByteJudge, no_judge
from .blocks import errors_of, note_of
from .choosing import MBAP, SAMPLE, SAMPLE_BYTES, kind_of, may_begin
from .neighbours import TLS, neighbour
from .packets import (
    NETWORK,
    SERIAL,
    Interface,
    Ints,
    PacketFile,
    Packets,
    Segments,
    segments_of,
    serial_reads,
)
from .tcp import ConnectionGroup, Half, Reassembly

_PORTS: Final = 256
_PORT_NAMES: Final = {f"port {port}": port for port in range(_PORTS)}  # of interfaces that this tool wrote
NO_TRANSPORT: Final = "neither TCP nor UDP"
FOREIGN_DATAGRAMS: Final = "UDP without Modbus"
NAMED: Final = 4  # of what is left out, named one by one
_UNKNOWN: Final = "unknown"  # what a connection may be that is the only one
_TLS_PORT: Final = 802  # of Modbus/TCP Security
_LONGEST_HOLE_NS: Final = 10_000_000_000  # what is older is not said to be missing
_LINKS: Final = {
    105: "IEEE 802.11", 127: "IEEE 802.11 with radiotap", 189: "USB (usbmon)", 195: "IEEE 802.15.4",
    220: "USB (usbmon)", 227: "CAN", 249: "USB (USBPcap)",
}  # fmt: skip


@dataclass(slots=True)
class JudgedGroup:
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
class PacketSurvey:
    """What the first reading of a file found."""

    serial: dict[int, int] = field(default_factory=dict)  # interface: port
    groups: list[JudgedGroup] = field(default_factory=list)
    others: Counter[str] = field(default_factory=Counter)  # packets of what is not read, by name
    ports: dict[int, range] = field(default_factory=dict)  # group's number: ports of its lanes
    names: dict[int, str] = field(default_factory=dict)  # port: what it is
    notes: list[LineNote] = field(default_factory=list)  # in the file's order


def known_of_ports(survey: PacketSurvey) -> dict[str, str]:
    """What is known of each port, so that nobody asks again: its protocol, and that marks say who asks."""
    ports = range(max(survey.ports[number].stop for number in survey.ports))
    kinds = {port: one.kind for one in survey.groups for port in survey.ports.get(one.group.number, ())}
    spoken = {port: "" if kind in (None, _UNKNOWN) else str(kind) for port, kind in kinds.items()}
    known = {
        PROTOCOLS_NOTE: ",".join(spoken.get(port, "") for port in ports),
        DIRECTIONS_NOTE: ",".join(BY_MARKS if spoken.get(port) == "tcp" else "" for port in ports),
    }
    return {name: words for name, words in known.items() if words.strip(",")}


def nothing_words(survey: PacketSurvey) -> str:
    others = [f"{count:,} packets of {name}" for name, count in survey.others.most_common(NAMED)]
    if survey.groups:
        names = [one.words for one in sorted(survey.groups, key=lambda one: -one.octets)]
        more = f" and {len(names) - NAMED:,} more" if len(names) > NAMED else ""
        return f"no Modbus in its {len(names):,} TCP connections: {', '.join(names[:NAMED])}{more}"
    return f"it has no serial line, no TCP data and no Modbus over UDP: {', '.join(others) or 'no packets'}"


class _ConnectionSurvey:
    """Takes what connections carry as far as it takes to judge them."""

    def __init__(self) -> None:
        self.judged: dict[int, JudgedGroup] = {}  # by the group's number
        self.data = b""
        self.t_ns: Ints = np.zeros(1, np.int64)
        self.segments: Segments | None = None
        self.base = 0  # segments before those

    def _of(self, half: Half) -> JudgedGroup:
        return self.judged.setdefault(half.group.number, JudgedGroup(half.group))

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


def surveyed(file: PacketFile, judge: ByteJudge) -> PacketSurvey:
    """Read the whole file for what is in it."""
    survey, listener = PacketSurvey(), _ConnectionSurvey()
    reassembly = Reassembly(listener)
    for packets in file.packets(unheard):
        listener.data, listener.t_ns = packets.data.tobytes(), packets.t_ns
        survey.notes += notes_on(packets)
        for interface, chosen in by_interface(packets):
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
                    survey.others[NO_TRANSPORT] += listener.segments.other
            else:
                survey.others[f"link type {link}" + (f" ({_LINKS[link]})" if link in _LINKS else "")] += len(chosen)
    reassembly.close()
    survey.groups = list(listener.judged.values())
    _give_ports(survey, file.interfaces, judge)
    return survey


def notes_on(packets: Packets) -> Iterator[LineNote]:
    """Comments on packets, and what this tool noted of a recording."""
    for i, comments in packets.comments.items():
        yield from (note_of(int(packets.t_ns[i]), text) for text in comments if errors_of(text) is None)


def unheard(_where: str, _what: str) -> None:
    """Damage is for the second reading to say."""


def _serial_ports(found: dict[int, int], interfaces: list[Interface]) -> dict[int, int]:
    """The ports of serial interfaces: those in their names where each has one of its own, else by appearance."""
    named = {interface: _PORT_NAMES.get(interfaces[interface].name or "", _PORTS) for interface in found}
    if max(named.values(), default=0) < _PORTS and len(set(named.values())) == len(named):
        return named
    return {interface: port for interface, port in found.items() if port < _PORTS}


def _judge_groups(survey: PacketSurvey, judge: ByteJudge) -> None:
    """What each connection speaks; datagrams that are no Modbus are counted, and left out."""
    sure = {"tcp", "ascii"}
    if judge is not no_judge:  # by its check values: answers of DNS, too, begin as they were asked
        sure.add("rtu")
    for one in survey.groups:
        reads = one.reads
        one.neighbour = neighbour(reads)
        one.kind = None if one.neighbour else kind_of(reads, judge)
        if one.group.of_datagrams and one.kind not in sure:
            survey.others[FOREIGN_DATAGRAMS] += one.packets
    survey.groups = [one for one in survey.groups if one.kind in sure or not one.group.of_datagrams]
    if not survey.serial and len(survey.groups) == 1 and not survey.groups[0].neighbour:
        survey.groups[0].kind = survey.groups[0].kind or _UNKNOWN  # there is nothing else that could be meant


def _give_ports(survey: PacketSurvey, interfaces: list[Interface], judge: ByteJudge) -> None:
    """Give ports: serial interfaces first, as they are named by this tool, then connections in order of appearance."""
    survey.serial = _serial_ports(survey.serial, interfaces)
    _judge_groups(survey, judge)
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


def by_interface(packets: Packets) -> Iterator[tuple[int, Ints]]:
    counts = np.bincount(packets.interface)
    present = np.flatnonzero(counts).tolist()
    for interface in present:
        chosen = packets.interface == interface
        yield interface, np.flatnonzero(chosen) if len(present) > 1 else np.arange(len(packets))
