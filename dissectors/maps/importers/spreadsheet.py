"""Tables out of manuals: CSV, TSV or XLSX with columns of any names, in English, Russian or German.

Columns are told by their headings, the heading row by how many it has. A type that the table does not name follows
from the number of registers. Addresses that begin with 1 are left as they stand unless all of them are logical (40001
on): which base a manual counts from is for the user to say (`address_base`).
"""

from __future__ import annotations

import datetime
import io
import re
import zipfile
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final

from ..cells import area_and_address, one_line
from ..model import DIGIT_OF_AREA, VALUE_TYPES, MapArea, MapError, MissingLibraryError
from ..table import csv_rows
from ..tablecells import AddressForm, address_form, address_of, is_inverse, order_of, says_order, type_of
from ..tablewords import (
    access_of,
    area_of_cell,
    area_words,
    has_only_states,
    headings,
    is_function,
    is_powers,
    limits_of,
    measure_in,
    merged_headings,
    plain_number,
    unit_of,
    values_of,
)
from .source import ImportedMap, MapBuilder, MapSource, refused, whole_in

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
    rows = [[_shown_text(cell) for cell in row] for row in values]
    if merged:
        for area in sheet.merged_cells.ranges:
            row, first = area.min_row - 1, area.min_col - 1
            if row < len(rows) and area.min_col < area.max_col < len(rows[row]):  # not a title over the whole table
                rows[row][first : area.max_col] = [rows[row][first]] * (min(area.max_col, len(rows[row])) - first)
    return rows


def _hidden(sheet: Any) -> frozenset[int]:
    spans = (range(one.min - 1, one.max) for one in sheet.column_dimensions.values() if one.hidden and one.min)
    return frozenset(column for span in spans for column in span if column < 1 << 14)


def _shown_text(cell: object) -> str:
    """What a cell shows. A day among registers was a range (10-11) that the spreadsheet took for one: none of its
    numbers is an address."""
    if cell is None:
        return ""
    if isinstance(cell, datetime.date | datetime.time):
        return "(a date)" if isinstance(cell, datetime.date) else "(a time)"
    if isinstance(cell, float):
        return f"{cell:.15g}"
    return str(cell).strip()[:CELL]


NAME = "a table"
_LINK: Final = re.compile(r"!?\[([^\[\]]*)\]\([^()\s]*\)")
_ZIP: Final = b"PK\x03\x04"
_LOOK: Final = 60  # rows in which a heading is sought
_UNIT_WORDS: Final = 3  # at most
_FIRST_WORD: Final = {"CDAB": "least significant", None: "most significant"}
MOST_ROWS, MOST_COLUMNS = 70_000, 100  # of a sheet


def recognises(source: MapSource) -> bool:
    """A workbook, or a table with a heading."""
    if source.data.startswith(_ZIP):
        return source.suffix in (".xlsx", ".xlsm", "")
    try:
        return source.is_text and any(headings(row) for row in _rows_of_text(source.text, source.name, _LOOK))
    except MapError:
        return False


def read(source: MapSource) -> list[ImportedMap]:
    """The table, or each sheet that has one."""
    if source.data.startswith(_ZIP):
        sheets = sheets_of(source.data, source.name, MOST_ROWS, MOST_COLUMNS)
    else:
        sheets = [WorkbookSheet("", _rows_of_text(source.text, source.name, MOST_ROWS))]
    several = len(sheets) > 1
    charts = [(area_words(sheet.name), map_of_sheet(source, sheet, several=several)) for sheet in sheets]
    complete = [(area, one) for area, one in charts if one is not None]
    if not complete:
        raise refused(source, "a table of registers", "a row of headings such as address, name, type, unit")
    areas = [area for area, _ in complete if area is not None]
    if len(complete) > 1 and len(set(areas)) == len(complete):
        return [_of_one_device(source, [one for _, one in complete])]
    return [one for _, one in complete]


def _of_one_device(source: MapSource, parts: Sequence[ImportedMap]) -> ImportedMap:
    """Sheets that are named after one area each, as one map."""
    rows = tuple(row for part in parts for row in part.chart.rows)
    notes = dict.fromkeys(note for part in parts for note in part.notes)
    told = f"{len(parts)} sheets, an area each, were taken for one device"
    return ImportedMap(replace(parts[0].chart, device=source.stem, rows=rows), (told, *notes))


