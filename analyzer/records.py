"""Rows of a structured array moved as what they are to the machine: so many bytes each.

numpy copies a structured array field by field, some thirty times slower than the same bytes as one opaque value.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Records = NDArray[np.void]


def joined(parts: Sequence[Records]) -> Records:
    """Arrays of one dtype end to end, at least one: `np.concatenate`."""
    return np.concatenate([_opaque(part) for part in parts]).view(parts[0].dtype)


def picked(rows: Records, which: NDArray[Any]) -> Records:
    """`rows[which]`, by places or by a mask: a copy."""
    found: Records = _opaque(rows)[which].view(rows.dtype)
    return found


def _opaque(rows: Records) -> Records:
    return rows.view(np.dtype((np.void, rows.dtype.itemsize)))
