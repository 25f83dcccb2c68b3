"""Where the PDU of each row of a batch stands, and that of the request that it answers: bytes for array code to read.

The PDU of RTU and TCP lies in the batch's own bytes. What does not is put behind them: the PDUs of ASCII frames, and
those of requests in a batch before.
"""

from __future__ import annotations

from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.envelopes import MBAP

from .batch import Batch
from .frame import adu_of
from .schema import Kind, Protocol

_Ints = NDArray[np.int64]
_CHECK: Final = 2  # bytes of the CRC


class Pdus:
    """The PDUs of a batch: of row i `data[begins[i] : ends[i]]`, the function code first.

    `asked_begins` and `asked_ends` are those of its request, -1 where none is known. Noise rows have no meaning.
    """

    def __init__(self, batch: Batch) -> None:
        rows = batch.rows
        self.batch = batch
        self._more: list[bytes] = []
        self._size = len(batch.data)
        self.begins: _Ints = rows.at + 1  # behind the unit
        self.ends: _Ints = rows.at + rows.length - _CHECK
        if (protocol := rows.protocol).any():
            networked = protocol == Protocol.TCP
            self.begins[networked] += MBAP - 1
            self.ends[networked] += _CHECK
            self._spelt()
        self.asked_begins, self.asked_ends = self._requests()
        self.data = batch.data
        if self._more:
            self.data = np.concatenate((batch.data, np.frombuffer(b"".join(self._more), np.uint8)))

    @cached_property
    def words(self) -> NDArray[np.uint16]:
        """The big-endian number that begins at each byte."""
        return words_of(self.data)

    def number(self, offset: int, width: int, rows: _Ints, *, asked: bool = False) -> _Ints:
        """A number of 1 or 2 bytes at this offset of some rows' PDUs, or of their requests'; -1 where there is none."""
        begins, ends = (self.asked_begins, self.asked_ends) if asked else (self.begins, self.ends)
        at = begins[rows]
        at += offset
        short = at + width > ends[rows]
        at[short] = 0
        value: _Ints = (self.data if width == 1 else self.words).take(at).astype(np.int64)
        value[short] = -1
        return value

    def _requests(self) -> tuple[_Ints, _Ints]:
        """Where the PDU of each row's request begins and ends in the bytes; -1 and -1 for none."""
        rows = self.batch.rows
        begins, ends = np.full(len(rows), -1, np.int64), np.full(len(rows), -1, np.int64)
        requested = rows.request.copy()
        answers = np.flatnonzero(requested >= 0)
        if not len(answers):
            return begins, ends
        index = rows.index.copy()
        frames = np.flatnonzero(index >= 0)
        requested = requested[answers]
        numbers = index[frames]
        if numbers[-1] - numbers[0] == len(frames) - 1:  # one after the other, as long as nobody took some away
            at = requested - numbers[0]
            inside = (at >= 0) & (at < len(frames))
        else:
            at = np.searchsorted(numbers, requested)
            inside = numbers[np.minimum(at, len(frames) - 1)] == requested
        request = frames[np.where(inside, at, 0)]
        if not inside.all():
            begins[answers[inside]], ends[answers[inside]] = self.begins[request[inside]], self.ends[request[inside]]
        else:
            begins[answers], ends[answers] = self.begins[request], self.ends[request]
        for row, index in zip(answers[~inside].tolist(), requested[~inside].tolist(), strict=True):
            if (captured := self.batch.earlier.get(index)) is not None:
                adu = adu_of(captured, int(rows.protocol[row]))
                begins[row], ends[row] = self._put(adu.pdu)
        return begins, ends

    def _spelt(self) -> None:
        """ASCII frames as the bytes that their digits stand for."""
        for row in np.flatnonzero(self.batch.rows.protocol == Protocol.ASCII).tolist():
            if self.batch.rows.kind[row] != Kind.NOISE:
                adu = adu_of(self.batch.bytes_of(row), Protocol.ASCII)
                self.begins[row], self.ends[row] = self._put(adu.pdu)

    def _put(self, pdu: bytes) -> tuple[int, int]:
        """A PDU put behind the batch's bytes: where it begins and ends."""
        self._more.append(pdu)
        self._size += len(pdu)
        return self._size - len(pdu), self._size


def words_of(data: NDArray[np.uint8]) -> NDArray[np.uint16]:
    """The big-endian number that begins at each byte, the last one's with a zero behind it; one at least."""
    words = np.zeros(max(len(data), 1), np.uint16)
    words[: len(data)] = data
    words <<= 8
    words[: max(len(data) - 1, 0)] |= data[1:]
    return words
