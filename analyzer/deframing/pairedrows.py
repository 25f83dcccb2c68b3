"""Rows that were paired by header, as the third witness looks at them: whose lane they are on, and what marks them."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np

from ..tables.schema import Int64s, Kind, Protocol
from .segments import UnorderedRows
from .wireorder import Across

Lane = int  # a unit behind a port: port * 256 + unit
NO_LANE: Final = -1


class PairedRows(NamedTuple):
    """Rows in wire order, numbered and paired by header; of each the port that asks, and by how much clocks may lie."""

    loose: UnorderedRows
    asker: Int64s
    unsure_ns: Int64s

    @classmethod
    def of(cls, loose: UnorderedRows, across: Across | None) -> PairedRows:
        """`across`: of two ports that carry one direction each."""
        asker = loose.rows.port.astype(np.int64)
        unsure = np.full(len(asker), -1, np.int64)
        if across is not None:
            asker[across.answers] = across.requests
            unsure[across.answers] = across.unsure_ns[across.answers]
        return cls(loose, asker, unsure)

    @classmethod
    def joined(cls, parts: list[PairedRows]) -> PairedRows:
        """All of these, in order."""
        parts = [part for part in parts if len(part.asker)]
        if len(parts) < 2:
            return parts[0] if parts else cls.of(UnorderedRows.nothing(), None)
        own = [part.loose.placed_anew() for part in parts]  # joining moves them, and others look at them
        return cls(
            UnorderedRows.joined(own),
            np.concatenate([part.asker for part in parts]),
            np.concatenate([part.unsure_ns for part in parts]),
        )

    def cut(self, first: int, last: int) -> PairedRows:
        """Those from one to another (excluded)."""
        if first == 0 and last == len(self.asker):
            return self
        return PairedRows(self.loose.picked(np.arange(first, last)), self.asker[first:last], self.unsure_ns[first:last])


def marks_of(paired: PairedRows) -> Int64s:
    """By what frames in RTU mode are compared: length and CRC; those of other rows are all different."""
    rows, data = paired.loose.rows, paired.loose.data
    ends = rows.at + rows.length
    marks = rows.length << 16 | data.take(ends - 2, mode="clip").astype(np.int64) << 8 | data.take(ends - 1)
    plain: Int64s = np.where(rows.protocol == Protocol.RTU, marks, -2 - rows.index)
    return plain


def lanes_of(paired: PairedRows) -> Int64s:
    """The lane of each row: a whole frame to or from one unit on a serial line; of any other none."""
    rows = paired.loose.rows
    serial = rows.check & (rows.kind != Kind.NOISE) & (rows.unit != 0) & (rows.protocol != Protocol.TCP)
    lanes: Int64s = np.where(serial, paired.asker << 8 | rows.unit, NO_LANE)
    return lanes
