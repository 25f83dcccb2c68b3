"""In what words frames are told: English here; whoever tells them otherwise hands over words of the same kind."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final


def plural(number: int, noun: str) -> str:
    """`1 coil`, `3 coils`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


@dataclass(frozen=True, slots=True)
class Wording:
    """`say` gives words, or a template with the same places, by its English; `count` so many of a noun."""

    say: Callable[[str], str] = str
    count: Callable[[int, str], str] = plural

    def tell(self, template: str, /, **numbers: object) -> str:
        """A template by its English, filled."""
        return self.say(template).format_map(numbers)


ENGLISH: Final = Wording()
