"""Bytes as the edges of a UART's line, as a logic analyser would see them, and in the files of such.

Files: sigrok sessions, VCD, Saleae's exports, an oscilloscope's voltages. And a bus whose senders' clocks are off.
"""

from __future__ import annotations

import io
import random
import struct
import zipfile
from collections.abc import Iterable
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import captures
from captures import Capture
from dissectors.crc import crc_bytes


def edges_of(
    characters: Iterable[tuple[int, int]],
    baud: float,
    data_bits: int = 8,
    parity: str = "N",
    off: float = 0.0,
    wrong: Iterable[int] = (),
    broken: Iterable[int] = (),
) -> list[int]:
    """Times in ns of all level changes of (start in ns, value) characters on a line that is high when idle.

    `off`: how much faster the sender's clock is; numbers in `wrong` have their parity bit turned, in `broken` no stop.
    """
    bit = 1e9 / (baud * (1 + off))
    wrong, broken, out = set(wrong), set(broken), list[int]()
    for number, (start, value) in enumerate(characters):
        bits = [0, *(value >> i & 1 for i in range(data_bits))]
        if parity != "N":
            ones = bin(value & (1 << data_bits) - 1).count("1") & 1
            sent = {"E": ones, "O": ones ^ 1, "M": 1, "S": 0}[parity]
            bits.append(sent ^ (number in wrong))
        bits += [0] if number in broken else []
        level = 1
        for place, one in enumerate(bits):
            if one != level:
                out.append(round(start + place * bit))
                level = one
        if level == 0:
            out.append(round(start + len(bits) * bit))
    return out


def frames_on_line(
    frames: Iterable[bytes],
    baud: float,
    char_bits: float,
    gap_bits: float = 0.0,
    pause_ns: int = 5_000_000,
    begin_ns: int = 0,
) -> list[tuple[int, int]]:
    """Start times and values of frames sent one after the other, with so many bits of idle between characters."""
    bit = 1e9 / baud
    now, out = float(begin_ns + pause_ns), list[tuple[int, int]]()
    for frame in frames:
        for value in frame:
            out.append((round(now), value))
            now += (char_bits + gap_bits) * bit
        now += pause_ns
    return out


def sampled(channels: list[list[int]], rate: float, end_ns: int, levels: list[int] | None = None) -> NDArray[np.uint8]:
    """Samples of up to eight channels, a bit each, by the edges of each."""
    count = int(end_ns * rate / 1e9)
    data = np.zeros(count, np.uint8)
    for channel, edges in enumerate(channels):
        level = 1 if levels is None else levels[channel]
        flips = np.zeros(count + 1, np.int64)
        places = np.minimum(np.ceil(np.array(edges, np.float64) * rate / 1e9).astype(np.int64), count)
        np.add.at(flips, places, 1)
        data |= ((np.cumsum(flips[:count]) + level) % 2 << channel).astype(np.uint8)
    return data


def random_frames(chance: random.Random, count: int, ascii_only: bool = False) -> list[bytes]:
    if ascii_only:
        return [
            bytes(chance.choice(b"0123456789ABCDEF:\r\n") for _ in range(chance.randrange(7, 40))) for _ in range(count)
        ]
    return [chance.randbytes(chance.randrange(5, 40)) for _ in range(count)]


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


def vector_dump(channels: dict[str, list[int]], width: int = 4) -> bytes:
    """All channels as bits of one vector, the last one its most significant bit; leading zeros are left away."""
    level = dict.fromkeys(range(width), "x") | dict.fromkeys(range(len(channels)), "1")
    changes = sorted((t, bit) for bit, edges in enumerate(channels.values()) for t in edges)
    out = [f"$timescale 1 ns $end\n$var reg {width} ! lines [{width - 1}:0] $end\n$enddefinitions $end\n"]
    for t, changed in [(0, None), *changes]:
        if changed is not None:
            level[changed] = "0" if level[changed] == "1" else "1"
        bits = "".join(level[bit] for bit in reversed(range(width)))
        rest = bits.lstrip(bits[0])
        short = bits if bits[0] == "1" else rest if bits[0] == "0" and rest[:1] == "1" else bits[0] + rest
        out.append(f"#{t}\nb{short} !\n")
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


def combined_table(channels: list[list[int]], end: str = "\r\n") -> bytes:
    """Logic 1's export with the levels of all channels in one hexadecimal number."""
    changes = sorted((t, bit) for bit, edges in enumerate(channels) for t in edges)
    value = (1 << len(channels)) - 1
    rows = ["Time[s],Value", f"0.000000000000000,0x{value:X}"]
    for t, bit in changes:
        value ^= 1 << bit
        rows.append(f"{t / 1e9:.15f},0x{value:X}")
    return (end.join(rows) + end).encode()


def sample_table(
    channels: list[list[int]], names: str = "", head: str = "; Acquisition with 1/8 channels at 1 MHz"
) -> bytes:
    """A row a sample at 1 MHz, as PulseView exports them; `names` is the row of their names, where there is one."""
    samples = sampled(channels, 1e6, max(edges[-1] for edges in channels) + 10**6)
    rows = [",".join(str(sample >> bit & 1) for bit in range(len(channels))) for sample in samples.tolist()]
    lines = ["; CSV generated by libsigrok 0.5.2 on Mon Nov 23 2026", head, *([names] if names else []), *rows]
    return ("\n".join(lines) + "\n").encode()


def scope_table(
    edges: list[int], step_ns: int, head: str = "Time(s),CH1(V),CH2(V)", row: str = "{t:.6e},{high:.3f},{low:.3f}"
) -> bytes:
    """Both wires of a pair, 2.5 V apart, with noise: a row a sample, of number `i`, time `t` or `ms`, `high`, `low`."""
    chance = random.Random(edges[0])
    samples = sampled([edges], 1e9 / step_ns, edges[-1] + 10**7).tolist()
    rows = []
    for i, sample in enumerate(samples):
        volts = (1.25 if sample & 1 else -1.25) + chance.gauss(0, 0.05)
        rows.append(row.format(i=i, t=i * step_ns / 1e9, ms=i * step_ns / 1e6, high=2.5 + volts, low=2.5 - volts))
    return "\n".join([head, *rows, ""]).encode()


BAUD = 19200
OFF = {None: 0.01, 17: -0.015, 3: 0.0}  # of the client and two units
"""By how much the clock of the client, and of two units, is off."""


def bus() -> list[tuple[int | None, list[int]]]:
    """Who sends, and the edges."""
    now, out = 0, list[tuple[int | None, list[int]]]()
    for turn in range(40):
        unit = (17, 3)[turn % 2]
        asked, told = f"{unit:02x}03006b0002", f"{unit:02x}0304{turn:02x}{200 - turn:02x}55{turn:02x}"
        request, answer = (pdu + crc_bytes(pdu) for pdu in map(bytes.fromhex, (asked, told)))
        for sender, frame in ((None, request), (unit, answer)):
            characters = frames_on_line([frame], BAUD * (1 + OFF[sender]), 10, 0, 4_000_000, now)
            edges = edges_of(characters, BAUD, off=OFF[sender])
            out.append((sender, edges))
            now = edges[-1] + 1_000_000
    return out


def drifting_bus(path: Path) -> Capture:
    """The same on one wire, as a VCD file."""
    path.write_bytes(vcd({"RO": [edge for _, edges in bus() for edge in edges]}))
    return captures.open(path)
