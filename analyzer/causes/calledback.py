"""What answers to broadcasts do where the master does not wait for them: they run into what it sends next."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import dataclass
from typing import Final

from .bits import surplus_bits
from .evidence import HEALTHY, Evidence
from .registry import Symptom

_OFTEN: Final = 0.3  # of the broadcasts
_FEW: Final = 3
_LEAST: Final = 5  # exchanges that are hit
_CONTRAST: Final = 8  # exchanges of a unit behind something else
_ELSEWHERE: Final = 0.1  # of its hits
_HALF: Final = 0.5
_BITS: Final = 10.0
_SURE_BITS: Final = 30.0
_TO_ALL: Final = 0


@dataclass(frozen=True, slots=True)
class CalledBack:
    """How many exchanges right behind broadcasts were hit, of how many, by how much that is likelier as their doing
    (bits), and the units that are hit behind broadcasts, or behind each other, and next to never else."""

    met: int = 0
    met_of: int = 0
    bits: float = 0.0
    units: frozenset[int] = frozenset()


def called_back(evidence: Evidence) -> CalledBack:
    """Of the exchanges that nothing explains yet; nothing where it may be chance."""
    if not evidence.ledger.broadcasts or not evidence.ordered:
        return CalledBack()
    successors = evidence.ledger.successors
    direct = {unit.unit: _bits(evidence, unit.unit, {_TO_ALL}) for unit in evidence.units}
    hit = {unit for unit, bits in direct.items() if bits > _BITS}
    met = sum(successors.met[unit, _TO_ALL] for unit in hit)
    weight = sum(direct[unit] for unit in hit)
    if met < _LEAST or weight < _SURE_BITS:
        return CalledBack()
    met_of = sum(successors.followed[unit, _TO_ALL] for unit in hit)
    more = hit
    while more:
        more = {unit for unit in direct.keys() - hit if _behind(evidence, unit, hit | {_TO_ALL})}
        hit = hit | more
    return CalledBack(met, met_of, weight, frozenset(hit))


def broadcasts_answered(evidence: Evidence) -> bool:
    """Whether many broadcasts are, for what answers them runs into requests as a second master's would."""
    ledger = evidence.ledger
    often = ledger.broadcasts_answered >= _FEW and ledger.broadcasts_answered > _OFTEN * ledger.broadcasts
    return often or called_back(evidence).met > _OFTEN * ledger.broadcasts


def _behind(evidence: Evidence, unit: int, hit: Set[int]) -> bool:
    """Whether a unit is hit behind these and not else; one that always comes behind them no oftener than it may be."""
    successors = evidence.ledger.successors
    met = sum(successors.met[unit, each] for each in hit)
    followed = sum(successors.followed[unit, each] for each in hit)
    if successors.followed_of(unit) - followed >= _CONTRAST or not evidence.is_open(Symptom.DAMAGE, unit):
        return _bits(evidence, unit, hit) > _BITS
    return 0 < met <= min(evidence.ledger.broadcasts, _HALF * followed)


def _bits(evidence: Evidence, unit: int, behind: Set[int]) -> float:
    """How much likelier it is that a unit is hit right behind these than wherever it is asked; 0 where it is else."""
    successors = evidence.ledger.successors
    if not evidence.is_open(Symptom.DAMAGE, unit):
        return 0.0
    met = sum(successors.met[unit, each] for each in behind)
    followed = sum(successors.followed[unit, each] for each in behind)
    hit, asked = successors.met_of(unit) - met, successors.followed_of(unit) - followed
    if asked < _CONTRAST or hit > _ELSEWHERE * met:
        return 0.0
    return surplus_bits(met, followed, max(HEALTHY, (hit + 0.5) / (asked + 50)))
