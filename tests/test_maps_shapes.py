"""Shapes of files of registers that no table of words tells: where cells stand, what columns are beside each other."""

from __future__ import annotations

import pytest
from oddmaps import OddFile, check_import

from dissectors.maps import MapError
from dissectors.maps.importers import import_maps

SHAPES: dict[str, OddFile] = {
    "addresses that are far from logical numbers": (
        "regs.py",
        b'REGS = {\n  "Power": {"addr": 33071, "type": "S32", "unit": "W"},\n'
        b'  "Energy": {"addr": 33040, "type": "U16", "scale": 0.1, "unit": "kWh"},\n}\n',
        ["holding 33071 s32 W Power", "holding 33040 u16 x0.1 kWh Energy"],
        "",
    ),
    "one heading again on each page, its columns askew in a row": (
        "paste.txt",
        b"""Signal definitions (function code 0x03 read / 0x06 write)

No.  Name              R/W  Type  Unit  Gain  Address  Words
1    Model code        RO   U16   N/A   1     30000    1
2    Rated power       RO   U32   kW    1000  30012    2
3    State             RO   Bitfield16  N/A  1  32010  1
4    String voltage 1  RO   I16   V     10    32020    1
5    String current 1  RO   I16   A     100   32021    1
6    String voltage 2  RO   I16   V     10    32022    1
7    String current 2  RO   I16   A     100   32023    1
8    Grid voltage      RO   U16   V     10    32030    1
9    Grid frequency    RO   U16   Hz    100   32031    1
10   Cabinet           RO   I16   V     10    32032    1
11   Insulation        RO   U16   V     10    32033    1
12   Heat sink         RO   I16   V     10    32034    1
Edition 2 (May)                       Page 7
No.  Name              R/W  Type  Unit  Gain  Address  Words
13   Power limit       RW   I16   %     10    40120    1

NOTE The value is the number divided by the gain.
""",
        ["holding 30000 u16 r Model code", "holding 30012 u32 x0.001 kW r Rated power", "holding 32010 bits r State",
         *(f"holding {at} {text}" for at, text in (
             (32020, "s16 x0.1 V r String voltage 1"), (32021, "s16 x0.01 A r String current 1"),
             (32022, "s16 x0.1 V r String voltage 2"), (32023, "s16 x0.01 A r String current 2"),
             (32030, "u16 x0.1 V r Grid voltage"), (32031, "u16 x0.01 Hz r Grid frequency"),
             (32032, "s16 x0.1 V r Cabinet"), (32033, "u16 x0.1 V r Insulation"), (32034, "s16 x0.1 V r Heat sink"),
             (40120, "s16 x0.1 % rw Power limit")))],
        "divisors",
    ),
    "headings in two lines, of a page of central Europe, with what one blank parts": (
        "miernik.txt",
        """Rejestry wejściowe (odczyt funkcją 0x04), domyślnie

 Adres        Opis                Typ             Jednostka   Mnożnik
 dec   hex
 0     0000   Napięcie fazy A     uint16          V           0,1
 2     0002   Prąd fazy A         uint16          A           0,01
 10    000A   Energia oddana      uint32 (2 rej.) kWh         0,01

Rejestry zmienne (odczyt 0x03, zapis 0x06)

 Adres        Opis                Typ             Jednostka   Mnożnik
 dec   hex
 256   0100   Adres licznika      uint16          -           1
""".encode("cp1250"),
        ["input 0 u16 x0.1 V r Napięcie fazy A", "input 2 u16 x0.01 A r Prąd fazy A",
         "input 10 u32 x0.01 kWh r Energia oddana", "holding 256 u16 rw Adres licznika"],
        "",
    ),
    "factors by which a sentence divides, one of them below 1": (
        "list.csv",
        b'Description,Address,Type,Scalefactor,writable\nMains voltage,3,uint16,10,no\nMains power,4,int16,0.1,no\n'
        b'Limit,9,int16,100,yes\n"Value = register / Scalefactor",,,,\n',
        ["holding 3 u16 x0.1 r Mains voltage", "holding 4 s16 x10 r Mains power", "holding 9 s16 x0.01 rw Limit"],
        "",
    ),
    "a sentence that names two areas": (
        "drive.md",
        "Os dados são **registradores do tipo holding**. Bits podem ser lidos como *coils*.\n\n"
        "Parâmetro | Descrição | Unidade | Tipo\n:--|:--|:--|:--\nP0002 | Velocidade | rpm | uint16\n"
        "P0003 | Corrente | A | uint16\n".encode(),
        ["holding 2 u16 rpm Velocidade", "holding 3 u16 A Corrente"],
        "",
    ),
    "inputs beside input registers": (
        "flow.json",
        b"""[{"type": "tab"}, {"name": "Level", "dataType": "InputRegister", "adr": "0", "quantity": "1"},
{"name": "Setpoint", "dataType": "HoldingRegister", "adr": "9", "quantity": "2"},
{"name": "Running", "dataType": "Input", "adr": "0", "quantity": "1"}]""",
        ["input 0 u16 r Level", "holding 9 u32 Setpoint", "discrete 0 bool r Running"],
        "",
    ),
    "types with remarks behind them": (
        "sensor.txt",
        "地址      内容        操作    说明\n0000H     湿度        只读    uint16，实际值的10倍，单位 %\n"
        "0001H     盐度        只读    uint16，实际值，单位 mg/L\n0010H     编号        读写    uint16，1~9\n".encode(),
        ["holding 0 u16 x0.1 % r 湿度", "holding 1 u16 mg/L r 盐度", "holding 16 u16 rw 编号"],
        "",
    ),
    "factors behind types, and a column that is called units": (
        "entities.py",
        b'A = [\n  Sensor(name="Voltage", native_unit_of_measurement="V", register=0x10, unit=REG_U16, scale=0.1),\n'
        b'  Sensor(name="Power", native_unit_of_measurement="W", register=0x12, unit=REG_S32),\n]\n',
        ["holding 16 u16 x0.1 V Voltage", "holding 18 s32 W Power"],
        "",
    ),
    "bridges with things, each named before its bracket": (
        "pump.things",
        b"""Bridge modbus:tcp:gw [ host="pump", id=1 ] {
  Bridge poller heat [ start=30, length=8, type="input" ] {
    Thing data flow "Flow temperature" [ readStart="30", readValueType="int16" ]
    Thing data sum  "Heat"             [ readStart="32", readValueType="uint32_swap" ]
  }
  Bridge poller flags [ start=0, length=2, type="discrete" ] {
    Thing data fault "Fault" [ readStart="1", readValueType="bit" ]
  }
}
""",
        ["input 30 s16 r Flow temperature", "input 32 u32 CDAB r Heat", "discrete 1 bool r Fault"],
        "",
    ),
    "lists of values by their names": (
        "meter.yaml",
        b"registers:\n  Voltage: [0x0000, float32, 1, V]\n  Current: [0x0006, float32, 1, A]\n"
        b"  Energy: [0x48, uint32, 0.1, kWh]\n",
        ["holding 0 f32 V Voltage", "holding 6 f32 A Current", "holding 72 u32 x0.1 kWh Energy"],
        "",
    ),
    "functions that read and that write, a column each": (
        "regs.md",
        "| Параметр | Тип | Адрес | Функция чтения | Функция записи |\n|---|---|---|---|---|\n"
        "| Вход | float32 | 0x0000 | 0x03 | – |\n| Уставка | int16 | 0x0010 | 0x03 | 0x10 |\n".encode(),
        ["holding 0 f32 r Вход", "holding 16 s16 rw Уставка"],
        "",
    ),
    "addresses in two bases beside each other": (
        "list.csv",
        "Регистр (DEC),Регистр (HEX),Наименование,Формат,Ед. изм.\n256,0100,Напряжение,UINT16,В\n"
        "258,0102,Ток,UINT32,А\n".encode(),
        ["holding 256 u16 В Напряжение", "holding 258 u32 А Ток"],
        "",
    ),
    "headings in two lines, each with words of its own": (
        "fan.txt",
        b" Modbus   | Register | Name     | Range       | R/W\n Function | Address  |          |             |\n"
        b"----------+----------+----------+-------------+-----\n 03/06    | 0        | Setpoint | 0..100 %    | R/W\n"
        b" 04       | 0        | Speed    | 0..3000 rpm | R\n",
        ["holding 0 u16 % rw Setpoint", "input 0 u16 rpm r Speed"],
        "",
    ),
    "units and factors in remarks": (
        "tags.csv",
        b'Tag,Address,Type,Description\nT_SUP,300101,INT16,"Supply [\xc2\xb0C], x10"\n'
        b"P_SUP,300103,UINT16,Pressure [Pa]\n",
        ["input 100 s16 x0.1 °C r T_SUP", "input 102 u16 Pa r P_SUP"],
        "",
    ),
    "headings that one blank parts, above columns that more do": (
        "meter.txt",
        b"Addr(Dec) Addr(Hex) Register Name      Bytes  Type     Unit   R/W\n"
        b"30001     00 00     Phase 1 volts       4     Float    V      R\n"
        b"30003     00 02     Phase 2 volts       4     Float    V      R\n"
        b"40029     00 1C     Network baud rate   4     Float           R/W\n",
        ["input 0 f32 V r Phase 1 volts", "input 2 f32 V r Phase 2 volts", "holding 28 f32 rw Network baud rate"],
        "",
    ),
    "names in marks of code": (
        "regs.md",
        b"**Function code 3**\n\n* 2 - `temp` - Temperature, signed, 0.1 V\n* 3 - `hum` - Humidity, 0.1 %\n",
        ["holding 2 s16 x0.1 V r temp - Temperature", "holding 3 u16 x0.1 % r hum - Humidity"],
        "",
    ),
    "limits below zero, rights in remarks": (
        "rejestry.csv",
        "Nr rejestru;Opis;Jednostka;Mnożnik;Zakres;Uwagi\n1;Nawiew;°C;10;-50..100;odczyt\n"
        "2;Wywiew;1/10 °C;1;-50..100;odczyt/zapis\n".encode(),
        ["holding 1 s16 x0.1 °C r Nawiew", "holding 2 s16 °C rw Wywiew"],
        "",
    ),
    "states on a line of their own, below a rule": (
        "relay.txt",
        b"Addr.  Description   R/W  Data type\n-----  ------------  ---  ---------\n0x30   Relay         R/W  UINT16\n"
        b"       0: open, 1: closed\n0x31   Ratio         R/W  UINT16\n",
        ["holding 48 u16 rw {0=open; 1=closed} Relay", "holding 49 u16 rw Ratio"],
        "",
    ),
    "one blank between cells, a title above that has words of headings": (
        "map.txt",
        b"Modbus Register Map\nAddr Description Type Units Scale Access\n0 Line voltage A U16 V 10 R\n"
        b"12 Energy to grid U32 kWh 100 R\n50 CT primary U16 A 1 RW\n",
        ["holding 0 u16 x0.1 V r Line voltage A", "holding 12 u32 x0.01 kWh r Energy to grid",
         "holding 50 u16 A rw CT primary"],
        "",
    ),
    "zabbix: functions, skipped registers, factors": (
        "ups.yaml",
        b"""zabbix_export:
  templates:
    - items:
        - {name: Input, key: 'modbus.get[{$PORT},1,4,7,1,int16]', units: V,
           preprocessing: [{type: MULTIPLIER, parameters: ['0.1']}]}
        - {name: Output, key: 'modbus.get[{$PORT},1,3,10,2,uint32,mle,2]'}
        - {name: Fault, key: 'modbus.get[{$PORT},1,2,3]'}
        - {name: Ping, key: icmpping}
""",
        ["input 7 s16 x0.1 V r Input", "holding 12 u32 CDAB Output", "discrete 3 bool r Fault"],
        "icmpping.* asks by no modbus.get",
    ),
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_of_people(shape: str) -> None:
    check_import(SHAPES[shape])


OTHERS = {
    "prices": "Art.-Nr.;Bezeichnung;Einheit;Menge ab;Preis netto\n40001;Fühler;Stk;1;89,50\n"
    "40002;Fühler;Stk;10;81,00\n",
    "alarms": "| Code | Text | Class | Reset |\n|---|---|---|---|\n| 1 | High pressure | A | manual |\n"
    "| 5 | Flow switch | A | auto |\n| 30 | Phases | B | manual |\n",
    "participants": "Slave ID;Device;Location;Baud rate\n1;Meter;cellar;9600\n2;Pump;cellar;9600\n",
    "groups of a bus": "Group address,Name,Description\n1/1/1,Light kitchen,switch\n1/1/2,Light hall,switch\n",
    "inputs of a controller": "Symbol;Adresse;Datentyp\nStart;E0.0;BOOL\nMotor;A4.0;BOOL\nLevel;EW64;INT\n",
}


@pytest.mark.parametrize("kind", OTHERS)
def test_what_lists_no_registers(kind: str) -> None:
    with pytest.raises(MapError):
        import_maps("list.md" if kind == "alarms" else "list.csv", OTHERS[kind].encode())
