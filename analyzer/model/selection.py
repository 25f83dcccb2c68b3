"""Which rows a list shows: all of them, or those that pass a test, worked out piece by piece as rows come.

One such test is the display filter, on the model's own columns; `analyzer.filters` is the language.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable
from typing import Any, Final, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.limits import CRC_SIZE
from dissectors.maps.files import UnitMaps

from ..filters import RowOctets, compile_filter
from ..tables.batch import Batch
from ..tables.schema import Kind
from ..tables.schema import Protocol as Envelope
from ..tables.transactions import Status
from .bus import Bus
from .table import PIECE, RowState

Test = Callable[[Bus, int, int, int], NDArray[np.bool_]]  # bus, piece, first and last place in it: which rows pass
_JOINED: Final = 1 << 15  # numbers: smaller parts are put together
_BELOW: Final = 64  # rows of a transaction, at most


class ListRows(Protocol):
    """A list's rows: positions 0 to `count`, each a row's number, ascending."""

    @property
    def count(self) -> int: ...

    def row(self, position: int) -> int:
        """The row at a position."""
        ...

    def position(self, row: int) -> int:
        """Where a row stands, or the last one before it; 0 where there is none."""
        ...

    def among(self, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Which of some rows, ascending, are of these."""
        ...


class Everything:
    """All rows."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus

    @property
    def count(self) -> int:
        return self._bus.count

    def row(self, position: int) -> int:
        return position

    def position(self, row: int) -> int:
        return max(0, min(row, self._bus.count - 1))

    def among(self, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        return np.ones(len(rows), np.bool_)


class Selection:
    """Rows that pass a test. `extend` belongs to one thread at a time; reading to any."""

    def __init__(self, bus: Bus, test: Test, *, lag: int = 0) -> None:
        """`lag`: rows that are left untested until as many have come behind them, or no more come."""
        self._bus = bus
        self._test = test
        self._lag = lag
        self._parts: list[NDArray[np.uint32]] = []
        self._begins: list[int] = []  # position of each part's first row
        self.count = 0
        self.done = 0  # rows tested

    def extend(self, stop: Callable[[], bool] = lambda: False) -> bool:
        """Test the rows that are there now; False where `stop` ended it early."""
        while not stop():
            if not self.extend_by_piece():
                return True
        return False

    @property
    def upto(self) -> int:
        """Rows that can be tested now."""
        return self._bus.count if self._bus.whole else max(self.done, self._bus.count - self._lag)

    def has_tested(self, row: int) -> bool:
        """Whether a row was tested, or all that can be were."""
        return self.done > row or self.done >= self.upto

    def extend_by_piece(self) -> bool:
        """Test those of them that stand in the next piece; whether there were any."""
        for number, low, high in self._bus.table.slices(self.done, self.upto):
            passed = np.flatnonzero(self._test(self._bus, number, low, high))
            self._add((passed + (number * PIECE + low)).astype(np.uint32))
            self.done = number * PIECE + high
            return True
        return False

    def row(self, position: int) -> int:
        part = bisect_right(self._begins, position) - 1
        return int(self._parts[part][position - self._begins[part]])

    def position(self, row: int) -> int:
        part = self._part(row)
        if part < 0:
            return 0
        return self._begins[part] + max(int(np.searchsorted(self._parts[part], row, side="right")) - 1, 0)

    def among(self, rows: NDArray[np.int64]) -> NDArray[np.bool_]:
        if not len(rows):
            return np.zeros(0, np.bool_)
        near = self._parts[max(0, self._part(int(rows[0]))) : self._part(int(rows[-1])) + 1]
        return np.isin(rows, np.concatenate([np.zeros(0, np.uint32), *near]))

    def _part(self, row: int) -> int:
        """The last part that begins at a row or before it; -1 for none."""
        return bisect_right(self._parts, row, key=lambda part: int(part[0])) - 1

    def rows(self) -> NDArray[np.int64]:
        """All of them."""
        return np.concatenate([np.zeros(0, np.uint32), *self._parts]).astype(np.int64)

    def _add(self, rows: NDArray[np.uint32]) -> None:
        if not len(rows):
            return
        if self._parts and len(self._parts[-1]) < _JOINED:
            self._parts[-1] = np.concatenate((self._parts[-1], rows))
        else:
            self._begins.append(self.count)
            self._parts.append(rows)
        self.count += len(rows)


def frames_only(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
    """Rows that are no noise."""
    frames: NDArray[np.bool_] = bus.table.column(number, "kind")[low:high] != Kind.NOISE
    return frames


def transactions(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
    """Rows that begin a transaction: requests, and answers to none that is known."""
    kinds = bus.table.column(number, "kind")[low:high]
    alone = bus.table.column(number, "partner")[low:high] < 0
    begins: NDArray[np.bool_] = (kinds == Kind.REQUEST) | ((kinds == Kind.RESPONSE) & alone)
    return begins


def transactions_with(test: Test) -> Test:
    """Rows that begin a transaction of which the request or its answer passes."""

    def either(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
        passed = test(bus, number, low, high)
        first, size = number * PIECE + low, high - low
        kinds, partner = (bus.table.column(number, name)[low:high] for name in ("kind", "partner"))
        requests = kinds == Kind.REQUEST
        out: NDArray[np.bool_] = passed & (requests | ((kinds == Kind.RESPONSE) & (partner < 0)))
        open_ones = np.flatnonzero(requests & ~out & (partner >= 0))  # those whose own answer tells
        answers = partner[open_ones].astype(np.int64) - first
        here = answers < size
        out[open_ones[here]] = passed[answers[here]]
        for request, answer in zip(open_ones[~here].tolist(), answers[~here].tolist(), strict=True):
            piece, at = divmod(first + answer, PIECE)
            out[request] = test(bus, piece, at, at + 1)[0]
        return out

    return either


def remembered(test: Test) -> Test:
    """The same test for several selections that one thread extends in turn: it is made once of each piece."""
    asked: tuple[int, int, int] | None = None
    answer = np.zeros(0, np.bool_)

    def last_or_new(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
        nonlocal asked, answer
        if asked != (number, low, high):
            answer = test(bus, number, low, high)
            asked = number, low, high
        return answer

    return last_or_new


def in_span(t_start: int, t_end: int) -> Test:
    """Rows that touch a span of time."""

    def test(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
        starts, ends = (bus.table.column(number, name)[low:high] for name in ("t_start_ns", "t_end_ns"))
        touches: NDArray[np.bool_] = (ends >= t_start) & (starts <= t_end)
        return touches

    return test


def both(tests: list[Test]) -> Test:
    """Rows that pass all of some tests; a later test may take long."""

    def test(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
        passed = np.ones(high - low, np.bool_)
        for each in tests:
            if not passed.any():
                break
            passed &= each(bus, number, low, high)
        return passed

    return test


class Unfolded:
    """Transactions as lines, the rows of some of them on lines of their own below.

    A line is a row of the list, or a row that stands below it; `rows` may grow at its end.
    """

    def __init__(self, bus: Bus, rows: ListRows) -> None:
        self.rows = rows
        self._bus = bus
        self._opened: list[tuple[int, tuple[int, ...]]] = []  # position and the rows below it, ascending

    @property
    def count(self) -> int:
        """Lines."""
        return self.rows.count + sum(len(below) for _, below in self._opened)

    def place(self, line: int) -> tuple[int, int]:
        """A line's row, and how far below the line of its transaction it stands: 0 for that line itself."""
        for position, below in self._opened:
            if line <= position:
                break
            if line <= position + len(below):
                return below[line - position - 1], line - position
            line -= len(below)
        return self.rows.row(line), 0

    def line(self, row: int) -> int:
        """The line of the transaction that a row begins, or of the last one before it."""
        at = self.rows.position(row)
        return at + sum(len(below) for position, below in self._opened if position < at)

    def turn(self, line: int, wanted: bool | None = None) -> int:
        """Open or close what a line belongs to, or turn it; the line of its transaction."""
        line -= self.place(line)[1]
        at = self.rows.position(self.place(line)[0])
        is_open = any(position == at for position, _ in self._opened)
        if wanted is None or wanted != is_open:
            self._opened = [each for each in self._opened if each[0] != at]
            if not is_open:
                self._opened = sorted([*self._opened, (at, self._below(self.rows.row(at)))])
        return line

    def below(self, row: int) -> tuple[int, ...]:
        """The rows that stand below the transaction which a row begins or follows, once it is opened."""
        begins = self.rows.row(self.rows.position(row))
        return self._below(begins) if begins <= row else ()

    def _below(self, row: int) -> tuple[int, ...]:
        """The request, what follows it up to the next one, and its answer where that is further on."""
        table, last = self._bus.table, row + 1
        while last < min(self._bus.count, row + _BELOW) and table.value("kind", last) != Kind.REQUEST:
            last += 1
        partner = table.value("partner", row)
        return (*range(row, last), *((partner,) if partner >= last else ()))


