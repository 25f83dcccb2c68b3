"""Bits of evidence, in steps of 1/1024: sums of them are exact, whatever the order.

Two explanations may weigh the same (of writes that look like their echoes, which asks?). Then the order of the paths
decides, and that must not hang on what was added up before: a lattice begins where the last decision ended.
"""

from __future__ import annotations

from typing import overload

import numpy as np
from numpy.typing import NDArray

_STEPS = 1024.0


@overload
def exact(bits: float) -> float: ...
@overload
def exact(bits: NDArray[np.float64]) -> NDArray[np.float64]: ...
def exact(bits: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
    """The nearest step."""
    return np.rint(bits * _STEPS) / _STEPS if isinstance(bits, np.ndarray) else round(bits * _STEPS) / _STEPS
