"""How sure a cause is, calibrated on simulated buses of which a fifth of the vocabulary was hidden in turns.

Bits settle which of two causes it is; they do not settle whether it is one that nobody thought of, and more of the same
data never does. So certainty is fitted: by the margin over the next best cause, by how like the outcomes of the exchanges
that it claims are to those where it is so, by what the symptoms hang on that the cause says nothing of, and by how often
the cause was named where its bus had another fault. The weights stand in `certainty.json`, which `benchmarks/fit_certainty.py` makes; docs/causes.md has what
came of it on seeds that were held out.
"""

from __future__ import annotations

import json
from collections import defaultdict
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from math import exp, lgamma, log, log2
from typing import Any, Final, Literal, NamedTuple

from .contrasts import HITS_OF, Family
from .costs import kind_of
from .evidence import Evidence
from .exchanges import Ending
from .foretold import values_alone_bits
from .registry import Foretold, Suspicion, Symptom
from .taken import move

MOST: Final = 0.97  # of what was told on held-out buses as surer than that, no more was so
LEAST: Final = 0.05
_SURELY: Final = 0.9
_LIKELY: Final = 0.6
_FEW_BITS: Final = 12.0  # what no rival is taken to have
_TOLD: Final = 60.0  # exchanges: more of the same tell no more of what is the matter
_STEADINESS: Final = 8.0  # how much alike the outcomes of one cause are from bus to bus
_ANY: Final = 0.02
_UNIT: Final = 8.0  # bits, of that clue
_MOST_TYPICAL: Final = 4.0
Outcomes = Mapping[str, float]

Words = Literal["certain", "most likely", "perhaps"]


class Clues(NamedTuple):
    """What certainty goes by; all about between 0 and 10."""

    bits: float  # log2 of all bits
    margin: float  # share of them that the next best cause has not
    unsaid: float  # log2 of the bits of contrasts that the cause says nothing of
    taken: float  # log2 of the bits for that the client took what is said to be damaged on the line
    values: float  # and for that values alone are hit, where that is no line's doing


def clues(evidence: Evidence, found: Suspicion, foretold: Foretold, rival_bits: float) -> Clues:
    """Of one suspicion. `rival_bits`: of the next best cause of the same symptoms, 0 for none."""
    rival = max(rival_bits, _FEW_BITS)
    margin = max(found.bits - rival, 0.0) / max(found.bits, 1.0)
    unsaid = taken = values = 0.0
    for symptom, unit in found.explains:
        if unit is None or (found.units and unit not in found.units):
            continue
        if symptom in HITS_OF and symptom not in foretold.hangs_on:
            unsaid += max(evidence.best_contrast(symptom, unit, Family.ASKED, Family.BEFORE).bits, 0.0)
        if symptom is Symptom.DAMAGE and foretold.client_loses:
            taken += max(move(evidence, unit).bits, 0.0)
            values += values_alone_bits(evidence, (unit,))
    return Clues(log2(max(found.bits, 2.0)), margin, log2(1 + unsaid), log2(1 + taken), log2(1 + values))


def outcomes(evidence: Evidence, found: Suspicion) -> Outcomes:
    """What became of the exchanges that a suspicion is about: how many of each sort, at most so many that more of the
    same tells no more."""
    units = [unit for unit in evidence.units if not found.units or unit.unit in found.units]
    counts: defaultdict[str, float] = defaultdict(float)
    for unit in units:
        readings, followed = evidence.garbage(unit), evidence.followed(unit)
        counts["well"] += max(unit.answered - unit.count(Ending.EXCEPTION) - unit.behind, 0)
        counts["silent"] += unit.count(Ending.SILENT)
        counts["refused"] += unit.count(Ending.EXCEPTION)
        counts["late"] += unit.late + unit.unfit + unit.strays
        counts["double"] += unit.doubles
        for each in readings:
            counts[kind_of(each)] += unit.count(Ending.GARBAGE) / len(readings)
        for each in followed:
            counts[f"behind: {each.behind.value}"] += unit.behind / len(followed)
    every = sum(counts.values())
    return {name: count * min(_TOLD / every, 1.0) for name, count in counts.items()} if every else {}


def typical(shares: Mapping[str, Mapping[str, float]], cause: str, found: Outcomes) -> float:
    """How much likelier (bits) such outcomes are where that cause is so than where anything is wrong, both as they spread
    from bus to bus (Dirichlet and multinomial); `shares` by cause, those of anything by ""."""
    if not found or cause not in shares:
        return 0.0
    mine, any_way = (_spread_bits(shares[name], found) for name in (cause, ""))
    return min(max((mine - any_way) / _UNIT, -_MOST_TYPICAL), _MOST_TYPICAL)


def _spread_bits(shares: Mapping[str, float], found: Outcomes) -> float:
    weights = {name: _STEADINESS * shares.get(name, 0.0) + _ANY for name in shares.keys() | found.keys()}
    every, count = sum(weights.values()), sum(found.values())
    sums = sum(lgamma(weights[name] + n) - lgamma(weights[name]) for name, n in found.items())
    return (lgamma(every) - lgamma(every + count) + sums) / log(2)


@cache
def _weights() -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads(files(__package__).joinpath("certainty.json").read_text("utf-8"))
    return found


def certainty(cause: str, clues_of_it: Clues, found: Outcomes) -> float:
    """How sure that is, 0 to 1."""
    weights = _weights()
    score = weights["intercept"] + weights["causes"].get(cause, weights["other"])
    score += sum(weights["clues"][name] * value for name, value in clues_of_it._asdict().items())
    score += weights["clues"]["typical"] * typical(weights["shares"], cause, found)
    return min(max(1 / (1 + exp(-score)), LEAST), MOST)


def calibration() -> list[tuple[float, float, int, float, float]]:
    """What became of claims on buses that nothing was fitted to, a fifth of all causes hidden in turns: from which certainty
    to which, how many claims, how sure they were in the mean, and which share of them was so."""
    return [tuple(each) for each in _weights().get("told", {}).get("all", [])]


def in_words(share: float) -> Words:
    """What certainty is called."""
    return "certain" if share >= _SURELY else "most likely" if share >= _LIKELY else "perhaps"
