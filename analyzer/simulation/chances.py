"""Where chance comes from: a source for each thing that is drawn, so that none disturbs another.

The bus of a seed (its units, what they hold, what the client asks) is the same whatever happens to its frames, whoever
taps it and however fast it is.
"""

from __future__ import annotations

from dataclasses import dataclass
from random import Random


@dataclass(frozen=True, slots=True)
class Chances:
    """Of the bus and its conversation; of pauses and delays; of what goes wrong; of the tap."""

    bus: Random
    pace: Random
    faults: Random
    tap: Random

    @classmethod
    def of(cls, seed: int, fault: str) -> Chances:
        """Those of a seed, where this kind of thing goes wrong."""
        return cls(*(Random(f"{what} {seed}") for what in ("bus", "pace", fault, "tap")))
