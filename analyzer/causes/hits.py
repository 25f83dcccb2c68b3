"""What was hit on the line: answers, requests, the idle line; and when."""

from __future__ import annotations

from typing import Any, Final

import numpy as np

from .evidence import Evidence
from .signatures import Behind

# How damage spreads over kinds where it strikes all senders alike.
ALIKE: Final = {"bits": 0.24, "bits-tail": 0.03, "head": 0.12, "middle": 0.2, "whole": 0.13, "long": 0.06, "tail": 0.03,
                 "cut": 0.08, "cut-short": 0.05, "crossed": 0.02, "convention": 0.001, "count": 0.002, "other": 0.01}  # fmt: skip


class Hits:
    """How many exchanges were hit: frames (answers, requests) and the idle line."""

    def __init__(self, evidence: Evidence) -> None:
        self.damaged = sum(map(evidence.damaged, evidence.units))
        self.requests = sum(evidence.behind(unit, Behind.REQUEST) for unit in evidence.units)
        self.idle = sum(evidence.behind(unit, Behind.NOISE, Behind.ZEROS) for unit in evidence.units)
        self.exchanges = sum(unit.asked for unit in evidence.units)

    @property
    def frames(self) -> float:
        return self.damaged + self.requests

    @property
    def all(self) -> float:
        return self.frames + self.idle

    @property
    def numbers(self) -> dict[str, Any]:
        """For people."""
        return {
            "idle": round(self.idle),
            "damaged": self.damaged,
            "requests": round(self.requests),
            "exchanges": self.exchanges,
            "answers": self.exchanges,
            "well": self.exchanges - self.damaged,
            "hits": round(self.all),
        }


def span_of_hits(evidence: Evidence) -> dict[str, Any]:
    """`since` and `until` of a suspicion, by the parts of the time with hits; nothing where there are none."""
    grid = evidence.ledger.grid
    parts = np.flatnonzero(grid.counts("damage"))
    if grid.begin_ns is None or not len(parts):
        return {}
    return {"since": grid.begin_ns + int(parts[0]) * grid.width_ns, "until": end_of_part(evidence, int(parts[-1]) + 1)}


def end_of_part(evidence: Evidence, part: int) -> int:
    """The end of so many parts of the grid, which may reach beyond the capture's."""
    grid, ledger = evidence.ledger.grid, evidence.ledger
    reach = (grid.begin_ns or 0) + part * grid.width_ns
    return min(reach, ledger.end) if ledger.timed else reach
