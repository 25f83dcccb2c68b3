"""The file that is open, and what the user adds to its rows.

It is read anew, followed as it grows, left for another. Bookmarks, comments and the time reference are kept beside it,
with the marks that were set as it was recorded.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from captures import CaptureError
from captures.recording.notekinds import MARK

from ..languages import error_words, tr
from ..outages import notes_of
from ..words import TimeBase, data_size
from .filterbar import FilterBar
from .frames import FrameList
from .prompts import Ask, names_file, typed_path

if TYPE_CHECKING:
    from ..model.source import ViewSource
    from .screen import BusScreen

_CHECK_S: Final = 1.0
_AGAIN: Final = 64 << 20  # bytes up to which a file that grew is read anew by itself while its end is followed


@dataclass(frozen=True, slots=True)
class NextFile:
    """What is to be shown next, and how: the view, the filter, the row; None is the end of it, followed."""

    path: Path
    view: str | None = None
    filter: str = ""
    row: int | None = 0


class OpenFiles:
    """The main screen's file."""

    def __init__(self, screen: BusScreen, resumed: NextFile | None = None) -> None:
        """`resumed`: what is to be as it was, once all is read."""
        self._screen = screen
        self._resumed = resumed
        self._size = 0
        self.state: tuple[str, str] = ("", "")  # what became of the file since it was read, and the kind of these words

    @property
    def path(self) -> Path | None:
        """The file; None where there is none, as live."""
        return self._screen.desk.source.path

    def read(self, source: ViewSource) -> None:
        """It was read to its end: its marks become bookmarks, and it is looked at whether it grows."""
        capture = getattr(source, "capture", None)
        desk = self._screen.desk
        if capture is None or not desk.bus.count:
            return
        for note in notes_of(capture):
            if note.kind == MARK:
                desk.notes.comments.setdefault(desk.place(desk.bus.table.row_at_time(note.t_ns)), note.text)
        self._size = self._now()
        self._screen.set_interval(_CHECK_S, self._check_growth)

    def resume(self) -> None:
        """The filter and the row as they were before the file was read anew."""
        resumed, self._resumed = self._resumed, None
        screen = self._screen
        if resumed is None or self.path is None:
            return
        if resumed.filter:
            screen.query_one(FilterBar).use_filter(resumed.filter)
        if resumed.row is None:
            screen.action_follow()
        elif 0 < resumed.row < screen.desk.bus.count:
            screen.studied = resumed.row
            for each in screen.query(FrameList):
                each.go_to_row(resumed.row)

    def _now(self) -> int:
        """Its size; -1 where it is gone."""
        try:
            return 0 if self.path is None else self.path.stat().st_size
        except OSError:
            return -1

    def _check_growth(self) -> None:
        """Whether it has grown since, was cut, or is gone: that stands in the status line as long as it is so."""
        size = self._now()
        if not self._screen.is_current:  # a question in front of it has the word
            return
        if self._screen.frames.following and self._size < size <= _AGAIN:
            self.again(follow=True)
            return
        state = self._state(size)
        if state != self.state:
            self.state = state
            self._screen.write_status()

    def _state(self, size: int) -> tuple[str, str]:
        if size < 0:
            return tr("the file is gone: shown from memory"), "error"
        if size < self._size:
            return tr("the file was truncated or rewritten (Ctrl+R)"), "error"
        if size > self._size:
            return tr("grown by {size} (Ctrl+R, F follows)", size=data_size(size - self._size)), "warning"
        return "", ""

    def again(self, *, follow: bool = False) -> None:
        """Read it anew: the same view, filter and row."""
        screen = self._screen
        if self.path is None:
            screen.notify_of(tr("there is no file to reload"))
            return
        scope = screen.desk.scope
        text = "" if scope.filter is None else scope.filter.text
        screen.leave(NextFile(self.path, screen.view, text, None if follow else screen.row))

    async def ask(self) -> None:
        """Another file."""
        screen = self._screen
        folder = "" if self.path is None else f"{self.path.parent}/"
        question = Ask(tr("Open"), tr("a capture of any format"), value=folder, wrong=no_capture, selected=False)
        text = await screen.app.push_screen_wait(question)
        if text is not None:
            screen.leave(NextFile(typed_path(text)))


def no_capture(text: str) -> str:
    """Why a file cannot be opened; empty where it can."""
    import captures

    path = typed_path(text)
    if not names_file(path):
        return tr("no file {file}", file=text)
    try:
        captures.open(path)
    except captures.CaptureError as error:
        return error_words(error)
    return ""


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
                screen.notify_of(tr("bookmark saved {where}; ' goes to the next", where=where))
            else:
                gone = tr("bookmark and comment") if comment else tr("bookmark")
                screen.notify_of(tr("{gone} removed; u restores it", gone=gone))

        self._noted(change)

    def undo(self) -> None:
        """Take back the newest change of a bookmark or comment."""

        def change() -> None:
            spot = self._desk.notes.undo()
            row = -1 if spot is None else self._desk.bus.table.row_of_byte(*spot)
            self._screen.notify_of(tr("nothing to undo") if spot is None else tr("undone"))
            if row >= 0:
                self._screen.jumps.go_to_row(row)

        self._noted(change)

    def refer(self) -> None:
        """Make the row the time reference; again takes it back."""
        screen, notes = self._screen, self._desk.notes
        if screen.row is None or not self._desk.bus.timed:
            screen.notify_of(tr("no times here"))
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
            screen.notify_of(tr("marks need a running recording; press ; to comment a row"))
            return
        row = bus.count - 1
        text = await screen.app.push_screen_wait(Ask(tr("Mark this moment in the recording"), tr("what happens now")))
        if text:
            recorded = mark(text)
            if row >= 0:
                self._desk.notes.comments[self._desk.place(row)] = text
            kept = tr("marked in the recording")
            screen.notify_of(kept if recorded else tr("marked here until you leave: nothing is recorded"))
            screen.repaint_lists()

    def next(self) -> None:
        """Go to the next bookmark, from the first one on again."""
        rows = list(self._desk.notes_by_row)
        if not rows:
            self._screen.notify_of(tr("no bookmarks yet: m sets one"))
            return
        current = -1 if self._screen.row is None else self._screen.row
        self._screen.jumps.go_to_row(next((row for row in rows if row > current), rows[0]))

    def _noted(self, change: Callable[[], object]) -> None:
        """Change the notes; where they cannot be kept in their file, say so."""
        screen = self._screen
        try:
            change()
        except CaptureError as error:
            screen.notify_of(tr("saved only until you quit: {error}", error=error_words(error)), wrong=True)
        for each in screen.query(FrameList):
            each.unpaint()
        if screen.row is not None:
            screen.study_row(screen.row)
