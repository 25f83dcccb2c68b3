"""Which device is this? Maps that fit what a unit says of itself, what it is asked for, and what it answers.

Evidence is counted in bits, for each map against "none of those that are known". A text in the answer to function 17 or
43, or constants at known addresses, decide nearly alone; polled blocks and plausible values (a frequency near 50, a
power factor below 1, floats that are floats) add up. Said only with how sure.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.maps import RegisterMap, shipped_map, shipped_names
from dissectors.maps.model import MappedValue
from dissectors.values import Order

from ..tables.batch import Batch
from ..tables.schema import Kind
from .hypotheses import numbers
from .readings import BlockReadings, RegisterReadings
from .sunspec import at_home, sunspec_chain, sunspec_map
from .values import RegisterValue
from .wordclasses import is_absent

_TELLING: Final = {17: "server_id", 43: "identification"}
_NONE: Final = 7.0  # bits for a device that no map is of
_LEAST: Final = 0.8  # confidence below which nothing is said
_UNSAID: Final = 0.9  # the most where the device does not say what it is
_MOST_ADDRESSES: Final = 12.0  # bits that addresses alone can say
_MOST_TYPES: Final = 8.0  # and what was inferred of its values
_SURE: Final = 0.9
_CHAIN: Final = 0.99  # of a chain of SunSpec models that was walked
_TEXT_BITS, _WORD_BITS, _POLL_BITS = 14.0, 5.0, 3.0
_RANGES: Final[Mapping[str, tuple[float, float]]] = {
    "mains": (40.0, 70.0), "Hz": (0.0, 1000.0), "V": (3.0, 1200.0), "A": (-2000.0, 2000.0), "kW": (-5000.0, 5000.0),
    "W": (-5e6, 5e6), "°C": (-60.0, 400.0), "%": (-150.0, 150.0),
}  # fmt: skip
_ZERO_SAYS: Final = {"mains": -2.0, "V": -0.3}
_FREE_RUNNING: Final = re.compile(r"output|motor|compressor|fan|pulse|reference|set|carrier", re.IGNORECASE)
"""Names of frequencies that are not the mains'."""


@dataclass(frozen=True, slots=True)
class Recognised:
    """A unit and the map that it seems to be of; `name` is that of a shipped map, empty of one made from a chain."""

    unit: int
    name: str
    chart: RegisterMap
    confidence: float
    why: str


class UnitTexts:
    """What units say of themselves: the answers to functions 17 and 43, by unit."""

    def __init__(self) -> None:
        self.texts: dict[tuple[int, str], bytes] = {}

    def feed(self, batch: Batch) -> None:
        """Take in a batch."""
        rows = batch.rows
        answers = np.isin(rows.function, list(_TELLING)) & (rows.kind == Kind.RESPONSE)
        for row in np.flatnonzero(answers & rows.check & (rows.exception == 0)).tolist():
            key = (int(rows.unit[row]), _TELLING[int(rows.function[row])])
            if len(self.texts) < 1024 or key in self.texts:
                before = self.texts.get(key, b"")
                new = batch.bytes_of(row)
                if new not in before and len(before) < 4096:
                    self.texts[key] = before + new


def recognised(
    readings: RegisterReadings,
    texts: UnitTexts,
    values: Sequence[RegisterValue],
    charts: Mapping[str, RegisterMap] | None = None,
) -> list[Recognised]:
    """The likeliest map of each unit of which one is likelier than none; `values` are what was inferred without a map,
    `charts` the maps by name, else the shipped ones."""
    charts = charts if charts is not None else {name: shipped_map(name) for name in shipped_names()}
    blocks: dict[int, list[BlockReadings]] = {}
    for block in readings:
        blocks.setdefault(block.unit, []).append(block)
    likeliest = []
    for unit in sorted({*blocks, *(unit for unit, _ in texts.texts)}):
        mine = blocks.get(unit, [])
        answers = {which: text for (number, which), text in texts.texts.items() if number == unit}
        chain = sunspec_chain(mine)
        if chain and not at_home(chain) and (placed := sunspec_map(chain)) is not None:
            where = ", ".join(f"model {model.number} at {model.address}" for model in chain)
            likeliest.append(Recognised(unit, "", placed, _CHAIN, f"SunS at holding {chain[0].address - 2}: {where}"))
            continue
        inferred = [value for value in values if value.unit == unit]
        scores = {name: chart_bits(chart, mine, answers, inferred) for name, chart in charts.items()}
        best = max(scores, key=lambda name: scores[name][0])
        bits = np.array([_NONE, *(score for score, _ in scores.values())])
        share = 2.0 ** np.minimum(bits - bits.max(), 0)
        confidence = float(2.0 ** (scores[best][0] - bits.max()) / share.sum())
        if not any(word in scores[best][1] for word in ("calls itself", " holds ")):
            confidence = min(confidence, _UNSAID)  # a sister that no map is of may look the same
        if confidence >= _LEAST:
            likeliest.append(Recognised(unit, best, charts[best], round(confidence, 3), scores[best][1]))
    return likeliest


