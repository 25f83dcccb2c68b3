"""What registers held, read by read, and whether damage goes with a state of one.

Between two reads of a value that are alike the value is taken to have stood still; what was hit meanwhile is counted
for its state. A register that takes more than two values has two states all the same: 0, and anything else, as a speed
has; further states of a measured value mean nothing here.

Of each poll of words the values of some reads are kept, evenly over the capture, in flat memory: enough to see counters
that jump, values that stand still, other orders of words.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from .bits import likelihood_bits
from .exchanges import Ending, Stretch

_WORDS: Final = (3, 4)
_BITS: Final = (1, 2)
_POLLS: Final = 512
_COLUMNS: Final = 256  # values of a poll
_FROM: Final = 1  # hits, before which nothing need be followed
_NOT_0: Final = "not 0"
_ONCE: Final = 0.5  # of the bits, where it is hit but once while it has the value: many values change about then
_SWITCHES: Final = 2  # changes of state, at the least


@dataclass(slots=True)
class _States:
    """The values of one poll that may be states: column by column the two values, and hits and exchanges in each."""

    one: NDArray[np.int64]
    two: NDArray[np.int64]  # -1 until it is seen
    many: NDArray[np.bool_]  # more than two: no state; of words, the second half tells 0 from the rest
    hits: NDArray[np.int64]  # (2, columns)
    trials: NDArray[np.int64]
    switches: NDArray[np.int64]
    since: NDArray[np.int64]  # hits in the state that lasts
    periods: NDArray[np.int64]  # (2, columns): how many times a state lasted, and was hit, until it changed
    newest: NDArray[np.int64]
    hits_then: int  # on the bus so far, when the newest was read
    trials_then: int


@dataclass(frozen=True, slots=True)
class DamageState:
    """A value that goes with damage: where it is, its value then, and hits and exchanges with it and without."""

    unit: int
    function: int
    address: int
    value: int | str
    hits: int
    trials: int
    other_hits: int
    other_trials: int
    switches: int
    periods: int  # how many times it had the value, and the bus was hit
    bits: float

    @property
    def contrast(self) -> float:
        """How many times as often the bus is hit with it as without."""
        return (self.hits + 0.25) / (self.trials + 0.5) * (self.other_trials + 0.5) / (self.other_hits + 0.25)


@dataclass(slots=True)
class StateTable:
    """Feeds on stretches; `likeliest` gives the value that goes with damage best."""

    _polls: dict[int, _States] = field(default_factory=dict)
    _hits: int = 0
    _trials: int = 0

    def add(self, stretch: Stretch) -> None:
        """The next exchanges."""
        exchanges = stretch.exchanges
        if self._hits < _FROM and not exchanges.noise.any():
            self._trials += len(exchanges)
            return
        hit = (exchanges.noise > 0) | (exchanges.outcome == Ending.GARBAGE)
        hits = self._hits + np.cumsum(hit)
        trials = self._trials + np.arange(1, len(exchanges) + 1)
        good = (exchanges.outcome == Ending.OK) & np.isin(exchanges.function, _WORDS + _BITS)
        places = good.nonzero()[0]
        numbers = exchanges.poll[places]
        for number in np.unique(numbers).tolist():
            if number not in self._polls and len(self._polls) >= _POLLS:
                continue
            mine = places[numbers == number]
            values = answered_values(stretch, mine)
            if _of_words(number):
                values = np.concatenate((values, values != 0), axis=1)
            self._follow(number, values, hits[mine], trials[mine])
        self._hits, self._trials = int(hits[-1]), int(trials[-1])

    def _follow(
        self, number: int, values: NDArray[np.int64], hits: NDArray[np.int64], trials: NDArray[np.int64]
    ) -> None:
        if not values.shape[1]:
            return
        states = self._polls.get(number)
        if states is None or len(states.one) != values.shape[1]:
            count = values.shape[1]
            none = np.zeros((2, count), np.int64)
            states = self._polls[number] = _States(
                values[0].copy(), np.full(count, -1), np.zeros(count, np.bool_), none, none.copy(),
                np.zeros(count, np.int64), np.zeros(count, np.int64), none.copy(), values[0].copy(), int(hits[0]), int(trials[0])
            )  # fmt: skip
        before = np.concatenate((states.newest[None], values[:-1]))
        gained = np.diff(np.concatenate(([states.hits_then], hits)))
        passed = np.diff(np.concatenate(([states.trials_then], trials)))
        states.newest, states.hits_then, states.trials_then = values[-1].copy(), int(hits[-1]), int(trials[-1])
        changed = values != before
        moving = changed.any(axis=0)
        steady = ~moving
        if steady.any():
            in_two = (values[0] == states.two) & steady
            states.hits[0][steady & ~in_two] += int(gained.sum())
            states.trials[0][steady & ~in_two] += int(passed.sum())
            states.hits[1][in_two] += int(gained.sum())
            states.trials[1][in_two] += int(passed.sum())
            states.since[steady] += int(gained.sum())
        for column in np.flatnonzero(moving & ~states.many).tolist():
            self._count(states, column, values[:, column], changed[:, column], gained, passed)

    @staticmethod
    def _count(
        states: _States,
        column: int,
        values: NDArray[np.int64],
        changed: NDArray[np.bool_],
        gained: NDArray[np.int64],
        passed: NDArray[np.int64],
    ) -> None:
        others = values[values != states.one[column]]
        if states.two[column] < 0 and len(others):
            states.two[column] = others[0]
        if (others != states.two[column]).any():
            states.many[column] = True
            return
        states.switches[column] += int(np.count_nonzero(changed))
        in_two = (values != states.one[column]).astype(np.int64)
        for state in (0, 1):
            here = (in_two == state) & ~changed
            states.hits[state, column] += int(gained[here].sum())
            states.trials[state, column] += int(passed[here].sum())
        begins = np.flatnonzero(changed)  # of states that last till the next one
        lasted = np.add.reduceat(gained, np.concatenate(([0], begins)))
        lasted[0] = states.since[column] + gained[: begins[0]].sum()
        lasted[:-1] += gained[begins]  # nobody knows when between two reads it changed
        np.add.at(states.periods[:, column], 1 - in_two[begins], lasted[:-1] > 0)
        states.since[column] = lasted[-1]

    def likeliest(self) -> DamageState | None:
        """The value whose states differ most in how often the bus was hit; None where none does."""
        found = max(self._all(), key=lambda state: state.bits, default=None)
        return found if found is not None and found.bits > 0 else None

    def _all(self) -> Iterator[DamageState]:
        found = [(number, states, _telling(number, states)) for number, states in self._polls.items()]
        price = np.log2(max(sum(len(columns) for _, _, columns in found), 1)) + 1
        for number, states, columns in found:
            words = len(states.one) // 2 if _of_words(number) else len(states.one)
            for column in columns:
                hits, trials = states.hits[:, column].tolist(), states.trials[:, column].tolist()
                trials = [max(pair) for pair in zip(hits, trials, strict=True)]
                if not min(trials):
                    continue
                rates = [(h + 0.25) / (n + 0.5) for h, n in zip(hits, trials, strict=True)]
                own = sum(likelihood_bits(h, n, r) for h, n, r in zip(hits, trials, rates, strict=True))
                bits = own - likelihood_bits(sum(hits), sum(trials), (sum(hits) + 0.25) / (sum(trials) + 0.5))
                bad = int(rates[1] > rates[0])
                mine = states.periods[:, column].copy()
                lasts = int(states.newest[column] != states.one[column])
                mine[lasts] += states.since[column] > 0
                value = int((states.one, states.two)[bad][column])
                yield DamageState(
                    number >> 40 & 0xFF,
                    number >> 32 & 0xFF,
                    (number >> 16 & 0xFFFF) + column % words,
                    _NOT_0 if column >= words and value else value,
                    hits[bad],
                    trials[bad],
                    hits[1 - bad],
                    trials[1 - bad],
                    int(states.switches[column]),
                    int(mine[bad]),
                    float((bits if mine[bad] > 1 else bits * _ONCE) - price),
                )


def _of_words(number: int) -> bool:
    return (number >> 32 & 0xFF) in _WORDS


def _telling(number: int, states: _States) -> list[int]:
    """Columns with two states that change; 0 or not only where a register takes more than two values."""
    told = (states.switches >= _SWITCHES) & ~states.many
    if _of_words(number):
        half = len(told) // 2
        told[half:] &= states.many[:half]
    columns: list[int] = np.flatnonzero(told).tolist()
    return columns


def answered_values(stretch: Stretch, places: NDArray[np.intp]) -> NDArray[np.int64]:
    """The values of answers to one poll, a row each."""
    exchanges, table = stretch.exchanges, stretch.table
    answers = exchanges.answer[places]
    lengths, at = exchanges.answer_bytes[places], table.rows.at[answers]
    length = int(np.bincount(lengths).argmax())
    count = length - 5
    if table.rows.protocol[answers].any() or count < 1:
        return np.zeros((len(places), 0), np.int64)
    begins = np.where(lengths == length, at, at[np.argmax(lengths == length)])
    octets: NDArray[Any] = table.data[begins[:, None] + 3 + np.arange(count)]
    if int(exchanges.function[places[0]]) in _BITS:
        return np.unpackbits(octets, axis=1, bitorder="little")[:, :_COLUMNS].astype(np.int64)
    words = octets[:, : count // 2 * 2].astype(np.int64)
    return words[:, ::2] << 8 | words[:, 1::2]


_FUNCTIONS: Final = (3, 4)
_TABLE_POLLS: Final = 128
_READS: Final = 256  # of a poll that are kept at most
_TABLE_COLUMNS: Final = 64


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

    polls: dict[int, PollValues]

    def __init__(self) -> None:
        self.polls = {}

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
            if number in self.polls or len(self.polls) < _TABLE_POLLS:
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
        words = answered_values(stretch, chosen)[:, :_TABLE_COLUMNS].astype(np.uint16)
        if not len(known.times):
            known.words = words[:0]
        if words.shape[1] != known.words.shape[1]:
            return
        known.words = np.concatenate((known.words, words))
        known.times = np.concatenate((known.times, times[chosen]))
        while len(known.times) > _READS:
            known.words, known.times, known.every = known.words[::2], known.times[::2], known.every * 2
