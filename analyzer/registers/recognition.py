"""Which device is this? Maps that fit what a unit says of itself, what it is asked for, and what it answers.

Evidence is counted in bits, for each map against "none of those that are known". A text in the answer to function 17
or 43, or constants at known addresses, decide nearly alone; else what is asked for and what is answered add up
(`chartfit`), weighed as was learnt on devices of the shipped maps, of other makers, and of sister models. Said only
with how sure.

SunSpec says itself what it is: `SunS`, then models one behind another, each with its number and length, to FFFF. What
was read of a unit is walked; models that are known are put where the chain has them. A model that nobody knows is
named by its number, so that its registers are not taken for others'.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from dissectors.maps import RegisterMap, shipped_map, shipped_names
from dissectors.maps.model import MappedValue

from ..languages import register_words
from ..tables.batch import Batch
from ..tables.schema import Kind
from .chartfit import KINDS, chart_fit
from .readings import BlockReadings, RegisterReadings
from .roles import RegisterValue
from .telling import place_words

_MARK: Final = (0x5375, 0x6E53)  # SunS
_BASES: Final = (40000, 50000, 0)
_END: Final = 0xFFFF
_MOST: Final = 64  # models of a device
_LONGEST: Final = 4096
_HOME: Final = {  # models by number: the shipped map and the address there of the model's number
    1: ("fronius-sunspec-int", 40002),
    **dict.fromkeys((101, 102, 103), ("fronius-sunspec-int", 40069)),
    **dict.fromkeys((111, 112, 113), ("fronius-sunspec-float", 40069)),
}


@dataclass(frozen=True, slots=True)
class ChainModel:
    """A model of a device: its number, the address of that number, and the registers behind number and length."""

    number: int
    address: int
    length: int


def sunspec_chain(blocks: Iterable[BlockReadings]) -> list[ChainModel]:
    """The models of a unit as far as they were read; empty where no chain begins."""
    words: dict[int, int] = {}
    for block in blocks:
        if block.area == "holding" and not block.written:
            words.update(enumerate(block.last.tolist(), block.address))
    for base in _BASES:
        if (words.get(base), words.get(base + 1)) == _MARK:
            return _walked(words, base + 2)
    return []


def _walked(words: Mapping[int, int], at: int) -> list[ChainModel]:
    models: list[ChainModel] = []
    while len(models) < _MOST and words.get(at, _END) != _END and 0 < words.get(at + 1, 0) <= _LONGEST:
        models.append(ChainModel(words[at], at, words[at + 1]))
        at += 2 + words[at + 1]
    return models


def sunspec_map(chain: list[ChainModel]) -> RegisterMap | None:
    """The map of a device with this chain; None where none of its models is known but the first."""
    rows: list[MappedValue] = []
    for model in chain:
        rows += _placed(model)
    if not any(model.number in _HOME and model.number != 1 for model in chain):
        return None
    numbers = ", ".join(str(model.number) for model in chain)
    source = "SunSpec Alliance information models (Apache-2.0), put where the device has them"
    device = register_words("SunSpec device (models {numbers})", numbers=numbers)
    return RegisterMap(device, tuple(rows), vendor="SunSpec", source=source)


def at_home(chain: list[ChainModel]) -> bool:
    """Whether all models stand where a shipped map has them."""
    return all(model.number in _HOME and _HOME[model.number][1] == model.address for model in chain)


def _placed(model: ChainModel) -> list[MappedValue]:
    if model.number not in _HOME:
        name = f"SunSpec model {model.number}"
        return [MappedValue("holding", model.address, name, "u16"),
                MappedValue("holding", model.address + 1, f"{name} length", "u16")]  # fmt: skip
    name, home = _HOME[model.number]
    shift = model.address - home
    last = model.address + 2 + model.length
    return [
        replace(
            row,
            address=row.address + shift,
            scale_address=None if row.scale_address is None else row.scale_address + shift,
        )
        for row in _chart_rows(name, home)
        if row.end + shift <= last
    ]


@lru_cache(maxsize=8)
def _chart_rows(name: str, home: int) -> tuple[MappedValue, ...]:
    """The rows of a shipped map from this model on, to the next one."""
    rows = shipped_map(name).rows
    later = [at for shipped, at in _HOME.values() if shipped == name and at > home]
    end = min(later, default=0x10000)
    return tuple(row for row in rows if home <= row.address < end)


_TELLING: Final = {17: "server_id", 43: "identification"}
_LEAST: Final = 0.6  # confidence below which nothing is said
_UNSAID: Final = 0.9  # the most where the device does not say what it is
_CHAIN: Final = 0.99  # of a chain of SunSpec models that was walked
_TEXT_BITS, _WORD_BITS, _POLL_BITS = 14.0, 5.0, 3.0
_WEIGHTS: Final[Mapping[str, float]] = {
    "device": -3.6, "region": 0.68, "edges": 0.12, "cuts": 0.53, "strays": 1.5, "unlisted": 1.5, "types": 0.1,
    "values": 0.29, "contradictions": 0.49,
}  # fmt: skip
"""What a bit of each kind of evidence is worth (in nats), by `benchmarks/fit_recognition.py`."""


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
            models = "model {number} at {at}"
            where = ", ".join(register_words(models, number=model.number, at=model.address) for model in chain)
            begin = register_words("SunS at {place}", place=place_words("holding", chain[0].address - 2))
            likeliest.append(Recognised(unit, "", placed, _CHAIN, f"{begin}: {where}"))
            continue
        inferred = [value for value in values if value.unit == unit]
        scores = {name: chart_evidence(chart, mine, answers, inferred) for name, chart in charts.items()}
        best = max(scores, key=lambda name: scores[name].bits)
        bits = np.array([0.0, *(score.bits for score in scores.values())])
        share = 2.0 ** np.minimum(bits - bits.max(), 0)
        confidence = float(2.0 ** (scores[best].bits - bits.max()) / share.sum())
        if not scores[best].is_told:
            confidence = min(confidence, _UNSAID)  # a sister that no map is of may look the same
        if confidence >= _LEAST:
            likeliest.append(Recognised(unit, best, charts[best], round(confidence, 3), scores[best].why))
    return likeliest


@dataclass(frozen=True, slots=True)
class ChartEvidence:
    """What speaks for a map over none: in bits, and in words (the main reasons). `is_told`: whether the device itself
    says what it is, by its name or by the constants that it holds."""

    bits: float
    why: str
    is_told: bool


def chart_evidence(
    chart: RegisterMap,
    blocks: Sequence[BlockReadings],
    said: Mapping[str, bytes],
    values: Sequence[RegisterValue] = (),
) -> ChartEvidence:
    """Evidence for a map over none; `values` are what was inferred without it."""
    reasons: list[str] = []
    told = False
    fit = chart_fit(chart, blocks, values)
    bits = float(fit.bits @ [_WEIGHTS[kind] for kind in KINDS]) / math.log(2)
    for which, wanted in (("server_id", chart.match.server_id), ("identification", chart.match.identification)):
        for text in wanted:
            if text.encode() in said.get(which, b""):
                bits += _TEXT_BITS
                told = True
                reasons.append(register_words("it calls itself {text!r}", text=text))
        if wanted and which in said and not told:
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
            bits += (
                _WORD_BITS * (1 + len(words)) if same else -2.0 * alone
            )  # some answer so only when asked for it alone
            if same:
                told = True
                held = " ".join(f"{word:04X}" for word in words)
                reasons.append(register_words("{place} holds {held}", place=place_words(area, address), held=held))
    for area, address, quantity in chart.match.polls:
        if any((b.area, b.address, b.quantity) == (area, address, quantity) for b in blocks):
            bits += _POLL_BITS
            asked = {"place": place_words(area, address), "last": address + quantity - 1}
            reasons.append(register_words("it is asked for {place} to {last}", **asked))
    if fit.good:
        fitting = "{good:value|values} {good:|is as it|are as they} should be"
        reasons.append(register_words(fitting, good=fit.good))
    return ChartEvidence(bits, "; ".join(reasons), told)
