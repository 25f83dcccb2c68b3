"""What the user adds to rows: bookmarks, comments, the time reference; kept beside the capture."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

from captures import CaptureError

from ..languages import error_words, tr
from ..words import TimeBase
from .frames import FrameList
from .prompts import Ask

if TYPE_CHECKING:
    from .screen import BusScreen


class Bookmarks:
    """The main screen's notes, as the user sets them."""

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen
        self._desk = screen.desk

    def toggle(self) -> None:
        """Set a bookmark on the row, or take it away."""
        screen, notes = self._screen, self._desk.notes
        if screen.row is None:
            return
        spot = self._desk.place(screen.row)

        def change() -> None:
            comment = notes.comments.get(spot)
            if notes.toggle(spot):
                where = tr("until you leave") if notes.path is None else tr("in {file}", file=notes.path.name)
                screen.tell(tr("bookmark kept {where}; ' goes to the next", where=where))
            else:
                gone = tr("bookmark and comment") if comment else tr("bookmark")
                screen.tell(tr("{gone} taken away; u brings it back", gone=gone))

        self._noted(change)

    def undo(self) -> None:
        """Take back the newest change of a bookmark or comment."""

        def change() -> None:
            spot = self._desk.notes.undo()
            row = -1 if spot is None else self._desk.bus.table.row_of_byte(*spot)
            self._screen.tell(tr("nothing to take back") if spot is None else tr("taken back"))
            if row >= 0:
                self._screen.jumps.go(row)

        self._noted(change)

    def refer(self) -> None:
        """Make the row the time reference; again takes it back."""
        screen, notes = self._screen, self._desk.notes
        if screen.row is None or not self._desk.bus.timed:
            screen.tell(tr("no times here"))
            return
        spot = self._desk.place(screen.row)
        again = notes.reference == spot
        self._desk.base = TimeBase.START if again else TimeBase.REFERENCE
        self._noted(lambda: notes.refer(None if again else spot))

    async def ask_comment(self) -> None:
        """Ask for a comment on the row."""
        screen, notes = self._screen, self._desk.notes
        if screen.row is None:
            return
        spot = self._desk.place(screen.row)
        hint = tr("Enter keeps it beside the capture") if notes.path else tr("Enter keeps it until you leave")
        text = await screen.app.push_screen_wait(Ask(tr("Comment"), hint, value=notes.comments.get(spot, "")))
        if text is not None:
            self._noted(lambda: notes.comment(spot, text))

    async def ask_mark(self) -> None:
        """Ask for a note that goes into the recording, and stands as a comment on the newest row."""
        screen, bus = self._screen, self._desk.bus
        mark = getattr(self._desk.source, "mark", None)
        if mark is None or bus.whole:
            screen.tell(tr("marks go into a recording, while it runs; ; comments a row"))
            return
        row = bus.count - 1
        text = await screen.app.push_screen_wait(Ask(tr("Mark this moment in the recording"), tr("what happens now")))
        if text:
            recorded = mark(text)
            if row >= 0:
                self._desk.notes.comments[self._desk.place(row)] = text
            kept = tr("marked in the recording")
            screen.tell(kept if recorded else tr("marked here until you leave: nothing is recorded"))
            screen.repaint_lists()

    def next(self) -> None:
        """Go to the next bookmark, from the first one on again."""
        table = self._desk.bus.table
        rows = sorted(row for row in (table.row_of_byte(*spot) for spot in self._desk.notes.comments) if row >= 0)
        if not rows:
            self._screen.tell(tr("no bookmarks yet: m sets one"))
            return
        current = -1 if self._screen.row is None else self._screen.row
        self._screen.jumps.go(next((row for row in rows if row > current), rows[0]))

    def _noted(self, change: Callable[[], object]) -> None:
        """Change the notes; where they cannot be kept in their file, say so."""
        screen = self._screen
        try:
            change()
        except CaptureError as error:
            screen.tell(tr("kept until you quit only: {error}", error=error_words(error)), wrong=True)
        for each in screen.query(FrameList):
            each.unpaint()
        if screen.row is not None:
            screen.study_row(screen.row)
