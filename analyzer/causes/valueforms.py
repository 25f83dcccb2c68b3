"""Other readings of a unit's registers: swapped, moved, scaled, and by how much each fits better than the words as they are.

A read is held against what is due: the read before, or what sister units hold. What a register is off by costs bits, by
how far it usually moves. A form is a way to read the registers of an answer otherwise; it saves what it costs less.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Int64s
from .registerstates import PollValues

_WORD: Final = 1 << 16
_MOST_BITS: Final = 10.0  # that one register tells
_PAIR_BITS: Final = 0.5  # that a pair of words pays, which might stand as they are, and a move of all,
_MOVE_BITS: Final = 4.0
_SCALE_BITS: Final = 1.0  # and each register that is scaled: some are, others not
_BEFORE: Final = 20  # reads that say how registers move,
_LAST: Final = 2  # and what is due, besides the newest
_ROWS: Final = 5  # reads for which a form must hold
_CANDIDATES: Final = 4  # moments
_USUAL: Final = 0.9  # of its moves are no longer than a register's usual one
_COARSE: Final = 1 << 13  # a word that moves so far tells nothing by its moves
_SURE_BITS: Final = 18.0
_LEFT: Final = 0.2  # of what the words are off by may be left,
_LEFT_AMONG: Final = 0.35  # and of what they are off by from sister units

Costs = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Due:
    """What registers should be about: from `low` to `high`, numbers with a sign that may run over, and how far they
    usually move (`slack`)."""

    low: Int64s
    high: Int64s
    slack: Int64s

    def costs(self, words: Int64s) -> Costs:
        """Bits for what these words are off by, each in its place."""
        width = (self.high - self.low) % _WORD
        above = (words - self.low) % _WORD
        off = np.where(above <= width, 0, np.minimum(above - width, _WORD - above))
        return _off_bits(off, self.slack)

    def part(self, places: slice) -> Due:
        """Of some registers."""
        return Due(self.low[places], self.high[places], self.slack[places])


def _off_bits(off: Int64s, slack: Int64s) -> Costs:
    found: Costs = np.minimum(np.log2(1 + np.maximum(off - slack, 0) / (slack + 1)), _MOST_BITS)
    return found


class FormReading(NamedTuple):
    """A way to read registers: what each is off by then, which of them it changes, and what saying so takes."""

    costs: Costs
    changed: NDArray[np.bool_]
    price: float = 0.0


def shorter_way(apart: Int64s, size: int = _WORD) -> Int64s:
    """Differences of numbers that run over at `size`, the shorter way round, with their sign."""
    return (apart + size // 2) % size - size // 2


def swapped_bytes(words: Int64s) -> Int64s:
    """The two bytes of each word exchanged."""
    return (words & 0xFF) << 8 | words >> 8


def _as_words(words: Int64s, due: Due) -> FormReading:
    return FormReading(due.costs(words), np.ones(len(words), np.bool_))


def _in_pairs(words: Int64s, due: Due) -> FormReading:
    """Some of the words exchanged with their neighbours, where that costs least."""
    alone = due.costs(words)
    first, second = due.part(slice(None, -1)).costs(words[1:]), due.part(slice(1, None)).costs(words[:-1])
    pair = first + second + _PAIR_BITS
    best, paired = [0.0, float(alone[0])], [False, False]
    for i in range(1, len(words)):
        one, two = best[i] + alone[i], best[i - 1] + pair[i - 1]
        best.append(float(min(one, two)))
        paired.append(bool(two < one))
    costs, changed, i = alone.copy(), np.zeros(len(words), np.bool_), len(words)
    while i:
        if paired[i]:
            costs[i - 2 : i], changed[i - 2 : i] = (first[i - 2], second[i - 2]), True
        i -= 2 if paired[i] else 1
    return FormReading(costs, changed, _PAIR_BITS * int(changed.sum()) / 2)


def _moved(words: Int64s, due: Due, by: int) -> FormReading:
    """Each word in the place beside its own; what comes from elsewhere tells nothing."""
    costs, changed = due.costs(np.roll(words, by)), np.ones(len(words), np.bool_)
    edge = 0 if by > 0 else -1
    costs[edge], changed[edge] = 0.0, False
    return FormReading(costs, changed, _MOVE_BITS + float(due.costs(words)[edge]))


def _scaled(words: Int64s, due: Due, by: float) -> FormReading:
    """Some of the numbers as many times as large."""
    numbers = shorter_way(words)
    alone = due.costs(words)
    rough = Due(due.low, due.high, due.slack + int(by / 2))
    times = np.clip(np.round(numbers * by), 1 - _WORD, _WORD - 1).astype(np.int64)
    scaled = rough.costs(times % _WORD)
    scaled[np.abs(times) >= _WORD // 2] = np.inf
    size = np.minimum(np.minimum(due.low % _WORD, -due.low % _WORD), np.minimum(due.high % _WORD, -due.high % _WORD))
    changed, told = scaled + _SCALE_BITS < alone, (numbers != 0) & (size > rough.slack)  # 0 may be any small number
    price = _SCALE_BITS * int(changed.sum()) + float((alone - scaled)[changed & ~told].sum())
    return FormReading(np.where(changed, scaled, alone), changed & told, price)


_Maker = Callable[[Int64s, Due], FormReading]
SWAPS: Final[Mapping[str, _Maker]] = {
    "bytes": lambda words, due: _as_words(swapped_bytes(words), due),
    "words": _in_pairs,
    "both": lambda words, due: _in_pairs(swapped_bytes(words), due),
}
MOVES: Final[Mapping[str, _Maker]] = {"before": partial(_moved, by=1), "behind": partial(_moved, by=-1)}
SCALES: Final[Mapping[str, _Maker]] = {
    f"{by:g}": partial(_scaled, by=1 / by) for by in (0.001, 0.01, 0.1, 10, 100, 1000)
}
FORMS: Final = {**SWAPS, **MOVES, **SCALES}


class FormFit(NamedTuple):
    """The form that fits best: bits that it saves, how many registers it changes and the first of them."""

    form: str
    bits: float
    registers: int
    address: int


class DueReads(NamedTuple):
    """Some reads of a poll that are looked at, and what each should be about."""

    address: int
    words: Int64s
    due: Due


def _best_fit(polls: Sequence[DueReads], forms: Iterable[str], most_left: float) -> FormFit | None:
    """The form in which the registers of some polls are what is due, where they are not as they are; None without one."""
    count = len(polls[0].words)
    alone = sum(float(rows.due.costs(words).sum()) for rows in polls for words in rows.words) / count
    if alone < _SURE_BITS:
        return None  # no form saves more than that
    best: tuple[float, float, str, list[list[FormReading]]] = 0.0, 0.0, "", []
    for name in forms:
        made = [[FORMS[name](words, rows.due) for words in rows.words] for rows in polls]
        left = sum(float(each.costs.sum()) for rows in made for each in rows) / count
        bits = alone - left - sum(each.price for rows in made for each in rows) / count
        best = max(best, (bits, left, name, made), key=lambda each: each[0])
    bits, left, name, made = best
    if bits < _SURE_BITS or left > most_left * alone:
        return None
    changed = [(rows.address, forms_[0].changed & (rows.due.costs(rows.words[0]) > 1))
               for rows, forms_ in zip(polls, made, strict=True)]  # fmt: skip
    first = next((address + int(each.argmax()) for address, each in changed if each.any()), polls[0].address)
    return FormFit(name, bits, sum(int(each.sum()) for _, each in changed), first)


def moves(words: Int64s) -> Int64s:
    """By how much each register differs from the read before, the shorter way round."""
    return shorter_way(np.diff(words, axis=0))


class FormChange(NamedTuple):
    """From which moment on the registers of a unit hold something in another form."""

    fit: FormFit
    time: int


def fit_since(polls: Sequence[PollValues]) -> FormChange | None:
    """The moment at which the registers of a unit leap, all at once, to what is the same in another form, and stay so."""
    series = [_PollMoves(poll) for poll in polls if len(poll.times) > _BEFORE + _ROWS]
    leaps = sorted((leap for each in series for leap in each.leaps()), reverse=True)[:_CANDIDATES]
    found = list[FormChange]()
    for _, after, at in leaps:
        rows = [one for each in series if (one := each.rows(after, at)) is not None]
        fit = _best_fit(rows, FORMS, _LEFT) if rows else None
        if fit is not None:
            found.append(FormChange(fit, at))
    return max(found, key=lambda change: change.fit.bits, default=None)


class _PollMoves:
    """The reads of one poll, and by how much each leaps, for all that registers moved before."""

    def __init__(self, poll: PollValues) -> None:
        self.address, self.times, self.words = poll.address, poll.times, poll.words.astype(np.int64)
        sizes = np.abs(moves(self.words))
        before = np.lib.stride_tricks.sliding_window_view(sizes[:-1], _BEFORE, axis=0)
        self.slack = before.max(axis=-1)  # of the moves before each
        self.bits = _off_bits(sizes[_BEFORE:], self.slack).sum(axis=1)

    def leaps(self) -> list[tuple[float, int, int]]:
        """The largest: bits, the times of the reads before it and behind."""
        largest = np.argsort(self.bits)[-_CANDIDATES:]
        return [(float(self.bits[i]), *self.times[i + _BEFORE : i + _BEFORE + 2].tolist()) for i in largest]

    def rows(self, after: int, at: int) -> DueReads | None:
        """The reads behind a leap that came between two times, and what was read before it."""
        first = max(int(np.searchsorted(self.times, after)) - _BEFORE - 1, 0)
        last = int(np.searchsorted(self.times, at)) - _BEFORE
        within = self.bits[first : max(last, first + 1)]
        i = first + int(np.argmax(within)) if len(within) else len(self.words)
        newest = self.words[i + _BEFORE] if i + _BEFORE + _ROWS < len(self.words) else None
        if newest is None:
            return None
        apart = shorter_way(self.words[i + _BEFORE - _LAST : i + _BEFORE + 1] - newest)
        due = Due(newest + apart.min(axis=0), newest + apart.max(axis=0), _ROWS // 2 * self.slack[i])
        return DueReads(self.address, self.words[i + _BEFORE + 1 : i + _BEFORE + 1 + _ROWS : 2], due)


def fit_among(polls: Sequence[PollValues], sisters: Sequence[Sequence[PollValues]]) -> FormFit | None:
    """The form in which a unit holds what its sisters hold, asked alike, if those hold the same as each other."""
    every = [[each.words.astype(np.int64) for each in sister] for sister in zip(*sisters, strict=True)]  # by poll
    rows = [
        DueReads(poll.address, poll.words[[0, len(poll.words) // 2, -1]].astype(np.int64), _due_among(words))
        for poll, words in zip(polls, every, strict=True)
    ]
    off = sum(each.due.costs(each.words[-1]).sum() for each in rows)
    for i in range(len(sisters)):
        others = ((words[i][-1], _due_among(words[:i] + words[i + 1 :])) for words in every)
        if sum(due.costs(words).sum() for words, due in others) > _LEFT_AMONG * off:
            return None
    return _best_fit(rows, (*SWAPS, *MOVES), _LEFT_AMONG)


def _due_among(units: Sequence[Int64s]) -> Due:
    """About as large as in these units, twice or half of it at the most."""
    newest = units[0][-1]
    apart = np.concatenate([shorter_way(words - newest) for words in units])
    low, high = newest + apart.min(axis=0), newest + apart.max(axis=0)
    size = np.minimum(newest, _WORD - newest)
    return Due(low, high, (high - low + size) // 2)


def leap_bits(words: NDArray[np.uint16], i: int) -> Costs:
    """By how much more than usual each register of a poll moves from read `i` to the next; 0 for those that always leap."""
    if not 0 <= i < len(words) - 1:
        return np.zeros(words.shape[1])
    sizes = np.abs(moves(words.astype(np.int64)))
    usual = np.quantile(sizes[sizes.any(axis=1)], _USUAL, axis=0).astype(np.int64) if sizes.any() else sizes[0]
    return np.where(usual < _COARSE, _off_bits(sizes[i], usual), 0.0)
