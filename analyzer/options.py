"""What a user may set about deframing and diagnosis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True, slots=True)
class Options:
    """How to deframe and to diagnose. Times in ns; None: by the specification, from the line's settings."""

    idle_ns: int = 50_000_000  # a quiet line: what is whole is reported [5 ms .. 5 s]
    cut_ns: int = 3_000_000_000  # no frame has a hole like this
    explain: bool = False  # keep the evidence of each row
    t15_ns: int | None = None  # longest silence inside a frame
    t35_ns: int | None = None  # shortest silence between frames
    turnaround_ns: int = 100_000_000  # pause after a broadcast
    protocol: Literal["auto", "rtu", "ascii", "tcp"] = "auto"  # what a line speaks is seen from its first bytes
