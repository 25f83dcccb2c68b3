"""How far the exchanges are from what a cause foretells: bits against it."""

from __future__ import annotations

from collections.abc import Collection
from math import inf
from typing import Final

from .bits import surplus_bits
from .contrasts import NO_CONTRAST, Family
from .evidence import Evidence
from .hits import evenness_bits
from .registry import ASKED_FOR, Explained, Foretold, Suspicion, Symptom
from .taken import move
from .unitledger import UnitLedger


def against_bits(evidence: Evidence, foretold: Foretold, suspicion: Suspicion) -> float:
    """Bits against a suspicion; 0 or more.

    By what the symptoms that it explains hang on, where a cause like it lets them hang on less; and by damaged answers
    that the client took all the same, where it should have lost them.
    """
    bits = unforetold_bits(evidence, foretold, suspicion)
    for symptom, units in _by_symptom(suspicion).items():
        if symptom is Symptom.DAMAGE and foretold.client_loses:
            taken = sum(max(move(evidence, unit).bits, 0.0) for unit in units)
            bits += max(taken + evenness_bits(evidence), 0.0) if taken else 0.0  # of all alike: else no tap's loss
    return bits


def unforetold_bits(evidence: Evidence, foretold: Foretold, suspicion: Suspicion) -> float:
    """Bits of what the symptoms hang on, where a cause like that lets them hang on less; 0 or more."""
    return sum(
        _unforetold(evidence, symptom, unit, foretold.hangs_on[symptom])
        for symptom, units in _by_symptom(suspicion).items()
        if symptom in foretold.hangs_on
        for unit in units
    )


def _by_symptom(suspicion: Suspicion) -> dict[Symptom, list[int]]:
    found: dict[Symptom, list[int]] = {}
    for symptom, unit in suspicion.explains:
        if unit is not None and (not suspicion.units or unit in suspicion.units):
            found.setdefault(symptom, []).append(unit)
    return found


def _unforetold(evidence: Evidence, symptom: Symptom, unit: int, names: frozenset[str]) -> float:
    best = evidence.best_contrast(symptom, unit)
    if symptom is Symptom.DAMAGE and best.is_sharp and best.family is Family.ASKED and not names >= ASKED_FOR:
        return best.bits  # more of a long answer is hit than of a short one, but not all of one and none of the other
    own = next((each for each in evidence.contrasts(symptom, unit) if each.name in names), NO_CONTRAST)
    more = max(best.bits - own.bits, 0.0) if best.name not in names else 0.0
    if symptom is Symptom.SILENCE and best.is_sharp and more >= _SURE_BITS:
        return inf  # it decides, and then nothing else does
    return more


_DECIDES: Final = ASKED_FOR | {"rest", "since"}  # of silence: then nothing that strikes a line is why
_SURE_BITS: Final = 14.0


def own_silences(evidence: Evidence) -> set[tuple[Symptom, int]]:
    """Silences of units that what spoils frames of all can't be the reason of: of one that never answers, or is silent by
    what is asked or by the rest before, to the end, or far more often than others are hit at all."""
    hits = {unit.unit: (evidence.hit(unit), unit.asked) for unit in evidence.units if unit.answered}
    hit, asked = (sum(each) for each in zip(*hits.values(), strict=True)) if hits else (0, 0)
    own = set()
    for unit in evidence.units:
        own_hit, own_asked = hits.get(unit.unit, (0, 0))
        rate = (hit - own_hit + 0.5) / (asked - own_asked + 1) if hits.keys() - {unit.unit} else None
        if not _may_strike(evidence, unit, rate):
            own.add((Symptom.SILENCE, unit.unit))
    return own


def of_all(evidence: Evidence, kinds: Collection[Symptom]) -> Explained:
    """Such symptoms of all units, as far as what spoils frames of all can be the reason, and what stands in no frame."""
    found = frozenset((kind, unit.unit) for unit in evidence.units for kind in kinds) - own_silences(evidence)
    return found | {(Symptom.FRAMING, None)}


def _may_strike(evidence: Evidence, unit: UnitLedger, elsewhere: float | None) -> bool:
    """`elsewhere`: how often requests to others, or answers of theirs, are hit; None where no other answers."""
    best = evidence.best_contrast(Symptom.SILENCE, unit.unit)
    if not unit.answered or (best.bits >= _SURE_BITS and best.is_sharp and best.name in _DECIDES):
        return False
    return elsewhere is None or surplus_bits(evidence.silent(unit), unit.asked, elsewhere) < _SURE_BITS


def struck(evidence: Evidence, foretold: Foretold, suspicion: Suspicion) -> Explained:
    """What a suspicion explains: where it spoils the frames of all, not the silence of a unit that has a fault of its own."""
    if suspicion.units or not foretold.client_loses:
        return suspicion.explains
    own = own_silences(evidence)
    return suspicion.explains - own
