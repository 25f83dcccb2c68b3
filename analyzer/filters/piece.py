"""Some rows of a table while a filter looks at them; what is dear to make is made once, and only if it is asked for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..columns import Decoded, decode
from ..frames import Batch, Kind
from .held import Mask, Several, Values, Words
from .table import Table

BLOCK: Final = 1 << 14  # rows whose bytes are fetched at once


class Piece:
    """Rows `first` to `last` (excluded) of a table."""

    def __init__(self, table: Table, first: int, last: int) -> None:
        self.table = table
        self.first = first
        self.last = last
        self._blocks: dict[int, Piece] = {}

    def __len__(self) -> int:
        return self.last - self.first

    def column(self, name: str) -> NDArray[Any]:
        """One of the table's columns."""
        return self.table.column(name)[self.first : self.last]

    @cached_property
    def frames(self) -> Mask:
        """Which rows are frames."""
        found: Mask = self.column("kind") != Kind.NOISE
        return found

    def found(self) -> tuple[NDArray[np.integer[Any]], NDArray[np.integer[Any]]]:
        """Rows with findings, and the rule of each."""
        rows, rules = self.table.findings()
        low, high = np.searchsorted(rows, (self.first, self.last))
        return rows[low:high] - self.first, rules[low:high]

    def block(self, number: int) -> Piece:
        """`BLOCK` of its rows, kept as long as the piece."""
        if number not in self._blocks:
            first = self.first + number * BLOCK
            self._blocks[number] = Piece(self.table, first, min(first + BLOCK, self.last))
        return self._blocks[number]

    @cached_property
    def batch(self) -> Batch:
        """The rows with their bytes."""
        return self.table.batch(self.first, self.last)

    @cached_property
    def decoded(self) -> Decoded:
        """Their addresses and values."""
        return decode(self.batch)

    @cached_property
    def each(self) -> Each:
        """Their values one by one."""
        decoded = self.decoded
        counts = np.diff(decoded.offsets)
        rows = np.repeat(np.arange(len(counts)), counts)
        first = decoded.value_address.astype(np.int64)[rows]
        address = np.where(first < 0, -1, first + np.arange(len(rows)) - decoded.offsets[rows])
        return Each(rows, len(counts), address, decoded.area[rows], decoded.values)

    def summaries(self, asked: Mask | None) -> Words:
        """The words of those frames that are asked for."""
        wanted = self.frames if asked is None else self.frames & asked
        rows = np.flatnonzero(wanted)
        known: dict[tuple[int, bytes, bytes | None], str] = {}  # polls say the same again and again
        texts = []
        for row in rows.tolist():
            frame = self.batch.frame(row)
            key = (frame.row.kind, frame.captured, frame.request_bytes)
            if key not in known:
                known[key] = frame.summary()
            texts.append(known[key])
        return Words(texts, rows, len(self))


@dataclass(frozen=True, slots=True, eq=False)
class Each:
    """Single values: the row of each among `count`, its address (-1 unknown), its area and itself."""

    rows: NDArray[np.intp]
    count: int
    address: NDArray[np.int64]
    area: NDArray[np.uint8]
    value: NDArray[np.uint16]

    def several(self, each: Values) -> Several:
        """A field of them as one of their rows."""
        return Several(each, self.rows, self.count)
