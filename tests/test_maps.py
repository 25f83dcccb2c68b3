"""Register maps: the flat table and its errors, YAML, the shipped ones, and what other programs have."""

from __future__ import annotations

import contextlib
import csv
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scripts import package

from dissectors.maps import MapError, RegisterMap, map_for_unit, map_text, read_map, shipped_map, shipped_names
from dissectors.maps.importers import FORMATS, import_maps
from dissectors.maps.model import DeviceSignature, MappedValue
from dissectors.maps.table import read_table, write_table
from dissectors.maps.yamlform import json_schema, read_yaml, write_yaml
from dissectors.values import FORMULA_STARTS, ORDERS, ordered, registers_of

FILES = package("attack.mapfiles")
WORDS = st.text(st.characters(codec="utf-8", exclude_categories=("C", "Z")), min_size=1, max_size=12)
NUMBERS = st.floats(-1e6, 1e6).filter(lambda number: number != 0)
TYPES = {"u16": 1, "s16": 1, "u32": 2, "s32": 2, "u64": 4, "s64": 4, "f32": 2, "f64": 4, "bcd32": 2}


@st.composite
def values(draw: st.DrawFn) -> MappedValue:
    kind = draw(st.sampled_from([*TYPES, "enum", "bits", "text"]))
    length = TYPES.get(kind) or draw(st.integers(1, 20))
    states = draw(st.dictionaries(st.integers(0, 99), WORDS, max_size=3)) if kind in ("enum", "bits") else {}
    low = draw(st.none() | NUMBERS)
    return MappedValue(
        area=draw(st.sampled_from(("input", "holding"))),
        address=draw(st.integers(0, 65000)),
        name=draw(WORDS),
        type=kind,
        order=draw(st.sampled_from(ORDERS)),
        length=length,
        scale=draw(NUMBERS),
        offset=draw(NUMBERS),
        scale_address=draw(st.none() | st.integers(0, 65535)),
        unit=draw(WORDS),
        values=states,
        access=draw(st.sampled_from(("", "r", "w", "rw"))),
        minimum=low,
        maximum=None if low is None else low + 1,
        description=draw(WORDS),
        other={"note": draw(WORDS)},
    )


CHARTS = st.builds(
    RegisterMap,
    device=st.just("Meter"),
    rows=st.lists(values(), min_size=1, max_size=5, unique_by=lambda row: (row.area, row.address)).map(tuple),
    vendor=st.just("Maker"),
    word_order=st.sampled_from(ORDERS),
    match=st.just(DeviceSignature(("ID",), ("OBJ",), (("holding", 40000, (0x5375, 0x6E53)),), (("input", 0, 72),))),
    other=st.just({"functions": "3, 4"}),
)


@given(CHARTS)
def test_a_map_survives_its_files(chart: RegisterMap) -> None:
    assert read_table(write_table(chart), "x.csv") == chart
    assert read_yaml(write_yaml(chart), "x.yaml") == chart


HARMFUL = st.sampled_from(
    ("=1+1", "+x", "-y", "@z", "'=q", "''+r", "a;=cmd", "a,+b", "a\t@c", '"=x"', 'a";=y', "-40", "= 5")
)


@given(HARMFUL, HARMFUL, HARMFUL, HARMFUL)
def test_no_cell_is_run_as_a_formula(name: str, measure: str, device: str, column: str) -> None:
    row = MappedValue("input", 1, name, "s16", unit=measure, minimum=-40.0, maximum=5.0, other={column: name})
    chart = RegisterMap(device, (row,), source=measure)
    text = write_table(chart)
    for delimiter in ",;\t":
        cells = [cell for line in csv.reader(text.splitlines(), delimiter=delimiter) for cell in line]
        assert not [cell for cell in cells if cell.startswith(FORMULA_STARTS) and cell != "-40"]
    found = read_table(text, "x.csv").rows[0]
    assert (found.name, found.unit, found.minimum) == (" ".join(name.split()), " ".join(measure.split()), -40.0)


@given(st.binary(max_size=200))
def test_no_bytes_are_more_than_an_error(data: bytes) -> None:
    for form in (*FORMATS, None):
        try:
            import_maps("x.csv", data, name=form)
        except MapError as error:
            assert "\n" not in str(error)


