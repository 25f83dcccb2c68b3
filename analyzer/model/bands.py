"""What happened when, a row each: causes, whatever a filter keeps, units; counts in equal bins of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..languages import tr
from ..tables.findings import Severity
from ..tables.schema import Kind
from .table import PIECE

if TYPE_CHECKING:
    from .bus import Bus
    from .selection import Test

_UNITS = 256


class Band(NamedTuple):
    """Rows that ended in each bin, and how many of them a warning or an error stands on; `cause`: see `bands`."""

    name: str
    counts: NDArray[np.int64]
    troubles: NDArray[np.int64]
    cause: int | None = None


def bands(
    bus: Bus,
    scope: Sequence[Test],
    span: tuple[int, int],
    bins: int,
    named: Sequence[tuple[str, Test]],
    causes: Sequence[NDArray[np.int64]] = (),
    stop: Callable[[], bool] = bool,
) -> list[Band]:
    """A band for each cause that shows in the span, each of the kept tests, and each unit, of rows that pass the scope.

    A unit that only damaged frames speak of is none: their unit may be what was damaged.
    `causes` are the rows that show each (`explained.rows_of_causes`); a band has the number of its cause.
    """
    t_start, t_end = span
    width = max(t_end - t_start, 1) / bins
    by_unit = np.zeros((2, _UNITS, bins), np.int64)
    by_test = np.zeros((2, len(named), bins), np.int64)
    by_cause = np.zeros((len(causes), bins), np.int64)
    first, last = bus.table.row_at_time(t_start), bus.table.row_at_time(t_end) + 1
    for number, low, high in bus.table.slices(first, min(last, bus.count)):
        if stop():
            break
        unit, kind, mark, ends = (
            bus.table.column(number, name)[low:high] for name in ("unit", "kind", "mark", "t_end_ns")
        )
        slots = ((ends - t_start) // width).astype(np.int64)
        inside = (slots >= 0) & (slots < bins)
        for test in scope:
            inside &= test(bus, number, low, high)
        grave = mark >= Severity.WARNING
        framed = inside & (kind != Kind.NOISE)
        for i, wanted in enumerate((framed, framed & grave)):
            keys = unit[wanted].astype(np.int64) * bins + slots[wanted]
            by_unit[i] += np.bincount(keys, minlength=_UNITS * bins).reshape(_UNITS, bins)
        for k, (_, test) in enumerate(named):
            passed = inside & test(bus, number, low, high)
            for i, wanted in enumerate((passed, passed & grave)):
                by_test[i, k] += np.bincount(slots[wanted], minlength=bins)
        for k, rows in enumerate(causes):
            begin, end = np.searchsorted(rows, (number * PIECE + low, number * PIECE + high))
            own = rows[begin:end] - (number * PIECE + low)
            by_cause[k] += np.bincount(slots[own[inside[own]]], minlength=bins)
    units = np.flatnonzero(by_unit[0].any(axis=1) & bus.units.heard).tolist()
    return [
        *(
            Band(tr("cause {number}", number=k + 1), counts, counts, k)
            for k, counts in enumerate(by_cause)
            if counts.any()
        ),
        *(Band(name, by_test[0, k], by_test[1, k]) for k, (name, _) in enumerate(named)),
        *(Band(tr("unit {number}", number=unit), by_unit[0, unit], by_unit[1, unit]) for unit in units),
    ]
