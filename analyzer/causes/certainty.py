"""How sure a cause is, calibrated on simulated buses of which a fifth of the vocabulary was hidden in turns.

Bits settle which of two causes it is; they do not settle whether it is one that nobody thought of, and more of the same
data never does. So certainty is fitted: by the margin over the next best cause, by how like the outcomes of the exchanges
that it claims are to those where it is so, by what the symptoms hang on that the cause says nothing of, by how much no
cause at all explains, and by how often the cause was named where its bus had another fault. The weights stand in
`certainty.json`, which `benchmarks/fit_certainty.py` makes; docs/causes.md has what came of it on seeds that were held
out.
"""

from __future__ import annotations

import json
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping
from functools import cache
from importlib.resources import files
from math import exp, lgamma, log, log2
from typing import Any, Final, NamedTuple

from .bits import surplus_bits
from .contrasts import HITS_OF, Family
from .costs import kind_of
from .evidence import Evidence
from .exchanges import Ending
from .foretold import unforetold_bits, values_alone_bits
from .registry import Foretold, Suspicion, Symptom
from .signatures import Signature
from .taken import share_that_went_on
from .unitledger import UnitLedger

MOST: Final = 0.97  # of what was told on held-out buses as surer than that, no more was so
LEAST: Final = 0.05
_FEW_BITS: Final = 12.0  # what no rival is taken to have
_TOLD: Final = 60.0  # exchanges: more of the same tell no more of what is the matter
_STEADINESS: Final = 8.0  # how much alike the outcomes of one cause are from bus to bus
_ANY: Final = 0.02
_NO_WORD: Final = 0.2  # how likely it is something that no cause is a word for,
_ANYHOW: Final = 0.3  # whose outcomes are anyhow
_UNIT: Final = 8.0  # bits, of that clue
_MOST_TYPICAL: Final = 4.0
_DUE: Final = 4.0  # exchanges
_BACKGROUND: Final = 0.02  # of them
_CODES: Final = frozenset((1, 2, 3, 4, 5, 6, 10, 11))  # exceptions that differ in what they mean
_OF_ANY_LENGTH: Final = frozenset(("middle", "whole", "head", "other", "none", "cut"))
Outcomes = Mapping[str, float]


class Clues(NamedTuple):
    """What certainty goes by; all about between 0 and 10."""

    bits: float  # log2 of all bits
    margin: float  # share of them that the next best cause has not
    unsaid: float  # log2 of the bits of contrasts that the cause says nothing of
    values: float  # log2 of the bits for that values alone are hit, where that is no line's doing
    own: float  # log2 of the bits that are for this cause, and not just for that something is wrong
    unforetold: float  # log2 of the bits of contrasts that such a cause does not make
    uneven: float  # of a cause of the bus: the share of units that show none of it, though by its rate they should
    nobody: float  # 1 where no unit ever answers well: then there is nothing to compare with
    left: float  # log2 of the exchanges that went wrong and that neither this cause nor another takes


def clues(evidence: Evidence, found: Suspicion, foretold: Foretold, *, rival_bits: float, left: int) -> Clues:
    """Of one suspicion. `rival_bits`: of the next best cause of the same symptoms, 0 for none; `left`: exchanges."""
    rival = max(rival_bits, _FEW_BITS)
    margin = max(found.bits - rival, 0.0) / max(found.bits, 1.0)
    unsaid = values = 0.0
    for symptom, unit in found.explains:
        if unit is None or (found.units and unit not in found.units):
            continue
        if symptom in HITS_OF and symptom not in foretold.hangs_on:
            unsaid += max(evidence.best_contrast(symptom, unit, Family.ASKED, Family.BEFORE).bits, 0.0)
        if symptom is Symptom.DAMAGE and foretold.client_loses:
            values += values_alone_bits(evidence, (unit,))
    return Clues(
        log2(max(found.bits, 2.0)),
        margin,
        log2(1 + unsaid),
        log2(1 + values),
        log2(1 + max(found.bits - _plain(evidence, found), 0.0)),
        log2(1 + unforetold_bits(evidence, foretold, found)),
        0.0 if found.units else _uneven(evidence, found),
        float(not any(unit.answered for unit in evidence.units)),
        log2(1 + left),
    )


def _plain(evidence: Evidence, found: Suspicion) -> float:
    """Bits for that a unit has more of such symptoms than units that are well."""
    bits = 0.0
    for symptom, number in found.explains:
        unit = evidence.ledger.units.get(number) if number is not None else None
        if unit is not None and (not found.units or number in found.units):
            hits = sum(n for each, _, n in _sorts(evidence, unit) if each is symptom)
            bits += surplus_bits(min(hits, unit.asked), unit.asked, _BACKGROUND)
    return bits


