"""Buses drawn for who answers whom: a client's round of polls, units with habits, and which request each answer is of.

Units answer in the order in which they were asked, slowly now and then. A unit may queue requests, flush what it was
asked when the next request comes, drop some, be late once, or answer twice; the client waits for its timeout, asks
again or goes on, and takes what fits the newest request for its answer.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from random import Random
from typing import Final, NamedTuple

from analyzer.simulation import TAPS
from captures import Capture, Chunk, LineSettings
from dissectors.crc import crc_bytes

HABITS: Final = ("queue", "queue", "queue", "late", "twice", "twice", "flush", "drop", "well")
_MS: Final = 1e6
_READ_FUNCTIONS: Final = (3, 3, 4)


@dataclass(slots=True)
class _Poll:
    """A request of the round, and the words that it reads."""

    unit: int
    adu: bytes
    words: list[float]
    steps: list[float]  # 0: constant

    def answer(self, random: Random) -> bytes:
        """The answer as the words are by now; they move on."""
        for i, step in enumerate(self.steps):
            if step and random.random() < 0.8:
                self.words[i] += random.gauss(0, step)
        data = b"".join((round(word) & 0xFFFF).to_bytes(2) for word in self.words)
        body = self.adu[:2] + bytes([len(data)]) + data
        return body + crc_bytes(body)


class TruePair(NamedTuple):
    """An answer, the request that it is of, and the one as whose the client stores it (None: no other)."""

    start: int
    request: int
    taken_for: int | None
    alike: bool  # the round has several polls that hold the same


@dataclass(slots=True)
class DrawnRound:
    """A capture and the truth about it."""

    capture: Capture
    pairs: list[TruePair]
    habit: str
    moving: str
    tap: str


class _Answering(NamedTuple):
    ready_ns: float
    adu: bytes
    request: int
    poll: int


@dataclass(slots=True)
class _Unit:
    """How one unit answers."""

    habit: str
    latency_ns: float
    timeout_ns: float
    often: float  # of a trouble, a request
    queue: list[_Answering] = field(default_factory=list)
    busy_ns: float = 0.0

    def ask(self, random: Random, now_ns: float, poll: int, request: int, adu: bytes) -> None:
        """A request came in."""
        trouble = random.random() < self.often
        latency = self.latency_ns * random.uniform(0.7, 1.4)
        if self.habit == "flush":
            self.queue = [each for each in self.queue if each.ready_ns <= now_ns]
            self.busy_ns = now_ns
        if self.habit == "drop" and trouble:
            return
        if self.habit in ("queue", "late", "flush") and trouble:
            latency = self.timeout_ns * random.uniform(1.02, 1.9 if self.habit == "queue" else 1.5)
        begin = max(now_ns, self.busy_ns) if self.habit != "well" else now_ns
        ready = begin + latency
        self.busy_ns = ready
        self.queue.append(_Answering(ready, adu, request, poll))
        if self.habit == "twice" and trouble:
            again = ready + self.latency_ns * random.uniform(0.05, 3)
            self.queue.append(_Answering(again, adu, request, poll))
            self.busy_ns = again


@dataclass(slots=True)
class _Wire:
    """Frames on the wire."""

    char_ns: float
    now_ns: float = 1e9
    data: bytearray = field(default_factory=bytearray)
    times: list[float] = field(default_factory=list)  # end of each byte

    def send(self, adu: bytes, at_ns: float) -> int:
        """Send a frame at a time, or as soon as the wire is free; where it begins."""
        start = len(self.data)
        begin = max(at_ns, self.now_ns + 4 * self.char_ns)
        self.times += [begin + (i + 1) * self.char_ns for i in range(len(adu))]
        self.data += adu
        self.now_ns = self.times[-1]
        return start


def _polls(random: Random, moving: str, *, equal: bool, units: Sequence[int], count: int) -> list[_Poll]:
    size, polls = random.randint(1, 20), []
    level = random.uniform(100, 60000)
    base = [random.uniform(100, 60000) for _ in range(40)]
    for i in range(count):
        words = size if equal or random.random() < 0.3 else random.randint(1, 24)
        unit = random.choice(units)
        body = (
            bytes((unit, random.choice(_READ_FUNCTIONS) if not equal else 3))
            + (i * 100).to_bytes(2)
            + words.to_bytes(2)
        )
        if moving == "alike":
            values, steps = [level] * words, [0.0] * words
        elif moving == "sisters":
            values = [base[w] * random.uniform(0.97, 1.03) for w in range(words)]
            steps = [abs(value) * 0.002 * random.random() for value in values]
        else:
            values = [random.choice((0, random.uniform(0, 300), random.uniform(0, 65535))) for _ in range(words)]
            constant = moving == "constant"
            steps = [
                0.0 if constant or random.random() < 0.4 else abs(value) * 0.02 * random.random() for value in values
            ]
        polls.append(_Poll(unit, body + crc_bytes(body), values, steps))
    return polls


MOVING: Final = ("moving", "moving", "constant", "sisters", "alike")


def drawn(seed: int, most: int | None = None) -> DrawnRound:
    """The bus of this seed; at most about so many answers."""
    random = Random(f"who answers whom {seed}")
    habit, moving = random.choice(HABITS), random.choice(MOVING)
    tap = random.choice(sorted(TAPS))
    baud = random.choice((9600, 19200, 38400))
    char_ns = 11e9 / baud
    units = random.sample(range(1, 100), random.randint(1, 4))
    polls = _polls(random, moving, equal=random.random() < 0.5, units=units, count=random.randint(3, 40))
    timeout = random.choice((50, 100, 200, 500, 1000)) * _MS
    slowly = habit in ("queue", "late", "twice") and random.random() < 0.7
    latency = timeout * (random.uniform(0.1, 0.7) if slowly else random.uniform(0.02, 0.4))
    often = random.choice((0.003, 0.01, 0.03))
    slow = random.sample(units, max(1, round(len(units) * random.random())))
    servers = {
        unit: _Unit(habit if unit in slow else "well", latency, timeout, often if unit in slow else 0.0)
        for unit in units
    }
    pause = timeout * random.choice((0.005, 0.02, 0.1) if slowly else (0.01, 0.05, 0.3))
    rest = timeout * random.choice((0, 0, 0, 5) if slowly else (0, 0, 5))
    most = most or random.choice((150, 400, 800))
    polls = polls[: max(3, most // 6)]
    retries = random.choice((0, 0, 1, 2))
    pairs = _talk(random, _Wire(char_ns), polls, servers, (timeout, pause, rest), retries=retries, most=most)
    return _made(random, pairs, (habit, moving, tap), baud)


class _Talk(NamedTuple):
    wire: _Wire
    pairs: list[TruePair]


def _talk(
    random: Random,
    wire: _Wire,
    polls: list[_Poll],
    servers: dict[int, _Unit],
    waits: tuple[float, float, float],
    retries: int,
    most: int,
) -> _Talk:
    timeout, pause, rest = waits
    pairs: list[TruePair] = []
    answers = 0
    while answers < most:
        for number, poll in enumerate(polls):
            for _ in range(1 + retries):
                request = wire.send(poll.adu, wire.now_ns + pause)
                asked_ns = wire.now_ns
                servers[poll.unit].ask(random, asked_ns, number, request, poll.answer(random))
                good = False
                for taken, told in _heard(wire, servers, asked_ns + timeout):
                    fits = not good and told[:3] == poll.adu[:2] + bytes([2 * len(poll.words)])
                    pairs.append(TruePair(taken[0], taken[1], request if fits and taken[1] != request else None, False))
                    answers += 1
                    if fits:
                        good = True
                        break
                if good:
                    break
            for taken, _ in _heard(wire, servers, wire.now_ns + pause, idle=True):
                pairs.append(TruePair(taken[0], taken[1], None, False))
                answers += 1
        if rest:
            for taken, _ in _heard(wire, servers, wire.now_ns + rest, idle=True):
                pairs.append(TruePair(taken[0], taken[1], None, False))
            wire.now_ns += rest
    return _Talk(wire, pairs)


def _heard(
    wire: _Wire, servers: dict[int, _Unit], until_ns: float, *, idle: bool = False
) -> Iterator[tuple[tuple[int, int], bytes]]:
    """Answers that begin by then: where each begins and its request's start, and its bytes."""
    while True:
        first = min((each.queue[0] for each in servers.values() if each.queue), default=None)
        if first is None or first.ready_ns > until_ns:
            if not idle:
                wire.now_ns = max(wire.now_ns, until_ns)
            return
        for server in servers.values():
            if server.queue and server.queue[0] is first:
                server.queue.pop(0)
        yield (wire.send(first.adu, first.ready_ns), first.request), first.adu


def _made(random: Random, talk: _Talk, drawn_as: tuple[str, str, str], baud: int) -> DrawnRound:
    from array import array

    wire = talk.wire
    habit, moving, tap = drawn_as
    chunks: list[Chunk] = list(TAPS[tap].deliver(bytes(wire.data), array("d", wire.times), random, wire.char_ns))
    capture = Capture.of(LineSettings(baud=baud, char_bits=11), chunks, timed=tap != "untimed")
    return DrawnRound(capture, talk.pairs, habit, moving, tap)
