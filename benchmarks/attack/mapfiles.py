"""Files of register maps as other programs and manuals have them, and what a hostile one must not do."""

from __future__ import annotations

import io
import json
from collections.abc import Sequence
from random import Random
from typing import Final

from attack.target import Target, folder

HA = """
modbus:
  - name: hub
    sensors:
      - {name: Voltage, slave: 3, address: 10, input_type: input, data_type: uint32, swap: word, scale: 0.1,
         unit_of_measurement: V}
      - {name: Room, slave: 3, address: 0x20, unit_of_measurement: C}
    switches:
      - {name: Pump, slave: 3, address: 5, write_type: coil}
"""
ESPHOME = """
sensor:
  - platform: modbus_controller
    name: Power
    register_type: read
    address: 0x3102
    value_type: U_DWORD_R
    filters: [{multiply: 0.01}, {lambda: !lambda 'return x;'}]
binary_sensor:
  - {platform: modbus_controller, name: Charging, register_type: read, address: 0x3201, bitmask: 0x0004}
"""
SOLARMAN = """
requests: [{start: 0, end: 10, mb_functioncode: 0x04}]
parameters:
  - group: grid
    items:
      - {name: Energy, rule: 3, scale: 0.1, uom: kWh, registers: [0x0002, 0x0003]}
      - {name: Heat, rule: 2, scale: 0.1, offset: 1000, registers: [5]}
      - {name: State, rule: 1, registers: [6], lookup: [{key: 0, value: Off}, {key: 1, value: Run}]}
"""
TELEGRAF = """
[[inputs.modbus]]
  name = "meter"
  slave_id = 1
  holding_registers = [
    {name = "power", byte_order = "CDAB", data_type = "FLOAT32-IEEE", address = [8, 9]},
    {name = "energy", byte_order = "ABCD", data_type = "UFIXED", scale = 0.01, address = [10, 11]},
  ]
"""
EXPORTER = """
modules:
  - name: m
    metrics:
      - {name: p, address: 300022, dataType: int16, factor: 3.5}
      - {name: q, address: 40023, dataType: float32, endianness: yolo}
"""
SCHEMA = """
description: D
blocks:
  - id: Main
    fields:
      - {id: F, expression: 'ieee754_32(hr:00010 # 2)', unit: V}
      - {id: S, expression: 'int16(4x21; 0xDEAD) / 10'}
      - {id: C, expression: 'F * 2'}
"""
MODPOLL = "device,m,1,,,\npoll,input_register,30001,36,BE_LE\nref,V1,30001,float32,r,V\nref,A1,30007,uint16,r,A,0.1\n"
IOBROKER = (
    "_address\tname\tunit\ttype\tlen\tfactor\toffset\n69\tU\tV\tuint16be\t1\t0.1\t0\n71\tI\tA\tfloatsw\t2\t1\t0\n"
)
WIRENBOARD = """{"title": "T", /* c */ "device": {"name": "T", "channels": [
  {"name": "U", "reg_type": "input", "address": "0x10", "format": "u32", "scale": 0.01, "word_order": "little_endian"},
  {"name": "Ready", "reg_type": "holding", "address": "50199:0:1"}, // bit 0
  {"name": "Run", "reg_type": "holding", "address": "50199:11:1"}]}}"""
SUNSPEC = json.dumps(
    {
        "id": 103,
        "group": {
            "name": "inverter",
            "points": [
                {"name": "ID", "type": "uint16", "size": 1},
                {"name": "A", "type": "uint16", "size": 1, "sf": "A_SF", "units": "A", "label": "Amps"},
                {"name": "A_SF", "type": "sunssf", "size": 1},
                {"name": "Sn", "type": "string", "size": 16},
            ],
        },
    }
)
RUSSIAN = (
    "Параметры;;;;\nАдрес;Наименование;Тип данных;Ед. изм.;Множитель\n0x0A;Напряжение;uint16;В;0,1\n11;Ток;float;А;\n"
)
GERMAN = (
    "Registeradresse;Bezeichnung;Datentyp;Einheit;Faktor\n40001;Spannung L1;FLOAT32;V;1\n40003;Strom;INT16;A;0,01\n"
)
ENGLISH = (
    "Modbus Register,Parameter,Format,Units,Scale,R/W\n30001,Voltage,Float,V,,R\n100-101,Energy,UINT32,kWh,/100,RO\n"
)
OWN = """# device: Meter
# word_order: CDAB
# match: server_id: METER-3; register: holding 11 = 341; poll: input 0 72
area,address,name,type,order,length,scale,offset,scale_register,unit,values,access,min,max,description,group,note
input,0,Voltage L1,u16,,,0.1,,,V,,,0,300,,Grid,mine
input,0x10,Energy,u32,CDAB,,1/100,,,kWh,,,,,,,
holding,4x108,Mode,enum,,,,,,,0=off; 1=on,rw,,,,,
,40201,Serial,text,,8,,,,,,r,,,,,
"""
OWN_YAML = """
device: Meter
registers:
  - &first {area: input, address: 0, name: Voltage, type: u32, scale: 0.1, unit: V}
  - {<<: *first, address: 2, name: Current}
  - {area: holding, address: 7, name: Mode, type: enum, values: {0: off, 1: on}}
"""
SAMPLES: Final = {
    "ha.yaml": HA,
    "esphome.yaml": ESPHOME,
    "solarman.yaml": SOLARMAN,
    "telegraf.toml": TELEGRAF,
    "exporter.yml": EXPORTER,
    "schema.yaml": SCHEMA,
    "modpoll.csv": MODPOLL,
    "inputRegs.tsv": IOBROKER,
    "wb.json": WIRENBOARD,
    "sunspec.json": SUNSPEC,
    "russian.csv": RUSSIAN,
    "german.csv": GERMAN,
    "english.csv": ENGLISH,
    "own.csv": OWN,
    "own.yaml": OWN_YAML,
}
_TOKENS: Final = (
    b"&a [*a, *a]", b"*a", b"!lambda ", b"!!python/object/apply:os.system ['x']", b"65536", b"99999999999999999999",
    b"1e308", b"0x", b"4x0", b"400000", b"\xe2\x80\xa8", b"registers:", b"  - ", b": ", b",", b";", b"\t", b"# match: ",
    b"scale", b"/0", b"1/0", b"u64", b"text", b"length", b"count: 1000000000", b"/*", b"values: ", b"=", b"2026-13-45",
    b"\\ud800", b"address_base: 1", b".nan", b"-.inf", b"[[inputs.modbus]]", b"null", b"true",
)  # fmt: skip


