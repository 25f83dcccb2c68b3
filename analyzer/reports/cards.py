"""A card a unit: what became of its requests, where its answers are damaged, how long it takes, when that changed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..causes.evidence import Evidence
from ..causes.exchanges import Ending
from ..causes.ledger import ASKED, BAD, DELAY, Ledger
from ..causes.signatures import AnswerDamage, Signature
from ..causes.spells import spells_of
from ..causes.unitledger import UnitLedger
from ..languages import page_words
from ..words import between
from .model import Times, UnitCard, UnitChange

_SURE_BITS: Final = 16.0  # that a change of outcomes must be worth
_SLOWER: Final = 1.5  # times: that a change of delays must be
_PARTS: Final = 4  # of the time on either side of it, at the least
_ANSWERS: Final = 20
_CHANGES: Final = 4
_REGIONS: Final = {
    AnswerDamage.HEAD: "head", AnswerDamage.TAIL: "tail", AnswerDamage.CUT: "cut short",
    AnswerDamage.LONG: "too long", AnswerDamage.CONVENTION: "check value", AnswerDamage.COUNT: "byte count",
    AnswerDamage.CROSSED: "next request inside", AnswerDamage.OTHER: "another answer", AnswerDamage.WHOLE: "all of it",
}  # fmt: skip


def unit_cards(ledger: Ledger, times: Mapping[int, Times]) -> tuple[UnitCard, ...]:
    """The cards of all units that were asked for something. `times`: those of their answers, as tables have them."""
    evidence = Evidence(ledger)
    return tuple(_card(evidence, unit, times.get(unit.unit, Times())) for unit in evidence.units)


def _card(evidence: Evidence, unit: UnitLedger, times: Times) -> UnitCard:
    garbage = unit.count(Ending.GARBAGE)
    regions = Counter(map(_region, evidence.readings(unit)))
    read = sum(regions.values())
    least, most = times.bounds("min"), times.bounds("p95")
    bounds = None if least is None or most is None or not evidence.ledger.timed else (least[0], most[1])
    return UnitCard(
        unit.unit,
        unit.asked,
        unit.count(Ending.OK),
        unit.count(Ending.EXCEPTION),
        unit.count(Ending.SILENT),
        garbage,
        unit.late + unit.strays,
        unit.doubles,
        {region: round(garbage * count / read) for region, count in regions.most_common()},
        bounds,
        tuple(_changes(evidence.ledger, unit))[:_CHANGES],
    )


def _region(reading: Signature) -> str:
    if reading.damage in (AnswerDamage.BITS, AnswerDamage.MIDDLE) and reading.due > 0 and reading.at >= 0:
        thirds = ("head", "middle", "tail")
        return thirds[min(3 * reading.at // reading.due, 2)]
    return _REGIONS.get(reading.damage, "middle")


def _changes(ledger: Ledger, unit: UnitLedger) -> list[UnitChange]:
    grid = ledger.grid
    if not ledger.timed or grid.begin_ns is None:
        return []
    requests, bad = grid.counts((ASKED, unit.unit)), grid.counts((BAD, unit.unit))
    bits, inside = spells_of(bad, requests)
    changes = []
    if bits >= _SURE_BITS:
        rest = ~inside
        usual = page_words(", {bad} of {all} otherwise", bad=int(bad[rest].sum()), all=int(requests[rest].sum()))
        edges = np.flatnonzero(np.diff(np.concatenate(([0], inside.astype(np.int8), [0]))))
        for begin, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
            words = "{bad} of {all} requests without a good answer"
            hits = page_words(words, bad=int(bad[begin:end].sum()), all=int(requests[begin:end].sum()))
            until = min(grid.begin_ns + end * grid.width_ns, ledger.end)
            changes.append(UnitChange(grid.begin_ns + begin * grid.width_ns, until, hits + usual))
    slower = _slower(requests - bad, grid.counts((DELAY, unit.unit)))
    if slower is not None:
        at, before, after = slower
        words = page_words(
            "answers after {before} before, {after} from then on (mean)",
            before=between(before, before), after=between(after, after),
        )  # fmt: skip
        changes.append(UnitChange(grid.begin_ns + at * grid.width_ns, ledger.end, words))
    return changes


def _slower(answers: NDArray[np.int64], delays: NDArray[np.int64]) -> tuple[int, int, int] | None:
    """Where the mean delay changes most, and what it is before and after; None where it does not by much."""
    used = np.flatnonzero(answers > 0)
    if len(used) < 2 * _PARTS or answers.sum() < _ANSWERS:
        return None
    counts, sums = np.cumsum(answers[used]), np.cumsum(delays[used])
    before = sums[:-1] / counts[:-1]
    after = (sums[-1] - sums[:-1]) / np.maximum(counts[-1] - counts[:-1], 1)
    weight = np.minimum(counts[:-1], counts[-1] - counts[:-1])
    apart = np.abs(np.log(np.maximum(after, 1) / np.maximum(before, 1))) * np.sqrt(weight)
    apart[: _PARTS - 1], apart[len(apart) - _PARTS + 1 :] = 0, 0
    at = int(np.argmax(apart))
    first, last = round(float(before[at])), round(float(after[at]))
    spread = _spread(delays[used] / answers[used])
    if max(first, last) < _SLOWER * max(min(first, last), 1) or abs(last - first) < 2 * spread:
        return None
    return int(used[at + 1]), first, last


def _spread(means: NDArray[np.float64]) -> float:
    """How far the mean delays of neighbouring parts of the time are apart, as a rule."""
    return float(np.median(np.abs(np.diff(means)))) if len(means) > 1 else 0.0
