"""What happened hour by hour: for captures of days, in flat memory."""

from __future__ import annotations

from collections import Counter, defaultdict
from typing import TYPE_CHECKING, Final

import numpy as np

from ..languages import grouped, page_words
from ..tables.findings import Severity, described
from ..tables.transactions import Status
from ..words import is_clock, moment
from .model import Counts, HourRow

if TYPE_CHECKING:
    from captures.line import LineSettings

    from ..core import Analysed

_HOUR_NS: Final = 3_600_000_000_000
_MOST: Final = 10_000  # hours: more than a year
_BY_STATUS: Final = {
    Status.ANSWERED: "answered",
    Status.EXCEPTION: "exceptions",
    Status.UNANSWERED: "unanswered",
    Status.BROADCAST: "broadcasts",
    Status.DAMAGED: "damaged",
    Status.UNHEARD: "unheard",
}


class HourTable:
    """Batches in, rows of hours out; hours in which nothing was recorded have none."""

    def __init__(self, line: LineSettings) -> None:
        self._character_ns = line.character_ns
        self._counts: defaultdict[int, Counter[str]] = defaultdict(Counter)
        self._findings: defaultdict[int, Counter[str]] = defaultdict(Counter)
        self._bytes: Counter[int] = Counter()
        self._begin: int | None = None
        self._end = 0

    def feed(self, analysed: Analysed) -> None:
        """The next batch with what was said of it."""
        rows, settled = analysed.batch.rows, analysed.transactions
        if len(rows):
            times = rows.t_end_ns
            if self._begin is None:
                self._begin = int(rows.t_start_ns[0])
            self._end = max(self._end, int(times.max()))
            hours, where = np.unique(times // _HOUR_NS, return_inverse=True)
            octets = np.bincount(where, rows.length)
            for hour, count in zip(hours[:_MOST].tolist(), octets.tolist(), strict=False):
                self._bytes[hour] += int(count)
        hours_of = settled.t_start_ns // _HOUR_NS
        for hour in np.unique(hours_of).tolist() if len(self._counts) < _MOST else ():
            mine, counts = settled[hours_of == hour], self._counts[hour]
            counts["requests"] += len(mine)
            counts["retries"] += int(mine.retry.sum())
            counts["late"] += int(mine.late.sum())
            for status, name in _BY_STATUS.items():
                counts[name] += int(np.count_nonzero(mine.status == status))
        for finding in described(analysed.findings):
            if finding.severity is not Severity.NOTE and finding.start >= 0:
                self._findings[finding.t_ns // _HOUR_NS][finding.code] += 1

    def rows(self) -> tuple[HourRow, ...]:
        """The hours, in order."""
        hours = []
        for hour in sorted(set(self._bytes) | set(self._counts)):
            begin = max(hour * _HOUR_NS, self._begin or 0)
            span = min((hour + 1) * _HOUR_NS, self._end) - begin
            load = self._bytes[hour] * self._character_ns / span if self._character_ns and span > 0 else None
            commonest = self._findings[hour].most_common(1)
            finding = f"{commonest[0][0]} x {grouped(commonest[0][1])}" if commonest else ""
            counts = Counts(**dict(self._counts[hour]))
            hours.append(HourRow(self._name(hour), begin, counts, None if load is None else min(load, 1.0), finding))
        return tuple(hours)

    def _name(self, hour: int) -> str:
        if is_clock(hour * _HOUR_NS):
            return moment(hour * _HOUR_NS)[:13] + ":00"
        return page_words("hour {number}", number=hour - (self._begin or 0) // _HOUR_NS + 1)
