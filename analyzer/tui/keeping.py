"""Keeping something: bookmarks, comments, the time reference, copies, exports."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from textual import work
from textual.worker import get_current_worker

from analyzer.model.clock import TimeBase
from analyzer.model.saving import save
from analyzer.model.selection import Selection

from .copying import WAYS
from .messages import RowsSaved
from .part import Part
from .prompts import Ask, Choose

if TYPE_CHECKING:
    pass


class Keeping(Part):
    """The part of the main screen that keeps things."""

    def selected(self) -> NDArray[np.int64]:
        """The rows from the anchor to the cursor that the list shows."""
        if self.pinned is None or self.row is None:
            return np.zeros(0, np.int64)
        low, high = sorted((self.pinned, self.row))
        shown = self.frames.rows
        if isinstance(shown, Selection):
            rows = shown.rows()
            return rows[(rows >= low) & (rows <= high)]
        return np.arange(low, high + 1)

    def action_select(self) -> None:
        """Begin a selection at the cursor, or end it."""
        self.pinned = None if self.pinned is not None or self.view != "frames" else self.row
        self.frames.pinned = self.pinned
        self.frames.unpaint()
        self.say()

    def _noted(self, change: Callable[[], object]) -> None:
        """Change the notes; where they cannot be kept in their file, say so."""
        from captures import CaptureError

        try:
            change()
        except CaptureError as error:
            self.tell(f"kept until you quit only: {error}", wrong=True)
        for each in (self.frames, self.talk):
            each.unpaint()
        if self.row is not None:
            self.study_row(self.row)

    def action_bookmark(self) -> None:
        """Set a bookmark on the row, or take it away."""
        if self.row is not None:
            notes, place = self.desk.notes, self.desk.place(self.row)

            def toggle() -> None:
                said = notes.comments.get(place)
                if notes.toggle(place):
                    kept = "until you quit" if notes.path is None else f"in {notes.path.name}"
                    self.tell(f"bookmark kept {kept}; ' goes to the next")
                else:
                    self.tell("bookmark and comment taken away" if said else "bookmark taken away")

            self._noted(toggle)

    def action_reference(self) -> None:
        """Make the row the time reference; again takes it back."""
        if self.row is None or not self.desk.bus.timed:
            self.tell("no times here")
            return
        notes, place = self.desk.notes, self.desk.place(self.row)
        again = notes.reference == place
        self.desk.base = TimeBase.START if again else TimeBase.REFERENCE
        self._noted(lambda: notes.refer(None if again else place))

    @work
    async def action_comment(self) -> None:
        """Ask for a comment on the row."""
        if self.row is None:
            return
        place, notes = self.desk.place(self.row), self.desk.notes
        text = await self.app.push_screen_wait(
            Ask("Comment", "Enter keeps it beside the capture", value=notes.comments.get(place, ""))
        )
        if text is not None:
            self._noted(lambda: notes.comment(place, text))

    @work
    async def action_copy(self) -> None:
        """Ask how, and put the bytes on the terminal's clipboard (OSC 52)."""
        data = self._chosen_bytes()
        if not data:
            self.tell("no bytes to copy")
            return
        which = await self.app.push_screen_wait(
            Choose(f"Copy {len(data)} bytes as", [(way.key, way.name) for way in WAYS])
        )
        if which is not None:
            self.app.copy_to_clipboard(WAYS[which].write(data))
            self.tell("copied, if the terminal allows it (OSC 52)")

    def _chosen_bytes(self) -> bytes:
        """The selected rows' bytes, those of the field in focus, or the frame's."""
        if self.pinned is not None:
            return b"".join(self.desk.bus.captured(int(row)) for row in self.selected()[:256])
        from .details import Details

        details = self.query_one(Details)
        if details.has_focus and details.item is not None and details.item.length:
            item = details.item
            return self.look.data[item.start : item.start + item.length]
        return self.look.data

    @work
    async def action_export(self) -> None:
        """Ask for a file, and write the selected rows to it, or the shown ones."""
        rows = self._rows_to_save()
        if not len(rows):
            self.tell("no rows to export")
            return
        what = "selected" if self.pinned is not None else "shown"

        def wrong(text: str) -> str:
            from analyzer.exports import ExportError
            from analyzer.exports.sink import target

            try:
                target(Path(text).expanduser())
            except ExportError as error:
                return str(error)
            return "" if Path(text).expanduser().parent.is_dir() else f"no such folder as {Path(text).parent}"

        text = await self.app.push_screen_wait(
            Ask(f"Export the {len(rows):,} rows {what} to", "a file; its suffix tells the format", wrong=wrong,
                value="frames.csv")
        )  # fmt: skip
        if text:
            self.doing = "exporting"
            self.say()
            self.write_rows(rows, Path(text).expanduser())

    def _rows_to_save(self) -> NDArray[np.int64]:
        if self.pinned is not None:
            return self.selected()
        shown = self.frames.rows
        return shown.rows() if isinstance(shown, Selection) else np.arange(shown.count)

    @work(thread=True, group="export", exit_on_error=False)
    def write_rows(self, rows: NDArray[np.int64], path: Path) -> None:
        """Write them."""
        worker = get_current_worker()
        count, trouble = 0, ""
        try:
            count = save(self.desk.bus, self.desk.source, rows, path, lambda: worker.is_cancelled)
        except Exception as error:  # told in one line
            trouble = str(error) or type(error).__name__
        self.post_message(RowsSaved(str(path), count, trouble))

    def on_rows_saved(self, event: RowsSaved) -> None:
        self.doing = ""
        self.say()
        if event.trouble:
            self.tell(event.trouble, wrong=True)
        else:
            self.tell(f"{event.count:,} rows written to {event.path}")
