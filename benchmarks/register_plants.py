"""Series of another hand than the simulator's, so that what is learnt is registers and not one generator's habits.

Values scatter about a level and are drawn back to it, loads are switched, the sun comes and goes, counters follow a
power; much of a device stands still. Nothing here is shared with `analyzer.simulation.mapped.series`.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator
from itertools import count, repeat
from random import Random
from typing import Final

from analyzer.simulation.mapped.device import MappedDevice
from dissectors.maps.model import MappedValue

Series = Iterator[float]
_SET: Final = re.compile(
    r"setpoint|limit|\bmax|\bmin|serial|version|firmware|rated|nominal|address|number of|model|config|delay|threshold",
    re.IGNORECASE,
)
_COUNTED: Final = re.compile(r"wh$|varh$|vah$|^ah$|^m³$|^h$|^gj$|^min$|^l$", re.IGNORECASE)
_PARTS: Final = re.compile(r"\W*(voltage|current|power|active|reactive|apparent)\W*", re.IGNORECASE)
_HOURS: Final = {"h": 3600.0, "min": 60.0, "s": 1.0}
_WATTS: Final = {"Wh": 1.0, "kWh": 1e-3, "MWh": 1e-6}


def by_another_hand(device: MappedDevice, random: Random) -> None:
    """Let a device's values move as this module has it; texts, clocks and what it lacks stay as they are."""
    plant = OtherPlant(random)
    device.motions = [
        (row, motion if row.type == "time" or "clock" in row.name.lower() else plant.motion_of(row))
        for row, motion in device.motions
    ]


