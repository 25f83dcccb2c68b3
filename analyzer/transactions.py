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
_REACH: Final = 1 << 16  # and bytes, noise included


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
        ("start", np.int64),  # offset of the request's first byte in its port's stream
        ("length", np.int64),  # bytes of the request
        ("t_start", np.int64),  # ns, start of the request
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
        self._octets = 0  # on the bus so far, all ports together
        self._places = np.zeros(0, np.int64)  # of the open requests: octets on the bus up to their ends

    def feed(self, batch: Batch) -> NDArray[np.void]:
        """Transactions that are settled after this batch, in the order of their requests."""
        rows = batch.rows
        requests = np.flatnonzero((rows["kind"] == Kind.REQUEST) & rows["check"])  # nobody answers a damaged one
        responses = np.flatnonzero((rows["kind"] == Kind.RESPONSE) & (rows["request"] >= 0))
        if len(rows):
            self._frames = max(self._frames, int(rows["index"].max()) + 1)
        known = len(self._open)
        self._open = np.concatenate((self._open, _opened(rows[requests])))
        ends = self._octets + np.cumsum(rows["length"])
        self._places = np.concatenate((self._places, ends[requests]))
        self._octets = int(ends[-1]) if len(ends) else self._octets
        self._answer(rows[responses])
        self._mark_retries(batch, requests, known)
        status = self._open["status"]
        waiting = (status == Status.UNANSWERED) | (status == Status.BROADCAST)
        waiting &= self._open["request"] >= self._frames - _PATIENCE
        waiting &= self._places >= self._octets - _REACH
        count = int(np.argmax(waiting)) if waiting.any() else len(waiting)
        return self._settle(count)

    @property
    def open_from(self) -> int | None:
        """Index of the first request that is not settled."""
        return int(self._open["request"][0]) if len(self._open) else None

    def close(self) -> NDArray[np.void]:
        """The rest: no answer comes any more."""
        return self._settle(len(self._open))

    def _settle(self, count: int) -> NDArray[np.void]:
        settled, self._open = self._open[:count], self._open[count:].copy()
        self._places = self._places[count:].copy()
        return settled

    def _answer(self, responses: Rows) -> None:
        asked = self._open["request"]
        place = np.searchsorted(asked, responses["request"])
        found = place < len(asked)
        found[found] = asked[place[found]] == responses["request"][found]
        place, responses = place[found], responses[found]
        self._open["response"][place] = responses["index"]
        self._open["t_response"][place] = responses["t_start"]
        self._open["response_ns"][place] = responses["response_ns"]
        self._open["exception"][place] = responses["exception"]
        self._open["status"][place] = np.where(
            ~responses["check"], Status.DAMAGED, np.where(responses["exception"] > 0, Status.EXCEPTION, Status.ANSWERED)
        )
        newest = np.searchsorted(asked, responses["index"]) - 1
        self._open["late"][place] = newest != place

    def _mark_retries(self, batch: Batch, requests: NDArray[np.intp], known: int) -> None:
        """Of the new requests, which repeat the one before? Few look alike, so only those are compared."""
        if not len(requests):
            return
        opened, rows = self._open, batch.rows[requests]
        places = known + np.arange(len(requests))
        same = np.ones(len(requests), np.bool_)
        for name in ("length", "unit", "function"):
            same[1:] &= rows[name][1:] == rows[name][:-1]
        good = np.isin(opened["status"], (Status.ANSWERED, Status.EXCEPTION)) & ~opened["late"]
        same &= ~np.append(not known or good[known - 1], good[places[:-1]])
        for i in np.flatnonzero(same).tolist():
            before = self._last_request if i == 0 else batch.bytes_of(int(requests[i - 1]))
            opened["retry"][places[i]] = batch.bytes_of(int(requests[i])) == before
        self._last_request = batch.bytes_of(int(requests[-1]))


def _opened(requests: Rows) -> Rows:
    """Transactions of requests that nobody has answered yet."""
    opened = np.zeros(len(requests), TRANSACTION)
    for name in ("unit", "function", "port", "start", "length", "t_start"):
        opened[name] = requests[name]
    opened["request"], opened["t_request"] = requests["index"], requests["t_end"]
    opened["response"] = opened["t_response"] = opened["response_ns"] = -1
    opened["status"] = np.where(requests["unit"] == 0, Status.BROADCAST, Status.UNANSWERED)
    return opened
