"""A line with a client and its units, in simulated time: who sends what when, and what of it reaches the line.

Times are nanoseconds. One event after the other; nobody begins while another one sends: of two at once a damaged frame
is left (`collide`, and units with a twin).
"""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import count
from random import Random

from .modbus import LONGEST, Memory, adu, crc16, refusal

MS = 1_000_000


@dataclass
class Sent:
    """A frame, or stray bytes (role `stray`), as they were sent and as they stand on the line."""

    id: int
    role: str
    whole: bytes
    line: bytes
    t_ns: int  # start of the first character
    pair: int | None = None  # the request that a response answers
    fault: str = ""  # flip, lost, added, cut, collision
    holes: dict[int, int] = field(default_factory=dict)  # silence before byte i

    @property
    def intact(self) -> bool:
        """Whether every byte of a frame is there, in its place, unchanged."""
        return self.role != "stray" and not self.fault


Spoil = Callable[[Random, bytes], tuple[bytes, str]]


def whole(_: Random, data: bytes) -> tuple[bytes, str]:
    """Nothing happens to it."""
    return data, ""


def flip(random: Random, data: bytes) -> tuple[bytes, str]:
    """One to three bits turned over, near each other."""
    octets, at = bytearray(data), random.randrange(8 * len(data) - 8)
    for bit in random.sample(range(at, at + 8), random.choice((1, 1, 2, 3))):
        octets[bit // 8] ^= 1 << bit % 8
    return bytes(octets), "flip"


def lose(random: Random, data: bytes) -> tuple[bytes, str]:
    """One to three bytes are missing inside."""
    size = min(random.choice((1, 1, 2, 3)), len(data) - 4)
    at = random.randrange(1, len(data) - size)
    return data[:at] + data[at + size :], "lost"


def add(random: Random, data: bytes) -> tuple[bytes, str]:
    """A byte or two that nobody sent, inside."""
    at = random.randrange(1, len(data))
    return data[:at] + random.randbytes(random.choice((1, 1, 2))) + data[at:], "added"


def cut(random: Random, data: bytes) -> tuple[bytes, str]:
    """The end is missing, at least one byte of it, and four bytes are left."""
    return data[: random.randrange(4, len(data))] if len(data) > 4 else data[:3], "cut"


def collide(random: Random, data: bytes) -> tuple[bytes, str]:
    """Somebody else sends at the same time: most bytes are changed."""
    return bytes(byte & random.randrange(256) if random.random() < 0.7 else byte for byte in data[:-1]), "collision"


def sometimes(share: float, *ways: Spoil) -> Spoil:
    """One of the ways, in a share of the frames."""
    return lambda random, data: random.choice(ways)(random, data) if random.random() < share else (data, "")


@dataclass
class Unit:
    """A device on the line."""

    address: int
    memory: Memory
    delay_ms: tuple[float, float] = (2.0, 8.0)
    slow: tuple[float, float, float] = (0.0, 0.0, 0.0)  # share of answers, least and most further delay in ms
    asleep: Callable[[float], bool] = lambda _: False  # by the time in seconds
    refuses: Callable[[bytes, float], int] = lambda _, __: 0  # exception code for a PDU at a time, 0 for none
    spoil: Spoil = whole
    tear: tuple[float, float, float] = (0.0, 0.0, 0.0)  # share of answers with a silence inside, least and most ms
    twin: Memory | None = None  # another device at the same address

    def answer(self, pdu: bytes, now_s: float) -> bytes:
        """The PDU of its response."""
        code = self.refuses(pdu, now_s)
        return refusal(pdu[0], code) if code else self.memory.answer(pdu)


@dataclass
class Client:
    """Who asks: polls in turn, with a timeout, retries, and a rest before each request."""

    polls: Sequence[tuple[int, Callable[[Random], bytes]]]
    timeout_ms: float = 200.0
    retries: int = 1
    rest_ms: tuple[float, float] = (4.0, 20.0)
    spoil: Spoil = whole
    deaf: bool = False  # begins without listening whether the line is free


@dataclass
class Line:
    """The line and all that was sent on it so far."""

    random: Random
    baud: int = 19200
    char_bits: int = 11
    units: dict[int, Unit] = field(default_factory=dict)
    sent: list[Sent] = field(default_factory=list)
    free_ns: int = 100 * MS
    glitch: Callable[[Random], tuple[bytes, bytes]] = lambda _: (b"", b"")  # stray bytes hard before and after

    @property
    def char_ns(self) -> float:
        """The time of a character."""
        return self.char_bits * 1e9 / self.baud

    def put(self, role: str, data: bytes, begin_ns: int, spoil: Spoil, pair: int | None = None,
            holes: dict[int, int] | None = None) -> tuple[Sent, int]:  # fmt: skip
        """Puts bytes on the line, not before it is free; what was sent, and when it ends."""
        quiet = round(3.6 * self.char_ns)
        begin = max(begin_ns, self.free_ns + quiet)
        before, after = self.glitch(self.random) if role != "stray" else (b"", b"")
        begin = self._stray(before, begin)
        told, fault = spoil(self.random, data)
        made = Sent(len(self.sent), role, data, told, begin, pair, fault, holes or {})
        self.sent.append(made)
        self.free_ns = begin + round(len(told) * self.char_ns) + sum(made.holes.values())
        end = self.free_ns
        self.free_ns = self._stray(after, end)
        return made, end

    def _stray(self, data: bytes, begin: int) -> int:
        if data:
            self.sent.append(Sent(len(self.sent), "stray", data, data, begin))
        return begin + round(len(data) * self.char_ns)

    def run(self, clients: Sequence[Client], transactions: int) -> list[Sent]:
        """Lets clients ask so many requests in all; gives what was sent, in order."""
        return _Run(self, clients, transactions).finish()


@dataclass
class _Asking:
    """A client's state: the poll at hand, tries left, the request that it waits for."""

    client: Client
    turn: int = 0
    tries: int = 0
    pdu: bytes = b""
    waits: int | None = None
    expects: tuple[int, int] = (0, 0)


class _Run:
    """Events of a run: a client begins, a unit answers, a client gives up."""

    def __init__(self, line: Line, clients: Sequence[Client], transactions: int) -> None:
        self.line, self.left, self.order = line, transactions, count()
        self.asking = [_Asking(client) for client in clients]
        self.events: list[tuple[int, int, Callable[[int], None]]] = []
        self.busy: dict[int, int] = {}
        for at, one in enumerate(self.asking):
            self.at(line.free_ns + at * 37 * MS, partial(self.ask, one))

    def at(self, when: float, what: Callable[[int], None]) -> None:
        heapq.heappush(self.events, (round(when), next(self.order), what))

    def finish(self) -> list[Sent]:
        while self.events and self.left > 0:
            when, _, what = heapq.heappop(self.events)
            what(when)
        return sorted(self.line.sent, key=lambda one: (one.t_ns, one.id))

    def ask(self, one: _Asking, now: int) -> None:
        unit, make = one.client.polls[one.turn % len(one.client.polls)]
        if not one.tries:
            one.pdu = make(self.line.random)
        self.left -= 1
        spoil = collide if one.client.deaf and now < self.line.free_ns else one.client.spoil
        request, end = self.line.put("request", adu(unit, one.pdu), now, spoil)
        one.waits, one.expects = request.id, (unit, one.pdu[0])
        if unit == 0:
            self.at(end + 100 * MS, partial(self.next, one))
            return
        self.at(end + one.client.timeout_ms * MS, partial(self.give_up, one, request.id))
        device = self.line.units.get(unit)
        if device is not None and not request.fault:
            self.hear(device, one.pdu, request, end)

    def hear(self, unit: Unit, pdu: bytes, request: Sent, end: int) -> None:
        random = self.line.random
        begin = max(end, self.busy.get(unit.address, 0))
        if unit.asleep(end / 1e9):
            return
        share, least, most = unit.slow
        delay = random.uniform(*unit.delay_ms) + (random.uniform(least, most) if random.random() < share else 0)
        self.busy[unit.address] = round(begin + delay * MS)
        self.at(begin + delay * MS, partial(self.answer, unit, pdu, request))

    def answer(self, unit: Unit, pdu: bytes, request: Sent, now: int) -> None:
        data = adu(unit.address, unit.answer(pdu, now / 1e9))
        if unit.twin is not None and unit.twin.answer(pdu) != data[1:-2]:
            mixed = _mixed(self.line.random, data, adu(unit.address, unit.twin.answer(pdu)))
            _, end = self.line.put("response", data, now, lambda *_: (mixed, "collision"), request.id)
            return
        share, least, most = unit.tear
        random, holes = self.line.random, {}
        if random.random() < share:
            holes = {random.randrange(1, len(data)): round(random.uniform(least, most) * MS)}
        response, end = self.line.put("response", data, now, unit.spoil, request.id, holes)
        for one in self.asking:
            if one.waits is not None and one.expects == (unit.address, pdu[0]) and not response.fault:
                self.at(end, partial(self.next, one))
                one.waits = None
                break

    def next(self, one: _Asking, now: int) -> None:
        one.waits, one.tries = None, 0
        one.turn += 1
        self.at(now + self.line.random.uniform(*one.client.rest_ms) * MS, partial(self.ask, one))

    def give_up(self, one: _Asking, request: int, now: int) -> None:
        if one.waits != request:
            return
        one.waits = None
        one.tries += 1
        if one.tries > one.client.retries:
            self.next(one, now)
        else:
            self.at(now + self.line.random.uniform(*one.client.rest_ms) * MS, partial(self.ask, one))


def _mixed(random: Random, one: bytes, other: bytes) -> bytes:
    """What two drivers at once leave: the address, which both send alike, then bytes of neither."""
    size = max(len(one), len(other)) + random.choice((-1, 0, 0, 1))
    both = (a & b if random.random() < 0.7 else random.randrange(256)
            for a, b in zip(one.ljust(LONGEST, b"\xff"), other.ljust(LONGEST, b"\xff"), strict=True))  # fmt: skip
    mixed = one[:2] + bytes(both)[2 : max(size, 4)]
    return mixed if crc16(mixed[:-2]) != int.from_bytes(mixed[-2:], "little") else mixed[:-1]


def wire_of(sent: Sequence[Sent], char_ns: float) -> Iterator[tuple[int, int]]:
    """Each byte on the line with the time of its last stop bit, in order."""
    for one in sent:
        now = float(one.t_ns)
        for at, byte in enumerate(one.line):
            now += char_ns + one.holes.get(at, 0)
            yield round(now), byte
