"""A half-duplex line in simulated time: clients that wait, units that answer, what a tap hears of it. Times in ns."""

from __future__ import annotations

import heapq
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import count
from random import Random
from struct import pack, unpack
from typing import Literal

from captures.chunks import Chunk
from captures.line import LineSettings
from dissectors.crc import crc_bytes, crc_ok

MS, SECOND = 1e6, 1e9
_LATEST = 7200 * SECOND
_TO_ALL = 0
_MIXED = 0.7  # of overlaid bytes are what both drivers make, the others anything
_ANSWER = 140  # bytes that a patient client has time for
Pdu = bytes | Callable[[float], bytes]
Role = Literal["request", "answer", "echo"]


def adu(unit: int, pdu: bytes) -> bytes:
    """With the unit's number and the check value."""
    body = bytes((unit,)) + pdu
    return body + crc_bytes(body)


@dataclass(eq=False, slots=True)
class OtherBurst:
    """Bytes that one device sends in a piece; `heard` is what the line makes of them."""

    begin: float
    end: float
    data: bytes
    sender: object
    role: Role
    heard: bytes


@dataclass(eq=False)
class OtherDevice:
    """A unit: when it answers and what. `deaf`: to requests (ADU, time); `tampers`: its PDUs; `seals`: its ADUs."""

    number: int
    random: Random
    delay_ns: float
    jitter: float = 0.1
    per_byte_ns: float = 0.0
    written: dict[int, int] = field(default_factory=dict)
    deaf: list[Callable[[bytes, float], bool]] = field(default_factory=list)
    tampers: list[Callable[[bytes, bytes, float], bytes | None]] = field(default_factory=list)
    seals: list[Callable[[bytes], bytes]] = field(default_factory=list)
    delays: list[Callable[[bytes, float], float]] = field(default_factory=list)
    free_ns: float = 0.0

    def value(self, address: int, now: float) -> int:
        """A register: a count, a measured value, a slow counter, zero or a setting, by its address."""
        if address in self.written:
            return self.written[address]
        drawn = (address * 2654435761 + self.number * 40503) & 0xFFFFFFFF
        kinds = (
            drawn >> 24,
            int(1000 + 300 * math.sin(now / SECOND / (5 + drawn % 50)) + self.random.gauss(0, 3)),
            int(drawn % 5000 + now / SECOND * (1 + drawn % 9) / 3),
            0,
            drawn >> 8,
        )
        return kinds[drawn % 5] & 0xFFFF

    def answer(self, pdu: bytes, now: float) -> bytes:
        """The PDU of its answer."""
        function, address, quantity = pdu[0], *unpack(">HH", pdu[1:5])
        if function in (1, 2):
            bits = (self.value(address + i, now) & 0xFF for i in range((quantity + 7) // 8))
            return bytes((function, (quantity + 7) // 8, *bits))
        if function in (3, 4):
            words = (self.value(address + i, now) for i in range(quantity))
            return bytes((function, 2 * quantity)) + b"".join(pack(">H", word) for word in words)
        self.written[address] = quantity
        return pdu[:5]


@dataclass(eq=False)
class OtherPoll:
    """One entry of a client's list."""

    unit: int
    pdu: Pdu
    period_s: float = 1.0

    def made(self, now: float) -> bytes:
        """Its PDU at a time."""
        return self.pdu(now) if callable(self.pdu) else self.pdu


@dataclass(eq=False)
class OtherClient:
    """A client and its habits. `ears`: what it makes of what it hears; `lost`: requests in vain, for it."""

    polls: list[OtherPoll]
    by_timers: bool
    gap_ns: float
    gap_jitter: float
    rest_ns: float
    timeout_ns: float
    retries: int
    at_once: bool = True  # asks again at once, not when its list comes round
    hasty: bool = False  # goes on when it hears rubbish
    skips: int = 0  # rounds without a unit that did not answer
    listens: bool = True
    begin_ns: float = 0.1 * SECOND
    ears: list[Callable[[bytes], bytes]] = field(default_factory=list)
    asked: int = 0
    lost: int = 0
    due: list[float] = field(default_factory=list)
    turn: int = 0
    rested: bool = False
    left_out: dict[int, int] = field(default_factory=dict)
    waits: Callable[[bytes, float], None] | None = None


class OtherBus:
    """The line with all that was sent on it; it runs until so many requests were made."""

    def __init__(self, random: Random, devices: Sequence[OtherDevice], baud: int, requests: int) -> None:
        self.random, self.requests, self.made = random, requests, 0
        self.parity = random.choice("NNE")
        self.bits = 10 + (self.parity != "N")
        self.baud, self.char_ns = baud, self.bits * 1e9 / baud
        self.rest_ns = max(3.5 * self.char_ns, 1.75 * MS)
        self.devices = {device.number: device for device in devices}
        self.twins: list[OtherDevice] = []
        self.askers: list[OtherClient] = []
        self.spells: list[OtherBurst] = []
        self.spoils: list[Callable[[OtherBurst], bytes]] = []
        self.strays: list[tuple[float, int]] = []
        self.finish: list[Callable[[], None]] = []  # what becomes of the spells before a tap hears them
        self.taps: list[Callable[[list[tuple[float, int]]], list[tuple[float, int]]]] = []
        self.echoes = False
        self._events: list[tuple[float, int, Callable[[float], None]]] = []
        self._order = count()

    @property
    def share(self) -> float:
        """The part of all requests that was made."""
        return self.made / self.requests

    def run(self) -> None:
        """Lets all clients ask."""
        for asker in self.askers:
            self._at(asker.begin_ns, lambda now, asker=asker: self._next(asker, now))  # type: ignore[misc]
        while self._events and self.made < self.requests + 3:
            now, _, what = heapq.heappop(self._events)
            if now > _LATEST:
                break
            what(now)
        for finish in self.finish:
            finish()

    def _at(self, when: float, what: Callable[[float], None]) -> None:
        heapq.heappush(self._events, (when, next(self._order), what))

    def _send(self, now: float, data: bytes, sender: object, role: Role) -> OtherBurst:
        spell = OtherBurst(now, now + len(data) * self.char_ns, data, sender, role, data)
        for spoil in self.spoils:
            spell.heard = spoil(spell)
        self.spells.append(spell)
        self._at(spell.end, lambda end: self._deliver(spell, end))
        if role == "request" and self.echoes:
            self._send(spell.end + 0.2 * self.char_ns, spell.heard, sender, "echo")
        return spell

    def _deliver(self, spell: OtherBurst, now: float) -> None:
        met = any(each is not spell and each.begin < spell.end and each.end > spell.begin for each in self.spells[-8:])
        data = b"" if met else spell.heard
        if spell.role == "request":
            for device in (*self.devices.values(), *self.twins):
                self._hear(device, data, now)
        if spell.role == "answer":
            for asker in self.askers:
                if asker.waits is not None:
                    asker.waits(data, now)

    def _hear(self, device: OtherDevice, data: bytes, now: float) -> None:
        if len(data) < 4 or not crc_ok(data) or data[0] not in (device.number, _TO_ALL):
            return
        if True in [deaf(data, now) for deaf in device.deaf]:  # each takes note of what it hears
            return
        pdu = data[1:-2]
        answer: bytes | None = device.answer(pdu, now)
        for tamper in device.tampers:
            answer = None if answer is None else tamper(pdu, answer, now)
        if answer is None or data[0] == _TO_ALL:
            return
        delay = device.delay_ns * (1 + abs(device.random.gauss(0, device.jitter))) + device.per_byte_ns * len(answer)
        for other in device.delays:
            delay = other(pdu, delay)
        sent = adu(device.number, answer)
        for seal in device.seals:
            sent = seal(sent)
        self._at(max(now + max(delay, self.rest_ns), device.free_ns), lambda begin: self._speak(device, sent, begin))

    def _speak(self, device: OtherDevice, data: bytes, now: float) -> None:
        device.free_ns = now + len(data) * self.char_ns
        if data:
            self._send(now, data, device, "answer")

    def _next(self, asker: OtherClient, now: float) -> None:
        if self.made >= self.requests:
            return
        poll = self._due(asker, now)
        if poll is None:
            return
        if asker.left_out.get(poll.unit, 0):
            asker.left_out[poll.unit] -= 1
            if all(asker.left_out.get(each.unit, 0) for each in asker.polls):
                asker.left_out.clear()
            self._at(now + 0.05 * MS, lambda t: self._next(asker, t))
            return
        self._ask(asker, poll.unit, poll.made(now), 0, now)

    def _due(self, asker: OtherClient, now: float) -> OtherPoll | None:
        """What comes next; None where the client comes back later."""
        if not asker.by_timers:
            if asker.turn and asker.turn % len(asker.polls) == 0 and asker.rest_ns and not asker.rested:
                asker.rested = True
                self._at(now + asker.rest_ns, lambda t: self._next(asker, t))
                return None
            asker.rested = False
            asker.turn += 1
            return asker.polls[(asker.turn - 1) % len(asker.polls)]
        asker.due = asker.due or [asker.begin_ns + i * asker.gap_ns for i in range(len(asker.polls))]
        first = min(range(len(asker.polls)), key=asker.due.__getitem__)
        if asker.due[first] > now:
            self._at(asker.due[first], lambda t: self._next(asker, t))
            return None
        asker.due[first] = max(asker.due[first] + asker.polls[first].period_s * SECOND, now - 5 * SECOND)
        return asker.polls[first]

    def _ask(self, asker: OtherClient, unit: int, pdu: bytes, tries: int, now: float) -> None:
        busy = max((each.end for each in self.spells[-6:] if each.begin <= now < each.end), default=0.0)
        if asker.listens and busy:
            begin = busy + self.rest_ns + self.random.random() * MS
            self._at(begin, lambda t: self._ask(asker, unit, pdu, tries, t))
            return
        self.made += 1
        spell = self._send(now, adu(unit, pdu), asker, "request")
        pause = asker.gap_ns * (1 + abs(self.random.gauss(0, asker.gap_jitter)))
        if unit == _TO_ALL:
            self._at(spell.end + max(pause, 30 * MS), lambda t: self._next(asker, t))
            return
        asker.asked += 1

        def over(when: float, *, good: bool) -> None:
            if asker.waits is not take:
                return
            asker.waits = None
            asker.lost += not good
            if not good and tries < asker.retries and asker.at_once:
                self._at(when + pause / 2, lambda t: self._ask(asker, unit, pdu, tries + 1, t))
                return
            if not good and asker.skips:
                asker.left_out[unit] = asker.skips
            self._at(when + pause, lambda t: self._next(asker, t))

        def take(data: bytes, when: float) -> None:
            for ear in asker.ears:
                data = ear(data)
            right = len(data) >= 4 and crc_ok(data)
            if right and data[0] == unit and data[1] & 0x7F == pdu[0]:
                over(when, good=True)
            elif not right and asker.hasty:
                over(when + self.rest_ns, good=False)

        asker.waits = take
        self._at(spell.end + asker.timeout_ns, lambda t: over(t, good=False))

    def heard(self) -> list[tuple[float, int]]:
        """The end of each byte on the line, in order; of two at once something is left."""
        every = [
            (spell.begin + (i + 1) * self.char_ns, byte) for spell in self.spells for i, byte in enumerate(spell.heard)
        ]
        found: list[tuple[float, int]] = []
        for t, byte in sorted((*every, *self.strays)):
            if found and t - found[-1][0] < 0.95 * self.char_ns:
                both = found[-1][1] & byte if self.random.random() < _MIXED else self.random.randrange(256)
                found[-1] = found[-1][0], both
            else:
                found.append((t, byte))
        for tap in self.taps:
            found = tap(found)
        return found

    def chunks(self, tap: str) -> Iterator[Chunk]:
        """As a kind of tap hands them over."""
        begin, latest = 1_790_000_000 * 10**9, 0
        for t, data in _TAPS[tap](self.heard(), self.random, self.char_ns):
            latest = max(latest + 1, int(t))
            yield Chunk(begin + latest, data)

    def settings(self, tap: str) -> LineSettings:
        """What a capture says of the line."""
        return LineSettings(self.baud, self.bits, self.parity, 1, tap)


Octets = list[tuple[float, int]]
Reads = Iterator[tuple[float, bytes]]


def _each(octets: Octets, random: Random, _: float) -> Reads:
    yield from ((t + random.randrange(3000), bytes((byte,))) for t, byte in octets)


def _by_silence(octets: Octets, silence: float) -> Iterator[Octets]:
    first = 0
    for i in range(1, len(octets) + 1):
        if i == len(octets) or octets[i][0] - octets[i - 1][0] > silence:
            yield octets[first:i]
            first = i


def _fifo(octets: Octets, random: Random, char_ns: float) -> Reads:
    for part in _by_silence(octets, 4 * char_ns):
        for i in range(0, len(part), 8):
            some = part[i : i + 8]
            late = 0.0 if len(some) == 8 else 4 * char_ns
            yield some[-1][0] + late + random.randrange(80_000), bytes(byte for _, byte in some)


def _usb(octets: Octets, random: Random, _: float) -> Reads:
    """A latency timer of 16 ms, packets of up to 62 bytes."""
    phase, held = random.randrange(16_000_000), Octets()
    for t, byte in (*octets, (math.inf, 0)):
        tick = 0 if not held else (held[0][0] + phase) // (16 * MS) + 1
        if held and (t + phase >= tick * 16 * MS or len(held) == 62):
            yield tick * 16 * MS - phase + random.randrange(200_000), bytes(each for _, each in held)
            held = []
        held.append((t, byte))


def _network(octets: Octets, random: Random, _: float) -> Reads:
    now = 0.0
    for part in _by_silence(octets, 5 * MS):
        now = max(now, part[-1][0] + random.expovariate(1 / (15 * MS)))
        yield now, bytes(byte for _, byte in part)


_TAPS: dict[str, Callable[[Octets, Random, float], Reads]] = {
    "precise": _each, "irq": _fifo, "ftdi16": _usb, "gateway": _network,
}  # fmt: skip


def patience(line: OtherBus, devices: Sequence[OtherDevice]) -> float:
    """A timeout (ns) that no answer of these units is late for."""
    slowest = max(each.delay_ns * (1 + 3 * each.jitter) + 150 * each.per_byte_ns for each in devices)
    return 1.5 * slowest + _ANSWER * line.char_ns
