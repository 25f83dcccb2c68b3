"""Kinds of files that people have maps in, one each: cells that wrap, sources that declare, entries of many lines."""

from __future__ import annotations

import json

import pytest
from oddmaps import check_import

from dissectors.maps.importers import import_maps
from dissectors.maps.written import order_of

_FILES = {
    "HTML whose cells of types, units and rights hold for several rows": (
        "releve.html",
        """<table>
<tr><th>Adresse</th><th>Libellé</th><th>Type</th><th>Unité</th><th>Coef.</th><th>Accès</th></tr>
<tr><td>100</td><td>Tension L1</td><td rowspan="2">uint16</td><td rowspan="2">V</td><td rowspan="2">0,1</td>
<td rowspan="3">Lecture</td></tr>
<tr><td>101</td><td>Tension L2</td></tr>
<tr><td>103-104</td><td>Energie</td><td>uint32</td><td>kWh</td><td>0,01</td></tr>
<tr><td>110</td><td>Consigne</td><td>int16</td><td>°C</td><td>0,1</td><td>Lecture/Ecriture</td></tr>
</table>
""",
        [
            "holding 100 u16 x0.1 V r Tension L1", "holding 101 u16 x0.1 V r Tension L2",
            "holding 103 u32 x0.01 kWh r Energie", "holding 110 s16 x0.1 °C rw Consigne",
        ],
    ),
    "tables of states between, which have no addresses": (
        "pumpe.md",
        """
## Halteregister

| Register | Bezeichnung | Datentyp | Faktor | Einheit | Zugriff |
|---|---|---|---|---|---|
| 10 | Betriebsart | uint16 | | | R/W |

| Wert | Bedeutung |
|---|---|
| 0 | Aus |
| 1 | Hand |

| Register | Bezeichnung | Datentyp | Faktor | Einheit | Zugriff |
|---|---|---|---|---|---|
| 20 | Istdruck | int16 | 0.01 | bar | R |

| Code | Bedeutung |
|---|---|
| 1 | Trockenlauf |
| 2 | Motor zu heiß |
""",
        ["holding 10 u16 rw Betriebsart", "holding 20 s16 x0.01 bar r Istdruck"],
    ),
    "logical numbers of coils that a spreadsheet took the zeros from": (
        "mapa.csv",
        """Registro;Nombre;Tipo;Escala;Unidad;L/E
1;Marcha bomba;BOOL;;;E
2;Paro bomba;BOOL;;;E
10001;Bomba en marcha;BOOL;;;L
30001;Caudal;UINT16;0,1;m3/h;L
40001;Consigna;UINT16;0,01;bar;L/E
""",
        [
            "coil 0 bool w Marcha bomba", "coil 1 bool w Paro bomba", "discrete 0 bool r Bomba en marcha",
            "input 0 u16 x0.1 m3/h r Caudal", "holding 0 u16 x0.01 bar rw Consigna",
        ],
    ),
    "a remark that says another step than the row does": (
        "trasduttore.csv",
        """Indirizzo,Descrizione,Tipo,Fattore,UM,Accesso,Note
0,Tensione L1,uint16,"0,1",V,R,
1,Rapporto TA,uint16,1,,RW,primario / 5A
""",
        ["holding 0 u16 x0.1 V r Tensione L1", "holding 1 u16 rw Rapporto TA"],
    ),
    "constants in brackets, steps behind types, numbers that are no registers": (
        "regs.h",
        """// Holding registers, zero based
// Bus address and limits
#define SLAVE_ID 5
#define RX_BUF_SIZE 256
// --- Measurements (read only, function 0x04) ---
#define MB_IN_TEMP      (0x0000) /* s16 0.1 °C */
#define MB_IN_HUM       ((uint16_t)0x0001) /* u16 0.1 %RH */
// --- Settings (function 0x03/0x06) ---
#define MB_HOLD_SP      (0x0100u) /* s16 0.1 °C */
""",
        [
            "input 0 s16 x0.1 °C r MB_IN_TEMP", "input 1 u16 x0.1 %RH r MB_IN_HUM",
            "holding 256 s16 x0.1 °C rw MB_HOLD_SP",
        ],
    ),
    "bits of a PLC, counted one by one or behind their bytes": (
        "globals.st",
        """VAR_GLOBAL
  bEin   AT %QX1 : BOOL; (* Pumpe ein *)
  bAus   AT %QX1.2 : BOOL; (* Pumpe aus *)
  bLauf  AT %IX3 : BOOL; (* Pumpe läuft *)
  iDruck AT %IW0 : INT;  (* Druck, 0.01 bar *)
END_VAR
""",
        ["coil 1 bool bEin", "coil 10 bool bAus", "discrete 3 bool r bLauf", "input 0 s16 x0.01 bar r iDruck"],
    ),
    "records whose keys are names, not areas": (
        "registers.json",
        """{"output_voltage": {"addr": 10, "type": "uint16", "scale": 0.1, "unit": "V"},
"input_voltage": {"addr": 11, "type": "uint16", "scale": 0.1, "unit": "V"},
"coil_temperature": {"addr": 12, "type": "int16", "scale": 0.1, "unit": "°C"}}
""",
        [
            "holding 10 u16 x0.1 V output_voltage", "holding 11 u16 x0.1 V input_voltage",
            "holding 12 s16 x0.1 °C coil_temperature",
        ],
    ),
    "a value said twice, once of reading with its factor and once of writing": (
        "gateway.json",
        """{"slaves": [{"timeseries": [
{"tag": "supplyTemp", "type": "16int", "functionCode": 4, "objectsCount": 1, "address": 0, "divider": 10},
{"tag": "setpoint", "type": "16uint", "functionCode": 3, "objectsCount": 1, "address": 5, "divider": 10}],
"attributeUpdates": [{"tag": "setpoint", "type": "16uint", "functionCode": 6, "objectsCount": 1, "address": 5}]}]}
""",
        ["input 0 s16 x0.1 r supplyTemp", "holding 5 u16 x0.1 rw setpoint"],
    ),
    "a wiki's rights in bold": (
        "licznik.mediawiki",
        """== Rejestry pamiętające ==
{| class="wikitable"
! Adres !! Nazwa !! Typ !! Mnożnik !! Jednostka !! Uwagi
|-
| 0x10 || Limit prądu || uint16 || 0,1 || A || 6..32; '''odczyt/zapis'''
|-
| 0x11 || Prędkość || uint16 || || || '''odczyt/zapis'''
|}
""",
        ["holding 16 u16 x0.1 A rw Limit prądu", "holding 17 u16 rw Prędkość"],
    ),
    "addresses that a note calls those of the protocol, decimals under a short word": (
        "inverter.csv",
        """
Holding registers (functions 03 and 06), decimal protocol addresses: do not subtract 40001
No,Signal,Unit,Register address,Dec,Access
1,Rated power,kW,30073,3,RO
2,Grid voltage,V,32066,1,RO
3,Reactive power,,40122,0,RW
""",
        [
            "holding 30073 u16 x0.001 kW r Rated power", "holding 32066 u16 x0.1 V r Grid voltage",
            "holding 40122 u16 rw Reactive power",
        ],
    ),
    "a title in the second column, where lines begin with their bar": (
        "pump.md",
        """
| Access | Register | Words | Name |
|---|---|---|---|
| Measured |  |  |  |
| R | 0000h | 2 | Flow (x0.1 l/s) |
| R | 0009h | 1 | Level (x0.001 mm) |
| Set points |  |  |  |
| R/W | 000Ah | 2 | Limit (x0.1 l/s) |
""",
        ["holding 0 u32 x0.1 l/s r Flow", "holding 9 u16 x0.001 mm r Level", "holding 10 u32 x0.1 l/s rw Limit"],
    ),
    "cells that go on below, access in titles": (
        "pump.txt",
        """
Input registers (function 04)

Register   Meaning              Unit    Factor
30001      Pressure behind      bar     0.01
           the filter
30002      Speed                rpm     1
30003      Hours                h       1

Holding registers, read and write

Register   Meaning              Unit    Factor
40001      Wanted pressure      bar     0.01
""",
        [
            "input 0 u16 x0.01 bar r Pressure behind the filter", "input 1 u16 rpm r Speed", "input 2 u16 h r Hours",
            "holding 0 u16 x0.01 bar rw Wanted pressure",
        ],
    ),
    "a page's foot is no register": (
        "pump.txt",
        """
Register   Meaning              Unit    Factor
40001      Wanted pressure      bar     0.01
40002      Wanted speed         rpm     1
40003      Hours                h       1

Pumps Ltd, series PX-22                 page 7

40004      Level                cm      0.1
40005      Limit                cm      0.1
""",
        [
            "holding 0 u16 x0.01 bar Wanted pressure", "holding 1 u16 rpm Wanted speed", "holding 2 u16 h Hours",
            "holding 3 u16 x0.1 cm Level", "holding 4 u16 x0.1 cm Limit",
        ],
    ),
    "offsets from a base of their block": (
        "fan.xml",
        """<?xml version='1.0'?><!-- a fan -->
<fan><block function='4' base='200'><reg offset='0' type='int16'>Supply</reg>
<reg offset='2' type='float'>Power</reg></block>
<block function='3,6' base='400'><reg offset='1' type='uint16'>Speed</reg>
<reg offset='5' type='uint16'>Limit</reg></block></fan>
""",
        ["input 200 s16 r Supply", "input 202 f32 r Power", "holding 401 u16 rw Speed", "holding 405 u16 rw Limit"],
    ),
    "a constant and a number": (
        "scale.rs",
        """
const LIVE: u16 = 0x100;
pub const ALL: [Reg; 3] = [
    Reg { address: LIVE + 0x01, name: "Weight", kind: "I32", unit: "g" },
    Reg { address: LIVE + 0x03, name: "Belt", kind: "U16", unit: "m/s" },
    Reg { address: LIVE + 0x10, name: "Zero", kind: "U16", unit: "" },
];
""",
        ["holding 257 s32 g Weight", "holding 259 u16 m/s Belt", "holding 272 u16 Zero"],
    ),
    "what fields are where nothing is said, remarks with the area": (
        "meter.py",
        """
class Reg:
    address: int
    name: str
    type: str
    scale: float = 1.0
    unit: str = ""
    access: str = "R"

# input registers
A = [
    Reg(0x10, "Voltage", "float32", unit="V"),
    Reg(0x12, "Energy", "uint32", 0.01, "kWh"),
    Reg(0x14, "Phase", "float32"),
]
# holding registers
B = [
    Reg(0x10, "Pulse", "uint16", 10.0, "ms", "RW"),
    Reg(0x11, "Node", "uint16", access="RW"),
]
""",
        [
            "input 16 f32 V r Voltage", "input 18 u32 x0.01 kWh r Energy", "input 20 f32 r Phase",
            "holding 16 u16 x10 ms rw Pulse", "holding 17 u16 rw Node",
        ],
    ),
    "AsciiDoc, a cell a line": (
        "box.adoc",
        """= Box

[cols=4]
|===
|Address |Function |Description |Unit

|4
|04
|Room
|ppm

|5
|03/06
|Limit
|ppm
|===
""",
        ["input 4 u16 ppm r Room", "holding 5 u16 ppm rw Limit"],
    ),
    "reStructuredText, a list of lists; German, from one": (
        "box.rst",
        """
Kasten
======

Die Register sind ab 1 gezählt.

.. list-table::
   :header-rows: 1

   * - Register
     - Bezeichnung
     - Einheit
   * - 1
     - Druck
     - bar
   * - 2
     - Menge
     - l
   * - 3
     - Kraft
     - N
""",
        ["holding 0 u16 bar Druck", "holding 1 u16 l Menge", "holding 2 u16 N Kraft"],
    ),
    "entries with lines below them": (
        "drive.txt",
        """Drive

2.1. Register 40001 – Speed
     16 bits unsigned. Scale: 0.01. Unit: Hz. Read only.

2.2. Registers 40002-40003 – Energy
     32 bits unsigned. Unit: kWh.
     Read only.

2.3. Register 40010 – Wanted speed
     16 bits unsigned. Scale: 0.01. Unit: Hz. Read and write.
""",
        [
            "holding 0 u16 x0.01 Hz r Speed", "holding 1 u32 kWh r Energy", "holding 9 u16 x0.01 Hz rw Wanted speed",
        ],
    ),
    "an enumeration that counts on, bits in a remark": (
        "regs.h",
        """enum reg {
    /* read only */
    R_SUPPLY = 100,  /* int16, 0.1 K */
    R_RETURN,        /* int16, 0.1 K */
    R_STATE,         /* bit 0: runs, bit 3: alarm */
};
""",
        [
            "holding 100 s16 x0.1 K r R_SUPPLY", "holding 101 s16 x0.1 K r R_RETURN",
            "holding 102 bits r {0=runs; 3=alarm} R_STATE",
        ],
    ),
    "a table of which single blanks are left": (
        "meter.txt",
        """Meter 9 user manual

Address Name Type Unit Factor
0x0010 Voltage of phase 1 UINT16 V 0.1
0x0011 Voltage of phase 2 UINT16 V 0.1
0x0020 Energy imported since the last reset UINT32 kWh 0.01
Page 12 of 40
""",
        [
            "holding 16 u16 x0.1 V Voltage of phase 1", "holding 17 u16 x0.1 V Voltage of phase 2",
            "holding 32 u32 x0.01 kWh Energy imported since the last reset",
        ],
    ),
    "columns that a remark names, defines without remarks": (
        "regs.py",
        """# input registers
# name: (address, data type, factor, unit)
LIVE = {
    "voltage": (5011, "uint16", 0.1, "V"),
    "energy": (5012, "uint32", 0.01, "kWh"),
    "state": (5020, "uint16", 1, None),
}
""",
        ["input 5011 u16 x0.1 V r voltage", "input 5012 u32 x0.01 kWh r energy", "input 5020 u16 r state"],
    ),
    "decimals in words, comments that speak of all": (
        "unit.ini",
        """; registers are counted from 1
[a]
name=Level
register=1
note=1 decimal, cm
[b]
name=Flow
register=2
note=divided by 100
""",
        ["holding 0 u16 x0.1 cm Level", "holding 1 u16 x0.01 Flow"],
    ),
    "groups with the function of all below, an address in the head": (
        "unit.yaml",
        """unit: K8
base_address: 0
groups:
  - name: Live
    function: 4
    points:
      - {address: 0, text: Supply, type: int16, unit: K}
      - {address: 1, text: Return, type: int16, unit: K}
  - name: Settings
    function: 3
    points:
      - {address: 0, text: Wanted, type: int16, unit: K}
      - {address: 9, text: Mode, type: uint16}
""",
        ["input 0 s16 K r Supply", "input 1 s16 K r Return", "holding 0 s16 K Wanted", "holding 9 u16 Mode"],
    ),
    "units behind names that no list has, signs in remarks": (
        "list.csv",
        """Adr;Name;Remark
1;Dust (spd);signed
2;Noise (brl);
3;Smell (ou);16 bit unsigned
4;Light (kfc);
""",
        ["holding 1 s16 spd Dust", "holding 2 u16 brl Noise", "holding 3 u16 ou Smell", "holding 4 u16 kfc Light"],
    ),
    "a table of C whose structure names its columns, areas as short constants": (
        "fan.c",
        """
typedef enum { A_COIL, A_DISC, A_IREG, A_HREG } area_t;
struct point { area_t area; uint16_t addr; const char *label; fmt_t fmt; float mult; const char *unit; int rw; };
/* area   addr  label   fmt   mult unit  rw */
static const struct point points[] = {
    { A_IREG, 4, "flow", F_U16, 0.1f, "l/s", 0 },
    { A_IREG, 5, "drop", F_S16, 1.0f, "", 0 },
    { A_HREG, 4, "want", F_U16, 0.5f, "l/s", 1 },
    { A_DISC, 1, "jam", F_BIT, 1.0f, "", 0 },
    { A_COIL, 1, "run", F_BIT, 1.0f, "", 1 },
};
""",
        [
            "input 4 u16 x0.1 l/s r flow", "input 5 s16 r drop", "holding 4 u16 x0.5 l/s rw want",
            "discrete 1 bool r jam", "coil 1 bool rw run",
        ],
    ),
    "titles of areas that blanks cut as rows are": (
        "pompa.txt",
        """
REGISTRI DI SOLA LETTURA   -   funzione 04

Indirizzo   Descrizione        Unità   Decimali
0000h       Pressione          bar     2
0001h       Portata            l/s     1

REGISTRI DI LETTURA/SCRITTURA   -   funzioni 03, 16

Indirizzo   Descrizione        Unità   Decimali
0000h       Pressione voluta   bar     2
0007h       Ritardo            s       0
""",
        [
            "input 0 u16 x0.01 bar r Pressione", "input 1 u16 x0.1 l/s r Portata",
            "holding 0 u16 x0.01 bar rw Pressione voluta", "holding 7 u16 s rw Ritardo",
        ],
    ),
    "a key of letters below the table, parted by blanks": (
        "kazan.txt",
        """
Yazmaç   Açıklama          Çarpan   Birim   Erişim
40001    Kazan sıcaklığı   0,1      °C      O
40002    Baca sıcaklığı    0,1      °C      O
40003    Hedef sıcaklık    0,1      °C      O/Y
40004    Sıfırlama                          Y

O: okunur    Y: yazılır    O/Y: okunur, yazılır
""",
        [
            "holding 0 u16 x0.1 °C r Kazan sıcaklığı", "holding 1 u16 x0.1 °C r Baca sıcaklığı",
            "holding 2 u16 x0.1 °C rw Hedef sıcaklık", "holding 3 u16 w Sıfırlama",
        ],
    ),
    "a post: numbers of Basic, two registers by a word": (
        "post.txt",
        """
Olá, aqui vai a lista da bomba de calor. Função 3 (holding), endereços hexadecimais a partir de zero:

&H00 - temperatura de saída, int16, /10, °C
&H01 - pressão (0.01 bar)
&H0A e &H0B - energia, uint32, kWh

Para ler e escrever (função 6):

&H20 - temperatura pedida, int16, /10, °C
""",
        [
            "holding 0 s16 x0.1 °C r temperatura de saída", "holding 1 u16 x0.01 bar r pressão",
            "holding 10 u32 kWh r energia", "holding 32 s16 x0.1 °C rw temperatura pedida",
        ],
    ),
    "defaults that are a list": (
        "p.json",
        '{"defaults": [1, 2], "points": [{"name": "Flow", "address": 4, "type": "uint16", "unit": "l/s"},'
        ' {"name": "Drop", "address": 5, "type": "int16", "unit": "Pa"}]}',
        ["holding 4 u16 l/s Flow", "holding 5 s16 Pa Drop"],
    ),
    "a post: pairs of registers with a comma": (
        "post.txt",
        """
Регистры счётчика, функция 4, адреса с нуля:

0 - напряжение (0.1 В)
1 - ток (0.01 А)
4,5 - энергия (uint32, Вт·ч)
""",
        ["input 0 u16 x0.1 В r напряжение", "input 1 u16 x0.01 А r ток", "input 4 u32 Вт·ч r энергия"],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", _FILES)
def test_a_kind_of_file(kind: str) -> None:
    name, text, rows = _FILES[kind]
    check_import((name, text.encode(), rows, ""))


@pytest.mark.parametrize(
    ("said", "order"),
    [
        ("Los registros de 32 bits llevan la palabra baja primero", "CDAB"), ("Niederwertiges Wort zuerst", "CDAB"),
        ("mot de poids fort en premier", "ABCD"), ("старшата дума е първа", "ABCD"), ("下位ワードが先", "CDAB"),
        ("נמוך-גבוה", "CDAB"), ("alarma de temperatura baja, primera etapa", None),
    ],
)  # fmt: skip
def test_which_word_comes_first_in_many_languages(said: str, order: str | None) -> None:
    assert order_of(said.lower()) == order


def test_a_spreadsheet_of_a_japanese_windows() -> None:
    table = "アドレス,名称,データ型,単位\n16,現在温度,符号付16bit,℃\n17,設定値,符号なし16bit,％\n"
    rows = ["holding 16 s16 ℃ 現在温度", "holding 17 u16 ％ 設定値"]
    check_import(("list.csv", table.encode("cp932"), rows, ""))


def test_a_key_with_null_says_nothing() -> None:
    channels = [{"name": "A", "reg_type": "holding", "address": 1, "type": "value", "format": "u16", "group": None}]
    template = json.dumps({"device_type": "x", "device": {"name": "x", "id": "x", "channels": channels}})
    (found,) = import_maps("config-x.json", template.encode())
    assert [(row.name, row.group) for row in found.chart.rows] == [("A", "")]


def test_a_dash_in_the_unit_column_says_that_there_is_none() -> None:
    text = (
        "Address  Name            Type    Unit\n0        Loop current    uint16  mA\n"
        "1        Sensor of input uint16  -\n         3 - 4..20 mA\n2        Level           uint16  %\n"
    )
    (imported,) = import_maps("x.txt", text.encode())
    assert {row.address: row.unit for row in imported.chart.rows} == {0: "mA", 1: "", 2: "%"}
