"""Answers that the client stores under the registers of another request: how many, since when, of which polls."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Final

from ..tables.batch import Batch, adu_of
from ..tables.schema import Kind

_POLLS: Final = 64  # of a unit, that are named
_SERIES_NS: Final = 10_000_000_000  # longer ago: another series
_EXAMPLES: Final = 6
_READS: Final = {1: "coil", 2: "discrete", 3: "holding", 4: "input"}


@dataclass(slots=True)
class UnitShifts:
    """Of one unit."""

    displaced: int = 0  # answers
    values: int = 0  # registers or bits in them
    series: int = 0
    unsure: int = 0  # answers of which nobody can tell whose they are
    first_ns: int = 0
    last_ns: int = 0
    begun: int = 0  # index of the first such answer
    frames: list[int] = field(default_factory=list)  # some of them
    polls: dict[tuple[str, int, int], int] = field(default_factory=dict)  # area, address, quantity: answers under it


@dataclass(slots=True)
class ShiftLedger:
    """Batches in; what was displaced, by unit."""

    units: dict[int, UnitShifts] = field(default_factory=dict)
    _asked: dict[int, bytes] = field(default_factory=dict)  # the newest requests by their start

    def feed(self, batch: Batch) -> None:
        """The next rows."""
        rows = batch.rows
        odd = ((rows.taken_for_start >= 0) | rows.unsure).nonzero()[0].tolist()
        requests = ((rows.kind == Kind.REQUEST) & rows.check).nonzero()[0]
        for row in requests[0 if odd else -_POLLS :].tolist():
            self._asked.pop(int(rows.start[row]), None)
            self._asked[int(rows.start[row])] = batch.bytes_of(row)
        for row in odd:
            self._count(batch, row)
        for start in list(self._asked)[:-_POLLS]:
            del self._asked[start]

    def _count(self, batch: Batch, row: int) -> None:
        rows = batch.rows
        mine = self.units.setdefault(int(rows.unit[row]), UnitShifts())
        if rows.unsure[row]:
            mine.unsure += 1
            return
        asked = self._asked.get(int(rows.taken_for_start[row]), b"")
        if asked == self._asked.get(int(rows.request_start[row])):
            return  # repeated: its values stand under the right registers
        now = int(rows.t_start_ns[row])
        if not mine.displaced:
            mine.first_ns, mine.begun = now, int(rows.index[row])
        mine.series += not mine.displaced or now - mine.last_ns > _SERIES_NS
        mine.displaced += 1
        mine.last_ns = now
        if len(mine.frames) < _EXAMPLES:
            mine.frames.append(int(rows.index[row]))
        taken = adu_of(asked, int(rows.protocol[row])).data
        if len(taken) >= _EXAMPLES and taken[1] in _READS:
            address, quantity = int.from_bytes(taken[2:4]), int.from_bytes(taken[4:6])
            mine.values += quantity
            poll = _READS[taken[1]], address, quantity
            if poll in mine.polls or len(mine.polls) < _POLLS:
                mine.polls[poll] = mine.polls.get(poll, 0) + 1
