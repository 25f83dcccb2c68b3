"""pcapng for Wireshark: a packet a frame, dissected without any setting.

A packet is of link type 252 (upper PDU): tags that name the dissector, then the bytes as captured. Frames go to
`mbrtu`, those of Modbus TCP to `mbtcp`. Frames of ASCII mode and, if asked for, noise go to `data`, which shows bytes
and claims nothing: Wireshark has no dissector of that mode, and an LRC is no CRC. A packet's time is that of
its last stop bit.

Direction stands in the packet flags (a request is outbound, a response inbound) and in the port tags: port 502 is the
server's. Wireshark takes a hint from ports only where its preference `mbrtu.tcp.port` is 502; without that it guesses
direction from lengths, and cannot tell a write's echo from its request. A wrong check value is flagged as a CRC error,
and what was found about a frame is its packet comment: `error: byte-missing: ...`.

The format's address columns hold IP addresses alone, so unit 17 is 0.0.0.17 and the client 0.0.1.0: addresses of no
network, by which Wireshark tells units apart. Noise has none.

The raw reads are in the file as well, in blocks that other programs step over (`captures.network.blocks`): so this tool
reads its own file as the capture that it came from. With a filter, or a count, they are left out.

Blocks are packed by arrays: all of them are whole 32-bit words, so each field is one scatter over all packets.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings
from captures.network import blocks as ng
from captures.network.blocks import pcapng_block, pcapng_option
from captures.network.packets import INBOUND, OUTBOUND, UPPER_PDU

from ...tables.batch import Batch
from ...tables.findings import Finding
from ...tables.schema import Kind, Protocol
from ...usernotes import Notes, marked_rows
from ...version import __version__
from ..encoding import explain_json
from ..sink import ExportOptions, OutputStream, Sink

if TYPE_CHECKING:
    from captures import Block, Capture

    from ...core import Analysed

BINARY: Final = True
TAKES: Final = frozenset({"noise", "explain"})
_CRC_ERROR: Final = 1 << 24  # flag
_DISSECTOR, _FROM, _TO, _PORT_TYPE, _SOURCE, _DESTINATION = 12, 20, 21, 24, 25, 26  # tags; _FROM and _TO are IPv4
_TCP: Final = 2
_SERVER, _CLIENT = 502, 1502
_MOST: Final = 1 << 17  # bytes of a row that are written: longer packets make Wireshark refuse the file
_ABOUT: Final = "Port 502 is the server's: set the preference mbrtu.tcp.port to 502 and Wireshark knows each direction."

Words = NDArray[np.uint32]
_Ints = NDArray[np.int64]


def _tags(dissector: bytes, source: int, destination: int) -> Words:
    """What stands before the bytes of a packet; as long for any dissector. Without ports there are no addresses."""
    if source:
        client = bytes((0, 0, 1, 0))
        tags = struct.pack(">HH8sHH4sHH4s", _DISSECTOR, 8, dissector, _FROM, 4, client, _TO, 4, client)
    else:
        tags = struct.pack(">HH24s", _DISSECTOR, 24, dissector)
    for tag, value in ((_PORT_TYPE, _TCP), (_SOURCE, source), (_DESTINATION, destination)):
        tags += struct.pack(">HHI", tag, 4, value)
    return np.frombuffer(tags + bytes(4), "<u4")


# By kind: noise has no direction. Frames of ASCII mode have, and the dissector of noise.
_PORTS: Final = ((0, 0), (_CLIENT, _SERVER), (_SERVER, _CLIENT))
_RTU: Final = np.stack([_tags(b"data" if kind == Kind.NOISE else b"mbrtu", *_PORTS[kind]) for kind in Kind])
_TCP_FRAME: Final = np.stack([_tags(b"data" if kind == Kind.NOISE else b"mbtcp", *_PORTS[kind]) for kind in Kind])
_PLAIN: Final = np.stack([_tags(b"data", *_PORTS[kind]) for kind in Kind])
_WAYS: Final = np.array([0, OUTBOUND, INBOUND], np.uint32)
_BEFORE: Final = 7  # words of a packet block before its tags
_TAGGED: Final = _RTU.shape[1]
_FROM_AT, _TO_AT = 4, 6  # words of the tags that are the addresses
_AFTER: Final = 4  # words behind the bytes: the flags, the end of the options, the block's size


class _PacketWriter(Sink):
    def __init__(self, out: OutputStream, capture: Capture, options: ExportOptions) -> None:
        self._out = out
        self._options = options
        self._line = capture.line
        self._interfaces: dict[int, int] = {}  # by port, in order of appearance
        self._reads = options.whole
        self._notes = Notes.of_capture(capture.path)
        out.write(ng.section(capture.line, timed=capture.timed, reads=self._reads, more=_about()))
        self._interface(0)

    def block(self, block: Block) -> None:
        """Raw reads as they are."""
        if self._reads:
            self._out.write(ng.reads_block(block))

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """A packet a row."""
        kinds = batch.rows.kind[first:last]
        chosen = np.arange(first, last) if self._options.noise else first + np.flatnonzero(kinds != Kind.NOISE)
        if not len(chosen):
            return
        ports = batch.rows.port[chosen]
        for port in np.unique(ports).tolist():
            self._interface(port)
        interfaces = np.zeros(256, np.uint32)
        interfaces[list(self._interfaces)] = list(self._interfaces.values())
        marks = marked_rows(self._notes, ports, batch.rows.start[chosen])
        comments = _comments(batch, chosen, self._options.explain, marks)
        self._out.write(_packets(batch, chosen, interfaces[ports], comments))

    def batch(self, analysed: Analysed) -> None:
        """Nothing here hangs on a whole batch."""

    def close(self) -> None:
        """Nothing is left: packets are written as they come."""

    def _interface(self, port: int) -> None:
        if port not in self._interfaces:
            self._interfaces[port] = len(self._interfaces)
            self._out.write(_interface(port, self._line))


def _about() -> bytes:
    application = f"rtuscope {__version__}".encode()
    return pcapng_option(ng.COMMENT, _ABOUT.encode()) + pcapng_option(ng.APPLICATION, application)


def _interface(port: int, line: LineSettings) -> bytes:
    options = pcapng_option(ng.NAME, f"port {port}".encode()) + pcapng_option(
        ng.RESOLUTION, b"\x09"
    )  # times in 10**-9 s
    if line.baud is not None:
        options += pcapng_option(ng.SPEED, struct.pack("<Q", int(line.baud)))
    return pcapng_block(ng.INTERFACE, struct.pack("<HHI", UPPER_PDU, 0, 0) + options + bytes(4))


def _packets(batch: Batch, chosen: NDArray[np.intp], interfaces: Words, comments: dict[int, bytes]) -> bytes:
    """The blocks of some rows; `comments` holds options by a row's position in `chosen`."""
    rows = batch.rows[chosen]
    lengths = np.minimum(rows.length, _MOST)
    extra = np.zeros(len(rows), np.int64)
    if comments:
        extra[list(comments)] = [len(option) // 4 for option in comments.values()]
    ends = _BEFORE + _TAGGED + (lengths + 3) // 4  # words, in a block, up to where the options begin
    words = ends + extra + _AFTER
    begins = np.cumsum(words) - words
    packed = np.zeros(int(words.sum()), "<u4")

    sizes = 4 * words
    tags_size = 4 * _TAGGED
    times = np.maximum(rows.t_end_ns, 0)  # the format has no times before its epoch
    octets = (tags_size + lengths, tags_size + rows.length)  # written, and as they were
    for i, column in enumerate((ng.ENHANCED_PACKET, sizes, interfaces, times >> 32, times & 0xFFFFFFFF, *octets)):
        packed[begins + i] = column
    kinds = rows.kind
    tags = _RTU[kinds]
    for protocol, its in ((Protocol.ASCII, _PLAIN), (Protocol.TCP, _TCP_FRAME)):
        if (mine := rows.protocol == protocol).any():
            tags[mine] = its[kinds[mine]]
    for kind, at in ((Kind.REQUEST, _TO_AT), (Kind.RESPONSE, _FROM_AT)):
        tags[kinds == kind, at] = rows.unit[kinds == kind].astype(np.uint32) << 24  # its last byte
    packed[(begins + _BEFORE)[:, None] + np.arange(_TAGGED)] = tags
    _copy(batch.data, rows.at, packed.view(np.uint8), 4 * (begins + _BEFORE + _TAGGED), lengths)

    behind = begins + ends
    for position, option in comments.items():
        packed[behind[position] : behind[position] + extra[position]] = np.frombuffer(option, "<u4")
    behind = behind + extra
    packed[behind] = 4 << 16 | ng.FLAGS  # the option's code, then its size
    packed[behind + 1] = _WAYS[kinds] | np.where((kinds != Kind.NOISE) & ~rows.check, _CRC_ERROR, 0)
    packed[behind + 3] = sizes
    return packed.tobytes()


def _copy(data: NDArray[np.uint8], at: _Ints, out: NDArray[np.uint8], to: _Ints, lengths: _Ints) -> None:
    """Stretches of `data` to their places in `out`."""
    steps = np.arange(int(lengths.sum()))
    copied = np.cumsum(lengths) - lengths
    out[np.repeat(to - copied, lengths) + steps] = data[np.repeat(at - copied, lengths) + steps]


def _comments(batch: Batch, chosen: NDArray[np.intp], explain: bool, marks: Mapping[int, str]) -> dict[int, bytes]:
    """Packet comments as options, by a row's position in `chosen`: findings, why the boundaries stand where they do,
    and the user's own."""
    texts_by_row: dict[int, list[str]] = {}
    findings = batch.findings
    if findings is not None and len(findings):
        rows = batch.rows[chosen]
        marked = np.isin(rows.start, findings.start)
        for position in np.flatnonzero(marked).tolist():
            texts_by_row[position] = [finding_comment(finding) for finding in batch.findings_of(int(chosen[position]))]
    if explain and batch.evidence is not None:
        for position in np.flatnonzero(batch.rows.kind[chosen] != Kind.NOISE).tolist():
            if (why := explain_json(batch.frame(int(chosen[position])))) is not None:
                weights = ", ".join(f"{key} {value}" for key, value in why.items() if key != "runner_up")
                texts_by_row.setdefault(position, []).append(f"evidence in bits: {weights}")
    for position, comment in marks.items():
        texts_by_row.setdefault(position, []).append(f"bookmark: {comment}" if comment else "bookmark")
    return {position: _comment_options(texts) for position, texts in texts_by_row.items() if texts}


def _comment_options(texts: Iterable[str]) -> bytes:
    return b"".join(pcapng_option(ng.COMMENT, text.encode()[: ng.TEXT]) for text in texts)


def finding_comment(finding: Finding) -> str:
    """A finding as a packet's comment; display filters find its code and its severity."""
    return f"{finding.severity.name.lower()}: {finding.code}: {finding.text}"


class PacketStream:
    """The same packets one by one, as a bus goes on. What is said of a frame whose packet went out already comes as an
    empty packet of its own, whose comments tell of which frame."""

    def __init__(self) -> None:
        self._line = LineSettings()
        self._interfaces: dict[int, int] = {}  # by port, of the present line
        self._count = 0

    def begin(self) -> bytes:
        """What stands before all packets."""
        return ng.section(self._line, timed=True, reads=False, more=_about())

    def row(self, batch: Batch, row: int, line: LineSettings) -> bytes:
        """A frame or noise, with what was found by now; `line` is what is known of the line."""
        chosen = np.array([row])
        new, interface = self._interface(int(batch.rows.port[row]), line)
        interfaces = np.array([interface], np.uint32)
        return new + _packets(batch, chosen, interfaces, _comments(batch, chosen, explain=False, marks={}))

    def remark(self, t_ns: int, port: int, line: LineSettings, texts: Iterable[str]) -> bytes:
        """Comments by themselves."""
        new, interface = self._interface(port, line)
        tags = _PLAIN[Kind.NOISE].tobytes()
        t_ns = max(t_ns, 0)
        head = struct.pack("<5I", interface, t_ns >> 32, t_ns & 0xFFFFFFFF, len(tags), len(tags))
        return new + pcapng_block(ng.ENHANCED_PACKET, head + tags + _comment_options(texts) + bytes(4))

    def _interface(self, port: int, line: LineSettings) -> tuple[bytes, int]:
        """The block that declares a port's interface, if that is new, and its number."""
        if line != self._line:
            self._line = line
            self._interfaces = {}
        if port in self._interfaces:
            return b"", self._interfaces[port]
        self._interfaces[port] = self._count
        self._count += 1
        return _interface(port, line), self._interfaces[port]


def open_sink(out: OutputStream, capture: Capture, options: ExportOptions) -> _PacketWriter:
    """Packets onto `out`."""
    return _PacketWriter(out, capture, options)
