"""Seeded buses in columns: what one client polls of its servers, frame after frame, as fast as arrays make it.

The client goes through its list of polls again and again, as control systems do, and writes between them. Half of the
frames are therefore requests that were said before. On a bus that `drifts` answers are not: measured values drift and
counters count from one poll to the next, set points stay, and some requests are refused or get no answer. A `plant` is
healthy: blocks of all sizes, values that stand for many polls, writes now and then, hardly anything refused.
Frame number k is the same whatever the number of frames asked for, so a small capture is the head of a large one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from captures import LineSettings
from dissectors.crc import CRC_TABLE

LINE = LineSettings(baud=115200, char_bits=11, parity="E", tap="irq")
CHAR_NS = 11e9 / 115200
SLICE = 20_000  # transactions made at once
EPOCH = 1_760_000_000_000_000_000

_READS = (3, 3, 3, 3, 4, 4, 4, 1, 2)
_WRITES = (6, 6, 6, 16, 16, 16, 5, 5, 15, 22, 23)
_BITS = (1, 2, 15)
_CRC = np.array(CRC_TABLE, np.uint16)

Ints = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Habits:
    """What a bus is like: servers, polls in the list, registers of a poll, shares of transactions, and how long values
    stand (turns of the list, at the most)."""

    units: int
    polls: int
    quantities: tuple[int, ...]
    written: float
    refused: float
    silent: float
    broadcast: float
    stands: int = 1

    @property
    def most(self) -> int:
        """Registers of the largest poll."""
        return max(self.quantities)


DRIFTS = Habits(24, 300, tuple(range(2, 31)), 0.12, 0.01, 0.005, 0.002)
PLANT = Habits(16, 64, (1, 2, 2, 4, 6, 8, 10, 10, 16, 20, 24, 32, 40, 60, 100, 125), 0.02, 2e-4, 1e-4, 0, stands=60)
BUSES = {"drifts": DRIFTS, "plant": PLANT}


@dataclass(frozen=True, slots=True)
class Slice:
    """Frames in wire order: their bytes end to end, sizes, times (ns, last stop bit), direction, and pairs.

    `pair` is the number of the request that a response answers, counted from the capture's first frame, else -1.
    """

    data: NDArray[np.uint8]
    sizes: Ints
    t_ns: Ints
    response: NDArray[np.bool_]
    pair: Ints


def slices(frames: int, seed: int = 1, habits: Habits = DRIFTS) -> Iterator[Slice]:
    """About `frames` frames: whole transactions, in slices of 20,000."""
    plan = _Plan(np.random.default_rng(seed), habits)
    now, said, transactions = float(EPOCH), 0, 0
    while said < frames:
        random = np.random.default_rng((seed, transactions))
        made = plan.transactions(random, transactions, SLICE, now, said)
        if said + len(made.sizes) > frames:
            made = _head(made, frames - said)
        yield made
        transactions += SLICE
        said += len(made.sizes)
        now = float(made.t_ns[-1])


class _Plan:
    """The list of polls, and what the servers hold."""

    def __init__(self, random: np.random.Generator, habits: Habits) -> None:
        self.habits, polls = habits, habits.polls
        self.unit = random.permutation(np.arange(polls) % habits.units) + 1
        self.function = random.choice(_READS, polls)
        self.start = random.integers(0, 2000, polls)
        self.quantity = random.choice(habits.quantities, polls)
        self.delay = random.uniform(1.8e6, 9e6, habits.units + 1)
        shape = (polls, habits.most)
        kind = random.random(shape)  # a fifth set points, most measured, some fast, some counters
        self.base = random.integers(0, 1 << 16, shape)
        self.swing = np.select([kind < 0.2, kind < 0.7, kind < 0.9], [0, 60, 3000], 0)
        self.noise = np.select([kind < 0.2, kind < 0.7, kind < 0.9], [1, 4, 60], 1)
        self.count = np.where(kind < 0.9, 0, random.integers(1, 20, shape))
        self.period = random.uniform(50, 900, shape)
        self.stands = random.integers(1, habits.stands, shape, endpoint=True)

    def transactions(self, random: np.random.Generator, first: int, n: int, now: float, said: int) -> Slice:
        """`n` transactions from number `first` on."""
        number = np.arange(first, first + n)
        habits, poll = self.habits, number % self.habits.polls
        writing = random.random(n) < habits.written
        function = np.where(writing, random.choice(_WRITES, n), self.function[poll])
        broadcast = writing & (function == 6) & (random.random(n) < habits.broadcast / habits.written * 4)
        unit = np.where(broadcast, 0, self.unit[poll])
        refused = ~broadcast & (random.random(n) < habits.refused)
        silent = broadcast | (random.random(n) < habits.silent)
        quantity = self.quantity[poll]
        words = self._values(random, poll, number // habits.polls)
        asked, answered = _Frames(n, habits.most), _Frames(n, habits.most)
        for frames in (asked, answered):
            frames.put(0, unit)
            frames.put(1, function)
        _fill(asked, answered, function, self.start[poll], quantity, words)
        answered.put(1, function | 0x80, refused)
        answered.put(2, random.integers(1, 5, n), refused)
        answered.size[refused] = 3
        return self._timed(random, (asked.closed(), answered.closed()), silent, unit, now, said)

    def _values(self, random: np.random.Generator, poll: Ints, turn: Ints) -> Ints:
        """A row of registers a transaction, as they stand at the turn of their poll."""
        turns = turn[:, None] // self.stands[poll]
        wave = np.sin(turns / self.period[poll]) * self.swing[poll]
        shape = (len(poll), self.habits.most)
        flicker = random.random(shape) * self.noise[poll] if self.habits.stands == 1 else np.zeros(shape)
        found: Ints = (self.base[poll] + (wave + flicker).astype(np.int64) + self.count[poll] * turns) & 0xFFFF
        return found

    def _timed(
        self, random: np.random.Generator, frames: tuple[_Frames, _Frames], silent: NDArray[np.bool_], unit: Ints,
        now: float, said: int,
    ) -> Slice:  # fmt: skip
        """Requests and answers in turn, with the pauses of a client and of its servers between."""
        n = len(silent)
        width = frames[0].body.shape[1]
        body = np.stack([frame.body for frame in frames], axis=1).reshape(2 * n, width)
        size = np.stack([frame.size for frame in frames], axis=1).reshape(2 * n)
        before = random.uniform(2.5e6, 5e6, n) + 20e6 * np.roll(silent, 1)  # what is not answered is waited for
        pause = np.stack([before, self.delay[unit] + random.exponential(4e5, n)], axis=1).reshape(2 * n)
        there = np.ones(2 * n, np.bool_)
        there[1::2] = ~silent
        body, size, pause = body[there], size[there], pause[there]
        end = now + np.cumsum(pause + size * CHAR_NS)
        late = random.uniform(2e4, 1.2e5, len(size))  # of the read after the last stop bit
        number = said + np.cumsum(there) - 1
        response = np.zeros(2 * n, np.bool_)
        response[1::2] = True
        pair = np.full(2 * n, -1)
        pair[1::2] = number[::2]
        data = body[np.arange(width) < size[:, None]]
        return Slice(data, size, np.maximum.accumulate(end + late).astype(np.int64), response[there], pair[there])


class _Frames:
    """Frames as rows of a table of bytes, built column by column."""

    def __init__(self, n: int, most: int) -> None:
        self.body = np.zeros((n, 2 * most + 13), np.uint8)
        self.size = np.zeros(n, np.int64)

    def put(self, at: int, value: Ints, where: NDArray[np.bool_] | slice = slice(None)) -> None:
        """A byte."""
        self.body[where, at] = value[where]

    def word(self, at: int, value: Ints, where: NDArray[np.bool_]) -> None:
        """A register, most significant byte first."""
        self.put(at, value >> 8, where)
        self.put(at + 1, value & 0xFF, where)

    def block(self, at: int, values: Ints, where: NDArray[np.bool_]) -> None:
        """As many registers as a row has."""
        octets = values[where].astype(">u2").view(np.uint8)
        self.body[where, at : at + octets.shape[1]] = octets

    def closed(self) -> _Frames:
        """With the CRC behind each; bytes beyond a frame's end are of no meaning."""
        crc = np.full(len(self.size), 0xFFFF, np.uint16)
        for at in range(int(self.size.max())):
            inside = at < self.size
            crc = np.where(inside, crc >> 8 ^ _CRC[(crc ^ self.body[:, at]) & 0xFF], crc)
        rows = np.arange(len(self.size))
        self.body[rows, self.size] = crc & 0xFF
        self.body[rows, self.size + 1] = crc >> 8
        self.size += 2
        return self


