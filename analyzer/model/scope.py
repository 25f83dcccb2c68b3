"""What the user narrows the capture to, and the figures of what is left."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ..core import Analysed
from ..reports.summary import Summary
from ..tables.columns import decode
from ..tables.findings import NOTHING
from ..tables.schema import Kind
from .activity import Bins, UnitActivity, binned
from .polls import ChangedAnswers
from .pollwatch import PollLog
from .registers import RegisterLog
from .selection import (
    Selection,
    Test,
    both,
    frames_only,
    in_span,
    remembered,
    transactions,
    transactions_with,
)
from .table import PIECE

if TYPE_CHECKING:
    from ..reports.model import Report
    from .bus import Bus
    from .selection import CompiledTest
    from .source import ViewSource

_AT_ONCE = 1 << 13  # rows
_LAG = 64  # rows: by then what was found about one is known, as a rule


@dataclass
class Scope:
    """The one scope that all views obey: a filter, a span of time; and what lists show of it."""

    filter: CompiledTest | None = None
    span: tuple[int, int] | None = None  # ns
    hide_noise: bool = False
    only_changed: bool = False  # of the transactions

    @property
    def narrows(self) -> bool:
        """Whether rows are left out, noise apart."""
        return self.filter is not None or self.span is not None

    @property
    def settled(self) -> bool:
        """Whether it asks for what is only known once later rows have come."""
        return self.filter is not None and self.filter.settled

    def words(self) -> tuple[object, ...]:
        """What tells it from another one."""
        return None if self.filter is None else self.filter.text, self.span, self.hide_noise

    def tests(self) -> list[Test]:
        """What a row must pass; nothing where all are wanted."""
        tests: list[Test] = []
        if self.hide_noise:
            tests.append(frames_only)
        if self.span is not None:
            tests.append(in_span(*self.span))
        if self.filter is not None:
            tests.append(self.filter.test)
        return tests

    def selections(self, bus: Bus) -> tuple[Selection | None, Selection]:
        """The rows that it leaves, None for all; and the rows that begin transactions with a row that passes.

        One thread extends both, piece by piece in turn.
        """
        tests = self.tests()
        passes = remembered(both(tests))
        rows = Selection(bus, passes, lag=_LAG if self.settled else 0) if tests else None
        begins = transactions_with(passes) if self.narrows else transactions
        if self.only_changed:
            begins = both([ChangedAnswers(), begins])
        return rows, Selection(bus, begins, lag=_LAG if self.narrows or self.only_changed else 0)


class ScopedFigures:
    """The figures of some rows, as `Bus` has them of all: `rows` with what belongs to their transactions."""

    def __init__(self, bus: Bus, rows: NDArray[np.int64], stop: Callable[[], bool] = bool) -> None:
        self._bus = bus
        partner = bus.table.take_column("partner", rows).astype(np.int64)
        self.rows = np.union1d(rows, partner[partner >= 0])
        self.registers = RegisterLog()
        self.units = UnitActivity()
        self.watched = PollLog()
        self.frames = int((bus.table.take_column("kind", self.rows) != Kind.NOISE).sum())
        self._complete = bus.whole
        self._summary = Summary(bus.char_ns)
        self._rates = None if bus.bits is None else bus.bits.rates()
        first = 0
        while first < len(self.rows) and not stop():
            last = int(np.searchsorted(self.rows, (self.rows[first] // PIECE + 1) * PIECE))
            self._add(bus, self.rows[first : min(last, first + _AT_ONCE)])
            first = min(last, first + _AT_ONCE)

    def _add(self, bus: Bus, part: NDArray[np.int64]) -> None:
        batch = bus.batch(part)
        requests = part[batch.rows.kind == Kind.REQUEST]
        findings = NOTHING if batch.findings is None else batch.findings
        self._summary.feed(Analysed(batch, bus.transactions(requests), findings))
        if bus.bits is not None and self._rates is not None:
            self._rates.feed(batch.rows, bus.bits.take_bit_times(part))
        settled, decoded = bus.transactions(requests), decode(batch)
        self.registers.feed(batch, part, decoded)
        self.watched.feed(batch, part, decoded, bus.table.take_column("partner", part).astype(np.int64))
        self.watched.settle(bus.table.rows_of_frames(settled.request), settled)
        self.units.feed(batch.rows)

    def over(self, t_start: int, t_end: int, bins: int) -> Bins:
        """How busy these rows made a span, in equal bins."""
        return binned(self._bus, self.rows, t_start, t_end, bins)

    def report(self, source: ViewSource, *, story: bool = False) -> Report:  # noqa: ARG002 - a part tells none
        """These rows on one page."""
        return self._bus.page(self._summary, self._rates, source, partial=not self._complete)
