"""The row of views on top: one line, numbered, clickable."""

from __future__ import annotations

from rich.text import Text
from textual import events
from textual.widgets import Static

from ..languages import tr
from .messages import ViewWanted
from .view import View
from .views import VIEWS


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
            (view, f" {_digit(view)} {_short(view) if view.name == self.chosen else ''}".ljust(3)) for view in VIEWS
        ]

    def _word(self, view: View, *, narrow: bool) -> str:
        title = _short(view) if narrow else tr(view.title)
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


def _short(view: View) -> str:
    return tr(view.short or view.title)
