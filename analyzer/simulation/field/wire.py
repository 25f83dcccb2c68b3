"""The pair of wires in simulated time: who drives it, and what each receiver's UART makes of it.

A line is at 1 (mark) when it rests. A character is a start bit at 0, data bits least significant first, parity if
any, stop bits at 1. A receiver waits for a falling edge and then samples the middle of each bit by its own clock.

A sender drives the line from `on` to `off`, which need not be the time that its characters take: a driver may be
enabled late, released early or held on. Where two drive, one of them wins, or the line is anybody's guess. Where nobody
drives, bias resistors hold the line at rest; without them it follows whatever is induced. Pulses are induced from
outside and may be stronger than a driver. Reflections bend what far senders send.

What a clean stretch gives to a receiver with the sender's settings is known without looking at its bits; all other
stretches are composed of levels and read bit by bit.
"""

from __future__ import annotations

import heapq
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import count
from random import Random
from typing import Literal, NamedTuple, Protocol


class Schedule:
    """Actions in order of their times (ns); `now` is the time of the one that runs."""

    def __init__(self) -> None:
        self.now = 0.0
        self._order = count()
        self._waiting: list[tuple[float, int, Callable[[float], None]]] = []

    def at(self, t: float, action: Callable[[float], None]) -> None:
        """Run `action(t)` then; at once, where that time has passed."""
        heapq.heappush(self._waiting, (max(t, self.now), next(self._order), action))

    def run(self, until: float) -> None:
        """Run all that is due before `until`."""
        while self._waiting and self._waiting[0][0] < until:
            self.now, _, action = heapq.heappop(self._waiting)
            action(self.now)


@dataclass(frozen=True, slots=True)
class LineUart:
    """Settings of a UART; `inverted`: A and B are swapped at it."""

    baud: float
    data_bits: int = 8
    parity: str = "N"
    stop_bits: int = 1
    inverted: bool = False
    bit_ns: float = field(init=False, repr=False, compare=False)
    char_ns: float = field(init=False, repr=False, compare=False)
    silence_ns: float = field(init=False, repr=False, compare=False)  # t3.5: fixed above 19200 bit/s ([2] 2.5.1.1)

    def __post_init__(self) -> None:
        """What is asked for each character, known once."""
        bit = 1e9 / self.baud
        character = self.char_bits * bit
        silence = 3.5 * character if self.baud <= 19200 else max(1.75e6, 3.5 * character)
        for name, value in (("bit_ns", bit), ("char_ns", character), ("silence_ns", silence)):
            object.__setattr__(self, name, value)

    @property
    def char_bits(self) -> int:
        """Bits of a character as it is sent."""
        return 1 + self.data_bits + (self.parity != "N") + self.stop_bits

    def bits(self, byte: int) -> list[int]:
        """The levels of one character, a bit each."""
        data = [byte >> i & 1 for i in range(self.data_bits)]
        parity = [] if self.parity == "N" else [self._parity(sum(data))]
        return [0, *data, *parity, *[1] * self.stop_bits]

    def _parity(self, ones: int) -> int:
        return {"E": ones & 1, "O": ~ones & 1, "M": 1, "S": 0}[self.parity]

    def right_parity(self, value: int, bit: int) -> bool:
        """Whether the parity bit fits the data."""
        return self.parity == "N" or bit == self._parity(value.bit_count())


class LineSignal:
    """Levels over time: it rests at `rest` and has the level `levels[i]` from `times[i]` (ns) on."""

    def __init__(self, times: Sequence[float] = (), levels: Sequence[int] = (), rest: int = 1) -> None:
        self.times = list(times)
        self.levels = list(levels)
        self.rest = rest

    def at(self, t: float) -> int:
        """The level at a time."""
        i = bisect_right(self.times, t) - 1
        return self.levels[i] if i >= 0 else self.rest

    def next_to(self, level: int, t: float) -> float | None:
        """When the line goes to this level next, at `t` or later."""
        i = bisect_left(self.times, t)
        before = self.levels[i - 1] if i else self.rest
        for at in range(i, len(self.times)):
            if self.levels[at] == level != before:
                return self.times[at]
            before = self.levels[at]
        return None


class ReceivedOctet(NamedTuple):
    """A byte as a receiver has it: when its stop bit ended (ns), its value, whether parity or stop bit were wrong."""

    t_ns: float
    value: int
    error: bool


