"""A site drawn by chance: a line, its client's list, its units; a case does its harm to it and lets it run.

Everything that may differ from site to site does: speed and parity, how many units and how fast, what is polled and how
often, timeouts, retries and pauses, how long the capture is and that it begins in the middle.
"""

from __future__ import annotations

import struct
from array import array
from bisect import bisect_left
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from random import Random
from typing import Any

import captures

from ..taps import TAPS, with_errors
from .master import FieldMaster, FieldPoll, FieldRequest, Manners
from .units import ASCII, MS, FieldUnit
from .wire import FieldWire, LineUart, Pulse, ReceivedOctet, Schedule, TapEnd

SECOND = 1e9
_BAUDS = (1200, 2400, 4800, 9600, 9600, 9600, 19200, 19200, 38400, 57600, 115200)
_PARITIES = ("N", "N", "E", "E", "O")
_SLOW = 9600  # bit/s, at which a cycle may take all the time there is
_RESTS = 14  # characters
_REQUESTS = 1500  # about: a site's capture is no longer than these take


@dataclass(frozen=True, slots=True)
class Expected:
    """What an analysis of a case should say first: a cause (None: nothing at all; empty: something is wrong that has no
    word) and one of these units, if any are named; `also` are other causes that are true of it, `beside` is another
    fault, of which either may come first."""

    cause: str | None
    units: tuple[int, ...] = ()
    also: tuple[str, ...] = ()
    beside: Expected | None = None


@dataclass(frozen=True, slots=True)
class FieldCapture:
    """What a tap delivered, and what the clients know about their requests."""

    line: captures.LineSettings
    chunks: list[captures.Chunk]
    expected: Expected
    requests: list[FieldRequest]
    begin_ns: float
    end_ns: float
    epoch_ns: int = 0  # of the capture's clock, where the times of requests begin at 0

    def lost(self) -> list[FieldRequest]:
        """Requests within the capture that got no answer that their client took."""
        return [one for one in self.requests if one.result == "lost" and self.begin_ns < one.end < self.end_ns]


@dataclass
class Bench:
    """One site."""

    random: Random
    tap_name: str
    uart: LineUart
    schedule: Schedule
    wire: FieldWire
    units: dict[int, FieldUnit]
    master: FieldMaster
    masters: list[FieldMaster]
    duration_ns: float
    begin_ns: float
    header: dict[str, Any] = field(default_factory=dict)
    marks_errors: bool = True
    tapped: Callable[[list[ReceivedOctet]], list[ReceivedOctet]] = lambda octets: octets  # what the adapter makes of it
    epoch_ns: int = 0
    most_requests: int | None = None  # behind so many in the capture the recorder is switched off

    def unit(self, *, asked: int = 1) -> FieldUnit:
        """One of the units, which the client asks for so many things at least."""
        fit = [u for u in self.units if sum(poll.unit == u for poll in self.master.polls) >= asked]
        return self.units[self.random.choice(sorted(fit or self.units))]

    def clock(self) -> float:
        """A moment within the capture, ns."""
        return self.begin_ns + self.random.random() * (self.duration_ns - self.begin_ns)

    def pulses(self, pulses: Sequence[Pulse]) -> None:
        """Induce these besides those that are."""
        self.wire.pulses = sorted([*self.wire.pulses, *pulses])
        self.wire.longest_pulse = max((each.end - each.begin for each in self.wire.pulses), default=0.0)

    def run(self, expected: Expected) -> FieldCapture:
        """Let it run, and tap it."""
        for master in self.masters:
            master.start(0.05 * SECOND + self.random.random() * 0.3 * SECOND)
        self.schedule.run(self.duration_ns)
        self.wire.finish(self.duration_ns)
        requests = [request for master in self.masters for request in master.requests]
        ends = sorted(request.end for request in requests if request.end > self.begin_ns)
        if self.most_requests is not None and self.most_requests < len(ends):
            self.duration_ns = ends[self.most_requests] - 2 * self.uart.char_ns
        return FieldCapture(
            captures.LineSettings(**self.header),
            list(self._chunks()),
            expected,
            requests,
            self.begin_ns,
            self.duration_ns,
            self.epoch_ns,
        )

    def speak_ascii(self) -> None:
        """Everybody speaks Modbus ASCII, of seven data bits."""
        self.uart = replace(self.uart, data_bits=7, parity="E")
        self.header["char_bits"] = self.uart.char_bits
        if "parity" in self.header:
            self.header["parity"] = "E"
        self.wire.uart = self.master.uart = self.uart
        self.wire.taps = [TapEnd(self.uart)]
        self.master.envelope = ASCII
        self.master.manners.timeout_ms += 250 * self.uart.char_ns / MS  # two digits a byte
        for unit in self.units.values():
            unit.uart = unit.sends = self.uart
            unit.envelope = ASCII

    def _chunks(self) -> list[captures.Chunk]:
        chunks: list[captures.Chunk] = []
        for port, tap in enumerate(self.wire.taps):
            stream = self.tapped(tap.recorded)
            ends = [octet.t_ns for octet in stream]
            low, high = bisect_left(ends, self.begin_ns), bisect_left(ends, self.duration_ns)
            part = stream[low:high]
            data = bytes(octet.value for octet in part)
            times = array("d", (octet.t_ns + self.epoch_ns for octet in part))
            errors = [i for i, octet in enumerate(part) if octet.error] if self.marks_errors else []
            character = tap.uart.char_ns
            delivered = TAPS[self.tap_name].deliver(data, times, self.random, character)
            damaged = with_errors(delivered, errors)
            chunks += [replace(chunk, port=port) for chunk in damaged] if port else damaged
        return sorted(chunks, key=lambda chunk: chunk.t_ns)


