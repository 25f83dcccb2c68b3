"""Devices of a fourth hand: makers that do not exist. Each is drawn: what its device is, which types and word order it
likes, whether it pads, strides, rounds addresses up or leaves parts out; so no two layouts are the same.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray
from register_makers import asked, encoded
from register_series import MadeDevice

from analyzer.registers.readings import RegisterReadings
from dissectors.maps.model import MapArea, MappedValue

Floats = NDArray[np.float64]
Rng = np.random.Generator


@dataclass(frozen=True, slots=True)
class Quantity:
    """What is measured: `kind` of series, its usual least and greatest level, decimals that makers give it, whether it
    may be negative; `wide` where 16 bits are often too few."""

    kind: str
    least: float
    most: float
    decimals: tuple[int, ...]
    signed: bool = False
    wide: bool = False


def _q(kind: str, least: float, most: float, *decimals: int, signed: bool = False, wide: bool = False) -> Quantity:
    return Quantity(kind, least, most, decimals, signed, wide)


_VOLT, _AMPERE = _q("calm", 100, 420, 0, 1, 2, 3), _q("load", 0.3, 300, 1, 2, 3)
_POWER = _q("load", 50, 90_000, 0, 1, 2, signed=True, wide=True)
_SHARE, _HERTZ = _q("calm", 0.5, 1, 2, 3, signed=True), _q("calm", 49.9, 60, 1, 2, 3)
_ENERGY = _q("total", 1, 3e6, 0, 1, 2, 3, wide=True)
_WARM = _q("slow", -20, 95, 0, 1, 1, 2, signed=True)
_HOURS, _COUNT = _q("total", 5, 90_000, 0, wide=True), _q("total", 0, 2e6, 0, wide=True)
_STATE, _FLAGS, _ALARM = _q("state", 0, 12, 0), _q("flags", 0, 0, 0), _q("alarm", 0, 0, 0)
_SETTING, _WIDE_SETTING = _q("still", 0, 3000, 0, 1), _q("still", 0, 3e6, 0, wide=True)
_PRESSURE, _LEVEL = _q("slow", 0.2, 40, 1, 2, 3), _q("slow", 0.1, 20, 2, 3)
_FLOW, _VOLUME = _q("load", 0.5, 900, 1, 2, 3, wide=True), _q("total", 10, 5e6, 0, 1, 2, wide=True)
_PERCENT, _SPEED = _q("slow", 0, 100, 0, 1), _q("load", 5, 3000, 0, 1, signed=True)
_PLACE = _q("place", 10, 4e6, 0, 1, signed=True, wide=True)
_SUN, _CELL = _q("load", 5, 900, 0, 1), _q("calm", 3.1, 3.6, 3, 3, 2)
_CLOCK = _q("clock", 0, 0, 0, wide=True)

DEVICES: Final[dict[str, list[list[Quantity]]]] = {
    "meter": [3 * [_VOLT], 3 * [_AMPERE], 4 * [_POWER], 4 * [_POWER], 3 * [_SHARE], [_HERTZ], 4 * [_ENERGY],
              6 * [_ENERGY], 3 * [_VOLT], 3 * [_PERCENT]],
    "inverter": [[_STATE], [_VOLT, _AMPERE] * 3, [_VOLT, _AMPERE, _POWER], [_POWER] * 2, [_ENERGY] * 2, 3 * [_WARM],
                 [_HERTZ], [_HOURS], 3 * [_ALARM], 2 * [_SUN], 2 * [_FLAGS]],
    "battery": [[_VOLT, _AMPERE, _PERCENT, _PERCENT], 16 * [_CELL], 4 * [_WARM], [_COUNT], 2 * [_ENERGY], [_POWER],
                2 * [_FLAGS], 4 * [_ALARM]],
    "drive": [[_FLAGS, _STATE], [_HERTZ, _SPEED, _AMPERE, _SPEED], [_POWER], [_VOLT], 2 * [_WARM], [_HOURS, _ENERGY],
              12 * [_SETTING], [_PLACE], 2 * [_ALARM]],
    "axis": [3 * [_PLACE], 3 * [_PLACE], 3 * [_SPEED], 3 * [_FLAGS], [_COUNT], 6 * [_WIDE_SETTING]],
    "plant": [8 * [_WARM], 4 * [_PRESSURE], 4 * [_PERCENT], 3 * [_FLOW], 3 * [_VOLUME], 10 * [_SETTING], 4 * [_HOURS],
              4 * [_COUNT], 3 * [_FLAGS], 3 * [_STATE], 6 * [_ALARM]],
    "flow": [[_FLOW, _VOLUME, _VOLUME], 2 * [_WARM], [_PRESSURE], [_FLOW, _ENERGY], [_HOURS], 2 * [_ALARM], [_CLOCK]],
    "tank": [[_LEVEL, _WARM, _VOLUME, _STATE] * 3, [_LEVEL] * 2, [_PRESSURE], 4 * [_SETTING]],
    "counter": [8 * [_COUNT], [_FLAGS], 4 * [_COUNT], [_CLOCK], 4 * [_SETTING]],
    "air": [4 * [_WARM], 2 * [_PERCENT], [_PRESSURE], 6 * [_SETTING], [_STATE] * 2, [_FLAGS], 2 * [_HOURS]],
    "weather": [[_FLOW, _SPEED], 2 * [_WARM], [_PERCENT, _PRESSURE], [_SUN], [_VOLUME], [_COUNT]],
}  # fmt: skip


STYLES: Final = ("need", "need", "need", "narrow", "wide", "float", "float and whole")


@dataclass(frozen=True, slots=True)
class Habits:
    """How a maker lays registers out: `style` of types and what share of quantities strays from it, whether wide values
    stand at even offsets (`even`), registers from value to value at least (`stride`), and chances."""

    order: str
    style: str
    strays: float
    even: bool
    stride: int
    spare: float
    lacks: float
    mark: int
    is_wide: float
    long: bool
    repeats: int
    seconds: float


def habit_devices(seeds: range, polls: int = 60) -> Iterator[MadeDevice]:
    """A device of a maker of its own for each seed."""
    for seed in seeds:
        yield habit_device(seed, polls)


def habit_device(seed: int, polls: int = 60) -> MadeDevice:
    """One device."""
    rng = np.random.default_rng([4, seed])
    habits = _habits(rng)
    kind = str(rng.choice(list(DEVICES)))
    sections = [section for section in DEVICES[kind] if rng.random() < 0.75] or DEVICES[kind][:1]
    if rng.random() < 0.5:
        sections = [sections[number] for number in rng.permutation(len(sections))]
    area: MapArea = "holding" if rng.random() < 0.6 else "input"
    at = int(rng.integers(0, 40_000))
    readings, truth = RegisterReadings(), []
    parts: list[list[Quantity]] = [[]]
    for section in sections:
        if parts[-1] and rng.random() < 0.25:
            parts.append([])
        parts[-1] += section
    for part in parts:
        rows: list[MappedValue] = []
        columns: list[NDArray[np.uint16]] = []
        begin = at = at if rng.random() < 0.5 else (at // 50 + 1) * 50
        for quantity in part * habits.repeats:
            kind_of, own = _type(rng, habits, quantity)
            width = int(kind_of[1:]) // 16
            lacking = rng.random() < habits.lacks
            if habits.even and width > 1 and (at - begin) % 2:
                columns.append(np.zeros((polls, 1), np.uint16))
                at += 1
            if lacking and habits.mark and rng.random() < 0.7:
                words = np.full((polls, width), 0xFFFF if habits.mark == 0xFFFF else 0, np.uint16)
                words[:, 0 if own == "ABCD" else width - 1] = habits.mark
            else:
                raw = np.zeros(polls) if lacking else _motion(rng, habits, quantity, polls)
                words = encoded(_written(rng, raw, quantity, kind_of, width), kind_of, own)
            columns.append(words)
            rows.append(MappedValue(area, at, quantity.kind, kind_of, own, width))
            at += width
            pad = max(0, habits.stride - width) or int(rng.random() < habits.spare) * int(rng.integers(1, 4))
            columns.append(np.zeros((polls, pad), np.uint16))
            at += pad
        block = np.concatenate(columns, axis=1)[:, :120]
        rows = [row for row in rows if row.end - begin <= block.shape[1]]
        for address, words, inside in asked(rng, begin, block, rows):
            readings.put(1, area, address, words)
            truth.append((area, address, words.shape[1], inside))
        at = begin + block.shape[1] + int(rng.integers(12, 60))
    return MadeDevice(f"{kind}-{seed}", f"habits {seed}", habits.order, readings, tuple(truth))


def _habits(rng: Rng) -> Habits:
    return Habits(
        order="ABCD" if rng.random() < 0.64 else "CDAB",
        style=str(rng.choice(STYLES)),
        strays=float(rng.choice([0, 0, 0.08, 0.25])),
        even=rng.random() < 0.3,
        stride=2 * int(rng.random() < 0.06),
        spare=float(rng.choice([0, 0, 0.03, 0.1, 0.25])),
        lacks=float(rng.choice([0, 0, 0.1, 0.3])),
        mark=int(rng.choice([0, 0, 0xFFFF, 0x8000, 0x7FFF])),
        is_wide=float(rng.choice([0.5, 0.8, 1, 1])),
        long=rng.random() < 0.15,
        repeats=int(rng.choice([1, 1, 1, 1, 2, 3])),
        seconds=float(rng.choice([0.2, 1, 1, 2, 5, 10, 60])),
    )


def _type(rng: Rng, habits: Habits, quantity: Quantity) -> tuple[str, str]:
    """The type of a value and its word order: those of one section mostly share it."""
    sign = "s" if quantity.signed else "u"
    odd = _fixed(rng, quantity)  # one choice a quantity and maker
    wide = quantity.wide and odd.random() < habits.is_wide
    plain = quantity.kind in ("state", "flags", "alarm", "still") and not quantity.wide
    if quantity.kind == "clock":
        return "u32", habits.order
    style = str(odd.choice(STYLES)) if odd.random() < habits.strays else habits.style
    match style:
        case "narrow":
            bits = 32 if quantity.kind == "total" and wide else 16
        case "wide":
            bits = 16 if plain and odd.random() < 0.5 else 32
        case "float" if not plain or odd.random() < 0.3:
            return "f32", habits.order
        case "float and whole" if quantity.kind not in ("total", "place") and not plain:
            return "f32", habits.order
        case _:
            bits = 32 if wide else 16
    if bits == 32 and habits.long and quantity.kind == "total":
        bits = 64
    order = habits.order if bits > 16 else "ABCD"
    return f"{sign}{bits}", order


def _fixed(rng: Rng, quantity: Quantity) -> Rng:
    """Chances that are the same for all of a quantity's values on one device."""
    seeds = rng.bit_generator.seed_seq.entropy  # type: ignore[attr-defined]
    return np.random.default_rng([*seeds, hash(quantity.decimals) % 9999, int(quantity.most)])


