"""Units that somebody looks for: that they are silent is no fault."""

from __future__ import annotations

from itertools import pairwise
from statistics import median
from typing import Final

from .evidence import Evidence
from .unitledger import UnitLedger

_SCAN: Final = 8  # units
_SEGMENT: Final = 31  # units: beside a client no more have room on a segment, which carries 32 loads
_VISITS: Final = 2
_SELDOM: Final = 0.1  # of how often others are asked
_VISIT: Final = 0.05  # of the capture
_NEARLY_ALL: Final = 0.95
_DENSE: Final = 0.8  # of all numbers from the first to the last


def scanned(evidence: Evidence) -> frozenset[int]:
    """Units that were asked once or twice, one behind the other in the order of their numbers, or so many of these that no
    list would hold them: a search for those that are there, not a list of those that should be."""
    ledger = evidence.ledger
    span = ledger.span_ns if ledger.timed else ledger.bytes
    once = [
        unit
        for unit in evidence.units
        if (visits := unit.asked - unit.repeats) <= _VISITS
        and not unit.answered
        and (visits == 1 or unit.last - unit.first <= _VISIT * span)  # what passes it on may hold one try up
    ]
    never = [unit for unit in evidence.units if not unit.answered]
    if len(evidence.units) >= _SEGMENT and 2 * len(never) > len(evidence.units):  # round after round
        once = never
    if len(once) < _SCAN:
        return frozenset()
    once.sort(key=lambda unit: unit.first)
    numbers = [unit.unit for unit in once]
    rising = sum(one < two for one, two in pairwise(numbers))
    known = sum(numbers[0] <= unit.unit <= numbers[-1] for unit in evidence.units)
    in_order = rising >= _NEARLY_ALL * (len(once) - 1) and known >= _DENSE * (numbers[-1] - numbers[0] + 1)
    return frozenset(numbers) if in_order else frozenset()


def is_looked_for(evidence: Evidence, unit: UnitLedger) -> bool:
    """Whether a unit is asked far more seldom than those that answer: somebody looks whether it is there."""
    others = [other.asked - other.repeats for other in evidence.units if other.answered]
    visits = unit.asked - unit.repeats
    return bool(others) and (visits <= _VISITS or visits <= _SELDOM * median(others))
