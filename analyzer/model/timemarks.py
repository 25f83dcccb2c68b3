"""Round times of day along a span, for an axis."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import tzinfo
from typing import Final

from ..words import moment_of

_SECOND_NS: Final = 1_000_000_000
_DAY_S: Final = 86_400
_STEPS_S: Final = (
    60, 120, 300, 600, 900, 1800, 3600, 7200, 10_800, 21_600, 43_200,
    *(_DAY_S * days for days in (1, 2, 7, 14, 28, 56, 112, 365)),
)  # fmt: skip


def time_marks(begin_ns: int, end_ns: int, most: int, zone: tzinfo) -> Iterator[tuple[int, str]]:
    """Some times of the span, about `most` of them at most, with what to call them: `08:30`, or at midnight `11-21`."""
    wide = (end_ns - begin_ns) / _SECOND_NS / max(1, most)
    step = next((step for step in _STEPS_S if step >= wide), _STEPS_S[-1])
    offset = moment_of(begin_ns / _SECOND_NS, zone).utcoffset()
    ahead = 0 if offset is None else int(offset.total_seconds())
    at = -(-(begin_ns // _SECOND_NS + ahead) // step) * step - ahead
    while at * _SECOND_NS <= end_ns:
        moment = moment_of(at, zone)
        yield at * _SECOND_NS, f"{moment:%m-%d}" if (at + ahead) % _DAY_S == 0 else f"{moment:%H:%M}"
        at += step
