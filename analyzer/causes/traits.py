"""What the exchanges that a suspicion is about look like, and how typical that is of its cause.

Each trait is a histogram: how they ended, and where answers are damaged. A cause is known by how its traits spread
where it is so, each kind of bus for itself, and by traits that are anyhow, for nobody has seen all kinds; "none of
these" is as much of a hypothesis, known by faults without a word. Which is likelier is reckoned trait by trait. How
traits spread stands in `certainty.json`. (How often it happens and what came of asking again hang on the client and the
bus: on buses of another hand they misled.)
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from math import lgamma, log, log2
from typing import Final

from .costs import kind_of
from .evidence import Evidence
from .exchanges import Ending
from .registry import Suspicion, Symptom
from .signatures import Signature
from .taken import share_that_went_on
from .unitledger import UnitLedger

TRAITS: Final = ("ending", "place")
_TOLD: Final = 60.0  # exchanges: more of the same tell no more of what is the matter
_STEADINESS: Final = 8.0  # how much alike a trait of one cause is from bus to bus
_ANY: Final = 0.1
_ANYHOW: Final = 0.2  # of what no kind is known by
_UNIT: Final = 8.0  # bits
_HEAD: Final = 3  # bytes, each a place of its own,
_TAIL: Final = 2  # and those of a check value
_CODES: Final = frozenset((1, 2, 3, 4, 5, 6, 10, 11))  # exceptions that differ in what they mean
_OF_ANY_LENGTH: Final = frozenset(("middle", "whole", "head", "other", "none", "cut"))
Histogram = Mapping[str, float]
Traits = Mapping[str, Histogram]


def traits_of(evidence: Evidence, found: Suspicion) -> Traits:
    """Of the exchanges that a suspicion is about, but for what is explained otherwise: histograms by trait, each of at most
    so many exchanges that more of the same tell no more."""
    counts: defaultdict[str, defaultdict[str, float]] = defaultdict(lambda: defaultdict(float))
    units = [unit for unit in evidence.units if not found.units or unit.unit in found.units]
    for unit in units:
        for symptom, sort, count in sorts_of(evidence, unit):
            if symptom is None or evidence.is_open(symptom, unit.unit):
                counts["ending"][sort] += count
        for place, count in _places(evidence, unit):
            counts["place"][place] += count
    return {trait: _bounded(each) for trait, each in counts.items() if any(each.values())}


def _bounded(counts: Histogram) -> Histogram:
    every = sum(counts.values())
    return {name: count * min(_TOLD / every, 1.0) for name, count in counts.items()}


def sorts_of(evidence: Evidence, unit: UnitLedger) -> Iterator[tuple[Symptom | None, str, float]]:
    """How exchanges of a unit ended: of which symptom (None: well), in words, how many."""
    readings, followed = evidence.garbage(unit), evidence.followed(unit)
    behind = unit.behind if followed else 0
    well = max(unit.answered - unit.count(Ending.EXCEPTION) - behind, 0)
    again = len(unit.redundant) / max(len(unit.redundant) + len(unit.heeded), 1)
    yield None, "well", well * (1 - again)
    yield None, "well: again", well * again
    silent, went_on = unit.count(Ending.SILENT), share_that_went_on(evidence, unit.unit)
    yield Symptom.SILENCE, "silent", silent * (1 - went_on)
    yield Symptom.SILENCE, "silent: taken", silent * went_on
    codes = sum((poll.exceptions for poll in evidence.polls_of(unit.unit)), Counter[int]())
    for code, count in codes.items():
        part = unit.count(Ending.EXCEPTION) * count / codes.total()
        yield Symptom.REFUSAL, f"refused: {code if code in _CODES else 'other'}", part
    yield Symptom.LATENESS, "late", unit.late
    yield Symptom.LATENESS, "unfit", unit.unfit
    yield Symptom.LATENESS, "strays", unit.strays
    yield Symptom.DOUBLES, "double", unit.doubles
    for each in readings:
        yield Symptom.DAMAGE, _damage(each), unit.count(Ending.GARBAGE) / len(readings)
    for each in followed:
        yield Symptom.BEHIND, f"behind: {each.behind.value}", behind / len(followed)


def _damage(reading: Signature) -> str:
    """The kind of damage, and whether it is longer or shorter than what is due, of kinds that may be either."""
    kind = kind_of(reading)
    if kind not in _OF_ANY_LENGTH:
        return kind
    return kind + ("+" if reading.length > reading.due else "-" if reading.length < reading.due else "=")


def _places(evidence: Evidence, unit: UnitLedger) -> Iterator[tuple[str, float]]:
    """Where damaged answers are damaged first."""
    readings = evidence.readings(unit)
    for each in readings:
        if each.due > 0:
            yield _place(each), evidence.damaged(unit) / len(readings)


def _place(reading: Signature) -> str:
    at, due = reading.at, reading.due
    if at < _HEAD:
        return str(at)
    return "end" if at >= due - _TAIL else f"third {3 * (at - _HEAD) // max(due - _HEAD - _TAIL, 1)}"


Shares = Mapping[str, Mapping[str, Sequence[Histogram]]]  # by trait and cause, of each kind of bus


def typical(shares: Shares, none: Mapping[str, Sequence[Histogram]], cause: str, found: Traits) -> dict[str, float]:
    """How much likelier (in units of 8 bits) each trait is where that cause is so than where any is, or none of
    these. `none`: by trait, how it spreads in each kind of fault that has no word."""
    return {
        trait: _typical(shares[trait], none.get(trait, ()), cause, found[trait]) if trait in found else 0.0
        for trait in TRAITS
    }


def _typical(
    shares: Mapping[str, Sequence[Histogram]], none: Sequence[Histogram], cause: str, found: Histogram
) -> float:
    if cause not in shares:
        return 0.0
    sorts = len(set().union(found, *none, *(each for kinds in shares.values() for each in kinds)))
    anyhow = _dirichlet_bits(dict.fromkeys(found, _ANYHOW), _ANYHOW * sorts, found)
    bits = {each: _mean_bits([_spread_bits(kind, found, sorts) for kind in kinds]) for each, kinds in shares.items()}
    own = _mean_bits([bits[cause], anyhow])  # the bus may be of a kind that nobody has seen
    no_cause = _mean_bits([anyhow, *(_spread_bits(kind, found, sorts) for kind in none)])
    return (own - _mean_bits([_mean_bits(list(bits.values())), no_cause])) / _UNIT


def _mean_bits(bits: Sequence[float]) -> float:
    """log2 of the mean of probabilities."""
    most = max(bits)
    return most + log2(sum(2 ** (each - most) for each in bits) / len(bits))


def _spread_bits(shares: Histogram, found: Histogram, sorts: int) -> float:
    """As traits spread from bus to bus: Dirichlet and multinomial."""
    weights = {name: _STEADINESS * shares.get(name, 0.0) + _ANY for name in found}
    return _dirichlet_bits(weights, _STEADINESS * sum(shares.values()) + _ANY * sorts, found)


def _dirichlet_bits(weights: Histogram, every: float, found: Histogram) -> float:
    sums = sum(lgamma(weights[name] + n) - lgamma(weights[name]) for name, n in found.items())
    return (lgamma(every) - lgamma(every + sum(found.values())) + sums) / log(2)