def _seeds() -> Sequence[bytes]:
    return [text.encode() for text in SAMPLES.values()]


def workbook(rows: Sequence[Sequence[object]]) -> bytes:
    """A workbook of one sheet."""
    import openpyxl

    book, file = openpyxl.Workbook(), io.BytesIO()
    for row in rows:
        book.active.append(row)
    book.save(file)
    return file.getvalue()


def _workbooks() -> Sequence[bytes]:
    rows: list[list[object]] = [
        ["List"],
        [],
        ["Address", "Name", "Type", "Unit"],
        [5, "Flow", "float", "m3/h"],
        ["0x10", "State", "", ""],
    ]
    return [workbook(rows), workbook([["Register", "Description", "R/W"], *([n, f"v{n}", "R"] for n in range(40))])]


def _take(data: bytes, chance: Random) -> None:
    """Read in every way that there is; what is read is one line a text, and survives its own files."""
    from dissectors.maps import read_map
    from dissectors.maps.importers import FORMATS, import_maps

    name = chance.choice(tuple(SAMPLES))
    if chance.random() < 0.3:
        path = folder() / f"map{chance.choice(('.csv', '.yaml', '.tsv'))}"
        path.write_bytes(data)
        charts = [read_map(path)]
    else:
        form = chance.choice((None, None, None, *FORMATS))
        charts = [one.chart for one in import_maps(name, data, name=form)]
    for chart in charts:
        _survives(chart, chance)


def _take_workbook(data: bytes, chance: Random) -> None:
    from dissectors.maps.importers import import_maps

    for one in import_maps("list.xlsx", data):
        assert all("\n" not in note for note in one.notes)
        _survives(one.chart, chance)


def _survives(chart: object, chance: Random) -> None:
    from dissectors.maps.model import RegisterMap, read_mapped
    from dissectors.maps.table import read_table, write_table
    from dissectors.maps.yamlform import read_yaml, write_yaml

    assert isinstance(chart, RegisterMap)
    said = [chart.device, chart.vendor, *chart.other, *chart.other.values()]
    for row in chart.rows:
        said += [row.name, row.unit, row.description, row.group, *row.values.values(), *row.other.values()]
        read_mapped(row, [chance.randrange(0x10000) for _ in range(row.length)], chance.choice((None, 0, 0xFFFF)))
    assert all(text.isprintable() for text in said)
    assert read_table(write_table(chart), "again.csv").rows == chart.rows
    assert read_yaml(write_yaml(chart), "again.yaml").rows == chart.rows


def _panel(data: bytes, _: Random) -> None:
    from analyzer.registers.panel import read_panel

    read_panel(data.decode(errors="replace"), "panel.csv")


def map_targets() -> list[Target]:
    """Maps, workbooks, and tables of `registers --like`."""
    from analyzer.registers.panel import PanelError
    from dissectors.maps import MapError

    panels = (b"time,value\n12:00:01,230.1\n12:00:02,230.4\n", b"2026-11-21 10:45:00;1,5\n2026-11-21 10:45:01;1,6\n")
    return [
        Target("register maps", _seeds, _take, (MapError,), _TOKENS, 30),
        Target("map workbooks", _workbooks, _take_workbook, (MapError,), share=1, seconds=3.0),
        Target("panels", lambda: panels, _panel, (PanelError,), (b"e400", b"12:99", b";;", b"nan"), 5),
    ]
