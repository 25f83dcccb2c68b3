"""A view of the bus: one record, from which the screen makes its tab, its key, its widget, and what happens in it.

A new view is a file with such a record and a line in `views`. Its functions get the screen, and of a list the widget
whose cursor moved; what they need of the view itself they ask the screen for by the widget's class.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from .doorcells import DoorCell, cells_of_row
from .paint import Painted

if TYPE_CHECKING:
    from textual.widget import Widget

    from .desk import ViewState
    from .screen import BusScreen

JUMPS: Final = ("find", "find_on", "goto", "counterpart", "finding")  # the screen's actions that go to another row


LISTS: Final = ("transactions", "frames")  # the views whose lines are rows of the bus


def nothing(screen: BusScreen) -> None:
    """Nothing is to be done."""


def ignored(screen: BusScreen, sender: Widget) -> None:
    """What was chosen means nothing to others."""


def grown(screen: BusScreen) -> None:
    """The view's one widget paints what came."""
    screen.query_one(f"#{screen.view}", Painted).grown()


def nowhere(screen: BusScreen) -> int | None:  # noqa: ARG001
    """Its cursor stands on no row."""
    return None


@dataclass(frozen=True, slots=True)
class View:
    """A tab of the main screen."""

    name: str  # the widget's id, and what commands call it
    key: str
    title: str
    make: Callable[[ViewState], Widget]
    refresh: Callable[[BusScreen], None] = nothing  # it is shown, or rows came since
    chosen: Callable[[BusScreen, Widget], None] = ignored  # the cursor of one of its lists moved
    entered: Callable[[BusScreen, Widget], None] = ignored  # a line of one of its lists was opened
    shown: Callable[[BusScreen], None] = nothing  # it has just come up
    at: Callable[[BusScreen], int | None] = nowhere  # the row that its cursor stands on
    cells: Callable[[BusScreen], list[DoorCell]] = cells_of_row  # what under its cursor can be filtered by
    short: str = ""  # title on narrow terminals
    detail: bool = False  # with the frame under the cursor below
    filtered: bool = True  # obeys the scope, whose line stands above
    figures: bool = False  # shows figures of the rows that the scope leaves, which take a while to count
    without: tuple[str, ...] = ()  # the screen's actions that mean nothing in it
