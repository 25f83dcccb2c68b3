"""Edges in the files of logic analysers: sigrok sessions, VCD, Saleae's exports."""

from __future__ import annotations

import io
import struct
import zipfile

import numpy as np


def sr(samples: bytes, rate: str = "1 MHz", names: tuple[str, ...] = ("RO",), unit: int = 1, parts: int = 1) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("version", "2")
        probes = "".join(f"probe{i + 1}={name}\n" for i, name in enumerate(names))
        archive.writestr(
            "metadata",
            "[global]\nsigrok version=0.5.2\n\n[device 1]\ncapturefile=logic-1\n"
            f"total probes={len(names)}\nsamplerate={rate}\ntotal analog=0\n{probes}unitsize={unit}\n",
        )
        size = -(-len(samples) // parts)
        for part in range(parts):
            archive.writestr(f"logic-1-{part + 1}", samples[part * size : (part + 1) * size])
    return file.getvalue()


def vcd(channels: dict[str, list[int]], unit: str = "1 ns", divisor: int = 1, vector: bool = False) -> bytes:
    codes = {name: "!#ab"[i] + "0" * (i % 2) for i, name in enumerate(channels)}
    changes = sorted((t // divisor, name) for name, edges in channels.items() for t in edges)
    out = [f"$date now $end\n$timescale {unit} $end\n$scope module bus $end\n"]
    out += [f"$var wire 1 {code} {name} $end\n" for name, code in codes.items()]
    out += ["$var wire 8 % bus [7:0] $end\n$upscope $end\n$enddefinitions $end\n$comment 0! says nothing $end\n"]
    out += ["#0\n$dumpvars\n", *(f"1{code}\n" for code in codes.values()), "bxxxx %\n$end\n"]
    levels = dict.fromkeys(channels, 1)
    for t, name in changes:
        levels[name] ^= 1
        out.append(f"#{t} b{levels[name]} {codes[name]} b1010 %\n" if vector else f"#{t} {levels[name]}{codes[name]}\n")
    return "".join(out).encode()


def binary_export(edges: list[int], version: int = 0, level: int = 1) -> bytes:
    times = (np.array(edges) / 1e9).astype("<f8")
    if version == 0:
        head = struct.pack("<iiIddQ", 0, 0, level, times[0] - 0.1, times[-1] + 0.1, len(times))
        return b"<SALEAE>" + head + times.tobytes()
    half = len(times) // 2
    out = b"<SALEAE>" + struct.pack("<iiQ", 1, 0, 2)
    for begin, part in ((0, times[:half]), (half, times[half:])):
        out += struct.pack("<IdddQ", level ^ begin & 1, 1e6, part[0] - 1e-9, part[-1], len(part)) + part.tobytes()
    return out


def edge_table(channels: dict[str, list[int]], head: str = "Time [s]", end: str = "\n") -> bytes:
    changes = sorted((t, name) for name, edges in channels.items() for t in edges)
    levels = dict.fromkeys(channels, 1)
    rows = [",".join([head, *channels]), ",".join(["0.000000000", *map(str, levels.values())])]
    for t, name in changes:
        levels[name] ^= 1
        rows.append(",".join([f"{t / 1e9:.9f}", *map(str, levels.values())]))
    return (end.join(rows) + end).encode()
