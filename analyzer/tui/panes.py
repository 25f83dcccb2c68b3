"""The row of views on top, one line, numbered, clickable; and the panes of the view that is shown: which has the keys,
and how much room each has.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from rich.text import Text
from textual import events
from textual.widget import Widget
from textual.widgets import Static

from ..languages import tr
from .messages import ViewWanted
from .view import View
from .views import BY_NAME, VIEWS

if TYPE_CHECKING:
    from .screen import BusScreen


class Tabs(Static):
    """The views by number; the chosen one stands out."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, markup=False)
        self.chosen = VIEWS[0].name
        self.troubles = 0

    def choose(self, view: str) -> None:
        """Another view is shown."""
        self.chosen = view
        self.refresh()

    def _words(self) -> list[tuple[View, str]]:
        """Each view with its text, as short as the width needs."""
        for narrow in (False, True):
            words = [(view, self._word(view, narrow=narrow)) for view in VIEWS]
            if sum(len(text) for _, text in words) <= self.size.width:
                return words
        return [
            (view, f" {_digit(view)} {_tab_title(view) if view.name == self.chosen else ''}".ljust(3)) for view in VIEWS
        ]

    def _word(self, view: View, *, narrow: bool) -> str:
        title = _tab_title(view) if narrow else tr(view.title)
        return f" {_digit(view)} {title}{' ' if not narrow or view.name == self.chosen else ''}"

    def render(self) -> Text:
        line = Text(no_wrap=True)
        for view, text in self._words():
            line.append(text, "reverse bold" if view.name == self.chosen else "")
        return line

    def on_click(self, event: events.Click) -> None:
        offset = event.get_content_offset(self)
        at = 0
        for view, text in self._words():
            if offset is not None and at <= offset.x < at + len(text):
                self.post_message(ViewWanted(view.name))
            at += len(text)


def _digit(view: View) -> str:
    """The first of its keys."""
    return view.key.partition(",")[0]


def _tab_title(view: View) -> str:
    return tr(view.short or view.title)


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
