"""Requests with their answers, as columns.

A transaction is a request and what became of it. It is settled when its answer has come, or when so many frames have
followed that none will; settled ones are given in the order of their requests, so that the columns of all batches put
end to end are the conversation of the whole capture. What a request can still be told ends at its horizon, a row that
hangs on the rows alone: so batches do not matter.

Whose an answer is say the rows. Where nobody can tell (`unsure`), it stands with the request that the client takes it
for; an answer that is given twice stands with its request once.

Response times are told as far as a tap's clock carries them: exact, an interval, or unknown (`schema.DelayBounds`).
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import expectation

from .batch import Batch, adu_of
from .schema import GLITCHES, Bools, Columns, DelayBounds, Int64s, Kind, Protocol, Rows, UInt8s, delay_bounds

ECHOED: Final = np.isin(np.arange(256), (5, 6, 22))  # functions whose answer is their request once more
LATE_WAITS: Final = 3  # so many of the master's waits after a request, beyond which an answer is not late but another's
LATE_NS: Final = 3_000_000_000  # and so long at least: not every tap tells how long the master waits
LONGEST_NS: Final = 120_000_000_000  # nobody waits longer for an answer, though nothing else is asked meanwhile
PATIENCE_NS: Final = 1_000_000_000  # as clients usually wait, until it shows how long this one does
OF_GATEWAYS: Final = (0x0A, 0x0B)  # exceptions by which a gateway answers for a unit behind it ([1] 7)
NEVER: Final = -(1 << 62)  # a time that is none
_PATIENCE: Final = 16  # frames after a request, beyond which no answer is waited for
_PIPELINED: Final = 1024  # the same over Modbus TCP, where many connections and transactions are open at once
_REACH: Final = 1 << 16  # and bytes, noise included
_GLITCHES: Final = bytes(GLITCHES)  # noise bytes that say nothing
_MIN_ADU: Final = 4
_TRANSACTION_ID: Final = 2  # bytes, anew in each request over Modbus TCP
ALIKE: Final = 2  # bytes in which a damaged request may differ from its repetition


class Status(IntEnum):
    """What became of a request."""

    ANSWERED = 0
    EXCEPTION = 1
    UNANSWERED = 2
    BROADCAST = 3  # nobody answers those
    DAMAGED = 4  # an answer came, with a wrong CRC
    UNHEARD = 5  # it may have been answered while the recorder heard nothing (`analyzer.outages`)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class TransactionRows(Columns):
    """Requests, and what became of them."""

    request: Int64s  # index of the request's frame
    response: Int64s  # index of the answer's, -1 for none
    start: Int64s  # offset of the request's first byte in its port's stream
    length: Int64s  # bytes of the request
    response_start: Int64s  # the same of the answer, -1 for none
    response_length: Int64s
    t_start_ns: Int64s  # ns, start of the request
    t_request_ns: Int64s  # ns, end of the request
    t_response_ns: Int64s  # ns, start of the answer; -1 for none
    response_ns: Int64s  # -1 for none, or where the tap can't tell
    t_next_ns: Int64s  # without a good answer: ns, start of the next request; NEVER for none
    garbage: Int64s  # and bytes between the two that belong to no request, glitches apart
    unit: UInt8s
    function: UInt8s
    exception: UInt8s  # exception code of the answer, 0 for none
    status: UInt8s  # Status
    retry: Bools  # the same bytes as the request before, which got no good answer
    again: Bools  # a broadcast, or a write that is echoed: the same as the request before, which went well
    late: Bools  # the master had sent another request before this answer came
    mistaken: Bools  # and it fits that one as well
    port: UInt8s
    response_port: UInt8s  # of the answer: another where each direction has its own
    protocol: UInt8s  # Protocol
    unsure: Bools  # the client takes this answer for its own, and nobody can tell whose it is
    mark: UInt8s  # of the request, as in `Rows`

    def response_times(self, off_ns: float) -> DelayBounds:
        """How long each answer took, as far as a clock carries it by which times may be wrong by so much."""
        return delay_bounds(np.where(self.response >= 0, self.response_ns, -1), off_ns)


OF_ANSWER: Final = {  # column of a transaction: that of its answer
    "response": "index",
    "response_start": "start",
    "response_length": "length",
    "response_port": "port",
    "t_response_ns": "t_start_ns",
    "response_ns": "response_ns",
    "exception": "exception",
}


class Transactions:
    """Turns batches into transactions; holds only those that are open."""

    _open: TransactionRows
    _last_request: bytes | None
    _failed: bool
    _last_row: tuple[bool, bytes]
    _frames: int
    _octets: int
    _places: NDArray[np.int64]
    _repeats: NDArray[np.bool_]
    _waited_ns: int

    def __init__(self) -> None:
        self._open = TransactionRows.zeros(0)
        self._last_request = None
        self._failed = False  # the newest that is settled got no good answer
        self._last_row = (True, b"")  # of the last row: whether it was a whole frame, its bytes
        self._frames = 0
        self._octets = 0  # on the bus so far, all ports together
        self._places = np.zeros(0, np.int64)  # of the open requests: octets on the bus up to their ends
        self._waited_ns = LONGEST_NS  # for answers that did not come, at the least
        self._repeats = np.zeros(0, np.bool_)  # of the open requests over TCP: whether the one before asked the same

    def feed(self, batch: Batch) -> TransactionRows:
        """Transactions that are settled after this batch, in the order of their requests."""
        rows = batch.rows
        if not len(rows):
            return self._settle(0)
        kind = rows.kind
        requests = np.flatnonzero((kind == Kind.REQUEST) & rows.check)  # nobody answers a damaged one
        responses = np.flatnonzero(kind == Kind.RESPONSE)
        responses = responses[(rows.request[responses] >= 0) | rows.unsure[responses]]
        frames = np.flatnonzero(kind)
        known = len(self._open)
        before = np.cumsum(kind > 0) - (kind > 0) + self._frames
        if len(frames):
            self._frames = int(rows.index[frames[-1]]) + 1
        opened = TransactionRows.zeros(known + len(requests))
        opened.put(slice(known), self._open)
        self._open = opened
        _begin(opened[known:], rows, requests)
        ends = self._octets + np.cumsum(rows.length)
        self._places = np.concatenate((self._places, ends[requests]))
        self._repeats = np.concatenate((self._repeats, np.zeros(len(requests), np.bool_)))
        self._octets = int(ends[-1])
        patience = np.where(self._open.protocol == Protocol.TCP, _PIPELINED, _PATIENCE) + self._open.request
        horizon = np.minimum(
            np.searchsorted(before, patience, side="right"),
            np.searchsorted(ends - rows.length, self._places + _REACH, side="right"),
        )
        self._count_garbage(batch, requests, known, horizon)
        self._answer(batch, requests, responses, horizon)
        self._mark_retries(batch, requests, known)
        status = self._open.status
        waiting = (status == Status.UNANSWERED) | (status == Status.BROADCAST)
        waiting |= (status == Status.DAMAGED) & (self._open.t_next_ns == NEVER)  # what it costs shows the next request
        waiting &= (patience >= self._frames) & (self._places >= self._octets - _REACH)
        count = int(np.argmax(waiting)) if waiting.any() else len(waiting)
        return self._settle(count)

    @property
    def patience_ns(self) -> int:
        """How long the client waits for an answer: by requests that got none before the next one."""
        return PATIENCE_NS if self._waited_ns == LONGEST_NS else self._waited_ns

    @property
    def open_from(self) -> int | None:
        """Index of the first request that is not settled."""
        return int(self._open.request[0]) if len(self._open) else None

    def close(self) -> TransactionRows:
        """The rest: no answer comes any more."""
        return self._settle(len(self._open))

    def _settle(self, count: int) -> TransactionRows:
        settled, self._open = self._open[:count], self._open[count:].copy()
        if count:
            failed = np.append(self._failed, _failed(settled))
            settled.retry[:] |= self._repeats[:count] & failed[:-1]  # several may be open: only now it shows
            settled.again[:] &= ~settled.retry
            self._failed = bool(failed[-1])
        silent = settled.status == Status.UNANSWERED
        settled.garbage[~silent] = 0
        waited = (settled.t_next_ns - settled.t_request_ns)[silent & (settled.t_next_ns != NEVER)]
        self._waited_ns = int(waited.min(initial=self._waited_ns))
        settled.t_next_ns[~silent & (settled.status != Status.DAMAGED) & ~settled.late] = NEVER
        self._places, self._repeats = self._places[count:].copy(), self._repeats[count:].copy()
        return settled

    def _count_garbage(self, batch: Batch, requests: NDArray[np.intp], known: int, horizon: NDArray[np.intp]) -> None:
        """What lies between each request and the next, and when that next one began."""
        rows = batch.rows
        bad = np.flatnonzero((rows.kind != Kind.REQUEST) & (rows.request < 0))
        lost = np.zeros(len(rows) + 1, np.int64)
        for row in bad.tolist():
            at = int(rows.at[row])
            lost[row + 1] = len(batch.data[at : at + int(rows.length[row])].tobytes().translate(None, _GLITCHES))
        total = np.cumsum(lost)
        first = max(known - 1, 0)
        bounds = np.append(requests, len(rows)) if known == 0 else np.concatenate(([0], requests, [len(rows)]))
        begins, bounds = bounds[:-1], bounds[1:]
        horizon = horizon[first:]
        self._open.garbage[first:] += total[np.maximum(np.minimum(bounds, horizon), begins)] - total[begins]
        heard = bounds[:-1] < horizon[:-1]
        self._open.t_next_ns[first:-1][heard] = rows.t_start_ns[bounds[:-1][heard]]

    def _answer(
        self, batch: Batch, requests: NDArray[np.intp], responses: NDArray[np.intp], horizon: NDArray[np.intp]
    ) -> None:
        """Join answers to their requests."""
        rows = batch.rows
        requested = self._open.request
        wanted = self._wanted(rows, responses)
        position = np.searchsorted(requested, wanted)
        found = position < len(requested)
        found[found] = (requested[position[found]] == wanted[found]) & (responses[found] < horizon[position[found]])
        found &= self._open.response[np.where(found, position, 0)] < 0 if len(requested) else False
        position, responses = position[found], responses[found]
        position, first = np.unique(position, return_index=True)
        responses = responses[first]
        self._open.unsure[position] = rows.unsure[responses]
        for name, column in OF_ANSWER.items():
            self._open.column(name)[position] = rows.column(column).take(responses)
        status = np.where(rows.exception[responses] > 0, np.uint8(Status.EXCEPTION), np.uint8(Status.ANSWERED))
        status[~rows.check[responses]] = Status.DAMAGED
        self._open.status[position] = status
        following = np.append(requested[1:], np.iinfo(np.int64).max)
        late = following[position] < rows.index[responses]
        late &= self._open.protocol[position] != Protocol.TCP  # whose answers say what they answer
        self._open.late[position] = late
        newest = np.append(-1, requests)[np.searchsorted(requests, responses[late])]
        for at, row, before in zip(position[late].tolist(), responses[late].tolist(), newest.tolist(), strict=True):
            self._open.mistaken[at] = rows.taken_for_start[row] >= 0 or self._mistaken(batch, row, before)

    def _wanted(self, rows: Rows, responses: NDArray[np.intp]) -> NDArray[np.int64]:
        """The request that each answer is joined to: where nobody can tell, that which the client takes it for."""
        wanted = rows.request[responses]
        for i in np.flatnonzero(rows.unsure[responses]).tolist():
            row = int(responses[i])
            taken = (self._open.start == rows.taken_for_start[row]) & (self._open.unit == rows.unit[row])
            if taken.any():
                wanted[i] = self._open.request[int(np.flatnonzero(taken)[-1])]
        return wanted

    def _mistaken(self, batch: Batch, row: int, before: int) -> bool:
        """Whether a late answer would do for the newest request before it, which then takes it for its own.

        `before`: the row of that request, -1 where it stands in an earlier batch.
        """
        newest = batch.bytes_of(before) if before >= 0 else self._last_request
        if newest is None:
            return False
        protocol = int(batch.rows.protocol[row])
        requested, answer = adu_of(newest, protocol).data, adu_of(batch.bytes_of(row), protocol).data
        return expectation(requested).fits(answer) if min(len(requested), len(answer)) >= _MIN_ADU else False

    def _mark_retries(self, batch: Batch, requests: NDArray[np.intp], known: int) -> None:
        """Of the new requests, which repeat the one before? Few went without a good answer, so those are compared."""
        if len(requests):
            opened = self._open
            bad = np.append(self._failed if not known else _failed(opened[known - 1 : known]), _failed(opened[known:]))
            for i in np.flatnonzero(bad[:-1]).tolist():
                requested = self._last_request if i == 0 else batch.bytes_of(int(requests[i - 1]))
                row, protocol = int(requests[i]), int(opened.protocol[known + i])
                if requested is not None and len(requested) == batch.rows.length[row]:
                    same = _same_request(requested, batch.bytes_of(row), protocol)
                    if protocol == Protocol.TCP:
                        self._repeats[known + i] = same
                    else:
                        opened.retry[known + i] = same and bool(opened.unit[known + i])
            self._mark_second_tries(batch, requests, known)
            self._mark_again(batch, requests, known)
            self._last_request = batch.bytes_of(int(requests[-1]))
        last = len(batch) - 1
        self._last_row = bool(batch.rows.check[last]), batch.bytes_of(last)

    def _mark_again(self, batch: Batch, requests: NDArray[np.intp], known: int) -> None:
        """Broadcasts, and writes that are echoed, of which each byte is that of the request before."""
        rows, opened = batch.rows, self._open
        unit, function, protocol = opened.unit[known:], opened.function[known:], opened.protocol[known:]
        may = ((unit == 0) | ECHOED[function]) & ~opened.retry[known:]
        if not may.any():
            return
        lengths, ends = rows.length[requests], rows.at[requests] + rows.length[requests]
        checks = batch.data.take(ends - 2).astype(np.int64) << 8 | batch.data.take(ends - 1)
        same = np.ones(len(requests), np.bool_)
        same[1:] = (lengths[1:] == lengths[:-1]) & (unit[1:] == unit[:-1]) & (function[1:] == function[:-1])
        same[1:] &= (checks[1:] == checks[:-1]) | (protocol[1:] != Protocol.RTU)
        for i in np.flatnonzero(may & same).tolist():
            requested = self._last_request if i == 0 else batch.bytes_of(int(requests[i - 1]))
            same[i] = requested is not None and _same_request(
                requested, batch.bytes_of(int(requests[i])), int(protocol[i])
            )
        opened.again[known:] = may & same

    def _mark_second_tries(self, batch: Batch, requests: NDArray[np.intp], known: int) -> None:
        """Requests right behind a damaged one, or behind noise, that is them but for a byte or two."""
        before = requests - 1
        whole = np.append(batch.rows.check, self._last_row[0])[before]  # -1: the last row of the batch before
        for i in np.flatnonzero(~whole).tolist():
            damaged = self._last_row[1] if before[i] < 0 else batch.bytes_of(int(before[i]))
            request = batch.bytes_of(int(requests[i]))
            if abs(len(damaged) - len(request)) <= ALIKE and shared(damaged, request) >= len(request) - ALIKE:
                self._open.retry[known + i] = True


def _failed(transactions: TransactionRows) -> NDArray[np.bool_]:
    """Which of these got no good answer in time."""
    status = transactions.status
    failed: NDArray[np.bool_] = (status != Status.ANSWERED) & (status != Status.EXCEPTION) | transactions.late
    return failed


def _same_request(one: bytes, other: bytes, protocol: int) -> bool:
    """Whether two requests ask the same, whatever their numbers over Modbus TCP."""
    first = _TRANSACTION_ID if protocol == Protocol.TCP else 0
    return one[first:] == other[first:]


def shared(one: bytes, two: bytes) -> int:
    """How many bytes two byte strings share at their beginnings and ends."""
    most = min(len(one), len(two))
    head = next((i for i in range(most) if one[i] != two[i]), most)
    tail = next((i for i in range(most - head) if one[-1 - i] != two[-1 - i]), most - head)
    return head + tail


def _begin(opened: TransactionRows, rows: Rows, requests: NDArray[np.intp]) -> None:
    """Fill in transactions of requests that nobody has answered yet."""
    requested = rows[requests]
    opened.request[:], opened.start[:], opened.length[:] = requested.index, requested.start, requested.length
    opened.t_start_ns[:], opened.t_request_ns[:], opened.t_next_ns[:] = requested.t_start_ns, requested.t_end_ns, NEVER
    opened.unit[:], opened.function[:] = requested.unit, requested.function
    opened.port[:], opened.protocol[:], opened.mark[:] = requested.port, requested.protocol, requested.mark
    for column in (opened.response, opened.response_start, opened.response_length, opened.t_response_ns):
        column[:] = -1
    opened.response_ns[:] = -1
    to_all = (opened.unit == 0) & (opened.protocol != Protocol.TCP)  # unit 0 of a TCP server is itself
    opened.status[:] = np.where(to_all, np.uint8(Status.BROADCAST), np.uint8(Status.UNANSWERED))