def site(
    random: Random,
    tap: str,
    *,
    units: tuple[int, int] = (2, 9),
    bauds: Sequence[int] = _BAUDS,
    seconds: tuple[float, float] = (20, 600),
    parities: Sequence[str] = _PARITIES,
) -> Bench:
    """A healthy site; a case narrows what it needs."""
    uart = LineUart(random.choice(bauds), 8, random.choice(parities), 1)
    if uart.parity == "N" and random.random() < 0.3:
        uart = LineUart(uart.baud, 8, "N", 2)
    schedule = Schedule()
    wire = FieldWire(random, schedule, uart)
    wire.contention = random.choice(("low", "strong", "random"))
    numbers = random.sample(range(1, 248 if random.random() < 0.2 else 40), random.randint(*units))
    servers = {number: FieldUnit(number, uart, wire, random) for number in sorted(numbers)}
    polls = _polls(random, uart, list(servers))
    slowest = max(server.delay_ms for server in servers.values())
    manners = _manners(random, uart, slowest, polls)
    master = FieldMaster(uart, wire, random, polls, manners)
    duration = min(random.uniform(*seconds), max(seconds[0], _REQUESTS * _usual_seconds(uart, manners, slowest, polls)))
    header = {"baud": int(uart.baud), "char_bits": uart.char_bits, "tap": tap}
    if random.random() < 0.4:
        header["parity"], header["stop_bits"] = uart.parity, uart.stop_bits
    begin = random.choice((0.0, 0.0, random.uniform(0, 0.1) * duration * SECOND))
    bench = Bench(
        random, tap, uart, schedule, wire, servers, master, [master], duration * SECOND + begin, begin, header
    )
    bench.marks_errors = random.random() < 0.6
    bench.epoch_ns = random.choice((0, 0, 1_760_000_000_000_000_000 + random.randrange(10**16)))
    return bench


def longest_answer_ms(uart: LineUart) -> float:
    """More than any answer that a site's clients ask for takes on the line."""
    return 140 * uart.char_ns / MS


