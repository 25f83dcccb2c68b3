"""sigrok-cli's UART and Modbus decoders on samples of the wire, four a bit, both directions on one channel.

Settings are those of the decoder's page: `rx` for UART, `cschannel=RX` besides the default `scchannel=RX`, so that it
reads each frame as a request and as a response. A frame is found where one of the two says that its CRC is correct, and
damaged where none does. The direction is that whose CRC is correct; where both are, it does not say. Idle time beyond
100 bits is cut to that: the decoder asks only whether a pause is longer than `framegap`, 28 bits.
"""

from __future__ import annotations

import re
import subprocess
import sys
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from rtubench.adapters.speaking import Given, NotThereError, Row, frame, given, speak

_PER_BIT, _IDLE_BITS = 4, 100


_EVENT = re.compile(r'"ts": (?P<us>[\d.]+), .*"tid": "(?P<row>[^"]*)", "name": "(?P<words>.*)"}')  # quotes unescaped
_DIRECTIONS = {"Client->server": "request", "Server->client": "response"}  # rows of the decoder


class Said(NamedTuple):
    """An annotation: the bytes that it covers, first and last, the direction it is read in, its words."""

    first: int
    last: int
    direction: str
    words: str


def _samples(told: Given, path: Path) -> list[int]:
    """Writes the line's level, a byte a sample; gives the sample at which each byte begins."""
    parity = told.head["char_bits"] == 11
    level, begins, before = bytearray(b"\1" * _IDLE_BITS * _PER_BIT), [], None
    for t_ns, data in told.reads:
        idle_bits = _IDLE_BITS
        if before is not None and t_ns is not None:
            idle_bits = min(idle_bits, max(0, round((t_ns - before - told.char_ns) * told.head["baud"] / 1e9)))
        level += b"\1" * idle_bits * _PER_BIT
        for byte in data:
            begins.append(len(level))
            data_bits = [byte >> at & 1 for at in range(8)]
            for bit in (0, *data_bits, *([sum(data_bits) & 1] if parity else []), 1):
                level += bytes((bit,)) * _PER_BIT
        before = t_ns
    path.write_bytes(level + b"\1" * _IDLE_BITS * _PER_BIT)
    return begins


def _command(told: Given, path: Path, *options: str) -> list[str]:
    baud = told.head["baud"]
    parity = "even" if told.head["char_bits"] == 11 else "none"
    return ["sigrok-cli", "-i", str(path), "-I", f"binary:numchannels=1:samplerate={baud * _PER_BIT}",
            "-P", f"uart:rx=0:baudrate={baud}:parity={parity},modbus:cschannel=RX", "-A", "modbus",
            *options]  # fmt: skip


def _annotations(path: Path) -> Iterator[Said]:
    told = given(path)
    line = Path.cwd() / f"{path.name}.bin"
    begins = _samples(told, line)
    done = subprocess.run(
        _command(told, line, "--protocol-decoder-jsontrace"), capture_output=True, text=True, check=True
    )
    events = [one.groups() for one in _EVENT.finditer(done.stdout) if one["row"] in _DIRECTIONS]
    for (begin, row, words), (end, _, _) in zip(events[::2], events[1::2], strict=True):
        samples = (round(float(us) * told.head["baud"] * _PER_BIT / 1e6) for us in (begin, end))
        first, last = (bisect_right(begins, sample - 1) - 1 for sample in samples)
        yield Said(first, last, _DIRECTIONS[row], words)


def about() -> Row:
    try:
        done = subprocess.run(["sigrok-cli", "--version"], capture_output=True, text=True, check=True)
    except FileNotFoundError:
        raise NotThereError("sigrok-cli is not installed") from None
    claims = ["frames", "directions", "damage", "speed"]
    return {"tool": "sigrok-cli", "version": done.stdout.split()[1], "input": "wire", "claims": claims}


def bus(path: Path) -> Iterator[Row]:
    """Frames begin where a server's address is told, which both readings tell of the same byte."""
    begun: dict[str, int] = {}
    ends: dict[int, int] = {}
    correct: dict[int, dict[str, int]] = {}
    for one in _annotations(path):
        if one.words.startswith("Slave ID"):
            begun[one.direction] = one.first
        if one.direction in begun:
            start = begun[one.direction]
            ends[start] = max(ends.get(start, 0), one.last + 1)
            if one.words == "CRC correct":
                correct.setdefault(start, {})[one.direction] = one.last + 1
    for start, end in sorted(ends.items()):
        read = correct.get(start, {})
        for stop in set(read.values()) or {end}:
            directions = [one for one, its_end in read.items() if its_end == stop]
            yield frame(start, stop - start, bool(read), directions[0] if len(directions) == 1 else None)


def speed(path: Path) -> Iterator[Row]:
    told, line = given(path), Path.cwd() / "line.bin"
    _samples(told, line)
    yield {"command": _command(told, line)}


if __name__ == "__main__":
    sys.exit(speak(about, {"bus": bus, "speed": speed}))
