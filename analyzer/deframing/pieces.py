"""What the engine has decided: pieces of the stream as columns, before they are numbered and paired."""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..frames import EVIDENCE, GAPS, Rows
from .rules import Index
from .tape import Times

NOISE: Final = 2  # the role of a piece that is no frame


class Decided(NamedTuple):
    """Pieces of the tape, end to end, just decided."""

    start: Index  # index in the tape
    end: Index
    role: NDArray[np.uint8]  # Role, or NOISE
    check: NDArray[np.bool_]  # CRC right
    margin: NDArray[np.float32]  # bits over the next best explanation
    contested: NDArray[np.bool_]  # decided by the lattice
    why: Rows | None = None  # EVIDENCE, where it is wanted


class Pieces(NamedTuple):
    """Decided pieces of the stream, end to end."""

    start: NDArray[np.int64]  # offset in the stream
    end: NDArray[np.int64]
    role: NDArray[np.uint8]  # Role, or NOISE
    check: NDArray[np.bool_]  # CRC right
    t_start: Times  # ns, estimates of first start bit and last stop bit
    t_end: Times
    head: Times  # number of the read that brought the first byte
    tail: Times  # and of the one that brought the last
    margin: NDArray[np.float32]  # bits over the next best explanation
    contested: NDArray[np.bool_]  # decided by the lattice
    gaps: Rows  # GAPS
    why: Rows  # EVIDENCE; none where it is not wanted


def evidence(n: int) -> Rows:
    """Evidence of n pieces, to be filled in."""
    why = np.zeros(n, EVIDENCE)
    why["rival_start"] = -1
    return why


_TYPES: Final = (np.int64, np.int64, np.uint8, np.bool_, *[np.int64] * 4, np.float32, np.bool_, GAPS, EVIDENCE)
NOTHING: Final = Pieces(*(np.empty(0, t) for t in _TYPES))
