"""The one collection of defects that can be simulated: an entry a code of the findings' table.

    @defect("no-response")
    def no_response(stage: Stage) -> None:
        \"\"\"A unit is silent for once.\"\"\"
        ...

A module of `analyzer.simulation.defects` holds such functions; nothing lists the modules. A function puts the defect on
the stage once, from an idle line to an idle line. One that shapes the whole capture (`whole=True`) is called once, with
the number of exchanges that the capture should have.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Final, TypeVar

from ...registry import Registry

if TYPE_CHECKING:
    from .stage import Stage

EVERY_TAP: Final = ("precise", "irq", "ftdi16", "gateway", "untimed")
TIMED: Final = ("precise",)  # what silences say needs a tap that sees them


@dataclass(frozen=True, slots=True)
class Defect:
    """A defect that can be put on a stage; `taps` are those that can carry its evidence, `units` the fewest that
    it takes."""

    code: str
    place: Callable[..., None]
    taps: tuple[str, ...] = EVERY_TAP
    whole: bool = False
    units: int = 1

    @property
    def words(self) -> str:
        """What happens, in a sentence."""
        return (self.place.__doc__ or "").strip().splitlines()[0]

    def put(self, stage: Stage, exchanges: int) -> None:
        """The whole capture: healthy exchanges with this defect, some 30 times in 400 of them."""
        if self.whole:
            self.place(stage, exchanges)
            return
        stage.healthy(_WARM_UP)
        for _ in range(max(1, exchanges // _APART)):
            stage.healthy(stage.random.randint(_APART - 6, _APART + 2))
            self.place(stage)
        stage.healthy(_LAST)


_WARM_UP: Final = 14  # exchanges: each poll once
_APART: Final = 12
_LAST: Final = 3

_F = TypeVar("_F", bound=Callable[..., None])
_DEFECTS: Final = Registry[Defect]("analyzer.simulation.defects", "defect")


def defect(code: str, **how: Any) -> Callable[[_F], _F]:
    """Enters a function as the defect of this code."""

    def enter(place: _F) -> _F:
        _DEFECTS.enter(code, Defect(code, place, **how))
        return place

    return enter


@cache
def defects() -> Mapping[str, Defect]:
    """All defects, by code."""
    return _DEFECTS.by_name()