def _fill(asked: _Frames, answered: _Frames, function: Ints, start: Ints, quantity: Ints, words: Ints) -> None:
    """The bodies behind unit and function, of every function that is spoken here."""
    bits = np.isin(function, _BITS)
    octets = np.where(bits, (quantity + 7) // 8, 2 * quantity)
    last = np.where(quantity % 8 > 0, (1 << quantity % 8) - 1, 0xFF)  # padding bits are 0
    reads, writes, single = np.isin(function, (1, 2, 3, 4)), np.isin(function, (15, 16)), np.isin(function, (5, 6))
    mask, both = function == 22, function == 23
    everywhere = np.ones(len(function), np.bool_)
    for frames in (asked, answered):
        frames.word(2, start, everywhere)
        frames.word(4, quantity, reads | writes)
        frames.word(4, np.where(function == 5, (words[:, 0] & 1) * 0xFF00, words[:, 0]), single)
        frames.word(4, words[:, 0], mask)
        frames.word(6, words[:, 1], mask)
        frames.size[:] = np.where(mask, 8, 6)
    asked.put(6, octets, writes)
    asked.block(7, words, writes)
    asked.size[writes] = (7 + octets)[writes]
    asked.word(4, quantity, both)
    asked.word(6, start, both)
    asked.word(8, np.ones_like(start), both)
    asked.put(10, np.full_like(start, 2), both)
    asked.word(11, words[:, 0], both)
    asked.size[both] = 13
    given = reads | both
    answered.put(2, octets, given)
    answered.block(3, words, given)
    answered.size[given] = (3 + octets)[given]
    for frames, head, where in ((asked, 7, bits & writes), (answered, 3, bits & given)):
        frames.body[where, (head - 1 + octets)[where]] &= last[where].astype(np.uint8)


def _head(made: Slice, frames: int) -> Slice:
    """Its first frames."""
    size = int(made.sizes[:frames].sum())
    return Slice(made.data[:size], made.sizes[:frames], made.t_ns[:frames], made.response[:frames], made.pair[:frames])
