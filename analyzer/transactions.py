"""Requests with their answers, as columns.

A transaction is a request and what became of it. It is settled when its answer has come, or when so many frames have
followed that none will; settled ones are given in the order of their requests, so that the columns of all batches put
end to end are the conversation of the whole capture.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .frames import Batch, Kind, Rows

_PATIENCE: Final = 16  # frames after a request, beyond which no answer is waited for


class Status(IntEnum):
    """What became of a request."""

    ANSWERED = 0
    EXCEPTION = 1
    UNANSWERED = 2
    BROADCAST = 3  # nobody answers those
    DAMAGED = 4  # an answer came, with a wrong CRC


TRANSACTION = np.dtype(
    [
        ("request", np.int64),  # index of the request's frame
        ("response", np.int64),  # index of the answer's, -1 for none
        ("t_request", np.int64),  # ns, end of the request
        ("t_response", np.int64),  # ns, start of the answer; -1 for none
        ("response_ns", np.int64),  # -1 for none, or where the tap can't tell
        ("unit", np.uint8),
        ("function", np.uint8),
        ("exception", np.uint8),  # exception code of the answer, 0 for none
        ("status", np.uint8),  # Status
        ("retry", np.bool_),  # the same bytes as the request before, which got no good answer
        ("late", np.bool_),  # the master had sent another request before this answer came
        ("port", np.uint8),
    ]
)


class Transactions:
    """Turns batches into transactions; holds only those that are open."""

    def __init__(self) -> None:
        self._open: Rows = np.zeros(0, TRANSACTION)
        self._last_request: bytes | None = None
        self._frames = 0

    def feed(self, batch: Batch) -> NDArray[np.void]:
        """Transactions that are settled after this batch, in the order of their requests."""
        rows = batch.rows
        kind = rows["kind"].copy()
        requests = np.flatnonzero((kind == Kind.REQUEST) & rows["check"])  # nobody answers a damaged one
        responses = np.flatnonzero(kind == Kind.RESPONSE)
        responses = responses[rows["request"][responses] >= 0]
        frames = np.flatnonzero(kind)
        if len(frames):
            self._frames = int(rows["index"][frames[-1]]) + 1
        known = len(self._open)
        opened = _opened(rows, requests)
        self._open = np.concatenate((self._open, opened)) if known else opened
        self._answer(rows, responses)
        self._mark_retries(batch, requests, known)
        status = self._open["status"]
        late = int(np.searchsorted(self._open["request"], self._frames - _PATIENCE))
        waiting = (status[late:] == Status.UNANSWERED) | (status[late:] == Status.BROADCAST)
        return self._settle(late + int(np.argmax(waiting)) if waiting.any() else len(status))

    def close(self) -> NDArray[np.void]:
        """The rest: no answer comes any more."""
        return self._settle(len(self._open))

    def _settle(self, count: int) -> NDArray[np.void]:
        settled, self._open = self._open[:count], self._open[count:].copy()
        return settled

    def _answer(self, rows: Rows, responses: NDArray[np.intp]) -> None:
        asked = self._open["request"].copy()
        request = rows["request"][responses]
        place = np.searchsorted(asked, request)
        found = place < len(asked)
        found[found] = asked[place[found]] == request[found]
        if not found.all():
            place, responses = place[found], responses[found]
        opened, index = self._open, rows["index"][responses]
        opened["response"][place] = index
        opened["t_response"][place] = rows["t_start"][responses]
        opened["response_ns"][place] = rows["response_ns"][responses]
        exception = rows["exception"][responses]
        opened["exception"][place] = exception
        status = np.where(exception > 0, np.uint8(Status.EXCEPTION), np.uint8(Status.ANSWERED))
        status[~rows["check"][responses]] = Status.DAMAGED
        opened["status"][place] = status
        following = np.append(asked[1:], np.iinfo(np.int64).max)
        opened["late"][place] = following[place] < index

    def _mark_retries(self, batch: Batch, requests: NDArray[np.intp], known: int) -> None:
        """Of the new requests, which repeat the one before? Few went without a good answer, so those are compared."""
        if not len(requests):
            return
        opened, rows = self._open, batch.rows
        status = opened["status"]
        bad = (status != Status.ANSWERED) & (status != Status.EXCEPTION) | opened["late"]
        before = np.arange(known - 1, len(opened) - 1)  # the transaction before each of the new ones
        some = np.flatnonzero(bad[before]) if known else 1 + np.flatnonzero(bad[before[1:]])
        for i in some.tolist():
            last = self._last_request if i == 0 else batch.bytes_of(int(requests[i - 1]))
            row = int(requests[i])
            if last is not None and len(last) == rows["length"][row]:
                opened["retry"][known + i] = batch.bytes_of(row) == last
        self._last_request = batch.bytes_of(int(requests[-1]))


def _opened(rows: Rows, requests: NDArray[np.intp]) -> Rows:
    """Transactions of requests that nobody has answered yet."""
    opened = np.zeros(len(requests), TRANSACTION)
    for name in ("unit", "function", "port"):
        opened[name] = rows[name][requests]
    opened["request"], opened["t_request"] = rows["index"][requests], rows["t_end"][requests]
    opened["response"] = opened["t_response"] = opened["response_ns"] = -1
    opened["status"] = np.where(opened["unit"] == 0, np.uint8(Status.BROADCAST), np.uint8(Status.UNANSWERED))
    return opened
