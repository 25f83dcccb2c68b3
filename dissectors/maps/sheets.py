"""The rows of tables: workbooks, CSV, columns that blanks part. What they mean is for others."""

from __future__ import annotations

import datetime
import io
import re
import zipfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import islice, takewhile
from typing import Any, Final

from .cells import one_line
from .columns import LEAST_CELLS, cut_at_blanks, parts_of_line, without_page_marks
from .model import MapError, MissingLibraryError
from .roles import assigned, is_heading, known_headings
from .table import csv_rows
from .vocabulary import expression, form, heading_bits, plain_heading, tidied, vocabulary

ZIP: Final = b"PK\x03\x04"
_CELL: Final = 1000  # characters
_MOST_COLUMNS: Final = 100  # of a sheet
_LOOK: Final = 60  # lines that tell how a text is cut
_TEXT: Final = 1 << 18  # characters of a text without signs between cells
_START: Final = 20_000  # characters that do
_LEAST_WIDE: Final = 3  # such rows
_DRAWN: Final = str.maketrans("│┃║┆┊╎─━═┄┈┌┬┐├┼┤└┴┘╔╦╗╠╬╣╚╩╝╒╤╕╞╪╡╘╧╛╓╥╖╟╫╢╙╨╜", "|" * 6 + "-" * 5 + "+" * 36)
_MOST_LINES: Final = 16  # of a heading
_UNPACKED: Final = 256 << 20  # bytes of a workbook
_WHOLE: Final = 6 << 20  # bytes up to which it is read at once, with what merges and hides cells
_MERGED: Final = 1 << 17  # cells that may be merged then
_SPREAD: Final = 1 << 18  # cells of a sheet, empty ones counted
_UNKNOWN: Final = re.compile(rb"</f>(?:<v\s*/>|<v></v>)?</c>")
_MERGE: Final = re.compile("<mergeCell [^>]*ref=.([A-Z]{1,3}[0-9]{1,7}:[A-Z]{1,3}[0-9]{1,7})")


class HeldCell(str):
    """Nothing, in a place that a cell of a row above holds: that has the text `above`."""

    above: str

    def __new__(cls, above: str) -> HeldCell:
        cell = super().__new__(cls)
        cell.above = above
        return cell


@dataclass(frozen=True, slots=True)
class MapSheet:
    """A sheet's `rows`, the columns that it hides (from 0), and what is to be said of it."""

    name: str
    rows: list[list[str]]
    hidden: frozenset[int] = frozenset()
    notes: tuple[str, ...] = ()


def notes_of_cut(count: int | None, most: int, what: str) -> tuple[str, ...]:
    """What is said where a file has more rows or other parts than are read."""
    return (f"only the first {most:,} {what} were read",) * ((count or 0) > most)


def ways_in(data: bytes, text: str, name: str, most_rows: int) -> Iterator[list[MapSheet]]:
    """The sheets of a workbook, or the one that a text is, in each way to cut it; MapError names the file."""
    if data.startswith(ZIP):
        yield sheets_of(data, name, most_rows)
        return
    for rows, length in tables_of_text(text, name, most_rows + 1):
        notes = (
            *notes_of_cut(len(text), length, "characters"),
            *notes_of_cut(len(rows), most_rows, "rows"),
            *notes_of_cut(max(map(len, rows), default=0), _MOST_COLUMNS, "columns"),
        )
        yield [MapSheet("", [row[:_MOST_COLUMNS] for row in rows[:most_rows]], notes=notes)]


def sheets_of(data: bytes, name: str, most_rows: int) -> list[MapSheet]:
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
        book, whole = _book(openpyxl, data, whole=size <= _WHOLE and sum(map(_merged_cells, texts)) <= _MERGED)
        unknown = sum(len(_UNKNOWN.findall(text)) for text in texts)
        told = (f"{unknown} formulas have no value yet: open and save the workbook where they are calculated",)
        shown = [sheet for sheet in book.worksheets if sheet.sheet_state == "visible"] or book.worksheets
        return [_sheet(sheet, most_rows, told[: min(unknown, 1)], merged=whole) for sheet in shown]
    except Exception as error:  # a damaged workbook raises whatever its parts do
        raise MapError(f"{name}: not a readable workbook: {one_line(error)}") from error


