"""Which request does a response in an envelope answer?

ASCII frames are paired by the bytes that their digits stand for. A response over Modbus TCP carries the transaction of
its request, on the same connection; where a log's ports are directions, on the one that asks.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.envelopes import MBAP
from dissectors.lengths import Expectation, expectation

from ..tables.batch import adu_of
from ..tables.schema import Kind, Protocol, Row, Rows
from .conversation import responses_fit
from .pairing import Pairer
from .rules import Bytes
from .wireorder import Across

_REQUEST, _RESPONSE = int(Kind.REQUEST), int(Kind.RESPONSE)
_PAIRED: Final = ("request", "request_start", "response_ns")
_UNIT: Final = MBAP - 1  # offset in a frame of Modbus TCP
_PADDING: Final = 1 << 8  # bytes
_OPEN_TRANSACTIONS: Final = 4096  # frames behind a request in which it may be answered
_PIPELINED: Final = 8  # requests of one transaction number that may be open on a port
_PORTS: Final = 1 << 8


class EnvelopedPairer:
    """Fills `request`, `request_start` and `response_ns` of rows, which are -1, in wire order, batch after batch."""

    _rtu: Pairer
    _ascii: Pairer
    _tcp: _TransactionPairer

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

    @classmethod
    def of(cls, asked: Row, adu: bytes, read: int) -> _OpenTransaction:
        """`read` brought its last byte."""
        return cls(asked.index, asked.start, asked.t_end_ns, read, adu, expectation(adu[_UNIT:]))


class _TransactionPairer:
    """Pairs Modbus TCP: most of it as arrays, neighbours of one transaction; the rest one by one.

    A response on a port that has not asked by then is looked for on all ports. Transactions of such numbers go one by
    one, whatever their neighbours are: whose answer was first hangs on all of them.
    """

    _open: dict[int, dict[int, list[_OpenTransaction]]]
    _asking: set[int]

    def __init__(self) -> None:
        self._open = {}  # by number and port, the oldest first
        self._asking = set()  # ports on which requests were seen

    def pair(
        self, rows: Rows, which: NDArray[np.intp], data: Bytes, head: NDArray[np.int64], tail: NDArray[np.int64]
    ) -> dict[int, bytes]:
        """Pair these rows, all of them frames."""
        data = np.concatenate((data, np.zeros(_PADDING, np.uint8)))  # a frame may be shorter than its fields
        kind, at, index = rows.kind[which], rows.at[which], rows.index[which]
        number = data.take(at).astype(np.int64) << 8 | data.take(at + 1)
        port = rows.port[which].astype(np.int64)
        keys = port << 16 | number
        elsewhere = (kind == _RESPONSE) & (np.arange(len(which)) < self._asks_from(kind, port).take(port))
        order = np.argsort(keys, kind="stable")
        asked, answers = order[:-1], order[1:]
        pairs = (keys[asked] == keys[answers]) & (kind[asked] == _REQUEST) & (kind[answers] == _RESPONSE)
        pairs &= index[answers] - index[asked] <= _OPEN_TRANSACTIONS
        if elsewhere.any():
            pairs &= ~np.isin(number[asked], number[elsewhere])
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
        known = [*self._open, *number[loose].tolist()]
        reused = np.isin(number, known) & (kind == _REQUEST)
        earlier: dict[int, bytes] = {}
        first = int(index[0])
        for i in np.flatnonzero(loose | reused).tolist():
            row, begin = int(which[i]), int(at[i])
            adu = data[begin : begin + int(rows.length[row])].tobytes()
            opened = self._open.setdefault(int(number[i]), {})
            if kind[i] == _REQUEST:
                if loose[i]:
                    before = opened.pop(int(port[i]), [])  # so that the port that asked last stands last
                    made = _OpenTransaction.of(rows.row(row), adu, int(tail[row]))
                    opened[int(port[i])] = [*before, made][-_PIPELINED:]
            elif (found := _found(opened, adu, int(index[i]), None if elsewhere[i] else int(port[i]))) is not None:
                same = int(head[row]) == found.read
                rows.request[row], rows.request_start[row] = found.number, found.start
                rows.response_ns[row] = -1 if same else max(0, int(rows.t_start_ns[row]) - found.t_end)
                if found.number < first:
                    earlier[found.number] = found.adu
        self._forget(int(index[-1]))
        return earlier

    def _asks_from(self, kind: NDArray[np.uint8], port: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of each port, the frame from which on it has asked; what asks now is known from here on."""
        asks_from = np.full(_PORTS, len(kind))
        asking, since = np.unique(port[kind == _REQUEST], return_index=True)
        asks_from[asking] = np.flatnonzero(kind == _REQUEST)[since]
        asks_from[list(self._asking)] = 0
        self._asking.update(asking.tolist())
        return asks_from

    def _forget(self, newest: int) -> None:
        """Requests that are too old to be answered, of which a table would grow."""
        if len(self._open) <= 2 * _OPEN_TRANSACTIONS:
            return
        for number, opened in list(self._open.items()):
            for port, asked in list(opened.items()):
                young = [one for one in asked if newest - one.number <= _OPEN_TRANSACTIONS]
                if young:
                    opened[port] = young
                else:
                    del opened[port]
            if not opened:
                del self._open[number]


def _found(
    opened: dict[int, list[_OpenTransaction]], adu: bytes, index: int, port: int | None
) -> _OpenTransaction | None:
    """The request of a response, taken from those of its number: of this port; None: of the one that asked last.

    A client may send several under one number, or use a number anew: the newest that fits is meant.
    """
    asked = opened.get(next(reversed(opened), -1) if port is None else port, [])
    for one in reversed(asked):
        if index - one.number <= _OPEN_TRANSACTIONS and one.expects.fits(adu[_UNIT:]):
            asked.remove(one)
            return one
    return None
