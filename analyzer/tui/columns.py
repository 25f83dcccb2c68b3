"""Columns of the lists: which are shown, kept among the user's preferences."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from ..languages import tr
from .frames import FrameList
from .prompts import Choose

if TYPE_CHECKING:
    from .screen import BusScreen

_WORDS: Final = {
    "number": "number of the frame", "time": "time", "gap": "silence before it", "unit": "unit",
    "function": "function", "register": "register", "quantity": "quantity", "answer": "time of the answer",
}  # fmt: skip


class ShownColumns:
    """The columns of the list that is shown."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    async def choose(self) -> None:
        """Show and hide them one by one, until Esc."""
        screen, wishes = self._screen, self._screen.desk.wishes
        listing = screen.query_one(f"#{screen.list_view}", FrameList)
        at: int | None = 0
        while at is not None:
            names = [f"{listing.id}.{column}" for column in listing.COLUMNS]
            choices = [
                (str(i), f"{'·' if name in wishes.hidden else '✓'} {tr(_WORDS[column])}")
                for i, (name, column) in enumerate(zip(names, listing.COLUMNS, strict=True), 1)
            ]
            at = await screen.app.push_screen_wait(Choose(tr("Columns; Esc: done"), choices, at=at))
            if at is not None:
                wishes.hidden ^= {names[at]}
                wishes.save()
                listing.unpaint()
