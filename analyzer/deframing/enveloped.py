"""Requests and responses paired, each protocol in its own way: RTU and ASCII mode by what was said, TCP by transaction.

ASCII frames are paired by the bytes that their digits stand for. A response over Modbus TCP carries the transaction of
its request, on the same connection; where a log's ports are directions, on the one that asks.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.answers import Expectation, expectation
from dissectors.envelopes import MBAP

from ..tables.frame import adu_of
from ..tables.schema import Kind, Protocol, Row, Rows
from .conversation import responses_fit
from .pairing import Pairer
from .rules import Bytes
from .wireorder import Across

_PAIRED: Final = ("request", "request_start", "response_ns")
_UNIT: Final = MBAP - 1  # offset in a frame of Modbus TCP
_PADDING: Final = 1 << 8  # bytes
_OPEN: Final = 4096  # transactions that may be open at once
_REQUEST, _RESPONSE = int(Kind.REQUEST), int(Kind.RESPONSE)


class EnvelopedPairer:
    """Fills `request`, `request_start` and `response_ns` of rows, which are -1, in wire order, batch after batch."""

    def __init__(self) -> None:
        self._rtu, self._ascii, self._tcp = Pairer(), Pairer(), _TransactionPairer()

    def pair(
        self,
        rows: Rows,
        data: Bytes,
        head: NDArray[np.int64],
        tail: NDArray[np.int64],
        across: Across | None = None,
    ) -> dict[int, bytes]:
        """Fill the columns in place; give the bytes of those requests that lie in earlier batches; see `Pairer`."""
        if not np.count_nonzero(rows.protocol):
            return self._rtu.pair(rows, data, head, tail, across)
        protocol = rows.protocol.copy()
        earlier: dict[int, bytes] = {}
        plain = protocol == Protocol.RTU
        if plain.any():
            mine = rows[plain]
            earlier |= self._rtu.pair(mine, data, head[plain], tail[plain], across and across.of(plain))
            for name in _PAIRED:
                rows.column(name)[plain] = mine.column(name)
        framed = rows.kind != Kind.NOISE
        spelt = np.flatnonzero(framed & (protocol == Protocol.ASCII))
        if len(spelt):
            earlier |= self._spelt(rows, spelt, data, head, tail, across and across.of(spelt))
        networked = np.flatnonzero(framed & (protocol == Protocol.TCP))
        if len(networked):
            earlier |= self._tcp.pair(rows, networked, data, head, tail)
        return earlier

    def _spelt(
        self,
        rows: Rows,
        which: NDArray[np.intp],
        data: Bytes,
        head: NDArray[np.int64],
        tail: NDArray[np.int64],
        across: Across | None,
    ) -> dict[int, bytes]:
        """Frames in ASCII mode: their rows as they would be without their envelope."""
        mine = rows[which]
        begins, ends = mine.at.tolist(), (mine.at + mine.length).tolist()
        bodies = [
            adu_of(data[begin:end].tobytes(), Protocol.ASCII).data for begin, end in zip(begins, ends, strict=True)
        ]
        mine.length[:] = [len(body) for body in bodies]
        mine.at[:] = np.cumsum(mine.length) - mine.length
        octets = np.frombuffer(b"".join(bodies), np.uint8)
        earlier = self._ascii.pair(mine, octets, head[which], tail[which], across)
        for name in _PAIRED:
            rows.column(name)[which] = mine.column(name)
        return {index: b":" + request.hex().upper().encode() + b"\r\n" for index, request in earlier.items()}


class _OpenTransaction(NamedTuple):
    """A request over Modbus TCP that nobody has answered yet."""

    number: int  # its frame's index
    start: int
    t_end: int
    read: int
    adu: bytes
    expects: Expectation


class _TransactionPairer:
    """Pairs Modbus TCP: most of it as arrays, neighbours of one transaction; the rest one by one."""

    def __init__(self) -> None:
        self._open: dict[int, _OpenTransaction] = {}  # by port and transaction, the oldest first
        self._asking: set[int] = set()  # ports on which requests were seen

    def pair(
        self, rows: Rows, which: NDArray[np.intp], data: Bytes, head: NDArray[np.int64], tail: NDArray[np.int64]
    ) -> dict[int, bytes]:
        """Pair these rows, all of them frames."""
        data = np.concatenate((data, np.zeros(_PADDING, np.uint8)))  # a frame may be shorter than its fields
        kind, at = rows.kind[which], rows.at[which]
        keys = rows.port[which].astype(np.int64) << 16 | data.take(at).astype(np.int64) << 8 | data.take(at + 1)
        order = np.argsort(keys, kind="stable")
        asked, answers = order[:-1], order[1:]
        pairs = (keys[asked] == keys[answers]) & (kind[asked] == _REQUEST) & (kind[answers] == _RESPONSE)
        asked, answers = asked[pairs], answers[pairs]
        ends = at + rows.length[which]
        fits = responses_fit(data, at[asked] + _UNIT, at[answers] + _UNIT, (ends[asked], ends[answers]))
        asked, answers = asked[fits], answers[fits]
        mine, its = which[answers], which[asked]
        waited = np.maximum(rows.t_start_ns[mine] - rows.t_end_ns[its], 0)
        waited[tail[its] == head[mine]] = -1
        rows.request[mine], rows.request_start[mine] = rows.index[its], rows.start[its]
        rows.response_ns[mine] = waited
        loose = np.ones(len(which), np.bool_)
        loose[asked] = loose[answers] = False
        reused = np.isin(keys, [*self._open, *keys[loose].tolist()]) & (kind == _REQUEST)
        earlier: dict[int, bytes] = {}
        first = int(rows.index[which[0]])
        asking, since = np.unique(keys[kind == _REQUEST] >> 16, return_index=True)
        asks_from = dict(zip(asking.tolist(), np.flatnonzero(kind == _REQUEST)[since].tolist(), strict=True))
        asks_from |= dict.fromkeys(self._asking, -1)
        for i in np.flatnonzero(loose | reused).tolist():
            row, key, begin = int(which[i]), int(keys[i]), int(at[i])
            adu = data[begin : begin + int(rows.length[row])].tobytes()
            if kind[i] == _REQUEST:
                self._open.pop(key, None)  # the transaction is used anew
                if loose[i]:
                    self._ask(rows.row(row), key, adu, int(tail[row]))
            elif (found := self._found(key, adu, asks=asks_from.get(key >> 16, i) < i)) is not None:
                same = int(head[row]) == found.read
                rows.request[row], rows.request_start[row] = found.number, found.start
                rows.response_ns[row] = -1 if same else max(0, int(rows.t_start_ns[row]) - found.t_end)
                if found.number < first:
                    earlier[found.number] = found.adu
        self._asking.update(asking.tolist())
        return earlier

    def _ask(self, asked: Row, key: int, adu: bytes, read: int) -> None:
        expects = expectation(adu[_UNIT:])
        self._open[key] = _OpenTransaction(asked.index, asked.start, asked.t_end_ns, read, adu, expects)
        if len(self._open) > _OPEN:
            del self._open[next(iter(self._open))]

    def _found(self, key: int, adu: bytes, *, asks: bool) -> _OpenTransaction | None:
        """The request of a response, taken from those that are open; `asks`: there were requests on its port before."""
        if not asks:  # a direction of its own
            key = next((each for each in reversed(self._open) if each & 0xFFFF == key & 0xFFFF), key)
        found = self._open.get(key)
        if found is None or not found.expects.fits(adu[_UNIT:]):
            return None
        return self._open.pop(key)
