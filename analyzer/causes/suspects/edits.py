"""Damage that is always the same: one bit of one byte, or a byte added before another, in all damaged answers."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from functools import lru_cache
from itertools import pairwise
from math import log2
from typing import Final, NamedTuple

from dissectors.crc import crc16

from ...tables.findings import Severity
from ..evidence import Evidence
from ..registry import Suspicion, Symptom, suspect
from ..signatures import AnswerDamage, Signature
from ..unitledger import UnitLedger
from .common import damage_suspicion

_LEAST: Final = 4
_ALWAYS: Final = 0.9
_ADDED_MOST: Final = 8  # bytes
_ADDED_BITS: Final = 14.0  # a frame that is whole without the bytes added before one value
_BIT_BITS: Final = 3.0  # which of the eight


class Edit(NamedTuple):
    """What was done to an answer: a bit turned (`byte` the place, `value` the bit) or a byte added (`byte` before `value`)."""

    kind: str
    byte: int
    value: int


@lru_cache(maxsize=1 << 12)
def edit_of(reading: Signature) -> Edit | None:
    """The one thing that makes an answer whole again; None where that is not known."""
    if reading.damage is AnswerDamage.BITS and len(reading.flips) == 1:
        return Edit("turned", reading.at, reading.flips[0])
    data = reading.heard
    if 0 < reading.length - reading.due <= _ADDED_MOST and len(data) == reading.length:
        for added, before in dict.fromkeys(pairwise(data)):
            rest = data.replace(bytes((added, before)), bytes((before,)))
            if len(rest) == reading.due and crc16(rest) == 0:
                return Edit("added", added, before)
    return None


@suspect(
    "same-damage",
    Severity.ERROR,
    blame="unit",
    text="Answers of {units:unit|units} are damaged in always the same way[: bit {bit} of byte {place}][: {added} is added before "
    "each {before}], in {edited:,} of {damaged:,} damaged answers; no line does that",
    share="{damaged:,} of {answers:,} answers of {units:unit|units}",
    deciding_test="Tap the line at the terminals of {units:unit|units}: damaged there too, it is the unit; whole there, a converter "
    "on the way",
    remedy="Look for a converter in text mode (0D 0A for 0A), a program that changes bytes on the way, or a fault in the unit's "
    "memory or firmware",
)
def same_damage(evidence: Evidence) -> Iterator[Suspicion]:
    """One edit explains nearly all damaged answers."""
    found: dict[Edit, list[tuple[UnitLedger, int]]] = {}
    for unit in evidence.units:
        readings = evidence.readings(unit)
        edits = (
            Counter(edit for each in readings if (edit := edit_of(each)) is not None)
            if len(readings) >= _LEAST
            else None
        )
        if edits and (common := edits.most_common(1)[0])[1] >= max(_LEAST, _ALWAYS * len(readings)):
            count = round(evidence.damaged(unit) * common[1] / len(readings))
            found.setdefault(common[0], []).append((unit, count))
    for edit, units in found.items():
        yield _suspicion(evidence, edit, units)


def _suspicion(evidence: Evidence, edit: Edit, units: list[tuple[UnitLedger, int]]) -> Suspicion:
    bits = 0.0
    for unit, count in units:
        due = max((each.due for each in evidence.readings(unit)), default=8)
        each_bits = _ADDED_BITS if edit.kind == "added" else log2(max(due, 2)) + _BIT_BITS
        bits += evidence.surplus(unit) + each_bits * count
    turned = edit.kind == "turned"
    return damage_suspicion(
        evidence,
        [unit for unit, _ in units],
        bits,
        {
            "bit": f"{edit.value}" if turned else "",
            "place": f"{edit.byte + 1}" if turned else "",
            "added": "" if turned else f"{edit.byte:02X}",
            "before": "" if turned else f"{edit.value:02X}",
            "edited": sum(count for _, count in units),
        },
        (Symptom.DAMAGE, Symptom.BEHIND, Symptom.LATENESS),
    )
