"""Values that cannot be: by their own past, by sister units that are asked for the same registers, by their register "
"map."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ...registers.looks import NO_VALUE
from ...tables.findings import Severity
from ..evidence import Evidence
from ..registerstates import PollValues
from ..registry import Suspicion, Symptom, suspect
from ..sisters import READS, open_reads, sisters
from ..standstills import MOVES, moving_shares, standstills
from .common import value_suspicion

_SOME_MOVES: Final = 0.1  # the same, of one that moves slowly
_MANY_COLUMNS: Final = 6  # each of which stands still by chance in a third of all units
_COLUMNS: Final = 3  # that stand still together
_MOST_SISTERS: Final = 0.75
_EMPTY: Final = (0, *NO_VALUE)  # what is not connected stands still
_LEAST_UP: Final = 5
_PAIRS: Final = 2
_AT_ONCE: Final = 4  # reads, within which all stop
_STILL: Final = 0.4  # of the capture
_MOST_BITS: Final = 240.0
_AS_LARGE: Final = 2.0  # times, up or down, that the same thing may differ from unit to unit


@suspect(
    "frozen-values",
    Severity.WARNING,
    blame="unit",
    text="The values of unit {unit} stand still: {registers} registers from {address} on have not changed in {reads} "
    "reads[, those of its {sisters:sister unit|sister units} did all the time][, and then leapt, {ended:time|times}]",
    share="{registers} registers of unit {unit}",
    deciding_test="Compare the registers of unit {unit} with its own display; what it measures is changed for a test "
    "only with the operator's consent",
    remedy="Restart the unit or its measuring part; look for a hold or simulation mode",
)
def frozen_values(evidence: Evidence) -> Iterator[Suspicion]:
    """Registers that move in sister units and stand still in one; units that stand still for longer than they ever do."""
    for group in sisters(evidence):
        for poll in group if len(group) > 1 else ():
            yield from _among(poll, [each for each in group if each is not poll])
    for unit, polls in open_reads(evidence):
        found, bits = standstills(polls)
        if found:
            reads = round(sum(each.reads for each in found) / len(polls)) * polls[0].every
            numbers = {"reads": reads, "sisters": (), "ended": sum(not each.lasts for each in found)}
            most = max(found, key=lambda each: each.registers)
            yield _suspicion(unit, bits, most.registers, most.address, numbers, found[0].since, found[-1].until)


def _among(poll: PollValues, others: list[PollValues]) -> Iterator[Suspicion]:
    """A poll of which registers stand still that move in sister units."""
    own, theirs = moving_shares(poll), np.array([moving_shares(each) for each in others])
    changed = poll.words[1:] != poll.words[:-1]
    last = np.where(changed.any(axis=0), len(changed) - np.argmax(changed[::-1], axis=0), 0)
    lively = ((theirs >= MOVES).mean(axis=0) >= _MOST_SISTERS) & ~np.isin(poll.words[-1], _EMPTY)
    frozen = lively & (len(changed) - last >= max(READS // 2, _STILL * len(changed)))
    if np.count_nonzero(frozen) < max(_COLUMNS, 0.5 * np.count_nonzero(lively)):
        return
    never = _never(theirs, frozen) and _of_a_kind(own, theirs) and _as_large(poll, others, frozen)
    if never or _stopped(changed[:, frozen], last[frozen]) or _altogether(changed, theirs):
        since = int(last[frozen].max())
        still = len(changed) - since
        rate = float(np.median(theirs[:, frozen], axis=0).mean())
        numbers = {"reads": still * poll.every, "sisters": tuple(each.unit for each in others), "ended": 0}
        bits = still * -np.log2(max(1 - rate, 0.05)) + 10
        first, (begin, end) = poll.address + int(np.argmax(frozen)), poll.times[[since, -1]].tolist()
        yield _suspicion(poll.unit, bits, int(np.count_nonzero(frozen)), first, numbers, begin, end)


def _suspicion(
    unit: int, bits: float, registers: int, address: int, numbers: Mapping[str, Any], since: int, until: int
) -> Suspicion:
    numbers = {"registers": registers, "address": address, **numbers}
    return value_suspicion(unit, min(bits, _MOST_BITS), numbers, since, until)


def _stopped(changed: NDArray[np.bool_], last: NDArray[np.intp]) -> bool:
    """Whether registers that moved till then stood still all at once."""
    since = int(last.max())
    before = changed[:since]
    return since >= _LEAST_UP and since - int(last.min()) <= _AT_ONCE and bool((before.mean(axis=0) >= MOVES).all())


def _never(others: NDArray[np.float64], frozen: NDArray[np.bool_]) -> bool:
    """Whether some registers that never moved do so in every one of several sisters."""
    lively = frozen & (others >= MOVES).all(axis=0)
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
        and still >= max(READS // 2, _STILL * len(changed))
        and int(np.count_nonzero(moving)) >= _MANY_COLUMNS
    )


def _of_a_kind(own: NDArray[np.float64], others: NDArray[np.float64]) -> bool:
    """Whether units that are asked for the same registers hold the same things in them: the others move alike, and this
    one moves nowhere where none of them does. Else what stands still in one may be something else there."""
    move = others >= MOVES
    alike = float((move.all(axis=0) | ~move.any(axis=0)).mean())
    return alike >= _MOST_SISTERS and not ((own >= MOVES) & ~move.any(axis=0)).any()


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
        yield value_suspicion(unit, _OUTSIDE_BITS + len(texts) - 1, {"said": texts[0], "values": len(texts)})
