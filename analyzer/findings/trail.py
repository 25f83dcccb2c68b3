"""The rows before a row, across batches: what a rule looks back on when something is odd."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from typing import Final, NamedTuple

from ..frames import Batch, Kind, Row

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
        self._earlier: deque[Seen] = deque(maxlen=_KEPT)

    def back(self, batch: Batch, place: int) -> Iterator[Seen]:
        """The last rows before row number `place`, the nearest first."""
        for before in range(place - 1, max(place - 1 - _KEPT, -1), -1):
            yield Seen.of(batch, before)
        for i, earlier in enumerate(reversed(self._earlier)):
            if i >= _KEPT - place:
                return
            yield earlier

    def go_on(self, batch: Batch) -> None:
        """This batch is done."""
        for place in range(max(0, len(batch) - _KEPT), len(batch)):
            self._earlier.append(Seen.of(batch, place))
