"""pcapng for Wireshark: a packet a frame, dissected without any setting.

A packet is of link type 252 (upper PDU): tags that name the dissector, then the bytes as captured. Frames go to
`mbrtu`, those of Modbus TCP to `mbtcp`. Frames of ASCII mode and, if asked for, noise go to `data`, which shows bytes
and claims nothing: Wireshark has no dissector of that mode, and an LRC is no CRC. A packet's time is that of
its last stop bit.

Direction stands in the packet flags (a request is outbound, a response inbound) and in the port tags: port 502 is the
server's. Wireshark takes a hint from ports only where its preference `mbrtu.tcp.port` is 502; without that it guesses
direction from lengths, and cannot tell a write's echo from its request. A wrong check value is flagged as a CRC error,
and what was found about a frame is its packet comment.

The raw reads are in the file as well, in blocks that other programs step over (`captures.network.blocks`): so this tool
reads its own file as the capture that it came from. With a filter they are left out.

Blocks are packed by arrays: all of them are whole 32-bit words, so each field is one scatter over all packets.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from captures.network import blocks as ng
from captures.network.blocks import pcapng_block, pcapng_option
from captures.network.links import UPPER_PDU
from captures.network.packets import INBOUND, OUTBOUND

from ...tables.batch import Batch
from ...tables.schema import Kind, Protocol
from ...usernotes import Notes, marked_rows
from ...version import __version__
from ..encoding import explain_json
from ..output import OutputStream
from ..sink import ExportOptions

if TYPE_CHECKING:
    from captures import Block, Capture, LineSettings

    from ...core import Analysed

BINARY: Final = True
_CRC_ERROR: Final = 1 << 24  # flag
_DISSECTOR, _PORT_TYPE, _SOURCE, _DESTINATION = 12, 24, 25, 26  # tags
_TCP: Final = 2
_SERVER, _CLIENT = 502, 1502
_MOST: Final = 1 << 17  # bytes of a row that are written: longer packets make Wireshark refuse the file
_ABOUT: Final = "Port 502 is the server's: set the preference mbrtu.tcp.port to 502 and Wireshark knows each direction."

Words = NDArray[np.uint32]
_Ints = NDArray[np.int64]


def _tags(dissector: bytes, source: int, destination: int) -> Words:
    """What stands before the bytes of a packet; as long for any dissector."""
    tags = struct.pack(">HH8s", _DISSECTOR, 8, dissector)
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
_AFTER: Final = 4  # words behind the bytes: the flags, the end of the options, the block's size


class _Packets:
    def __init__(self, out: OutputStream, capture: Capture, options: ExportOptions) -> None:
        self._out = out
        self._options = options
        self._line = capture.line
        self._interfaces: dict[int, int] = {}  # by port, in order of appearance
        self._reads = options.filter is None
        self._notes = Notes.of_capture(capture.path)
        about = pcapng_option(ng.COMMENT, _ABOUT.encode()) + pcapng_option(
            ng.APPLICATION, f"rtuscope {__version__}".encode()
        )
        out.write(ng.section(capture.line, timed=capture.timed, reads=self._reads, more=about))
        self._interface(0)

    def block(self, block: Block) -> None:
        """Raw reads as they are."""
        if self._reads:
            self._out.write(ng.reads_block(block))

    def rows(self, batch: Batch, first: int, last: int) -> None:
        """A packet a row."""
        kinds = batch.rows["kind"][first:last]
        kept = np.arange(first, last) if self._options.noise else first + np.flatnonzero(kinds != Kind.NOISE)
        if not len(kept):
            return
        ports = batch.rows["port"][kept]
        for port in np.unique(ports).tolist():
            self._interface(port)
        interfaces = np.zeros(256, np.uint32)
        interfaces[list(self._interfaces)] = list(self._interfaces.values())
        marks = marked_rows(self._notes, ports, batch.rows["start"][kept])
        comments = _comments(batch, kept, self._options.explain, marks)
        self._out.write(_packets(batch, kept, interfaces[ports], comments))

    def batch(self, analysed: Analysed) -> None:
        """Nothing here hangs on a whole batch."""

    def close(self) -> None:
        """Nothing is left: packets are written as they come."""

    def _interface(self, port: int) -> None:
        if port not in self._interfaces:
            self._interfaces[port] = len(self._interfaces)
            self._out.write(_interface(port, self._line))


def _interface(port: int, line: LineSettings) -> bytes:
    options = pcapng_option(ng.NAME, f"port {port}".encode()) + pcapng_option(
        ng.RESOLUTION, b"\x09"
    )  # times in 10**-9 s
    if line.baud is not None:
        options += pcapng_option(ng.SPEED, struct.pack("<Q", int(line.baud)))
    return pcapng_block(ng.INTERFACE, struct.pack("<HHI", UPPER_PDU, 0, 0) + options + bytes(4))


def _packets(batch: Batch, kept: NDArray[np.intp], interfaces: Words, comments: dict[int, bytes]) -> bytes:
    """The blocks of some rows; `comments` holds options by a row's place in `kept`."""
    rows = batch.rows[kept]
    lengths = np.minimum(rows["length"], _MOST)
    extra = np.zeros(len(rows), np.int64)
    if comments:
        extra[list(comments)] = [len(option) // 4 for option in comments.values()]
    ends = _BEFORE + _TAGGED + (lengths + 3) // 4  # words, in a block, up to where the options begin
    words = ends + extra + _AFTER
    begins = np.cumsum(words) - words
    packed = np.zeros(int(words.sum()), "<u4")

    sizes = 4 * words
    tags_size = 4 * _TAGGED
    times = np.maximum(rows["t_end"], 0)  # the format has no times before its epoch
    octets = (tags_size + lengths, tags_size + rows["length"])  # written, and as they were
    for i, column in enumerate((ng.ENHANCED_PACKET, sizes, interfaces, times >> 32, times & 0xFFFFFFFF, *octets)):
        packed[begins + i] = column
    kinds = rows["kind"]
    tags = _RTU[kinds]
    for protocol, its in ((Protocol.ASCII, _PLAIN), (Protocol.TCP, _TCP_FRAME)):
        if (mine := rows["protocol"] == protocol).any():
            tags[mine] = its[kinds[mine]]
    packed[(begins + _BEFORE)[:, None] + np.arange(_TAGGED)] = tags
    _copy(batch.data, rows["at"], packed.view(np.uint8), 4 * (begins + _BEFORE + _TAGGED), lengths)

    behind = begins + ends
    for place, option in comments.items():
        packed[behind[place] : behind[place] + extra[place]] = np.frombuffer(option, "<u4")
    behind = behind + extra
    packed[behind] = 4 << 16 | ng.FLAGS  # the option's code, then its size
    packed[behind + 1] = _WAYS[kinds] | np.where((kinds != Kind.NOISE) & ~rows["check"], _CRC_ERROR, 0)
    packed[behind + 3] = sizes
    return packed.tobytes()


def _copy(data: NDArray[np.uint8], at: _Ints, out: NDArray[np.uint8], to: _Ints, lengths: _Ints) -> None:
    """Stretches of `data` to their places in `out`."""
    steps = np.arange(int(lengths.sum()))
    done = np.cumsum(lengths) - lengths
    out[np.repeat(to - done, lengths) + steps] = data[np.repeat(at - done, lengths) + steps]


def _comments(batch: Batch, kept: NDArray[np.intp], explain: bool, marks: Mapping[int, str]) -> dict[int, bytes]:
    """Packet comments as options, by a row's place in `kept`: findings, why the boundaries stand where they do, and the
    user's own."""
    said: dict[int, list[str]] = {}
    found = batch.findings
    if found is not None and len(found):
        rows = batch.rows[kept]
        marked = np.isin(rows["start"], found["start"])
        for place in np.flatnonzero(marked).tolist():
            said[place] = [finding.text for finding in batch.findings_of(int(kept[place]))]
    if explain and batch.evidence is not None:
        for place in np.flatnonzero(batch.rows["kind"][kept] != Kind.NOISE).tolist():
            if (why := explain_json(batch.frame(int(kept[place])))) is not None:
                weights = ", ".join(f"{key} {value}" for key, value in why.items() if key != "runner_up")
                said.setdefault(place, []).append(f"evidence in bits: {weights}")
    for place, comment in marks.items():
        said.setdefault(place, []).append(f"bookmark: {comment}" if comment else "bookmark")
    return {
        place: b"".join(pcapng_option(ng.COMMENT, text.encode()[:0xFFFF]) for text in texts)
        for place, texts in said.items()
        if texts
    }


def open_sink(out: OutputStream, capture: Capture, options: ExportOptions) -> _Packets:
    """Packets onto `out`."""
    return _Packets(out, capture, options)
