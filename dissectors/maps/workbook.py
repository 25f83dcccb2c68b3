"""The sheets of an XLSX workbook as rows of texts: merged cells spread, hidden columns known, dates no numbers."""

from __future__ import annotations

import datetime
import io
import re
import zipfile
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Final

from .cells import one_line
from .model import MapError, MissingLibraryError

CELL: Final = 1000  # characters
_UNPACKED: Final = 256 << 20  # bytes of a workbook
_WHOLE: Final = 6 << 20  # bytes up to which it is read at once, with what merges and hides cells
_MERGED: Final = 1 << 17  # cells that may be merged then
_SPREAD: Final = 1 << 18  # cells of a sheet, empty ones counted
_UNKNOWN: Final = re.compile(rb"</f>(?:<v\s*/>|<v></v>)?</c>")
_MERGE: Final = re.compile(rb"<mergeCell [^>]*ref=.([A-Z]{1,3})([0-9]{1,7}):([A-Z]{1,3})([0-9]{1,7})")


@dataclass(frozen=True, slots=True)
class WorkbookSheet:
    """A sheet's `rows`, the columns that it hides (from 0), and what is to be said of it."""

    name: str
    rows: list[list[str]]
    hidden: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()


def sheets_of(data: bytes, name: str, most_rows: int, most_columns: int) -> list[WorkbookSheet]:
    """The sheets that are shown, or all where none is; MapError names the file."""
    try:
        import openpyxl
    except ImportError as error:
        raise MissingLibraryError(f"{name}: a workbook (or save it as CSV)", "openpyxl", "xlsx") from error
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as packed:
            size = sum(part.file_size for part in packed.infolist())
            if size > _UNPACKED:
                raise MapError("too large once unpacked")
            parts = [part for part in packed.namelist() if part.startswith("xl/worksheets/") and size <= _WHOLE]
            texts = [packed.read(part) for part in parts]
        whole = size <= _WHOLE and sum(map(_merged_cells, texts)) <= _MERGED
        notes: tuple[str, ...] = ()
        if unknown := sum(len(_UNKNOWN.findall(text)) for text in texts):
            notes = (f"{unknown} formulas have no value yet: open and save the workbook where they are calculated",)
        book = openpyxl.load_workbook(io.BytesIO(data), read_only=not whole, data_only=True)
        if whole and any(sheet.max_row * sheet.max_column > _SPREAD for sheet in book.worksheets):
            whole = False  # a cell far away: read at once, all the cells between would be made
            book = openpyxl.load_workbook(io.BytesIO(data), read_only=True, data_only=True)
        shown = [sheet for sheet in book.worksheets if sheet.sheet_state == "visible"] or book.worksheets
        return [
            WorkbookSheet(
                sheet.title,
                _rows_of(sheet, most_rows, most_columns, merged=whole),
                _hidden(sheet) if whole else frozenset(),
                notes,
            )
            for sheet in shown
        ]
    except Exception as error:  # a damaged workbook raises whatever its parts do
        raise MapError(f"{name}: no readable workbook: {one_line(error)}") from error


def _merged_cells(text: bytes) -> int:
    """How many cells a sheet merges."""
    return sum(
        (_column(right) - _column(left) + 1) * (int(bottom) - int(top) + 1)
        for left, top, right, bottom in _MERGE.findall(text)
    )


def _column(letters: bytes) -> int:
    column = 0
    for letter in letters:
        column = 26 * column + letter - 64
    return column


def column_name(column: int) -> str:
    """A, B ... Z, AA of a column from 0."""
    name = ""
    column += 1
    while column:
        column, letter = divmod(column - 1, 26)
        name = chr(65 + letter) + name
    return name


def _rows_of(sheet: Any, most_rows: int, most_columns: int, *, merged: bool) -> list[list[str]]:
    """The cells as texts; what is merged over columns holds its text in each of them, below its first row nothing."""
    if merged:
        most_rows, most_columns = min(most_rows, sheet.max_row), min(most_columns, sheet.max_column)
    values: Iterable[Sequence[object]] = sheet.iter_rows(values_only=True, max_row=most_rows, max_col=most_columns)
    rows = [[_text(cell) for cell in row] for row in values]
    if merged:
        for area in sheet.merged_cells.ranges:
            row, first = area.min_row - 1, area.min_col - 1
            if row < len(rows) and area.min_col < area.max_col < len(rows[row]):  # not a title over the whole table
                rows[row][first : area.max_col] = [rows[row][first]] * (min(area.max_col, len(rows[row])) - first)
    return rows


def _hidden(sheet: Any) -> frozenset[int]:
    spans = (range(one.min - 1, one.max) for one in sheet.column_dimensions.values() if one.hidden and one.min)
    return frozenset(column for span in spans for column in span if column < 1 << 14)


def _text(cell: object) -> str:
    """What a cell shows. A day among registers was a range (10-11) that the spreadsheet took for one: none of its
    numbers is an address."""
    if cell is None:
        return ""
    if isinstance(cell, datetime.date | datetime.time):
        return "(a date)" if isinstance(cell, datetime.date) else "(a time)"
    if isinstance(cell, float):
        return f"{cell:.15g}"
    return str(cell).strip()[:CELL]
