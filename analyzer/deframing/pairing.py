"""Which request does a response answer?

Almost always the frame before it, which arrays settle at once; the rest (late answers, two requests in a row) look
back over the requests that are still open, the newest that fits first.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.answers import expectation

from ..frames import Kind, Rows
from .conversation import fitting
from .rules import Bytes

_REACH: Final = 4096  # bytes back
_OPEN: Final = 8  # requests at most


@dataclass(slots=True)
class _Open:
    """A request that nobody has answered yet."""

    index: int
    start: int
    port: int
    t_end: int
    read: int
    place: int  # bytes before it on the bus, all ports together
    adu: bytes


class Pairer:
    """Fills `request`, `request_start` and `response_ns` of rows, in wire order, batch after batch."""

    def __init__(self) -> None:
        self._open: list[_Open] = []
        self._place = 0

    def pair(self, rows: Rows, data: Bytes, head: NDArray[np.int64], tail: NDArray[np.int64]) -> dict[int, bytes]:
        """Fill the columns in place; give the bytes of those requests that lie in earlier batches.

        `head` and `tail` number the reads that brought the first and last byte of each row; a response that came in
        one read with its request has no known response time.
        """
        frames = np.flatnonzero(rows["kind"] != Kind.NOISE)
        place = self._place + np.cumsum(rows["length"]) - rows["length"]
        self._place += int(rows["length"].sum())
        earlier: dict[int, bytes] = {}
        if not len(frames):
            return earlier
        kind = rows["kind"].take(frames)
        at = rows["at"].take(frames)
        follows = np.flatnonzero((kind[1:] == Kind.RESPONSE) & (kind[:-1] == Kind.REQUEST)) + 1
        follows = follows[rows["port"].take(frames[follows]) == rows["port"].take(frames[follows - 1])]
        follows = follows[fitting(data, at[follows - 1], at[follows])]
        answers, asked = frames[follows], frames[follows - 1]
        rows["request"][answers] = rows["index"][asked]
        rows["request_start"][answers] = rows["start"][asked]
        timed = tail[asked] != head[answers]
        waited = np.maximum(rows["t_start"][answers] - rows["t_end"][asked], 0)
        rows["response_ns"][answers] = np.where(timed, waited, -1)
        settled = np.zeros(len(frames), np.bool_)
        settled[follows] = settled[follows - 1] = True
        loose = np.flatnonzero(~settled)
        behind = np.append(np.flatnonzero(kind[loose] == Kind.RESPONSE), len(loose))
        until = behind[np.searchsorted(behind, np.arange(len(loose)))]  # (more requests than are kept open are passed)
        for i in loose[until - np.arange(len(loose)) <= _OPEN].tolist():
            row = int(frames[i])
            begin = int(rows["at"][row])
            adu = data[begin : begin + int(rows["length"][row])].tobytes()
            if kind[i] == Kind.REQUEST:
                self._ask(rows, row, adu, int(tail[row]), int(place[row]))
            else:
                self._answer(rows, row, adu, int(head[row]), int(place[row]), earlier)
        first = int(rows["index"][frames[0]])
        return {index: request for index, request in earlier.items() if index < first}

    def _ask(self, rows: Rows, row: int, adu: bytes, read: int, place: int) -> None:
        values = rows[row]
        opened = _Open(
            int(values["index"]), int(values["start"]), int(values["port"]), int(values["t_end"]), read, place, adu
        )
        self._open = [*self._open[1 - _OPEN :], opened]

    def _answer(self, rows: Rows, row: int, adu: bytes, read: int, place: int, earlier: dict[int, bytes]) -> None:
        self._open = [o for o in self._open if place - o.place <= _REACH]
        fitting_ones = [o for o in reversed(self._open) if expectation(o.adu).fits(adu)]
        if not fitting_ones:
            return
        port = int(rows["port"][row])  # the other port only where each carries one direction
        found = next((o for o in fitting_ones if o.port == port), fitting_ones[0])
        self._open.remove(found)
        earlier[found.index] = found.adu
        rows["request"][row] = found.index
        rows["request_start"][row] = found.start
        rows["response_ns"][row] = -1 if read == found.read else max(0, int(rows["t_start"][row]) - found.t_end)
