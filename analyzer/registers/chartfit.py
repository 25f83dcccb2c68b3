"""How well a map fits what a unit is asked for and what it answers, as evidence in bits of several kinds.

Each kind is a log likelihood ratio: how often so under the right map, against how often by chance under a map of
another device. Chance is counted from the map itself (how dense its values begin and end, how wide a range is among
the numbers that a register can hold); what each kind is worth beside the others is learnt
(`benchmarks/fit_recognition.py`).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, cast

import numpy as np
from numpy.typing import NDArray

from dissectors.maps import RegisterMap
from dissectors.maps.model import MapArea, MappedValue
from dissectors.values import Order

from .hypotheses import numbers
from .looks import is_absent
from .readings import BlockReadings
from .roles import RegisterValue

KINDS: Final = (
    "device", "region", "edges", "cuts", "strays", "unlisted", "types", "values", "contradictions",
)  # fmt: skip
"""The kinds of evidence; `device` is 1, what a device without a word for or against it has."""
_APART: Final = 16  # registers between two regions of a map
_LONGEST: Final = 125
_PULL: Final[Mapping[str, float]] = {"group": 4.0, "value": 1.0, "within": 0.06, "none": 0.7}
"""How much rather a request for the right map begins (or ends) at an address where a group of values does, a value
behind another, one within a value, or elsewhere."""
_TYPES: Final[Mapping[tuple[int, bool], float]] = {
    (1, False): 0.6, (2, False): 0.1, (2, True): 0.08, (4, False): 0.03, (4, True): 0.02,
}  # fmt: skip
"""How often a register that moves is the first of such a value, of either word order."""
_RIGHT: Final = 0.94  # of the values that a right map has, those that are as it says
_RANGES: Final[Mapping[str, tuple[float, float]]] = {
    "mains": (45.0, 66.0), "Hz": (0.0, 600.0), "V": (1.0, 1200.0), "A": (0.0, 2000.0), "°C": (-50.0, 250.0),
    "%": (-100.0, 100.0), "power factor": (-1.001, 1.001), "phase": (80.0, 760.0), "hPa": (800.0, 1100.0),
}  # fmt: skip
_ZERO: Final = 0.35  # how often a register of another device is zero
_ZEROS: Final[Mapping[str, float]] = {"mains": 0.03, "phase": 0.06, "V": 0.15, "hPa": 0.03}
"""How often a value of the right map is; else as often as any."""
_FREE_RUNNING: Final = re.compile(r"output|motor|compressor|fan|pulse|reference|set|carrier", re.IGNORECASE)
"""Names of frequencies that are not the mains'."""
_PHASE: Final = re.compile(r"^(?:grid |mains |phase )?voltage (?:L[123]|[abc])\b|^voltage$|L\d-L\d", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class ChartFit:
    """Evidence by kind (`KINDS`), and how many values speak for the map."""

    bits: NDArray[np.float64]
    good: int


def chart_fit(chart: RegisterMap, blocks: Sequence[BlockReadings], values: Sequence[RegisterValue]) -> ChartFit:
    """The evidence; `values` are what was inferred without a map."""
    evidence = dict.fromkeys(KINDS, 0.0)
    evidence["device"] = 1.0
    asked = list({block.key: block for block in blocks if not block.written}.values())
    _requests(chart, asked, evidence)
    evidence["types"] = sum(_types(chart, values))
    good = _values(chart, asked, evidence)
    return ChartFit(np.array([_damped(evidence[kind]) for kind in KINDS]), good)


def _damped(bits: float) -> float:
    """Much evidence of one kind has much in common: of 8 bits 6, of 24 bits 12."""
    return math.copysign(math.log1p(abs(bits) / 12) * 12, bits) if bits else 0.0


def _requests(chart: RegisterMap, blocks: Sequence[BlockReadings], evidence: dict[str, float]) -> None:
    """Where requests begin and end against where the map's values do."""
    polled = listed = 0
    regions: set[tuple[int, int]] = set()
    for block in blocks:
        layout = _AreaLayout.of(chart, block.area)
        end = block.address + block.quantity
        region = next(((low, high) for low, high in layout.regions if block.address < high and end > low), None)
        polled += block.quantity
        if region is None:
            evidence["strays"] -= 1.0
            continue
        listed += sum(at in layout.words for at in range(block.address, end))
        if block.area in ("input", "holding"):
            for here, chance in (
                (layout.edge(block.address, begin=True), layout.begins(region)),
                (layout.edge(end, begin=False), layout.ends(block.address)),
            ):
                ratio = math.log2(_PULL[here] / sum(_PULL[edge] * share for edge, share in chance.items()))
                evidence["cuts" if here == "within" else "edges"] += ratio
        if region not in regions:
            regions.add(region)
            chance_there = (math.log2(2 + region[1]) - math.log2(1 + region[0])) / 16
            evidence["region"] += min(-math.log2(min(chance_there, 1.0)), 6.0)
    if polled:
        evidence["unlisted"] -= 8.0 * max(0.0, 0.6 - listed / polled)


class _AreaLayout:
    """Where the values of one area of a map begin and end."""

    def __init__(self, rows: Sequence[MappedValue]) -> None:
        self.words = {at for row in rows for at in range(row.address, row.end)}
        self._starts, self._ends = {row.address for row in rows}, {row.end for row in rows}
        self.regions: list[tuple[int, int]] = []
        for row in sorted(rows, key=lambda row: row.address):
            if self.regions and row.address - self.regions[-1][1] <= _APART:
                self.regions[-1] = (self.regions[-1][0], max(self.regions[-1][1], row.end))
            else:
                self.regions.append((row.address, row.end))

    @classmethod
    def of(cls, chart: RegisterMap, area: MapArea) -> _AreaLayout:
        return cls([row for row in chart.rows if row.area == area])

    def edge(self, address: int, *, begin: bool) -> str:
        """What a request has that begins at (or ends before) an address: an entry of `_PULL`."""
        edges, beyond = (self._starts, address - 1) if begin else (self._ends, address)
        if address in edges:
            return "value" if beyond in self.words else "group"
        return "within" if (address if begin else address - 1) in self.words else "none"

    def begins(self, region: tuple[int, int]) -> Mapping[str, float]:
        """By chance, of a request that begins in or before a region, round addresses as often as others."""
        return _shares(self.edge(at, begin=True) for at in range(max(0, region[0] - 4), region[1]))

    def ends(self, address: int) -> Mapping[str, float]:
        """By chance, of one that begins there: of lengths the short ones are frequent."""
        shares = dict.fromkeys(_PULL, 0.0)
        weights = 0.0
        for quantity in range(1, _LONGEST + 1):
            weight = 1 / (quantity + 4)
            shares[self.edge(address + quantity, begin=False)] += weight
            weights += weight
        return {edge: share / weights for edge, share in shares.items()}


def _shares(edges: Iterator[str]) -> Mapping[str, float]:
    found = list(edges)
    return {edge: found.count(edge) / max(len(found), 1) for edge in _PULL}


def _types(chart: RegisterMap, values: Sequence[RegisterValue]) -> Iterator[float]:
    """How well what was inferred without a map agrees with it."""
    for value in values:
        row = chart.at(value.area, value.address)
        if row is None or not value.changes or row.type == "text" or value.area in ("coil", "discrete"):
            continue
        order = row.order if row.length > 1 else None
        prior = _TYPES.get((row.length, row.is_float), 0.05)
        share = (1.0 - value.confidence) * prior
        if (row.address, row.length, row.is_float) == (value.address, value.words, value.kind == "float"):
            share = value.confidence if row.length == 1 or order == value.order else share
        elif (second := value.runner_up) is not None and (row.address, row.length, row.is_float, order) == (
            second.address, second.words, second.kind == "float", second.order,
        ):  # fmt: skip
            share = second.confidence
        yield math.log2(max(share, 0.02) / prior)


def _values(chart: RegisterMap, blocks: Sequence[BlockReadings], evidence: dict[str, float]) -> int:
    """How plausible the readings are as what the map says that they measure; how many values speak for it."""
    seen: set[tuple[str, int]] = set()
    good = 0
    for block in blocks:
        if block.area not in ("input", "holding"):
            continue
        series = block.series[0]
        for row in chart.within(block.area, block.address, block.quantity):
            if (row.area, row.address) not in seen:
                seen.add((row.area, row.address))
                at = row.address - block.address
                ratio = _row_bits(row, block, series[:, at : at + row.length])
                evidence["values" if ratio > 0 else "contradictions"] += ratio
                good += ratio > 0.5
    return good


def _row_bits(row: MappedValue, block: BlockReadings, words: NDArray[np.uint16]) -> float:
    """The log likelihood ratio of a value's readings."""
    if row.type == "text":
        return _text_bits(words[-1])
    if row.type == "enum" and row.length == 1 and len(row.values) > 1:
        return _states_bits(row, words[:, 0])
    if row.type in ("enum", "bits", "time") or is_absent(words):
        return 0.0
    scale = row.scale
    if row.scale_address is not None and block.address <= row.scale_address < block.address + block.quantity:
        power = int(block.last[row.scale_address - block.address].astype(np.int16))
        if not -10 <= power <= 10:
            return -4.0
        scale *= 10.0**power
    floats = numbers(words, cast(Order, row.order), is_float=row.is_float, signed=row.is_signed)
    if row.is_float:
        size = np.abs(floats)
        if not np.isfinite(floats).all() or ((size > 0) & (size < 1e-9)).any() or (size > 1e15).any():
            return -5.0
    with np.errstate(all="ignore"):
        floats = floats * scale + row.offset
    sort = _sort(row)
    bounds = _RANGES.get(sort)
    if row.minimum is not None and row.maximum is not None and row.maximum > row.minimum:
        low, high = (row.minimum, row.maximum) if bounds is None else bounds
        bounds = (max(low, row.minimum), min(high, row.maximum)) if not row.writable else bounds
    zero = _ZEROS.get(sort, _ZERO)
    if not floats.any():
        return math.log2(zero / _ZERO)
    if bounds is None:
        return 0.0
    inside = bool(((floats >= bounds[0]) & (floats <= bounds[1])).mean() > 0.9)
    chance = _chance(row, scale, bounds)
    right = (1 - zero) * (_RIGHT if inside else 1 - _RIGHT)
    by_chance = (1 - _ZERO) * (chance if inside else 1 - chance)
    return math.log2(right / max(by_chance, 1e-3))


def _sort(row: MappedValue) -> str:
    """What a value measures, an entry of `_RANGES` or its unit."""
    name = row.name.lower()
    if "power factor" in name and "scale" not in name:
        return "power factor"
    if row.unit == "Hz" and not _FREE_RUNNING.search(name):
        return "mains"
    return "phase" if row.unit == "V" and _PHASE.search(row.name) else row.unit


def _chance(row: MappedValue, scale: float, bounds: tuple[float, float]) -> float:
    """How often a number that is not zero lies in these bounds by chance: as often as its logarithm does."""
    low, high = ((bound - row.offset) / (scale or 1.0) for bound in bounds)
    if row.is_float:
        low, high = (math.log2(max(abs(bound), 1e-3)) for bound in (max(low, 0.0), high))
        return min(max(0.85 * (high - low) / (math.log2(1e8) - math.log2(1e-3)), 0.01), 0.95)
    bits = 16 * row.length
    low, high = (math.log2(min(max(bound, 0.0), 2.0**bits) + 1) for bound in (low, high))
    return min(max((high - low) / min(bits, 28), 0.01), 0.95)


def _states_bits(row: MappedValue, states: NDArray[np.uint16]) -> float:
    """Of an enum: whether all states are listed; a state that is not zero is rarely so by chance."""
    seen = set(np.unique(states).tolist())
    if not seen <= set(row.values):
        return -3.0
    if seen == {0}:
        return 0.3
    least = math.log2(2 + max(seen - {0xFFFF}, default=0))
    return min(3.5, max(0.5, 4.0 - least * 0.5))


def _text_bits(words: NDArray[np.uint16]) -> float:
    """Of a text: whether its characters are some."""
    data = words.byteswap().tobytes().rstrip(b"\0 \xff")
    if not data:
        return -0.3
    printable = all(0x20 <= byte < 0x7F for byte in data.strip(b"\0"))
    return min(1.5 * len(data), 6.0) if printable else -3.0
