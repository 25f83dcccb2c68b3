"""The table of classes: how each is made, on which taps; and what they are made on.

That is a bus of which every byte, its time and every frame is known, and what a tap makes of it.
"""

from __future__ import annotations

from array import array
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from random import Random

from analyzer.simulation import TAPS
from captures import Capture, Chunk, LineSettings

Truth = tuple[int, int, int]  # port, start, length
_MS = 1_000_000


@dataclass(slots=True)
class Bus:
    """Bytes on the wires of a bus in time, and the frames among them.

    `role` of a frame: `q` asks, `a` answers the newest `q` that is not answered, `u` answers what nobody heard.
    """

    random: Random
    baud: int = 19200
    data: dict[int, bytearray] = field(default_factory=lambda: defaultdict(bytearray))
    times: dict[int, array[float]] = field(default_factory=lambda: defaultdict(lambda: array("d")))
    frames: dict[Truth, tuple[str, Truth | None]] = field(default_factory=dict)
    plain: set[Truth] = field(default_factory=set)  # frames that are there, but no edge
    now: float = 1e9
    asked: Truth | None = None

    @property
    def char_ns(self) -> float:
        return 11e9 / self.baud

    def wait(self, ms: float) -> None:
        self.now += ms * _MS

    def stray(self, octets: bytes, port: int = 0) -> None:
        for byte in octets:
            self.now += self.char_ns
            self.data[port].append(byte)
            self.times[port].append(self.now)

    def send(self, role: str, adu: bytes, port: int = 0, *, plain: bool = False) -> None:
        key = (port, len(self.data[port]), len(adu))
        if plain:
            self.plain.add(key)
        self.stray(adu, port)
        self.frames[key] = (role, self.asked if role == "a" else None)
        self.asked = key if role == "q" else None

    def capture(self, tap: str, notes: dict[str, str] | None = None) -> Capture:
        chunks: list[Chunk] = []
        for port, data in sorted(self.data.items()):
            read = TAPS[tap].deliver(bytes(data), self.times[port], self.random, self.char_ns)
            chunks += [replace(chunk, port=port) for chunk in read]
        chunks.sort(key=lambda chunk: chunk.t_ns)
        line = LineSettings(baud=self.baud, char_bits=11, tap=tap, notes=notes or {})
        return Capture.of(line, chunks, timed=tap != "untimed")


Edge = Callable[[Random], tuple[Bus, dict[str, str]]]
EDGES: dict[str, tuple[Edge, tuple[str, ...], int]] = {}  # class: how it is made, on which taps, captures a seed
ALL_TAPS = ("precise", "irq", "ftdi16", "untimed")


def edge(name: str, taps: tuple[str, ...] = ALL_TAPS, count: int = 1) -> Callable[[Edge], Edge]:
    """Registers a class of edges: `count` captures of it a seed and tap."""

    def register(make: Edge) -> Edge:
        EDGES[name] = make, taps, count
        return make

    return register
