"""A device that a map describes: its values in time, as the words that its registers hold.

Values hang together as in a plant: voltages and currents are channels (a phase, a string, a battery), power is made of
them, sums of phases, energy of power. What the map does not list holds something too: mostly nothing, sometimes a
constant, sometimes a number that nobody documented.
"""

from __future__ import annotations

import math
import re
import struct
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from random import Random
from typing import Final, cast

from dissectors.maps.model import MapArea, MappedValue, RegisterMap
from dissectors.values import Order, floating, integer, registers_of

from . import series
from .series import Series

_QUANTITY: Final = re.compile(
    r"\b(voltage|current|reactive power|apparent power|power factor|power|reactive energy|apparent energy|energy|yield"
    r"|import|export|today|average|demand|maximum|peak|as float|32 bit|64 bit)\b",
    re.IGNORECASE,
)
_COUNTED: Final = frozenset(
    ("Wh", "kWh", "MWh", "varh", "kvarh", "VAh", "kVAh", "Ah", "GJ", "MJ", "m³", "t", "h", "s", "min", "kg", "l")
)
_ABSENT: Final = 0.03  # of the values that a map lists
_LACKING: Final = (0.03, 0.03, 0.1, 0.3)  # of a wild device, which lacks whole parts
_MARKS: Final = ("zero", "zero", "zero", "ones", "least", "greatest")  # of what a device lacks
_CLOCK: Final = re.compile(
    r"\bclock ((?:years?|months?|days?|hours?|minutes?|(?:milli)?seconds?)(?: and [a-z]+)?)\b", re.IGNORECASE
)
_TIMES: Final = {"h": 3600.0, "min": 60.0, "s": 1.0}
_LEVELS: Final[dict[str, tuple[float, float]]] = {  # unit: level and reach
    "Hz": (50, 0.2), "kPa": (300, 100), "bar": (6, 3), "MPa": (0.6, 0.2), "%": (50, 45), "rpm": (1450, 300),
    "°": (60, 60), "Nm": (20, 15), "ppm": (500, 300), "Pa": (200, 100), "hPa": (1000, 20), "m³/h": (40, 30),
    "m": (4, 2), "mm": (1500, 900), "l/min": (20, 10), "mA": (10, 6), "m/s": (3, 2),
    "kg/m³": (850, 40), "µA": (9000, 5000), "lx": (30000, 29000), "kg": (40, 39),
    "g": (9000, 8900), "mV": (24000, 600), "°F": (90, 20),
}  # fmt: skip


