"""Texts and sources without a table of cells: columns by place, a cell a line, what programs declare and read."""

from __future__ import annotations

import pytest
from oddmaps import check_import

_TEXTS = {
    "one blank between columns, a heading of two rows, cells that go on": (
        "valve.txt",
        """
Valve terminal VT-3                                         Page 7

Address  Parameter      Data   Unit Factor R/W
(dec)    name           type
0        Inlet pressure INT16  bar  0.01   R
1        Outlet         INT16  bar  0.01   R
         pressure
2~       Operating time UINT32 h    1      R
3
4        Wanted opening UINT16 %    0.1    R/
                                           W
5        Reserved
""",
        [
            "holding 0 s16 x0.01 bar r Inlet pressure", "holding 1 s16 x0.01 bar r Outlet pressure",
            "holding 2 u32 h r Operating time", "holding 4 u16 x0.1 % rw Wanted opening",
        ],
    ),
    "signs of the East take two places": (
        "meter.txt",
        """
地址 名称         类型   单位 系数
0    相电压       U16    V    0.1
1    有功功率     S16    kW   0.01
2    总电能       U32    kWh  1
""",
        ["holding 0 u16 x0.1 V 相电压", "holding 1 s16 x0.01 kW 有功功率", "holding 2 u32 kWh 总电能"],
    ),
    "a cell a line": (
        "probe.txt",
        "Probe P1\nAddress\n(hex)\nParameter\nFormat\nUnit\n"
        "0000\nLevel\nFloat\nm\n0002\nDensity\nFloat\nkg/m3\n000A\nStatus\nUINT16\n-\nProbe P1, page\n12\n",
        ["holding 0 f32 m Level", "holding 2 f32 kg/m3 Density", "holding 10 u16 Status"],
    ),
    "two kinds of tables of reStructuredText": (
        "fan.rst",
        """
Holding registers
-----------------

+---------+------------+--------+------+
| Address | Name       | Type   | R/W  |
+=========+============+========+======+
| 0       | Wanted     | uint16 | R/W  |
|         | speed      |        |      |
+---------+------------+--------+------+

Input registers
---------------

======= ============ ====== ========
Address Name         Type   Unit
======= ============ ====== ========
0       Motor speed  uint16 1 rpm
1       Air flow     int16  0.1 m3/h
======= ============ ====== ========
""",
        ["holding 0 u16 rw Wanted speed", "input 0 u16 rpm r Motor speed", "input 1 s16 x0.1 m3/h r Air flow"],
    ),
    "words of one value, a range and states behind names": (
        "counter.csv",
        "Address,Parameter,Unit,Scale\n0,Energy (high word),kWh,0.1\n1,Energy (low word),kWh,0.1\n"
        '4,Volume LSW,m3,1\n5,Volume MSW,m3,1\n6,Alarm high,V,1\n7,Alarm low,V,1\n8,"Mode: 0 - off, 1 - on",,\n'
        "9,Stage (0..3),,\n10,Not used,,\n",
        [
            "holding 0 u32 x0.1 kWh Energy", "holding 4 u32 CDAB m3 Volume", "holding 6 u16 V Alarm high",
            "holding 7 u16 V Alarm low", "holding 8 u16 {0=off; 1=on} Mode", "holding 9 u16 Stage",
        ],
    ),
    "titles between the tables of a wiki": (
        "wiki.txt",
        """
{| class="wikitable"
|+ Holding registers (function 03, 06)
! Address !! Name !! Type
|-
| 0 || Mode || uint16
|-
| 1 || Stage || uint16
|}

== Input registers ==
{| class="wikitable"
! Address !! Name !! Type
|-
| 0
| Flow
| int16
|-
| 1
| Heat
| uint16
|}
""",
        ["holding 0 u16 rw Mode", "holding 1 u16 rw Stage", "input 0 s16 r Flow", "input 1 u16 r Heat"],
    ),
    "codes of struct in the tuples that a namedtuple names": (
        "regs.py",
        """
Reg = namedtuple("Reg", "addr name fmt unit k")
ALL = [
    Reg(0x10, "Supply", "h", "°C", 0.1),
    Reg(0x11, "Flow", "f", "m3/h", 1),
    Reg(0x13, "Heat", ">I", "kWh", 0.01),
    Reg(0x15, "Serial", "2H", "", 1),
    Reg(0x17, "Pulses", "Q", "", 1),
]
""",
        [
            "holding 16 s16 x0.1 °C Supply", "holding 17 f32 m3/h Flow", "holding 19 u32 x0.01 kWh Heat",
            "holding 21 u32 Serial", "holding 23 u64 Pulses",
        ],
    ),
    "rows of a table that SQL creates": (
        "tags.sql",
        """
CREATE TABLE tag (
  id INTEGER PRIMARY KEY, tag VARCHAR(32) NOT NULL, fc SMALLINT NOT NULL, addr INTEGER NOT NULL,
  datatype VARCHAR(8), k NUMERIC(8,4) NOT NULL DEFAULT 1, eu VARCHAR(8)
);
INSERT INTO tag VALUES
(1,'Current A',4,0,'UINT16',0.01,'A'),
(2,'Power',4,2,'INT32',0.1,'kW'),
(3,'Trip delay',3,100,'UINT16',10,'ms');
""",
        ["input 0 u16 x0.01 A r Current A", "input 2 s32 x0.1 kW r Power", "holding 100 u16 x10 ms Trip delay"],
    ),
    "double words of IEC 61131": (
        "plc.st",
        """
VAR_GLOBAL
    iLevel AT %MW4 : INT; (* 0.1 % *)
    rFlow AT %MD3 : REAL; (* l/h *)
END_VAR
""",
        ["holding 4 s16 x0.1 % iLevel", "holding 6 f32 l/h rFlow"],
    ),
    "addresses in attributes above declarations": (
        "plc.st",
        """
VAR_GLOBAL
    {attribute 'register' := '40001'}
    rSupply : REAL; // bar
    {attribute 'register' := '40003'}
    iLevel : INT; // mm
END_VAR
""",
        ["holding 0 f32 bar rSupply", "holding 2 s16 mm iLevel"],
    ),
    "the members of structures, from where a sentence says": (
        "image.h",
        """
/* FC04 reads the input registers from address 0, the holding registers start at 200. */
typedef struct {
    // status
    uint16_t state;        // 0 idle, 1 running
    float    torque;       /* Nm */
    uint16_t reserved[2];
    int16_t  temperature;  // 0.1 °C
} mixer_input_t;
struct mixer_holding {
    uint32_t wanted;
    uint16_t speed;        // rpm
};
""",
        [
            "input 0 u16 r state", "input 1 f32 Nm r torque", "input 5 s16 x0.1 °C r temperature",
            "holding 200 u32 wanted", "holding 202 u16 rpm speed",
        ],
    ),
    "constants below titles, access by a sentence": (
        "regs.h",
        """
/* Input registers are read with FC04, holding registers with FC03/FC06/FC16. */
#define UNIT_DEFAULT 1
/* ---- input registers ---- */
#define IR_FLOW  0  /* Flow [0.1 l/h] uint16 */
#define IR_STATE 1
/* ---- holding registers ---- */
#define HR_LIMIT 7  /* s16, 0.1 K */
/* ---- limits ---- */
#define MOST_PUMPS 16
""",
        ["input 0 u16 x0.1 l/h r IR_FLOW", "input 1 u16 r IR_STATE", "holding 7 s16 x0.1 K rw HR_LIMIT"],
    ),
    "what a program calls the registers that it reads": (
        "poll.py",
        """
rr = client.read_input_registers(10, 8, slave=3)
volt = rr.registers[0] / 10
amp = to_int16(rr.registers[1]) * 0.01  # A
power = (rr.registers[2] << 16) | rr.registers[3]
level = client.read_holding_registers(address=100, count=1).registers[0]  # tank level %
data["heat"] = meter.read_register(5, 2, functioncode=4, signed=True)  # °C
""",
        [
            "input 10 u16 x0.1 r volt", "input 11 s16 x0.01 A r amp", "input 12 u32 r power", "holding 100 u16 % level",
            "input 5 s16 x0.01 °C r heat",
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("kind", _TEXTS)
def test_a_text(kind: str) -> None:
    name, text, rows = _TEXTS[kind]
    check_import((name, text.encode(), rows, ""))
