"""Polls: what changed from one answer to the next, and what transactions carry.

The answer to the same poll before an answer: a poll is told by its request's bytes, of which a hash is kept for the
pieces that were looked at last. What transactions carry is told of many at once: register, quantity, values, and which
of these are others than last time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from dissectors.values import AREAS, logical

from ..tables.columns import Decoded, decode
from ..tables.schema import Kind
from .table import PIECE

if TYPE_CHECKING:
    from dissectors.fields import Field

    from .bus import Bus

_REACH: Final = 4  # pieces
_CACHED: Final = 6
_WORD: Final = 8  # bytes that are taken at once
_KEPT: Final = np.array([b"\xff" * n + bytes(_WORD - n) for n in range(_WORD + 1)]).view(np.uint64)  # of so many bytes
_FACTORS: Final = (np.uint64(0xFF51AFD7ED558CCD), np.uint64(0xC4CEB9FE1A85EC53))
_Hashes = NDArray[np.uint64]


def hashes(bus: Bus, rows: NDArray[np.int64]) -> _Hashes:
    """A number for each row, the same where their bytes are."""
    sums: _Hashes = np.zeros(len(rows), np.uint64)
    if not len(rows):
        return sums
    at = bus.table.take_column("at", rows).astype(np.int64)
    length = bus.table.take_column("length", rows).astype(np.int64)
    low = int(at.min())
    data = bus.store.get(low, int((at + length).max()) - low)
    words = sliding_window_view(np.concatenate((data, np.zeros(_WORD, np.uint8))), _WORD)
    at -= low
    sums += length.astype(np.uint64)
    longer = np.arange(len(rows))
    for done in range(0, int(length.max()), _WORD):
        longer = longer[length[longer] > done]
        octets = words[at[longer] + done].view(np.uint64)[:, 0]
        octets &= _KEPT[np.minimum(length[longer] - done, _WORD)]
        sums[longer] = _stirred(sums[longer] ^ octets)
    return sums


def _stirred(numbers: _Hashes) -> _Hashes:
    """Numbers of which every bit has told on all of them (the finalizer of MurmurHash3)."""
    for factor in _FACTORS:
        numbers ^= numbers >> np.uint64(33)
        numbers *= factor
    numbers ^= numbers >> np.uint64(33)
    return numbers


def _keyed(polls: _Hashes, lengths: NDArray[Any]) -> _Hashes:
    """Polls of which answers of these lengths are compared."""
    keys: _Hashes = polls ^ lengths.astype(np.uint64) * _FACTORS[0]
    return keys


class PollIndex:
    """Which answers are to the same poll."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self._cache: dict[int, tuple[_Hashes, int]] = {}  # by piece, with the rows that are known of it

    def _polls(self, number: int) -> _Hashes:
        """The poll, and the length, of each row of a piece that is a good answer; 0 for others."""
        table = self._bus.table
        size = min(PIECE, self._bus.count - number * PIECE)
        polls, low = self._cache.pop(number, (np.zeros(0, np.uint64), 0))
        if len(polls) < size:
            polls = np.concatenate((polls[:low], np.zeros(min(PIECE, 2 * size) - low, np.uint64)))
        if low < size:
            kind, check, partner = (table.column(number, name)[low:size] for name in ("kind", "check", "partner"))
            answers = np.flatnonzero((kind == Kind.RESPONSE) & check & (partner >= 0))
            lengths = table.column(number, "length")[low:size][answers]
            polls[low + answers] = _keyed(hashes(self._bus, partner[answers].astype(np.int64)), lengths)
        if len(self._cache) >= _CACHED:
            del self._cache[next(iter(self._cache))]
        self._cache[number] = polls, max(low, size)
        return polls[:size]

    def _poll(self, row: int) -> np.uint64:
        """The same of one answer, good or not; 0 where it answers nothing."""
        bus = self._bus
        partner = bus.partner(row) if row < bus.count else None
        if partner is None or bus.table.value("kind", row) != Kind.RESPONSE:
            return np.uint64(0)
        poll: np.uint64 = _keyed(hashes(bus, np.array([partner])), bus.table.take_column("length", np.array([row])))[0]
        return poll

    def before(self, row: int) -> int | None:
        """The row of the newest good answer before `row` to the same poll; None where none is near."""
        number, slot = divmod(row, PIECE)
        wanted = (self._polls(number)[slot] if row < self._bus.count else 0) or self._poll(row)
        if not wanted:
            return None
        for earlier in range(number, max(-1, number - _REACH), -1):
            polls = self._polls(earlier)
            matches = np.flatnonzero((polls[:slot] if earlier == number else polls) == wanted)
            if len(matches):
                return earlier * PIECE + int(matches[-1])
        return None


