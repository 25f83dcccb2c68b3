"""When it is worth asking anew what registers mean."""

from __future__ import annotations

from typing import Final

_FIRST: Final = 48  # frames before anything is told
_MORE: Final = 1.5


def is_due(asked_at: int, frames: int) -> bool:
    """Whether there is so much more than when types were asked for; both in frames."""
    return frames >= max(_FIRST, int(asked_at * _MORE) + 1)
