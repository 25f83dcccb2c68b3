"""Requests with all that followed them until the next one: columns, one row a request.

A serial answer carries no address, and a damaged one nothing to go by; but the line is half-duplex, so what stands
between a request and the next one belongs to it, whatever it is. So damaged answers have a unit, and silence and
garbage are two things. Rows of the deframer go in, batch after batch; an exchange is given once the next request has
come. Nothing is kept but the rows since the newest request, and of those not more than a window.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from functools import lru_cache
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role, relations, rule
from dissectors.limits import OVERHEAD, RequestedByteCount, taken
from dissectors.registry import revision

from ..requests.got import Got
from ..tables.batch import Batch, adu_of
from ..tables.schema import NO_GAP, Bools, Columns, Int16s, Int32s, Int64s, Kind, Rows, UInt8s
from ..tables.transactions import ECHOED, NEVER

_WINDOW_ROWS: Final = 512  # behind a request: what follows after that many rows is nobody's
_WINDOW_BYTES: Final = 1 << 16
ANSWERED: Final = np.isin(np.arange(256), (1, 2, 3, 4, 5, 6, 15, 16, 22, 23))  # of which an answer is known for one
_OF_WORDS: Final = np.isin(np.arange(256), (3, 4))
_AHEAD: Final = 2  # exchanges that are held back
_STRAY_BYTES: Final = 1  # so few end to end are no answer, however damaged
_APART_NS: Final = 32_000_000  # from one byte to the next: two waits of an adapter, three characters at 1200 bit/s
_SAME: Final = (1 << 40) - 1  # of a poll's number: all but the unit
_NOTHING: Final = -1
_REQUEST: Final = int(Kind.REQUEST)


class Ending(IntEnum):
    """What became of a request."""

    OK = 0
    EXCEPTION = 1
    SILENT = 2  # not a byte, or stray ones, each by itself
    GARBAGE = 3  # bytes, and no answer among them
    BROADCAST = 4
    UNHEARD = 5  # the recorder heard nothing when an answer was due
    NO_REQUEST = 6  # reads like a request, and is a unit's answer to the broadcast before it
    ECHO = 7  # the next request once more, as an adapter shows what it sends


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Exchanges(Columns):
    """Requests with all that followed them, in order."""

    t_start: Int64s  # ns, of the request
    t_asked: Int64s  # its end
    t_next: Int64s  # start of the next request; NEVER at the end
    t_answered: Int64s  # end of the answer; NEVER for none
    delay: Int64s  # ns, end of the request to start of the answer; -1 where there is none or nobody knows
    place: Int64s  # bytes on the bus before it
    request: Int64s  # index of the frame
    poll: Int64s  # unit, function, address and quantity in one number
    identity: Int64s  # equal for requests of equal bytes
    row: Int64s  # of the request, in its stretch
    row_end: Int64s  # behind the last row of the exchange
    answer: Int64s  # row of the answer, -1 for none
    gap_before: Int64s  # ns of silence before the request; NO_GAP
    answer_gap: Int64s  # the same before an answer right behind its request
    hole: Int64s  # ns, longest silence inside the answer; 0 for none
    hole_at: Int32s  # byte of the answer before which it stands
    answer_bytes: Int32s
    asked_bytes: Int32s
    got: Int16s  # as `analyzer.requests` counts it
    due: Int32s  # bytes of a right answer, 0 where nobody knows
    noise: Int32s  # bytes behind the request that belong to no right frame
    strays: Int32s  # right answers among them that answer nothing
    late: Int32s  # right answers to earlier requests
    marks: Int32s  # bytes of the answer that the UART marked
    unit: UInt8s
    function: UInt8s
    exception: UInt8s
    outcome: UInt8s
    next_unit: Int16s  # of the next request, -1 at the end
    repeats: Bools  # the bytes of the request before
    next_same: Bools  # the next request repeats this one
    next_echoed: Bools  # the next request is of a function whose answer reads like it: it may be a late one
    called: Bools  # of a broadcast: somebody answers it


@dataclass(frozen=True, slots=True)
class Stretch:
    """Exchanges in order, and the rows that they are made of."""

    exchanges: Exchanges
    table: Batch

    def rows_of(self, i: int) -> range:
        """Rows behind the request of one exchange."""
        return range(int(self.exchanges.row[i]) + 1, int(self.exchanges.row_end[i]))


@dataclass(slots=True, eq=False)
class ExchangeBuilder:
    """Rows in; out stretches of exchanges, and rows that follow no request: before the first one, or so long after one
    that they are not its.

    An exchange is given when the one behind it is over as well: what a broadcast called forth may read like a request.
    """

    _open: Batch = field(default_factory=Batch.empty)  # from the oldest request on that is not given
    _unheard: set[int] = field(default_factory=set)
    _before: Exchanges = field(default_factory=lambda: Exchanges.zeros(0))  # the newest exchange that was given
    _bytes: int = 0  # on the bus before the open rows

    def feed(self, batch: Batch, unheard: Collection[int] = ()) -> Iterator[Stretch | Rows]:
        """What is settled once these rows are known. `unheard`: requests (by index) whose answer nobody could hear."""
        self._unheard.update(unheard)
        rows = _followed(self._open, batch)
        asks = asking(rows.rows).nonzero()[0].tolist()
        first = asks[0] if asks else len(rows)
        if first:
            yield self._unowned(rows.rows[:first])
        self._open = Batch.empty()
        if not asks:
            return
        begin = asks[max(len(asks) - _AHEAD, 0)]
        if begin > first:
            yield self._stretch(_part(rows, first), len(asks) - _AHEAD)
        opened, last = _compact(_part(rows, begin)), asks[-1] + 1 - begin
        if len(opened) - last <= _WINDOW_ROWS and len(opened.data) <= _WINDOW_BYTES:
            self._open = opened
            return
        yield self._stretch(_part(opened, 0, last), min(len(asks), _AHEAD))
        yield self._unowned(opened.rows[last:])

    def close(self) -> Iterator[Stretch]:
        """No more rows come."""
        opened, self._open = self._open, Batch.empty()
        if len(opened):
            stretch = self._stretch(opened, int(np.count_nonzero(asking(opened.rows))))
            last = stretch.exchanges.outcome[-1:]
            last[last == Ending.GARBAGE] = Ending.UNHEARD  # what the end of the capture cuts off is not damaged
            yield stretch

    def _unowned(self, rows: Rows) -> Rows:
        self._bytes += int(rows.length.sum())
        return rows

    def _stretch(self, rows: Batch, count: int) -> Stretch:
        """The first exchanges of these rows, which begin with a request."""
        made = _exchanges(rows, self._before)
        made.place[:] += self._bytes
        if self._unheard:
            outcome = made.outcome
            outcome[np.isin(made.request, list(self._unheard)) & (outcome == Ending.SILENT)] = Ending.UNHEARD
            last = int(made.request[count - 1])
            self._unheard = {index for index in self._unheard if index > last}
        given = made[:count]
        self._bytes += int(rows.rows.length[: int(given.row_end[-1])].sum())
        self._before = given[count - 1 :].copy()
        return Stretch(given, rows)


def _part(batch: Batch, first: int, last: int | None = None) -> Batch:
    """Some rows; the bytes stay where they are."""
    return Batch(batch.rows[first:last], batch.data)


def _compact(batch: Batch) -> Batch:
    """The same rows with their own bytes only; at least one."""
    rows = batch.rows.copy()
    begin, end = int(rows.at.min()), int((rows.at + rows.length).max())
    rows.at[:] -= begin
    return Batch(rows, batch.data[begin:end].copy())


def _followed(opened: Batch, batch: Batch) -> Batch:
    """Rows and those behind them."""
    if not len(opened):
        return batch
    moved = _compact(batch)
    moved.rows.at[:] += len(opened.data)
    return Batch(Rows.joined((opened.rows, moved.rows)), np.concatenate((opened.data, moved.data)))


def _exchanges(table: Batch, before: Exchanges) -> Exchanges:
    """The exchanges of rows that begin with a request; `before`: the exchange before them, if there is one."""
    rows = table.rows
    asks = asking(rows)
    which = asks.nonzero()[0]
    made = Exchanges.zeros(len(which))
    of = asks.cumsum() - 1  # the exchange of each row
    for mine, column in (
        (made.t_start, rows.t_start_ns), (made.t_asked, rows.t_end_ns), (made.request, rows.index),
        (made.unit, rows.unit), (made.function, rows.function), (made.gap_before, rows.gap_before_ns),
        (made.asked_bytes, rows.length),
    ):  # fmt: skip
        mine[:] = column.take(which)
    lengths = rows.length
    made.place[:] = (lengths.cumsum() - lengths).take(which)
    made.t_next[:-1], made.t_next[-1] = made.t_start[1:], NEVER
    made.row[:] = which
    made.row_end[:-1], made.row_end[-1] = which[1:], len(rows)
    made.answer[:] = made.delay[:] = -1
    made.t_answered[:], made.answer_gap[:] = NEVER, NO_GAP
    _asked(made, table, which)
    _answered(made, rows, of)
    _compare(made, before)
    return made


def _compare(made: Exchanges, before: Exchanges) -> None:
    """Fill in what an exchange is beside the one before it."""
    outcome, poll = made.outcome, made.poll & _SAME
    made.repeats[:] = (made.identity == _earlier(made.identity, before.identity)) & (
        poll == _earlier(poll, before.poll & _SAME)
    )
    made.next_same[:-1] = made.repeats[1:]
    made.next_echoed[:-1] = ECHOED[made.function[1:]]
    made.next_unit[:-1], made.next_unit[-1] = made.unit[1:], -1
    echoed = (outcome == Ending.SILENT) & (_earlier(outcome, before.outcome) == Ending.BROADCAST)
    echoed &= poll == _earlier(poll, before.poll & _SAME)
    outcome[echoed] = Ending.NO_REQUEST
    made.called[:-1] |= echoed[1:]


def _earlier(column: NDArray[Any], before: NDArray[Any]) -> NDArray[Any]:
    """What stands before each, in front of which `before` stands, if anything does; there it is no request's."""
    return np.concatenate((before if len(before) else np.array((_NOTHING,)), column[:-1]))


