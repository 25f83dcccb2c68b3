"""Tables of registers as their users have them: other encodings, headings, addresses and factors; one oddity each."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest
from oddmaps import OddFile, check_import
from running import refused

from dissectors.maps import MapError, lines
from dissectors.maps.importers import builder, general, import_maps, source
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
    assert any("divisors" in note for note in imported.notes)
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


TABLES: dict[str, OddFile] = {
    "Excel's line that names its delimiter": (
        "list.csv",
        b"sep=;\r\nRegister;Name;Type;Scale\r\n40001;Level, tank 1;UINT16;0,1\r\n40002;Level, tank 2;UINT16;0,1\r\n",
        ["holding 0 u16 x0.1 Level, tank 1", "holding 1 u16 x0.1 Level, tank 2"],
        "",
    ),
    "headings that are one long word": (
        "liste.csv",
        "Pumpe PS-40;;;;;\n;;;;;\nLfd. Nr.;Modbus-Adresse;Bezeichnung;Datenformat;Einheit;Skalierungsfaktor;"
        "Lesen/Schreiben\n1;0x0100;Vorlauf;INT16;°C;0,1;R\n2;0x0101;Durchfluss;UINT32 (Low Word first);l/h;0,01;R\n"
        "3;0x0103;Betriebsart (0 = Aus, 1 = Hand, 2 = Auto);UINT16;-;1;R/W\n4;0x0104;Leistung;FLOAT32;kW;-;R\n"
        .encode("cp1252"),
        ["holding 256 s16 x0.1 °C r Vorlauf", "holding 257 u32 CDAB x0.01 l/h r Durchfluss",
         "holding 259 u16 rw {0=Aus; 1=Hand; 2=Auto} Betriebsart", "holding 260 f32 kW r Leistung"],
        "",
    ),
    "logical numbers of all four areas, states in remarks": (
        "list.csv",
        b"Function code,Starting address,Qty,Data name,Data type,Unit,Resolution,Remark\n"
        b"04H,30001,1,Voltage,UINT,V,0.1 V,\n"
        b"04H,30011-30012,2,Energy,UDINT,kWh,0.01 kWh,High word first\n02H,10003,1,Door,BOOL,,,\n"
        b'03H,40101,1,Baud,UINT,,1,"0: 4800, 1: 9600"\n01H,00001,1,Relay,BOOL,,,\n',
        ["input 0 u16 x0.1 V r Voltage", "input 10 u32 x0.01 kWh r Energy", "discrete 2 bool r Door",
         "holding 100 u16 {0=4800; 1=9600} Baud", "coil 0 bool Relay"],
        "",
    ),
    "UTF-16 without its mark": (
        "list.txt",
        "Address\tName\tType\n5\tFlow\tfloat\n7\tTotal\tU32\n".encode("utf-16-le"),
        ["holding 5 f32 Flow", "holding 7 u32 Total"],
        "",
    ),
    "units in the names, no column for them": (
        "list.csv",
        "Адрес;Наименование;Тип\n0;Напряжение L1, В;U16\n1;Ток L1 (А);U16\n2;Мощность [кВт];S16\n3;Пуск, стоп;U16\n"
        .encode("cp1251"),
        ["holding 0 u16 В Напряжение L1", "holding 1 u16 А Ток L1", "holding 2 s16 кВт Мощность",
         "holding 3 u16 Пуск, стоп"],
        "",
    ),
    "types with their order in brackets": (
        "list.csv",
        b"Address;Name;Type\n0;A;UINT32 (ABCD)\n2;B;INT32 (CDAB)\n4;C;float inverse\n6;D;Float32 word swap\n8;E;S16\n"
        b"9;F;Float (DCBA)\n11;G;U32 LE\n",
        ["holding 0 u32 A", "holding 2 s32 CDAB B", "holding 4 f32 CDAB C", "holding 6 f32 CDAB D", "holding 8 s16 E",
         "holding 9 f32 DCBA F", "holding 11 u32 G"],
        "row 8: .*taken for ABCD",
    ),
    "types in words": (
        "list.csv",
        b"Register,Name,Format\n1,A,INT16U\n2,B,INT32S\n4,C,32-bit float\n6,D,16 bit signed\n7,E,Unsigned 32 bits\n"
        b"9,F,INT64U\n13,G,32bit unsigned integer\n15,H,signed short\n16,I,u_int32\n18,J,2 x 16 bit\n20,K,i16\n",
        ["holding 1 u16 A", "holding 2 s32 B", "holding 4 f32 C", "holding 6 s16 D", "holding 7 u32 E",
         "holding 9 u64 F", "holding 13 u32 G", "holding 15 s16 H", "holding 16 u32 I", "holding 18 u32 J",
         "holding 20 s16 K"],
        "",
    ),
    "types in a letter and a width": (
        "list.csv",
        b"Address;Name;Type\n0;A;f32\n2;B;F64\n6;C;FP32\n8;D;f32 CDAB\n10;E;U32\n12;F;float64\n16;G;s16\n17;H;F\n",
        ["holding 0 f32 A", "holding 2 f64 B", "holding 6 f32 C", "holding 8 f32 CDAB D", "holding 10 u32 E",
         "holding 12 f64 F", "holding 16 s16 G", "holding 17 f32 H"],
        "",
    ),
    "headings of two rows": (
        "list.csv",
        b"Pump,,,,,\nRegister,,Parameter,Value,,\nDec,Hex,,Type,Factor,Unit\n4096,1000,Flow,uint32,0.01,m3/h\n"
        b"4098,1002,Head,int16,0.1,m\n",
        ["holding 4096 u32 x0.01 m3/h Flow", "holding 4098 s16 x0.1 m Head"],
        "",
    ),
    "types in Russian words": (
        "list.csv",
        "Рег.;Параметр;Тип\n10;A;беззнаковое 32 бит\n12;B;целое со знаком\n13;C;с плавающей точкой\n15;D;строка 16\n"
        "23;E;знаковое 32\n25;F;битовая маска\n".encode(),
        ["holding 10 u32 A", "holding 12 s16 B", "holding 13 f32 C", "holding 15 text D", "holding 23 s32 E",
         "holding 25 bits F"],
        "",
    ),
    "scales in all manners": (
        "list.csv",
        "Address;Name;Scale\n0;A;0,1\n1;B;/10\n2;C;x0.1\n3;D;×0,01\n4;E;÷100\n5;F;1/10\n6;G;10^-3\n7;H;*0.5\n8;I;1:10\n"
        "9;J;1E-2\n10;K;0.1 V\n11;L;-\n12;M;10⁻²\n13;N;-0,1\n".encode(),
        ["holding 0 u16 x0.1 A", "holding 1 u16 x0.1 B", "holding 2 u16 x0.1 C", "holding 3 u16 x0.01 D",
         "holding 4 u16 x0.01 E", "holding 5 u16 x0.1 F", "holding 6 u16 x0.001 G", "holding 7 u16 x0.5 H",
         "holding 8 u16 x0.1 I", "holding 9 u16 x0.01 J", "holding 10 u16 x0.1 V K", "holding 11 u16 L",
         "holding 12 u16 x0.01 M", "holding 13 u16 x-0.1 N"],
        "",
    ),
    "ranges in all manners": (
        "list.csv",
        b'Registers;Name\n100-101;A\n102..103;B\n104/105;C\n"106, 107";D\n108 + 109;E\n110 to 113;F\n114;G\n'
        b"115 & 116;H\n",
        ["holding 100 u32 A", "holding 102 u32 B", "holding 104 u32 C", "holding 106 u32 D", "holding 108 u32 E",
         "holding 110 u64 F", "holding 114 u16 G", "holding 115 u32 H"],
        "",
    ),
    "line breaks in headings and cells": (
        "list.csv",
        b'"Modbus\naddress";"Parameter\nname";"Data\ntype"\n40001;"Outlet\ntemperature";"INT\n16"\n'
        b'40002;"Return\r\ntemperature";INT16\n',
        ["holding 0 s16 Outlet temperature", "holding 1 s16 Return temperature"],
        "",
    ),
    "empty rows, a repeated heading, a foot note": (
        "list.csv",
        b"Meter 7,,,\n,,,\nAddress,Name,Type,Unit\n,,,\n1,U,u16,V\n,,,\nPage 2,,,\nAddress,Name,Type,Unit\n"
        b"2,I,u16,A\n,,,\nNote:,all values read only,,\n",
        ["holding 1 u16 V U", "holding 2 u16 A I"],
        "row 11: 'Note:' is not an address",
    ),
    "a logical and a protocol address side by side": (
        "list.csv",
        b"Modbus address;Register (hex);Name;Type\n40101;0x0064;U;u16\n40102;0x0065;I;u16\n",
        ["holding 100 u16 U", "holding 101 u16 I"],
        "",
    ),
    "six figures and thin gaps": (
        "list.csv",
        "Register;Name;Type\n400 001;A;u16\n400\u202f003;B;u32\n300001;C;u16\n".encode(),
        ["holding 0 u16 A", "holding 2 u32 B", "input 0 u16 r C"],
        "",
    ),
    "access in words": (
        "list.csv",
        "Адрес;Имя;Доступ\n1;A;только чтение\n2;B;чтение/запись\n3;C;запись\n4;D;write only\n5;E;RO\n6;F;R/W\n"
        "7;G;Read\n".encode(),
        ["holding 1 u16 r A", "holding 2 u16 rw B", "holding 3 u16 w C", "holding 4 u16 w D", "holding 5 u16 r E",
         "holding 6 u16 rw F", "holding 7 u16 r G"],
        "",
    ),
    "a column that is missing its heading, cells too many": (
        "list.csv",
        b"No;Address;;Name;Type\n1;10;x;Speed;u16;left over\n2;11;;Torque;s16\n3;12\n",
        ["holding 10 u16 Speed", "holding 11 s16 Torque", "holding 12 u16 Register 12"],
        "row 4: no name",
    ),
    "area in a column of short words": (
        "list.tsv",
        b"Type\tAddress\tName\tFormat\nAI\t0\tFlow\tFLOAT\nDI\t3\tDoor\tBOOL\nDO\t4\tPump\tBOOL\nAO\t9\tSetpoint\tINT\n",
        ["input 0 f32 r Flow", "discrete 3 bool r Door", "coil 4 bool Pump", "holding 9 s16 Setpoint"],
        "",
    ),
    "German of Windows": (
        "liste.csv",
        "Adresse;Bezeichnung;Datentyp;Länge;Größe\n10;Rücklauftemperatur;INT16;1;°C\n11;Störung Lüfter;UINT16;1;\n"
        .encode("cp1252"),
        ["holding 10 s16 °C Rücklauftemperatur", "holding 11 u16 Störung Lüfter"],
        "",
    ),
    "Chinese": (
        "list.csv",
        "参数名称,地址（十六进制）,长度（字）,数据格式,说明,读写\n电压,0010H,1,无符号,单位0.1V,只读\n功率,0012H,2,有符号,单位W,只读\n"
        "模式,0020H,1,无符号,0：停；1：启,读写\n".encode(),
        ["holding 16 u16 x0.1 V r 电压", "holding 18 s32 W r 功率", "holding 32 u16 rw {0=停; 1=启} 模式"],
        "",
    ),
    "Romance languages": (
        "list.csv",
        "Adresse;Désignation;Unité;Coefficient;Accès\n5;Tension;V;0,1;Lecture\n6;Consigne;°C;0,5;L/E\n".encode(),
        ["holding 5 u16 x0.1 V r Tension", "holding 6 u16 x0.5 °C rw Consigne"],
        "",
    ),
    "columns that blanks part": (
        "manual.txt",
        b"Address   Name               Type     Unit   Access\n7         Supply voltage     UINT16   V      R\n"
        b"8         Operating hours    UINT32   h      R\n10        State              UINT16          R\n",
        ["holding 7 u16 V r Supply voltage", "holding 8 u32 h r Operating hours", "holding 10 u16 r State"],
        "",
    ),
    "bits in rows below their register": (
        "list.csv",
        b"Register,Bit,Name,Type\n7,,Status,UINT16\n,0,Ready,\n,3,Fault,\n8,,Alarms,UINT16\n,,Bit 1: hot,\n"
        b",,Bit 2: cold,\n",
        ["holding 7 bits {0=Ready; 3=Fault} Status", "holding 8 bits {1=hot; 2=cold} Alarms"],
        "",
    ),
    "widths, signs and octets in columns": (
        "list.csv",
        b"Address,Name,Size,Signed,Mult.,Offset (bytes)\n0,A,16,yes,.1,0\n1,B,32,no,1,2\n",
        ["holding 0 s16 x0.1 A", "holding 1 u32 B"],
        "",
    ),
    "lengths in octets": (
        "list.csv",
        b"Start,End,Bytes,Name,Format\n0,1,4,Serial,UINT\n2,9,16,Model,ASCII\n",
        ["holding 0 u32 Serial", "holding 2 text Model"],
        "",
    ),
    "steps in every place": (
        "list.csv",
        "Addr;Var;Type;Remark\n0;A;U16 x0.01;\n1;B;U16;0,1 °C\n2;C (0.1 V);U16;\n3;D (A x 100);U16;\n"
        "4;E, bar;U16/10;1 a day\n".encode(),
        ["holding 0 u16 x0.01 A", "holding 1 u16 x0.1 °C B", "holding 2 u16 x0.1 V C", "holding 3 u16 x0.01 A D",
         "holding 4 u16 x0.1 bar E"],
        "",
    ),
    "numbers that are none of a logical table": (
        "list.csv",
        b"Address,Name\n30000,Model\n30070,Rated power\n40000,Clock\n",
        ["holding 30000 u16 Model", "holding 30070 u16 Rated power", "holding 40000 u16 Clock"],
        "",
    ),
    "coils among addresses with their area": (
        "list.csv",
        b"PLC address,Tag\n4x0001,A\n0x0005,B\n1x0002,C\n",
        ["holding 0 u16 A", "coil 4 bool B", "discrete 1 bool r C"],
        "",
    ),
    "a Chinese sensor's sheet": (
        "list.csv",
        "寄存器地址,内容,操作,定义说明\n0001 H,湿度,只读,湿度实时值（扩大10倍）\n07D0 H,设备地址,读写,1~254\n".encode(),
        ["holding 1 u16 x0.1 r 湿度", "holding 2000 u16 rw 设备地址"],
        "",
    ),
    "access under `Type`, numbers of parameters": (
        "list.csv",
        b"Parameter No.,Modbus Address,Parameter Name,Units,Type\nP1-01,129,Top speed,Hz,R/W\nP1-02,130,Load,%,R\n",
        ["holding 129 u16 Hz rw Top speed", "holding 130 u16 % r Load"],
        "",
    ),
    "columns below a rule": (
        "list.rst",
        b"======= ========= ====\nAddress Name      Type\n======= ========= ====\n7       Supply V  u16\n"
        b"8       Hours     u32\n======= ========= ====\n",
        ["holding 7 u16 Supply V", "holding 8 u32 Hours"],
        "",
    ),
    "objects of JSON": (
        "list.json",
        b'{"registers": [{"address": 7, "name": "U", "type": "int16", "scale": 0.1, "unit": "V"},'
        b' {"address": 8, "name": "Mode", "values": {"0": "off", "1": "on"}}]}',
        ["holding 7 s16 x0.1 V U", "holding 8 u16 {0=off; 1=on} Mode"],
        "",
    ),
    "what a title says of all rows": (
        "list.csv",
        "Порядок слов: младшим вперёд; адреса в hex,\nАдрес,Параметр,Тип\n10,U,float\n1A,I,float (ABCD)\n".encode(),
        ["holding 16 f32 CDAB U", "holding 26 f32 I"],
        "",
    ),
    "places behind the point": (
        "list.csv",
        "Адрес;Имя;Знаков после запятой;Формат\n0;U;1;\n1;I;;XX.XX\n2;N;0;\n".encode(),
        ["holding 0 u16 x0.1 U", "holding 1 u16 x0.01 I", "holding 2 u16 N"],
        "",
    ),
    "areas under `Modbus type`, states in brackets and in a row": (
        "list.csv",
        b'Offset,Modbus type,Item,Options\n1,Input Register,Fan,"Off (0), Low (1)"\n2,Coil,Run,\n'
        b"3,Holding Register,Mode,0-Off 1-Heat 2-Cool\n",
        ["input 1 u16 r {0=Off; 1=Low} Fan", "coil 2 bool Run", "holding 3 u16 {0=Off; 1=Heat; 2=Cool} Mode"],
        "",
    ),
    "coils counted from 00001 below their title": (
        "list.csv",
        b"Coil status,\nAddress,Item\n00001,Enable\n00002,Reset\n",
        ["coil 0 bool Enable", "coil 1 bool Reset"],
        "",
    ),
    "whether one can write, names in the second column of them, states as JSON": (
        "list.csv",
        b"variable name,data type,register,documented name,writable,values\n"
        b',uint16,7,Relay,yes,"{""0"":""Open"",""1"":""Closed""}"\n'
        b',16BIT_FLAGS,8,Alarms,no,"{""b0"": ""hot"", ""b3"": ""cold, wet""}"\n,,9~10,Total,R,\n',
        ["holding 7 u16 rw {0=Open; 1=Closed} Relay", "holding 8 bits r {0=hot; 3=cold, wet} Alarms",
         "holding 9 u32 r Total"],
        "",
    ),
    "an area as the heading of addresses": (
        "list.csv",
        b"Coil,Function\n7,Pump 1 on\n8,Pump 2 on\nInput register,Value,Size\n7,Level,s16\n8,Flow,u32\n",
        ["coil 7 bool Pump 1 on", "coil 8 bool Pump 2 on", "input 7 s16 r Level", "input 8 u32 r Flow"],
        "",
    ),
    "bits of a register that comes again": (
        "list.csv",
        b"Address,Bit,Description\n7,0,Ready\n7,1,Fault\n8,,Speed\n9,0,Alone\n",
        ["holding 8 u16 Speed", "holding 9 u16 Alone", "holding 7 bits {0=Ready; 1=Fault} Bits of 7"],
        "",
    ),
    "the first word in a column": (
        "list.csv",
        b"Address;Name;Type;Word order;Schreib-/Lesezugriff\n0;A;float;big;l\n2;B;float;little;l/s\n",
        ["holding 0 f32 r A", "holding 2 f32 CDAB rw B"],
        "",
    ),
    "powers of ten as factors": (
        "list.csv",
        b"Address,Name,Type,Scale factor\n0,U,uint16,-1\n1,I,uint16,-3\n2,P,uint32,0\n4,S,uint16,1\n",
        ["holding 0 u16 x0.1 U", "holding 1 u16 x0.001 I", "holding 2 u32 P", "holding 4 u16 x10 S"],
        "powers of ten",
    ),
    "states in the remarks": (
        "list.csv",
        b'Address;Name;Type;Remark\n7;Mode;enum;0: off, 1: heat, 2: cool\n8;Alarm;bitmap;"Bit0: low; Bit1: high"\n',
        ["holding 7 enum {0=off; 1=heat; 2=cool} Mode", "holding 8 bits {0=low; 1=high} Alarm"],
        "",
    ),
    "XML with attributes": (
        "dryer.xml",
        b'<dryer><at reg="20" caption="Inlet" coded="int16" eu="V" slope="0.1"/>'
        b'<at reg="21" caption="Belt" coded="uint16" eu="A" slope="1"/></dryer>',
        ["holding 20 s16 x0.1 V Inlet", "holding 21 u16 A Belt"],
        "",
    ),
    "XML with elements": (
        "tank.xml",
        b"<t><r><address>5</address><name>Level</name><type>u16</type></r>"
        b"<r><address>6</address><name>Flow</name><type>f32</type></r></t>",
        ["holding 5 u16 Level", "holding 6 f32 Flow"],
        "",
    ),
    "items that have names, in a program": (
        "regs.py",
        b"REGS = [\n  {'address': 0x10, 'name': 'In', 'type': 'int16', 'of': [1, 2]},  # first\n"
        b"  {'address': 0x11, 'name': 'It\\'s', 'type': 'uint16'},\n]\nprint(REGS[0], '{')\n",
        ["holding 16 s16 In", "holding 17 u16 It\\'s"],
        "",
    ),
    "items behind a comment that names them": (
        "regs.go",
        b'// address, name, kind\nvar r = []Point{\n\t{7, "In", "int16"},\n\t{8, "Out", "uint16"},\n}\n',
        ["holding 7 s16 In", "holding 8 u16 Out"],
        "",
    ),
    "items of a structure": (
        "regs.h",
        b'typedef struct { uint16_t address; const char *name; char type[8]; } point_t;\n'
        b'point_t p[2] = { {7, "In", "int16"}, {8, "Out", "uint16"} };\n',
        ["holding 7 s16 In", "holding 8 u16 Out"],
        "",
    ),
    "rows of SQL": (
        "regs.sql",
        b"INSERT INTO p (spot, caption, wire) VALUES (7, 'In', 'int16'), (8, 'Out', 'uint16');",
        ["holding 7 s16 In", "holding 8 u16 Out"],
        "",
    ),
    "names of addresses with remarks": (
        "regs.h",
        b"#ifndef H\n#define H\n#define T_IN 0x10 /* int16, 0.1 V */\n#define P_IN 0x11u // uint16, 1 bar\n#endif\n",
        ["holding 16 s16 x0.1 V T_IN", "holding 17 u16 bar P_IN"],
        "",
    ),
    "variables of a controller": (
        "line.st",
        b"VAR\n  Speed AT %MW5 : UINT; (* V *)\n  Level AT %MW6 : REAL; (* A *)\nEND_VAR\n",
        ["holding 5 u16 V Speed", "holding 6 f32 A Level"],
        "",
    ),
    "blocks of lines": (
        "meter.txt",
        b"Meter\n\naddress: 5\nname: Level\ntype: u16\n\naddress: 6\nname: Flow\ntype: f32\nunit: bar\n",
        ["holding 5 u16 Level", "holding 6 f32 bar Flow"],
        "",
    ),
    "a table of a wiki": (
        "page.wiki",
        b'{| class="wikitable"\n! address !! name !! type\n|-\n| 5 || Level || u16\n|-\n| 6\n| Flow\n| f32\n|}\n',
        ["holding 5 u16 Level", "holding 6 f32 Flow"],
        "",
    ),
    "a table in drawn lines": (
        "page.txt",
        "┌───┬───────┬─────┐\n│ address │ name │ type │\n├───┼───────┼─────┤\n│ 5 │ Level │ u16 │\n│ 6 │ Flow │ f32 │\n"
        "└───┴───────┴─────┘\n".encode(),
        ["holding 5 u16 Level", "holding 6 f32 Flow"],
        "",
    ),
    "no headings": (
        "plain.csv",
        b"5;Level;UINT16;V;0.1\n6;Flow;FLOAT;A;1\nx;Old;UINT16;V;1\n8;Rest;INT16;V;1\n",
        ["holding 5 u16 x0.1 V Level", "holding 6 f32 A Flow", "holding 8 s16 V Rest"],
        "row 3: 'x' is not an address",
    ),
    "divisors under a word that nobody knows": (
        "list.csv",
        b"address,name,type,foo\n5,A,u16,10\n6,B,u16,100\n7,C,u16,1\n",
        ["holding 5 u16 x0.1 A", "holding 6 u16 x0.01 B", "holding 7 u16 C"],
        "",
    ),
    "entries, parts in any order, a title with the area": (
        "gauge.txt",
        b"Tank gauge, function 04\n\n101: Level (left), uint16, 0.1 cm, R\n102: Total: R, uint32, rpm\n"
        b"104 - Flow - 1 l - uint16\n",
        ["input 101 u16 x0.1 cm r Level (left)", "input 102 u32 rpm r Total", "input 104 u16 l r Flow"],
        "",
    ),
    "bullets of Markdown": (
        "chiller.md",
        "# Chiller\n\n- **0x0010** Supply (int16, 0.1 °C)\n- `0x0011-0x0012` Energy: kWh, RW\n"
        "* 0x13 Fan [uint16]\n".encode(),
        ["holding 16 s16 x0.1 °C Supply", "holding 17 u32 kWh rw Energy", "holding 19 u16 Fan"],
        "",
    ),
    "remarks of another order": (
        "regs.h",
        b"#define LEVEL 16 /* R, uint16, 0.1 m */\n#define LIMIT 0x20 // RW, 0.5 m, uint16\n",
        ["holding 16 u16 x0.1 m r LEVEL", "holding 32 u16 x0.5 m rw LIMIT"],
        "",
    ),
    "addresses from 1 on, as the heading says": (
        "list.csv",
        b"Register (1-based),Name,Type\n1,A,u16\n2-3,B,u32\n40011,C,u16\n",
        ["holding 0 u16 A", "holding 1 u32 B", "holding 10 u16 C"],
        "counted from 1",
    ),
    "addresses from 1 on, as a title says; one is 0": (
        "list.csv",
        b"Addresses are 1-based\nRegister,Name,Type\n0,A,u16\n2,B,u16\n",
        ["holding 0 u16 A", "holding 2 u16 B"],
        "",
    ),
    "a table on its side": (
        "side.csv",
        b"Meter,,\nRegister,50,52\nName,Energy,Speed\nType,UINT32,UINT16\nUnit,kWh,rpm\n",
        ["holding 50 u32 kWh Energy", "holding 52 u16 rpm Speed"],
        "",
    ),
    "columns of blanks below two words": (
        "pdf.txt",
        b"  METER      page 12\n\n  Register   Name    Type     Unit\n  5          Level   UINT16   V\n"
        b"  6          Flow    INT16    A\n",
        ["holding 5 u16 V Level", "holding 6 s16 A Flow"],
        "",
    ),
    "accents left out": (
        "list.csv",
        b"Denomination;Acces;Regle;Adresse;Libelle\nx;L;1;5;Niveau\nx;L/E;2;6;Debit\n",
        ["holding 5 u16 r Niveau", "holding 6 u16 rw Debit"],
        "",
    ),
}  # fmt: skip


@pytest.mark.parametrize("oddity", TABLES)
def test_a_table_of_people(oddity: str) -> None:
    check_import(TABLES[oddity])


def test_what_is_read_in_part_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    for module, limit, least in (
        (builder, "_MOST_ROWS", 2000), (source, "_MOST_LINES", 4000),
        (general, "_MOST_LINES", 2000), (lines, "_TEXT", 1 << 15),
    ):  # fmt: skip
        assert getattr(module, limit) >= 8 * least
        monkeypatch.setattr(module, limit, least)
    rows = "".join(f"{at};Value {at};u16\n" for at in range(2500))
    sheets = {
        "over 2,000 values": "Address;Name;Type\n" + rows,
        "only the first 100 headings": "Address;Name;Type\n5;A;u16\n" * 300,
        "only the first 100 columns": "Address;Name;Type" + ";" * 200 + "\n5;A;u16\n",
        "only the first 4,000 rows": "_address;len;factor\n" + "5;1;1\n" * 4500,
        "only the first 2,000 rows": "".join(f"{at % 9}: U, u16\n" for at in range(2500)),
        "only the first 32,768 characters": "".join(f"{at % 9}: Value of it, uint16\n" for at in range(1700)),
    }
    for note, text in sheets.items():
        (imported,) = import_maps("x.csv", text.encode())
        assert any(re.search(note, said) for said in imported.notes), note
    prose = "A sentence of words.\n" * 70 + "Address;Name;Type\n5;A;u16\n"
    with pytest.raises(MapError, match="in its first 60 rows"):
        import_maps("x.csv", prose.encode())
