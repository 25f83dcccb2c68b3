"""Workbooks as people keep their register lists, one oddity each: what is read, and what is said about it."""

from __future__ import annotations

import datetime
import io
import re
import zipfile
from collections.abc import Callable
from typing import Any

import pytest
from oddmaps import check_import, row_texts

from dissectors.maps import MapError
from dissectors.maps.importers import import_maps
from dissectors.maps.written import area_words

openpyxl = pytest.importorskip("openpyxl")
Cells = list[list[Any]]
HEADINGS = ["Address", "Name", "Type", "Unit"]


def book_of(*sheets: Cells, change: Callable[[Any], object] | None = None) -> bytes:
    """A workbook of these sheets, then changed as a user does."""
    book, file = openpyxl.Workbook(), io.BytesIO()
    book.remove(book.active)
    for number, rows in enumerate(sheets, 1):
        sheet = book.create_sheet(f"Sheet {number}")
        for row in rows:
            sheet.append(row)
    if change is not None:
        change(book)
    book.save(file)
    return file.getvalue()


def two_rows_of_headings(book: Any) -> None:
    sheet = book.active
    for cells in ("A1:G1", "A3:B3", "C3:C4", "D3:F3", "G3:G4", "C5:C6"):
        sheet.merge_cells(cells)


BOOKS: dict[str, tuple[Cells, Callable[[Any], object] | None, list[str], str]] = {
    "headings of two rows, cells merged over both and over columns": (
        [["Modbus register list of the pump, rev. 3"], [], ["Register", None, "Parameter", "Value", None, None, "R/W"],
         ["Dec", "Hex", None, "Type", "Factor", "Unit", None],
         [4096, "1000", "Flow", "uint32", 0.01, "m3/h", "R"], [4098, "1002", None, "int16", 0.1, "°C", "R/W"]],
        two_rows_of_headings,
        ["holding 4096 u32 x0.01 m3/h r Flow", "holding 4098 s16 x0.1 °C rw Register 4098"],
        "row 6: no name",
    ),
    "numbers as text, with apostrophes of old, hexadecimal": (
        [HEADINGS, ["'40001", "U", "U16", "V"], ["40002", "I", "U16", "A"], ["40003-40004", "E", None, "kWh"]],
        None,
        ["holding 0 u16 V U", "holding 1 u16 A I", "holding 2 u32 kWh E"],
        "",
    ),
    "addresses 0x1000 and 1000h": (
        [["Title"], HEADINGS, ["0x1000", "U", "U16", "V"], ["0x1001", "I", "S16", "A"], ["1002h", "P", "S32", "W"],
         ["10FEh-10FFh", "E", "", "kWh"]],
        None,
        ["holding 4096 u16 V U", "holding 4097 s16 A I", "holding 4098 s32 W P", "holding 4350 u32 kWh E"],
        "",
    ),
    "hidden columns, an old address in one": (
        [["Address", "Address", "Name", "Type", "Internal name"], [5, 105, "U", "U16", "x_u"],
         [7, 107, "I", "U16", "x_i"]],
        lambda book: [book.active.column_dimensions.group(one, one, hidden=True) for one in "AE"],
        ["holding 105 u16 U", "holding 107 u16 I"],
        "hidden columns of the sheet were skipped: A, E$",
    ),
    "all that matters is hidden": (
        [["Address", "Name"], [5, "U"], [6, "I"]],
        lambda book: book.active.column_dimensions.group("A", "B", hidden=True),
        ["holding 5 u16 U", "holding 6 u16 I"],
        "",
    ),
    "Russian headings over several rows, areas merged": (
        [["Карта регистров ПЧ"], ["Дата", datetime.date(2024, 3, 5)], [],
         ["Функция", "Адрес регистра", "Наименование параметра", "Тип данных", "Ед. изм.", "Коэфф.", "Доступ"],
         [3, "0x0010", "Частота", "UINT", "Гц", "0,01", "чтение"],
         [None, "0x0011", "Ток", "UINT", "А", "0,1", "чтение"],
         [4, "0x0010", "Напряжение", "UINT", "В", "0,1", "чтение/запись"]],
        lambda book: book.active.merge_cells("A5:A6"),
        ["holding 16 u16 x0.01 Гц r Частота", "holding 17 u16 x0.1 А r Ток",
         "input 16 u16 x0.1 В rw Напряжение"],
        "",
    ),
    "factors as floats that are not even": (
        [["Address", "Name", "Factor"], [1.0, "A", 0.1 + 0.2], [2.0, "B", 1e-05], [3.0, "C", 1.0]],
        None,
        ["holding 1 u16 x0.3 A", "holding 2 u16 x1e-05 B", "holding 3 u16 C"],
        "",
    ),
    "a range that the spreadsheet took for a day": (
        [HEADINGS, [10, "U", "U16", "V"], [datetime.datetime(2024, 11, 12), "E", "U32", "kWh"]],
        None,
        ["holding 10 u16 V U"],
        "row 3: '\\(a date\\)' is not an address",
    ),
    "a title merged over the table, groups merged over rows": (
        [["Device", None, None, None], HEADINGS, ["Measured", None, None, None], [0, "U", "f32", "V"],
         ["Counted", None, None, None], [2, "E", "u64", "Wh"]],
        lambda book: [book.active.merge_cells(f"A{row}:D{row}") for row in (1, 3, 5)],
        ["holding 0 f32 V U", "holding 2 u64 Wh E"],
        "",
    ),
}  # fmt: skip


