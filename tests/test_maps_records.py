"""Registers as programs and notes have them: records of JSON or YAML, and tables in Markdown."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from dissectors.maps.importers import import_maps
from dissectors.maps.model import MapError, RegisterMap


def chart_of(text: str, name: str) -> RegisterMap:
    (imported,) = import_maps(name, text.encode())
    return imported.chart


LIST = [
    {"Type": "INPUT", "Name": "UPTIME", "Address": [6, 7], "Format": "UINT", "Unit": "s", "Description": "since start"},
    {"Type": "INPUT", "Name": "LEVEL", "Address": [8], "Format": "INT", "Min": -5, "Max": 40},
    {"Type": "HOLDING", "Name": "LIMIT", "Address": [3], "Format": "INT"},
]
BY_NAME = """
regs:
  pump:
    mode: {register: 0x101, type: int, values: {0: off, 3: on}}
    power: {register: 288, type: uint, factor: 0.004, unit: "%"}
  tank:
    level: {register: 770, len: 2, type: uint32}
"""
BY_ADDRESS = {
    "holding": {"40003": {"name": "Flow", "dataType": "int16", "scaleFactor": 0.01, "unit": "m3/h"}},
    "input": {"30001": {"name": "Temp", "dataType": "float32"}},
}


def test_what_is_null_says_nothing() -> None:
    listed = [{"name": name, "address": at, "unit": None, "access": None} for at, name in enumerate(("Flow", "Level"))]
    assert [(row.address, row.name, row.unit) for row in chart_of(json.dumps(listed), "a.json").rows] == [
        (0, "Flow", ""), (1, "Level", ""),
    ]  # fmt: skip


def test_what_was_read_before_changes_nothing() -> None:
    code = "from dissectors.maps.facts import facts_in; print(facts_in('x0,1 \u043c3/\u0447', 'behind')['scale'])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, check=True).stdout.strip() == b"0.1"


def test_a_list_of_objects() -> None:
    rows = [
        (row.area, row.address, row.name, row.type, row.minimum, row.maximum)
        for row in chart_of(json.dumps(LIST), "a.json").rows
    ]
    assert rows == [
        ("input", 6, "UPTIME", "u32", None, None),
        ("input", 8, "LEVEL", "s16", -5, 40),
        ("holding", 3, "LIMIT", "s16", None, None),
    ]


def test_objects_by_their_names() -> None:
    rows = chart_of(BY_NAME, "pump.yaml").rows
    assert [(row.address, row.name, row.type, row.scale, row.group) for row in rows] == [
        (0x101, "mode", "s16", 1, "regs pump"),
        (288, "power", "u16", 0.004, "regs pump"),
        (770, "level", "u32", 1, "regs tank"),
    ]
    assert dict(rows[0].values) == {0: "off", 3: "on"}


def test_objects_by_their_addresses() -> None:
    rows = chart_of(json.dumps(BY_ADDRESS), "meter.json").rows
    assert [(row.area, row.address, row.name, row.type, row.scale) for row in rows] == [
        ("holding", 2, "Flow", "s16", 0.01),
        ("input", 0, "Temp", "f32", 1),
    ]


def test_objects_a_line_each_and_registers_by_their_numbers() -> None:
    lines = "\n".join(
        json.dumps({"Number": number, "Name": name, "DataType": kind, "swapType": order, "wordLen": 2})
        for number, name, kind, order in ((42033, "Hours", "UINT32", "CDAB"), (42035, "Level", "FLOAT32", "ABCD_BE"))
    )
    rows = chart_of(lines, "drier.jsonl").rows
    assert [(row.area, row.address, row.name, row.type, row.order) for row in rows] == [
        ("holding", 2032, "Hours", "u32", "CDAB"),
        ("holding", 2034, "Level", "f32", "ABCD"),
    ]


@pytest.mark.parametrize("text", ['{"services": {"web": {"ports": [80]}}}', "[1, 2, 3]", '[{"address": "Main St 1"}]'])
def test_json_of_other_things_is_no_map(text: str) -> None:
    with pytest.raises(MapError):
        import_maps("other.json", text.encode())


MARKDOWN = """
# Registers of the drier

## Discrete inputs

| Address | Description |
|--------:|-------------|
| 0x0001  | **Door** open |

## Input registers

All of them are read only.

### Temperatures

| Register | `Name` | Type | Mapping | Unit |
|----------|:------:|------|---------|------|
| 0A,0B | `air/hot` | S_DWORD | | 0.1 °C |
| 1C | [mode](#modes) | u16 | 0 = idle, 1 = heat | |
| 20 | lamp | u16 | | lit while the door is open |
"""


def test_tables_of_a_readme() -> None:
    rows = chart_of(MARKDOWN, "README.md").rows
    assert [(row.area, row.address, row.name, row.type, row.scale, row.unit, row.group) for row in rows] == [
        ("discrete", 1, "Door open", "bool", 1, "", "Discrete inputs"),
        ("input", 10, "air/hot", "s32", 0.1, "°C", "Temperatures"),
        ("input", 28, "mode", "u16", 1, "", "Temperatures"),
        ("input", 32, "lamp", "u16", 1, "", "Temperatures"),
    ]
    assert dict(rows[2].values) == {0: "idle", 1: "heat"} and rows[3].description == "lit while the door is open"


def test_areas_under_the_heading_of_types_and_powers_of_ten_beside_none() -> None:
    table = (
        "| Address | Type | Name | Data Type | Scale |\n|--|--|--|--|--|\n"
        "| 1 | COIL | Fan | u16 | n/a |\n| 7 | HOLDING | P | s32 | -3 |\n"
    )
    rows = chart_of(table, "notes.md").rows
    assert [(row.area, row.address, row.type, row.scale) for row in rows] == [
        ("coil", 1, "bool", 1),
        ("holding", 7, "s32", 0.001),
    ]


def test_merged_headings_of_html_name_the_columns_below_them() -> None:
    page = (
        "<table><tr><th rowspan=2>Address</th><th rowspan=2>Name</th><th colspan=2>Coding</th><th rowspan=2>Unit</th>"
        "</tr><tr><th>Type</th><th>Factor</th></tr>"
        "<tr><td>500</td><td>Flow</td><td>UINT32</td><td>0.1</td><td>l/s</td></tr>"
        "<tr><td>502</td><td>Level</td><td>INT16</td><td>0.01</td><td>m</td></tr></table>"
    )
    rows = import_maps("page.html", page.encode())[0].chart.rows
    assert [(row.type, row.scale, row.unit) for row in rows] == [("u32", 0.1, "l/s"), ("s16", 0.01, "m")]
