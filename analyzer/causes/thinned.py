"""Numbers of a stream in flat memory: some of them, evenly over the stream, and the count and sum of all."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

_MOST: Final = 512
_MODE: Final = 0.12  # width of the densest numbers, of themselves


class Thinned:
    """Every so many-eth number of those added."""

    __slots__ = ("_numbers", "_ordered", "_stride", "count", "total")

    def __init__(self) -> None:
        self._numbers: NDArray[np.float64] = np.zeros(0)
        self._ordered: NDArray[np.float64] | None = None  # once somebody asks for a quantile
        self._stride = 1
        self.count = 0
        self.total = 0.0

    def __len__(self) -> int:
        return self.count

    def add(self, numbers: NDArray[Any]) -> None:
        """More of the stream."""
        self._ordered = None
        first = -self.count % self._stride
        self.count += len(numbers)
        self.total += float(numbers.sum())
        self._numbers = np.concatenate((self._numbers, numbers[first :: self._stride]))
        while len(self._numbers) > _MOST:
            self._numbers = self._numbers[::2]
            self._stride *= 2

    @property
    def numbers(self) -> NDArray[np.float64]:
        """Those remembered, in their order."""
        return self._numbers

    def quantile(self, share: float) -> float | None:
        """A quantile of those remembered; None without any."""
        if not len(self._numbers):
            return None
        if self._ordered is None:
            self._ordered = np.sort(self._numbers)
        low, part = divmod(share * (len(self._ordered) - 1), 1)  # as `np.quantile` does, whose checks take far longer
        first = float(self._ordered[int(low)])
        return first + part * (float(self._ordered[int(low) + 1]) - first) if part else first

    def above(self, bound: float) -> float:
        """The share of numbers over a bound; 0 without any."""
        return float((self._numbers > bound).mean()) if len(self._numbers) else 0.0


def densest(numbers: NDArray[np.float64]) -> float:
    """The median of those positive numbers that lie closest together, a window of an eighth wide; 0 for none."""
    ordered = np.sort(numbers[numbers > 0])
    if not len(ordered):
        return 0.0
    ends = np.searchsorted(ordered, ordered * (1 + _MODE), side="right")
    begin = int(np.argmax(ends - np.arange(len(ordered))))
    return float(np.median(ordered[begin : int(ends[begin])]))
