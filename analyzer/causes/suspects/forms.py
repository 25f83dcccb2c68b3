"""Registers that hold what is right in another form only: swapped, one place further on, scaled."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...tables.findings import Severity
from ..evidence import Evidence
from ..ledgerview import LedgerView, kept
from ..registerstates import PollValues
from ..registry import Suspicion, Symptom, suspect
from ..sisters import READS, asked_alike, sisters
from ..valueforms import MOVES, SCALES, SWAPS, FormFit, fit_among, fit_since
from .common import value_suspicion

_PAIRS: Final = 2
_PAIRS_OF_TWO: Final = 3  # where there is but one sister, whose registers may hold something else
_STEADIER: Final = 3.0
_COUNTS: Final = 0.9
_BITS: Final = 30.0  # for each value
_MOST_BITS: Final = 240.0
_FLOATS: Final = (1e-3, 1e7)  # what measured values are
_OCTAVES: Final = 3.0  # that a measured value moves in
_LEAST_SPREAD: Final = 0.1
_ALIKE: Final = 1 / 3  # of the values: so many may read the same way in both orders, by a neighbour's word
_HELD_BITS: Final = 10.0  # for a form that holds read after read
_SISTERS: Final = 2  # that agree
_SWAPPED: Final = {"words": "the two words", "bytes": "the two bytes", "both": "words and bytes"}
_CHANGED: Final[Mapping[str, Mapping[str, str]]] = {
    "before": {"place": "one register further on"},
    "behind": {"place": "one register before"},
    "0.001": {"times": "a thousandth as large"},
    "0.01": {"times": "a hundredth as large"},
    "0.1": {"times": "a tenth as large"},
    "10": {"times": "10 times as large"},
    "100": {"times": "100 times as large"},
    "1000": {"times": "1000 times as large"},
}


@suspect(
    "word-order",
    Severity.WARNING,
    blame="unit",
    text="Unit {unit} sends its values with {swapped} swapped: {pairs:,} values from register {address} on fit "
    "only in the other order[, by its {sisters:sister unit|sister units}][, by its own {earlier:,} reads before]",
    share="{pairs:,} values of unit {unit}",
    deciding_test="Compare one value of unit {unit} with its own display, in both orders",
    remedy="Set the unit's byte and word order, or that of its tags in the client, to the one in which they match",
)
def word_order(evidence: Evidence) -> Iterator[Suspicion]:
    """Values that are right in one order in most units and in the other one in one, or first in one and then in the other."""
    moved = {found.polls[0].unit for found in _other_forms(evidence) if found.fit.form in MOVES}
    for group in sisters(evidence):
        if len(group) < 2 or not moved.isdisjoint(poll.unit for poll in group):
            continue
        columns: dict[int, dict[int, int]] = {}  # by the first register: the order in each unit
        for column in range(group[0].words.shape[1] - 1):
            orders = {poll.unit: _order(poll, column) for poll in group}
            told = {unit: order for unit, order in orders.items() if order is not None}
            if len(told) == len(group):
                columns[column] = told
        yield from _outvoted(group, columns)
    for found in _in_other_form(evidence, SWAPS):
        fit, numbers = found.fit, {"swapped": _SWAPPED[found.fit.form], "pairs": found.fit.registers}
        yield _suspicion(found.polls, fit.bits + _HELD_BITS, {**numbers, **found.numbers}, found.since)


@suspect(
    "values-changed",
    Severity.NOTE,
    blame="unit",
    text="{registers:,} registers of unit {unit} from {address} on hold other values than are due[: what belongs {place}]"
    "[: numbers {times}][, by its {sisters:sister unit|sister units}][, by its own {earlier:,} reads before]",
    share="{registers:,} registers of unit {unit}",
    deciding_test="Compare one value of unit {unit} with its own display; look who changed its settings or its firmware then",
    remedy="Set the scale or the register map of unit {unit}, or that of its tags in the client, to what it should be",
)
def values_changed(evidence: Evidence) -> Iterator[Suspicion]:
    """Registers that hold those of their neighbours, or other powers of ten, from a moment on or among sister units."""
    for found in _in_other_form(evidence, (*MOVES, *SCALES)):
        numbers = {"place": (), "times": (), "registers": found.fit.registers, **_CHANGED[found.fit.form]}
        yield _suspicion(found.polls, found.fit.bits + _HELD_BITS, {**numbers, **found.numbers}, found.since)


class _OtherForm(NamedTuple):
    """What is read of a unit, the form in which it is right, compared with what, and since when."""

    polls: Sequence[PollValues]
    fit: FormFit
    sisters: tuple[int, ...]
    earlier: int
    since: int

    @property
    def numbers(self) -> Mapping[str, Any]:
        """For people."""
        return {"address": self.fit.address, "sisters": self.sisters, "earlier": self.earlier}


def _in_other_form(evidence: Evidence, forms: Collection[str]) -> Iterator[_OtherForm]:
    """Units of which one of these forms fits best of all."""
    for found in _other_forms(evidence):
        if found.fit.form in forms and evidence.is_open(Symptom.VALUES, found.polls[0].unit):
            yield found


@kept
def _other_forms(view: LedgerView) -> list[_OtherForm]:
    found = []
    for group in asked_alike(view):
        for i, polls in enumerate(group):
            first, others = polls[0].times, group[:i] + group[i + 1 :]
            change = fit_since(polls)
            if change is not None:
                earlier = int(np.searchsorted(first, change.time)) * polls[0].every
                found.append(_OtherForm(polls, change.fit, (), earlier, change.time))
            fit = fit_among(polls, others) if len(others) >= _SISTERS else None
            if fit is not None:
                units = tuple(other[0].unit for other in others)
                found.append(_OtherForm(polls, fit, units, 0, int(first[0])))
    return found


def _suspicion(polls: Sequence[PollValues], bits: float, numbers: Mapping[str, Any], since: int) -> Suspicion:
    until = max(int(poll.times[-1]) for poll in polls)
    return value_suspicion(polls[0].unit, min(bits, _MOST_BITS), numbers, since, until)


def _float(words: NDArray[np.uint16], *, swapped: bool) -> NDArray[np.float64]:
    pair = words[:, ::-1] if swapped else words
    with np.errstate(invalid="ignore"):  # any bits may come
        found: NDArray[np.float64] = np.ascontiguousarray(pair).astype(">u2").view(">f4")[:, 0].astype(np.float64)
    return found


def _spread(values: NDArray[np.float64]) -> float:
    """How far values lie apart, in octaves; infinite where they are not what a measured value is."""
    sizes = np.abs(values)
    usual = np.isfinite(values) & (sizes > _FLOATS[0]) & (sizes < _FLOATS[1])
    if usual.mean() < _COUNTS:
        return np.inf
    low, high = np.quantile(np.log2(sizes[usual]), (0.05, 0.95))
    return float(high - low)


def _outvoted(group: list[PollValues], columns: dict[int, dict[int, int]]) -> Iterator[Suspicion]:
    wrong = {poll.unit: sum(2 * orders[poll.unit] - 1 for orders in columns.values()) for poll in group}
    swapped, usual = ([unit for unit, sum_ in wrong.items() if sign * sum_ > 0] for sign in (1, -1))
    odd, rest, order = (swapped, usual, 1) if len(swapped) <= len(usual) else (usual, swapped, 0)
    if len(odd) != 1 or len(rest) < 1 or (len(rest) == 1 and order == 0):
        return
    alike = sum(2 * sum(orders[unit] == orders[odd[0]] for unit in rest) > len(rest) for orders in columns.values())
    if alike > _ALIKE * len(columns):
        return  # a unit that exchanges the words does so with all of them
    poll = next(poll for poll in group if poll.unit == odd[0])
    pairs = sum(orders[odd[0]] == order for orders in columns.values())
    if pairs < (_PAIRS if len(rest) > 1 else _PAIRS_OF_TWO):
        return
    numbers = {
        "swapped": _SWAPPED["words"],
        "pairs": pairs,
        "address": poll.address + next(iter(columns)),
        "sisters": tuple(rest),
        "earlier": 0,
    }
    yield _suspicion([poll], _BITS * pairs, numbers, int(poll.times[0]))


def _order(poll: PollValues, column: int) -> int | None:
    """0 where two registers are a float as they stand, 1 where they are with the words exchanged, None if neither."""
    words = poll.words[:, column : column + 2]
    changes = (words[1:] != words[:-1]).sum(axis=0)
    if changes.max() < READS // 3:
        return None  # what does not move tells nothing
    order = int(changes[0] > changes[1])  # the low word moves more
    right, wrong = (_spread(_float(words, swapped=bool(each))) for each in (order, 1 - order))
    return order if right < _OCTAVES and wrong > max(_STEADIER * right, _LEAST_SPREAD) else None
