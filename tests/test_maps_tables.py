"""Tables of registers as their users have them: other encodings, headings, addresses and factors."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest
from running import refused

from dissectors.maps.importers import import_maps
from dissectors.maps.table import read_table, write_table


def rows_of(data: bytes, name: str = "table.csv") -> list[tuple[object, ...]]:
    (imported,) = import_maps(name, data)
    assert read_table(write_table(imported.chart), "again.csv").rows == imported.chart.rows
    return [(r.area, r.address, r.name, r.type, r.scale, r.unit) for r in imported.chart.rows]


def test_a_russian_table_of_windows() -> None:
    table = (
        "Адрес;Параметр;Тип данных;Коэффициент;Единица измерения;Значения\r\n"
        "40001;Температура;INT16;0,1;°C;\r\n40002;Режим;enum;;;0=стоп; 1=пуск\r\n"
    )
    first, second = rows_of(table.encode("cp1251"))
    assert first == ("holding", 0, "Температура", "s16", 0.1, "°C")
    assert second[:4] == ("holding", 1, "Режим", "enum")


def test_ranges_below_a_heading_in_the_plural() -> None:
    table = (
        "Registers,Name,Data Type,Unit\n30001-30002,Energy,U32,kWh\n30003-30006,Total,U64,Wh\n30007,Temp,S16,0.1 °C\n"
    )
    assert [(r[0], r[1], r[3], r[4]) for r in rows_of(table.encode())] == [
        ("input", 0, "u32", 1.0), ("input", 2, "u64", 1.0), ("input", 6, "s16", 0.1),
    ]  # fmt: skip


def test_registers_beside_an_address_are_how_many() -> None:
    assert [r[1:4] for r in rows_of(b"Address,Registers,Name,Type\n1,2,A,float\n3,1,B,u16\n")] == [
        (1, "A", "f32"), (3, "B", "u16"),
    ]  # fmt: skip


def test_an_area_apart_from_its_number_and_thousands() -> None:
    assert [r[1] for r in rows_of("Address;Name;Type\n4 0001;A;u16\n4 0012;B;u16\n".encode("utf-8-sig"))] == [0, 11]
    assert [r[1] for r in rows_of(b"Address,Name,Type\n1 000,A,u16\n1 002,B,u16\n")] == [1000, 1002]


def test_gains_from_one_up_divide() -> None:
    table = "Register\tName\tType\tGain\tUnit\n32064\tInput power\tint32\t1000\tkW\n32085\tFrequency\tuint16\t100\tHz\n"
    (imported,) = import_maps("gains.tsv", table.encode("utf-16"))
    assert [row.scale for row in imported.chart.rows] == [0.001, 0.01]
    assert any("divided" in note for note in imported.notes)
    assert [r[4] for r in rows_of(b"Register;Name;Type;Gain\n1;A;u16;0,1\n2;B;u16;10\n")] == [0.1, 10.0]


def test_a_heading_over_two_rows_and_hexadecimal_beside_decimal() -> None:
    heading = "Register map;;;;\n;;;;\nAddress;;Parameter;Format;Unit\nDec;Hex;;;\n"
    table = heading + "10;000A;Voltage;Float32;V\n12;000C;Current;Float32;A\n"
    assert [r[1:4] for r in rows_of(table.encode())] == [(10, "Voltage", "f32"), (12, "Current", "f32")]


def test_a_workbook_without_its_library_names_what_installs_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    book = tmp_path / "book.xlsx"
    book.write_bytes(b"PK\x03\x04" + bytes(64))
    monkeypatch.setitem(sys.modules, "openpyxl", None)
    (tmp_path / "pipx_metadata.json").touch()
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    said = refused(capsys, "map", "import", book, "-o", tmp_path / "map.csv")
    assert said.endswith("needs openpyxl: pipx inject rtuscope openpyxl")
