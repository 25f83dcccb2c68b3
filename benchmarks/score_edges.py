"""Scores the deframer on the edges that real lines have every day, class by class.

    python benchmarks/score_edges.py [--seeds N] [--misses] [CLASS ...]

A class is a function that makes captures with known truth: stray bytes beside a frame that nobody was heard to ask for,
a tap that hears answers only, two ports of one direction each, lines full of undeclared functions, counts that
contradict a frame whose CRC is right. A line a class and tap: frames, missed, false, recall, precision, and the shares
of right directions and pairs among the frames that were found. A frame counts where port, start and length are right.
"""

from __future__ import annotations

import argparse
import sys
from array import array
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from random import Random

from analyzer.core import deframe
from analyzer.simulation import TAPS
from analyzer.tables.schema import Kind
from captures import Capture, Chunk, LineSettings
from dissectors.crc import crc_bytes

LEAST = 0.98  # recall and precision of a class
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


@dataclass(slots=True)
class EdgeTally:
    """What became of the frames of one class."""

    frames: int = 0
    hits: int = 0
    false: int = 0
    directions: int = 0
    pairs: int = 0
    paired: int = 0
    misses: list[str] = field(default_factory=list)


def score(bus: Bus, capture: Capture, tally: EdgeTally, label: str) -> None:
    """Enters one capture."""
    found = {}
    for batch in deframe(capture):
        for row in batch.rows[(batch.rows["kind"] != Kind.NOISE) & batch.rows["check"]]:
            key = (int(row["port"]), int(row["start"]), int(row["length"]))
            found[key] = ("q" if row["kind"] == Kind.REQUEST else "a", int(row["request_start"]))
    tally.frames += len(bus.frames) - len(bus.plain)
    for key, (role, request) in bus.frames.items():
        if key in bus.plain:
            continue
        if key not in found:
            port, start, length = key
            around = bytes(bus.data[port][max(0, start - 4) : start + length + 4]).hex()
            tally.misses.append(f"{label}: {role} {key} in {around}")
            continue
        tally.hits += 1
        kind, asked = found[key]
        tally.directions += kind == ("q" if role == "q" else "a")
        if request is not None:
            tally.pairs += 1
            tally.paired += asked == request[1]
    tally.false += len(found.keys() - bus.frames.keys())


def adu(*body: int) -> bytes:
    octets = bytes(body)
    return octets + crc_bytes(octets)


def some(random: Random, count: int) -> bytes:
    return bytes(random.getrandbits(8) for _ in range(count))


