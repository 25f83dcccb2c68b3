"""Times that their order tells how to read.

Fractions of seconds without their leading zeros, `12:00:01.5` five milliseconds after `12:00:01`: loggers that print
seconds and milliseconds as two numbers write so. Read as decimals they run back within a second, read as counts they
never do. Steps, `[+0.031]`: as times since some start they would run back. Numbers before a mark, `1023: TX 01 03`:
milliseconds where they rise, and not from line to line by one.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final

from .stamps import SECOND_NS, Stamp

_MOST: Final = 4096  # times that are looked at
_LINES_NS: Final = 2_000_000  # of numbers of lines, or of two together, read as milliseconds
_WIDTHS: Final = (3, 6, 9)  # digits of milliseconds, microseconds, nanoseconds


@dataclass(slots=True)
class Fractions:
    """The times of a text's beginning, as far as their fractions tell how they were written."""

    _stamps: list[Stamp] = field(default_factory=list)
    _signed: list[int] = field(default_factory=list)
    _counters: list[int] = field(default_factory=list)

    def note(self, stamp: Stamp) -> None:
        """One more time."""
        if stamp.places and len(self._stamps) < _MOST:
            self._stamps.append(stamp)
        for times, wanted in ((self._signed, stamp.signed), (self._counters, stamp.counter)):
            if wanted and len(times) < _MOST:
                times.append(stamp.t_ns)

    @property
    def steps(self) -> bool:
        """Whether times with a plus are steps from the one above."""
        return any(later < earlier for earlier, later in pairwise(self._signed))

    @property
    def counters(self) -> bool:
        """Whether numbers before a mark are milliseconds."""
        steps = [later - earlier for earlier, later in pairwise(self._counters)]
        return bool(steps) and min(steps) >= 0 and sorted(steps)[len(steps) // 2] > _LINES_NS

    @property
    def width(self) -> int:
        """How many digits the fractions stand for, where leading zeros are missing; 0 where nothing says so."""
        places = {stamp.places for stamp in self._stamps}
        if len(places) < 2 or max(places) > _WIDTHS[-1]:
            return 0
        width = next(width for width in _WIDTHS if width >= max(places))
        if not _runs_back([stamp.t_ns for stamp in self._stamps]):
            return 0
        return 0 if _runs_back([counted(stamp, width) for stamp in self._stamps]) else width


def counted(stamp: Stamp, width: int) -> int:
    """The time of a stamp, in ns, whose fraction counts units of 10^-width seconds."""
    if not 0 < stamp.places <= width:
        return stamp.t_ns
    seconds, fraction = divmod(stamp.t_ns, SECOND_NS)
    count = fraction * int(10**stamp.places) // SECOND_NS
    return seconds * SECOND_NS + count * int(10 ** (9 - width))


def _runs_back(times: list[int]) -> bool:
    """Whether a time is before the one above it, by less than a second."""
    return any(0 < earlier - later < SECOND_NS for earlier, later in pairwise(times))
