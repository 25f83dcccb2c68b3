"""Devices of a third hand: layouts as makers have them (`layouts/physics.txt`), filled by plants (`register_physics`),
asked as masters ask: all at once, by values, by even stretches that cut values, with registers before and behind that
nobody lists. Some models lack parts, some refresh more seldom than they are asked; floats come from converters, or
rounded.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray
from register_layouts import DeviceLayout, listed_layouts
from register_physics import Floats, Plant
from register_series import MadeDevice

from analyzer.registers.readings import RegisterReadings, Words
from dissectors.maps.model import MapArea, MappedValue

_OTHER_ORDER: Final = {"ABCD": "CDAB", "CDAB": "ABCD"}
_OTHER_AREA: Final[dict[MapArea, MapArea]] = {"input": "holding", "holding": "input"}
_SHIFT: Final = 6  # addresses, for registers before the first
_STRETCHES: Final = [8, 10, 16, 20, 32, 50]


def physical_layouts() -> dict[str, DeviceLayout]:
    """The layouts by name."""
    return listed_layouts("physics")


def physical_devices(seeds: range, polls: int = 60, flip: float = 0.0, thin: int = 1) -> Iterator[MadeDevice]:
    """Devices of all layouts, or of each `thin`-th, once a seed; of chance `flip` with the other word order."""
    for layout in list(physical_layouts().values())[::thin]:
        for seed in seeds:
            yield physical_device(layout, seed, polls, flip)


def physical_device(layout: DeviceLayout, seed: int, polls: int = 60, flip: float = 0.0) -> MadeDevice:
    """One device."""
    name, area, order, float_order = layout.name, layout.stretches[0].area, layout.order, layout.float_order
    if np.random.default_rng([7, zlib.crc32(name.encode()), seed]).random() < flip:
        order, float_order = _OTHER_ORDER[order], _OTHER_ORDER[float_order]
    rng = np.random.default_rng([zlib.crc32(name.encode()), seed])
    if rng.random() < 0.3:
        area = _OTHER_AREA[area]
    period = float(rng.choice([1, 2, 5, 10, 15, 30, 60]))
    plant = Plant(rng, polls, period)
    refresh = int(rng.choice([1, 1, 1, 2, 5])) if period < 5 else 1
    steps = str(rng.choice(["none", "dec1", "dec3", "adc"]))
    at = int(rng.integers(0, 20000))
    readings = RegisterReadings()
    truth: list[tuple[MapArea, int, int, tuple[MappedValue, ...]]] = []
    lacks = rng.random() < 0.2
    for stretch in layout.stretches:
        rows: list[MappedValue] = []
        columns: list[Words] = []
        begin = at
        for token in stretch.tokens:
            if token.code is None:
                columns.append(np.zeros((polls, token.times or 0), np.uint16))
            else:
                kind, quantity = token.type, token.code
                assert kind is not None, token
                value = np.zeros(polls) if lacks and rng.random() < 0.25 else plant(quantity)
                raw = value * float(1 / (token.scale or 1))
                if kind[0] == "f":
                    raw = _stepped(raw, steps)
                own = float_order if kind[0] == "f" else order
                columns.append(encoded(raw[np.arange(polls) // refresh * refresh], kind, own))
                width = columns[-1].shape[1]
                rows.append(MappedValue(area, at, quantity, kind, own if width > 1 else "ABCD", width))
            at += columns[-1].shape[1]
        words = np.concatenate(columns, axis=1)
        for address, block, inside in asked(rng, begin, words, rows):
            readings.put(1, area, address, block)
            truth.append((area, address, block.shape[1], inside))
        at += int(rng.integers(20, 60))
    return MadeDevice(f"{name}-{seed}", name, order, readings, tuple(truth))


def asked(
    rng: np.random.Generator, begin: int, words: Words, rows: list[MappedValue]
) -> list[tuple[int, Words, tuple[MappedValue, ...]]]:
    """The requests for one part: address, what is read, the values that lie in it whole."""
    style, width = rng.random(), words.shape[1]
    edges = [row.address - begin for row in rows]
    cuts = [0, width]
    if 0.55 <= style < 0.75:
        count = min(len(edges) - 1, int(rng.integers(1, 4)))
        cuts = [0, *sorted(rng.choice(edges[1:], count, replace=False).tolist()), width] if edges[1:] else cuts
    elif 0.75 <= style < 0.9:
        cuts = [*range(0, width, int(rng.choice(_STRETCHES))), width]
    elif style >= 0.9:
        cuts = [*sorted({0, *edges})[:: int(rng.integers(1, 3))], width]
    before = int(rng.integers(0, 6)) if rng.random() < 0.3 else 0
    behind = int(rng.integers(0, 6)) if rng.random() < 0.3 else 0
    found = []
    for first, last in pairwise(cuts):
        if last <= first:
            continue
        block, address = words[:, first:last], begin + first + _SHIFT
        if before and first == 0:
            block, address = np.concatenate([_unlisted(rng, len(words), before), block], axis=1), address - before
        if behind and last == width:
            block = np.concatenate([block, _unlisted(rng, len(words), behind)], axis=1)
        inside = [row for row in rows if row.address - begin >= first and row.end - begin <= last]
        moved = tuple(replace(row, address=row.address + _SHIFT) for row in inside)
        found.append((address, np.ascontiguousarray(block), moved))
    return found


def _unlisted(rng: np.random.Generator, polls: int, count: int) -> Words:
    words = np.where(rng.random(count) < 0.6, 0, rng.integers(0, 500, count)).astype(np.uint16)
    return np.tile(words, (polls, 1))


def _stepped(raw: Floats, steps: str) -> Floats:
    """A float as a device has it: rounded, or from a converter of 14 bits."""
    match steps:
        case "dec1":
            return np.round(raw, 1)
        case "dec3":
            return np.round(raw, 3)
        case "adc":
            bit = max(float(np.abs(raw).max()), 1e-9) * 2.0**-14
            return np.round(raw / bit) * bit
        case _:
            return raw


def encoded(raw: Floats, kind: str, order: str) -> Words:
    """A series as registers."""
    width = int(kind[1:]) // 16
    if kind[0] == "f":
        plain: NDArray[np.uint16] = raw.astype(f">f{2 * width}").view(">u2").reshape(-1, width).astype(np.uint16)
    else:
        whole = np.round(np.clip(raw, -9e18, 9e18)).astype(">i8")
        plain = whole.view(">u2").reshape(-1, 4)[:, 4 - width :].astype(np.uint16)
    return plain[:, ::-1] if order == "CDAB" else plain
