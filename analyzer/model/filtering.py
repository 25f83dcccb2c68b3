"""The display filter on the model's own columns; `analyzer.filters` is the language."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.adu import CRC_SIZE
from dissectors.maps.units import UnitMaps

from ..filters import RowOctets, compile_filter
from ..tables.batch import Batch
from ..tables.schema import Kind, Protocol
from ..tables.transactions import Status
from .bus import Bus
from .selection import Test
from .table import PIECE, RowState

EXAMPLES = (
    "unit == 17 and function in (3, 4)",
    "exception or crc_ok == false",
    'finding == "late-response"',
    "register == 40108 and value > 1000",
    "response_time > 50ms",
    "gap > 3.5 chars",
    'hex contains "03 02"',
    "not noise",
)


class CompiledTest(NamedTuple):
    """A filter as a test of rows; `settled`: it asks for what is only known once later rows have come."""

    text: str
    test: Test
    settled: bool


def compiled(text: str, line: LineSettings, charts: UnitMaps | None = None) -> CompiledTest:
    """A filter for the rows of a line; `charts` are the maps of units, for `value("NAME")` and `name`. FilterError."""
    row_filter = compile_filter(text, line, charts)
    mask = row_filter.mask

    def test(bus: Bus, number: int, low: int, high: int) -> NDArray[np.bool_]:
        return mask(PieceTable(bus, number, low, high))

    return CompiledTest(text, test, row_filter.settled)


class PieceTable:
    """Rows `low` to `high` (excluded) of a piece of the model, as a filter asks about them."""

    def __init__(self, bus: Bus, number: int, low: int, high: int) -> None:
        self._bus = bus
        self._number, self._low, self._high = number, low, high
        self._first = number * PIECE + low

    @property
    def line(self) -> LineSettings:
        return self._bus.line

    @property
    def origin_ns(self) -> int:
        return self._bus.t_first

    def __len__(self) -> int:
        return self._high - self._low

    def column(self, name: str) -> NDArray[Any]:
        """A value a row."""
        if name == "index":
            return np.where(self._own("kind") != Kind.NOISE, self._own("frame").astype(np.int64), -1)
        if name == "retry":
            return (self._own("state") & RowState.RETRY).astype(np.bool_)
        if name == "unanswered":
            silent: NDArray[np.bool_] = self._own("state") & RowState.STATUS == Status.UNANSWERED + 1
            return silent
        if name == "late":
            return self._late()
        return self._own(name)

    def _own(self, name: str) -> NDArray[Any]:
        return self._bus.table.column(self._number, name)[self._low : self._high]

    def _late(self) -> NDArray[np.bool_]:
        """Answers to requests that were answered late; the request knows."""
        partner = self._own("partner").astype(np.int64)
        late = np.zeros(len(self), np.bool_)
        answers = np.flatnonzero((partner >= 0) & (self._own("kind") == Kind.RESPONSE))
        late[answers] = self._bus.table.take("state", partner[answers]) & RowState.LATE != 0
        return late

    def findings(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Rows with findings, ascending, and the rule of each."""
        rows, rules = self._bus.found.rules(self._first, self._first + len(self))
        return rows - self._first, rules

    def batch(self, first: int, last: int) -> Batch:
        """Some of the rows, as far as it takes to read their bytes."""
        return self._bus.contents(np.arange(self._first + first, self._first + last)) if last > first else Batch.empty()

    def octets(self, first: int, last: int) -> RowOctets | None:
        """Their bytes, where no row spells them as digits."""
        protocols = self._own("protocol")[first:last]
        if not len(protocols) or (protocols == Protocol.ASCII).any():
            return None
        at = self._own("at")[first:last].astype(np.int64)
        lengths = self._own("length")[first:last].astype(np.int64)
        data = self._bus.store.get(int(at[0]), int(at[-1] + lengths[-1] - at[0]))
        at -= at[0]
        ends = at + lengths
        ends[protocols == Protocol.RTU] -= CRC_SIZE
        return RowOctets(data, at + 1, ends, lambda rows: self._some(first, rows))

    def _some(self, first: int, rows: NDArray[np.intp]) -> tuple[Batch, NDArray[np.intp]]:
        """Some rows, and the requests in this piece that they answer, with their numbers; these count from `first`."""
        first += self._low
        slots = first + rows
        kinds, partners = (self._bus.table.stretch(self._number, name, slots) for name in ("kind", "partner"))
        requests = partners[kinds == Kind.RESPONSE].astype(np.int64) - self._number * PIECE
        chosen = np.zeros(self._high, np.bool_)
        chosen[slots] = chosen[requests[requests >= 0]] = True
        slots = np.flatnonzero(chosen)
        return self._bus.contents(slots + self._number * PIECE), slots - first