def _uneven(evidence: Evidence, found: Suspicion) -> float:
    symptoms = {symptom for symptom, _ in found.explains}
    hits = {u: sum(n for symptom, _, n in _sorts(evidence, u) if symptom in symptoms) for u in evidence.units}
    rate = sum(hits.values()) / max(sum(unit.asked for unit in hits), 1)
    due = [hit for unit, hit in hits.items() if rate * unit.asked >= _DUE]
    return sum(not hit for hit in due) / max(len(due), 1)


def outcomes(evidence: Evidence, found: Suspicion) -> Outcomes:
    """What became of the exchanges that a suspicion is about, but for what is explained otherwise: how many of each sort,
    at most so many that more of the same tells no more."""
    counts: defaultdict[str, float] = defaultdict(float)
    for unit in evidence.units:
        if not found.units or unit.unit in found.units:
            for symptom, sort, count in _sorts(evidence, unit):
                if symptom is None or evidence.is_open(symptom, unit.unit):
                    counts[sort] += count
    every = sum(counts.values())
    return {name: count * min(_TOLD / every, 1.0) for name, count in counts.items()} if every else {}


def _sorts(evidence: Evidence, unit: UnitLedger) -> Iterator[tuple[Symptom | None, str, float]]:
    readings, followed = evidence.garbage(unit), evidence.followed(unit)
    behind = unit.behind if followed else 0
    well = max(unit.answered - unit.count(Ending.EXCEPTION) - behind, 0)
    again = len(unit.redundant) / max(len(unit.redundant) + len(unit.heeded), 1)
    yield None, "well", well * (1 - again)
    yield None, "well: again", well * again
    silent, went_on = unit.count(Ending.SILENT), share_that_went_on(evidence, unit.unit)
    yield Symptom.SILENCE, "silent", silent * (1 - went_on)
    yield Symptom.SILENCE, "silent: taken", silent * went_on
    yield from _refusals(evidence, unit)
    yield Symptom.LATENESS, "late", unit.late
    yield Symptom.LATENESS, "unfit", unit.unfit
    yield Symptom.LATENESS, "strays", unit.strays
    yield Symptom.DOUBLES, "double", unit.doubles
    for each in readings:
        yield Symptom.DAMAGE, _damage(each), unit.count(Ending.GARBAGE) / len(readings)
    for each in followed:
        yield Symptom.BEHIND, f"behind: {each.behind.value}", behind / len(followed)


def _refusals(evidence: Evidence, unit: UnitLedger) -> Iterator[tuple[Symptom, str, float]]:
    codes = sum((poll.exceptions for poll in evidence.polls_of(unit.unit)), Counter[int]())
    for code, count in codes.items():
        part = unit.count(Ending.EXCEPTION) * count / codes.total()
        yield Symptom.REFUSAL, f"refused: {code if code in _CODES else 'other'}", part


def _damage(reading: Signature) -> str:
    """The kind of damage, and whether it is longer or shorter than what is due, of kinds that may be either."""
    kind = kind_of(reading)
    if kind not in _OF_ANY_LENGTH:
        return kind
    return kind + ("+" if reading.length > reading.due else "-" if reading.length < reading.due else "=")


def typical(shares: Mapping[str, Mapping[str, float]], cause: str, found: Outcomes) -> float:
    """How much likelier (bits) such outcomes are where that cause is so than where any is, or something that is no
    cause's; as they spread from bus to bus (Dirichlet and multinomial). `shares` by cause."""
    if not found or cause not in shares:
        return 0.0
    bits = {name: _spread_bits(shares[name], found) for name in shares}
    kinds = set().union(found, *shares.values())
    no_word = _dirichlet_bits(dict.fromkeys(kinds, _ANYHOW), found)
    most = max(no_word, *bits.values())
    any_cause = sum(2 ** (each - most) for each in bits.values()) / len(bits)
    any_way = most + log2((1 - _NO_WORD) * any_cause + _NO_WORD * 2 ** (no_word - most))
    return min(max((bits[cause] - any_way) / _UNIT, -_MOST_TYPICAL), _MOST_TYPICAL)


def _spread_bits(shares: Mapping[str, float], found: Outcomes) -> float:
    return _dirichlet_bits(
        {name: _STEADINESS * shares.get(name, 0.0) + _ANY for name in shares.keys() | found.keys()}, found
    )


def _dirichlet_bits(weights: Mapping[str, float], found: Outcomes) -> float:
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
    like = typical(weights["shares"], cause, found)
    score += weights["clues"]["typical"] * like + weights["clues"]["unlike"] * min(like, 0.0)
    return min(max(1 / (1 + exp(-score)), LEAST), MOST)


def calibration() -> list[tuple[float, float, int, float, float]]:
    """What became of claims on buses that nothing was fitted to, a fifth of all causes hidden in turns: from which certainty
    to which, how many claims, how sure they were in the mean, and which share of them was so."""
    return [tuple(each) for each in _weights().get("told", [])]


def told_on() -> str:
    """The day on which that was told, as YYYY-MM-DD."""
    return str(_weights().get("told_on", ""))