def _book(library: Any, data: bytes, *, whole: bool) -> tuple[Any, bool]:
    """The workbook, and whether it was read at once: a cell far away would make all the cells between."""
    book = library.load_workbook(io.BytesIO(data), read_only=not whole, data_only=True)
    if whole and any(sheet.max_row * sheet.max_column > _SPREAD for sheet in book.worksheets):
        return library.load_workbook(io.BytesIO(data), read_only=True, data_only=True), False
    return book, whole


def _sheet(sheet: Any, most_rows: int, notes: tuple[str, ...], *, merged: bool) -> MapSheet:
    cut = (
        *notes_of_cut(sheet.max_row, most_rows, "rows"),
        *notes_of_cut(sheet.max_column, _MOST_COLUMNS, "columns"),
    )
    rows = _rows_of(sheet, most_rows, merged=merged)
    return MapSheet(sheet.title, rows, _hidden(sheet) if merged else frozenset(), (*notes, *cut))


def _merged_cells(text: bytes) -> int:
    """How many cells a sheet merges."""
    from openpyxl.utils import range_boundaries

    return sum(
        (right - left + 1) * (bottom - top + 1)
        for left, top, right, bottom in map(range_boundaries, _MERGE.findall(text.decode("ascii", "replace")))
    )


def column_name(column: int) -> str:
    """A, B ... Z, AA of a workbook's column from 0."""
    from openpyxl.utils import get_column_letter

    return str(get_column_letter(column + 1))


def _rows_of(sheet: Any, most_rows: int, *, merged: bool) -> list[list[str]]:
    """The cells as texts; what is merged over columns holds its text in each of them, below its first row nothing."""
    most_columns = _MOST_COLUMNS
    if merged:
        most_rows, most_columns = min(most_rows, sheet.max_row), min(most_columns, sheet.max_column)
    values: Iterable[Sequence[object]] = sheet.iter_rows(values_only=True, max_row=most_rows, max_col=most_columns)
    rows = [[_shown_text(cell) for cell in row] for row in values]
    if merged:
        for area in sheet.merged_cells.ranges:
            row, first = area.min_row - 1, area.min_col - 1
            if row < len(rows) and area.min_col < area.max_col < len(rows[row]):  # not a title over the whole table
                rows[row][first : area.max_col] = [rows[row][first]] * (min(area.max_col, len(rows[row])) - first)
            for below in rows[row + 1 : area.max_row] if area.min_col == area.max_col <= len(rows[0]) else ():
                below[first] = HeldCell(rows[row][first])
    return rows


def _hidden(sheet: Any) -> frozenset[int]:
    spans = (
        range(one.min - 1, min(one.max, 1 << 14)) for one in sheet.column_dimensions.values() if one.hidden and one.min
    )
    return frozenset(column for span in spans for column in span)


def _shown_text(cell: object) -> str:
    """What a cell shows. A day among registers was a range (10-11) that the spreadsheet took for one: none of its
    numbers is an address."""
    if cell is None:
        return ""
    if isinstance(cell, datetime.date | datetime.time):
        return "(a date)" if isinstance(cell, datetime.date) else "(a time)"
    if isinstance(cell, float):
        return f"{cell:.15g}"
    return str(cell).strip()[:_CELL]


def tables_of_text(text: str, file: str, most: int) -> Iterator[tuple[list[list[str]], int]]:
    """The rows of a text in each way that may be meant, and how many characters of it were read: as its layout has
    them; else CSV with any sign between cells, and columns that blanks part, as PDFs are copied."""
    text = text.translate(_DRAWN).replace(r"\|", " /")  # a bar within a cell
    shown = text.splitlines()[:most]
    if named := form("separator", "".join(shown[:1])):  # Excel's own line
        yield _cut(["", *shown[1:]], named["sign"], file), len(text)
        return
    looks = ((one, expression(one["looks"]).search(text)) for one in vocabulary()["layouts"])
    laid_out, mark = next((found for found in looks if found[1]), ({}, None))
    if mark:
        yield _laid_out(text, laid_out, most), len(text)
        if mark.start() < _START or text.lstrip().startswith("<"):
            return
    start = without_page_marks(expression("{LEADERS}").sub("   ", text[:_TEXT]).splitlines()[:most])
    head = shown[:_LOOK]
    sign = max("\t;,|", key="\n".join(head).count)
    signed = sum(line.count(sign) > 1 for line in head)
    wide = sum(len(parts_of_line(line)) >= LEAST_CELLS for line in start[:_LOOK])
    if wide >= max(_LEAST_WIDE, 2 * signed) or any(form("rule_above", line) for line in head):
        yield [*cut_at_blanks(start)], _TEXT
    if max(wide, signed) < _LEAST_WIDE:
        yield _cut_at_words(start), _TEXT
        joined = expression(r"(?<=\S)(?:\n[ \t]*){1,4}\(").sub(" (", text[:_TEXT])
        yield [*_cut_at_lines(joined.splitlines()[:most])], _TEXT
    yield _cut(shown, sign, file), len(text)