@dataclass(slots=True)
class MappedDevice:
    """One server: `step` lets time pass, `words` are what its registers hold now, by area and address."""

    unit: int
    chart: RegisterMap
    response_ns: float
    seconds: float
    random: Random
    wild: float = 0.2  # of the values, those that do what nobody expects of their names
    words: dict[tuple[MapArea, int], int] = field(default_factory=dict)
    motions: list[tuple[MappedValue, Series]] = field(default_factory=list)
    _unlisted: list[tuple[tuple[MapArea, int], Series]] = field(default_factory=list)
    _mark: str | None = None  # None: any, value by value

    def __post_init__(self) -> None:
        plant = Plant(self.random, self.seconds, self.wild)
        absent = _ABSENT
        if self.wild:
            absent, self._mark = self.random.choice(_LACKING), self.random.choice(_MARKS)
        powers = {(row.area, row.scale_address) for row in self.chart.rows if row.scale_address is not None}
        for row in self.chart.rows:
            if (row.area, row.address) in powers:
                self.words[row.area, row.address] = self.random.choice((0, 0, -1, -1, -2, -3, 1)) & 0xFFFF
            elif row.type == "text" or self.random.random() < absent:
                for register, word in enumerate(self._still(row), row.address):
                    self.words[row.area, register] = word
            else:
                self.motions.append((row, plant.motion_of(row)))
        for area, address, stored in self.chart.match.registers:
            for register, word in enumerate(stored, address):
                self.words[area, register] = word
        self.motions = [(row, motion) for row, motion in self.motions if not self._identifies(row)]
        self.step()

    def _identifies(self, row: MappedValue) -> bool:
        """Whether a value is one by which the device is recognised."""
        return any(
            row.area == area and row.address < address + len(words) and address < row.end
            for area, address, words in self.chart.match.registers
        )

    def step(self) -> None:
        """One poll cycle later."""
        for row, motion in self.motions:
            words = encoded(self._in_powers(row), next(motion))
            for offset, word in enumerate(words):
                self.words[row.area, row.address + offset] = word
        for key, motion in self._unlisted:
            self.words[key] = int(next(motion)) & 0xFFFF

    def _in_powers(self, row: MappedValue) -> MappedValue:
        """The row with the power of ten that its scale register holds."""
        power = None if row.scale_address is None else self.words.get((row.area, row.scale_address))
        if not power:
            return row
        return replace(row, scale=row.scale * 10.0 ** (power - 0x10000 if power > 0x7FFF else power))

    def read(self, area: MapArea, address: int, quantity: int) -> list[int]:
        """The words of a block."""
        return [self._word(area, register) for register in range(address, address + quantity)]

    def write(self, area: MapArea, address: int, words: list[int]) -> None:
        """A master's values stay."""
        for register, word in enumerate(words, address):
            self.words[area, register] = word
        end = address + len(words)
        for at, (row, _) in enumerate(self.motions):
            if row.area == area and address <= row.address and row.end <= end:
                value = decoded(row, [self.words[area, register] for register in range(row.address, row.end)])
                self.motions[at] = (row, series.constant(value))

    def _still(self, row: MappedValue) -> list[int]:
        """The words of a text, or of a value that this device does not have."""
        if row.type == "text":
            text = f"{self.chart.vendor} {self.chart.device} {self.random.randrange(10**6)}".encode("ascii", "replace")
            return registers_of(text[: 2 * row.length].ljust(2 * row.length, b"\0"), cast(Order, row.order))
        if row.area in ("coil", "discrete"):
            return [0]
        size = 2 * row.length
        if self._mark is None:
            absent = self.random.choice((b"\0" * 2, b"\xff" * 2, b"\x80\0" if row.length == 1 else b"\0" * 2))
            if absent == b"\0" * 2 and not _may_be_zero(row):
                absent = b"\xff" * 2
            return registers_of(absent * row.length, cast(Order, row.order))
        if row.is_float and self._mark != "zero":
            return registers_of((b"\x7f\xc0" if size == 4 else b"\x7f\xf8").ljust(size, b"\0"), cast(Order, row.order))
        signed = {"least": b"\x80".ljust(size, b"\0"), "greatest": b"\x7f".ljust(size, b"\xff")}
        ones = b"\0" * size if row.type.startswith("bcd") else b"\xff" * size
        marks = {"zero": b"\0" * size, "ones": ones, **(signed if row.is_signed else {})}
        return registers_of(marks.get(self._mark, ones), cast(Order, row.order))

    def _word(self, area: MapArea, address: int) -> int:
        key = (area, address)
        if key not in self.words:
            self._unlist(key)
        return self.words[key]

    def _unlist(self, key: tuple[MapArea, int]) -> None:
        """A register that the map does not list."""
        random, kind = self.random, self.random.random()
        bits = key[0] in ("coil", "discrete")
        if kind < 0.72 or bits:
            self.words[key] = 0
        elif kind < 0.77:
            self.words[key] = random.choice((0xFFFF, 0x7FFF, 0x8000))
        elif kind < 0.93:
            self.words[key] = random.randrange(random.choice((10, 1000, 65536)))
        else:
            level = random.uniform(10, 10 ** random.uniform(1.2, 4.5))
            self._unlisted.append(
                (key, series.motion(random, level, level * random.uniform(0.02, 0.3), wild=self.wild > 0))
            )
            self.words[key] = int(next(self._unlisted[-1][1])) & 0xFFFF


def _may_be_zero(row: MappedValue) -> bool:
    """Whether the map allows registers that hold nothing: its states, its limits."""
    low, high = row.minimum, row.maximum
    inside = (low is None or low <= row.offset) and (high is None or row.offset <= high)
    return inside and (not row.values or row.type == "bits" or 0 in row.values)


