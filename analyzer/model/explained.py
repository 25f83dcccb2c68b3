"""Findings by the cause that explains them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..causes.links import cause_of
from ..tables.findings import codes

if TYPE_CHECKING:
    from ..causes.model import Cause
    from .bus import Bus

_UNIT = 0xFFFF  # of a key: unit + 1, 0 for the bus as a whole


class ExplainedFindings(NamedTuple):
    """What one cause explains, or (`cause` None) none does: numbers of findings by code, the most frequent first.

    `cause` is its number among those asked about; the findings of a code are in the order of their rows.
    """

    cause: int | None
    by_code: Mapping[str, NDArray[np.int64]]


def by_cause(bus: Bus, numbers: NDArray[np.int64], causes: Sequence[Cause]) -> list[ExplainedFindings]:
    """Some findings by cause: of each cause, best first, what it explains of them, then what none explains."""
    log, table, names = bus.found, bus.table, codes()
    rows = log.rows_of(numbers).astype(np.int64)
    units = np.where(rows >= 0, table.take("unit", np.maximum(rows, 0)).astype(np.int64), -1)
    keys = log.rules_of(numbers).astype(np.int64) << 16 | units + 1
    groups: dict[int | None, dict[str, list[NDArray[np.int64]]]] = {}
    for key in np.unique(keys).tolist():
        code, unit = names[key >> 16], (key & _UNIT) - 1
        cause = cause_of(code, None if unit < 0 else unit, causes)
        groups.setdefault(cause, {}).setdefault(code, []).append(numbers[keys == key])
    explained = []
    for which in [*range(len(causes)), None]:
        parts = {code: np.sort(np.concatenate(each)) for code, each in groups.get(which, {}).items()}
        if which is None and not parts:
            continue
        ordered = sorted(parts.items(), key=lambda each: -len(each[1]))
        by_code = {code: each[np.argsort(log.rows_of(each), kind="stable")] for code, each in ordered}
        explained.append(ExplainedFindings(which, by_code))
    return explained


def rows_of_causes(bus: Bus, causes: Sequence[Cause]) -> list[NDArray[np.int64]]:
    """The rows that the findings stand on which each cause explains, ascending."""
    if not causes:
        return []
    rows = [np.zeros(0, np.int64) for _ in causes]
    for explained in by_cause(bus, np.arange(bus.found.count), causes):
        if explained.cause is not None and explained.by_code:
            numbers = np.concatenate(list(explained.by_code.values()))
            on = np.unique(bus.found.rows_of(numbers).astype(np.int64))
            rows[explained.cause] = on[on >= 0]
    return rows
