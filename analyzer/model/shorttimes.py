"""Columns of numbers that nearly always are small: four bytes each, eight once one is larger.

Each is indexed like an array of int64, and gives such. One thread writes; others read rows that it was told of.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import NO_GAP

_LONGEST: Final = np.iinfo(np.int32).max
_UNKNOWN: Final = np.iinfo(np.int32).min  # stands for NO_GAP


class ShortTimes:
    """So many times, ns; NO_GAP where one is not known."""

    def __init__(self, count: int) -> None:
        self._values: NDArray[Any] = np.empty(count, np.int32)

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        values: NDArray[Any] = self._values[slots]
        if values.dtype == np.int64:
            return values
        return np.where(values == _UNKNOWN, NO_GAP, values.astype(np.int64))

    def __setitem__(self, slots: Any, times: NDArray[np.int64] | int) -> None:
        exact = np.asarray(times, np.int64)
        if self._values.dtype == np.int32:
            unknown = exact == NO_GAP
            if not (np.abs(exact[~unknown]) > _LONGEST).any():
                self._values[slots] = np.where(unknown, _UNKNOWN, exact)
                return
            self._values = ShortTimes.__getitem__(self, slice(None))
        self._values[slots] = exact

    @property
    def nbytes(self) -> int:
        """Memory of the column."""
        return self._values.nbytes


class NearNumbers(ShortTimes):
    """Numbers that nearly always are within two thousand million of the first: four bytes each."""

    def __init__(self, count: int) -> None:
        super().__init__(count)
        self._base: int | None = None

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        return super().__getitem__(slots) + (self._base or 0)

    def __setitem__(self, slots: Any, times: NDArray[np.int64] | int) -> None:
        exact = np.asarray(times, np.int64)
        if self._base is None and exact.size:
            self._base = int(exact.flat[0])
        super().__setitem__(slots, exact - (self._base or 0))


class EndTimes(ShortTimes):
    """Times shortly after those of another column, which are written first."""

    def __init__(self, begins: NDArray[np.int64]) -> None:
        super().__init__(len(begins))
        self._begins = begins

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        ends: NDArray[Any] = super().__getitem__(slots) + self._begins[slots]
        return ends

    def __setitem__(self, slots: Any, times: NDArray[np.int64] | int) -> None:
        super().__setitem__(slots, np.asarray(times, np.int64) - self._begins[slots])