def request(random: Random, unit: int, functions: Sequence[int] = (1, 2, 3, 4, 5, 6, 15, 16, 22)) -> bytes:
    """A legal request of a common function."""
    function = random.choice(functions)
    head = unit, function, *some(random, 2)
    if function in (1, 2):
        return adu(*head, 0, random.randint(1, 200))
    if function in (3, 4):
        return adu(*head, 0, random.randint(1, 125))
    if function == 5:
        return adu(*head, random.choice((0, 0xFF)), 0)
    if function == 6:
        return adu(*head, *some(random, 2))
    if function == 22:
        return adu(*head, *some(random, 4))
    if function == 15:
        quantity = random.randint(1, 64)
        return adu(*head, 0, quantity, (quantity + 7) // 8, *some(random, (quantity + 7) // 8))
    quantity = random.randint(1, 20)
    return adu(*head, 0, quantity, 2 * quantity, *some(random, 2 * quantity))


def answer(random: Random, asked: bytes, refuse: float = 0.03) -> bytes:
    """A legal answer to a request."""
    unit, function, quantity = asked[0], asked[1], int.from_bytes(asked[4:6])
    if random.random() < refuse:
        return adu(unit, function | 0x80, random.choice((1, 2, 3, 4, 6)))
    if function in (1, 2):
        count = (quantity + 7) // 8
        return adu(unit, function, count, *some(random, count))
    if function in (3, 4):
        return adu(unit, function, 2 * quantity, *some(random, 2 * quantity))
    return asked if function in (5, 6, 22) else adu(*asked[:6])


def short_answer(random: Random) -> bytes:
    """6 or 7 bytes: one byte of bits, or one register."""
    if random.random() < 0.5:
        return adu(random.randint(1, 247), random.choice((1, 2)), 1, *some(random, 1))
    return adu(random.randint(1, 247), random.choice((3, 4)), 2, *some(random, 2))


def _strays(random: Random, count: int, kind: str) -> bytes:
    return some(random, count) if kind == "random" else bytes(random.choice((0, 0, 0xFF, 0xFE)) for _ in range(count))


def vendor(random: Random, unit: int, function: int, least: int = 0) -> bytes:
    return adu(unit, function, *some(random, random.randint(least, 40)))


Edge = Callable[[Random], tuple[Bus, dict[str, str]]]
EDGES: dict[str, tuple[Edge, tuple[str, ...], int]] = {}  # class: how it is made, on which taps, captures a seed
_ALL_TAPS = ("precise", "irq", "ftdi16", "untimed")


def edge(name: str, taps: tuple[str, ...] = _ALL_TAPS, count: int = 1) -> Callable[[Edge], Edge]:
    """Registers a class of edges: `count` captures of it a seed and tap."""

    def register(make: Edge) -> Edge:
        EDGES[name] = make, taps, count
        return make

    return register


@edge("one-register answer alone, 00 behind", count=50)
def _alone_then_zero(random: Random) -> tuple[Bus, dict[str, str]]:
    bus = Bus(random)
    bus.send("u", adu(random.randint(1, 247), random.choice((3, 4)), 2, *some(random, 2)))
    bus.stray(b"\0")
    return bus, {}


def _stray_alone(least: int, most: int, kind: str, made: Callable[[Random], tuple[str, bytes]]) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus = Bus(random)
        for side in (0, 1):
            bus.stray(_strays(random, random.randint(least, most), kind))
            if not side:
                bus.send(*made(random))
        return bus, {}

    return make


def _any_legal(random: Random) -> tuple[str, bytes]:
    asked = request(random, random.randint(1, 247))
    return ("q", asked) if random.random() < 0.5 else ("u", answer(random, asked))


for _kind in ("random", "glitch"):
    edge(f"short answer alone, 1-3 {_kind} bytes on both sides", count=50)(
        _stray_alone(1, 3, _kind, lambda random: ("u", short_answer(random)))
    )
    edge(f"short answer alone, 4-8 {_kind} bytes on both sides", count=50)(
        _stray_alone(4, 8, _kind, lambda random: ("u", short_answer(random)))
    )
    edge(f"any frame alone, 0-8 {_kind} bytes on both sides", count=50)(_stray_alone(0, 8, _kind, _any_legal))


def _stray_stream(least: int, most: int, kind: str, made: Callable[[Random], tuple[str, bytes]]) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus = Bus(random)
        for _ in range(60):
            for side in (0, 1):
                bus.stray(_strays(random, random.randint(least, most), kind))
                if not side:
                    bus.send(*made(random))
            bus.wait(random.uniform(5, 60))
        return bus, {}

    return make


def _own_unit(make: Callable[[Random], bytes]) -> Callable[[Random], tuple[str, bytes]]:
    return lambda random: ("u", make(random))


for _kind in ("random", "glitch"):
    edge(f"short answers in a stream, 1-3 {_kind} bytes on both sides")(
        _stray_stream(1, 3, _kind, _own_unit(short_answer))
    )
    edge(f"any frames in a stream, 0-3 {_kind} bytes on both sides")(_stray_stream(0, 3, _kind, _any_legal))


def _amid_healthy(kind: str, own: bool) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus, units = Bus(random), random.sample(range(1, 248), 3)
        polls = [request(random, random.choice(units)) for _ in range(8)]
        for i in range(150):
            _healthy(bus, random, polls)
            if i < 30 or i % 5:
                continue
            unit = random.choice(units) if own else random.randint(1, 247)
            for side in (0, 1):
                bus.stray(_strays(random, random.randint(0, 3), kind))
                if not side:
                    asked = request(random, unit)
                    bus.send(*random.choice((("q", asked), ("u", answer(random, asked)))))
            bus.asked = None
            bus.wait(random.uniform(20, 60))
        return bus, {}

    return make


for _kind in ("random", "glitch"):
    edge(f"amid a healthy bus, own units, 0-3 {_kind} bytes on both sides")(_amid_healthy(_kind, True))
    edge(f"amid a healthy bus, strange units, 0-3 {_kind} bytes on both sides")(_amid_healthy(_kind, False))


def _answers_only(behind: bytes | None) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus, units = Bus(random), random.sample(range(1, 248), 3)
        polls = [request(random, random.choice(units), (1, 2, 3, 4, 3, 4, 6, 16)) for _ in range(8)]
        for i in range(100):
            bus.send("u", answer(random, polls[i % len(polls)]))
            bus.stray(some(random, random.randint(1, 3)) if behind is None else behind)
            bus.wait(random.uniform(15, 60))
        return bus, {}

    return make


edge("answers only")(_answers_only(b""))
edge("answers only, 00 behind each")(_answers_only(b"\0"))
edge("answers only, 1-3 random bytes behind each")(_answers_only(None))


@edge("one-register answers only, 00 behind each")
def _one_register_only(random: Random) -> tuple[Bus, dict[str, str]]:
    bus = Bus(random)
    for _ in range(100):
        bus.send("u", adu(random.choice((1, 2, 9)), 3, 2, *some(random, 2)))
        bus.stray(b"\0")
        bus.wait(random.uniform(15, 60))
    return bus, {}


@edge("requests only")
def _requests_only(random: Random) -> tuple[Bus, dict[str, str]]:
    bus = Bus(random)
    polls = [request(random, random.randint(1, 9)) for _ in range(8)]
    for i in range(100):
        bus.send("q", polls[i % len(polls)])
        bus.wait(random.uniform(60, 100))
    return bus, {}


def _healthy(bus: Bus, random: Random, polls: Sequence[bytes]) -> None:
    asked = random.choice(polls)
    bus.send("q", asked, plain=True)
    bus.wait(random.uniform(3, 20))
    bus.send("a", answer(random, asked), plain=True)
    bus.wait(random.uniform(8, 40))


@edge("counts that contradict the frame, between silences", ("precise", "irq"))
def _contrary_counts(random: Random) -> tuple[Bus, dict[str, str]]:
    bus = Bus(random)
    polls = [request(random, random.randint(1, 5)) for _ in range(8)]
    for i in range(120):
        _healthy(bus, random, polls)
        if i >= 40 and i % 4 == 0:
            unit, octets = random.randint(1, 5), random.choice((2, 4, 6, 8))
            wrong = random.choice(
                (
                    (unit, 16, 0, random.getrandbits(7), 0, octets // 2, 0),
                    (unit, 16, 0, random.getrandbits(7), 0, octets // 2 + 9, octets + 3),
                    (unit, 16, 0, random.getrandbits(7), 0, octets // 2, 255),
                    (unit, 15, 0, random.getrandbits(7), 0, 8 * octets, 0),
                )
            )
            bus.send("q", adu(*wrong, *some(random, octets)))
            bus.wait(random.uniform(60, 90))
        elif i >= 40 and i % 4 == 2:
            unit, octets = random.randint(1, 5), random.choice((2, 4, 6, 8))
            bus.send("q", adu(unit, 3, 0, random.getrandbits(7), 0, octets // 2), plain=True)
            bus.wait(random.uniform(3, 20))
            bus.send("u", adu(unit, 3, random.choice((0, octets + 2, octets // 2, 255)), *some(random, octets)))
            bus.wait(random.uniform(20, 40))
    return bus, {}


def _ports(notes: dict[str, str], functions: Sequence[int], gap: float = 1.0) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus = Bus(random)
        first = 0 if notes else random.choice((0, 1))
        polls = [request(random, random.randint(1, 5), functions) for _ in range(12)]
        for _ in range(40):
            asked = random.choice(polls)
            if random.random() < 0.3:
                asked = request(random, random.randint(1, 5), functions)
            bus.send("q", asked, first)
            bus.wait(gap * random.uniform(4, 20))
            bus.send("a", answer(random, asked, 0.0), 1 - first)
            bus.wait(gap * random.uniform(20, 60))
        return bus, notes

    return make


_KNOWN = {"directions": "request,response"}
for _name, _notes in (("known", _KNOWN), ("not known", {})):
    edge(f"two ports, directions {_name}, echoes of 05, 06, 16h", ("precise", "irq", "ftdi16"))(
        _ports(_notes, (5, 6, 22))
    )
    edge(f"two ports, directions {_name}, all functions", ("precise", "irq", "ftdi16"))(
        _ports(_notes, (1, 2, 3, 4, 5, 6, 15, 16, 22))
    )


def _vendor_line(functions: Sequence[int], share: float, broadcasts: float, zeros: float = 0.0) -> Edge:
    def make(random: Random) -> tuple[Bus, dict[str, str]]:
        bus, units = Bus(random, 38400), random.sample(range(1, 248), 4)
        polls = [request(random, random.choice(units)) for _ in range(6)]
        for _ in range(250):
            if random.random() >= share:
                _healthy(bus, random, polls)
                continue
            function = random.choice(functions)
            quiet = random.random() < broadcasts
            unit = 0 if quiet else random.choice(units)
            bus.send("q", vendor(random, unit, function))
            if random.random() < zeros:
                bus.stray(bytes(random.randint(1, 2)))
            bus.wait(random.uniform(3, 20))
            if not quiet:
                bus.send("a", vendor(random, unit, function))
                if random.random() < zeros:
                    bus.stray(bytes(random.randint(1, 2)))
                bus.wait(random.uniform(8, 40))
        return bus, {}

    return make


_USER, _OTHER = (0x41, 0x42, 0x64), (0x29, 0x2A, 0x2D, 0x50)
edge("vendor line, user-defined functions", (*_ALL_TAPS, "gateway"))(_vendor_line(_USER, 0.9, 0.5))
edge("vendor line, functions 29h to 50h", (*_ALL_TAPS, "gateway"))(_vendor_line(_OTHER, 0.9, 0.5))
edge("vendor line, one function", _ALL_TAPS)(_vendor_line((0x41,), 0.9, 0.5))
edge("vendor line, half of it", _ALL_TAPS)(_vendor_line((*_USER, *_OTHER), 0.5, 0.2))
edge("vendor line, stray zeros", _ALL_TAPS)(_vendor_line(_USER, 0.9, 0.5, 0.5))


def cases(names: Sequence[str], seeds: int) -> Iterator[tuple[str, str, Bus, Capture, str]]:
    """Captures with class, tap and a label of each."""
    for name in names:
        make, taps, count = EDGES[name]
        for tap in taps:
            for seed in range(seeds * count):
                random = Random(f"{name} {tap} {seed}")
                bus, notes = make(random)
                yield name, tap, bus, bus.capture(tap, notes), f"{name} {tap} {seed}"


def main(arguments: list[str]) -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("classes", nargs="*", metavar="CLASS", help="words that the names of classes hold")
    parser.add_argument("--seeds", type=int, default=4)
    parser.add_argument("--misses", action="store_true", help="print each miss")
    options = parser.parse_args(arguments)
    names = [name for name in EDGES if not options.classes or any(word in name for word in options.classes)]
    tallies: defaultdict[tuple[str, str], EdgeTally] = defaultdict(EdgeTally)
    for name, tap, bus, capture, label in cases(names, options.seeds):
        score(bus, capture, tallies[name, tap], label)
    titles = ("frames", "missed", "false", "recall", "precision", "direction", "pairs")
    print(f"{'class':<66} {'tap':<8}", *(f"{title:>9}" for title in titles))
    for (name, tap), tally in tallies.items():
        shares = (
            tally.hits / max(1, tally.frames),
            tally.hits / max(1, tally.hits + tally.false),
            tally.directions / max(1, tally.hits),
            tally.paired / max(1, tally.pairs) if tally.pairs else float("nan"),
        )
        counts = tally.frames, tally.frames - tally.hits, tally.false
        low = " <" * (min(shares[:2]) < LEAST)
        print(f"{name:<66} {tap:<8}", *(f"{n:9}" for n in counts), *(f"{share:9.4f}" for share in shares), low)
    if options.misses:
        for tally in tallies.values():
            print(*tally.misses[:12], sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
