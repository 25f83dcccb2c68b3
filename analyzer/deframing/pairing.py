"""Which request does a response answer?

In RTU and ASCII mode almost always the frame before it, which arrays settle at once; the rest (late answers, two
requests in a row) look back over the requests that are still open, the newest that fits first.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import expectation

from ..tables.schema import Kind, Rows
from ..tables.transactions import LATE_NS, LATE_WAITS, LONGEST_NS
from .buffer import Times
from .conversation import response_fits, responses_fit
from .rules import Bytes, Index
from .wireorder import Across

_REACH: Final = 4096  # bytes back
_OPEN_REQUESTS: Final = 8  # requests at most
_FEW: Final = 48  # frames
_REQUEST, _RESPONSE = int(Kind.REQUEST), int(Kind.RESPONSE)


@dataclass(slots=True)
class _OpenRow:
    """A request that nobody has answered yet."""

    index: int
    start: int
    port: int
    t_end: int
    read: int
    place: int  # bytes before it on the bus, all ports together
    adu: bytes
    t_next: int | None = None  # start of the next request on its port

    def expects_by(self, t_ns: int) -> bool:
        """Whether an answer may come then: soon enough after the master went on, if it did."""
        waits = LONGEST_NS if self.t_next is None else max(LATE_NS, LATE_WAITS * (self.t_next - self.t_end))
        return t_ns - self.t_end <= min(waits, LONGEST_NS)


class Pairer:
    """Fills `request`, `request_start` and `response_ns` of rows, which are -1, in wire order, batch after batch."""

    _open: list[_OpenRow]
    _place: int

    def __init__(self) -> None:
        self._open = []
        self._place = 0

    def pair(
        self,
        rows: Rows,
        data: Bytes,
        head: NDArray[np.int64],
        tail: NDArray[np.int64],
        across: Across | None = None,
    ) -> dict[int, bytes]:
        """Fill the columns in place; give the bytes of those requests that lie in earlier batches.

        `head` and `tail` number the reads that brought the first and last byte of each row; a response that came in
        one read with its request has no known response time. `across`: of two ports that carry one direction each.
        """
        frames = rows.kind.nonzero()[0]
        ends = self._place + rows.length.cumsum()
        place = ends - rows.length
        self._place = int(ends[-1]) if len(ends) else self._place
        earlier: dict[int, bytes] = {}
        if not len(frames):
            return earlier
        few = across is None and len(frames) <= _FEW
        loose = (_pair_few if few else _pair_neighbours)(rows, data, frames, head, tail, across)
        asking = _RequestTimes(rows, frames)
        for i in _still_open(loose, rows.kind.take(frames)) if len(loose) > _OPEN_REQUESTS else loose.tolist():
            row = int(frames[i])
            begin = int(rows.at[row])
            adu = data[begin : begin + int(rows.length[row])].tobytes()
            if rows.kind[row] == _REQUEST:
                if not rows.check[row]:
                    continue  # a damaged one is answered by nobody
                self._ask(rows, row, adu, int(tail[row]), int(place[row]))
            else:
                self._went_on(asking, int(rows.index[row]))
                other = across is not None and bool(across.answers[row])
                port = across.requests if across is not None and other else int(rows.port[row])
                self._answer(rows, row, adu, int(head[row]), int(place[row]), port, earlier)
        self._went_on(asking, int(rows.index[frames[-1]]) + 1)
        if across is not None:
            told = rows.response_ns
            told[across.answers & (told <= across.unsure_ns)] = -1
        return {index: request for index, request in earlier.items() if index < asking.first}

    def _ask(self, rows: Rows, row: int, adu: bytes, read: int, place: int) -> None:
        index, start, port, end = rows.index[row], rows.start[row], rows.port[row], rows.t_end_ns[row]
        opened = _OpenRow(int(index), int(start), int(port), int(end), read, place, adu)
        self._open = [
            *self._open[-_OPEN_REQUESTS:],
            opened,
        ]  # one too many: an answer right behind closes it at once

    def _went_on(self, asking: _RequestTimes, until: int) -> None:
        """Each open request learns when the next one on its port began, if that is a frame before `until`."""
        for opened in self._open:
            if opened.t_next is None and max(opened.index + 1, asking.first) < until:
                indices, times = asking.of(opened.port)
                behind = int(indices.searchsorted(opened.index, "right"))
                if behind < len(indices) and indices[behind] < until:
                    opened.t_next = int(times[behind])

    def _answer(
        self, rows: Rows, row: int, adu: bytes, read: int, place: int, port: int, earlier: dict[int, bytes]
    ) -> None:
        """`port`: that of the requests that it may answer."""
        before = int(rows.index[row]) - 1
        newest = self._open[-1:]
        if not any(o.index == before and o.port == port and expectation(o.adu).fits(adu) for o in newest):
            self._open = self._open[-_OPEN_REQUESTS:]
        self._open = [o for o in self._open if place - o.place <= _REACH]
        now = int(rows.t_start_ns[row])
        fitting = (o for o in reversed(self._open) if o.port == port and expectation(o.adu).fits(adu))
        found = next((o for o in fitting if o.expects_by(now)), None)
        if found is None:
            return
        self._open.remove(found)
        earlier[found.index] = found.adu
        rows.request[row] = found.index
        rows.request_start[row] = found.start
        rows.response_ns[row] = -1 if read == found.read else max(0, int(rows.t_start_ns[row]) - found.t_end)


class _RequestTimes:
    """Of the frames of a batch: when the requests of a port began, worked out once somebody asks."""

    def __init__(self, rows: Rows, frames: Index) -> None:
        self.first = int(rows.index[frames[0]])
        self._rows, self._frames = rows, frames
        self._known: dict[int, tuple[Index, Times]] = {}

    def of(self, port: int) -> tuple[Index, Times]:
        """Indices of the requests of a port, and their times."""
        if port not in self._known:
            rows, frames = self._rows, self._frames
            mine = frames[(rows.kind.take(frames) == _REQUEST) & (rows.port.take(frames) == port)]
            self._known[port] = rows.index.take(mine), rows.t_start_ns.take(mine)
        return self._known[port]


def _pair_neighbours(rows: Rows, data: Bytes, frames: Index, head: Times, tail: Times, across: Across | None) -> Index:
    """Pair each request with the frame behind it, if that answers it; the frames (numbers in `frames`) left over."""
    kind, at, port = rows.kind.take(frames), rows.at.take(frames), rows.port.take(frames)
    follows = (kind[1:] == _RESPONSE) & (kind[:-1] == _REQUEST) & rows.check.take(frames[:-1])
    if across is not None:
        asker = np.where(across.answers[frames], across.requests, port)
        follows &= asker[1:] == port[:-1]
    elif port.any():
        follows &= port[1:] == port[:-1]
    follows = follows.nonzero()[0] + 1
    follows = follows.compress(responses_fit(data, at.take(follows - 1), at.take(follows)))
    waited = np.maximum(rows.t_start_ns.take(frames[follows]) - rows.t_end_ns.take(frames[follows - 1]), 0)
    follows, waited = follows[waited <= LONGEST_NS], waited[waited <= LONGEST_NS]
    answers, asked = frames.take(follows), frames.take(follows - 1)
    waited[tail.take(asked) == head.take(answers)] = -1
    rows.request[answers] = rows.index[asked]
    rows.request_start[answers] = rows.start.take(asked)
    rows.response_ns[answers] = waited
    settled = np.zeros(len(frames), np.bool_)
    settled[follows] = settled[follows - 1] = True
    return (~settled).nonzero()[0]


def _pair_few(
    rows: Rows,
    data: Bytes,
    frames: Index,
    head: Times,
    tail: Times,
    across: Across | None,  # noqa: ARG001
) -> Index:
    """The same of a few frames of lines that each carry both directions: one by one."""
    octets, kind, at, port = data.tobytes(), rows.kind.tolist(), rows.at.tolist(), rows.port.tolist()
    whole = rows.check.tolist()
    numbers = frames.tolist()
    loose = dict.fromkeys(range(len(numbers)))
    for i, (asked, answer) in enumerate(pairwise(numbers)):
        if (
            kind[asked] == _REQUEST
            and whole[asked]
            and kind[answer] == _RESPONSE
            and port[asked] == port[answer]
            and response_fits(octets, at[asked], at[answer])
        ):
            waited = max(0, int(rows.t_start_ns[answer]) - int(rows.t_end_ns[asked]))
            if waited <= LONGEST_NS:
                rows.request[answer], rows.request_start[answer] = rows.index[asked], rows.start[asked]
                rows.response_ns[answer] = -1 if tail[asked] == head[answer] else waited
                del loose[i], loose[i + 1]
    return np.array(list(loose), np.intp)


def _still_open(loose: Index, kind: NDArray[np.uint8]) -> list[int]:
    """Of frames (numbers in `kind`) that are not paired, the responses, and the requests that may be open then."""
    number = np.arange(len(loose))
    looks = np.append((kind.take(loose) == _RESPONSE).nonzero()[0], len(loose))
    near: list[int] = loose[looks[looks.searchsorted(number)] - number <= _OPEN_REQUESTS + 1].tolist()
    return near
