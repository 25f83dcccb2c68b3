"""Devices of which the readings say little: what no type may be sure of.

Strangers are neighbouring registers that have nothing to do with each other: each counts, wanders, scatters or stands
for itself. The others are devices of makers that are drawn (`register_habits`), spoilt: the answers of polls of one
length in each other's places (swapped), each poll's answers in no order of time (stirred), each register's so by itself
(jumbled), nothing that moves (still), or hardly any readings (short).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray
from register_habits import habit_device
from register_makers import asked
from register_series import MadeDevice

from analyzer.registers.readings import RegisterReadings, Words
from dissectors.maps.model import MapArea, MappedValue

Rng = np.random.Generator
Floats = NDArray[np.float64]
Block = tuple[MapArea, int]


def strangers(seeds: range, polls: int = 60) -> Iterator[MadeDevice]:
    """A device of unrelated registers of 16 bits for each seed."""
    for seed in seeds:
        yield stranger(seed, polls)


def stranger(seed: int, polls: int = 60) -> MadeDevice:
    """One device: up to three parts, each of kinds of registers that it favours."""
    rng = np.random.default_rng([11, seed])
    readings, truth = RegisterReadings(), []
    area: MapArea = "holding" if rng.random() < 0.6 else "input"
    at = int(rng.integers(0, 40_000))
    for _ in range(int(rng.integers(1, 4))):
        favoured = rng.choice(np.array(list(WAYS)), int(rng.integers(1, 4)), p=_SHARES)
        count = int(rng.integers(2, 13))
        columns = [WAYS[str(rng.choice(favoured))](rng, polls) for _ in range(count)]
        words = np.stack([np.round(column).astype(np.int64) & 0xFFFF for column in columns], axis=1).astype(np.uint16)
        rows = [MappedValue(area, at + n, "stranger", "u16", "ABCD", 1) for n in range(count)]
        for address, block, inside in asked(rng, at, words, rows):
            readings.put(1, area, address, block)
            truth.append((area, address, block.shape[1], inside))
        at += count + int(rng.integers(20, 60))
    return MadeDevice(f"strangers-{seed}", f"strangers {seed}", "ABCD", readings, tuple(truth))


def _counter(rng: Rng, polls: int) -> Floats:
    """Counts on, over its end too; by pulses, evenly or in bursts."""
    pace = 10 ** rng.uniform(-1, 4)
    ways = (rng.poisson(pace, polls), np.full(polls, max(1, round(pace))), rng.exponential(pace, polls))
    steps = ways[int(rng.integers(0, len(ways)))]
    counted: Floats = rng.integers(0, 0x10000) + np.cumsum(steps)
    return counted


def _walk(rng: Rng, polls: int) -> Floats:
    """Wanders about a level, of any size."""
    reach = 10 ** rng.uniform(0, 3.5)
    level = rng.uniform(reach, 0xFFFF - reach) if rng.random() < 0.5 else 10 ** rng.uniform(1, 4)
    walked: Floats = np.abs(level + np.cumsum(rng.normal(0, reach / 8, polls)))
    return walked


def _scatter(rng: Rng, polls: int) -> Floats:
    """Anything in a range, each time anew."""
    low = 0 if rng.random() < 0.5 else int(rng.integers(0, 0x8000))
    return rng.integers(low, low + int(10 ** rng.uniform(0.7, 4.5)) + 2, polls).astype(np.float64)


def _noise(rng: Rng, polls: int) -> Floats:
    return rng.integers(0, 0x10000, polls).astype(np.float64)


def _level(rng: Rng, polls: int) -> Floats:
    """A level with noise."""
    level = 10 ** rng.uniform(1.5, 4.7)
    noisy: Floats = np.abs(level + rng.normal(0, level * 10 ** rng.uniform(-3.5, -0.7), polls))
    return noisy


def _states(rng: Rng, polls: int) -> Floats:
    states = rng.integers(0, int(rng.choice([2, 6, 200])), 4).astype(np.float64)
    held: Floats = states[np.cumsum(rng.random(polls) < rng.choice([0.03, 0.2])) % 4]
    return held


def _still(rng: Rng, polls: int) -> Floats:
    return np.full(polls, float(rng.choice([0, 0, 1, int(rng.integers(0, 0x10000))])))


WAYS: Final[dict[str, Callable[[Rng, int], Floats]]] = {
    "counter": _counter, "walk": _walk, "scatter": _scatter, "noise": _noise, "level": _level, "states": _states,
    "still": _still,
}  # fmt: skip


_SHARES: Final = np.array([0.03 if way == "noise" else 0.97 / (len(WAYS) - 1) for way in WAYS])
"""How often a part favours a way: noise over all of 0000 to FFFF is hardly ever a register of its own."""


def spoilt(kind: str, seeds: range, polls: int = 60) -> Iterator[MadeDevice]:
    """Devices of makers of their own, spoilt in this way; their truths are those of what was spoilt."""
    for seed in seeds:
        rng = np.random.default_rng([12, seed])
        device = habit_device(seed, int(rng.integers(1, 5)) if kind == "short" else polls)
        blocks = {(b.area, b.address): b.series[0].copy() for b in device.readings}
        SPOILT[kind](rng, blocks)
        if kind == "swapped" and len(blocks) < 2:
            continue
        readings = RegisterReadings()
        for (area, address), words in blocks.items():
            readings.put(1, area, address, words)
        yield MadeDevice(f"{kind}-{seed}", device.family, device.order, readings, device.truth)


def _swap(rng: Rng, blocks: dict[Block, Words]) -> None:
    """Polls are of one length: each asks for as much as the shortest of several registers; answers change places."""
    width = min((words.shape[1] for words in blocks.values() if words.shape[1] > 1), default=1)
    for (area, address), words in list(blocks.items()):
        del blocks[area, address]
        for begin in range(0, words.shape[1] - width + 1, width):
            blocks[area, address + begin] = words[:, begin : begin + width].copy()
    table = np.stack(list(blocks.values()), axis=1)
    for number, moment in enumerate(table):
        table[number] = moment[rng.permutation(len(moment))]
    blocks.update({key: table[:, number].copy() for number, key in enumerate(blocks)})


def _stir(rng: Rng, blocks: dict[Block, Words]) -> None:
    for words in blocks.values():
        words[:] = words[rng.permutation(len(words))]


def _jumble(rng: Rng, blocks: dict[Block, Words]) -> None:
    for words in blocks.values():
        words[:] = rng.permuted(words, axis=0)


def _stop(_rng: Rng, blocks: dict[Block, Words]) -> None:
    for words in blocks.values():
        words[:] = words[0]


SPOILT: Final[dict[str, Callable[[Rng, dict[Block, Words]], None]]] = {
    "swapped": _swap, "stirred": _stir, "jumbled": _jumble, "still": _stop, "short": lambda _rng, _blocks: None,
}  # fmt: skip
