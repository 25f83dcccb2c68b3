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
from math import log2
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Bools, Int64s
from .bits import likelihood_bits
from .exchanges import Ending, Exchanges, Stretch

_WORDS: Final = (3, 4)
_BITS: Final = (1, 2)
_POLLS: Final = 512
_COLUMNS: Final = 256  # values of a poll
_FROM: Final = 1  # hits, before which nothing need be followed
_NOT_0: Final = "not 0"
_ONCE: Final = 0.5  # of the bits, where it is hit but once while it has the value: many values change about then
_SWITCHES: Final = 2  # changes of state, at the least


@dataclass(slots=True, eq=False)
class _States:
    """The values of one poll that may be states: column by column the two values, and hits and exchanges in each."""

    newest: Int64s
    hits_then: int  # on the bus so far, when the newest was read
    trials_then: int
    one: Int64s = field(init=False)
    two: Int64s = field(init=False)  # -1 until it is seen
    many: Bools = field(init=False)  # more than two: no state; of words, the second half tells 0 from the rest
    hits: Int64s = field(init=False)  # (2, columns)
    trials: Int64s = field(init=False)
    periods: Int64s = field(init=False)  # how many times a state lasted, and was hit, until it changed
    switches: Int64s = field(init=False)
    since: Int64s = field(init=False)  # hits in the state that lasts

    def __post_init__(self) -> None:
        count = len(self.newest)
        self.one, self.two, self.many = self.newest, np.full(count, -1), np.zeros(count, np.bool_)
        self.hits, self.trials, self.periods = np.zeros((3, 2, count), np.int64)
        self.switches, self.since = np.zeros((2, count), np.int64)

    def follow(self, values: Int64s, hits: Int64s, trials: Int64s) -> None:
        """The next reads, a row each; hits and exchanges on the bus so far."""
        gained, passed = np.diff(hits, prepend=self.hits_then), np.diff(trials, prepend=self.trials_then)
        changed = values != np.concatenate((self.newest[None], values[:-1]))
        self.newest, self.hits_then, self.trials_then = values[-1].copy(), int(hits[-1]), int(trials[-1])
        other = values != self.one
        first = values[other.argmax(axis=0), np.arange(values.shape[1])]
        self.two = np.where((self.two < 0) & other.any(axis=0), first, self.two)
        self.many |= (other & (values != self.two)).any(axis=0)
        self.switches += changed.sum(axis=0)
        for state, here in enumerate((~other & ~changed, other & ~changed)):
            self.hits[state] += gained @ here
            self.trials[state] += passed @ here
        before, moving = np.concatenate(([0], gained.cumsum())), changed.any(axis=0)
        self.since[~moving] += before[-1]
        for column in (moving & ~self.many).nonzero()[0].tolist():
            begins = changed[:, column].nonzero()[0]  # of states that last till the next one
            lasted = np.diff(before[begins], prepend=-self.since[column])
            lasted += gained[begins]  # nobody knows when between two reads it changed
            np.add.at(self.periods[:, column], (~other[begins, column]).astype(np.intp), lasted > 0)
            self.since[column] = before[-1] - before[begins[-1]]

    def telling(self, *, of_words: bool) -> list[int]:
        """Columns with two states that change; 0 or not only where a register takes more than two values."""
        told = (self.switches >= _SWITCHES) & ~self.many
        half = len(told) // 2 if of_words else len(told)
        told[half:] &= self.many[: len(told) - half]
        columns: list[int] = np.flatnonzero(told).tolist()
        return columns

    def bits(self, column: int) -> tuple[float, int]:
        """How much likelier the hits are with a rate for each state than with one, and in which they are more."""
        hits, trials = self.hits[:, column], np.maximum(self.hits, self.trials)[:, column]
        if not trials.min():
            return 0.0, 0
        counts = zip(hits.tolist(), trials.tolist(), strict=True)
        own = sum(likelihood_bits(h, n, (h + 0.25) / (n + 0.5)) for h, n in counts)
        every, of = int(hits.sum()), int(trials.sum())
        bits = own - likelihood_bits(every, of, (every + 0.25) / (of + 0.5))
        return float(bits), int(np.argmax((hits + 0.25) / (trials + 0.5)))


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

    def add(self, part: Stretch) -> None:
        """The next exchanges."""
        exchanges = part.exchanges
        if self._hits < _FROM and not exchanges.noise.any():
            self._trials += len(exchanges)
            return
        hit = (exchanges.noise > 0) | (exchanges.outcome == Ending.GARBAGE)
        hits = self._hits + np.cumsum(hit)
        trials = self._trials + np.arange(1, len(exchanges) + 1)
        self._hits, self._trials = int(hits[-1]), int(trials[-1])
        for number, mine in _reads_by_poll(exchanges, _WORDS + _BITS):
            if number not in self._polls and len(self._polls) >= _POLLS:
                continue
            values = answered_values(part, mine)
            if not values.shape[1]:
                continue
            if _of_words(number):
                values = np.concatenate((values, values != 0), axis=1)
            states = self._polls.get(number)
            if states is None or len(states.one) != values.shape[1]:
                states = self._polls[number] = _States(values[0].copy(), int(hits[mine[0]]), int(trials[mine[0]]))
            states.follow(values, hits[mine], trials[mine])

    def likeliest(self) -> DamageState | None:
        """The value whose states differ most in how often the bus was hit; None where none does."""
        found = [
            (number, states, column)
            for number, states in self._polls.items()
            for column in states.telling(of_words=_of_words(number))
        ]
        price = log2(max(len(found), 1)) + 1
        best = max((_damage_state(*each, price) for each in found), key=lambda state: state.bits, default=None)
        return best if best is not None and best.bits > 0 else None


