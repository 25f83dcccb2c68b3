"""What happened, told by widgets and workers to whoever shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from textual.message import Message

if TYPE_CHECKING:
    from textual.widget import Widget

    from analyzer.model.filtering import Compiled
    from analyzer.model.registers import Reading, Register
    from analyzer.reports.model import Report


class RowsCame(Message):
    """The model holds more rows than before."""


class LoadingEnded(Message):
    """No more rows come; `trouble` says why if it is not that the source was read to its end."""

    def __init__(self, trouble: str = "") -> None:
        self.trouble = trouble
        super().__init__()


class SelectionGrew(Message):
    """A worker put more rows into a selection, or has seen all."""


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

    def __init__(self, filter: Compiled | None) -> None:
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


class ViewWanted(Message):
    """Somebody wants to see another view."""

    def __init__(self, view: str) -> None:
        self.view = view
        super().__init__()


class PieceChosen(Message):
    """Another piece of the paste is looked at."""


class FilterLeft(Message):
    """The user is done with the filter's line."""


class ReportCounted(Message):
    """The bus on one page, as it is known now."""

    def __init__(self, report: Report) -> None:
        self.report = report
        super().__init__()


class HistoryRead(Message):
    """What a register was over time."""

    def __init__(self, register: Register, readings: list[Reading]) -> None:
        self.register = register
        self.readings = readings
        super().__init__()


class HitFound(Message):
    """A search ended; None for nothing found."""

    def __init__(self, row: int | None) -> None:
        self.row = row
        super().__init__()


class RowsSaved(Message):
    """An export ended; `trouble` says why it failed, if it did."""

    def __init__(self, path: str, count: int, trouble: str) -> None:
        self.path = path
        self.count = count
        self.trouble = trouble
        super().__init__()