def waveform(uart: LineUart, data: bytes, starts: Sequence[float]) -> tuple[list[float], list[int]]:
    """Times and levels of these characters, each begun at its time."""
    times: list[float] = []
    levels: list[int] = []
    level = 1
    for byte, start in zip(data, starts, strict=True):
        for i, bit in enumerate(uart.bits(byte)):
            if bit != level:
                times.append(start + i * uart.bit_ns)
                levels.append(bit)
                level = bit
    if uart.inverted:
        return times, [1 - bit for bit in levels]
    return times, levels


def receive(signal: LineSignal, uart: LineUart, begin: float, end: float) -> list[ReceivedOctet]:
    """What a receiver makes of a signal between two times; a character begun by then is read to its end."""
    bit = uart.bit_ns
    received: list[ReceivedOctet] = []
    mark = 0 if uart.inverted else 1
    t = begin
    while True:
        start = signal.next_to(1 - mark, t)
        if start is None or start >= end:
            return received
        if signal.at(start + bit / 2) == mark:
            t = start + bit / 2
            continue
        samples = [signal.at(start + (1.5 + i) * bit) == mark for i in range(uart.data_bits + (uart.parity != "N") + 1)]
        value = sum(level << i for i, level in enumerate(samples[: uart.data_bits]))
        stopped = samples[-1]
        right = stopped and uart.right_parity(value, samples[uart.data_bits])
        received.append(ReceivedOctet(start + uart.char_ns, value, not right))
        t = start + (len(samples) + 0.5) * bit
        if not stopped:  # a break, or out of step: the line must rest before anything begins
            again = signal.next_to(mark, t)
            if again is None:
                return received
            t = again


_APART = 3.0  # characters of silence after which nothing of one stretch hangs on the next
_TAIL = 1.5  # characters that a receiver may need to end one that began last


class Pulse(NamedTuple):
    """Something induced: from, to (ns), and what it does: to a driven line too, or to a floating one only."""

    begin: float
    end: float
    kind: Literal["flip", "low", "float"]


@dataclass(slots=True)
class Burst:
    """What one sender puts on the line at once."""

    sender: object
    uart: LineUart
    data: bytes
    starts: list[float]
    on: float
    off: float
    strength: float = 1.0
    plain: bool = True  # a receiver with its settings gets just its bytes
    octets: list[ReceivedOctet] = field(default_factory=list)  # as it does, once somebody has
    times: list[float] = field(default_factory=list)
    levels: list[int] = field(default_factory=list)

    @property
    def last(self) -> float:
        """ns, end of its last stop bit."""
        return self.starts[-1] + self.uart.char_ns

    def level(self, t: float) -> int:
        if not self.times:
            self.times, self.levels = waveform(self.uart, self.data, self.starts)
        i = bisect_right(self.times, t) - 1
        return self.levels[i] if i >= 0 else int(not self.uart.inverted)


class Listener(Protocol):
    """A receiver on the line."""

    uart: LineUart

    def hear(self, octets: Sequence[ReceivedOctet], t: float) -> None:
        """Bytes since the last time; nobody sends any more at `t`."""


Bend = Callable[[Burst, Random], list[Pulse]]  # reflections of one burst


@dataclass(slots=True)
class TapEnd:
    """One receiver of the tap: its settings, which senders it hears (four wires carry each direction apart), and what
    it made of them."""

    uart: LineUart
    hears: Callable[[Burst], bool] | None = None
    recorded: list[ReceivedOctet] = field(default_factory=list)