EXAMPLES = (
    "unit == 17 and function in (3, 4)",
    "exception or crc_ok == false",
    'finding == "late-response"',
    "register == 40108 and value > 1000",
    "response_time > 50ms",
    "gap > 3.5 chars",
    'hex contains "03 02"',
    "not noise",
)


class CompiledTest(NamedTuple):
    """A filter as a test of rows; `settled`: it asks for what is only known once later rows have come."""

    text: str
    test: Test
    settled: bool


def compiled(text: str, line: LineSettings, charts: UnitMaps | None = None) -> CompiledTest:
    """A filter for the rows of a line; `charts` are the maps of units, for `value("NAME")` and `name`. FilterError."""
    row_filter = compile_filter(text, line, charts)
    mask = row_filter.mask

    def test(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
        return mask(PieceTable(bus, number, low, high))

    return CompiledTest(text, test, row_filter.settled)


class PieceTable:
    """Rows `low` to `high` (excluded) of a piece of the model, as a filter asks about them."""

    def __init__(self, bus: Bus, number: int, low: int, high: int) -> None:
        self._bus = bus
        self._number, self._low, self._high = number, low, high
        self._first = number * PIECE + low

    @property
    def line(self) -> LineSettings:
        return self._bus.line

    @property
    def origin_ns(self) -> int:
        return self._bus.t_first

    def __len__(self) -> int:
        return self._high - self._low

    def column(self, name: str) -> NDArray[Any]:
        """A value a row."""
        if name == "index":
            return np.where(self._own("kind") != Kind.NOISE, self._own("frame").astype(np.int64), -1)
        if name == "retry":
            return (self._own("state") & RowState.RETRY).astype(np.bool_)
        if name == "unanswered":
            silent: NDArray[np.bool_] = self._own("state") & RowState.STATUS == Status.UNANSWERED + 1
            return silent
        if name == "late":
            return self._late()
        return self._own(name)

    def _own(self, name: str) -> NDArray[Any]:
        return self._bus.table.column(self._number, name)[self._low : self._high]

    def _late(self) -> NDArray[np.bool_]:
        """Answers to requests that were answered late; the request knows."""
        partner = self._own("partner").astype(np.int64)
        late = np.zeros(len(self), np.bool_)
        answers = np.flatnonzero((partner >= 0) & (self._own("kind") == Kind.RESPONSE))
        late[answers] = self._bus.table.take_column("state", partner[answers]) & RowState.LATE != 0
        return late

    def findings(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Rows with findings, ascending, and the rule of each."""
        rows, rules = self._bus.found.rules(self._first, self._first + len(self))
        return rows - self._first, rules

    def batch(self, first: int, last: int) -> Batch:
        """Some of the rows, as far as it takes to read their bytes."""
        return self._bus.contents(np.arange(self._first + first, self._first + last)) if last > first else Batch.empty()

    def octets(self, first: int, last: int) -> RowOctets | None:
        """Their bytes, where no row spells them as digits."""
        protocols = self._own("protocol")[first:last]
        if not len(protocols) or (protocols == Envelope.ASCII).any():
            return None
        at = self._own("at")[first:last].astype(np.int64)
        lengths = self._own("length")[first:last].astype(np.int64)
        data = self._bus.store.get(int(at[0]), int(at[-1] + lengths[-1] - at[0]))
        at -= at[0]
        ends = at + lengths
        ends[protocols == Envelope.RTU] -= CRC_SIZE
        return RowOctets(data, at + 1, ends, lambda rows: self._some(first, rows))

    def _some(self, first: int, rows: NDArray[np.intp]) -> tuple[Batch, NDArray[np.intp]]:
        """Some rows, and the requests in this piece that they answer, with their numbers; these count from `first`."""
        first += self._low
        slots = first + rows
        kinds, partners = (self._bus.table.stretch(self._number, name, slots) for name in ("kind", "partner"))
        requests = partners[kinds == Kind.RESPONSE].astype(np.int64) - self._number * PIECE
        chosen = np.zeros(self._high, np.bool_)
        chosen[slots] = chosen[requests[requests >= 0]] = True
        slots = np.flatnonzero(chosen)
        return self._bus.contents(slots + self._number * PIECE), slots - first
