"""The wires that can be simulated: who talks on them and what goes wrong, as shares of frames or of exchanges.

A new wire is one new entry in `WIRES`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType


@dataclass(frozen=True, slots=True)
class Wire:
    """What a wire does, as probabilities.

    Of the conversation: `public`, that its servers know all public functions and not only the common ones; `vendor`,
    the weight of an undocumented function beside a common one's 1; `hostile`, the share of register reads answered
    with a payload meant to fool a CRC scan; `broadcast`, the share of requests.

    Of each frame: `flip` of a bit, `drop` of a byte, holes inside (`slow`), stray bytes hard before it and, drawn
    apart, hard after it (`glitch`); of a response also `truncate` and `collide`, with another server's.

    Of each exchange: `silent`, no answer; `late`, the answer comes after the next request; `stray`, noise before it.
    """

    public: float = 0.5
    vendor: int = 0
    hostile: float = 0.0
    broadcast: float = 0.0
    flip: float = 0.0
    drop: float = 0.0
    truncate: float = 0.0
    collide: float = 0.0
    slow: float = 0.0
    glitch: float = 0.0
    silent: float = 0.0
    late: float = 0.0
    stray: float = 0.0


_NOISY = Wire(flip=0.018, drop=0.02, truncate=0.02, collide=0.018, silent=0.03, late=0.01, stray=0.1)

WIRES: Mapping[str, Wire] = MappingProxyType(
    {
        "clean": Wire(),
        "hard": Wire(hostile=0.36),
        "slow-slave": Wire(slow=0.3),
        "noisy": _NOISY,
        "glitch": Wire(glitch=0.3, silent=0.045),
        "vendor": Wire(public=0.0, vendor=2, flip=0.01, silent=0.02),
        "broadcast": Wire(broadcast=0.04),
        "brutal": replace(
            _NOISY,
            public=1.0,
            vendor=1,
            hostile=0.3,
            broadcast=0.01,
            flip=0.055,
            drop=0.055,
            truncate=0.05,
            collide=0.05,
            slow=0.11,
            glitch=0.15,
            silent=0.08,
            late=0.035,
            stray=0.3,
        ),
    }
)
