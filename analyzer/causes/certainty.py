"""How sure a cause is, calibrated on simulated buses of which a fifth of the vocabulary was hidden in turns.

Bits settle which of two causes it is; they do not settle whether it is one that nobody thought of, and more of the same
data never does. So certainty is fitted: by the margin over the next best cause, by bits a hit rather than bits in all,
by what the symptoms hang on that the cause says nothing of, and by how often the cause was named where its bus had
another fault. The weights stand in `certainty.json`, which `benchmarks/fit_certainty.py` makes; docs/causes.md has what
came of it on seeds that were held out.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from math import exp, log2
from typing import Any, Final, Literal, NamedTuple

from .contrasts import HITS_OF, Family
from .evidence import Evidence
from .exchanges import Ending
from .registry import Foretold, Suspicion, Symptom
from .taken import move

MOST: Final = 0.97  # of what was told on held-out buses as surer than that, no more was so
LEAST: Final = 0.05
CALIBRATED: Final = 0.5  # a figure is told from here on: so few claims are less sure that theirs may be anything
_SURELY: Final = 0.9
_LIKELY: Final = 0.6
_FEW_BITS: Final = 12.0  # what no rival is taken to have

Words = Literal["certain", "most likely", "perhaps"]


class Clues(NamedTuple):
    """What certainty goes by; all about between 0 and 10."""

    bits: float  # log2 of all bits
    margin: float  # share of them that the next best cause has not
    a_hit: float  # log2 of bits a hit
    unsaid: float  # log2 of the bits of contrasts that the cause says nothing of
    taken: float  # log2 of the bits for that the client took what is said to be damaged on the line


def clues(evidence: Evidence, found: Suspicion, foretold: Foretold, rival_bits: float) -> Clues:
    """Of one suspicion. `rival_bits`: of the next best cause of the same symptoms, 0 for none."""
    rival = max(rival_bits, _FEW_BITS)
    margin = max(found.bits - rival, 0.0) / max(found.bits, 1.0)
    unsaid = taken = 0.0
    for symptom, unit in found.explains:
        if unit is None or (found.units and unit not in found.units):
            continue
        if symptom in HITS_OF and symptom not in foretold.hangs_on:
            unsaid += max(evidence.best_contrast(symptom, unit, Family.ASKED, Family.BEFORE).bits, 0.0)
        if symptom is Symptom.DAMAGE and foretold.client_loses:
            taken += max(move(evidence, unit).bits, 0.0)
    a_hit = found.bits / max(_hits(evidence, found), 1)
    return Clues(log2(max(found.bits, 2.0)), margin, log2(1 + a_hit), log2(1 + unsaid), log2(1 + taken))


def _hits(evidence: Evidence, found: Suspicion) -> int:
    """About how many exchanges a suspicion is about."""
    hits = 0
    for symptom, number in found.explains:
        unit = evidence.ledger.units.get(number) if number is not None else None
        if unit is None or (found.units and number not in found.units):
            continue
        if symptom is Symptom.SILENCE:
            hits += unit.count(Ending.SILENT)
        elif symptom is Symptom.DAMAGE:
            hits += unit.count(Ending.GARBAGE)
        elif symptom is Symptom.REFUSAL:
            hits += unit.count(Ending.EXCEPTION)
        elif symptom is Symptom.BEHIND:
            hits += unit.behind
    return hits


@cache
def _weights() -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads(files(__package__).joinpath("certainty.json").read_text("utf-8"))
    return found


def certainty(cause: str, clues_of_it: Clues) -> float:
    """How sure that is, 0 to 1."""
    weights = _weights()
    score = weights["intercept"] + weights["causes"].get(cause, weights["other"])
    score += sum(weights["clues"][name] * value for name, value in clues_of_it._asdict().items())
    return min(max(1 / (1 + exp(-score)), LEAST), MOST)


def calibration() -> list[tuple[float, float, int, float, float]]:
    """What became of claims on buses that nothing was fitted to, a fifth of all causes hidden in turns: from which certainty
    to which, how many claims, how sure they were in the mean, and which share of them was so."""
    return [tuple(each) for each in _weights().get("told", {}).get("all", [])]


def in_words(share: float) -> Words:
    """What certainty is called."""
    return "certain" if share >= _SURELY else "most likely" if share >= _LIKELY else "perhaps"
