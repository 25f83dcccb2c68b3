"""Every cell is a door: what stands under the cursor is filtered to, filtered out, added to the filter, followed."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ..languages import tr
from ..model.search import for_test
from ..model.selection import compiled
from .doorcells import DoorCell
from .filterbar import FilterBar
from .prompts import Choose
from .views import BY_NAME

if TYPE_CHECKING:
    from .screen import BusScreen

_ASKS: Final = {"=": "Filter to", "!": "Filter out", "&": "Add with and", "|": "Add with or", ".": "Go to the next of"}


class Doors:
    """The main screen's doors."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    async def go(self, sign: str) -> None:
        """Ask for a cell of the line where there are several, and go through it."""
        screen = self._screen
        cells = BY_NAME[screen.view].cells(screen)
        if not cells:
            screen.tell(tr("nothing under the cursor to filter by"))
            return
        which: int | None = 0
        if len(cells) > 1:
            which = await screen.app.push_screen_wait(
                Choose(tr(_ASKS[sign]), [(cell.key, cell.words) for cell in cells])
            )
        if which is not None:
            self._through(sign, cells[which])

    def _through(self, sign: str, cell: DoorCell) -> None:
        screen = self._screen
        bar = screen.query_one(FilterBar)
        old, text = bar.text, cell.text
        if sign == ".":
            screen.jumps.find_by(cell.words, for_test(compiled(text, screen.desk.bus.line).test))
        elif sign == "=":
            bar.use(text)
        elif sign == "!":
            bar.use(f"{_grouped(old)} and not ({text})" if old else f"not ({text})")
        else:
            word = "and" if sign == "&" else "or"
            bar.prepare(f"{_grouped(old)} {word} {_grouped(text)}" if old else text)


def _grouped(text: str) -> str:
    """A filter that can be joined to another."""
    return f"({text})" if " and " in text or " or " in text else text