@pytest.mark.parametrize("oddity", BOOKS)
def test_a_workbook_of_people(oddity: str) -> None:
    rows, change, expected, note = BOOKS[oddity]
    check_import(("list.xlsx", book_of(rows, change=change), expected, note))


def test_each_sheet_with_a_table_is_a_map_and_hidden_ones_are_none() -> None:
    cover: Cells = [["Register list"], ["for the pump"]]
    sheets: list[Cells] = [
        cover,
        [HEADINGS, [1, "U", "U16", "V"]],
        [HEADINGS, [1, "old", "U16", ""]],
        [HEADINGS, [9, "F", "f32", "Hz"]],
    ]

    def hide(book: Any) -> None:
        book.worksheets[2].sheet_state = "hidden"

    found = import_maps("pump.xlsx", book_of(*sheets, change=hide))
    assert [(one.chart.device, row_texts(one)) for one in found] == [
        ("pump Sheet 2", ["holding 1 u16 V U"]),
        ("pump Sheet 4", ["holding 9 f32 Hz F"]),
    ]


def test_sheets_that_are_named_after_an_area_are_one_device() -> None:
    sheets: list[Cells] = [
        [HEADINGS, [1, "U", "U16", "V"]],
        [HEADINGS, [1, "Limit", "U16", "V"]],
    ]

    def name(book: Any) -> None:
        book.worksheets[0].title, book.worksheets[1].title = "Input registers", "Settings (FC 03)"

    (found,) = import_maps("pump.xlsx", book_of(*sheets, change=name))
    assert found.chart.device == "pump"
    assert row_texts(found) == ["input 1 u16 V r U", "holding 1 u16 V Limit"]


@pytest.mark.parametrize(
    ("title", "area"),
    [("Read-only data, function code 04h", "input"), ("Functions 03, 04 and 06", None), ("FC02", "discrete"),
     ("Регистры (функция 3)", "holding"), ("Function list 4", None)],
)  # fmt: skip
def test_the_one_function_of_a_title_says_the_area(title: str, area: str | None) -> None:
    assert area_words(title) == area


def with_values(data: bytes, values: dict[str, str]) -> bytes:
    """A workbook with the values that a spreadsheet had calculated."""
    made = io.BytesIO()
    with zipfile.ZipFile(io.BytesIO(data)) as packed, zipfile.ZipFile(made, "w") as out:
        for name in packed.namelist():
            text = packed.read(name)
            for cell, value in values.items() if "sheet1" in name else ():
                text, count = re.subn(
                    rf'(r="{cell}"[^>]*><f>.*?</f>)<v ?/?>(?:</v>)?'.encode(), rb"\1<v>%s</v>" % value.encode(), text
                )
                assert count == 1
            out.writestr(name, text)
    return made.getvalue()


def test_formulas_count_as_they_were_calculated_and_others_are_told() -> None:
    rows: Cells = [HEADINGS, [100, "U", "U16", "V"], ["=A2+2", "I", "U32", "A"], ["=A3+2", "P", "U16", "W"]]
    data = book_of(rows)
    check_import(
        ("x.xlsx", with_values(data, {"A3": "102", "A4": "104"}), [
            "holding 100 u16 V U", "holding 102 u32 A I", "holding 104 u16 W P"], "")
    )  # fmt: skip
    check_import(("x.xlsx", data, ["holding 100 u16 V U"], "2 formulas have no value yet: open and save"))


def test_a_workbook_that_merges_everything_is_read_all_the_same() -> None:
    data, made = (
        book_of([HEADINGS, [5, "U", "U16", "V"]], change=lambda book: book.active.merge_cells("F1:G2")),
        io.BytesIO(),
    )
    with zipfile.ZipFile(io.BytesIO(data)) as packed, zipfile.ZipFile(made, "w") as out:
        for name in packed.namelist():
            out.writestr(name, packed.read(name).replace(b"F1:G2", b"F1:XFD1048576"))
    check_import(("x.xlsx", made.getvalue(), ["holding 5 u16 V U"], ""))


def test_a_workbook_without_a_table_is_one_line() -> None:
    with pytest.raises(MapError, match=r"a heading row such as") as raised:
        import_maps("x.xlsx", book_of([["nothing"], [1, 2, 3]]))
    assert "\n" not in str(raised.value)