def asking(rows: Rows) -> Bools:
    """Which rows are right requests."""
    asks: Bools = (rows.kind == _REQUEST) & rows.check
    return asks


def _answered(made: Exchanges, rows: Rows, of: NDArray[np.intp]) -> None:
    """Fill in what followed each request; `of`: the exchange of each row."""
    kind, check, lengths = rows.kind, rows.check, rows.length
    answers = ((kind == Kind.RESPONSE) & check).nonzero()[0]
    answers = answers[answers != made.row[of[answers]]]
    mine = rows.request.take(answers) == made.request.take(of[answers])
    unsure = rows.unsure.take(answers)
    if unsure.any():  # nobody can tell whose they are: the client goes on with them
        mine |= unsure & (rows.taken_for_start.take(answers) == rows.start.take(made.row[of[answers]]))
    own = answers[mine][::-1]  # backwards, so that the first of several stays
    place = of[own]
    doubted = place[rows.unsure.take(own)]
    made.answer[place] = own
    for its, column in (
        (made.delay, rows.response_ns), (made.t_answered, rows.t_end_ns), (made.exception, rows.exception),
        (made.marks, rows.errors), (made.answer_bytes, rows.length), (made.hole_at, rows.gap_at),
    ):  # fmt: skip
        its[place] = column.take(own)
    made.hole[place] = np.maximum(rows.gap_most_ns.take(own), 0)
    gaps = rows.gap_before_ns.take(own)
    gaps[own != made.row.take(place) + 1] = NO_GAP
    made.answer_gap[place] = gaps
    others = answers[~mine]
    others = others[ANSWERED[rows.function[others]]]
    np.add.at(made.strays, of[others[rows.request[others] < 0]], 1)
    np.add.at(made.late, of[others[rows.request[others] >= 0]], 1)
    bad = ((kind == Kind.NOISE) | ~check).nonzero()[0]
    np.add.at(made.noise, of[bad], lengths[bad])
    outcome = np.where(made.answer >= 0, np.uint8(Ending.OK), np.uint8(Ending.SILENT))
    outcome[made.exception > 0] = Ending.EXCEPTION
    lasted = rows.t_end_ns[bad] - rows.t_start_ns[bad]
    garbled = np.zeros(len(made), np.bool_)
    garbled[of[bad[(lengths[bad] > _STRAY_BYTES) & (lasted <= _APART_NS * (lengths[bad] - 1))]]] = True
    place = of[others]  # of the unit and function that was asked, and yet it answers nothing: a wrong count
    unfit = (rows.request[others] < 0) & (rows.unit[others] == made.unit[place]) & (made.answer[place] < 0)
    garbled[place[unfit & (rows.function[others] == made.function[place])]] = True
    outcome[(outcome == Ending.SILENT) & garbled] = Ending.GARBAGE
    silent, damaged = outcome == Ending.SILENT, (outcome == Ending.SILENT) & (made.strays + made.late > 0)
    made.got[:] = np.where(silent, Got.SILENCE, np.where(outcome == Ending.EXCEPTION, made.exception, Got.ANSWER))
    made.got[damaged | (outcome == Ending.GARBAGE)] = made.got[doubted] = Got.DAMAGE  # another's answer met it
    halved = unfit & _OF_WORDS[made.function[place]] & (lengths[others] == 2 + OVERHEAD + (made.poll[place] & 0xFFFF))
    made.got[place[halved]] = Got.HALF
    outcome[made.unit == 0] = Ending.BROADCAST
    made.outcome[:] = outcome
    to_all = answers[made.unit[of[answers]] == 0]
    called = (rows.unit[to_all] != 0) | (lengths[to_all] != lengths[made.row[of[to_all]]])
    made.called[of[to_all[called]]] = True
    made.called[:] |= (outcome == Ending.BROADCAST) & (made.noise > _STRAY_BYTES)


