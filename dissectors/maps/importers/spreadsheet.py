"""Tables out of manuals: CSV, TSV or XLSX with columns of any names, in English, Russian or German.

Columns are told by their headings, the heading row by how many it has. A type that the table does not name follows
from the number of registers. Addresses that begin with 1 are left as they stand unless all of them are logical (40001
on): which base a manual counts from is for the user to say (`address_base`).
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from ..cells import CellError, area_and_address
from ..model import DIGIT_OF_AREA, VALUE_TYPES, MapArea, MapError
from ..sheets import ZIP, MapSheet, column_name, rows_of_text, sheets_of
from ..tablecells import AddressForm, address_form, address_of, is_inverse, order_of, says_order, type_of
from ..tableheadings import filled, headings, merged_headings
from ..tablewords import (
    access_of,
    area_of_cell,
    area_words,
    has_only_states,
    is_function,
    is_powers,
    limits_of,
    measure_in,
    plain_number,
    scale_of,
    step_in,
    step_said,
    unit_of,
    values_of,
    writable_of,
)
from .source import ImportedMap, MapBuilder, MapSource, refused, whole_in

NAME = "a table"
_LAST_BIT: Final = 15
_FIRST_OF_WORDS: Final = {"big": "ABCD", "little": "CDAB"}
_STEPS_OF_UNITS: Final = {1, 10, 100, 1000, 10_000}
_HEX_TITLE: Final = re.compile(
    r"(?:address|register|адрес|регистр|adress|地址)\w*[^,;]{0,24}(?:hex|шестн|十六进制)", re.IGNORECASE
)
_LOOK: Final = 60  # rows in which a heading is sought
_UNIT_WORDS: Final = 3  # at most
_FIRST_WORD: Final = {"CDAB": "least significant", None: "most significant"}
_MOST_ROWS: Final = 70_000


def recognises(source: MapSource) -> bool:
    """A workbook, or a table with a heading."""
    if source.data.startswith(ZIP):
        return source.suffix in (".xlsx", ".xlsm", "")
    try:
        return source.is_text and any(headings(row) for row in rows_of_text(source.text, source.name, _LOOK))
    except MapError:
        return False


def read(source: MapSource) -> list[ImportedMap]:
    """The table, or each sheet that has one."""
    if source.data.startswith(ZIP):
        sheets = sheets_of(source.data, source.name, _MOST_ROWS)
    else:
        sheets = [MapSheet("", rows_of_text(source.text, source.name, _MOST_ROWS))]
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


def map_of_sheet(source: MapSource, sheet: MapSheet, *, several: bool = False) -> ImportedMap | None:
    """The map of one sheet; a later row of headings begins the next table of it."""
    builder = MapBuilder(source.name, device=f"{source.stem} {sheet.name if several else ''}".strip())
    rows, hidden = _visible(sheet)
    for note in (*hidden, *sheet.notes):
        builder.note(note)
    heading: _TableHeading | None = None
    area = area_words(sheet.name)
    group = above = ""
    second = 0
    register: tuple[MapArea, int] | None = None  # the newest
    order, in_hex = None, False  # as a title says
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
            heading = _heading_of(builder, row, below, in_hex=in_hex)
            above, register = "", None
            area = ("area" not in heading.columns and area_words(row[heading.columns["address"]])) or area
            continue
        if heading is None or len(cells) < 2:
            title = " ".join(cells)
            order = (order_of(title) if says_order(title) else None) or order
            in_hex = in_hex or _HEX_TITLE.search(title) is not None
        if heading is None or not cells:
            area = area_words(title) or area
            group = _title(title) if len(cells) == 1 and title.startswith("#") else group
            continue
        named = {key: row[at].strip() for key, at in heading.columns.items() if at < len(row)}
        if _is_bit(builder, named, register):
            continue
        if len(cells) == 1:
            group, area = _title(cells[0]) or group, area_words(cells[0]) or area
            continue
        above = named.get("area") or above  # one cell for several rows holds its text once
        if heading.of_words:
            named["order"] = _FIRST_OF_WORDS.get(named["order"].lower(), named["order"])
        if named.get("address") and heading.addresses[named["address"]] < 2:
            named.pop("bit", None)  # several rows of one register are its bits
        if order and "order" not in heading.columns and not order_of(named.get("type", "")):
            named["order"] = order
        here = area_of_cell(above, function=heading.of_functions) or area
        register = _row(builder, named, heading.form, here, group, number) or register
    if builder.rows or builder.bits:
        builder.note("columns were told by their headings: look the map over, its address base above all")
    return builder.built() if heading is not None else None


@dataclass(frozen=True, slots=True)
class _TableHeading:
    """What the columns of a table hold, by a row of headings and the rows below it."""

    columns: dict[str, int]
    form: AddressForm
    addresses: Counter[str]  # how many rows have each
    of_functions: bool  # areas are the codes of functions
    of_words: bool  # an order is one of words


def _heading_of(
    builder: MapBuilder, row: Sequence[str], below: Sequence[Sequence[str]], *, in_hex: bool
) -> _TableHeading:
    """The heading that a row is; `in_hex`: a title says so of the addresses."""
    columns = headings(row, below) or headings(row)
    _of_widths(columns, below)
    if _is_divisor(row, columns, below):
        columns["divisor"] = columns.pop("scale")
        builder.note("gains from 1 up were taken for what raw values are divided by")
    elif "scale" in columns and is_powers(filled(below, columns["scale"])):
        columns["power"] = columns.pop("scale")
        builder.note("whole factors, some below 0, were taken for powers of ten")
    addresses = filled(below, columns["address"])
    form = address_form(f"{row[columns['address']]} {'hex' if in_hex else ''}", addresses)
    if form.is_hex and not form.is_said:
        builder.note("addresses were taken for hexadecimal, as some of them have letters")
    return _TableHeading(
        columns,
        form,
        Counter(addresses),
        of_functions="area" in columns and is_function(row[columns["area"]]),
        of_words="order" in columns and "word" in row[columns["order"]].lower(),
    )


def _visible(sheet: MapSheet) -> tuple[list[list[str]], list[str]]:
    """The rows without the columns that the sheet hides, where what is left is a table, and what is said of it."""
    if not sheet.hidden:
        return sheet.rows, []
    rows = [["" if at in sheet.hidden else cell for at, cell in enumerate(row)] for row in sheet.rows]
    if not any(headings(row) for row in rows[:_LOOK]):
        return sheet.rows, []
    return rows, [f"columns that the sheet hides were left out: {', '.join(map(column_name, sorted(sheet.hidden)))}"]


def _is_divisor(row: Sequence[str], heading: dict[str, int], below: Sequence[Sequence[str]]) -> bool:
    """Whether a column of gains, or scales, says how many steps a unit has: none is below 1, as a factor would be."""
    at = heading.get("scale")
    if at is None or "divisor" in heading or not row[at].lower().startswith(("gain", "scal", "factor", "faktor")):
        return False
    numbers = [int(cell) if cell.isdecimal() else 0 for cell in filled(below, at)]
    return bool(numbers) and min(numbers) >= 1 and max(numbers) > 1 and {*numbers} <= _STEPS_OF_UNITS


def _of_widths(heading: dict[str, int], below: Sequence[Sequence[str]]) -> None:
    """Take a column of lengths for one of types (s16), or of bits where all are 8, 16, 32 or 64, if nothing else is."""
    at = heading.get("length")
    if at is None or "type" in heading or "width" in heading:
        return
    cells = set(filled(below, at))
    if cells and all(re.fullmatch(r"[A-Za-z]{1,8}\d{1,2}", cell) for cell in cells):
        heading["type"] = heading.pop("length")
    if cells and cells <= {"8", "16", "32", "64"} and cells != {"8"}:
        heading["width"] = heading.pop("length")


_BIT_NAME: Final = re.compile(r"(?:bit|бит|位)[ .]?(\d|0\d|1[0-5])(?!\d)\s*[:=.)–-]?\s*(?P<name>\S.*)", re.IGNORECASE)


def _is_bit(builder: MapBuilder, cells: dict[str, str], register: tuple[MapArea, int] | None) -> bool:
    """Whether a row names a bit of the register above: it has no address of its own. The bit is added then."""
    if register is None or cells.get("address"):
        return False
    name = cells.get("name") or cells.get("description") or ""
    spoken = _BIT_NAME.fullmatch(name)
    number = spoken[1] if spoken else re.sub(r"^\D{0,5}|\.0$", "", cells.get("bit", ""))
    if not number.isdecimal() or int(number) > _LAST_BIT or not name:
        return False
    builder.add_bits(*register, int(number), 1, " ".join((spoken["name"] if spoken else name).split()))
    return True


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
) -> tuple[MapArea, int] | None:
    """Add what a row says; the register that it is about, whose bits rows below may name."""
    position = address_of(cells.get("address", ""), form)
    if position is None:
        builder.note(f"row {number}: {cells.get('address', '')[:30]!r} is no address")
        return None
    named = area
    bit = position.bit
    if bit is None and (cells.get("bit") or "-").isdecimal() and int(cells["bit"]) <= _LAST_BIT:
        bit = int(cells["bit"])
    address: object = position.first
    if position.prefixed or _is_logical(position.text, named, form):
        address, named = position.text, None
    elif named is None:
        named = "holding"
    end = address_of(cells.get("end", ""), form)
    last = end.first if end is not None and position.last is None else position.last
    span = last - position.first + 1 if last is not None and last >= position.first else None
    kind, length = type_of(_type_said(cells), whole_in(cells.get("length")) or _words_of_octets(cells) or span)
    name = cells.get("name") or cells.get("description") or f"Register {cells.get('address', '')}"
    if not cells.get("name") and not cells.get("description"):
        builder.note(f"row {number}: no name")
    if bit is not None:
        where, at = area_and_address(named, address)
        builder.add_bits(where, at, bit, 1, " ".join(name.split()))
        return where, at
    wide = VALUE_TYPES.get(kind, 0) > 1
    said = f"{cells.get('order', '')} {cells.get('type', '')}".strip()
    order = (order_of(said) or order_of(cells.get("description", ""))) if wide else None
    if wide and (cells.get("order") or says_order(said)) and (order is None or is_inverse(said)):
        builder.note(
            f"row {number}: order {said[:30]!r} was taken for {order or 'ABCD'}, {_FIRST_WORD[order]} word first"
        )
    if len(cells.get("unit", "").split()) > _UNIT_WORDS:  # of a column for units and remarks
        cells = {"description": cells["unit"], **cells, "unit": ""}
    name, scale, measure = _measured(cells, " ".join(name.split()))
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
            "access": access_of(cells.get("access", "")) or writable_of(cells.get("writable", "")),
            "min": low,
            "max": high,
            "description": cells.get("description") if cells.get("name") else None,
            "group": cells.get("group") or group,
        },
        f"row {number}: {name[:40]}",
    )
    try:
        return area_and_address(named, address)
    except CellError:  # said by then
        return None


def _type_said(cells: dict[str, str]) -> str:
    """What the columns of type, width and sign say together."""
    width, sign = cells.get("width", ""), cells.get("signed", "").lower()
    words = [cells.get("type", ""), f"{width} bit" if width.isdecimal() else width]
    if re.match(r"y|s|да|со|ja|有|\+|±|1", sign):
        words.append("signed")
    elif sign:
        words.append("unsigned")
    return " ".join(filter(None, words))


def _words_of_octets(cells: dict[str, str]) -> int | None:
    octets = whole_in(cells.get("octets"))
    return octets // 2 if octets and octets % 2 == 0 else None


_STEP_BEHIND_TYPE: Final = re.compile(r"(?<=\w)\s*(?:[x×*]\s*(0[.,]\d{1,6})|([/÷]\s*10{1,5}))(?!\d)")


_SHOWN: Final = re.compile(r"[Xx#0]{1,9}[.,]([Xx#0]{1,6})")  # digits of a display: `XXX.X`


def _measured(cells: dict[str, str], name: str) -> tuple[str, str | None, str | None]:
    """A row's name, scale and unit of measure, which stand in columns of their own, or behind other words."""
    scale, measure = unit_of(cells)
    if not measure and (behind := re.fullmatch(r"[\d.,]+\s*([^\d\s.,:/x×*^].*)", cells.get("scale", ""))):
        measure = measure_in(f"_ [{behind[1]}]")[1]
    if not measure:
        name, measure = measure_in(name)
    if scale is None and (behind := _STEP_BEHIND_TYPE.search(cells.get("type", ""))) is not None:
        scale = scale_of({"scale": behind[1] or behind[2]})
    if scale is None and (shown := _SHOWN.fullmatch(cells.get("type", ""))) is not None:
        scale = f"1/{10 ** len(shown[1])}"
    if scale is None:
        name, scale, other = step_in(name)
        measure = measure or other
    if scale is None:
        scale, other = step_said(cells.get("description", ""))
        measure = measure or other
    return name, scale, measure


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
    digits = "0134" if form.is_logical or (form.is_digital and named in ("coil", "discrete")) else "34"
    if form.is_plain or re.fullmatch(rf"[{digits}]\d{{4,5}}", text) is None or int(text) % 10 ** (len(text) - 1) == 0:
        return False
    return named is None or text[0] == DIGIT_OF_AREA[named]
