"""Layouts that people use beyond plain tables: matrices, blocks, sentences, declarations, one each."""

from __future__ import annotations

import pytest
from oddmaps import OddFile, check_import

FILES: dict[str, OddFile] = {
    "addresses of several phases side by side": (
        "meter.csv",
        b"""Meter matrix (input registers, FC04, hexadecimal addresses)
Quantity;Unit;Format;Address;;;Step
;;;L1;L2;L3;
Voltage;V;UInt16;0x0000;0x0001;0x0002;0.1
Current;A;UInt32;0x0010;0x0012;0x0014;0.001
Frequency;Hz;UInt16;-;-;0x0060;0.01
""",
        [
            "input 0 u16 x0.1 V r Voltage L1",
            "input 1 u16 x0.1 V r Voltage L2",
            "input 2 u16 x0.1 V r Voltage L3",
            "input 16 u32 x0.001 A r Current L1",
            "input 18 u32 x0.001 A r Current L2",
            "input 20 u32 x0.001 A r Current L3",
            "input 96 u16 x0.01 Hz r Frequency L3",
        ],
        "",
    ),
    "addresses that a sentence composes of two columns, bars within cells": (
        "gateway.md",
        b"""# Gateway

Address = page * 100 + place

| Signal | type [states] \\| (limits) | Unit | Writable | Page | Place | Scale |
|---|---|---|---|---|---|---|
| Flow | uint16 (0..900) | l/s | false | 0 | 7 | 1/10 |
| Mode | uint16 [off\\|on] | | true | 2 | 1 | 1 |
| Level | int16 | m | false | 2 | 12 | 1/100 |
| Sum | uint32 | kg | false | 13 | 40 | 1 |
""",
        [
            "holding 7 u16 x0.1 l/s r Flow",
            "holding 201 u16 rw Mode",
            "holding 212 s16 x0.01 m r Level",
            "holding 1340 u32 kg r Sum",
        ],
        "",
    ),
    "a tree that signs draw, areas and registers in it, a count below": (
        "plant.txt",
        """Plant export
├── Pump [unit 3]
│   ├── Input registers
│   │   ├── 4     Flow          INT16    x0.1   l/s
│   │   ├── 5     Load          UINT16   x10    kg
│   │   └── 6     Level         INT16    x0.01  m
│   └── Coils
│       └── 9     Run           BOOL
└── Tank [unit 4]
    └── Holding registers
        ├── 20    Set point     INT16    x0.1   m
        └── 21    Sum           UINT32   x1     kg

2 devices, 6 points
""".encode(),
        [
            "input 4 s16 x0.1 l/s r Flow",
            "input 5 u16 x10 kg r Load",
            "input 6 s16 x0.01 m r Level",
            "coil 9 bool Run",
            "holding 20 s16 x0.1 m Set point",
            "holding 21 u32 kg Sum",
        ],
        "",
    ),
    "places of digits behind names, as makers of drives write them": (
        "drive.txt",
        b"""Address   R/W   Function
2101H     RW    Frequency set (XXX.XX Hz)
2103H     R     Output frequency (XXX.XX Hz)
2104H     R     Output current (XX.X A)
2105H     R     Motor speed (XXXXX rpm)
210FH     R     Output power (X.XXX kW)
""",
        [
            "holding 8449 u16 x0.01 Hz rw Frequency set",
            "holding 8451 u16 x0.01 Hz r Output frequency",
            "holding 8452 u16 x0.1 A r Output current",
            "holding 8453 u16 rpm r Motor speed",
            "holding 8463 u16 x0.001 kW r Output power",
        ],
        "",
    ),
    "feet of left and right pages, rights of commands, a text of UTF-8": (
        "meter.txt",
        b"""Register list

 Register      Action     Size      Type           Units        Description
              (R/W/WC)
 3000            R          2       FLOAT32        A            Current A
 3002            R          2       FLOAT32        A            Current B
 3010            R          2       FLOAT32        V            Voltage A

 DOC0417EN                                                                    51
 Register      Action     Size      Type           Units        Description
              (R/W/WC)
 3204            R          4       INT64          Wh           Energy
 2014            R/WC       1       INT16U         s            Interval
 50              R          20      UTF8           -            Model
 5250            W          1       INT16U         -            Command

 52                                                                    DOC0417EN
""",
        [
            "holding 3000 f32 A r Current A",
            "holding 3002 f32 A r Current B",
            "holding 3010 f32 V r Voltage A",
            "holding 3204 s64 Wh r Energy",
            "holding 2014 u16 s rw Interval",
            "holding 50 text r Model",
            "holding 5250 u16 w Command",
        ],
        "",
    ),
    "types that stand for areas, as a line above says": (
        "list.txt",
        b"""Type:  I = integer,  D = digital
Mapping:  I -> holding register,  D -> coil.

Type   Idx   Modbus   R/W   Unit   Description
I      7     128      R     %      Valve
I      9     129      R     K      Difference
D      1     0        R/W   -      Unit on
D      3     2        R     -      Alarm
""",
        [
            "holding 128 u16 % r Valve",
            "holding 129 u16 K r Difference",
            "coil 0 bool rw Unit on",
            "coil 2 bool r Alarm",
        ],
        "",
    ),
    "a wiki's table with cells over several rows": (
        "page.wiki",
        b"""{| class="wikitable"
! Area
! style="width:9%" | Address
! Name !! Type !! Scale !! Unit
|-
| rowspan="3" | Input register
| 0 || Flow || rowspan="2" style="color:red" | int16 || 0.1 || l/s
|-
| 1 || Level || 0.01 || m
|-
| 4 || Sum || uint32 || 1 || kg
|-
| rowspan=2 | Holding register
| 10
| Set point
| uint16
| 0.1 || l/s
|-
| 11 || Interval || uint16 || 1 || s
|}
""",
        [
            "input 0 s16 x0.1 l/s r Flow",
            "input 1 s16 x0.01 m r Level",
            "input 4 u32 kg r Sum",
            "holding 10 u16 x0.1 l/s Set point",
            "holding 11 u16 s Interval",
        ],
        "",
    ),
    "blocks of the same offsets, types behind names": (
        "charger.md",
        b"""Hex addresses. Outlet A starts at 0x0100, outlet B at 0x0200.

Offset | Len | What | Access
--- | --- | --- | ---
`+0x00` | 1 | DC voltage, uint16, 0.1 V | R
`+0x01` | 2 | Energy, uint32, 1 Wh | R
`+0x10` | 1 | Current limit, uint16, 0.1 A | R/W
""",
        [
            "holding 256 u16 x0.1 V r Outlet A DC voltage",
            "holding 512 u16 x0.1 V r outlet B DC voltage",
            "holding 257 u32 Wh r Outlet A Energy",
            "holding 513 u32 Wh r outlet B Energy",
            "holding 272 u16 x0.1 A rw Outlet A Current limit",
            "holding 528 u16 x0.1 A rw outlet B Current limit",
        ],
        "",
    ),
    "what sentences say of tables, footnotes": (
        "flow.md",
        """Function 04 reads tables 1 and 2; table 3 uses functions 03/16.

## Table 1

| Addr | Name | Type | Unit |
|---|---|---|---|
| 0 | Flow | float[^1] | m³/h |
| 2 | Total | double | m³ |
| 6 | Gain | short, x0.1 | dB |

## Table 3

| Addr | Name | Type | Unit | Access |
|---|---|---|---|---|
| 0 | Cut-off | float[^1] | m³/h | RW |
| ~~2~~ | ~~Test~~ | ~~short~~ | | |
| 4 | Reset | ushort | | W |

[^1]: low word first (CDAB)
""".encode(),
        [
            "input 0 f32 CDAB m³/h r Flow",
            "input 2 f64 m³ r Total",
            "input 6 s16 x0.1 dB r Gain",
            "holding 0 f32 CDAB m³/h rw Cut-off",
            "holding 4 u16 w Reset",
        ],
        "",
    ),
    "digits of logical numbers win over sentences": (
        "meter.csv",
        b"""# 30001 is the first input register.
Register,Description,Format,Unit,R/W
30001,Voltage,Float32,V,R
30003,Current,Float32,A,R
40001,Address,UINT16,,R/W
40002,Limit,UINT32,A,R/W
""",
        ["input 0 f32 V r Voltage", "input 2 f32 A r Current", "holding 0 u16 rw Address", "holding 1 u32 A rw Limit"],
        "",
    ),
    "sentences": (
        "pump.txt",
        b"""The dosing pump answers function 04 for measurements and 03/06 for settings.

Input register 1 contains the flow rate in ml/min (unsigned 16 bit). Input register 2 contains the pressure in 0.01 bar.
Input registers 3-4 contain the total volume as a 32-bit unsigned integer in litres, high word first.
Input register 5 holds the status: 0 = stopped, 1 = running, 2 = fault.
Holding register 100 sets the flow setpoint in ml/min. Holding register 101 sets the stroke limit (0.1 %).
""",
        [
            "input 1 u16 ml/min r flow rate",
            "input 2 u16 x0.01 bar r pressure",
            "input 3 u32 r total volume",
            "input 5 u16 r {0=stopped; 1=running; 2=fault} status",
            "holding 100 u16 ml/min flow setpoint",
            "holding 101 u16 x0.1 % stroke limit",
        ],
        "",
    ),
    "addresses of IEC 61131": (
        "press.st",
        b"""(* %MW0 is holding register 0; %MD addresses count double words.
   %MX0.0 is coil 0. All values little endian word order (low word first). *)
VAR_GLOBAL
  xPressEnable     AT %MX0.0  : BOOL;   (* enable the press, R/W *)
  xLampTest        AT %MX0.1  : BOOL;   (* lamp test, R/W *)
  iForceSet        AT %MW10   : INT;    (* force setpoint, 0.1 kN, R/W *)
  uiCycleCount     AT %MW11   : UINT;   (* cycles today, R *)
  diPosition       AT %MD6    : DINT;   (* ram position, 0.001 mm, R *)
  rTempOil         AT %MD7    : REAL;   (* oil temperature, degC, R *)
  wAlarm           AT %MW20   : WORD;   (* alarm word, bit 0 = overload, bit 1 = guard open *)
  sRecipe          AT %MW30   : STRING[16]; (* recipe name, R/W *)
END_VAR
""",
        [
            "coil 0 bool rw xPressEnable",
            "coil 1 bool rw xLampTest",
            "holding 10 s16 x0.1 kN rw iForceSet",
            "holding 11 u16 r uiCycleCount",
            "holding 12 s32 CDAB x0.001 mm r diPosition",
            "holding 14 f32 CDAB degC r rTempOil",
            "holding 20 bits {0=overload; 1=guard open} wAlarm",
            "holding 30 text rw sRecipe",
        ],
        "",
    ),
    "raw and scaled limits": (
        "tags.csv",
        b"""Tag Name,Address,Data Type,Access,Scan Rate,Scaling,Raw Low,Raw High,Scaled Low,Scaled High,Units
Boiler.Temp,400001,Word,RO,100,Linear,0,1000,0,100,degC
Boiler.Press,400002,Short,R/W,100,,,,,,bar
Boiler.Flow,400005,Float,RO,100,,,,,,m3/h
Boiler.Run,000001,Boolean,R/W,100,,,,,,
Boiler.Fault,100003,Boolean,RO,100,,,,,,
Outdoor,300010,Short,RO,100,Linear,-500,500,-50,50,degC
""",
        [
            "holding 0 u16 x0.1 degC r Boiler.Temp",
            "holding 1 s16 bar rw Boiler.Press",
            "holding 4 f32 m3/h r Boiler.Flow",
            "coil 0 bool rw Boiler.Run",
            "discrete 2 bool r Boiler.Fault",
            "input 9 s16 x0.1 degC r Outdoor",
        ],
        "",
    ),
    "enumerations without numbers": (
        "gate.h",
        b"""enum gate_coils {     /* FC 1/5 */
    OPEN,             /* open the gate */
    LIGHT = 8,        /* light */
    LOCK,             /* lock */
    COILS_COUNT
};
enum gate_inputs {    /* FC 4, uint16 */
    POSITION,         /* 0.1 % */
    TEMPERATURE       /* int16, 0.1 degC */
};
""",
        [
            "coil 0 bool rw OPEN",
            "coil 8 bool rw LIGHT",
            "coil 9 bool rw LOCK",
            "input 0 u16 x0.1 % r POSITION",
            "input 1 s16 x0.1 degC r TEMPERATURE",
        ],
        "",
    ),
    "arrays of a structure": (
        "image.h",
        b"""// mirrored into the input registers, low word first
typedef struct {
    uint16_t status;      // bit field
    uint16_t pressure[2]; // 0.01 bar
    char serial[12];
    int32_t power;        // W
    uint8_t pad[2];
} input_image_t;
""",
        [
            "input 0 bits r status",
            "input 1 u16 x0.01 bar r pressure_1",
            "input 2 u16 x0.01 bar r pressure_2",
            "input 3 text r serial",
            "input 9 s32 CDAB W r power",
        ],
        "",
    ),
    "sums with a mark of their type": (
        "torque.h",
        b"""#define BASE_LIVE 0x0100u
#define TORQUE (BASE_LIVE + 0) /* int32_t, 0.001 Nm, RO */
#define SPEED (BASE_LIVE + 4)  /* int16_t, 1 rpm, RO */
#define TAG (BASE_LIVE + 5)    /* char[20], RW */
""",
        ["holding 256 s32 x0.001 Nm r TORQUE", "holding 260 s16 rpm r SPEED", "holding 261 text rw TAG"],
        "",
    ),
    "defaults, addresses from 1, labels beside keys": (
        "unit.yaml",
        """address_base: 1
defaults: {space: holding, fmt: uint16, rw: false}
points:
  supply: {reg: 101, fmt: int16, mul: 0.1, unit: "°C", text: Supply air}
  set: {reg: 201, mul: 0.1, unit: "°C", rw: true, text: Setpoint}
  door: {space: discrete, reg: 1, fmt: bool, text: Door}
""".encode(),
        ["holding 100 s16 x0.1 °C r Supply air", "holding 200 u16 x0.1 °C rw Setpoint", "discrete 0 bool r Door"],
        "",
    ),
    "a section between, hexadecimal below the heading": (
        "relay.txt",
        b""" 4.2  Measured values (function code 04)

 Address   Contents                     Words   Data type      Unit    Remarks
 hex
 0000      Phase voltage L1               2     Float IEEE754   V
 0002      Phase voltage L2               2     Float IEEE754   V
 0004      Phase voltage L3               2     Float IEEE754   V
 0006      Current L1                     2     Float IEEE754   A
 000C      Active power total             2     Float IEEE754   kW     + import, - export
 0010      Power factor                   1     INT16           -      x 1000
 001A      Operating hours                2     UINT32          h

 4.3  Settings (function codes 03, 06, 16)

 Address   Contents                     Words   Data type      Unit    Range
 hex
 0100      Slave address                  1     UINT16          -       1...247
 0101      Baud rate                      1     UINT16          -       0: 9600, 1: 19200
 0102      CT ratio                       2     UINT32          A       5...6000
""",
        [
            "input 0 f32 V r Phase voltage L1",
            "input 2 f32 V r Phase voltage L2",
            "input 4 f32 V r Phase voltage L3",
            "input 6 f32 A r Current L1",
            "input 12 f32 kW r Active power total",
            "input 16 s16 x0.001 r Power factor",
            "input 26 u32 h r Operating hours",
            "holding 256 u16 rw Slave address",
            "holding 257 u16 rw {0=9600; 1=19200} Baud rate",
            "holding 258 u32 A rw CT ratio",
        ],
        "",
    ),
    "entries with marks, areas by their titles": (
        "fan.md",
        """# Fan FX

## Inputs (FC 4)

- `0` **Speed** – rpm, uint16
- `1` **Current** – 0.01 A, uint16
- `2` **Temperature** – 0.1 °C, int16

## Holdings (FC 3/6/16)

- `0` **Speed setpoint** – rpm, uint16
- `1` **Mode** – uint16; 0 = off, 1 = manual, 2 = auto

## Coils (FC 1/5)

- `0` **Enable**
- `1` **Reset fault** (write only)
""".encode(),
        [
            "input 0 u16 rpm r Speed",
            "input 1 u16 x0.01 A r Current",
            "input 2 s16 x0.1 °C r Temperature",
            "holding 0 u16 rpm rw Speed setpoint",
            "holding 1 u16 rw {0=off; 1=manual; 2=auto} Mode",
            "coil 0 bool rw Enable",
            "coil 1 bool w Reset fault",
        ],
        "",
    ),
    "a template of evcc": (
        "hybrid.yaml",
        b"""template: hybrid
render: |
  type: custom
  {{- if eq .usage "grid" }}
  power:
    source: modbus
    {{- include "modbus" . | indent 2 }}
    register:
      address: 5600 # Meter power
      type: input
      decode: int32s
    scale: -1
  {{- end }}
  {{- if eq .usage "battery" }}
  power:
    source: modbus
    register:
      address: 13021 # Battery power
      type: holding
      decode: float32s
  limitsoc:
    source: modbus
    register:
      address: 13057 # Reserve
      type: writesingle
      decode: uint16
    scale: 10
  {{- end }}
""",
        [
            "input 5600 s32 CDAB x-1 W r Meter power",
            "holding 13021 f32 CDAB W Battery power",
            "holding 13057 u16 x0.1 % w Reserve",
        ],
        "",
    ),
}


@pytest.mark.parametrize("layout", FILES)
def test_a_layout_of_people(layout: str) -> None:
    check_import(FILES[layout])