def _asked(made: Exchanges, table: Batch, which: NDArray[np.intp]) -> None:
    """Fill in what each request asks for."""
    rows, data = table.rows, table.data
    begins = rows.at.take(which) + 1
    ends = begins + made.asked_bytes - 3
    if rows.protocol.any():
        data, begins, ends = _decoded(table, which)
    last = len(data) - 1
    octet = [data.take(np.minimum(begins + i, last)).astype(np.int64) for i in range(1, 5)]
    short = ends - begins < 5
    address, quantity = octet[0] << 8 | octet[1], octet[2] << 8 | octet[3]
    unit, function = made.unit.astype(np.int64), made.function
    quantity[~_COUNTED[function]] = 1
    address[short], quantity[short] = 0xFFFF, 0
    made.poll[:] = unit << 40 | function.astype(np.int64) << 32 | address << 16 | quantity
    check = data.take(np.minimum(ends, last)).astype(np.int64) << 8 | data.take(np.minimum(ends + 1, last))
    made.identity[:] = unit << 48 | function.astype(np.int64) << 40 | (ends - begins) << 24 | check
    constant, per_word, per_bit = _answer_lengths(revision())
    due = constant.take(function)
    due += per_word.take(function) * 2 * quantity + per_bit.take(function) * taken(quantity, True)
    due[short & (per_word + per_bit > 0).take(function)] = 0
    made.due[:] = np.minimum(due, 1 << 16)


