"""Kinds of damage: how a damaged answer is called among them, and what their counts are worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import log2
from typing import Final

from .signatures import AnswerDamage, Signature

_RARE: Final = 0.01
_SHORT_CUT: Final = 4  # bytes
_STRAYED: Final = 2  # bytes

# How damage spreads over kinds where it strikes anywhere, by chance.
_ANYWHERE: Final[Mapping[str, float]] = {
    "head": 0.09, "ahead": 0.03, "tail": 0.03, "cut-short": 0.05, "cut": 0.08, "bits": 0.24, "bits-tail": 0.03, "middle": 0.2,
    "long": 0.06, "convention": 0.002, "count": 0.005, "crossed": 0.03, "other": 0.02, "whole": 0.13, "none": 0.003,
}  # fmt: skip


def kind_of(reading: Signature) -> str:
    """The kind of damage, places at the end told apart."""
    if reading.damage is AnswerDamage.CUT:
        return "cut-short" if reading.bytes <= _SHORT_CUT else "cut"
    if reading.damage is AnswerDamage.HEAD and reading.length > reading.due:
        return "ahead"  # something else stands before it
    if reading.damage is AnswerDamage.BITS and reading.at >= reading.due - 1:
        return "bits-tail"
    return str(reading.damage.value)


def kind_bits(readings: list[Signature], expected: Mapping[str, float]) -> float:
    """How much likelier these kinds of damage are as expected than where damage strikes anywhere."""
    return sum(log2(expected.get(kind_of(each), _RARE) / _ANYWHERE[kind_of(each)]) for each in readings)


def overlaid(readings: Sequence[Signature]) -> int:
    """How many are so much longer or shorter than what was due that something else was sent into them: what disturbs a
    line from outside makes a byte or two more or less."""
    return sum(
        each.due > 0 and each.length >= _SHORT_CUT and abs(each.length - each.due) > _STRAYED for each in readings
    )


def share_of(readings: list[Signature], *kinds: str) -> float:
    """The share of readings of these kinds; 0 without any."""
    return sum(kind_of(each) in kinds for each in readings) / len(readings) if readings else 0.0
