"""A simulated bus: plausible conversations, a faulty wire, a tap that tells the time badly, and the truth about it all.

    made = simulate(Scenario(wire="noisy", tap="irq", seed=7))
    made.chunks     # what a tap would have delivered
    made.truth      # every frame that was sent, and what became of it

    made = simulate(Scenario("clean", "precise", defect="byte-missing"))
    made.findings   # what is wrong, and where

One idea a file: `devices` answer, `conversation` asks them, `line` puts the bytes into time on wires that say how often
and how they are spoilt, `taps` cut what is left into chunks, `truth` says what was where; `defects` put one thing that
is wrong on a healthy bus. The same scenario gives the same bytes wherever `random.Random` does.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..lazy import lazily

if TYPE_CHECKING:
    from .bus import Simulation, simulate, write
    from .line import WIRES, Wire
    from .taps import TAPS, SimulatedTap
    from .truth import Scenario, TruthFinding, TruthFrame

_HOMES = {
    "TAPS": "taps",
    "WIRES": "line",
    "Scenario": "truth",
    "Simulation": "bus",
    "SimulatedTap": "taps",
    "TruthFinding": "truth",
    "TruthFrame": "truth",
    "Wire": "line",
    "simulate": "bus",
    "write": "bus",
}

__all__ = [
    "TAPS",
    "WIRES",
    "Scenario",
    "SimulatedTap",
    "Simulation",
    "TruthFinding",
    "TruthFrame",
    "Wire",
    "simulate",
    "write",
]


__getattr__ = lazily(__name__, _HOMES)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
