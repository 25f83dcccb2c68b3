"""When the bus is hit: in spells, from when to when."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from ..tables.schema import Bools
from .bits import spells_of
from .evidence import Evidence

_SPELLS_BITS: Final = 14.0


def spells_of_hits(evidence: Evidence) -> tuple[float, Bools]:
    """The parts of the time in which the bus is hit, and what they save in bits; 0 where that may be chance."""
    grid = evidence.ledger.grid
    found, inside = spells_of(grid.counts("damage"), grid.counts("asked"))
    return (found if found >= _SPELLS_BITS and evidence.ledger.timed else 0.0), inside


def span_of_hits(evidence: Evidence) -> dict[str, Any]:
    """`since` and `until` of a suspicion, by the parts of the time with hits; nothing where there are none."""
    grid = evidence.ledger.grid
    parts = np.flatnonzero(grid.counts("damage"))
    if not len(parts):
        return {}
    since = (grid.begin_ns or 0) + int(parts[0]) * grid.width_ns
    return {"since": since, "until": end_of_part(evidence, int(parts[-1]) + 1)}


def end_of_part(evidence: Evidence, part: int) -> int:
    """The end of so many parts of the grid, which may reach beyond the capture's."""
    grid, ledger = evidence.ledger.grid, evidence.ledger
    reach = (grid.begin_ns or 0) + part * grid.width_ns
    return min(reach, ledger.end) if ledger.timed else reach
