"""Exchanges as contrasts see them: one row a request, with what stood before it and what the client did next.

Which exchange is remembered hangs on its number alone, however the rows came; of a long capture a part is, spread over
all of it as chance would spread it (an even stride would always meet the same poll of a round). So the table is
bounded, and each row carries what its neighbours were.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Bools, Columns, Int16s, Int32s, Int64s, UInt8s
from ..tables.transactions import NEVER
from .exchanges import Ending, Exchanges

_MOST: Final = 1 << 14  # rows
_SPREAD: Final = np.uint64(0x9E3779B97F4A7C15)  # the golden ratio: multiples of it lie evenly
_KNOWN: Final = np.isin(np.arange(256), (Ending.OK, Ending.EXCEPTION, Ending.SILENT, Ending.GARBAGE))
_ALL: Final = (1 << 64) - 1


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class AskedRows(Columns):
    """Requests of which something is known. `time` in ns, or bytes before it where there are no times."""

    time: Int64s
    number: Int64s  # of the exchange
    unit: UInt8s
    function: UInt8s
    address: Int32s
    quantity: Int32s
    due: Int32s  # bytes of a right answer, 0 where nobody knows
    outcome: UInt8s
    exception: UInt8s
    heard: Int32s  # bytes behind it that belong to no right frame
    rest: Int64s  # ns of silence before it; NO_GAP
    wait: Int64s  # ns to the next request; -1 where there is none
    delay: Int64s  # ns to the answer; -1
    before: Int16s  # the unit asked before, -1 for none
    outcome_before: UInt8s  # and what became of that
    repeats: Bools  # the request before
    next_same: Bools  # the client asks once more
    late: Int32s  # right answers to requests before it, while its own was due or behind it


@dataclass(slots=True, eq=False)
class ExchangeTable:
    """The exchanges of a bus, or an even part of them."""

    _parts: list[AskedRows] = field(default_factory=list)
    _held: int = 0
    _count: int = 0  # exchanges seen
    _below: int = _ALL  # of the hashes of those that are remembered
    _before: tuple[int, int] = (-1, int(Ending.OK))

    def add(self, exchanges: Exchanges, times: Int64s) -> None:
        """The next exchanges; `times` tell their order."""
        unit, outcome, poll, t_next = exchanges.unit, exchanges.outcome, exchanges.poll, exchanges.t_next
        before = [
            np.concatenate(([first], each[:-1])) for first, each in zip(self._before, (unit, outcome), strict=True)
        ]
        self._before = int(unit[-1]), int(outcome[-1])
        numbers = np.arange(self._count, self._count + len(exchanges))
        self._count += len(exchanges)
        every = AskedRows(
            times, numbers, unit, exchanges.function, (poll >> 16 & 0xFFFF).astype(np.int32),
            (poll & 0xFFFF).astype(np.int32), exchanges.due, outcome, exchanges.exception, exchanges.noise,
            exchanges.gap_before, np.where(t_next == NEVER, -1, t_next - exchanges.t_asked), exchanges.delay,
            before[0].astype(np.int16), before[1].astype(np.uint8), exchanges.repeats, exchanges.next_same, exchanges.late,
        )  # fmt: skip
        kept = _KNOWN.take(outcome) & (_hash(numbers) <= np.uint64(self._below))
        self._parts.append(every[kept])
        self._held += len(self._parts[-1])
        while self._held > _MOST:
            self._below >>= 1
            rows = self.rows
            self._parts = [rows[_hash(rows.number) <= np.uint64(self._below)]]
            self._held = len(self._parts[0])

    @property
    def rows(self) -> AskedRows:
        """All that are remembered, in order."""
        self._parts = [AskedRows.joined(self._parts)]
        return self._parts[0]

    @property
    def weight(self) -> float:
        """How many exchanges each row stands for."""
        return 2.0**64 / (self._below + 1.0)


def _hash(numbers: Int64s) -> NDArray[np.uint64]:
    """Numbers spread evenly over all 64 bits."""
    mixed = numbers.astype(np.uint64) * _SPREAD  # arrays run over without a word
    mixed ^= mixed >> np.uint64(29)
    found: NDArray[np.uint64] = mixed * np.uint64(0xBF58476D1CE4E5B9)
    return found
