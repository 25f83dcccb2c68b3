"""The panes of the view that is shown: which has the keys, and how much room each has."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.widget import Widget

from .views import BY_NAME

if TYPE_CHECKING:
    from .screen import BusScreen

_LEAST, _MOST = 15, 80  # percent of the screen that the frame below may take


class Panes:
    """The main screen's panes."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen

    @property
    def all(self) -> list[Widget]:
        """What can have the keys, the view's list first."""
        screen = self._screen
        part, detail = screen.query_one(f"#{screen.view}"), screen.detail
        own = [widget for widget in (part, *part.query("*")) if widget.focusable]
        return [*own, detail.fields, detail.octets] if BY_NAME[screen.view].detail else own

    def step(self, step: int) -> None:
        """From the list to the fields, to the bytes, and round."""
        panes = self.all
        at = next((i for i, pane in enumerate(panes) if pane.has_focus), -1)
        panes[(at + step) % len(panes) if at >= 0 else 0].focus()

    def zoom(self) -> None:
        """The list alone, or the frame below alone; again both."""
        views, detail = self._screen.query_one("#views"), self._screen.detail
        if not (views.display and detail.display) and BY_NAME[self._screen.view].detail:
            views.display = detail.display = True
            detail.set_class(False, "-zoomed")
        elif detail.has_focus_within:
            views.display = False
            detail.set_class(True, "-zoomed")
        else:
            detail.display = False

    def size(self, step: int) -> None:
        """More or less room for the frame below, in percent of the screen."""
        detail = self._screen.detail
        share = round(100 * detail.size.height / max(1, self._screen.size.height)) + step
        detail.styles.height = f"{max(_LEAST, min(_MOST, share))}%"
