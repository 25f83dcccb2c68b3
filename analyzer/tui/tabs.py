"""The row of views on top: one line, numbered, clickable."""

from __future__ import annotations

from typing import NamedTuple

from rich.text import Text
from textual import events
from textual.widgets import Static

from .messages import ViewWanted


class View(NamedTuple):
    """A view of the bus: its id, its name, and a shorter one for narrow terminals."""

    id: str
    name: str
    short: str


VIEWS = (
    View("frames", "Frames", "Frames"),
    View("conversations", "Conversations", "Talk"),
    View("findings", "Findings", "Findings"),
    View("units", "Units", "Units"),
    View("registers", "Registers", "Registers"),
    View("timeline", "Timeline", "Timeline"),
    View("report", "Report", "Report"),
    View("paste", "Paste", "Paste"),
)


class Tabs(Static):
    """The views by number; the chosen one stands out."""

    def __init__(self, *, id: str) -> None:
        super().__init__(id=id, markup=False)
        self.chosen = VIEWS[0].id
        self.troubles = 0

    def choose(self, view: str) -> None:
        """Another view is shown."""
        self.chosen = view
        self.refresh()

    def _words(self) -> list[tuple[View, str]]:
        """Each view with its text, as short as the width needs."""
        for narrow in (False, True):
            words = [
                (
                    view,
                    f" {i} {view.short if narrow else view.name}{' ' if not narrow or view.id == self.chosen else ''}",
                )
                for i, view in enumerate(VIEWS, 1)
            ]
            if sum(len(text) for _, text in words) <= self.size.width:
                return words
        return [
            (view, f" {i} {view.short if view.id == self.chosen else ''}".ljust(3)) for i, view in enumerate(VIEWS, 1)
        ]

    def render(self) -> Text:
        line = Text(no_wrap=True)
        for view, text in self._words():
            line.append(text, "reverse bold" if view.id == self.chosen else "")
        return line

    def on_click(self, event: events.Click) -> None:
        offset = event.get_content_offset(self)
        at = 0
        for view, text in self._words():
            if offset is not None and at <= offset.x < at + len(text):
                self.post_message(ViewWanted(view.id))
            at += len(text)
