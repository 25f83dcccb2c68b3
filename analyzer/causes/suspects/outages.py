"""Units that fall silent together: what they share is at fault."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from ...tables.findings import Severity
from ..costs import LostAnswers, cost, together
from ..evidence import Evidence
from ..exchanges import Ending
from ..ledger import ASKED, BAD
from ..onlyrepeats import only_repeats
from ..outages import Outage, outages_of
from ..registry import Suspicion, Symptom, suspect
from ..spells import mean_period_s
from .silence import is_spell, silence_bits

_TOGETHER_BITS: Final = 2.0  # two faults at once are unlikely by themselves, and the more so at one time
_OUTAGE_BITS: Final = 16.0  # that its place in the time costs
_INSIDE: Final = 0.6  # of a unit's silence
_FEW: Final = 3  # requests an outage, of a unit that is asked too rarely to be silent for a while
_LEAST: Final = 2  # requests to others meanwhile
_MOSTLY: Final = 0.5
_HARDLY: Final = 0.1


@suspect(
    "all-silent",
    Severity.ERROR,
    blame="line",
    text="Units {list} fall silent together{again}: {silent} requests to them stayed without a byte{others}",
    share="{silent} of {asked} requests to units {list}[, {others_silent} of {others_asked} to others]",
    deciding_test="Tap the line at the first of these units when it happens next: if requests arrive there, look at what the "
    "units share; if not, at the cable and the converters before it",
    remedy="Check what the silent units have in common: the trunk cable and its terminals, the converter or gateway that "
    "passes requests on, their supply",
)
def all_silent(evidence: Evidence) -> Iterator[Suspicion]:
    """Silence of several units that begins at the same time."""
    for group in silent_together(evidence):
        yield from _together(evidence, group)


def silent_together(evidence: Evidence) -> list[list[Outage]]:
    """Outages of the bus, those of about the same units together."""
    ledger = evidence.ledger
    spells = {
        unit.unit: evidence.silences(unit).all
        for unit in evidence.units
        if unit.answered and evidence.silent(unit) and not only_repeats(evidence, unit)
    }
    span = ledger.span_ns if ledger.timed else ledger.bytes
    groups = outages_of(spells, span, lambda spell: is_spell(evidence, spell))
    return [group for group in groups if sum(outage.bits for outage in group) >= _TOGETHER_BITS]


def _together(evidence: Evidence, group: Sequence[Outage]) -> Iterator[Suspicion]:
    """Units that are silent in these outages, and hardly at other times."""
    inside = Counter({unit: 0 for outage in group for unit in outage.spells})
    for outage in group:
        inside.update({unit: spell.count for unit, spell in outage.spells.items()})
    ledgers = {unit.unit: unit for unit in evidence.units}
    mine = [ledgers[unit] for unit, n in inside.most_common() if n >= _INSIDE * evidence.silent(ledgers[unit])]
    if len(mine) < 2:
        return
    rest = [unit for unit in evidence.units if unit not in mine]
    silent, asked = sum(inside[unit.unit] for unit in mine), sum(unit.asked for unit in mine)
    lost = together(_inside(cost(evidence, unit, Ending.SILENT), inside[unit.unit]) for unit in mine)
    begins = [outage.begin for outage in group]
    few = [unit for unit in rest if unit.answered and evidence.silent(unit) < _FEW * len(group)]
    yield Suspicion(
        tuple(unit.unit for unit in mine),
        sum(silence_bits(inside[unit.unit], inside[unit.unit]) for unit in mine)
        - _OUTAGE_BITS * len(group)
        + sum(outage.bits for outage in group),
        frozenset((Symptom.SILENCE, unit.unit) for unit in (*mine, *few)),
        {
            "list": tuple(sorted(unit.unit for unit in mine)),
            "again": _how_long(group),
            "silent": silent,
            "asked": asked,
            "others": _meanwhile(evidence, group, [unit.unit for unit in rest])
            if any(unit.answered for unit in rest)
            else ", and no other unit ever answers"
            if rest
            else ", and no others are polled",
            "others_silent": sum(map(evidence.silent, rest)),
            "others_asked": sum(unit.asked for unit in rest),
        },
        since=begins[0],
        until=max(outage.end for outage in group),
        period_s=mean_period_s(begins),
        lost_answers=lost.answers,
        lost_ms=lost.ms,
        frames=tuple(index for unit in mine for index in unit.examples.get(Ending.SILENT, []))[:6],
    )


def _inside(whole: LostAnswers, count: int) -> LostAnswers:
    """The part of a unit's cost that so many of its silent requests have."""
    return LostAnswers(count, None if whole.ms is None else whole.ms * count / whole.answers)


def _how_long(group: Sequence[Outage]) -> str:
    if len(group) > 1:
        return ", again and again"
    lasting = all(spell.before is None for spell in group[0].spells.values())
    return " and stay so" if lasting else " for a while"


def _meanwhile(evidence: Evidence, group: Sequence[Outage], others: Sequence[int]) -> str:
    """What others did within the outages, as far as parts of the time tell it."""
    grid = evidence.ledger.grid
    asked, bad = (sum((grid.counts((kind, unit)) for unit in others), np.zeros(grid.count)) for kind in (ASKED, BAD))
    inside = np.zeros(grid.count, np.bool_)
    for outage in group:
        first, last = grid.bins(np.array((outage.begin, outage.end))).tolist()
        inside[first + 1 : last] = True
    every = asked[inside].sum()
    if every < _LEAST:
        return ""
    well = 1 - bad[inside].sum() / every
    return (
        ", while others answered"
        if well > _MOSTLY
        else ", and nobody else answered meanwhile"
        if well < _HARDLY
        else ""
    )