def _laid_out(text: str, layout: Mapping[str, str], most: int) -> list[list[str]]:
    """The rows of a text by the patterns of its layout: what parts rows and cells, and what is a mark in them."""
    from html import unescape

    row, cell, mark, span = (expression(layout.get(part, "(?!)")) for part in ("row", "cell", "marks", "span"))
    line_break = expression(layout.get("break", "(?!)"))
    above: dict[int, list[str]] = {}  # what the next rows have in a column of a cell above
    rows = []
    for line in (found[1] for found in islice(row.finditer(text), most)):
        shown: list[str] = []
        parts = [*islice(cell.finditer(line), _MOST_COLUMNS)]
        if not parts:  # a title
            rows.append([unescape(mark.sub("", line_break.sub(" ", line))).strip()[:_CELL]])
            continue
        for part in parts:
            _pass_spanned(shown, above)
            spans = {name.lower(): int(count) for name, count in span.findall(part.groupdict().get("spans") or "")}
            width = max(1, spans.get("colspan", 1)) if len(parts) > 1 else 1  # alone: a title
            columns = range(len(shown), min(len(shown) + width, _MOST_COLUMNS))
            text = unescape(mark.sub("", line_break.sub("\n", part["cell"] or ""))).strip()[:_CELL]
            above |= {column: [HeldCell(text)] * (spans.get("rowspan", 1) - 1) for column in columns}
            shown += [text] * len(columns)
        _pass_spanned(shown, above)
        rows.append(shown)
    return rows


def _pass_spanned(shown: list[str], above: Mapping[int, list[str]]) -> None:
    """Nothing in the next columns of a row, as long as a cell above holds them."""
    while above.get(len(shown)):
        shown.append(above[len(shown)].pop())


def _cut(lines: Sequence[str], delimiter: str, file: str) -> list[list[str]]:
    rows = csv_rows(lines, delimiter, file)
    kind = ("of no marks", "cell")[delimiter == "|"]
    return [[tidied(kind, cell)[:_CELL] for cell in row[: _MOST_COLUMNS + 1]] for _, row in rows]


def _cut_at_words(lines: Sequence[str]) -> list[list[str]]:
    """Cells that single blanks part, as some PDFs are copied: of a row below a heading of known words, what is over is
    the name's; other lines as they stand."""
    cut = [line.split(maxsplit=_MOST_COLUMNS) for line in lines]
    head = max(cut[:_LOOK], key=known_headings, default=[])
    if known_headings(head) <= LEAST_CELLS:
        return [[line] for line in lines]
    name = max(range(len(head)), key=lambda at: heading_bits(plain_heading(head[at]), "name"))
    rows = []
    for line, words in zip(lines, cut, strict=True):
        over = len(words) - len(head)
        is_row = min(over + 1, name) > 0 and (words == head or words[0][:1].isdecimal())
        end = name + over + 1
        rows.append([*words[:name], " ".join(words[name:end]), *words[end:]] if is_row else [line])
    return rows


def _cut_at_lines(lines: Sequence[str]) -> Iterator[list[str]]:
    """Cells that have a line each, as others are copied: as many to a row as there are headings before the first
    number; other lines as they stand."""
    lines = [*filter(None, map(str.strip, lines))]
    head: list[str] = []
    at = place = 0
    while at < len(lines):
        named = [*takewhile(lambda line: not line[:1].isdecimal(), lines[at : at + _MOST_LINES])]
        row = lines[at : at + len(head)]
        if heading_bits(plain_heading(lines[at]), "address") and is_heading(named):
            row = head = named
            place = assigned(head, ()).get("address", 0)
        elif not form("place", "".join(row[place:][:1])) or len({*row} & {*head}) > 1:
            row = lines[at : at + 1]
        yield row
        at += len(row)
