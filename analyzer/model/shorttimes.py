"""Columns of numbers that nearly always are small, or all alike: they take less until one is not.

Each is indexed like the array that it stands for, and gives such. One thread writes; others read rows that it was told
of: what takes the place of a narrower array holds all of it before it does.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import NO_GAP

_LONGEST: Final = np.iinfo(np.int32).max
_UNKNOWN: Final = np.iinfo(np.int32).min  # stands for NO_GAP
_NARROW: Final = np.iinfo(np.uint16).max


class ShortTimes:
    """So many times, ns, four bytes each, eight once one is longer; NO_GAP where one is not known."""

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


class AlikeNumbers:
    """Numbers that nearly always are one and the same: no bytes while all are."""

    def __init__(self, count: int, dtype: np.dtype[Any]) -> None:
        self._count, self._dtype = count, dtype
        self._one: Any = None
        self._values: NDArray[Any] | None = None

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        if self._values is not None:
            there: NDArray[Any] = self._values[slots]
            return there
        size = len(range(*slots.indices(self._count))) if isinstance(slots, slice) else np.shape(slots)
        return np.full(size, self._one, self._dtype)

    def __setitem__(self, slots: Any, numbers: NDArray[Any] | int) -> None:
        if self._values is None:
            exact = np.asarray(numbers, self._dtype)
            if self._one is None and exact.size:
                self._one = exact.flat[0]
            if (exact == self._one).all():
                return
            self._values = np.full(self._count, self._one, self._dtype)
        self._values[slots] = numbers

    @property
    def nbytes(self) -> int:
        """Memory of the column."""
        return 0 if self._values is None else self._values.nbytes


class NarrowNumbers:
    """Numbers from the first one on that nearly always are less than 65,536 above it: two bytes each, then four.

    `first`: counted from that one instead.
    """

    def __init__(self, count: int, first: int | None = None) -> None:
        self._values: NDArray[Any] = np.empty(count, np.uint16)
        self._first = first

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        numbers: NDArray[Any] = self._values[slots].astype(np.uint32) + np.uint32(self._first or 0)
        return numbers

    def __setitem__(self, slots: Any, numbers: NDArray[Any] | int) -> None:
        exact = np.asarray(numbers, np.int64)
        if self._first is None and exact.size:
            self._first = int(exact.flat[0])
        above = exact - (self._first or 0)
        if self._values.dtype == np.uint16 and above.size and int(above.max()) > _NARROW:
            self._values = self._values.astype(np.uint32)
        self._values[slots] = above

    @property
    def nbytes(self) -> int:
        """Memory of the column."""
        return self._values.nbytes