def encoded(row: MappedValue, number: float) -> list[int]:
    """The words that hold a number in the unit of measure."""
    if row.area in ("coil", "discrete"):
        return [int(number) & 1]
    width = 16 * row.length
    if row.is_float:
        try:
            data = struct.pack(">f" if row.length == 2 else ">d", (number - row.offset) / row.scale)
        except OverflowError:
            data = bytes(2 * row.length)
    else:
        raw = round((number - row.offset) / row.scale)
        signed = row.is_signed
        low, high = (-(1 << width - 1), (1 << width - 1) - 1) if signed else (0, (1 << width) - 1)
        raw = min(max(raw, low), high)
        if row.type.startswith("bcd"):
            raw = int(str(min(max(raw, 0), 10 ** (width // 4) - 1)), 16)
        data = (raw & (1 << width) - 1).to_bytes(width // 8, "big")
    return registers_of(data, cast(Order, row.order))


def decoded(row: MappedValue, words: list[int]) -> float:
    """The number that these words hold, in the unit of measure."""
    order = cast(Order, row.order)
    if row.is_float:
        raw: float = floating(words, order)
    else:
        raw = integer(words, order, signed=row.is_signed)
        if row.type.startswith("bcd"):
            raw = int(f"{int(raw):x}") if f"{int(raw):x}".isdigit() else 0
    return raw * row.scale + row.offset


@dataclass(slots=True)
class _Circuit:
    """Voltage, current and power factor of one circuit, a number each a cycle."""

    volts: Series
    amperes: Series
    cosine: Series
    now: tuple[float, float, float] = (0.0, 0.0, 1.0)
    turn: int = -1

    def at(self, turn: int) -> tuple[float, float, float]:
        if turn != self.turn:
            self.now = next(self.volts), next(self.amperes), next(self.cosine)
            self.turn = turn
        return self.now


class Plant:
    """What the values of one device measure."""

    def __init__(self, random: Random, seconds: float, wild: float) -> None:
        self._random = random
        self._wild = wild
        self._seconds = seconds
        self._volts = random.choice((230.0, 230.0, 230.0, 120.0, 400.0))
        self._mains = random.choice((50.0, 50.0, 50.0, 60.0)) + random.uniform(-0.03, 0.03)
        self._amperes = 10 ** random.uniform(-0.5, 2.5)
        self._idle = random.random() < 0.1
        self._sense = random.choice((1, 1, 1, 1, -1))
        self._lively = 10 ** random.uniform(-2.2, -0.3)
        self._channels: dict[str, _Circuit] = {}
        self._decimals = random.choice((None, None, 1, 2, 3))
        self._clock = series.Clock(random, seconds)

    def motion_of(self, row: MappedValue) -> Series:
        """What a value does."""
        random = self._random
        if row.area in ("coil", "discrete"):
            return series.states(random, [0, 1])
        if row.type == "time":
            return series.counter(random, random.uniform(1.6e9, 1.8e9), random.choice((0.0, self._seconds)))
        if (clock := _CLOCK.search(row.name)) is not None:
            return self._clock.parts(clock[1].lower().split(" and ")[:: -1 if self._clock.turned else 1])
        if row.type == "bits":
            return series.flags(random, 16 * row.length)
        if "packed" in row.name:
            return series.packed(random)
        if row.type == "enum" or (row.values and row.length == 1):
            return series.states(random, list(row.values) or list(range(random.choice((2, 4, 8, 300)))))
        if row.writable or re.search(r"setpoint|nominal|serial|firmware|device type|address|capacity", row.name, re.I):
            return self._set(row)
        if random.random() < self._wild and row.length <= 2:
            return self._rounded(row, self._anything(row))
        return self._rounded(row, self._measured(row))

    def _motion(self, level: float, reach: float) -> Series:
        return series.motion(self._random, level, reach, wild=self._wild > 0)

    def _measured(self, row: MappedValue) -> Series:
        unit, name = row.unit, row.name
        if unit in _COUNTED and not re.search(r"demand|interval|delay|left|capacity$", name, re.I):
            return self._counted(row)
        factor = {"k": 1e-3, "M": 1e-6, "m": 1e3}.get(unit[:1] if unit[1:] in ("W", "VA", "var", "V", "A") else "", 1.0)
        base = unit[1:] if factor != 1.0 else unit
        if base in ("V", "A", "W", "VA", "var") or re.search(r"power factor", name, re.I):
            return self._electric(name, base if base else "PF", factor)
        if "°C" in unit:
            level = self._random.choice((5.0, 22.0, 22.0, 45.0, 65.0, -8.0))
            return self._motion(level, self._random.uniform(0.5, 8))
        if unit == "Hz" and not re.search(r"output|motor|compressor|pulse|setpoint|reference|meter \d", name, re.I):
            return series.walk(self._random, self._mains, 0.01, 0.05)
        level, reach = _LEVELS.get(unit, (0.0, 0.0))
        if level:
            low = self._random.uniform(0.02, 1)
            return self._motion(level * self._random.uniform(0.3, 1.3), reach * low)
        if unit == "" and re.search(r"count|starts|cycles", name, re.I):
            return series.counter(self._random, 10 ** self._random.uniform(0, 6), 10 ** self._random.uniform(-2, 2))
        if unit == "" and re.search(r"status|alarm|state|mode|code|fault|error|warning|sequence|decimal", name, re.I):
            return series.states(self._random, list(range(self._random.choice((1, 2, 4, 9, 60)))))
        return self._anything(row)

    def _electric(self, name: str, unit: str, factor: float) -> Series:
        if re.search(r"\b(total|sum|average)\b", name, re.I) and not re.search(r"L[123]", name):
            parts = [self._channel(f"L{phase}") for phase in (1, 2, 3)]
            average = bool(re.search(r"average", name, re.I)) or unit in ("V", "PF")
        else:
            parts, average = [self._channel(_QUANTITY.sub("", name).strip().upper())], False
        root = math.sqrt(3) if re.search(r"L\d-L\d|line voltage", name) else 1.0

        def run() -> Series:
            turn = 0
            while True:
                total = sum(_quantity(unit, *part.at(turn)) for part in parts)
                yield total * root * factor / (len(parts) if average else 1)
                turn += 1

        return run()

    def _channel(self, key: str) -> _Circuit:
        if key not in self._channels:
            random = self._random
            volts, amperes = self._volts, self._amperes * random.uniform(0.3, 1.2) * self._sense
            if "BATTERY" in key or "CELL" in key or "PACK" in key:
                volts = random.choice((3.3,) if "CELL" in key else (12.0, 24.0, 51.0, 380.0))
            elif "PV" in key or "MPPT" in key or "DC" in key:
                volts = random.uniform(80, 650)
                amperes = abs(amperes) % 15
            if self._idle:
                amperes = 0.0
            still = random.random() < 0.04
            self._channels[key] = _Circuit(
                series.constant(volts) if still else series.walk(random, volts, volts * 0.002, volts * 0.02),
                self._motion(amperes, abs(amperes) * self._lively),
                series.walk(random, random.uniform(0.75, 0.99), 0.003, 0.01),
            )
        return self._channels[key]

    def _counted(self, row: MappedValue) -> Series:
        random = self._random
        resolution = row.scale if not row.is_float else 0.01
        begin = 10 ** random.uniform(0, 7.5) * resolution if random.random() < 0.9 else 0.0
        if row.unit in _TIMES and re.search(r"time|hour|uptime|second", row.name, re.I):
            pace = self._seconds / _TIMES[row.unit]
        else:
            pace = 10 ** random.uniform(-2.5, 2.5) * resolution
        reverse = re.search(r"export|negative|reverse", row.name, re.I)
        if random.random() < (0.6 if reverse else 0.15):
            pace = 0.0
        return series.counter(random, begin, pace)

    def _set(self, row: MappedValue) -> Series:
        random = self._random
        low = row.minimum if row.minimum is not None else 0.0
        most = {1: 2000.0, 2: 2.0**31}.get(row.length, 1e9) * row.scale
        high = row.maximum if row.maximum is not None else 10 ** random.uniform(0, math.log10(max(most, 1.0) + 1))
        value = random.choice((low, random.uniform(low, high), float(round(random.uniform(low, high)))))
        return series.constant(value)

    def _anything(self, row: MappedValue) -> Series:
        """A number of which no more is known than what its registers can hold."""
        random = self._random
        most = {1: 4.5, 2: 7.5, 4: 11.0}.get(row.length, 5.0)
        level = 10 ** random.uniform(0.3, most) * row.scale if not row.is_float else 10 ** random.uniform(-1, 5)
        if row.is_signed and random.random() < 0.25:
            level = random.choice((-level, 0.0))
        reach = max(abs(level), 20 * row.scale) * 10 ** random.uniform(-2.5, -0.2)
        kind = random.random()
        if kind < 0.12:
            return series.counter(random, abs(level), reach * random.uniform(0.001, 0.1))
        if kind < 0.2:
            return series.bursts(random, level or reach)
        return self._motion(level, reach)

    def _rounded(self, row: MappedValue, motion: Series) -> Series:
        """As a device tells it: integers by their scale, some coarser; floats often of a few decimals."""
        random = self._random
        coarse = 10 * row.scale if random.random() < 0.06 else None
        for_float = self._decimals if row.is_float else None
        low, high = row.minimum, row.maximum

        def run() -> Iterator[float]:
            for number in motion:
                if coarse:
                    number = round(number / coarse) * coarse
                elif for_float is not None:
                    number = round(number, for_float)
                if not row.is_signed:
                    number = max(number, row.offset)
                if low is not None and number < low:
                    number = low
                if high is not None and number > high:
                    number = high
                yield number

        return run()


def _quantity(unit: str, volts: float, amperes: float, cosine: float) -> float:
    """One quantity of a circuit."""
    match unit:
        case "V":
            return volts
        case "A":
            return abs(amperes)
        case "W":
            return volts * amperes * cosine
        case "VA":
            return volts * abs(amperes)
        case "var":
            return volts * amperes * math.sqrt(max(1 - cosine * cosine, 0.0))
        case _:
            return cosine