class ChangedAnswers:
    """A test of requests, row after row: the good answer is another one than the last to the same poll."""

    def __init__(self) -> None:
        self._newest: dict[int, int] = {}

    def __call__(self, bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
        """Of places `low` to `high` of a piece; the first answer to a poll counts as a change."""
        table = bus.table
        passed = np.zeros(high - low, np.bool_)
        kind, partner = (table.column(number, name)[low:high] for name in ("kind", "partner"))
        requests = np.flatnonzero((kind == Kind.REQUEST) & (partner >= 0))
        requests = requests[table.take_column("check", partner[requests].astype(np.int64))]
        answers: NDArray[Any] = partner[requests].astype(np.int64)
        polls, contents = hashes(bus, requests + number * PIECE + low), hashes(bus, answers)
        newest = self._newest
        for i, poll, content in zip(requests.tolist(), polls.tolist(), contents.tolist(), strict=True):
            passed[i] = newest.get(poll) != content
            newest[poll] = content
        return passed


def changed(before: tuple[Field, ...], now: tuple[Field, ...]) -> Iterator[tuple[Field, Field]]:
    """Fields of two frames of one shape that say something else, the innermost: as it was, as it is. No check value."""
    for old, new in zip(before, now, strict=False):
        if new.fields and len(old.fields) == len(new.fields):
            yield from changed(old.fields, new.fields)
        elif old.text != new.text and new.name != "crc":
            yield old, new


_AREAS: Final = tuple(AREAS)  # by AreaCode, from 1 on


@dataclass(frozen=True, slots=True)
class TransactionValues:
    """One transaction: `row` begins it, `answer` is -1 for none.

    `register` is the logical number of the first that it speaks of, empty for none, `area` (an AreaCode less 1, -1 for
    none) and `address` its place; `values` are those read, or else written; `changed` the places among them of which
    the last good answer to this poll said otherwise: `before`.
    """

    row: int
    answer: int
    register: str = ""
    quantity: int = -1
    values: tuple[int, ...] = ()
    changed: frozenset[int] = frozenset()
    before: tuple[int, ...] = ()
    unit: int = -1
    area: int = -1
    address: int = -1


class _CarriedRows:
    """Some rows, decoded."""

    def __init__(self, bus: Bus, rows: Sequence[int]) -> None:
        self._decoded: dict[int, tuple[Decoded, int]] = {}
        wanted = np.unique(np.array([row for row in rows if row >= 0], np.int64))
        for number in np.unique(wanted // PIECE).tolist():
            own = wanted[wanted // PIECE == number]
            decoded = decode(bus.batch(own))
            self._decoded.update((int(row), (decoded, i)) for i, row in enumerate(own.tolist()))

    def address(self, row: int) -> tuple[int, int, int]:
        """Area, address and quantity; -1 for none."""
        decoded, i = self._decoded[row]
        return int(decoded.area[i]), int(decoded.address[i]), int(decoded.quantity[i])

    def values(self, row: int) -> tuple[int, ...]:
        """None where the row is not here."""
        if row not in self._decoded:
            return ()
        decoded, i = self._decoded[row]
        return tuple(decoded.values_of(i).tolist())


def poll_values(bus: Bus, rows: Sequence[int]) -> list[TransactionValues]:
    """What the transactions that these rows begin carry."""
    partners = bus.table.take_column("partner", np.array(rows, np.int64))
    partners = np.where(partners < bus.count, partners, -1).tolist()  # live: the answer's row may not be whole yet
    before = [-1 if answer < 0 else _before(bus, answer) for answer in partners]
    carried = _CarriedRows(bus, [*rows, *partners, *before])
    polls = []
    for row, answer, last in zip(rows, partners, before, strict=True):
        area, address, quantity = carried.address(row)
        values, old = carried.values(answer) or carried.values(row), carried.values(last)
        changed = {i for i, value in enumerate(values) if len(old) == len(values) and old[i] != value}
        known = area > 0 and address >= 0
        register = logical(address, _AREAS[area - 1]) if known else ""
        place = (int(bus.table.value("unit", row)), area - 1, address) if known else (-1, -1, -1)
        polls.append(TransactionValues(row, answer, register, quantity, values, frozenset(changed), old, *place))
    return polls


_WRITES: Final = (5, 6, 15, 16)  # functions whose requests carry values


def carried_by_each(bus: Bus, rows: Sequence[int]) -> dict[int, TransactionValues | None]:
    """What each row's transaction carries, where it is this row that carries it and its check value is right."""
    begins = {row: begin for row in rows if (begin := _begin(bus, row)) is not None}
    polls = {poll.row: poll for poll in poll_values(bus, list(dict.fromkeys(begins.values())))} if begins else {}
    carried: dict[int, TransactionValues | None] = dict.fromkeys(rows)
    for row, begin in begins.items():
        poll = polls[begin]
        own = poll.answer == row if begin != row else bus.table.value("function", row) in _WRITES
        carried[row] = poll if poll.values and own else None
    return carried


def carried_by(bus: Bus, row: int) -> TransactionValues | None:
    """The same of one row."""
    return carried_by_each(bus, [row])[row]


def _begin(bus: Bus, row: int) -> int | None:
    """The row that begins the transaction of a row that may carry values: itself, or what it answers."""
    table = bus.table
    if bus.is_noise(row) or not table.value("check", row) or table.value("exception", row):
        return None
    return bus.partner(row) if table.value("kind", row) == Kind.RESPONSE else row


def _before(bus: Bus, answer: int) -> int:
    last = bus.polls.before(answer)
    return -1 if last is None else last