class OtherPlant:
    """What the values of one device measure."""

    def __init__(self, random: Random) -> None:
        self._random = random
        self._seconds = random.choice((1, 1, 2, 5, 10, 30, 60))
        self._volts = random.choice((230, 230, 120, 400, 57.7))
        self._amperes = 10 ** random.uniform(-0.5, 2.3)
        self._loads: dict[str, tuple[int, Random]] = {}
        self._still = random.choice((0.05, 0.15, 0.3))  # of the values, those of which nothing is connected
        self._decimals = random.choice((None, None, 1, 2, 3))

    def motion_of(self, row: MappedValue) -> Series:
        """What a value does, as the device tells it."""
        random, step = self._random, abs(row.scale) or 1.0
        if row.area in ("coil", "discrete"):
            return self._states([0, 1])
        if row.type == "bits":
            return self._flags(16 * row.length)
        if row.type == "enum" or row.values:
            return self._states(list(row.values) or list(range(random.choice((2, 3, 6, 12)))))
        if _SET.search(row.name) or (row.writable and random.random() < 0.8):
            most = 1000.0 if row.is_float else step * random.choice((10, 100, 5000, 30000, 10 ** (4.4 * row.length)))
            return repeat(random.choice((0.0, step, random.uniform(0, most))))
        if random.random() < self._still:
            return repeat(0.0)
        counted = _COUNTED.search(row.unit) or (row.unit == "" and re.search(r"count|total|cycles|starts", row.name))
        motion = self._counted(row, step) if counted else self._measured(row, step)
        if row.is_float and self._decimals is not None:
            return (round(number, self._decimals) for number in motion)
        return motion if row.is_signed else (max(number, row.offset) for number in motion)

    def _states(self, known: list[int]) -> Series:
        random, share = self._random, self._random.choice((0.0, 0.0, 0.01, 0.04, 0.15))
        state = random.choice(known)
        while True:
            if random.random() < share:
                state = random.choice(known)
            yield float(state)

    def _flags(self, width: int) -> Series:
        random, lively = self._random, self._random.random() < 0.3
        value = random.choice((0, 0, 0, 1, 1 << random.randrange(min(width, 16)), 0x0101))
        while True:
            if lively and random.random() < 0.06:
                value ^= 1 << random.randrange(min(width, 16))
            yield float(value)

    def _counted(self, row: MappedValue, step: float) -> Series:
        random = self._random
        value = step * 10 ** random.uniform(1, 7.3 if row.length > 1 else 4.7)
        if re.search(r"today|daily", row.name, re.IGNORECASE):
            value = random.uniform(0, 40)
        pace = step * 10 ** random.uniform(-2.5, 1.2)
        if row.unit in _HOURS:
            pace = self._seconds / _HOURS[row.unit]
        elif row.unit in _WATTS:
            pace = 10 ** random.uniform(1.5, 5.5) * _WATTS[row.unit] * self._seconds / 3600
        if re.search(r"export|reverse|reactive", row.name, re.IGNORECASE) and random.random() < 0.4:
            pace = 0.0
        while True:
            value += pace * max(0.0, random.gauss(1, 0.15))
            yield math.floor(value / step) * step

    def _measured(self, row: MappedValue, step: float) -> Series:
        random, unit, factor = self._random, row.unit, 1.0
        if unit[1:] in ("W", "V", "A", "VA", "var") and unit[:1] in ("k", "M", "m"):
            unit, factor = unit[1:], {"k": 1e-3, "M": 1e-6, "m": 1e3}[unit[0]]
        if unit == "V":
            return self._drawn(factor * self._level_of_volts(row.name), random.choice((0.0005, 0.002, 0.004)))
        if unit in ("A", "W", "VA", "var"):
            of_current = {"A": 1.0, "W": 0.93 * self._volts, "VA": self._volts, "var": 0.3 * self._volts}[unit]
            return self._load(_PARTS.sub("", row.name).upper(), factor * of_current)
        if "°" in unit:
            return self._drawn(random.choice((-6, 8, 20, 22, 35, 48, 65, 85)), random.choice((0.002, 0.01, 0.05)), 0.98)
        if unit == "Hz":
            return self._drawn(50.0, 0.0004, 0.8)
        if unit == "%":
            return self._drawn(random.choice((0, 12, 50, 77)), random.choice((0.0, 0.01, 0.1)), 0.97)
        level = 10 ** random.uniform(0.5, 3.6 if row.length == 1 else 4.8) * (0.1 if row.is_float else step)
        match random.randrange(5):
            case 0:
                return repeat(level)
            case 1:
                return (level * (1 + 0.5 * math.sin(turn / 9)) for turn in count(random.randrange(60)))
            case 2:
                return self._switched(level, Random(random.random()))
        return self._drawn(level, random.choice((0.0005, 0.002, 0.01, 0.05, 0.3)), 0.95)

    def _level_of_volts(self, name: str) -> float:
        if re.search(r"cell", name, re.IGNORECASE):
            return 3.3
        if re.search(r"batt|pack", name, re.IGNORECASE):
            return self._random.choice((12.0, 24.0, 51.0))
        if re.search(r"\b(pv|mppt|bus|dc)", name, re.IGNORECASE):
            return self._random.uniform(200, 700)
        return self._volts * (math.sqrt(3) if re.search(r"L\d.L\d|line", name) else 1.0)

    def _drawn(self, level: float, share: float, held: float | None = None) -> Series:
        """Scatters about a level, each reading near the one before."""
        random = self._random
        held = random.choice((0.2, 0.9, 0.98)) if held is None else held
        spread, away = abs(level) * share, 0.0
        while True:
            away = held * away + random.gauss(0, spread) * math.sqrt(1 - held * held)
            yield level + away

    def _load(self, name: str, factor: float) -> Series:
        """A circuit's current times a factor: all that is measured of one circuit goes together."""
        if name not in self._loads:
            self._loads[name] = (self._random.randrange(5), Random(self._random.random()))
        kind, seed = self._loads[name]
        own = Random()
        own.setstate(seed.getstate())
        level = self._amperes * own.uniform(0.2, 1.3) * (0 if own.random() < 0.12 else own.choice((1, 1, 1, -1)))
        if kind < 2:
            wave, begin = own.choice((9, 60, 300)), own.uniform(0, 6)
            currents: Series = (level * max(0.0, math.sin(begin + turn / wave)) for turn in count())
        else:
            currents = self._switched(level, own)
        return (factor * current * (1 + self._random.gauss(0, 0.001)) for current in currents)

    def _switched(self, level: float, own: Random) -> Series:
        share, now = own.choice((0.02, 0.08, 0.2)), level
        while True:
            if own.random() < share:
                now = level * own.choice((0, 0.1, 0.5, 1, 1.6))
            yield now * (1 + own.gauss(0, 0.004))
