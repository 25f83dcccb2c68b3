"""What changed for good about a unit, and when: one change point a series, in its hours.

A series is cut where that explains it best (the least sum of squares about two means rather than one), and told where
the difference is many times what the hours' own scatter makes likely. Where a tap only tells between what a response
time lies, the two means must not overlap.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, Final

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

_LEAST: Final = 6  # hours on either side of a change
_SIGMAS: Final = 6.0  # a change that hours' scatter alone makes once in far more series than a fleet has
_MS: Final = 0.5  # a change of less is nothing to anybody
_PERCENT: Final = 0.5
_Numbers = NDArray[np.float64]


def drifts(hours: Any) -> Any:
    """Changes, the surest first, of a table of hours sorted by site, line, unit and time."""
    rows = sorted(_changes(hours), key=lambda row: (-row["sigmas"], row["site"], row["line"], row["unit"]))
    schema = pa.schema(
        [
            ("site", pa.string()),
            ("line", pa.string()),
            ("unit", pa.uint8()),
            ("what", pa.string()),
            ("since", pa.timestamp("ns", "UTC")),
            ("before", pa.float64()),
            ("after", pa.float64()),
            ("sigmas", pa.float64()),
            ("hours", pa.int64()),
        ]
    )
    return pa.Table.from_pylist(rows, schema)


def _changes(hours: Any) -> Iterator[dict[str, Any]]:
    sites, lines = (hours.column(name).to_pylist() for name in ("site", "line"))
    units, asked, bad, timed, low, high = (
        hours.column(name).to_numpy().astype(np.float64) for name in ("unit", "asked", "bad", "timed", "low", "high")
    )
    times = hours.column("t_ns").cast(pa.timestamp("ns", "UTC")).cast(pa.int64()).to_numpy()
    keys = [*zip(sites, lines, units.tolist(), strict=True)]
    begins = [row for row in range(len(keys)) if not row or keys[row] != keys[row - 1]]
    for begin, end in zip(begins, [*begins[1:], len(keys)], strict=True):
        site, line, unit = keys[begin]
        about = {"site": site, "line": line, "unit": int(unit)}
        mine = slice(begin, end)
        known = timed[mine] > 0
        lows, highs = (each[mine][known] / timed[mine][known] / 1e6 for each in (low, high))
        yield from _change(about, "mean response time, ms", times[mine][known], lows, highs, _MS)
        known = asked[mine] > 0
        rates = 100 * bad[mine][known] / asked[mine][known]
        yield from _change(about, "bad answers, %", times[mine][known], rates, rates, _PERCENT)


def _change(
    about: dict[str, Any], what: str, times: NDArray[np.int64], low: _Numbers, high: _Numbers, least: float
) -> Iterator[dict[str, Any]]:
    values = (low + high) / 2
    count = len(values)
    if count < 2 * _LEAST:
        return
    sums = np.cumsum(values)
    n = np.arange(1, count)
    left, right = sums[:-1] / n, (sums[-1] - sums[:-1]) / (count - n)
    gain = n * (count - n) / count * (left - right) ** 2
    gain[: _LEAST - 1] = gain[count - _LEAST :] = -1
    at = int(gain.argmax()) + 1
    before, after = float(values[:at].mean()), float(values[at:].mean())
    rest = np.concatenate((values[:at] - before, values[at:] - after))
    scatter = float(np.sqrt((rest**2).sum() / (count - 2)))
    unsure = float((high - low).mean()) / 2
    change = abs(after - before)
    sigmas = change / max(scatter * np.sqrt(1 / at + 1 / (count - at)), 1e-9)
    if sigmas >= _SIGMAS and change >= least and change > 2 * unsure:
        yield {
            **about,
            "what": what,
            "since": int(times[at]),
            "before": round(before, 3),
            "after": round(after, 3),
            "sigmas": round(min(sigmas, 1e6), 1),
            "hours": count,
        }
