"""Columns of numbers in fewer bytes than they take as they are, as long as they are what they nearly always are.

Each is indexed like the array that it stands for, and gives such; what takes the place of a narrower array holds all
of it before it does, so that one thread may write while others read.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import NO_GAP

_LONGEST: Final = np.iinfo(np.int32).max
_UNKNOWN: Final = np.iinfo(np.int32).min  # stands for NO_GAP
_NARROW: Final = np.iinfo(np.uint16).max
_PLACE: Final = 2  # bytes of a place in a piece


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
    """Numbers that nearly always are one and the same: those that are not are kept by their places.

    `many` makes what takes all of them once they are too many for that.
    """

    def __init__(self, count: int, dtype: np.dtype[Any], many: Callable[[], Kept] | None = None) -> None:
        self._count, self._dtype = count, dtype
        self._many = many or partial(np.empty, count, dtype)
        self._one: Any = None
        self._others = np.empty(0, np.uint16), np.empty(0, dtype)  # places, ascending, and what stands there
        self._values: Kept | None = None

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        values, (places, others) = self._values, self._others  # one thread may write while another reads
        if values is not None:
            there: NDArray[Any] = values[slots]
            return there
        if isinstance(slots, slice):
            begin, end, step = slots.indices(self._count)
            out = np.full(max(0, end - begin), self._one, self._dtype)
            low, high = np.searchsorted(places, np.array((begin, end)))
            out[places[low:high].astype(np.int64) - begin] = others[low:high]
            return out[::step]
        if not len(places):
            return self._one if isinstance(slots, int) else np.full(np.shape(slots), self._one, self._dtype)
        at = np.minimum(places.searchsorted(slots), len(places) - 1)
        found: NDArray[Any] = np.where(places[at] == slots, others[at], self._one)[()]
        return found

    def __setitem__(self, slots: Any, numbers: NDArray[Any] | int) -> None:
        if self._values is not None:
            self._values[slots] = numbers
            return
        exact = np.asarray(numbers, self._dtype)
        if self._one is None and exact.size:
            self._one = exact.flat[0]
        places, others = self._others
        if isinstance(slots, slice) and exact.ndim and slots.step is None:
            begin, _, _ = slots.indices(self._count)
            if not len(places) or begin > places[-1]:  # as rows come
                new = np.flatnonzero(exact != self._one)
                if len(new):
                    self._keep(np.concatenate((places, new + begin)), np.concatenate((others, exact[new])))
                return
        written, last = np.unique(np.arange(self._count)[slots].reshape(-1)[::-1], return_index=True)
        exact = np.broadcast_to(exact, exact.shape or written.shape)[::-1][last]  # of a place told twice the last
        left, new = ~np.isin(places, written), exact != self._one
        self._keep(np.concatenate((places[left], written[new])), np.concatenate((others[left], exact[new])))

    def _keep(self, places: NDArray[Any], others: NDArray[Any]) -> None:
        """What is otherwise than the one, in any order."""
        if len(places) * (_PLACE + others.itemsize) <= self._count * others.itemsize // 2:
            order = np.argsort(places, kind="stable")
            self._others = places[order].astype(np.uint16), others[order]
            return
        values = self._many()
        values[:] = np.full(self._count, self._one, self._dtype)
        values[places] = others
        self._values = values

    @property
    def nbytes(self) -> int:
        """Memory of the column."""
        return sum(each.nbytes for each in self._others) if self._values is None else self._values.nbytes


class BesideNumbers(AlikeNumbers):
    """Numbers that nearly always are as far from those of another column, which is written first."""

    def __init__(self, count: int, other: Kept) -> None:
        super().__init__(count, np.dtype(np.int64), partial(NearNumbers, count))
        self._other = other

    def __getitem__(self, slots: Any) -> NDArray[Any]:
        numbers: NDArray[Any] = super().__getitem__(slots) + self._other[slots]
        return numbers

    def __setitem__(self, slots: Any, numbers: NDArray[Any] | int) -> None:
        super().__setitem__(slots, np.asarray(numbers, np.int64) - self._other[slots])


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


Column = NDArray[Any]
Kept = Column | ShortTimes | AlikeNumbers | NarrowNumbers
