"""A UART: bytes as levels on the line, and levels as the bytes that a receiver makes of them.

A line is at 1 (mark) when it rests. A character is a start bit at 0, data bits least significant first, parity if
any, stop bits at 1. A receiver waits for a falling edge and then samples the middle of each bit by its own clock.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple


@dataclass(frozen=True, slots=True)
class LineUart:
    """Settings of a UART; `inverted`: A and B are swapped at it."""

    baud: float
    data_bits: int = 8
    parity: str = "N"
    stop_bits: int = 1
    inverted: bool = False

    @property
    def bit_ns(self) -> float:
        return 1e9 / self.baud

    @property
    def char_bits(self) -> int:
        """Bits of a character as it is sent."""
        return 1 + self.data_bits + (self.parity != "N") + self.stop_bits

    @property
    def char_ns(self) -> float:
        return self.char_bits * self.bit_ns

    @property
    def silence_ns(self) -> float:
        """t3.5: fixed above 19200 bit/s ([2] 2.5.1.1)."""
        return 3.5 * self.char_ns if self.baud <= 19200 else max(1.75e6, 3.5 * self.char_ns)

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
