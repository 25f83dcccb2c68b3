"""Answers that are taken for those to a request, and are to the one before, whose client had given up."""

from __future__ import annotations

from typing import Final

import numpy as np

from .bits import strays, surplus_bits
from .evidence import Evidence
from .hits import given_up_by_timer
from .registry import Symptom
from .unitledger import UnitLedger

_LEAST: Final = 3
_SURE_BITS: Final = 16.0
_SHIFTED: Final = 4.0
_STEADIEST: Final = 0.01  # of a delay: so much any device's strays
_SOONER: Final = 0.85
_MOSTLY: Final = 0.6
_LONGEST: Final = 0.97  # of delays: some may be late ones, for which there was time


def shifted(evidence: Evidence, unit: UnitLedger) -> tuple[float, int]:
    """How much likelier the answers behind a silent exchange are to the request before each (bits), and how many: from
    that one on they take always the same time, from their own request on they do not."""
    successors = evidence.ledger.successors
    if unit.unit not in successors.delays or not evidence.is_open(Symptom.LATENESS, unit.unit):
        return 0.0, 0
    own, lagged = successors.delays[unit.unit].numbers, successors.lagged[unit.unit].numbers
    known = max(evidence.verdict.wait_ns, _STEADIEST * float(np.median(lagged)))
    if len(own) < 2 * _LEAST or not np.isfinite(known):
        return 0.0, 0
    mine, from_before = (strays(each) + known for each in (own, lagged))
    bits = len(own) * float(np.log2(mine / from_before))
    sure = bits >= _SURE_BITS and mine > _SHIFTED * from_before
    return (bits, len(successors.delays[unit.unit])) if sure else (0.0, 0)


def untimely(evidence: Evidence, unit: UnitLedger) -> tuple[float, int]:
    """How much likelier good answers behind a silent exchange of the same unit are to the request before (bits), and how
    many: they come sooner than the unit ever answers else, or most of them sooner or later, and the master gave up by its
    timer."""
    successors = evidence.ledger.successors
    if unit.unit not in successors.delays or not evidence.is_open(Symptom.LATENESS, unit.unit):
        return 0.0, 0
    own, usual = successors.delays[unit.unit].numbers, successors.usual[unit.unit].numbers
    if len(usual) < 3 * _LEAST or not given_up_by_timer(evidence, unit):
        return 0.0, 0
    off = evidence.verdict.wait_ns
    sooner = own < _SOONER * float(usual.min()) - off
    odd = sooner | (own > float(np.quantile(usual, _LONGEST)) / _SOONER + off)
    found = [(sooner, 1 / len(usual))]
    if np.count_nonzero(odd) >= _MOSTLY * len(own):
        found.append((odd, 1 / len(usual) + 1 - _LONGEST))
    bits, mine = max((surplus_bits(int(which.sum()), len(own), chance), int(which.sum())) for which, chance in found)
    return (bits, round(len(successors.delays[unit.unit]) * mine / len(own))) if bits >= _SURE_BITS else (0.0, 0)
