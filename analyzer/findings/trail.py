"""The rows before a row, across batches: what a rule looks back on when something is odd."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

import numpy as np

from ..frames import ROW, Batch, Kind, Row, Rows

_KEPT: Final = 64  # rows


class Seen(NamedTuple):
    """A row with its bytes."""

    row: Row
    captured: bytes

    @classmethod
    def of(cls, batch: Batch, place: int) -> Seen:
        """A row of a batch."""
        return cls(Row(*batch.rows[place].item()), batch.bytes_of(place))

    @property
    def is_frame(self) -> bool:
        return self.row.kind != Kind.NOISE


class Trail:
    """Looks back from any row of a batch, at most some rows into the batches before."""

    def __init__(self) -> None:
        self._earlier: deque[Batch] = deque()  # their last rows, enough of them together
        self._rows = 0

    def back(self, batch: Batch, place: int) -> Iterator[Seen]:
        """The last rows before row number `place`, the nearest first."""
        for before in range(place - 1, max(place - 1 - _KEPT, -1), -1):
            yield Seen.of(batch, before)
        left = _KEPT - place
        for earlier in reversed(self._earlier):
            for before in range(len(earlier) - 1, max(len(earlier) - 1 - left, -1), -1):
                yield Seen.of(earlier, before)
            left -= len(earlier)
            if left <= 0:
                return

    @property
    def newest(self) -> Rows:
        """The last row before this batch (one row of ROW); all zeros where there is none."""
        return self._earlier[-1].rows[-1:] if self._earlier else np.zeros(1, ROW)

    def go_on(self, batch: Batch) -> None:
        """This batch is done."""
        if not len(batch):
            return
        self._earlier.append(batch if len(batch) <= _KEPT else _end(batch))
        self._rows += min(len(batch), _KEPT)
        while self._rows - len(self._earlier[0]) >= _KEPT:
            self._rows -= len(self._earlier.popleft())


def _end(batch: Batch) -> Batch:
    """The last rows of a batch and their bytes, which hold on to no more than themselves."""
    rows = batch.rows[-_KEPT:].copy()
    first = int(rows["at"][0])
    rows["at"] -= first
    return Batch(rows, batch.data[first:].copy())