def chart_bits(
    chart: RegisterMap,
    blocks: Sequence[BlockReadings],
    said: Mapping[str, bytes],
    values: Sequence[RegisterValue] = (),
) -> tuple[float, str]:
    """Evidence for a map, and its main reasons."""
    reasons: list[str] = []
    bits = _addresses_bits(chart, blocks) + _types_bits(chart, values)
    for which, wanted in (("server_id", chart.match.server_id), ("identification", chart.match.identification)):
        for text in wanted:
            if text.encode() in said.get(which, b""):
                bits += _TEXT_BITS
                reasons.append(f"it calls itself {text!r}")
        if wanted and which in said and not reasons:
            bits -= _TEXT_BITS
    for area, address, words in chart.match.registers:
        block = next(
            (
                b
                for b in blocks
                if b.area == area and b.address <= address and address + len(words) <= b.address + b.quantity
            ),
            None,
        )
        if block is not None:
            at = address - block.address
            same = block.last[at : at + len(words)].tolist() == list(words)
            alone = block.quantity == len(words) or len(words) > 1
            bits += (_WORD_BITS * (1 + len(words)) if same else -2.0) if alone else 0.0
            if same and alone:
                reasons.append(f"{area} {address} holds {' '.join(f'{word:04X}' for word in words)}")
    for area, address, quantity in chart.match.polls:
        if any((b.area, b.address, b.quantity) == (area, address, quantity) for b in blocks):
            bits += _POLL_BITS
            reasons.append(f"it is asked for {area} {address} to {address + quantity - 1}")
    fit, counted = _values_bits(chart, blocks)
    if counted:
        reasons.append(f"{counted} values are as they should be")
    return bits + fit, "; ".join(reasons)


def _addresses_bits(chart: RegisterMap, blocks: Sequence[BlockReadings]) -> float:
    """How well the requests fit the map's addresses: the farther from zero, the less by chance."""
    begins = {(row.area, row.address) for row in chart.rows}
    ends = {(row.area, row.end) for row in chart.rows}
    bits = 0.0
    for block in {block.key: block for block in blocks if not block.written}.values():
        rarity = min(math.log2(1 + block.address) / 4, 3.5)
        if not chart.within(block.area, block.address, block.quantity):
            bits -= 1.5
            continue
        bits += rarity * ((block.area, block.address) in begins)
        bits += rarity / 2 * ((block.area, block.address + block.quantity) in ends)
    return min(bits, _MOST_ADDRESSES)


def _types_bits(chart: RegisterMap, values: Sequence[RegisterValue]) -> float:
    """How well what was inferred without a map agrees with it."""
    bits = 0.0
    for value in values:
        row = chart.at(value.area, value.address)
        if row is None or not value.changes or value.confidence < _SURE:
            continue
        if (row.address, row.length, row.is_float) == (value.address, value.words, value.kind == "float"):
            right = row.length == 1 or row.order == value.order
            bits += (0.25 if row.length == 1 else 1.5) if right else -3.0
        elif value.words > 1 or value.kind == "float":
            bits -= 3.0
    return max(min(bits, _MOST_TYPES), -_MOST_TYPES)  # one mistake about a device's words shows in many


def _values_bits(chart: RegisterMap, blocks: Sequence[BlockReadings]) -> tuple[float, int]:
    """How plausible the values of the polled registers are under the map, and how many speak for it."""
    bits, good, polled, listed = 0.0, 0, 0, 0
    for block in blocks:
        if block.written or block.area not in ("input", "holding"):
            continue
        rows = chart.within(block.area, block.address, block.quantity)
        polled += block.quantity
        listed += sum(row.length for row in rows)
        bits -= 2.0 * sum(_is_cut(row, block) for row in chart.rows)
        for row in rows:
            score = _row_bits(row, block)
            bits += score
            good += score > 0.5
    if polled:
        bits -= 8.0 * max(0.0, 0.5 - listed / polled)
    return bits, good


def _is_cut(row: MappedValue, block: BlockReadings) -> bool:
    """Whether a block begins or ends within a value."""
    if row.area != block.area or row.length == 1 or row.type == "text":
        return False
    end = block.address + block.quantity
    return row.address < block.address < row.end or row.address < end < row.end


def _row_bits(row: MappedValue, block: BlockReadings) -> float:
    """How well the readings of a value are what its map says that it measures."""
    at = row.address - block.address
    words = block.series[0][:, at : at + row.length]
    if row.type == "enum" and row.values:
        states = np.unique(words[:, 0])
        return 0.4 if all(int(state) in row.values for state in states) else -2.0
    if row.type in ("text", "enum", "bits", "time") or row.writable or is_absent(words):
        return 0.0
    values = numbers(words, _order(row), is_float=row.is_float, signed=row.is_signed)
    scale = row.scale
    if row.scale_address is not None and block.address <= row.scale_address < block.address + block.quantity:
        power = int(block.last[row.scale_address - block.address].astype(np.int16))
        if not -10 <= power <= 10:
            return -3.0
        scale *= 10.0**power
    with np.errstate(all="ignore"):
        values = values * scale + row.offset
    score = 0.0
    if row.is_float:
        size = np.abs(values)
        if not np.isfinite(values).all() or ((size > 0) & (size < 1e-6)).any() or (size > 1e12).any():
            return -5.0
        score += 1.2 if (values != 0).any() else 0.0
    name = row.name.lower()
    if "power factor" in name and "scale" not in name:
        beyond = (np.abs(values) > 1.001).any()
        return score + (-2.0 if beyond else 1.0 if (values != 0).any() else 0.0)
    return score + _range_bits(row, values)


def _range_bits(row: MappedValue, values: NDArray[np.float64]) -> float:
    """The same of numbers in a unit of measure."""
    unit = "mains" if row.unit == "Hz" and not _FREE_RUNNING.search(row.name) else row.unit
    if unit not in _RANGES:
        return 0.0
    low, high = _RANGES[unit]
    if not values.any():
        return _ZERO_SAYS.get(unit, 0.0)
    inside = bool(((values >= low) & (values <= high)).mean() > 0.9)
    strength = {"mains": 4.0, "V": 1.0}.get(unit, 0.3)
    return strength if inside else -2.0 * strength


def _order(row: MappedValue) -> Order:
    return row.order  # type: ignore[return-value]