def map_of_sheet(source: MapSource, sheet: WorkbookSheet, *, several: bool = False) -> ImportedMap | None:
    """The map of one sheet; a later row of headings begins the next table of it."""
    builder = MapBuilder(source.name, device=f"{source.stem} {sheet.name if several else ''}".strip())
    rows, hidden = _visible(sheet)
    for note in (*hidden, *sheet.notes):
        builder.note(note)
    columns: dict[str, int] = {}
    area = area_words(sheet.name)
    group = above = ""
    form, function, second = AddressForm(), False, 0
    for number, row in enumerate(rows, 1):
        cells = [cell for cell in row if cell]
        if number == second:  # of a heading of two rows
            continue
        if _is_rule(cells):
            continue
        joint = merged_headings(row, rows[number]) if number < len(rows) else None
        if joint or headings(row):
            if joint:
                row, second = joint, number + 1
            below = list(_until_heading(rows[second if joint else number :]))
            heading = headings(row, below)
            columns, above = heading, ""
            addresses = [other[heading["address"]] for other in below if heading["address"] < len(other)]
            if _is_divisor(row, heading, below):
                heading["divisor"] = heading.pop("scale")
                builder.note("gains from 1 up were taken for what raw values are divided by")
            elif "scale" in heading and is_powers(
                [other[heading["scale"]] for other in below if heading["scale"] < len(other)]
            ):
                heading["power"] = heading.pop("scale")
                builder.note("whole factors, some below 0, were taken for powers of ten")
            function = "area" in heading and is_function(row[heading["area"]])
            form = address_form(row[heading["address"]], addresses)
            if form.is_hex and not form.is_said:
                builder.note("addresses were taken for hexadecimal, as some of them have letters")
            continue
        if not columns or not cells:
            area = area_words(" ".join(cells)) or area
            group = _title(cells[0]) if len(cells) == 1 and cells[0].startswith("#") else group
            continue
        if len(cells) == 1:
            group, area = _title(cells[0]) or group, area_words(cells[0]) or area
            continue
        named = {key: row[at].strip() for key, at in columns.items() if at < len(row)}
        above = named.get("area") or above  # one cell for several rows holds its text once
        _row(builder, named, form, area_of_cell(above, function=function) or area, group, number)
    if builder.rows or builder.bits:
        builder.note("columns were told by their headings: look the map over, its address base above all")
    return builder.built() if columns else None


def _visible(sheet: WorkbookSheet) -> tuple[list[list[str]], list[str]]:
    """The rows without the columns that the sheet hides, where what is left is a table, and what is said of it."""
    if not sheet.hidden:
        return sheet.rows, []
    rows = [["" if at in sheet.hidden else cell for at, cell in enumerate(row)] for row in sheet.rows]
    if not any(headings(row) for row in rows[:_LOOK]):
        return sheet.rows, []
    return rows, [f"columns that the sheet hides were left out: {', '.join(map(column_name, sorted(sheet.hidden)))}"]


def _is_divisor(row: Sequence[str], heading: dict[str, int], below: Sequence[Sequence[str]]) -> bool:
    """Whether a column of gains says how many steps a unit has: none is below 1, as a factor would be."""
    at = heading.get("scale")
    if at is None or "divisor" in heading or not row[at].lower().startswith("gain"):
        return False
    cells = [other[at].strip() for other in below if at < len(other)]
    numbers = [int(cell) if cell.isdecimal() else 0 for cell in cells if cell]
    return bool(numbers) and min(numbers) >= 1 and max(numbers) > 1


def _until_heading(rows: Sequence[Sequence[str]]) -> Iterator[Sequence[str]]:
    for row in rows:
        if headings(row):
            return
        if not _is_rule(list(filter(None, row))):
            yield row


def _is_rule(cells: Sequence[str]) -> bool:
    """Whether a row is a line between rows, or nothing."""
    return all(re.fullmatch("[-=:. ]+", cell) for cell in cells)


def _title(text: str) -> str:
    """The title above rows, as a group; a sentence is none."""
    title = text.strip("#*: ")
    return "" if title.endswith(".") and " " in title else title


