"""Times that never decrease, made of times that sometimes do.

Within a port a later read has a later time. A source that breaks this is mended, and what was done is said: a small
step back (two clocks, a rounded log) is held at the time before; a step of over a second (a clock that was set, two
logs in one file) shifts all that follows, so that the gaps after it stay true, as far as times go.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from .limits import TIME_LIMIT

CLOCK_STEP_NS = 1_000_000_000


@dataclass(slots=True)
class _Disorder:
    """One kind of disorder: how often, and where first."""

    count: int = 0
    chunk: int = 0
    back_ns: int = 0

    def add(self, where: NDArray[np.bool_], chunk: NDArray[np.int64], change: NDArray[np.int64]) -> None:
        rows = np.flatnonzero(where)
        if len(rows) and not self.count:
            self.chunk, self.back_ns = int(chunk[rows[0]]), -int(change[rows[0]])
        self.count += len(rows)

    @property
    def times(self) -> str:
        return "once" if self.count == 1 else f"{self.count} times, first"


@dataclass(slots=True)
class TimeOrder:
    """Mends the times of one pass over a capture, block after block."""

    _chunks: int = 0
    _raw: dict[int, int] = field(default_factory=dict)  # newest time of each port, as it came
    _given: dict[int, int] = field(default_factory=dict)  # and as it was passed on
    _shift: dict[int, int] = field(default_factory=dict)  # what steps of the clock have added up to
    _late: _Disorder = field(default_factory=_Disorder)
    _steps: _Disorder = field(default_factory=_Disorder)
    _beyond: _Disorder = field(default_factory=_Disorder)

    def mend(self, t_ns: NDArray[np.int64], port: NDArray[np.uint8]) -> NDArray[np.int64]:
        """The times of the next block's chunks (not none), not decreasing within a port; the same array if in order."""
        first, self._chunks = self._chunks, self._chunks + len(t_ns)
        mended = t_ns
        ports = np.flatnonzero(np.bincount(port)).tolist()
        for number in ports:
            at = np.arange(len(t_ns)) if len(ports) == 1 else np.flatnonzero(port == number)
            raw = t_ns[at]
            before = self._raw.get(number, int(raw[0]))
            change = np.diff(raw, prepend=before)
            ordered = raw
            if self._shift.get(number) or change.min() < 0 or raw[0] < self._given.get(number, before):
                ordered = self._in_order(number, raw, change, first + at)
                mended = mended.copy() if mended is t_ns else mended
                mended[at] = ordered
            self._raw[number], self._given[number] = int(raw[-1]), int(ordered[-1])
        return mended

    def complaints(self) -> Iterator[tuple[str, str]]:
        """What was mended so far, as (where, what)."""
        late, steps = self._late, self._steps
        if late.count:
            yield f"chunk {late.chunk}", f"time goes back {late.times} by {late.back_ns / 1e6:.3f} ms: held"
        if steps.count:
            back = f"{steps.back_ns / 1e9:.3f} s"
            yield f"chunk {steps.chunk}", f"clock set back {steps.times} by {back}: later times are shifted forward"
        if self._beyond.count:
            yield f"chunk {self._beyond.chunk}", "shifted beyond the last possible time: held there"

    def _in_order(
        self, port: int, raw: NDArray[np.int64], change: NDArray[np.int64], chunk: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        step = change < -CLOCK_STEP_NS
        shift = _sums(np.where(step, -change, 0), self._shift.get(port, 0))
        self._shift[port] = int(shift[-1])
        beyond = raw > TIME_LIMIT - 1 - shift
        shifted = np.where(beyond, TIME_LIMIT - 1, raw + shift)
        self._late.add((change < 0) & ~step, chunk, change)
        self._steps.add(step, chunk, change)
        self._beyond.add(beyond, chunk, change)
        floor = self._given.get(port, -TIME_LIMIT)
        return np.maximum.accumulate(np.maximum(shifted, floor))


def _sums(steps: NDArray[np.int64], before: int) -> NDArray[np.int64]:
    """Running sums of numbers that are not negative, on from `before`; at most the largest number that there is."""
    if steps.sum(dtype=np.float64) + before < TIME_LIMIT:
        return np.cumsum(steps) + before
    most = int(np.iinfo(np.int64).max)
    return np.array([*accumulate(steps.tolist(), lambda a, b: min(a + b, most), initial=before)][1:], np.int64)