def _written(rng: Rng, raw: Floats, quantity: Quantity, kind: str, width: int) -> Floats:
    """A series in steps of its register; narrow ones in steps that let it fit."""
    if kind[0] == "f":
        digits = _fixed(rng, quantity).choice([99, 99, 1, 2, 3])
        return raw if digits == 99 else np.round(raw, digits)
    decimals = int(_fixed(rng, quantity).choice(quantity.decimals))
    most = 2.0 ** (16 * width - (kind[0] == "s")) - 1
    while decimals > -4 and np.abs(raw).max() * 10.0**decimals > most:
        decimals -= 1
    whole = np.floor(raw * 10.0**decimals + 0.5)
    coarse = int(_fixed(rng, quantity).choice([1, 1, 1, 1, 5, 10])) if quantity.kind in ("load", "slow") else 1
    return whole if kind[0] == "s" else np.maximum(np.round(whole / coarse) * coarse, 0)


def _motion(rng: Rng, habits: Habits, quantity: Quantity, polls: int) -> Floats:
    """What the quantity does, a number a poll."""
    held = int(rng.choice([1, 1, 1, 1, 3, 10]))  # polls to which the device gives the same answer
    level = _level_of(rng, quantity)
    series: Floats = SERIES[quantity.kind](rng, level, polls, habits.seconds)
    return series[np.arange(polls) // held * held]


def _level_of(rng: Rng, quantity: Quantity) -> float:
    if quantity.least > 0 and quantity.most > 20 * quantity.least:
        level = float(np.exp(rng.uniform(np.log(quantity.least), np.log(quantity.most))))
    else:
        level = float(rng.uniform(quantity.least, quantity.most))
    return -level if quantity.signed and rng.random() < 0.2 else level


def _drawn(rng: Rng, polls: int, hold: float) -> Floats:
    """Noise of about 1 that forgets at the pace of `hold`."""
    found, value = np.empty(polls), rng.normal()
    for at, step in enumerate(rng.normal(0, np.sqrt(1 - hold**2), polls)):
        value = value * hold + step
        found[at] = value
    return found


def _calm(rng: Rng, level: float, polls: int, _seconds: float) -> Floats:
    return level * (1 + float(rng.choice([3e-4, 2e-3, 8e-3])) * _drawn(rng, polls, float(rng.choice([0, 0.6, 0.95]))))


def _slow(rng: Rng, level: float, polls: int, _seconds: float) -> Floats:
    reach = abs(level) * 10 ** rng.uniform(-3, -0.8) + 0.05
    trend = rng.choice([0, 0, 1, -1]) * reach * np.linspace(0, 3, polls)
    noise = rng.normal(0, reach * 10 ** rng.uniform(-2, -0.5), polls)
    found: Floats = level + trend + reach * _drawn(rng, polls, 0.985) + noise
    return found


def _load(rng: Rng, level: float, polls: int, _seconds: float) -> Floats:
    """Switched among some levels, one of them often none, with ripple on each."""
    levels = level * np.array([1.0, rng.uniform(0.2, 1.8), rng.choice([0, 0.02, 1.2])])
    state = np.cumsum(rng.random(polls) < rng.choice([0.0, 0.02, 0.1, 0.3]))
    now = levels[rng.permutation(3)[state % 3]]
    ripple = float(rng.choice([0.001, 0.01, 0.06])) * _drawn(rng, polls, float(rng.choice([0.2, 0.9])))
    found: Floats = np.convolve(np.concatenate((now[:2], now)), rng.choice([1, 0.6]) * np.array([1, 0, 0]), "valid")
    return found * (1 + ripple)


def _total(rng: Rng, level: float, polls: int, seconds: float) -> Floats:
    """A counter: the larger, the faster; some rest, some count in pulses."""
    pace = level * seconds / 3600 / 10 ** rng.uniform(0, 4) * rng.choice([0, 1, 1, 1, 1])
    steps = pace * np.maximum(0, 1 + 0.3 * _drawn(rng, polls, 0.8))
    if rng.random() < 0.3:
        steps = rng.poisson(np.minimum(steps + 0.3, 500)).astype(float)
    found: Floats = level + np.cumsum(steps)
    return found


def _place(rng: Rng, level: float, polls: int, _seconds: float) -> Floats:
    goals = np.array([0, level, level * rng.uniform(-1, 1), level * rng.uniform(0, 1)])
    state = goals[rng.integers(0, 4, polls)[np.cumsum(rng.random(polls) < 0.15) % polls]]
    found, value, pace = np.empty(polls), state[0], abs(level) * rng.uniform(0.02, 0.5)
    for at, goal in enumerate(state):
        value += float(np.clip(goal - value, -pace, pace))
        found[at] = value + rng.normal(0, rng.choice([0, 2]))
    return found


def _state(rng: Rng, _level: float, polls: int, _seconds: float) -> Floats:
    some = rng.integers(0, 12, 3)
    found: Floats = some[np.cumsum(rng.random(polls) < rng.choice([0, 0.02, 0.1])) % 3].astype(float)
    return found


def _flags(rng: Rng, _level: float, polls: int, _seconds: float) -> Floats:
    live = 1 << rng.integers(0, 16, 2)
    flips = rng.random((polls, 2)) < rng.choice([0, 0.03, 0.15])
    base = int(rng.choice([0, 0, 1, 0x8001, int(rng.integers(0, 0x10000))]))
    bits = (np.cumsum(flips, axis=0) % 2 * live).sum(axis=1)
    found: Floats = (base ^ bits).astype(float)
    return found


def _alarm(rng: Rng, _level: float, polls: int, _seconds: float) -> Floats:
    on = (np.cumsum(rng.random(polls) < rng.choice([0, 0, 0, 0.03])) % 2) * int(rng.integers(1, 200))
    return on.astype(float)


def _still(rng: Rng, level: float, polls: int, _seconds: float) -> Floats:
    value = rng.choice([0, 0, 1, round(level / 100) * 100, round(level), 100])
    return np.full(polls, float(value))


def _clock(rng: Rng, _level: float, polls: int, seconds: float) -> Floats:
    begin = rng.choice([0, 1.6e9, 1.72e9]) + rng.uniform(0, 8e7)
    found: Floats = np.floor(begin + np.arange(polls) * seconds)
    return found


SERIES: Final[dict[str, Callable[[Rng, float, int, float], Floats]]] = {
    "calm": _calm, "slow": _slow, "load": _load, "total": _total, "place": _place, "state": _state, "flags": _flags,
    "alarm": _alarm, "still": _still, "clock": _clock,
}  # fmt: skip
