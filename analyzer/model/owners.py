"""Whose answer a row is, in words, where that is not simply the request before it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..languages import tr

if TYPE_CHECKING:
    from .bus import Bus


def owner(bus: Bus, row: int) -> str:
    """Which request an answer is of and which one the client takes it for, where they differ; or that none can tell."""
    table = bus.table
    unsure, displaced = table.value("unsure", row), table.value("taken_for_start", row) >= 0
    if unsure:
        return tr("it is unclear which request it answers")
    if not displaced:
        return ""
    request, taken = bus.partner(row), bus.taken_for(row)
    if request is None or taken is None:
        return tr("the client takes it for the answer to another request")
    return tr(
        "answers frame {request}, the client takes it for the answer to frame {taken}",
        request=table.value("frame", request),
        taken=table.value("frame", taken),
    )
