"""What is kept beside the table of rows, row by row.

Their bytes, kept once and in row order; why their boundaries stand where they do, in 15 bytes a row; and how long their
bits took, where a capture has edges, and by that how fast senders' clocks are.
"""

from __future__ import annotations

import threading
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..reports.rates import RateTable, bit_times
from ..tables.schema import Kind
from .table import NO_EVIDENCE, RowTable

if TYPE_CHECKING:
    from captures.edges.source import BitSpans

    from ..tables.batch import Batch
    from ..tables.schema import Rows

_BYTES: Final = 1 << 20


class ByteStore:
    """Bytes end to end, in blocks of 1 MiB."""

    def __init__(self) -> None:
        self._blocks: list[NDArray[np.uint8]] = []
        self.size = 0

    def append(self, data: NDArray[np.uint8]) -> int:
        """Add bytes; where they begin."""
        begin, written = self.size, 0
        while written < len(data):
            offset = (begin + written) % _BYTES
            if offset == 0:
                self._blocks.append(np.empty(_BYTES, np.uint8))
            size = min(_BYTES - offset, len(data) - written)
            self._blocks[-1][offset : offset + size] = data[written : written + size]
            written += size
        self.size = begin + len(data)
        return begin

    def get(self, at: int, length: int) -> NDArray[np.uint8]:
        """`length` bytes from `at`; a view where they lie in one block."""
        number, offset = divmod(at, _BYTES)
        if offset + length <= _BYTES:
            return self._blocks[number][offset : offset + length] if length else np.empty(0, np.uint8)
        parts = []
        while length > 0:
            size = min(_BYTES - offset, length)
            parts.append(self._blocks[number][offset : offset + size])
            length, number, offset = length - size, number + 1, 0
        return np.concatenate(parts)

    @property
    def nbytes(self) -> int:
        """Memory of the blocks."""
        return len(self._blocks) * _BYTES


_STEPS: Final = 8  # of a bit
_MOST: Final = np.iinfo(np.int16).max
_WEIGHTS: Final = ("length", "crc", "silence", "conversation", "margin")


class RowEvidence(NamedTuple):
    """Bits for this reading of the bytes (log2 of a likelihood ratio), `margin` over the best one without the row.

    The runner-up is what would stand here instead: noise where `rival_kind` says so, else `rival_length` bytes from
    `rival_start` on, an offset in the port's stream.
    """

    length: float
    crc: float
    silence: float
    conversation: float
    margin: float
    rival_kind: Kind
    rival_start: int
    rival_length: int


def evidence_columns(batch: Batch) -> dict[str, NDArray[Any]]:
    """A batch's evidence as columns of the table."""
    n, why = len(batch), batch.evidence
    if why is None:
        none: dict[str, NDArray[Any]] = {f"why_{name}": np.full(n, NO_EVIDENCE, np.int16) for name in _WEIGHTS}
        return {**none, "rival_start": np.zeros(n, np.int16), "rival_length": np.zeros(n, np.uint16),
                "rival_kind": np.zeros(n, np.uint8)}  # fmt: skip
    columns: dict[str, NDArray[Any]] = {}
    for name in _WEIGHTS:
        eighths = np.nan_to_num(why.column(name).astype(np.float64) * _STEPS, posinf=_MOST, neginf=-_MOST)
        columns[f"why_{name}"] = np.clip(np.round(eighths), -_MOST, _MOST).astype(np.int16)
    framed = (why.rival_start >= 0) & (why.rival_kind != Kind.NOISE)
    ahead = np.where(framed, why.rival_start - batch.rows.start, 0)
    near = framed & (np.abs(ahead) <= _MOST)
    columns["rival_start"] = np.where(near, ahead, 0).astype(np.int16)
    columns["rival_length"] = np.where(near, np.clip(why.rival_length, 0, (1 << 16) - 1), 0).astype(np.uint16)
    columns["rival_kind"] = np.where(near, why.rival_kind, Kind.NOISE).astype(np.uint8)
    return columns


def evidence_of(table: RowTable, row: int) -> RowEvidence | None:
    """A row's evidence; None where none was kept."""
    if table.value("why_margin", row) == NO_EVIDENCE:
        return None
    length, crc, silence, conversation, margin = (table.value(f"why_{name}", row) / _STEPS for name in _WEIGHTS)
    start = table.value("start", row) + table.value("rival_start", row)
    kind, size = Kind(table.value("rival_kind", row)), table.value("rival_length", row)
    return RowEvidence(length, crc, silence, conversation, margin, kind, start, size)


_NONE = np.zeros((2, 0), np.int64)


class RowBits:
    """Made before the pass over the bytes that it takes part in. One thread feeds, any may ask."""

    def __init__(self, spans: BitSpans) -> None:
        spans.want()
        self._spans = spans
        self._taken = [_NONE]
        self._lock = threading.Lock()
        self.of_all = self.rates()

    def feed(self, rows: Rows) -> None:
        """The rows that come next."""
        taken = bit_times(self._spans, rows)
        with self._lock:
            self._taken.append(taken)
        self.of_all.feed(rows, taken)

    def rates(self) -> RateTable:
        """An empty table, for some of the rows."""
        return RateTable(self._spans.bauds)

    def take(self, rows: NDArray[np.int64]) -> NDArray[np.int64]:
        """Of these rows as `bit_times` has it."""
        with self._lock:
            if len(self._taken) > 1:
                self._taken = [np.concatenate(self._taken, axis=1)]
            return self._taken[0][:, rows]