@given(st.text(max_size=300))
def test_no_text_is_more_than_an_error(text: str) -> None:
    for read in (read_table, read_yaml):
        try:
            read(text, "x")
        except MapError as error:
            assert str(error).startswith("x:")
    with contextlib.suppress(MapError):
        import_maps("x", text.encode("utf-8", "replace"))


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("input,70000,V,u16", "row 2: address is '70000': expected 0 to 65535"),
        ("inptu,7,V,u16", "row 2: area is 'inptu': expected coil, discrete, input or holding"),
        ("input,7,V,u17", "row 2: type is 'u17': expected one of bool, u16"),
        ("input,7,,u16", "row 2: name is '': expected a name"),
        ("coil,7,V,u16", "row 2: type is 'u16': expected bool in area coil"),
        ("input,x,V,u16", "row 2: address is 'x': expected a whole number"),
        (",7,V,u16", "row 2: address is '7': expected a logical address"),
        ("input,65535,V,u32", "row 2: address is '65535': expected that 2 registers end by 65535"),
        ("input,7,V,text", "row 2: length is '': expected how many registers"),
    ],
)
def test_an_error_names_the_cell(row: str, expected: str) -> None:
    with pytest.raises(MapError) as raised:
        read_table(f"area,address,name,type\n{row}\n", "meter.csv")
    assert str(raised.value).startswith("meter.csv: ")
    assert expected in str(raised.value)


def test_addresses_in_all_their_forms() -> None:
    text = "area,address,name\nholding,107,a\nholding,0x6B,b\n,4x108,c\n,40108,d\n,400108,e\nholding,6Bh,f\n"
    assert {(row.area, row.address) for row in read_table(text, "x").rows} == {("holding", 107)}
    based = read_table("# address_base: 1\narea,address,name\ninput,108,a\n", "x")
    assert based.rows[0].address == 107


def test_tables_as_spreadsheets_write_them() -> None:
    text = '\ufeff"# device: Meter;;;"\narea;address;name;type;scale;note\ninput;1.0;V;u16;0,1;my own\n;;;;;\n'
    chart = read_table(text, "x")
    assert chart.device == "Meter"
    assert (chart.rows[0].scale, chart.rows[0].other) == (0.1, {"note": "my own"})


def test_shipped_maps_are_whole() -> None:
    names = shipped_names()
    assert {"el-psu", "nl-16di", "eastron-sdm630", "fronius-sunspec-int"} <= set(names)
    for name in names:
        chart = shipped_map(name)
        assert chart.device and chart.source and chart.licence == "Apache-2.0", name
        assert map_text(chart, f"{name}.yaml")
    supply = shipped_map("el-psu")
    flags = supply.at("input", 2)
    assert flags is not None and flags.values[7] == "overvoltage"
    assert supply.other["longest_frame"] == "40"
    inputs = shipped_map("nl-16di")
    assert len([row for row in inputs.rows if row.area == "discrete"]) == 16


def test_maps_by_name_file_and_unit(tmp_path: Path) -> None:
    chart, unit = map_for_unit("xy-md02@7")
    assert (chart.device, unit) == ("XY-MD02", 7)
    file = tmp_path / "mine.csv"
    file.write_text(map_text(chart, file), encoding="utf-16")
    assert read_map(file) == chart
    for wrong in ("xy-md03", str(tmp_path / "none.csv"), f"{file}@999"):
        with pytest.raises(MapError):
            map_for_unit(wrong)


def test_the_schema_names_every_column() -> None:
    schema = json_schema()
    columns = schema["properties"]["registers"]["items"]["properties"]
    assert {"area", "address", "type", "order", "scale_register", "values"} <= set(columns)


