"""Soak: hours of bus time through everything that runs live, played fast; memory must stay flat.

    python benchmarks/soak.py [HOURS]

A bus with healthy and unhealthy stretches (polls, noise, damaged frames, silence) goes through a session with a ring
recorder, the lines and the status, as `rtuscope sniff -o` does. Prints resident memory every tenth of the way.
"""

from __future__ import annotations

import argparse
import random
import resource
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

from analyzer.live.lines import Recent, TextLines
from analyzer.live.session import Session
from analyzer.live.status import LineStatus
from captures.chunks import Block, Chunk
from captures.line import LineSettings
from captures.live.wire import Item, Tick
from captures.recording.recorder import Recorder
from captures.recording.ring import RingLimits
from dissectors.crc import crc_bytes

_LINE = LineSettings(baud=19200, char_bits=11, parity="E", stop_bits=1, tap="usb")
_CHARACTER_NS = 11 * 10**9 // 19200


class Bus:
    """A source: so many nanoseconds of a bus, as fast as they are taken."""

    line = _LINE
    waits = True
    more = False

    def __init__(self, length_ns: int) -> None:
        self._length = length_ns
        self._closed = False

    def items(self) -> Iterator[Item]:
        """Reads of eight bytes, and a tick after each answer."""
        chance, now = random.Random(1), 0
        while now < self._length and not self._closed:
            unit, at, count = chance.randint(1, 30), chance.randrange(1000), chance.randint(1, 20)
            said = [_adu(bytes([unit, 3]) + at.to_bytes(2, "big") + count.to_bytes(2, "big"))]
            if chance.random() > 0.02:
                said.append(_adu(bytes([unit, 3, 2 * count]) + chance.randbytes(2 * count)))
            if chance.random() < 0.01:
                said.append(chance.randbytes(chance.randint(1, 60)))
            chunks = []
            for data in said:
                now += chance.randint(2_000_000, 12_000_000)
                for first in range(0, len(data), 8):
                    part = data[first : first + 8]
                    now += len(part) * _CHARACTER_NS
                    chunks.append(Chunk(now, part))
            yield Block.from_chunks(chunks)
            now += 8_000_000
            yield Tick(now)

    def judge(self, heard: int, sense: int, line: LineSettings) -> None:
        """The settings are what they are."""

    def close(self) -> None:
        """End soon."""
        self._closed = True


def _adu(data: bytes) -> bytes:
    return data + crc_bytes(data)


def _resident_mb() -> float:
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * resource.getpagesize() / 1e6
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("hours", nargs="?", type=float, default=1.0)
    hours = parser.parse_args().hours
    length = int(hours * 3600e9)
    with tempfile.TemporaryDirectory() as folder:
        recorder = Recorder(Path(folder) / "bus.mcap", _LINE, limits=RingLimits(size=1 << 20, keep_bytes=8 << 20))
        recent, lines, status = Recent(), TextLines(colour=False, width=None), LineStatus(_LINE)
        begun, mark, shown = time.process_time(), 0, 0
        with Session(Bus(length), recorder=recorder) as session:
            for step in session.steps():
                status.feed(step)
                shown += sum(len(lines.of(row)) for row in recent.feed(step))
                if step.t_ns >= mark:
                    print(
                        f"{step.t_ns / 3600e9:5.2f} h  {status.frames:9,} frames  {_resident_mb():7.1f} MB", flush=True
                    )
                    mark += length // 10
        spent = time.process_time() - begun
        print(f"{spent:.0f} s of CPU, {spent / (hours * 3600):.1%} of one core; {shown:,} characters shown; {status}")


if __name__ == "__main__":
    main()
