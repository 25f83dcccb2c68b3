"""What an attack gives: how much was tried, its figures, and what did not hold."""

from __future__ import annotations

from dataclasses import dataclass, field


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