@given(st.lists(st.integers(0, 0xFFFF), min_size=1, max_size=4), st.sampled_from(ORDERS))
def test_registers_of_bytes_and_back(words: list[int], order: str) -> None:
    assert list(registers_of(ordered(words, order), order)) == words  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("file", "text", "expected"),
    [
        ("c.yaml", FILES.HA, [("input", 10, "u32", "CDAB", 0.1), ("holding", 32, "s16", "ABCD", 1),
                        ("coil", 5, "bool", "ABCD", 1)]),
        ("c.yaml", FILES.ESPHOME, [("input", 0x3102, "u32", "CDAB", 0.01), ("input", 0x3201, "bits", "ABCD", 1)]),
        ("c.yaml", FILES.SOLARMAN, [("input", 2, "u32", "CDAB", 0.1), ("input", 5, "s16", "CDAB", 0.1),
                              ("input", 6, "enum", "CDAB", 1)]),
        ("c.toml", FILES.TELEGRAF, [("holding", 8, "f32", "CDAB", 1), ("holding", 10, "u32", "ABCD", 0.01)]),
        ("c.yml", FILES.EXPORTER, [("input", 22, "s16", "ABCD", 3.5), ("holding", 23, "f32", "CDAB", 1)]),
        ("c.yaml", FILES.SCHEMA, [("holding", 10, "f32", "ABCD", 1), ("holding", 20, "s16", "ABCD", 0.1)]),
        ("c.csv", FILES.MODPOLL, [("input", 0, "f32", "CDAB", 1), ("input", 6, "u16", "ABCD", 0.1)]),
        ("inputRegs.tsv", FILES.IOBROKER, [("input", 69, "u16", "ABCD", 0.1), ("input", 71, "f32", "CDAB", 1)]),
        ("c.json", FILES.WIRENBOARD, [("input", 16, "u32", "CDAB", 0.01), ("holding", 50199, "bits", "ABCD", 1)]),
        ("c.json", FILES.SUNSPEC, [("holding", 40070, "u16", "ABCD", 1), ("holding", 40071, "u16", "ABCD", 1),
                             ("holding", 40072, "s16", "ABCD", 1), ("holding", 40073, "text", "ABCD", 1)]),
        ("c.csv", FILES.RUSSIAN, [("holding", 10, "u16", "ABCD", 0.1), ("holding", 11, "f32", "ABCD", 1)]),
        ("c.csv", FILES.GERMAN, [("holding", 0, "f32", "ABCD", 1), ("holding", 2, "s16", "ABCD", 0.01)]),
        ("c.csv", FILES.ENGLISH, [("input", 0, "f32", "ABCD", 1), ("holding", 100, "u32", "ABCD", 0.01)]),
    ],
)  # fmt: skip
def test_maps_of_others_round_trip(file: str, text: str, expected: list[tuple[str, int, str, str, float]]) -> None:
    (found,) = import_maps(file, text.encode())
    rows = [(row.area, row.address, row.type, row.order, row.scale) for row in found.chart.rows]
    assert rows == expected
    assert read_table(write_table(found.chart), "x") == found.chart


def test_what_a_map_cannot_carry_is_noted() -> None:
    clamped = FILES.ESPHOME.replace("return x;", "return max(x, 0);")
    assert any("lambda" in note for note in import_maps("c.yaml", clamped.encode())[0].notes)
    assert any("F * 2" in note for note in import_maps("c.yaml", FILES.SCHEMA.encode())[0].notes)
    heat = next(row for row in import_maps("c.yaml", FILES.SOLARMAN.encode())[0].chart.rows if row.name == "Heat")
    assert heat.offset == -100
    amps = import_maps("c.json", FILES.SUNSPEC.encode())[0].chart.rows[1]
    assert amps.scale_address == 40072


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("\ufeffRegister;Bezeichnung;Datentyp;Faktor\n40001-40002;U;FLOAT32;1\n40003 - 40004;E;UINT32;0,01\n"
         "40005…40008;S;ASCII;\n",
         [("holding", 0, "f32", 1, ""), ("holding", 2, "u32", 0.01, ""), ("holding", 4, "text", 1, "")]),
        ("Адрес (hex);Наименование параметра;Тип данных;Ед. изм.\n0x0000;U;uint16;0,1 В\n0010h;E;uint32;кВт·ч\n",
         [("holding", 0, "u16", 0.1, "В"), ("holding", 16, "u32", 1, "кВт·ч")]),
        ("Address (Hex),Name,Type\n000A,I,U16\n0010,P,S32\n",
         [("holding", 10, "u16", 1, ""), ("holding", 16, "s32", 1, "")]),
        ("Address,Name\n10,A\n1F,B\n", [("holding", 16, "u16", 1, ""), ("holding", 31, "u16", 1, "")]),
        ("No.,Start address,End address,Parameter name,Unit\n1,0,1,E,kWh\n2,4,4,F,0.01Hz\n",
         [("holding", 0, "u32", 1, "kWh"), ("holding", 4, "u16", 0.01, "Hz")]),
        ("№;Регистр;Имя\n1;30009;T\n", [("input", 8, "u16", 1, "")]),
        ("Address,Name,Type\n10.0,Pump on,bool\n10.1,Fault,bool\n11,Flow,u16\n",
         [("holding", 11, "u16", 1, ""), ("holding", 10, "bits", 1, "")]),
        ("| Address | Name | Function | Scaling |\n|---|---|---|---|\n| 5 | U | 04 | ÷10 |\n| 6 | I |  | x0.1 |\n",
         [("input", 5, "u16", 0.1, ""), ("input", 6, "u16", 0.1, "")]),
        ("Address\tName\tType\r\n1 000\tA\tREAL\r\n4x1003\tB\tDINT\r\n",
         [("holding", 1000, "f32", 1, ""), ("holding", 1002, "s32", 1, "")]),
    ],
)  # fmt: skip
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "cp1251"])
def test_tables_as_manuals_and_spreadsheets_have_them(
    text: str, expected: list[tuple[str, int, str, float, str]], encoding: str
) -> None:
    data = text.encode("utf-8" if encoding == "cp1251" and not text.isascii() and "÷" in text else encoding, "ignore")
    (found,) = import_maps("list.csv", data)
    assert [(row.area, row.address, row.type, row.scale, row.unit) for row in found.chart.rows] == expected


