"""Values that cannot be: by their own past, by sister units that are asked for the same registers, by their register "
"map."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...tables.findings import Severity
from ..evidence import Evidence
from ..registerstates import PollValues
from ..registry import Suspicion, Symptom, suspect

_READS: Final = 24  # kept ones, under which nothing is said
_MOVES: Final = 0.3  # of its reads a value that moves is another one
_SOME_MOVES: Final = 0.1  # the same, of one that moves slowly
_MANY_COLUMNS: Final = 6  # each of which stands still by chance in a third of all units
_COLUMNS: Final = 3  # that stand still together
_MOST_SISTERS: Final = 0.75
_EMPTY: Final = (0, 0x7FFF, 0x8000, 0xFFFF)  # what is not connected stands still
_LEAST_UP: Final = 5
_CARRY: Final = 8.0  # usual steps
_WORD: Final = 1 << 16
_PAIRS: Final = 2
_PAIRS_OF_TWO: Final = 3  # where there is but one sister, whose registers may hold something else
_AT_ONCE: Final = 4  # reads, within which all stop
_STEADIER: Final = 3.0
_STILL: Final = 0.4  # of the capture
_COUNTS: Final = 0.9  # of the steps of a counter that do not go down
_USUAL: Final = 0.8  # of a counter's steps are no larger than its usual one
_LEAP: Final = 60.0  # times its usual step, which no pause explains
_TORN_READS: Final = 12  # within which a carry comes to the other word
_BITS: Final = 30.0  # for each jump
_MOST_BITS: Final = 240.0
_TO_AND_FRO: Final = 2  # steps that one answer makes in the place of another
_FLOATS: Final = (1e-3, 1e7)  # what measured values are
_AS_LARGE: Final = 2.0  # times, up or down, that the same thing may differ from unit to unit
_OCTAVES: Final = 3.0  # that a measured value moves in
_LEAST_SPREAD: Final = 0.1
_ALIKE: Final = 1 / 3  # of the values: so many may read the same way in both orders, by a neighbour's word


def _sisters(evidence: Evidence) -> Iterator[list[PollValues]]:
    """Polls of different units for the same registers; alone where no other unit is asked so."""
    groups: dict[tuple[int, int, int], list[PollValues]] = {}
    for poll in evidence.ledger.values.polls.values():
        if len(poll.times) >= _READS and evidence.is_open(Symptom.VALUES, poll.unit):
            groups.setdefault((poll.function, poll.address, poll.words.shape[1]), []).append(poll)
    yield from groups.values()


def _moves(poll: PollValues) -> NDArray[np.float64]:
    """The share of reads that show another value than the read before, by register."""
    found: NDArray[np.float64] = (poll.words[1:] != poll.words[:-1]).mean(axis=0)
    return found


@suspect(
    "frozen-values",
    Severity.WARNING,
    blame="unit",
    text="The values of unit {unit} stand still: {registers} registers from {address} on have not changed in {reads} "
    "reads, "
    "those of its {sisters:sister unit|sister units} did all the time",
    share="{registers} registers of unit {unit}",
    deciding_test="Compare the registers of unit {unit} with its own display; what it measures is changed for a test "
    "only with the operator's consent",
    remedy="Restart the unit or its measuring part; look for a hold or simulation mode",
)
def frozen_values(evidence: Evidence) -> Iterator[Suspicion]:
    """Registers that move in sister units and stand still in one."""
    for group in _sisters(evidence):
        if len(group) < 2:
            continue
        moves = [_moves(poll) for poll in group]
        for i, poll in enumerate(group):
            others = np.array([each for j, each in enumerate(moves) if j != i])
            lively = ((others >= _MOVES).mean(axis=0) >= _MOST_SISTERS) & ~np.isin(poll.words[-1], _EMPTY)
            changed = poll.words[1:] != poll.words[:-1]
            last = np.where(changed.any(axis=0), len(changed) - np.argmax(changed[::-1], axis=0), 0)
            frozen = lively & (len(changed) - last >= max(_READS // 2, _STILL * len(changed)))
            if np.count_nonzero(frozen) < max(_COLUMNS, 0.5 * np.count_nonzero(lively)):
                continue
            if not (
                _stopped(changed[:, frozen], last[frozen])
                or (
                    _never(others, frozen)
                    and _of_a_kind(moves[i], others)
                    and _as_large(poll, [each for each in group if each is not poll], frozen)
                )
                or _altogether(changed, others)
            ):
                continue
            since = int(last[frozen].max())
            still = len(changed) - since
            rate = float(np.median(others[:, frozen], axis=0).mean())
            yield Suspicion(
                (poll.unit,),
                min(still * -np.log2(max(1 - rate, 0.05)) + 10, _MOST_BITS),
                frozenset({(Symptom.VALUES, poll.unit)}),
                {
                    "unit": poll.unit,
                    "registers": int(np.count_nonzero(frozen)),
                    "address": poll.address + int(np.argmax(frozen)),
                    "reads": still * poll.every,
                    "sisters": tuple(each.unit for j, each in enumerate(group) if j != i),
                },
                since=int(poll.times[since]),
                until=int(poll.times[-1]),
            )


def _stopped(changed: NDArray[np.bool_], last: NDArray[np.intp]) -> bool:
    """Whether registers that moved till then stood still all at once."""
    since = int(last.max())
    before = changed[:since]
    return since >= _LEAST_UP and since - int(last.min()) <= _AT_ONCE and bool((before.mean(axis=0) >= _MOVES).all())


def _never(others: NDArray[np.float64], frozen: NDArray[np.bool_]) -> bool:
    """Whether some registers that never moved do so in every one of several sisters."""
    lively = frozen & (others >= _MOVES).all(axis=0)
    return len(others) >= _PAIRS and int(np.count_nonzero(lively)) >= _COLUMNS


def _as_large(poll: PollValues, sisters: list[PollValues], frozen: NDArray[np.bool_]) -> bool:
    """Whether what stands still is about as large as in the sisters: else it may be another thing, a setting or a "
    "state."""
    words = np.concatenate([each.words[:, frozen] for each in sisters]).astype(np.float64)
    own = poll.words[-1, frozen].astype(np.float64)
    alike = (own >= words.min(axis=0) / _AS_LARGE) & (own <= words.max(axis=0) * _AS_LARGE)
    return bool(alike.mean() >= _MOST_SISTERS)


