"""Values in whose place a unit says that it has none."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from ...registers.looks import NO_FLOAT, NO_VALUE
from ...tables.findings import Severity
from ...tables.schema import Bools, Int64s
from ..evidence import Evidence
from ..registerstates import PollValues
from ..registry import Suspicion, suspect
from ..sisters import READS, open_reads
from ..valueforms import shorter_way
from .common import value_suspicion

_WORD: Final = 1 << 16
_DISTINCT: Final = 8  # other values, and
_MOVES: Final = 0.1  # of its reads: that is a measured value's, not a state's
_MOVE: Final = 0.9  # of its moves are no longer than its usual one
_FAR: Final = 16  # usual moves from a code: no value goes there by itself
_LEAST: Final = 3  # reads
_MOST: Final = 0.8  # of all
_ENTRY_BITS: Final = 14.0  # for each time that it leaps there,
_READ_BITS: Final = 2.0  # and each read that it stays
_MOST_BITS: Final = 120.0
_OCTAVES: Final = 6  # between the exponents of floats of one thing,
_TINY: Final = 90  # each larger than that
_HUGE: Final = 187  # and smaller than that: 1e18, in which nothing is measured


class _LostValue(NamedTuple):
    address: int
    codes: tuple[str, ...]
    lost: Bools
    bits: float


@suspect(
    "value-lost",
    Severity.NOTE,
    blame="unit",
    text="Unit {unit} holds {codes:code|codes} in the place of a value, in {registers:register|registers} from {address} "
    "on, in {lost:,} of {reads:,} reads and {spells:spell|spells}; else it measures there",
    share="{lost:,} of {reads:,} reads",
    deciding_test="Compare with the display of unit {unit}, and measure its sensor and the wires at its terminals",
    remedy="Look at the sensor, its wires and its supply; let the client show that there is no value, and not the code as "
    "a number",
)
def value_lost(evidence: Evidence) -> Iterator[Suspicion]:
    """Measured values that leap to a code for 'no value', and back or not."""
    for unit, polls in open_reads(evidence):
        found = [(poll, lost) for poll in polls for lost in _lost_of(poll)]
        if not found:
            continue
        poll, most = max(found, key=lambda each: int(each[1].lost.sum()))
        numbers = {
            "registers": len(found),
            "address": min(each.address for _, each in found),
            "lost": int(most.lost.sum()) * poll.every,
            "reads": poll.reads,
            "codes": most.codes,
            "spells": _spells(most.lost),
        }
        begin, end = poll.times[most.lost][[0, -1]].tolist()
        yield value_suspicion(unit, min(sum(each.bits for _, each in found), _MOST_BITS), numbers, begin, end)


def _spells(lost: Bools) -> int:
    return int(np.count_nonzero(np.diff(lost.astype(np.int8), prepend=0) == 1))


def _lost_of(poll: PollValues) -> Iterator[_LostValue]:
    words = poll.words.astype(np.int64)
    for column in np.flatnonzero(np.isin(words, NO_VALUE).any(axis=0)).tolist():
        yield from _lost(poll.address + column, words[:, column], np.isin(words[:, column], NO_VALUE))
    for column in range(words.shape[1] - 1):
        for order in (0, 1):
            high, low = words[:, column + order], words[:, column + 1 - order]
            no_float = np.isin(high, NO_FLOAT)
            if no_float.any() and _is_float(high[~no_float]):
                yield from _lost(poll.address + column, high << 16 | low, no_float)


def _is_float(high: Int64s) -> bool:
    """Whether these may be more significant words of floats of one thing, whose exponents are close."""
    exponents = high >> 7 & 0xFF
    is_measured = len(high) >= READS // 2 and exponents.min() > _TINY and exponents.max() < _HUGE
    return bool(is_measured and np.ptp(exponents) <= _OCTAVES)


def _lost(address: int, values: Int64s, lost: Bools) -> Iterator[_LostValue]:
    """Where a value that is measured is a code in some reads."""
    others, spells = values[~lost], _spells(lost)
    count = int(np.count_nonzero(lost))
    if count < _LEAST or count > _MOST * len(values) or len(np.unique(others)) < _DISTINCT:
        return
    size = _WORD if values.max() < _WORD else _WORD**2
    moves = np.abs(shorter_way(np.diff(others), size))
    if np.count_nonzero(moves) < _MOVES * len(moves):
        return
    usual = float(np.quantile(moves, _MOVE)) + 1
    nearest = min(float(np.abs(shorter_way(others - code, size)).min()) for code in np.unique(values[lost]).tolist())
    if size == _WORD and nearest < _FAR * usual:
        return  # it may have gone there
    first = values[lost] if size == _WORD else values[lost] >> 16
    codes = tuple(f"{code:04X}" for code in np.unique(first).tolist())
    yield _LostValue(address, codes, lost, _ENTRY_BITS * spells + _READ_BITS * (count - spells))
