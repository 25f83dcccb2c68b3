"""Waiting for a moment as exactly as the system's timers allow (about 0.1 ms)."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Final

_SPIN_NS: Final = 200_000  # before the moment: awake
_NAP_S: Final = 0.1  # asleep at most


def sleep_until(due_ns: int, stop: Callable[[], bool] = bool) -> None:
    """Wait for a time of the monotonic clock, or until `stop`."""
    while (left := due_ns - time.monotonic_ns()) > 0 and not stop():
        if left > _SPIN_NS:
            time.sleep(min(_NAP_S, (left - _SPIN_NS) / 1e9))
