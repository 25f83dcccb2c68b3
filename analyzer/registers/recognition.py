"""Which device is this? Maps that fit what a unit says of itself, what it is asked for, and what it answers.

Evidence is counted in bits, for each map against "none of those that are known". A text in the answer to function 17 or
43, or constants at known addresses, decide nearly alone; else what is asked for and what is answered add up
(`chartfit`), weighed as was learnt on devices of the shipped maps, of other makers, and of sister models. Said only
with how sure.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from dissectors.maps import RegisterMap, shipped_map, shipped_names

from ..tables.batch import Batch
from ..tables.schema import Kind
from .chartfit import KINDS, chart_fit
from .readings import BlockReadings, RegisterReadings
from .sunspec import at_home, sunspec_chain, sunspec_map
from .values import RegisterValue

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
            where = ", ".join(f"model {model.number} at {model.address}" for model in chain)
            likeliest.append(Recognised(unit, "", placed, _CHAIN, f"SunS at holding {chain[0].address - 2}: {where}"))
            continue
        inferred = [value for value in values if value.unit == unit]
        scores = {name: chart_bits(chart, mine, answers, inferred) for name, chart in charts.items()}
        best = max(scores, key=lambda name: scores[name][0])
        bits = np.array([0.0, *(score for score, _ in scores.values())])
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
    """Evidence for a map over none, and its main reasons."""
    reasons: list[str] = []
    fit = chart_fit(chart, blocks, values)
    bits = float(fit.bits @ [_WEIGHTS[kind] for kind in KINDS]) / math.log(2)
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
            bits += (
                _WORD_BITS * (1 + len(words)) if same else -2.0 * alone
            )  # some answer so only when asked for it alone
            if same:
                reasons.append(f"{area} {address} holds {' '.join(f'{word:04X}' for word in words)}")
    for area, address, quantity in chart.match.polls:
        if any((b.area, b.address, b.quantity) == (area, address, quantity) for b in blocks):
            bits += _POLL_BITS
            reasons.append(f"it is asked for {area} {address} to {address + quantity - 1}")
    if fit.good:
        reasons.append(f"{fit.good} values are as they should be")
    return bits, "; ".join(reasons)
