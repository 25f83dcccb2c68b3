"""Requests that are answered, rightly, by the number of another unit than was asked."""

from __future__ import annotations

from collections import Counter

from .evidence import Evidence
from .exchanges import Ending
from .ledgerview import kept
from .registry import Symptom
from .samples import Sample
from .unitledger import UnitLedger

_MOSTLY = 0.5
_LEAST = 3


@kept
def answered_as(evidence: Evidence, number: int) -> int | None:
    """The unit by whose number most of the silent requests to one are answered at once; None for none."""
    unit = evidence.ledger.units[number]
    silent = [each for each in unit.samples.kept if each.outcome == Ending.SILENT]
    others = Counter(other for each in silent if (other := _answering(each)) is not None)
    if not others or unit.count(Ending.SILENT) < _LEAST:
        return None
    other, count = others.most_common(1)[0]
    behind = (each for each in evidence.contrasts(Symptom.SILENCE, number) if each.name == "unit-before")
    if any(each.value == other and each.is_sharp for each in behind):
        return None  # it answers for itself behind others: what comes is that unit's, once more
    sampled = len(unit.samples.kept) * unit.samples.weight
    return other if count >= _MOSTLY * len(silent) and sampled >= _MOSTLY * unit.count(Ending.SILENT) else None


def _answering(sample: Sample) -> int | None:
    """The unit whose right answer, by the function that was asked, is the first thing behind a request."""
    piece = next(iter(sample.pieces), None)
    data = piece.data if piece is not None and piece.check else b""
    is_right = len(data) == sample.due and data[1:2] == bytes((sample.function,))
    return data[0] if is_right and data[0] != sample.unit else None


def lent(evidence: Evidence, unit: UnitLedger) -> int:
    """About how many requests to others are answered by the number of a unit."""
    others = (each for each in evidence.others(unit) if answered_as(evidence, each.unit) == unit.unit)
    return sum(other.count(Ending.SILENT) for other in others)
