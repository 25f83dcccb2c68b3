"""What units hold: words that behave as those of meters and drives do, by address and time."""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Sequence
from random import Random

Word = Callable[[float], int]  # the value at a time (ns)


def constant(value: int) -> Word:
    """It never changes."""
    return lambda _: value


def analog(random: Random) -> Word:
    """A measured value: it swings slowly and trembles."""
    middle, swing = random.choice((23, 230, 2300, 4800)), random.uniform(0.01, 0.2)
    period, phase, noise = random.uniform(20e9, 400e9), random.uniform(0, 6.28), random.choice((0, 1, 3))
    tremble = Random(random.getrandbits(32))

    def word(t: float) -> int:
        value = middle * (1 + swing * math.sin(6.2832 * t / period + phase)) + tremble.randint(-noise, noise)
        return max(0, min(0xFFFF, round(value)))

    return word


def steps(random: Random, on: Callable[[float], bool]) -> Word:
    """A state that is one value or another."""
    low, high = random.choice(((0, 1), (0, 1), (0, 0xFF), (1, 3), (0x0040, 0x0047), (0, 1500)))
    return lambda t: high if on(t) else low


def counter(random: Random) -> tuple[Word, Word]:
    """Two words, most significant first, that count up."""
    begin, rate = random.randrange(100_000, 90_000_000), random.choice((0.1, 1.0, 7.0, 40.0))

    def value(t: float) -> int:
        return begin + int(rate * t / 1e9)

    return (lambda t: value(t) >> 16 & 0xFFFF), (lambda t: value(t) & 0xFFFF)


def float_pair(random: Random) -> tuple[Word, Word]:
    """Two words of a float, most significant first."""
    middle, period = random.choice((50.0, 231.5, 12.25, 0.93, 1450.0)), random.uniform(20e9, 300e9)
    tremble = Random(random.getrandbits(32))
    current: dict[float, bytes] = {}

    def packed(t: float) -> bytes:
        if t not in current:
            current.clear()
            value = middle * (1 + 0.02 * math.sin(6.2832 * t / period) + 0.001 * tremble.random())
            current[t] = struct.pack(">f", value)
        return current[t]

    return (lambda t: packed(t)[0] << 8 | packed(t)[1]), (lambda t: packed(t)[2] << 8 | packed(t)[3])


class Holdings:
    """The words of one unit, made when they are first read."""

    def __init__(self, random: Random) -> None:
        self.random = random
        self.words: dict[int, Word] = {}

    def read(self, address: int, quantity: int, t: float) -> list[int]:
        """Words from an address on."""
        for at in range(address, address + quantity):
            if at not in self.words:
                self._grow(at)
        return [self.words[at](t) & 0xFFFF for at in range(address, address + quantity)]

    def write(self, address: int, values: Sequence[int]) -> None:
        """Words that stay as they are written."""
        for at, value in enumerate(values, address):
            self.words[at] = constant(value)

    def _grow(self, at: int) -> None:
        random = self.random
        kind = random.random()
        if kind < 0.35:
            self.words[at] = constant(
                random.choice((0, 0, 0, 1, 0xFFFF, 0x8000, random.randrange(1000), random.getrandbits(16)))
            )
        elif kind < 0.7:
            self.words[at] = analog(random)
        elif kind < 0.85:
            self.words[at], low = counter(random)
            self.words.setdefault(at + 1, low)
        else:
            self.words[at], low = float_pair(random)
            self.words.setdefault(at + 1, low)
