"""What one value of a device does in time: generators of numbers in the unit of measure, a number a poll cycle.

Each generator draws its own level and pace, so that no two devices behave alike: what reads them must not rely on one
kind of motion. Nothing here knows of registers.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from itertools import count
from random import Random

Series = Iterator[float]


def constant(level: float) -> Series:
    """Never moves."""
    while True:
        yield level


def walk(random: Random, level: float, step: float, reach: float) -> Series:
    """Moves by about `step`, drawn back to `level` from beyond `reach`."""
    value = level + random.uniform(-1, 1) * reach
    lazy = random.random() < 0.3
    while True:
        if not lazy or random.random() < 0.4:
            value += random.gauss(0, step) - (value - level) * min(step / max(reach, 1e-12), 0.5) * 0.5
        yield value


def noise(random: Random, level: float, spread: float) -> Series:
    """A reading that scatters about its level."""
    while True:
        yield random.gauss(level, spread)


def wave(random: Random, level: float, reach: float) -> Series:
    """Rises and falls slowly, as days and processes do."""
    period, at = random.uniform(20, 600), random.uniform(0, 600)
    spread = reach * random.choice((0.0, 0.003, 0.03))
    while True:
        at += 1
        yield level + reach * math.sin(2 * math.pi * at / period) + random.gauss(0, spread)


def ramp(random: Random, level: float, reach: float) -> Series:
    """Goes up or down steadily between two limits."""
    pace = reach / random.uniform(15, 400) * random.choice((-1, 1))
    value = level
    while True:
        value += pace
        if abs(value - level) > reach:
            pace = -pace
        yield value


def stays_and_jumps(random: Random, level: float, reach: float) -> Series:
    """Holds a value, then takes another."""
    share = random.uniform(0.02, 0.3)
    value = level
    while True:
        if random.random() < share:
            value = level + random.uniform(-1, 1) * reach
        yield value


def switched(random: Random, level: float, reach: float) -> Series:
    """A load that is switched among a few levels, and scatters a little on each."""
    levels = [level + random.uniform(-1, 1) * reach for _ in range(random.randint(2, 4))]
    share, spread = random.uniform(0.02, 0.25), random.choice((0.0, 0.002, 0.02)) * reach
    now = level
    while True:
        if random.random() < share:
            now = random.choice(levels)
        yield random.gauss(now, spread)


def bursts(random: Random, level: float) -> Series:
    """Zero most of the time."""
    share, running, value = random.uniform(0.02, 0.2), False, 0.0
    while True:
        if random.random() < share:
            running = not running
            value = level * random.uniform(0.5, 1.5)
        yield value * random.uniform(0.97, 1.03) if running else 0.0


def counter(random: Random, begin: float, pace: float) -> Series:
    """Only grows, by about `pace` a cycle; a few are set back."""
    value, steady = begin, random.random() < 0.5
    resets = random.random() < 0.05
    while True:
        value += pace if steady else random.expovariate(1 / pace) if pace > 0 else 0.0
        if resets and random.random() < 0.01:
            value = 0.0
        yield value


def states(random: Random, known: list[int]) -> Series:
    """One of a few states, now and then another."""
    usual = random.sample(known, min(len(known), random.randint(1, 4)))
    share = random.choice((0.0, 0.02, 0.05, 0.2))
    state = random.choice(usual)
    while True:
        if random.random() < share:
            state = random.choice(usual)
        yield float(state)


def flags(random: Random, width: int) -> Series:
    """Bits, some of which are set or cleared now and then."""
    first = random.choice((0, 0, 0, random.randrange(0, width, 16)))  # the rest of a wide one is spare
    value = sum(1 << first + random.randrange(min(width, 16)) for _ in range(random.choice((0, 0, 1, 2, 3))))
    live = [first + random.randrange(min(width, 16)) for _ in range(random.choice((0, 0, 1, 2, 4)))]
    while True:
        if live and random.random() < 0.08:
            value ^= 1 << random.choice(live)
        yield float(value)


def packed(random: Random) -> Series:
    """Two numbers of a byte each in one register."""
    halves = [
        random.choice((
            lambda: constant(float(random.choice((0, random.randrange(256))))),
            lambda: states(random, list(range(random.choice((2, 5, 12))))),
            lambda: motion(random, random.uniform(20, 200), random.uniform(2, 40)),
        ))()
        for _ in range(2)
    ]  # fmt: skip
    while True:
        high, low = (min(max(round(next(half)), 0), 255) for half in halves)
        yield float(high << 8 | low)


class Clock:
    """A calendar clock, of which registers hold parts: all of one device go together."""

    def __init__(self, random: Random, seconds: float) -> None:
        self._begin = datetime(random.randrange(2015, 2030), 1, 1) + timedelta(seconds=random.uniform(0, 3e7))
        self._seconds = seconds
        self._short = random.random() < 0.5  # years without their century
        self.turned = random.random() < 0.5  # the later of two parts stands in the high byte

    def parts(self, names: list[str]) -> Series:
        """One part of the time, or two as the bytes of one number, the first one high."""
        for turn in count():
            now = self._begin + timedelta(seconds=turn * self._seconds)
            value = 0
            for name in names:
                value = value << 8 | self._part(now, name.rstrip("s"), short=len(names) > 1 or self._short)
            yield float(value)

    def _part(self, now: datetime, name: str, *, short: bool) -> int:
        if name == "millisecond":
            return now.second * 1000 + now.microsecond // 1000
        part: int = getattr(now, name)
        return part % 100 if name == "year" and short else part


_MOTIONS: tuple[Callable[[Random, float, float], Series], ...] = (
    lambda random, level, reach: walk(random, level, reach * 10 ** random.uniform(-2.3, -0.3), reach),
    lambda random, level, reach: walk(random, level, reach * 10 ** random.uniform(-2.3, -0.3), reach),
    lambda random, level, reach: noise(random, level, reach * 10 ** random.uniform(-1.3, 0)),
    wave,
    ramp,
    stays_and_jumps,
)


def motion(random: Random, level: float, reach: float, *, wild: bool = False) -> Series:
    """Any of the motions of a measurement about a level; of a wild device a load may be switched."""
    return random.choice((*_MOTIONS, switched) if wild else _MOTIONS)(random, level, reach)