def _damage_state(number: int, states: _States, column: int, price: float) -> DamageState:
    bits, bad = states.bits(column)
    hits, trials = states.hits[:, column].tolist(), np.maximum(states.hits, states.trials)[:, column].tolist()
    periods = states.periods[:, column].copy()
    periods[int(states.newest[column] != states.one[column])] += states.since[column] > 0
    words = len(states.one) // 2 if _of_words(number) else len(states.one)
    value = int((states.one, states.two)[bad][column])
    return DamageState(
        number >> 40 & 0xFF, number >> 32 & 0xFF, (number >> 16 & 0xFFFF) + column % words,
        _NOT_0 if column >= words and value else value, hits[bad], trials[bad], hits[1 - bad], trials[1 - bad],
        int(states.switches[column]), int(periods[bad]), (bits if periods[bad] > 1 else bits * _ONCE) - price,
    )  # fmt: skip


def _of_words(number: int) -> bool:
    return (number >> 32 & 0xFF) in _WORDS


def _reads_by_poll(exchanges: Exchanges, functions: tuple[int, ...]) -> Iterator[tuple[int, NDArray[np.intp]]]:
    """The exchanges by these functions that were answered well, poll by poll."""
    places = ((exchanges.outcome == Ending.OK) & np.isin(exchanges.function, functions)).nonzero()[0]
    places = places[np.argsort(exchanges.poll[places], kind="stable")]
    numbers = exchanges.poll[places]
    begins = np.flatnonzero(np.diff(numbers, prepend=-1))
    bounds = zip(begins.tolist(), [*begins[1:].tolist(), len(places)], strict=False)
    return ((number, places[begin:end]) for number, (begin, end) in zip(numbers[begins].tolist(), bounds, strict=True))


def answered_values(stretch: Stretch, places: NDArray[np.intp]) -> Int64s:
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


_TABLE_POLLS: Final = 128
_READS: Final = 256  # of a poll that are kept at most
_TABLE_COLUMNS: Final = 64


@dataclass(slots=True)
class PollValues:
    """The words of one poll: `times` (n) on the ledger's axis, `words` (n, registers), `every` how many reads apart."""

    unit: int
    function: int
    address: int
    times: Int64s = field(default_factory=lambda: np.zeros(0, np.int64))
    words: NDArray[np.uint16] = field(default_factory=lambda: np.zeros((0, 0), np.uint16))
    every: int = 1
    reads: int = 0


@dataclass(slots=True)
class ValueTable:
    """Feeds on stretches."""

    polls: dict[int, PollValues] = field(default_factory=dict)

    def add(self, part: Stretch, times: Int64s) -> None:
        """The next exchanges, with their times on the ledger's axis."""
        for number, mine in _reads_by_poll(part.exchanges, _WORDS):
            if number in self.polls or len(self.polls) < _TABLE_POLLS:
                self._take(part, number, mine, times)

    def _take(self, stretch: Stretch, number: int, mine: NDArray[np.intp], times: Int64s) -> None:
        if number not in self.polls:
            self.polls[number] = PollValues(number >> 40 & 0xFF, number >> 32 & 0xFF, number >> 16 & 0xFFFF)
        known = self.polls[number]
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
