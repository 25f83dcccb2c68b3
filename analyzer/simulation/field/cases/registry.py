"""The one collection of field cases: a function a case, of as many kinds as its cause shows itself in.

    @field_case("dead-unit")
    def dead_unit(random: Random, tap: str) -> Site:
        \"\"\"One unit of several never answers.\"\"\"
        ...

A module of this package holds such functions; nothing lists the modules.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from random import Random
from typing import Final

from ....registry import Registry
from ..bench import Bench, Expected, FieldCapture

ANY_TAP: Final = ("precise", "irq", "ftdi16", "gateway", "untimed")
TIMED: Final = ("precise", "irq", "ftdi16", "gateway")
LOCAL: Final = ("precise", "irq", "ftdi16")
BYTES: Final = ("precise",)

Site = tuple[Bench, Expected]
Play = Callable[[Random, str], Site]


@dataclass(frozen=True, slots=True)
class FieldCase:
    """A case: its cause or variety, and the taps whose records carry its evidence."""

    name: str
    play: Play
    taps: tuple[str, ...]

    @property
    def words(self) -> str:
        """What is so, in a sentence."""
        return (self.play.__doc__ or "").strip().splitlines()[0]

    def capture(self, tap: str, seed: int) -> FieldCapture:
        """The capture of one seed; the same seed is the same site whatever the tap."""
        bench, expected = self.play(Random(f"{self.name} {seed}"), tap)
        return bench.run(expected)


_CASES: Final = Registry[FieldCase]("analyzer.simulation.field.cases", "field case")


def field_case(name: str, taps: tuple[str, ...] = ANY_TAP) -> Callable[[Play], Play]:
    """Registers a case."""

    def enter(play: Play) -> Play:
        _CASES.enter(name, FieldCase(name, play, taps))
        return play

    return enter


@cache
def field_cases() -> Mapping[str, FieldCase]:
    """All cases by name."""
    return _CASES.by_name()
