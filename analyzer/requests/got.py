"""What a request got, and what it is counted for: a visit, with the retries behind it."""

from __future__ import annotations

from enum import IntEnum

import numpy as np
from numpy.typing import NDArray


class Got(IntEnum):
    """What a request got; below 256 it is an exception code."""

    ANSWER = 0
    SILENCE = 256
    DAMAGE = 257  # something came, or nobody knows
    HALF = 258  # an answer whose byte count is the quantity asked for


def visits_of(poll: NDArray[np.int64], got: NDArray[np.int64], again: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Visits of a unit in order, of shape (visits, 2): the number of what was asked, what it got. Of requests, `again`
    those whose bytes come once more right behind them: a visit ends as the last of its retries does."""
    retried = again & ((got == Got.SILENCE) | (got == Got.DAMAGE))
    found: NDArray[np.int64] = np.stack((poll, got), axis=1)[~retried]
    return found