def _altogether(changed: NDArray[np.bool_], others: NDArray[np.float64]) -> bool:
    """Whether not one register has moved for long, while many do in every one of several sisters: whatever each of them
    stands for, a unit that measures anything moves some."""
    at = np.flatnonzero(changed.any(axis=1))
    still = len(changed) - (int(at[-1]) + 1 if len(at) else 0)
    moving = (others >= _SOME_MOVES).all(axis=0)
    return (
        len(others) >= _PAIRS
        and still >= max(_READS // 2, _STILL * len(changed))
        and int(np.count_nonzero(moving)) >= _MANY_COLUMNS
    )


def _of_a_kind(own: NDArray[np.float64], others: NDArray[np.float64]) -> bool:
    """Whether units that are asked for the same registers hold the same things in them: the others move alike, and this
    one moves nowhere where none of them does. Else what stands still in one may be something else there."""
    move = others >= _MOVES
    alike = float((move.all(axis=0) | ~move.any(axis=0)).mean())
    return alike >= _MOST_SISTERS and not ((own >= _MOVES) & ~move.any(axis=0)).any()


def _long(poll: PollValues, column: int, *, swapped: bool = False) -> NDArray[np.int64]:
    """Two registers as a whole number."""
    pair = poll.words[:, column : column + 2].astype(np.int64)
    return pair[:, 1] << 16 | pair[:, 0] if swapped else pair[:, 0] << 16 | pair[:, 1]


def _counting(poll: PollValues, *, swapped: bool) -> NDArray[np.bool_]:
    """Which registers may be the first of a counter's two: of all others `_jumps` would say that they are no "
    "counter's."""
    words = poll.words.astype(np.int64)
    first, second = words[:, :-1], words[:, 1:]
    steps = np.diff(second << 16 | first if swapped else first << 16 | second, axis=0)
    up = steps > 0
    ups = up.sum(axis=0)
    small = (up & (steps <= _WORD // 2)).sum(axis=0)  # where so few are, the usual step is a larger one
    counting: NDArray[np.bool_] = (ups >= _LEAST_UP) & (small > np.floor(_USUAL * (ups - 1)))
    counting &= (steps < 0).sum(axis=0) <= (1 - _COUNTS) * len(steps)
    return counting


def _jumps(values: NDArray[np.int64], times: NDArray[np.int64]) -> NDArray[np.intp] | None:
    """Where a counter falls back, or leaps by more than the time between two reads; None where these values are no
    counter's."""
    steps = np.diff(values)
    if np.count_nonzero(steps < 0) > (1 - _COUNTS) * len(steps):
        return None
    up = steps[steps > 0]
    if len(up) < _LEAST_UP:
        return None
    usual = float(np.quantile(up, _USUAL))
    if usual > _WORD / 2:
        return None  # not in step with the low word: rather a float
    if steps.min() >= 0 and steps.max() <= _LEAP * usual:
        return np.zeros(0, np.intp)  # whatever the pauses were
    apart = np.diff(times).astype(np.float64)
    longer = np.maximum(apart / max(float(np.median(apart)), 1.0), 1.0)
    jumps = ((steps < 0) | (steps > _LEAP * usual * longer)).nonzero()[0]
    beside = np.abs(steps[jumps]) % _WORD
    by_words = np.minimum(beside, _WORD - beside) <= 4 * usual * longer[jumps]
    most = usual * float(longer.max())
    torn = (
        bool((np.abs(steps[jumps[by_words]]) > _WORD / 2).all())
        and _undone(steps, jumps[by_words], most)
        and _at_carry(values, jumps[by_words], most)
    )
    if by_words.any() and not torn:
        return None  # a carry into another register than this one
    return jumps


def _is_torn(steps: NDArray[np.int64], jumps: NDArray[np.intp]) -> bool:
    """Whether each jump is about one of the high word, and undone soon: the two words were of different moments. That may
    well come at regular times, each time the low word carries."""
    sizes = np.abs(steps[jumps])
    usual = float(np.median(np.abs(steps)))
    return bool((np.abs(sizes - _WORD) < _WORD / 4).all()) and _undone(steps, jumps, usual)


def _at_carry(values: NDArray[np.int64], jumps: NDArray[np.intp], usual: float) -> bool:
    """Whether the low word has just carried at each of these jumps, or is about to: only then are two moments told apart
    by a whole high word. A register of its own changes at any time."""
    low = values[jumps + 1] % _WORD
    return bool((np.minimum(low, _WORD - low) <= _CARRY * max(usual, 1.0)).all())


def _undone(steps: NDArray[np.int64], jumps: NDArray[np.intp], usual: float) -> bool:
    """Whether each jump by whole high words is undone at one of the next reads: its two words were of different
    moments."""
    left, signs = set(jumps.tolist()), np.sign(steps)  # the product of two steps may be beyond 64 bits
    while left:
        first = min(left)
        left.remove(first)
        soon = range(first + 1, min(first + 1 + _TORN_READS, len(steps)))
        back = next((j for j in soon if signs[j] * signs[first] < 0), None)
        if back is None:
            return bool(first >= len(steps) - _TORN_READS)
        if abs(int(steps[first]) + int(steps[back])) > 8 * usual:
            return False
        left.discard(back)
    return True


@suspect(
    "counter-jumps",
    Severity.WARNING,
    blame="unit",
    text="A counter of unit {unit} (register {address}, 32 bits) jumps: {jumps:time|times} it fell back or leapt, by "
    "up to {most:,}",
    share="{jumps:,} of {reads} reads",
    deciding_test="Record this counter alone for an hour, and compare it with the unit's own display",
    remedy="Check whether one counter is read in two requests, or whether the unit loses it at a restart",
)
def counter_jumps(evidence: Evidence) -> Iterator[Suspicion]:
    """Counters that do not only count, where those of sister units do."""
    for group in _sisters(evidence):
        counting = {swapped: [_counting(poll, swapped=swapped) for poll in group] for swapped in (False, True)}
        for column in range(group[0].words.shape[1] - 1):
            for swapped, may in counting.items():
                counters = [poll for poll, columns in zip(group, may, strict=True) if columns[column]]
                yield from _of_counters(evidence, counters, column, swapped=swapped)


def _of_counters(evidence: Evidence, group: list[PollValues], column: int, *, swapped: bool) -> Iterator[Suspicion]:
    found = [(poll, _jumps(_long(poll, column, swapped=swapped), poll.times)) for poll in group]
    clean = sum(jumps is not None and not len(jumps) for _, jumps in found)
    for poll, jumps in found:
        if jumps is None or not len(jumps):
            continue
        values = _long(poll, column, swapped=swapped)
        torn = _is_torn(np.diff(values), jumps)
        if clean < 1 and not torn and not _odd(poll, jumps):
            continue
        if len(jumps) <= _TO_AND_FRO * evidence.ledger.units[poll.unit].loose:
            continue  # answers came in the place of others: so may the one that is read here
        steps = np.diff(values)
        yield Suspicion(
            (poll.unit,),
            min(_BITS * len(jumps), _MOST_BITS) if clean or len(jumps) > 1 else 0.0,
            frozenset({(Symptom.VALUES, poll.unit)}),
            {
                "unit": poll.unit,
                "address": poll.address + column,
                "jumps": len(jumps),
                "most": int(np.abs(steps[jumps]).max()),
                "reads": poll.reads,
            },
            since=int(poll.times[jumps[0]]),
            until=int(poll.times[jumps[-1] + 1]),
        )


def _odd(poll: PollValues, jumps: NDArray[np.intp]) -> bool:
    """Whether jumps come at no regular times: a clock's registers and counters that wrap jump regularly."""
    if len(jumps) < _COLUMNS:
        return False
    apart = np.diff(poll.times[jumps]).astype(np.float64)
    return bool(apart.std() > _MOVES * apart.mean())


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


@suspect(
    "word-order",
    Severity.WARNING,
    blame="unit",
    text="Unit {unit} sends its floats with the two words swapped: {pairs:,} values from register {address} on match "
    "those of its {sisters:sister unit|sister units} only in the other word order",
    share="{pairs:,} values of unit {unit}",
    deciding_test="Compare one value of unit {unit} with its own display, in both orders",
    remedy="Set the unit's word order, or that of its tags in the client, to that of the others",
)
def word_order(evidence: Evidence) -> Iterator[Suspicion]:
    """Floats that are right in one order in most units and in the other one in one."""
    for group in _sisters(evidence):
        if len(group) < 2:
            continue
        columns: dict[int, dict[int, int]] = {}  # by the first register: the order in each unit
        for column in range(group[0].words.shape[1] - 1):
            orders = {poll.unit: _order(poll, column) for poll in group}
            told = {unit: order for unit, order in orders.items() if order is not None}
            if len(told) == len(group):
                columns[column] = told
        yield from _outvoted(group, columns)


def _outvoted(group: list[PollValues], columns: dict[int, dict[int, int]]) -> Iterator[Suspicion]:
    wrong = {poll.unit: sum(2 * orders[poll.unit] - 1 for orders in columns.values()) for poll in group}
    swapped, usual = ([unit for unit, sum_ in wrong.items() if sign * sum_ > 0] for sign in (1, -1))
    odd, rest, order = (swapped, usual, 1) if len(swapped) <= len(usual) else (usual, swapped, 0)
    if len(odd) != 1 or len(rest) < 1 or (len(rest) == 1 and order == 0):
        return
    alike = sum(2 * sum(orders[unit] == orders[odd[0]] for unit in rest) > len(rest) for orders in columns.values())
    if alike > _ALIKE * len(columns):
        return  # a unit that exchanges the words does so with all of them
    first = next(iter(columns))
    poll = next(poll for poll in group if poll.unit == odd[0])
    pairs = sum(orders[odd[0]] == order for orders in columns.values())
    if pairs < (_PAIRS if len(rest) > 1 else _PAIRS_OF_TWO):
        return
    yield Suspicion(
        (odd[0],),
        min(_BITS * pairs, _MOST_BITS),
        frozenset({(Symptom.VALUES, odd[0])}),
        {
            "unit": odd[0],
            "pairs": pairs,
            "address": poll.address + first,
            "sisters": tuple(rest),
        },
        since=int(poll.times[0]),
        until=int(poll.times[-1]),
    )


def _order(poll: PollValues, column: int) -> int | None:
    """0 where two registers are a float as they stand, 1 where they are with the words exchanged, None if neither."""
    words = poll.words[:, column : column + 2]
    changes = (words[1:] != words[:-1]).sum(axis=0)
    if changes.max() < _READS // 3:
        return None  # what does not move tells nothing
    order = int(changes[0] > changes[1])  # the low word moves more
    right, wrong = (_spread(_float(words, swapped=bool(each))) for each in (order, 1 - order))
    return order if right < _OCTAVES and wrong > max(_STEADIER * right, _LEAST_SPREAD) else None


_OUTSIDE_BITS = 30.0  # for the first value, and one for each other


@suspect(
    "values-out-of-limits",
    Severity.WARNING,
    blame="unit",
    text="Unit {unit}: {said}; values out of their map's limits: {values:,}",
    share="{values:value|values}",
    deciding_test="Compare the value with the device's display: it tells a wrong map from a wrong measurement",
    remedy="Check scale, type and limits of the map, then the sensor or the wiring behind unit {unit}",
)
def out_of_limits(evidence: Evidence) -> Iterator[Suspicion]:
    """Numbers that the register map of the unit does not allow."""
    breaches = evidence.ledger.breaches
    for unit in dict.fromkeys(breach.unit for breach in breaches):
        if not evidence.is_open(Symptom.VALUES, unit):
            continue
        texts = [breach.text for breach in breaches if breach.unit == unit]
        yield Suspicion(
            (unit,),
            _OUTSIDE_BITS + len(texts) - 1,
            frozenset({(Symptom.VALUES, unit)}),
            {"unit": unit, "said": texts[0], "values": len(texts)},
        )