def _manners(random: Random, uart: LineUart, slowest_ms: float, polls: Sequence[FieldPoll]) -> Manners:
    least = 4 * slowest_ms + longest_answer_ms(uart)
    base = random.choice((0.0, 2.0, 5.0, 10.0, 20.0, 50.0))
    spread = random.choice((0.0, 0.1, 0.5))
    cycle = random.choice((0.0, 0.0, 500.0, 1000.0, 2000.0))
    char_ms = uart.char_ns / MS
    if not cycle or uart.baud < _SLOW:  # a client whose line is not full rests a little between its polls
        base = max(base, random.uniform(8, 20) * char_ms)
    elif sum(_characters(poll) for poll in polls if not poll.period_ns) * char_ms > cycle:
        base = max(base, _RESTS * char_ms)  # no round of all of them is over by then
    return Manners(
        timeout_ms=max(least, random.choice((100.0, 200.0, 250.0, 500.0, 1000.0))),
        retries=random.choice((0, 1, 1, 2, 3)),
        pause_ms=lambda _: base * (1 + spread * random.random()),
        cycle_ms=cycle,
        turnaround_ms=random.choice((100.0, 120.0, 150.0, 200.0)),
        on_bad=random.choice(("wait", "wait", "again")),
    )


def _characters(poll: FieldPoll) -> int:
    """Of a request, its answer and the silences around them."""
    pdu = poll.pdu(0.0)
    quantity = int.from_bytes(pdu[3:5])
    held = (quantity + 7) // 8 if pdu[0] <= 2 else 2 * quantity if pdu[0] <= 4 else 3
    return len(pdu) + held + 15


def _usual_seconds(uart: LineUart, manners: Manners, delay_ms: float, polls: Sequence[FieldPoll]) -> float:
    one = 45 * uart.char_ns / MS + 0.6 * delay_ms + manners.pause_ms(0)
    return max(one, manners.cycle_ms / max(len(polls), 1)) / 1e3


def read_pdu(function: int, address: int, quantity: int) -> Callable[[float], bytes]:
    """A read."""
    pdu = struct.pack(">BHH", function, address, quantity)
    return lambda _: pdu


def write_pdu(random: Random, function: int, address: int, quantity: int = 1) -> Callable[[float], bytes]:
    """A write whose values change."""

    def pdu(_: float) -> bytes:
        if function == 5:
            return struct.pack(">BHH", 5, address, random.choice((0, 0xFF00)))
        if function == 6:
            return struct.pack(">BHH", 6, address, random.randrange(2000))
        values = [random.randrange(2000) for _ in range(quantity)]
        return struct.pack(f">BHHB{quantity}H", 16, address, quantity, 2 * quantity, *values)

    return pdu


def _polls(random: Random, uart: LineUart, numbers: Sequence[int]) -> list[FieldPoll]:
    longest = 60 if uart.baud >= 9600 else 24
    alike = random.random() < 0.5  # sister units, asked for the same things
    shapes = [_shapes(random, longest) for _ in range(1 if alike else len(numbers))]
    polls = []
    for i, number in enumerate(numbers):
        polls += [FieldPoll(number, pdu) for pdu in shapes[i % len(shapes)]]
    order = random.random()
    if order < 0.3:
        random.shuffle(polls)
    if random.random() < 0.25:
        function = random.choice((5, 6, 16))
        pdu = write_pdu(random, function, random.randrange(200), random.randint(1, 4))
        polls.append(FieldPoll(random.choice(list(numbers)), pdu, random.uniform(2, 9) * SECOND))
    return polls


def _shapes(random: Random, longest: int) -> list[Callable[[float], bytes]]:
    at, pdus = random.choice((0, 0, 1, 100, 256, 1000, 3000, 30000)), []
    for _ in range(random.choice((1, 1, 2, 2, 3, 4))):
        function = random.choice((3, 3, 3, 4, 4, 1, 2))
        quantity = random.choice((1, 2, 2, 4, 6, 8, 10, 16, 20, 32, longest))
        quantity = min(quantity, longest) * (4 if function <= 2 else 1)
        pdus.append(read_pdu(function, at, quantity))
        at += quantity + random.choice((8, 40, 200))
    return pdus
