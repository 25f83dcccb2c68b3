"""Transactions counted by unit: what metrics and health say of it, in the words of the report."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from ...reports.summary import BY_STATUS
from ...tables.transactions import TransactionRows


@dataclass(frozen=True, slots=True, eq=False)
class UnitTraffic:
    """What one unit's transactions of a step add: counts by the names of `reports.model.Counts`, exceptions by code,
    and response times in ns."""

    unit: int
    counts: Counter[str]
    exceptions: Counter[int] = field(default_factory=Counter)
    times_ns: tuple[int, ...] = ()


def by_unit(settled: TransactionRows) -> Iterator[UnitTraffic]:
    """Settled transactions, a unit at a time."""
    for unit in np.unique(settled.unit).tolist():
        mine = settled[settled.unit == unit]
        counts = Counter(requests=len(mine))
        for name in ("retry", "late"):
            counts[{"retry": "retries"}.get(name, name)] = int(np.count_nonzero(mine.column(name)))
        for status, name in BY_STATUS.items():
            counts[name] = int(np.count_nonzero(mine.status == status))
        raised = Counter(mine.exception[mine.exception > 0].tolist())
        times = mine.response_ns[mine.response_ns >= 0]
        yield UnitTraffic(unit, counts, raised, tuple(times.tolist()))
