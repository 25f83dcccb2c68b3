"""The time that a plot shows: all of it, the newest so long, which goes along with a live bus, or so long around a
time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final

import numpy as np

from ..languages import tr
from ..words import duration

if TYPE_CHECKING:
    from .plot import Series

_S: Final = 10**9
_LENGTHS: Final = tuple(each * _S for each in (86_400, 21_600, 3600, 600, 60, 10, 1))
"""What is zoomed to: a day, six hours, an hour, ten minutes, a minute, ten seconds, a second (ns)."""

Span = tuple[int, int]


@dataclass(frozen=True, slots=True)
class PlotWindow:
    """`length_ns` 0: all; `end_ns` None: up to the newest."""

    length_ns: int = 0
    end_ns: int | None = None

    def of(self, reach: Span) -> Span:
        """The part of `reach`, from the first time to the newest, that is shown."""
        if not self.length_ns:
            return reach
        end = reach[1] if self.end_ns is None else self.end_ns
        return end - self.length_ns, end

    def shorter(self, reach: Span, around: int | None) -> PlotWindow:
        """The next shorter one, around a time where one is given; itself where there is none."""
        begin, end = self.of(reach)
        length = next((each for each in _LENGTHS if each < end - begin), 0)
        if not length:
            return self
        return PlotWindow(length, None if around is None else min(around + length // 2, reach[1]))

    def cut(self, series: Sequence[Series], reach: Span) -> list[Series]:
        """The readings in it; what one shortly before it gave holds from its begin on."""
        return [self._part(each, self.of(reach)) for each in series] if self.length_ns else [*series]

    def _part(self, series: Series, span: Span) -> Series:
        low = int(np.searchsorted(series.t_ns, span[0]))
        high = int(np.searchsorted(series.t_ns, span[1], side="right"))
        held = low > 0 and span[0] - int(series.t_ns[low - 1]) <= self.length_ns
        part = slice(low - held, high)
        return replace(series, t_ns=np.maximum(series.t_ns[part], span[0]), numbers=series.numbers[part])

    @property
    def words(self) -> str:
        """What is shown, where that is not all; to be put behind a title."""
        if not self.length_ns:
            return ""
        template = ", {time} of it" if self.end_ns is not None else ", the last {time}"
        return tr(template, time=duration(self.length_ns))
