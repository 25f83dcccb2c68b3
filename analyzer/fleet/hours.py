"""A unit's hours: what became of its requests and how long it took, so that questions of a fleet read little."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from numpy.typing import NDArray

from ..tables.transactions import Status
from .datasets import HOURS

HOUR_NS: Final = 3_600_000_000_000
_STATUSES: Final = tuple(status.name.lower() for status in Status)
_UNITS: Final = 256
_COUNTS: Final = tuple(HOURS.names[2:])  # of them the last is a greatest, the others are sums


class UnitHours:
    """Transactions in, in the order of their requests; hours that are over out."""

    def __init__(self) -> None:
        self._open: dict[int, NDArray[np.int64]] = {}  # by the hour since the epoch: a row a unit

    def feed(self, transactions: Any) -> Any:
        """Take in a RecordBatch of the table `transactions`; the rows of hours that are over, as one of `HOURS`."""
        if not len(transactions):
            return _rows({})
        hours = transactions.column("t_start_ns").view(pa.int64()).to_numpy() // HOUR_NS
        for hour in np.unique(hours).tolist():
            table = self._open.setdefault(hour, np.zeros((_UNITS, len(_COUNTS)), np.int64))
            _count(table, transactions.filter(pa.array(hours == hour)))
        newest = max(self._open)
        return _rows({hour: self._open.pop(hour) for hour in sorted(self._open) if hour < newest - 1})

    def close(self) -> Any:
        """The rest."""
        rest, self._open = self._open, {}
        return _rows(dict(sorted(rest.items())))


def _count(table: NDArray[np.int64], part: Any) -> None:
    units = part.column("unit").to_numpy().astype(np.intp)

    def add(name: str, which: NDArray[Any]) -> None:
        np.add.at(table[:, _COUNTS.index(name)], units, which)

    add("requests", np.ones(len(units), np.int64))
    status = part.column("status")
    for name in _STATUSES:
        add(name, pc.equal(status, name).to_numpy(zero_copy_only=False).astype(np.int64))
    for name, column in (("retries", "retry"), ("late", "late")):
        add(name, part.column(column).to_numpy(zero_copy_only=False).astype(np.int64))
    low, high = part.column("response_time_low_ns"), part.column("response_time_high_ns")
    add("timed", pc.is_valid(low).to_numpy(zero_copy_only=False).astype(np.int64))
    highs = pc.fill_null(high, 0).to_numpy()
    add("response_time_low_sum_ns", pc.fill_null(low, 0).to_numpy())
    add("response_time_high_sum_ns", highs)
    np.maximum.at(table[:, _COUNTS.index("response_time_high_max_ns")], units, highs)


def _rows(hours: dict[int, NDArray[np.int64]]) -> Any:
    units = {hour: np.flatnonzero(table[:, 0]) for hour, table in hours.items()}
    t_ns = np.concatenate([np.zeros(0, np.int64), *(np.full(len(u), hour * HOUR_NS) for hour, u in units.items())])
    counts = np.concatenate([np.zeros((0, len(_COUNTS)), np.int64), *(hours[hour][u] for hour, u in units.items())])
    numbers = np.concatenate([np.zeros(0, np.uint8), *(u.astype(np.uint8) for u in units.values())])
    columns = [pa.array(t_ns).view(HOURS.field("t_ns").type), pa.array(numbers)]
    columns += [pa.array(np.ascontiguousarray(counts[:, i])) for i in range(len(_COUNTS))]
    return pa.record_batch(columns, schema=HOURS)
