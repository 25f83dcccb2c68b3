"""Units that fall silent together: spells of silence that begin at the same time, of what units share."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, log2
from statistics import median
from typing import Final

import numpy as np

from ...tables.findings import Severity
from ...tables.schema import Bools, UInt8s
from ..bits import mean_period_s
from ..costs import LostAnswers, cost, together
from ..evidence import Evidence
from ..exchanges import Ending
from ..exchangetable import AskedRows
from ..flatmemory import Spell
from ..ledger import ASKED, BAD
from ..registry import Suspicion, Symptom, suspect
from ..repeats import only_repeats
from ..unitledger import UnitLedger
from .common import silent_suspicion
from .silence import EXCUSED, SILENT, is_spell, silence_bits
from .states import excused

_SLACK: Final = 0.05  # of its length: so much later another unit may fall silent, by what its supply holds
_ALIKE: Final = 2.0  # times as long, at the most, as the middle one: each unit starts again in its own time
_SAME_UNITS: Final = 0.5  # of those in one outage, that are in another too


@dataclass(frozen=True, slots=True)
class Outage:
    """Units that fell silent together, once, each with its spell; `bits`: how unlikely that is by chance."""

    spells: Mapping[int, Spell]
    bits: float

    @property
    def begin(self) -> int:
        """When the first request stayed without an answer."""
        return min(each.begin for each in self.spells.values())

    @property
    def end(self) -> int:
        """When the last one did."""
        return max(each.end for each in self.spells.values())


def outages_of(
    spells: Mapping[int, Sequence[Spell]], span: int, is_long: Callable[[Spell], bool]
) -> list[list[Outage]]:
    """Outages of two units at least, those of about the same units together. `span`: of all the time there is; `is_long`:
    whether a spell would be one by itself, as two of an outage are."""
    left = sorted(
        ((unit, spell) for unit, own in spells.items() for spell in own), key=lambda pair: (pair[1].begin, pair[0])
    )
    groups: list[list[Outage]] = []
    while left:
        members = _alike(_at_once(left))
        taken = {id(spell) for spell in (left[0][1], *members.values())}
        left = [pair for pair in left if id(pair[1]) not in taken]
        if sum(map(is_long, members.values())) > 1:
            outage = Outage(members, _by_chance(members.values(), span))
            same = next((group for group in groups if _are_same(group, outage)), None)
            if same is None:
                groups.append([outage])
            else:
                same.append(outage)
    return groups


def _at_once(spells: Sequence[tuple[int, Spell]]) -> dict[int, Spell]:
    """The first one, and those that may have begun with it: no answer came between, of any of their units."""
    found = dict(spells[:1])
    (first,) = found.values()
    latest = first.begin + _SLACK * (0 if first.before is None else first.end - first.begin)
    for unit, spell in spells[1:]:
        over = first.before is not None and spell.begin > first.before
        if unit not in found and not over and (spell.after is None or spell.after <= latest):
            found[unit] = spell
    return found


def _alike(members: dict[int, Spell]) -> dict[int, Spell]:
    """Those of about the same length, as far as requests tell it."""
    least = {unit: spell.end - spell.begin for unit, spell in members.items()}
    most = {unit: _longest(spell) for unit, spell in members.items()}
    low, high = median(least.values()), median(most.values())
    return {
        unit: spell for unit, spell in members.items() if least[unit] <= _ALIKE * high and _ALIKE * most[unit] >= low
    }


def _longest(spell: Spell) -> float:
    """How long it may have lasted."""
    return inf if spell.before is None or spell.after is None else spell.before - spell.after


def _by_chance(spells: Iterable[Spell], span: int) -> float:
    """Bits: each but the first might have begun at any time; where it was silent from the beginning, have ended."""
    bits = []
    for spell in spells:
        if spell.after is not None:
            window = spell.begin - spell.after + _SLACK * (spell.end - spell.begin)
        elif spell.before is not None:
            window = spell.before - spell.end + _SLACK * (spell.end - spell.begin)
        else:
            window = span
        bits.append(log2(max(span, 1) / max(min(window, span), 1)))
    return sum(sorted(bits)[:-1])


def _are_same(group: Sequence[Outage], outage: Outage) -> bool:
    units = {unit for each in group for unit in each.spells}
    common = units & outage.spells.keys()
    return len(common) >= _SAME_UNITS * min(len(units), len(outage.spells))


_TOGETHER_BITS: Final = 2.0  # two faults at once are unlikely by themselves, and the more so at one time
_OUTAGE_BITS: Final = 16.0  # that its place in the time costs
_INSIDE: Final = 0.6  # of a unit's silence
_FEW: Final = 3  # requests an outage, of a unit that is asked too rarely to be silent for a while
_LEAST: Final = 2  # requests to others meanwhile
_RUN: Final = 3  # requests, but for repeats
_USUAL: Final = 0.95  # of the answers
_MOSTLY: Final = 0.5
_HARDLY: Final = 0.1


@suspect(
    "all-silent",
    Severity.ERROR,
    blame="line",
    text="Units {list} fall silent together{again}: {silent:,} requests to them {how}{others}",
    share="{silent:,} of {asked:,} requests to units {list}[, {others_silent:,} of {others_asked:,} to others]",
    deciding_test="Tap the line at the first of these units when it happens next: if requests arrive there, look at what the "
    "units share; if not, at the cable and the converters before it",
    remedy="Check what the silent units have in common: the trunk cable and its terminals, the converter or gateway that "
    "passes requests on, their supply",
)
def all_silent(evidence: Evidence) -> Iterator[Suspicion]:
    """Silence of several units that begins at the same time."""
    for group in silent_together(evidence):
        yield from _together(evidence, group)
    yield from _behind_gateway(evidence)


def _behind_gateway(evidence: Evidence) -> Iterator[Suspicion]:
    """Several units of which a gateway says that they do not answer, from about one moment on."""
    found = excused(evidence)
    if len(found) < 2:
        return
    units, states = [evidence.ledger.units[number] for number in found], found.values()
    refused = sum(state.refused for state in states)
    others = any(unit.answered for unit in evidence.others(*units))
    numbers = {
        "list": tuple(sorted(found)),
        "again": " and stay so",
        "silent": refused,
        "asked": sum(state.asked for state in states),
        "how": EXCUSED,
        "others": ", while others answered" if others else "",
    }
    bits = sum(silence_bits(state.refused, state.asked) for state in states)
    kinds, lost = (Symptom.REFUSAL, Symptom.SILENCE), LostAnswers(refused)
    cause = silent_suspicion(evidence, units, bits, kinds, numbers, lost, Ending.EXCEPTION)
    yield replace(cause, since=min(state.since(unit) for state, unit in zip(states, units, strict=True)))


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
    runs = [Outage(each, _by_chance(each.values(), span)) for each in _runs(evidence, list(spells))]
    shared = {unit for run in runs if len(run.spells) > 1 for unit in run.spells}
    if shared:  # what a unit of these is silent to while no other is asked may be the same
        groups.append([run for run in runs if run.spells.keys() & shared])
    return [group for group in groups if sum(outage.bits for outage in group) >= _TOGETHER_BITS]


def _runs(evidence: Evidence, units: Sequence[int]) -> Iterator[dict[int, Spell]]:
    """Runs of silence of the bus, each unit with its part: nobody answered from the first request to the last, though
    several units were asked, too few times each for a spell of its own. Units that never answer tell nothing, nor do
    those that were silent before: they did not fall silent with the others."""
    rows = evidence.ledger.table.rows
    rows = rows[np.isin(rows.unit, units)]
    silent, times = (rows.outcome == Ending.SILENT) & _is_waited_for(rows), rows.time.tolist()
    still = _still(rows.unit, silent)
    edges = np.flatnonzero(np.diff(np.concatenate(([False], silent, [False])).astype(np.int8)))
    for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        after = times[begin - 1] if begin else None
        before = times[end] if end < len(times) else None
        run = rows[begin:end]
        fallen = np.unique(run.unit[~still[begin:end]])
        parts = {unit: np.flatnonzero(run.unit == unit) + begin for unit in fallen.tolist()}
        run = run[np.isin(run.unit, fallen)]
        if np.count_nonzero(~run.repeats) >= _RUN if len(parts) > 1 else len(run) > 1:
            yield {
                unit: Spell(times[mine[0]], times[mine[-1]], len(mine), after, before) for unit, mine in parts.items()
            }


def _still(units: UInt8s, silent: Bools) -> Bools:
    """Which silent exchanges have one of the same unit before them."""
    order = np.argsort(units, kind="stable")
    again = (units[order[1:]] == units[order[:-1]]) & silent[order[1:]] & silent[order[:-1]]
    found: Bools = np.zeros(len(units), np.bool_)
    found[order[1:]] = again
    return found


def _is_waited_for(rows: AskedRows) -> Bools:
    """Whether an answer had its time before the next request, by how long answers take: behind two clients that cut each
    other off none had."""
    delays = rows.delay[rows.outcome == Ending.OK]
    return (rows.wait < 0) | (rows.wait > (np.quantile(delays, _USUAL) if len(delays) else 0))


def _together(evidence: Evidence, group: Sequence[Outage]) -> Iterator[Suspicion]:
    """Units that are silent in these outages, and hardly at other times."""
    inside = Counter({unit: 0 for outage in group for unit in outage.spells})
    for outage in group:
        inside.update({unit: spell.count for unit, spell in outage.spells.items()})
    ledgers = {unit.unit: unit for unit in evidence.units}
    mine = [ledgers[unit] for unit, n in inside.most_common() if n >= _INSIDE * evidence.silent(ledgers[unit])]
    if len(mine) < 2:
        return
    rest = evidence.others(*mine)
    silent, asked = sum(inside[unit.unit] for unit in mine), sum(unit.asked for unit in mine)
    lost = together(_inside(evidence, unit, inside[unit.unit]) for unit in mine)
    begins = [outage.begin for outage in group]
    few = [unit for unit in rest if unit.answered and evidence.silent(unit) < _FEW * len(group)]
    numbers = {
        "list": tuple(sorted(unit.unit for unit in mine)),
        "again": _how_long(group),
        "silent": silent,
        "asked": asked,
        "how": SILENT,
        "others": _others(evidence, group, rest),
        "others_silent": sum(map(evidence.silent, rest)),
        "others_asked": sum(unit.asked for unit in rest),
    }
    bits = sum(silence_bits(inside[unit.unit], inside[unit.unit]) for unit in mine) - _OUTAGE_BITS * len(group)
    bits += sum(outage.bits for outage in group)
    yield replace(
        silent_suspicion(evidence, mine, bits, (Symptom.SILENCE,), numbers, lost),
        explains=frozenset((Symptom.SILENCE, unit.unit) for unit in (*mine, *few)),
        since=begins[0],
        until=max(outage.end for outage in group),
        period_s=mean_period_s(begins),
        severity=Severity.NOTE if _is_over(group) else None,
    )


def _others(evidence: Evidence, group: Sequence[Outage], rest: Sequence[UnitLedger]) -> str:
    """What the other units do."""
    if any(unit.answered for unit in rest):
        return _meanwhile(evidence, group, [unit.unit for unit in rest])
    return ", and no other unit ever answers" if rest else ", and no others are polled"


def _is_over(group: Sequence[Outage]) -> bool:
    """Whether it happened once, and all came back: somebody may have switched the plant off."""
    return len(group) == 1 and all(spell.before is not None for spell in group[0].spells.values())


def _inside(evidence: Evidence, unit: UnitLedger, count: int) -> LostAnswers:
    """The part of a unit's cost that so many of its silent requests have."""
    whole, part = cost(evidence, unit, Ending.SILENT), count / max(evidence.surely_silent(unit), count)
    return LostAnswers(round(part * whole.answers), None if whole.ms is None else part * whole.ms)


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
    if well > _MOSTLY:
        return ", while others answered"
    return ", and nobody else answered meanwhile" if well < _HARDLY else ""
