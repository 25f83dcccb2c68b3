"""Spells of silence that begin at the same time: what units share is at fault then, and not each of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf, log2
from statistics import median
from typing import Final

from .timegrid import Spell

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
    latest = first.begin + _SLACK * (first.end - first.begin)
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
