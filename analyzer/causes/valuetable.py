"""What registers held, read by read, thinned: enough to see counters that jump, values that stand still, other orders.

Of each poll of words the values of some reads, evenly over the capture, in flat memory.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .exchanges import Ending, Stretch
from .states import answered_values

_FUNCTIONS: Final = (3, 4)
_POLLS: Final = 128
_READS: Final = 256  # of a poll that are kept at most
_COLUMNS: Final = 64


@dataclass(slots=True)
class PollValues:
    """The words of one poll: `times` (n) on the ledger's axis, `words` (n, registers), `every` how many reads apart."""

    unit: int
    function: int
    address: int
    times: NDArray[np.int64]
    words: NDArray[np.uint16]
    every: int = 1
    reads: int = 0


class ValueTable:
    """Feeds on stretches."""

    def __init__(self) -> None:
        self.polls: dict[int, PollValues] = {}

    def add(self, stretch: Stretch, times: NDArray[np.int64]) -> None:
        """The next exchanges, with their times on the ledger's axis."""
        exchanges = stretch.exchanges
        good = (exchanges.outcome == Ending.OK) & np.isin(exchanges.function, _FUNCTIONS)
        places = good.nonzero()[0]
        numbers = exchanges.poll[places]
        order = np.argsort(numbers, kind="stable")
        ordered, places = numbers[order], places[order]
        begins = np.flatnonzero(np.diff(ordered, prepend=-1))
        bounds = zip(ordered[begins].tolist(), begins.tolist(), [*begins[1:].tolist(), len(places)], strict=True)
        for number, begin, end in bounds if len(places) else ():
            if number in self.polls or len(self.polls) < _POLLS:
                self._take(stretch, number, places[begin:end], times)

    def _take(self, stretch: Stretch, number: int, mine: NDArray[np.intp], times: NDArray[np.int64]) -> None:
        known = self.polls.get(number)
        if known is None:
            none = np.zeros((0, 0), np.uint16)
            unit, function, address = number >> 40 & 0xFF, number >> 32 & 0xFF, number >> 16 & 0xFFFF
            known = self.polls[number] = PollValues(unit, function, address, np.zeros(0, np.int64), none)
        first = -known.reads % known.every
        known.reads += len(mine)
        chosen = mine[first :: known.every]
        if not len(chosen):
            return
        words = answered_values(stretch, chosen)[:, :_COLUMNS].astype(np.uint16)
        if not len(known.times):
            known.words = words[:0]
        if words.shape[1] != known.words.shape[1]:
            return
        known.words = np.concatenate((known.words, words))
        known.times = np.concatenate((known.times, times[chosen]))
        while len(known.times) > _READS:
            known.words, known.times, known.every = known.words[::2], known.times[::2], known.every * 2
