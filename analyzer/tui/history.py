"""What one number was over time: the plot below the units and the registers."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from textual.strip import Strip

from ..languages import tr
from .paint import Painted, StyledText, fitted
from .sparks import EIGHTHS


def _number(number: float) -> str:
    return f"{number:.6g}"


class History(Painted):
    """What one number was over time, as bars, and its range."""

    def __init__(self, *, id: str, classes: str) -> None:
        super().__init__(id=id, classes=classes)
        self.title = ""
        self._written: Callable[[float], str] = _number
        self._points: list[tuple[int, float]] = []
        self._from_zero = False

    def show(
        self,
        title: str,
        points: Sequence[tuple[int, float]],
        written: Callable[[float], str] | None = None,
        *,
        from_zero: bool = False,
    ) -> None:
        """Times and numbers (NaN: none from then on), oldest first; `written` is how a number is put into words."""
        self.title = title
        self._written = written or _number
        self._from_zero = from_zero
        self._points = list(points)
        self.refresh()

    def render_line(self, y: int) -> Strip:
        width, height = self.content_size.width, self.content_size.height
        base = self.base
        if y == 0:
            return self.strip(fitted([StyledText(self.title, "strong")], width), width, base)
        numbers = [number for _, number in self._points if not math.isnan(number)]
        if not numbers or height < 3:
            return self.strip([StyledText(tr(" no reading") if y == 1 else "", "dim")], width, base)
        low, high = 0.0 if self._from_zero else min(numbers), max(numbers)
        rows = height - 1
        label = self._written(high) if y == 1 else self._written(low) if y == rows and high > low else ""
        parts = [
            StyledText(f"{label:>11} ", "dim"),
            StyledText(self._plot(y - 1, rows, max(1, width - 12), low, high), "accent"),
        ]
        return self.strip(parts, width, base)

    def _plot(self, y: int, rows: int, width: int, low: float, high: float) -> str:
        """One line of the plot: bars in eighths of a line, each the newest number at its time."""
        first, last = self._points[0][0], self._points[-1][0]
        scale = (8 * rows - 1) / (high - low) if high > low else 0.0
        line, at = [], 0
        for column in range(width):
            until = first + (last - first) * (column + 1) / width
            while at + 1 < len(self._points) and self._points[at + 1][0] <= until:
                at += 1
            if math.isnan(self._points[at][1]):
                line.append(" ")
                continue
            level = 1 + round((self._points[at][1] - low) * scale) if high > low else 4 * rows
            line.append(EIGHTHS[max(0, min(8, level - 8 * (rows - 1 - y)))])
        return "".join(line)