def test_orders_limits_and_what_is_unsure() -> None:
    text = (
        "Address,Name,Type,Byte order,Range\n0,A,float,CD AB,0...100\n2,B,float,little endian,-10 to 10\n"
        "4,C,float,big-endian,-32 768 – 32 767\n6,D,float,3412,0=off 1=on\n"
    )
    (found,) = import_maps("list.csv", text.encode())
    assert [(row.order, row.minimum, row.maximum) for row in found.chart.rows] == [
        ("CDAB", 0, 100), ("ABCD", -10, 10), ("ABCD", -32768, 32767), ("CDAB", None, None),
    ]  # fmt: skip
    assert any("little endian" in note for note in found.notes)


def test_merged_cells_of_a_workbook(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    sheet = book.active
    for row in (["Meter list"], ["Function", "Address", "Name", "Type"], [4, 0, "U", "float"], [None, 2, "I", "float"],
                [3, 10.0, "Mode", "uint16"], [None, 11, "Limit", "uint16"]):  # fmt: skip
        sheet.append(row)
    sheet.merge_cells("A1:D1")
    sheet.merge_cells("A3:A4")
    sheet.merge_cells("A5:A6")
    book.save(tmp_path / "list.xlsx")
    (found,) = import_maps("list.xlsx", (tmp_path / "list.xlsx").read_bytes())
    assert [(row.area, row.address, row.type) for row in found.chart.rows] == [
        ("input", 0, "f32"), ("input", 2, "f32"), ("holding", 10, "u16"), ("holding", 11, "u16"),
    ]  # fmt: skip


def test_a_workbook(tmp_path: Path) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    sheet = book.active
    for row in (
        ["Register list"],
        [],
        ["Address", "Name", "Type", "Unit"],
        [5, "Flow", "float", "m3/h"],
        ["0x10", "State", "", ""],
    ):
        sheet.append(row)
    book.save(tmp_path / "list.xlsx")
    (found,) = import_maps("list.xlsx", (tmp_path / "list.xlsx").read_bytes())
    assert [(row.address, row.type) for row in found.chart.rows] == [(5, "f32"), (16, "u16")]
    with pytest.raises(MapError):
        import_maps("bad.xlsx", b"PK\x03\x04 nothing")


def test_unknown_files_say_which_formats_there_are() -> None:
    with pytest.raises(MapError, match="not a known register map"):
        import_maps("x.bin", b"\0\1\2")
    assert replace(shipped_map("xy-md02"), device="x").device == "x"


def test_a_table_loads_no_yaml() -> None:
    code = "import sys; from dissectors.maps import shipped_map; shipped_map('%s'); sys.exit('yaml' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code % shipped_names()[0]], check=False).returncode == 0
