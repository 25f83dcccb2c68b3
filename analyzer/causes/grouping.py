"""Units that a cause may concern: each by itself, or several that share it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

T = TypeVar("T")


def alone_or_together(every: Sequence[T], sharing: Sequence[T]) -> list[list[T]]:
    """The groups to weigh: those that share it as one, if they are several, and each of the others by itself."""
    together = list(sharing) if len(sharing) > 1 else []
    alone = [[each] for each in every if each not in together]
    return [*alone, together] if together else alone