def _decoded(table: Batch, which: NDArray[np.intp]) -> tuple[UInt8s, Int64s, Int64s]:
    """The bytes of requests in ASCII mode without their envelope, and where each PDU begins and ends in them."""
    parts = [adu_of(table.bytes_of(row), int(table.rows.protocol[row])).data + b"\0" for row in which.tolist()]
    lengths = np.array([len(part) for part in parts], np.int64)
    begins = np.cumsum(lengths) - lengths
    return np.frombuffer(b"".join(parts) or b"\0", np.uint8), begins + 1, begins + np.maximum(lengths - 2, 1)


_COUNTED: Final = np.isin(np.arange(256), (1, 2, 3, 4, 15, 16, 20, 21, 23))  # functions with a quantity as second word


@lru_cache(maxsize=2)
def _answer_lengths(_revision: int) -> tuple[Int64s, Int64s, Int64s]:
    """Bytes of an answer's ADU by function: a constant (0: nobody knows), and how often words and bits asked count."""
    constant, per_word, per_bit = (np.zeros(256, np.int64) for _ in range(3))
    for function in range(128):
        known = rule(function, Role.RESPONSE)
        if known is None or known.base is None or known.variable:
            continue
        asked = [each for each in relations(function) if isinstance(each, RequestedByteCount)]
        if asked and asked[0].quantity_offset == 3:
            constant[function] = known.base + 3
            (per_bit if asked[0].bits else per_word)[function] = 1
        elif known.count is None:
            constant[function] = known.base + 3
    return constant, per_word, per_bit
