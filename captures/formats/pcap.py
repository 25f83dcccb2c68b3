"""pcap, `.pcap`: the classic file of tcpdump and Wireshark, one link type for all packets.

What is in the packets is known in `captures.network`. Both byte orders, and times in micro- or nanoseconds.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final

import numpy as np

from ..chunks import Note, Source
from ..errors import CaptureError
from ..files import opened, read_head
from ..network.packets import LONGEST, Interface, Packets
from ..text.judging import ByteJudge, no_judge
from . import Format

_MAGICS: Final = {  # byte order, and ns in a unit of the second half of a time
    b"\xd4\xc3\xb2\xa1": ("<", 1000),
    b"\xa1\xb2\xc3\xd4": (">", 1000),
    b"\x4d\x3c\xb2\xa1": ("<", 1),
    b"\xa1\xb2\x3c\x4d": (">", 1),
}
_HEADER: Final = 24
_RECORD: Final = 16
_PIECE: Final = 1 << 21


@dataclass(slots=True)
class _PcapFile:
    path: Path
    order: str
    unit_ns: int
    interfaces: list[Interface]
    header: dict[str, object] = field(default_factory=dict)

    def packets(self, note: Note) -> Iterator[Packets]:
        captured = struct.Struct(f"{self.order}I").unpack_from
        with opened(self.path) as file:
            file.seek(_HEADER)
            rest, base = b"", _HEADER
            while octets := file.read(_PIECE):
                rest += octets
                heads, at, longest = [], 0, len(rest) - _RECORD
                while at <= longest:
                    (size,) = captured(rest, at + 8)
                    after = at + _RECORD + size
                    if after > len(rest):
                        break
                    heads.append(at)
                    at = after
                if heads:
                    yield self._columns(rest, np.array(heads, np.int64))
                rest, base = rest[at:], base + at
                if len(rest) > LONGEST:
                    break
            if rest:
                note(
                    f"byte {base}", f"{len(rest):,} bytes that are not a whole packet: the rest of the file is skipped"
                )

    def _columns(self, data: bytes, heads: np.ndarray[tuple[int], np.dtype[np.int64]]) -> Packets:
        octets = np.frombuffer(data, np.uint8)
        words = octets[heads[:, None] + np.arange(_RECORD)].view(f"{self.order}u4").astype(np.int64)
        none = np.zeros(len(heads), np.int64)
        return Packets(
            data=octets,
            at=heads + _RECORD,
            size=words[:, 2],
            missing=np.maximum(words[:, 3] - words[:, 2], 0),
            t_ns=words[:, 0] * 1_000_000_000 + words[:, 1] * self.unit_ns,
            interface=none,
            flags=none,
        )


def _sniff(head: bytes) -> float:
    return 1.0 if head[:4] in _MAGICS else 0.0


def _read(path: Path, *, judge: ByteJudge = no_judge) -> Source:
    from ..network.source import packet_source

    head = read_head(path)
    if head[:4] not in _MAGICS or len(head) < _HEADER:
        raise CaptureError(f"{path}: not a pcap file, or cut in its header")
    order, unit_ns = _MAGICS[head[:4]]
    (link,) = struct.unpack_from(f"{order}I", head, 20)
    return packet_source(path, _PcapFile(path, order, unit_ns, [Interface(link & 0xFFFF)]), judge)


FORMAT = Format("pcap", (".pcap", ".cap", ".dmp"), _sniff, _read)
