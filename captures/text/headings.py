"""What a line of words says of the rows of bytes below it."""

from __future__ import annotations

from typing import NamedTuple

from .tools import NONE, LineMark


class Heading(NamedTuple):
    """What a line says of the rows of bytes below it."""

    mark: int
    t_ns: int | None
    fine: bool
    label: str
    port: str = ""
    left: int | None = None  # bytes still to come, where it says how many there are
    joins: bool = False  # all rows below it are one read
    exact: bool = False  # nothing else stands below it before all bytes are there
    rows: int = 0  # that it has had
    width: int = 0  # bytes of the row before
    columns: tuple[int, ...] = ()  # marks of a table's columns: `request,response`
    parted: str = ""  # the sign between the cells of a table
    cells: tuple[int, ...] = ()  # the mark that each cell of its first line has

    def mark_at(self, text: str, start: int) -> int:
        """The mark of what stands at a place of a row."""
        if len(self.columns) < 2 or not self.parted:
            return self.mark
        cell = text.count(self.parted, 0, start)
        return self.cells[cell] if cell < len(self.cells) else NONE


def marks_of_cells(text: str, line_marks: list[LineMark]) -> tuple[str, tuple[int, ...]]:
    """What parts the cells of a table's first line, and the mark of each; none where both stand in one."""
    parted = next((sign for sign in ("\t", ";", ",", "|") if sign in text), "")
    if not parted or len(line_marks) < 2:
        return "", ()
    cells: list[set[int]] = [set() for _ in range(text.count(parted) + 1)]
    for mark in line_marks:
        cells[text.count(parted, 0, mark.start)].add(mark.mark)
    return parted, tuple(cell.pop() if len(cell) == 1 else NONE for cell in cells)