def _row(
    builder: MapBuilder, cells: dict[str, str], form: AddressForm, area: MapArea | None, group: str, number: int
) -> None:
    position = address_of(cells.get("address", ""), form)
    if position is None:
        builder.note(f"row {number}: {cells.get('address', '')[:30]!r} is no address")
        return
    named = area
    address: object = position.first
    if position.prefixed or _is_logical(position.text, named, form):
        address, named = position.text, None
    elif named is None:
        named = "holding"
    end = address_of(cells.get("end", ""), form)
    last = end.first if end is not None and position.last is None else position.last
    span = last - position.first + 1 if last is not None and last >= position.first else None
    kind, length = type_of(cells.get("type", ""), whole_in(cells.get("length")) or span)
    name = cells.get("name") or cells.get("description") or f"Register {cells.get('address', '')}"
    if not cells.get("name") and not cells.get("description"):
        builder.note(f"row {number}: no name")
    if position.bit is not None:
        where, at = area_and_address(named, address)
        builder.add_bits(where, at, position.bit, 1, " ".join(name.split()))
        return
    wide = VALUE_TYPES.get(kind, 0) > 1
    said = f"{cells.get('order', '')} {cells.get('type', '')}".strip()
    order = order_of(said) if wide else None
    if wide and (cells.get("order") or says_order(said)) and (order is None or is_inverse(said)):
        builder.note(
            f"row {number}: order {said[:30]!r} was taken for {order or 'ABCD'}, {_FIRST_WORD[order]} word first"
        )
    scale, measure = unit_of(cells)
    if len((measure or "").split()) > _UNIT_WORDS:  # of a column for units and remarks
        cells = {"description": measure or "", **cells}
        measure = ""
    if "unit" not in cells:
        name, measure = measure_in(" ".join(name.split()))
    low, high = limits_of(cells)
    states = _states(cells, kind)
    if not states and (held := re.fullmatch(r"(.*\S)\s*[(\[](.*)[)\]]", name)) and has_only_states(held[2]):
        name, states = held[1], values_of(held[2])
    builder.add(
        {
            "area": named,
            "address": address,
            "name": " ".join(name.split()),
            "type": "bool" if named in ("coil", "discrete") or (named is None and position.text[0] in "01") else kind,
            "order": order,
            "length": length if kind in ("text", "bits", "enum") else None,
            "scale": scale if kind not in ("text", "bits", "enum", "bool") else None,
            "offset": plain_number(cells.get("offset", "")),
            "unit": measure,
            "values": states,
            "access": access_of(cells.get("access", "")),
            "min": low,
            "max": high,
            "description": cells.get("description") if cells.get("name") else None,
            "group": cells.get("group") or group,
        },
        f"row {number}: {name[:40]}",
    )


def _states(cells: dict[str, str], kind: str) -> str | None:
    """Names of states or bits out of their column, else out of the remarks."""
    states = values_of(cells.get("values", "")) if kind in ("enum", "bits", "u16", "s16") else None
    if not states and has_only_states(cells.get("range", "")):
        states = values_of(cells["range"])
    remark = cells.get("description", "")
    return states or (values_of(remark) if kind in ("enum", "bits") or has_only_states(remark) else None)


def _is_logical(text: str, named: MapArea | None, form: AddressForm) -> bool:
    """Whether 40108 is a logical number: where the row says nothing else, or the same; 00001 and 10001 in a column that
    has nothing but such numbers."""
    digits = "0134" if form.is_logical else "34"
    if re.fullmatch(rf"[{digits}]\d{{4,5}}", text) is None or int(text) % 10 ** (len(text) - 1) == 0:
        return False
    return named is None or text[0] == DIGIT_OF_AREA[named]


def _rows_of_text(text: str, file: str, most: int) -> list[list[str]]:
    lines = text.splitlines()[:most]
    if lines and (named := re.fullmatch(r"\"?sep=(.)\"?", lines[0].strip(), re.IGNORECASE)):  # Excel's own line
        return _cut(["", *lines[1:]], named[1], file)
    head = "\n".join(lines[:_LOOK])
    return _cut(lines, max("\t;,|", key=head.count), file)


def _cut(lines: Sequence[str], delimiter: str, file: str) -> list[list[str]]:
    rows = csv_rows(lines, delimiter, file)
    shown = _unmarked if delimiter == "|" else str.strip
    return [[shown(cell)[:CELL] for cell in row[:MOST_COLUMNS]] for _, row in rows]


def _unmarked(cell: str) -> str:
    """A cell of a Markdown table without its marks: code, bold, links."""
    return _LINK.sub(r"\1", cell).replace("**", "").replace("`", "").strip()
