"""What happened, told by widgets to whoever shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.message import Message

if TYPE_CHECKING:
    from textual.widget import Widget

    from ..model.selection import CompiledTest
    from .look import FrameDetail


class LineChosen(Message):
    """The cursor of a list moved."""

    def __init__(self, sender: Widget, line: int) -> None:
        self.sender = sender
        self.line = line
        super().__init__()

    @property
    def control(self) -> Widget:
        return self.sender


class LineEntered(LineChosen):
    """A line was opened."""


class FieldChosen(Message):
    """The cursor of the detail tree moved: bytes `start` to `start + length`."""

    def __init__(self, start: int, length: int) -> None:
        self.start = start
        self.length = length
        super().__init__()


class OctetChosen(Message):
    """The cursor of the bytes moved."""

    def __init__(self, offset: int) -> None:
        self.offset = offset
        super().__init__()


class FilterChanged(Message):
    """A display filter is to be used; None for none."""

    def __init__(self, filter: CompiledTest | None) -> None:
        self.filter = filter
        super().__init__()


class RowWanted(Message):
    """Somebody wants to see a row."""

    def __init__(self, row: int) -> None:
        self.row = row
        super().__init__()


class SpanChosen(Message):
    """A span of time was chosen for the list; None for the whole."""

    def __init__(self, t_start: int, t_end: int) -> None:
        self.t_start = t_start
        self.t_end = t_end
        super().__init__()


class SpanSeen(Message):
    """Another span of time is in sight."""


class ViewWanted(Message):
    """Somebody wants to see another view."""

    def __init__(self, view: str) -> None:
        self.view = view
        super().__init__()


class DetailWanted(Message):
    """Something of a view is to be shown below, where that view is in sight."""

    def __init__(self, view: str, look: FrameDetail) -> None:
        self.view = view
        self.look = look
        super().__init__()


class OnlyChanged(Message):
    """Only transactions are wanted whose answer differs from the last one to that poll; or all again."""


class FilterLeft(Message):
    """The user is done with the filter's line."""
