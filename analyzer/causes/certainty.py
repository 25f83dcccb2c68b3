"""How sure a cause is, calibrated on simulated buses of which a fifth of the vocabulary was hidden in turns.

Bits settle which of two causes it is; they do not settle whether it is one that nobody thought of, and more of the same
data never does. So certainty is fitted: by the margin over the next best cause, by what the symptoms hang on that such
a cause does not make, by how often the cause was named where its bus had another fault, and by how typical the
exchanges that it claims are of it, where "none of these" is a hypothesis as well (`analyzer.causes.traits`); and on
buses of several hands, for each has habits that the others have not. The weights stand in `certainty.json`, which
`benchmarks/fit_certainty.py` makes; docs/causes.md has what came of it on seeds that were held out.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from math import exp, log2
from typing import Any, Final, NamedTuple

from .bits import surplus_bits
from .evidence import Evidence
from .foretold import unforetold_bits
from .registry import Foretold, Suspicion
from .traits import Traits, sorts_of, typical

MOST: Final = 0.97  # of what was told on held-out buses as surer than that, no more was so
LEAST: Final = 0.05
_FEW_BITS: Final = 12.0  # what no rival is taken to have
_BACKGROUND: Final = 0.02  # of the exchanges


class Clues(NamedTuple):
    """What certainty goes by, but for traits; all about between 0 and 10."""

    margin: float  # share of its bits that the next best cause has not
    own: float  # log2 of the bits that are for this cause, and not just for that something is wrong
    unforetold: float  # log2 of the bits of contrasts, and of all else, that such a cause does not make


def clues(evidence: Evidence, found: Suspicion, foretold: Foretold, *, rival_bits: float) -> Clues:
    """Of one suspicion. `rival_bits`: of the next best cause of the same symptoms, 0 for none."""
    return Clues(
        max(found.bits - max(rival_bits, _FEW_BITS), 0.0) / max(found.bits, 1.0),
        log2(1 + max(found.bits - _plain(evidence, found), 0.0)),
        log2(1 + unforetold_bits(evidence, foretold, found) + found.against),
    )


def _plain(evidence: Evidence, found: Suspicion) -> float:
    """Bits for that a unit has more of such symptoms than units that are well."""
    bits = 0.0
    for symptom, number in found.explains:
        unit = evidence.ledger.units.get(number) if number is not None else None
        if unit is not None and (not found.units or number in found.units):
            hits = sum(n for each, _, n in sorts_of(evidence, unit) if each is symptom)
            bits += surplus_bits(min(hits, unit.asked), unit.asked, _BACKGROUND)
    return bits


@cache
def _weights() -> Mapping[str, Any]:
    found: Mapping[str, Any] = json.loads(files(__package__).joinpath("certainty.json").read_text("utf-8"))
    return found


def certainty(cause: str, clues_of_it: Clues, traits: Traits) -> float:
    """How sure that is, 0 to 1."""
    weights = _weights()
    score = weights["intercept"] + weights["causes"].get(cause, weights["other"])
    known = clues_of_it._asdict() | typical(weights["shares"], weights["none"], cause, traits)
    score += sum(weights["clues"][name] * value for name, value in known.items())
    return min(max(1 / (1 + exp(-score)), LEAST), MOST)


def calibration() -> list[tuple[float, float, int, float, float]]:
    """What became of claims on buses that nothing was fitted to, a fifth of all causes hidden in turns: from which certainty
    to which, how many claims, how sure they were in the mean, and which share of them was so."""
    return [tuple(each) for each in _weights().get("told", [])]


def told_on() -> str:
    """The day on which that was told, as YYYY-MM-DD."""
    return str(_weights().get("told_on", ""))
