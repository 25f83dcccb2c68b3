"""A piece's column of times that are nearly always under two seconds: four bytes each, eight once one is longer.

It is indexed like an array of int64, and gives such. One thread writes; others read rows that it was told of.
"""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from analyzer.frames import NO_GAP

_LONGEST: Final = np.iinfo(np.int32).max
_UNKNOWN: Final = np.iinfo(np.int32).min  # stands for NO_GAP


class ShortTimes:
    """So many times, ns; NO_GAP where one is not known."""

    def __init__(self, count: int) -> None:
        self._values: NDArray[Any] = np.empty(count, np.int32)

    def __getitem__(self, places: Any) -> NDArray[Any]:
        values: NDArray[Any] = self._values[places]
        if values.dtype == np.int64:
            return values
        return np.where(values == _UNKNOWN, NO_GAP, values.astype(np.int64))

    def __setitem__(self, places: Any, times: NDArray[np.int64] | int) -> None:
        known = np.asarray(times, np.int64)
        if self._values.dtype == np.int32:
            unknown = known == NO_GAP
            if not (np.abs(known[~unknown]) > _LONGEST).any():
                self._values[places] = np.where(unknown, _UNKNOWN, known)
                return
            self._values = self[:]
        self._values[places] = known

    @property
    def nbytes(self) -> int:
        """Memory of the column."""
        return self._values.nbytes
