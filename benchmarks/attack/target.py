"""What an attack feeds inputs to, what more than one kind of target needs, and what an attack gives."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from random import Random
from typing import Final

from captures import Chunk, LineSettings, Mark
from captures.limits import TIME_LIMIT

LINE: Final = LineSettings(baud=19200, char_bits=11, parity="E", tap="irq")
_FRAMES: Final = (
    "1103006b00037687",
    "110306ae415652434049ad",
    "118302c134",
    "0b0100130025",
    "110105cd6bb20e1b45e6",
    "110500acff004e8b",
    "11100001000204000a0102c6f0",
    "0006000100039a1a",
    "112b0e01003f44",
    "011700030006000e00030600ff00ff00ff",
)
FRAMES: Final = tuple(bytes.fromhex(text) for text in _FRAMES)


@dataclass(frozen=True)
class Target:
    """`take` gets an input, with chances of its own; `errors` are what a user is told. `share` of all inputs.

    `seconds` of CPU is the most that an input may take. `make` gives inputs in place of seeds that are spoilt.
    """

    name: str
    seeds: Callable[[], Sequence[bytes]]
    take: Callable[[bytes, Random], None]
    errors: tuple[type[Exception], ...] = ()
    tokens: tuple[bytes, ...] = ()
    share: int = 10
    seconds: float = 1.0
    make: Callable[[Random], bytes] | None = None


@cache
def folder() -> Path:
    """Where files are for a moment: in memory, where there is such a place."""
    memory = Path("/dev/shm")
    return Path(tempfile.mkdtemp(dir=memory if os.access(memory, os.W_OK) else None))


def conversation(chance: Random, count: int = 20) -> list[Chunk]:
    """Frames with times, ports and marks, not all of them sensible."""
    wild, now, chunks = chance.random() < 0.1, chance.choice((0, 10**18, -(10**15))), []
    for _ in range(count):
        now += chance.choice((1, 10**6, 10**7, 3 * 10**9))
        t_ns = chance.choice((now, 1 - TIME_LIMIT, TIME_LIMIT - 1, 0)) if wild else now
        data = chance.choice((*FRAMES, chance.randbytes(chance.randint(1, 40))))
        errors = (chance.randrange(len(data)),) if chance.random() < 0.1 else ()
        chunks.append(Chunk(t_ns, data, chance.choice((0, 0, 1)), chance.choice(tuple(Mark)), errors))
    return chunks


@dataclass
class Outcome:
    """`failures` are a line or more each, with what brings them back."""

    name: str
    tried: int = 0
    figures: str = ""
    failures: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        held = "held" if not self.failures else f"DID NOT HOLD {len(self.failures)} times"
        return f"{self.name}: {self.tried:,} tried, {held}; {self.figures}"
