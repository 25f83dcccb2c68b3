"""The file that is open: read anew, followed as it grows, left for another; marks that were set as it was recorded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from captures.recording.notes import MARK

from ..languages import error_words, tr
from ..outages import notes_of
from .prompts import Ask

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

    def __init__(self, screen: BusScreen) -> None:
        self._screen = screen
        self._size = 0
        self._announced = False

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

    def _now(self) -> int:
        try:
            return 0 if self.path is None else self.path.stat().st_size
        except OSError:
            return 0

    def _check_growth(self) -> None:
        """Whether it has grown since."""
        size = self._now()
        if size <= self._size:
            return
        if self._screen.frames.following and size <= _AGAIN:
            self.again(follow=True)
        elif not self._announced:
            self._announced = True
            self._screen.tell(tr("the file has grown: Ctrl+R reads it anew, F follows its end"))

    def again(self, *, follow: bool = False) -> None:
        """Read it anew: the same view, filter and row."""
        screen = self._screen
        if self.path is None:
            screen.tell(tr("there is no file to read anew"))
            return
        scope = screen.desk.scope
        text = "" if scope.filter is None else scope.filter.text
        screen.app.exit(NextFile(self.path, screen.view, text, None if follow else screen.row))

    async def ask(self) -> None:
        """Another file."""
        screen = self._screen
        folder = "" if self.path is None else f"{self.path.parent}/"
        question = Ask(tr("Open"), tr("a capture of any format"), value=folder, wrong=_no_capture, selected=False)
        text = await screen.app.push_screen_wait(question)
        if text is not None:
            screen.app.exit(NextFile(Path(text).expanduser()))


def _no_capture(text: str) -> str:
    """Why a file cannot be opened; empty where it can."""
    import captures

    path = Path(text).expanduser()
    if not path.is_file():
        return tr("no such file as {file}", file=text)
    try:
        captures.open(path)
    except captures.CaptureError as error:
        return error_words(error)
    return ""
