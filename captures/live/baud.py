"""A line's settings, found by listening: no bytes in, no frames wanted, only a judge of what was heard.

Settings are tried in the order in which they are met in the field. Heard at a wrong rate, bytes are not what was sent
and make no sense; heard with the wrong parity, they come with errors. Each try lasts until enough was heard to judge,
so a silent line is waited for. The first settings that explain nearly everything are taken; where none does, the best
that explain something; else it begins again.

What makes sense is for the caller to know: `judge` is given blocks and settings, and says how many bytes it explains.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from ..chunks import Block
from .settings import PortSettings

Judge = Callable[[Sequence[Block], PortSettings], int]

_ORDER: Final = (
    (9600, "N"), (19200, "E"), (9600, "E"), (19200, "N"), (115200, "N"), (38400, "N"), (57600, "N"), (38400, "E"),
    (115200, "E"), (57600, "E"), (4800, "N"), (4800, "E"), (2400, "N"), (2400, "E"), (1200, "N"), (1200, "E"),
    (9600, "O"), (19200, "O"), (38400, "O"), (115200, "O"), (57600, "O"), (4800, "O"), (2400, "O"), (1200, "O"),
    (230400, "N"), (76800, "N"), (250000, "N"), (500000, "N"), (921600, "N"), (14400, "N"), (28800, "N"), (600, "N"),
)  # fmt: skip
_ENOUGH: Final = 160  # bytes that tell for certain
# Fewer tell something, too, so long (ns) after the first one: a fast line heard too slowly gives few.
_PATIENCE: Final = ((16, 1_500_000_000), (4, 5_000_000_000))
_SETTLE: Final = 0.85  # of the bytes explained and without error
_ACCEPT: Final = 0.25  # at the least, after all were tried


@dataclass(frozen=True, slots=True)
class Try:
    """What became of one try: `score` 0 to 1."""

    settings: PortSettings
    score: float
    bytes: int

    def __str__(self) -> str:
        return f"{self.settings}: {self.score:.0%} of {self.bytes} bytes are readable"


class Search:
    """Tries settings one after the other. `settings` are those to listen with now; `found` once it is over."""

    def __init__(self, port: PortSettings, judge: Judge, *, free_parity: bool = True) -> None:
        """`port.baud` None: the rate is sought; `free_parity`: parity is, too."""
        rates = [(port.baud, parity) for parity in "NEO"] if port.baud is not None else list(_ORDER)
        if not free_parity:
            rates = [(baud, parity) for baud, parity in rates if parity == port.parity]
            rates = list(dict.fromkeys(rates)) or [(baud, port.parity) for baud, _ in _ORDER]
        self._candidates = [replace(port, baud=baud, parity=parity) for baud, parity in rates]
        self._judge = judge
        self._at = 0
        self._tries: list[Try] = []
        self.heard: list[Block] = []
        self.found: PortSettings | None = None
        self._since: int | None = None

    @property
    def settings(self) -> PortSettings:
        """What to listen with now."""
        return self.found or self._candidates[self._at]

    def feed(self, block: Block) -> None:
        """What was heard with these settings."""
        if self._since is None:
            self._since = int(block.t_ns[0])
        self.heard.append(block)

    def step(self, now_ns: int) -> Try | None:
        """A try that is over by now; then `settings` are the next ones, or `found` is set."""
        octets = sum(len(block.data) for block in self.heard)
        waited = 0 if self._since is None else now_ns - self._since
        if octets < _ENOUGH and not any(octets >= some and waited >= patience for some, patience in _PATIENCE):
            return None
        errors = sum(len(block.errors) for block in self.heard)
        explained = self._judge(self.heard, self.settings)
        score = explained / octets * (1 - errors / octets)
        done = Try(self.settings, score, octets)
        self._tries.append(done)
        if score >= _SETTLE:
            self.found = done.settings
            return done
        self._next()
        return done

    def _next(self) -> None:
        self.heard, self._since = [], None
        self._at += 1
        if self._at == len(self._candidates):
            best = max(self._tries, key=lambda each: each.score)
            self._at, self._tries = 0, []
            if best.score >= _ACCEPT:
                self.found = best.settings
