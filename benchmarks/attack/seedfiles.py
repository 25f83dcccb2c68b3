"""Good files of formats that are only read: packets of TCP and of serial lines, edges, tables of analyzers."""

from __future__ import annotations

import io
import sys
import zipfile
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from pathlib import Path
from random import Random
from typing import Final

sys.path.append(str(Path(__file__).parents[2] / "tests" / "support"))

from packets import Talk, pcap, pcapng, read_answer, read_request
from waves import (
    binary_export,
    edge_table,
    edges_of,
    frames_on_line,
    sample_table,
    sampled,
    scope_table,
    sr,
    vcd,
    vector_dump,
)

_RTU: Final = (bytes.fromhex("1103006b00037687"), bytes.fromhex("110306ae415652434049ad"))
_TABLES: Final = (
    b'name,type,start_time,duration,data,error\n"Async Serial","data",0.0006,2.3e-05,0x11,\n'
    b'"Async Serial","data",0.001,2.3e-05,0x03,\n',
    b"Time [s],Value,Parity Error,Framing Error\n0.000602500000000,0x11,,\n0.0012,0x03,,\n0.0018,0x00,Error,\n",
    b"Time [s],Analyzer Name,Decoded Protocol Result\n0.1,Async Serial,0x11\n0.101,Async Serial,'3' (0x33)\n",
    b"name,type,start_time,duration,data,error\nuart,data,2026-11-21T10:15:00.5Z,0.001,17,\n",
)


def _edges(seed: int, frames: Sequence[bytes] = _RTU) -> list[int]:
    parity, off = ("E", 0.01) if seed % 2 else ("N", 0.0)
    characters = frames_on_line(frames, 19200 * (1 + off), 11 if seed % 2 else 10, seed % 3 * 0.4)
    return edges_of(characters, 19200, 8, parity, off)


def _small(seed: int) -> list[int]:
    return _edges(seed, _RTU[:1])


def _packets(write: Callable[[list[tuple[int, bytes]], int], bytes]) -> list[bytes]:
    seeds = []
    for link in (1, 113, 276, 0, 101):
        talk = Talk(link=link).begin().ask(read_request(1)).answer(read_answer(1))
        seeds.append(write(talk.ask(_RTU[0]).answer(_RTU[1][:4]).answer(_RTU[1][4:]).end().packets, link))
    seeds += [write([(10**18 + i * 10**7, data) for i, data in enumerate(_RTU * 2)], link) for link in (147, 250)]
    upper = b"\0\x0c\0\5mbrtu\0\0\0\0"
    return [*seeds, write([(5, upper + data) for data in _RTU], 252)]


def _sessions() -> list[bytes]:
    """Of sigrok, small ones."""
    seeds = []
    for seed in range(3):
        edges = _edges(seed, _RTU[:1])
        samples = sampled([edges, [t + 5 for t in edges]], 200_000, edges[-1] + 10**6).tobytes()
        seeds.append(sr(samples, "200 kHz", ("RO", "B"), parts=1 + seed))
    return seeds


def _logic_session() -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w") as archive:
        archive.writestr("meta.json", "{}")
        archive.writestr("digital-0.bin", bytes(100))
    return file.getvalue()


@cache
def seeds_of(name: str) -> Sequence[bytes]:
    """Good files of a format, none of them large; none for formats unknown here."""
    made = _MADE.get(name)
    return made() if made is not None else ()


_MADE: Final[Mapping[str, Callable[[], Sequence[bytes]]]] = {
    "pcap": lambda: _packets(pcap),
    "pcapng": lambda: _packets(lambda packets, link: pcapng([(0, t, data, b"") for t, data in packets], [link])),
    "saleae": lambda: _TABLES,
    "saleae-binary": lambda: [binary_export(_edges(seed), seed % 2, seed % 2) for seed in range(4)],
    "saleae-edges": lambda: [
        edge_table({"RO": _edges(seed, _RTU[:1]), "TX": _edges(seed + 1, _RTU[:1])}) for seed in range(3)
    ],
    "analyser-session": lambda: [_logic_session()],
    "scope-table": lambda: [scope_table(_small(seed), 1_000 * (seed + 1)) for seed in range(3)],
    "sigrok": _sessions,
    "sigrok-table": lambda: [sample_table([_small(seed)]) for seed in range(3)],
    "vcd": lambda: [
        *(vcd({"RO": _small(seed)}, ("1 ns", "1 us")[seed % 2], (1, 1000)[seed % 2]) for seed in range(4)),
        vector_dump({"RO": _small(4), "TX": _small(5)}),
    ],
}


def repacked(data: bytes, chance: Random) -> bytes:
    """A zip whose members were spoilt, not it itself; other bytes as they are."""
    from attack.inputs import spoilt

    if not zipfile.is_zipfile(io.BytesIO(data)):
        return data
    file = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as given, zipfile.ZipFile(file, "w") as archive:
        for entry in given.infolist():
            content = given.read(entry)
            if content and chance.random() < 0.5:
                content = spoilt(chance, (content,), (b"samplerate=1 MHz\n", b"total probes=99\n", b"unitsize=0\n"))
            archive.writestr(entry.filename, content)
    return file.getvalue()