class FieldWire:
    """One line with its listeners and what taps it."""

    def __init__(self, random: Random, schedule: Schedule, uart: LineUart) -> None:
        self.random = random
        self.schedule = schedule
        self.uart = uart
        self.taps = [TapEnd(uart)]
        self.listeners: list[Listener] = []
        self.pulses: list[Pulse] = []  # in order of time; whoever makes them sets them before the start
        self.longest_pulse = 0.0  # ns
        self.bends: Bend | None = None
        self.contention: Literal["low", "strong", "random"] = "strong"
        self._bursts: list[Burst] = []  # of the stretch that is going on
        self._bent: list[Pulse] = []
        self._heard_to = 0.0  # the taps have read the line up to here
        self._notified = 0.0

    def send(self, burst: Burst) -> None:
        """Somebody begins to drive now."""
        last = max((each.off for each in self._bursts), default=0.0)
        longest = max([self.uart.char_ns, burst.uart.char_ns, *(each.uart.char_ns for each in self._bursts)])
        if self._bursts and min(burst.on, burst.starts[0]) - last > _APART * longest:
            self._settle(last + _TAIL * longest)
        if self.bends is not None:
            self._bent += self.bends(burst, self.random)
        self._bursts.append(burst)
        self.schedule.at(burst.last, self._ended)

    def busy(self, t: float) -> bool:
        """Whether somebody drives at this time."""
        return any(burst.on <= t < burst.off for burst in self._bursts)

    def finish(self, t: float) -> None:
        """No more is sent: the tap reads on until `t`."""
        if self._bursts:
            self._settle(max(t, max(burst.off for burst in self._bursts) + 3 * self.uart.char_ns))

    def _ended(self, t: float) -> None:
        if any(burst.last > t + 1 for burst in self._bursts):
            return
        begin, self._notified = self._notified, t
        heard: dict[LineUart, list[ReceivedOctet]] = {}
        for listener in self.listeners:
            octets = heard.get(listener.uart)
            if octets is None:
                octets = self._read(self._bursts, listener.uart, min(burst.on for burst in self._bursts), t)
                heard[listener.uart] = octets = [octet for octet in octets if octet.t_ns > begin + 1]
            listener.hear(octets, t)

    def _settle(self, t: float) -> None:
        """The taps read a stretch; pulses since the one before belong to it."""
        for tap in self.taps:
            bursts = [burst for burst in self._bursts if tap.hears is None or tap.hears(burst)]
            if bursts or tap.hears is None:
                tap.recorded += self._read(bursts, tap.uart, self._heard_to, t)
        self._heard_to = t
        self._bursts, self._bent = [], []

    def _read(self, bursts: Sequence[Burst], uart: LineUart, begin: float, end: float) -> list[ReceivedOctet]:
        begin = min([begin, *(burst.on for burst in bursts[:1])])
        since = begin - 4 * uart.char_ns
        low = bisect_left(self.pulses, (since - self.longest_pulse,))
        high = bisect_left(self.pulses, (end,))
        pulses = [each for each in self.pulses[low:high] if max(each.begin, each.end) >= since]
        if len(bursts) == 1 and not pulses and not self._bent:
            burst = bursts[0]
            if burst.plain and burst.uart == uart:
                if not burst.octets:
                    char, both = uart.char_ns, zip(burst.starts, burst.data, strict=True)
                    burst.octets = [ReceivedOctet(t + char, value, False) for t, value in both]
                return burst.octets
        signal = self._composed(bursts, [*pulses, *self._bent])
        return receive(signal, uart, begin, end)

    def _composed(self, bursts: Sequence[Burst], pulses: Sequence[Pulse]) -> LineSignal:
        cuts: set[float] = set()
        for burst in bursts:
            burst.level(0)
            cuts.update((burst.on, burst.off))
            cuts.update(t for t in burst.times if burst.on < t < burst.off)
        for pulse in pulses:
            cuts.update((pulse.begin, pulse.end))
        times, levels, level = [], [], 1
        active: list[Pulse] = []
        at, coming = 0, sorted(pulses)
        for t in sorted(cuts):
            while at < len(coming) and coming[at].begin <= t:
                active.append(coming[at])
                at += 1
            active = [pulse for pulse in active if pulse.end > t]
            now = self._level(t, bursts, active)
            if now != level:
                times.append(t)
                levels.append(now)
                level = now
        return LineSignal(times, levels)

    def _level(self, t: float, bursts: Sequence[Burst], pulses: Sequence[Pulse]) -> int:
        drivers = [burst for burst in bursts if burst.on <= t < burst.off]
        level = 1
        if drivers:
            by_driver = [burst.level(t) for burst in drivers]
            level = by_driver[0]
            if len(set(by_driver)) > 1:
                level = self._won(drivers, by_driver, t)
        for pulse in pulses:
            if pulse.kind == "flip":
                level = 1 - level
            elif pulse.kind == "low" or not drivers:
                level = 0
        return level

    def _won(self, drivers: Sequence[Burst], levels: Sequence[int], t: float) -> int:
        if self.contention == "low":
            return 0
        if self.contention == "random":
            return Random(f"{t:.0f}").randrange(2)  # the same for all who hear it
        strongest = max(range(len(drivers)), key=lambda i: drivers[i].strength)
        return levels[strongest]
