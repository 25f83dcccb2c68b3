"""Files of other programs as their users keep them, one oddity each: what is read, and what is said about it."""

from __future__ import annotations

import pytest
from oddmaps import OddFile, check_import

from dissectors.maps import MapError
from dissectors.maps.importers import import_maps

FILES: dict[str, OddFile] = {
    "esphome: substitutions, a secret, an include, an anchor": (
        "inverter.yaml",
        b"""substitutions:
  name: Roof
  base: "0x3100"
wifi: {ssid: !secret wifi_ssid, password: !secret wifi_password}
packages: !include {file: common.yaml, vars: {a: 1}}
.usual: &usual {platform: modbus_controller, modbus_controller_id: roof, register_type: read}
sensor:
  - <<: *usual
    name: "${name} PV voltage"
    address: ${base}
    value_type: U_WORD
    filters: [{multiply: 0.01}]
    unit_of_measurement: V
  - <<: *usual
    name: $name current
    address: 12545
    value_type: S_WORD
    filters:
      - multiply: 0.01
      - lambda: return max(x, 0);
""",
        ["input 12544 u16 x0.01 V r Roof PV voltage", "input 12545 s16 x0.01 r Roof current"],
        "lambda",
    ),
    "esphome: a merge of what is in another file": (
        "pump.yaml",
        b"sensor:\n  - platform: modbus_controller\n    <<: !include defaults.yaml\n    name: Flow\n    address: 0x10\n"
        b"    register_type: holding\n    value_type: FP32_R\n",
        ["holding 16 f32 CDAB Flow"],
        "",
    ),
    "esphome: bytes behind the address, factors as lambdas": (
        "boiler.yaml",
        b"""sensor:
- platform: modbus_controller
  name: T
  address: 100
  offset: 4
  register_type: holding
  lambda: "return x / 10.0;"
- platform: modbus_controller
  name: P
  address: 110
  register_type: holding
  value_type: S_DWORD
  lambda: |-
    return x * 0.5f;
- platform: modbus_controller
  name: Q
  address: 120
  register_type: holding
  lambda: !lambda 'return x > 5 ? x : 0;'
""",
        ["holding 102 u16 x0.1 T", "holding 110 s32 x0.5 P", "holding 120 u16 Q"],
        "^Q: what its lambda",
    ),
    "esphome: two points of a line": (
        "level.yaml",
        b"sensor:\n  platform: modbus_controller\n  name: Level\n  address: 7\n  register_type: read\n  filters:\n"
        b"    - calibrate_linear:\n        - 4000 -> 0\n        - 20000 -> 100\n",
        ["input 7 u16 x0.00625 +-25 r Level"],
        "",
    ),
    "homeassistant: hubs in a package, lists in another file": (
        "packages.yaml",
        "heat:\n  modbus:\n    - name: plant\n      host: !secret host\n      sensors: !include a.yaml\n"
        "      switches:\n        - {name: Насос, address: 0x07, write_type: coil, slave: 2}\n".encode(),
        ["coil 7 bool rw Насос"],
        "a.yaml",
    ),
    "homeassistant: decimal commas, structures, word swap": (
        "configuration.yaml",
        b"""modbus:
  name: hub
  sensors:
    - name: "Energy"
      slave: 1
      address: "0x0156"
      input_type: input
      data_type: custom
      structure: ">f"
      count: 2
      swap: word
      scale: "0,001"
    - {name: Temp, slave: 1, address: 7, scale: 0.1, offset: "-40", unit_of_measurement: \xc2\xb0C}
    - {name: Both, slave: 1, address: 9, data_type: custom, structure: ">hh", count: 2}
""",
        ["input 342 f32 CDAB x0.001 r Energy", "holding 7 s16 x0.1 +-40 °C Temp"],
        "Both: .*>hh",
    ),
    "homeassistant: a climate": (
        "climate.yaml",
        b"- name: ac\n  climates:\n    - {name: Room, address: 117, target_temp_register: 2782, scale: 0.1}\n",
        ["holding 2782 s16 x0.1 rw Room target", "holding 117 s16 x0.1 Room"],
        "",
    ),
    "homeassistant: platforms, as before 2021": (
        "configuration.yaml",
        b"""sensor:
  - platform: time_date
  - platform: modbus
    registers:
      - name: Supply
        hub: boiler
        slave: 4
        register: 31
        register_type: input
        data_type: float
        count: 2
        reverse_order: true
      - {name: Hours, hub: boiler, slave: 4, register: 40, data_type: uint, count: 2, unit_of_measurement: h}
binary_sensor:
  - platform: modbus
    inputs:
      - {name: Flame, hub: boiler, slave: 4, address: 3, input_type: discrete_input}
switch:
  platform: modbus
  coils:
    - {name: Pump, hub: boiler, slave: 4, coil: 12}
""",
        ["input 31 f32 CDAB r Supply", "holding 40 u32 h Hours", "discrete 3 bool r Flame", "coil 12 bool rw Pump"],
        "",
    ),
    "homeassistant: the list that sensor: includes": (
        "sensors.yaml",
        b"- platform: modbus\n  registers:\n    - {name: Level, slave: 1, register: 7, scale: 0.01}\n",
        ["holding 7 s16 x0.01 Level"],
        "",
    ),
    "solarman: anchors, keys in hex, a list of lookups": (
        "deye.yaml",
        b"""requests: [{start: 0x0003, end: 0x00FF, mb_functioncode: 0x03}]
.rule: &u16 {rule: 1, scale: 0.1}
parameters:
  - group: solar
    items:
      - {<<: *u16, name: PV1 Voltage, registers: [0x006D], uom: V}
      - name: State
        registers: ["0x003B"]
        rule: 1
        lookup:
          - {key: 0x00, value: Standby}
          - {key: [1, 2], value: Run}
          - {key: default, value: Unknown}
      - {name: Energy, rule: 3, scale: "0,1", registers: [0x60, 0x61], uom: kWh}
      - {name: Clock, rule: 8, registers: [22, 23, 24]}
""",
        ["holding 109 u16 x0.1 V PV1 Voltage", "holding 59 enum {0=Standby; 1=Run; 2=Run} State",
         "holding 96 u32 CDAB x0.1 kWh Energy"],
        "Clock: rule '8 3' is not a type that maps have",
    ),
    "modbus_exporter: a factor with a comma, an address that is short": (
        "modbus.yml",
        b"modules:\n- name: m\n  protocol: tcp/ip\n  metrics:\n"
        b"  - {name: u, address: 30001, dataType: uint16, factor: '0,1', metricType: gauge}\n"
        b"  - {name: e, address: 400011, dataType: uint32, endianness: yolo}\n"
        b"  - {name: x, address: 17, dataType: int16}\n",
        ["input 1 u16 x0.1 r u", "holding 11 u32 CDAB e"],
        "x: .*17",
    ),
    "telegraf: a hole in the environment, fields left out": (
        "telegraf.conf",
        b"""[agent]
  interval = "10s"
[[inputs.modbus]]
  name = "meter"
  controller = "tcp://${HOST}:502"
  configuration_type = "request"
  [[inputs.modbus.request]]
    slave_id = 1
    byte_order = "CDAB"
    register = "input"
    fields = [
      { address=0, name="u", type="FLOAT32" },
      { address=2, omit=true, type="INT32" },
      { address=4, name="n", type="INT16", scale=0.1 },
      { address=5, name="low", type="UINT8L" },
    ]
""",
        ["input 0 f32 CDAB r u", "input 4 s16 x0.1 r n"],
        "low: type 'UINT8L'",
    ),
    "telegraf: registers in their own order": (
        "old.toml",
        b"[[inputs.modbus]]\nslave_id = 7\nholding_registers = [\n"
        b' { name = "e", byte_order = "CDAB", data_type = "UFIXED", scale=0.01, address = [10,11]},\n'
        b' { name = "swapped", byte_order = "ABCD", data_type = "INT32", scale=1.0, address = [21,20]},\n]\n',
        ["holding 10 u32 CDAB x0.01 e", "holding 20 s32 CDAB swapped"],
        "",
    ),
    "iobroker: decimal commas, aliases": (
        "holdingRegs.tsv",
        b"_address\tname\tdescription\tunit\ttype\tlen\tfactor\toffset\tformula\trole\troom\tpoll\twp\tcw\tisScale\n"
        b"40001\tU\tVoltage\tV\tuint16be\t1\t0,1\t0\t\tvalue\t\ttrue\tfalse\tfalse\tfalse\n"
        b"40010\tP\t\tkW\tint32sw\t2\t0,001\t-5\tx*2\tvalue\t\ttrue\ttrue\tfalse\tfalse\n\n",
        ["holding 0 u16 x0.1 V U", "holding 9 s32 CDAB x0.001 +-5 kW rw P"],
        r"row 3: P: formula 'x\*2'",
    ),
    "esphome: parts of a register, a select, a number, a text": (
        "heater.yaml",
        b"""sensor:
  - {platform: modbus_controller, name: Stage, register_type: holding, address: 5, bitmask: 0x0F, value_type: U_WORD}
binary_sensor:
  - {platform: modbus_controller, name: Fault, register_type: holding, address: 7, bitmask: 0x8}
select:
  - {platform: modbus_controller, name: Mode, address: 12, value_type: U_WORD, optionsmap: {"Off": 0, "On": 1}}
number:
  - {platform: modbus_controller, name: Set, address: 13, value_type: S_WORD, multiply: 10, min_value: 5, max_value: 30}
text_sensor:
  - {platform: modbus_controller, name: Serial, register_type: holding, address: 30, register_count: 5}
""",
        ["holding 5 u16 Stage", "holding 12 enum rw {0=Off; 1=On} Mode", "holding 13 s16 x0.1 rw Set",
         "holding 30 text Serial", "holding 7 bits {3=Fault} Bits of 7"],
        "^Stage: bitmask 0xf is not carried",
    ),
    "homeassistant: swapped bytes and words, copies, a climate with its target": (
        "configuration.yaml",
        b"""modbus:
  - name: h
    sensors:
      - {name: A, address: 0x10, data_type: custom, structure: ">i", count: 2, swap: word_byte}
      - {name: W, address: 30, data_type: uint32, virtual_count: 2, scale: .001}
      - {name: Half, address: 40, data_type: float16}
    climates:
      - {name: Room, address: 117, target_temp_register: [120, 121], data_type: int16, input_type: input, scale: 0.1}
""",
        ["holding 16 s32 DCBA A", "holding 30 u32 x0.001 W 1", "holding 32 u32 x0.001 W 2", "holding 34 u32 x0.001 W 3",
         "holding 120 s16 x0.1 rw Room target", "input 117 s16 x0.1 r Room"],
        "^Half: data type 'float16'",
    ),
    "telegraf: metrics, bits of a register, types that no map has": (
        "telegraf.conf",
        b"""[[inputs.modbus]]
  name = "Device"
  configuration_type = "metric"
  [[inputs.modbus.metric]]
    slave_id = 4
    byte_order = "DCBA"
    fields = [
      { register = "input", address=0x0, name="u", type="UINT16", scale = 0.1 },
      { register = "holding", address=5, name="e", type="UINT32", output="FLOAT64" },
      { register = "coil", address=3, name="c" },
      { address=8, name="half", type="INT8H" },
      { address=10, name="txt", type="STRING", length=4 },
      { address=20, name="b", type="BIT", bit=3 },
      { address=20, name="b2", type="BIT", bit=5 },
    ]
[[inputs.cpu]]
  percpu = true
""",
        ["input 0 u16 x0.1 r u", "holding 5 u32 DCBA e", "coil 3 bool c", "holding 10 text txt",
         "holding 20 bits {3=b; 5=b2} Bits of 20"],
        "^half: type 'INT8H' is not a type that maps have",
    ),
    "modbus_exporter: labels, six figures, a text": (
        "modbus.yml",
        b"""modules:
  - name: meter
    metrics:
      - {name: power, address: 300022, dataType: int16, metricType: gauge, labels: {phase: "1"}}
      - {name: power, address: 300023, dataType: int16, labels: {phase: "2"}, factor: 3.1415}
      - {name: bit, address: 30024, dataType: bool, bitOffset: 4}
      - {name: str, address: 40100, dataType: string}
      - {name: e, address: 400110, dataType: uint64, endianness: yolo}
""",
        ["input 22 s16 r power 1", "input 23 s16 x3.1415 r power 2", "holding 110 u64 CDAB e",
         "input 24 bits r {4=bit} Bits of 24"],
        "^str: data type 'string' is not a type that maps have",
    ),
    "modpoll: registers from 40000 on, which are no logical numbers": (
        "inverter.csv",
        b"device,inv,1,,\npoll,holding_register,40000,20,BE_LE\nref,Vab,40000,uint16,r,V,0.1\nref,P,40001,int32,rw,W,\n"
        b"poll,coil,0,8,BE_BE\nref,c,0,bool8,rw\n",
        ["holding 40000 u16 x0.1 V r Vab", "holding 40001 s32 CDAB W rw P", "coil 0 bool rw c"],
        "",
    ),
    "modpoll: semicolons of a spreadsheet": (
        "modpoll.csv",
        "\ufeffdevice;meter;1;;;;\r\npoll;input_register;30001;4;BE_LE;;\r\n;;;;;;\r\n# phase;;;;;;\r\n"
        "ref;u;30001;float32;r;V;\r\nref;n;30003;uint16;r;\u00b0C;0,1\r\n".encode(),
        ["input 0 f32 CDAB V r u", "input 2 u16 x0.1 °C r n"],
        "",
    ),
    "rapid scada: elements side by side, a group that counts on, words in another order": (
        "pump.xml",
        """\ufeff<?xml version="1.0" encoding="utf-8"?>
<DeviceTemplate><ElemGroups>
  <ElemGroup active="true" tableType="HoldingRegisters" address="40" name="Set">
    <Elem name="Speed, rpm" type="ushort" /><Elem name="Flow" type="float" byteOrder="1032" />
    <Elem name="Level, x0.01 m" type="short" /><Elem name="Sum" type="ulong" /><Elem name="Code" />
  </ElemGroup>
  <ElemGroup tableType="Coils" address="7" name="Do"><Elem name="Run" /><Elem name="Reset" /></ElemGroup>
  <ElemGroup dataBlock="InputRegisters" address="7" name="Seen"><Elem name="Load" type="int" /></ElemGroup>
</ElemGroups></DeviceTemplate>""".encode(),
        ["holding 40 u16 rpm Speed", "holding 41 f32 CDAB Flow", "holding 43 s16 x0.01 m Level", "holding 44 u64 Sum",
         "holding 48 u16 Code", "coil 7 bool Run", "coil 8 bool Reset", "input 7 s32 r Load"],
        "",
    ),
    "scada-lts: locators of points": (
        "export.json",
        b"""{"dataPoints": [
{"xid": "DP_1", "name": "Flow", "engineeringUnits": "l/s", "pointLocator": {"range": "HOLDING_REGISTER",
 "modbusDataType": "FOUR_BYTE_FLOAT_SWAPPED", "offset": 12, "multiplier": 1.0, "settableOverride": true}},
{"xid": "DP_2", "name": "Level", "engineeringUnits": "m", "pointLocator": {"range": "INPUT_REGISTER",
 "modbusDataType": "TWO_BYTE_INT_SIGNED", "offset": 3, "multiplier": 0.01, "additive": -2.0}},
{"xid": "DP_3", "name": "Open", "pointLocator": {"range": "INPUT_STATUS", "modbusDataType": "BINARY", "offset": 9}},
{"xid": "DP_4", "name": "Sum", "pointLocator": {"dataType": 3}}]}""",
        ["holding 12 f32 CDAB l/s rw Flow", "input 3 s16 x0.01 +-2 m r Level", "discrete 9 bool r Open"],
        "",
    ),
    "niagara: logical addresses of all areas, facets, conversions": (
        "points.csv",
        b"""Name,Type,Facets,Proxy Ext.Address Format,Proxy Ext.Data Address,Proxy Ext.Reg Type,\
Proxy Ext.Data Type,Proxy Ext.Conversion
Flow,Numeric Point,"units=u:liter;l;;;,precision=i:1",Modbus,30008,Input,Float,Default
Level,Numeric Writable,"units=u:meter;m;(m);;",Modbus,40101,Holding,Signed Integer,"Linear (scale=0.01, offset=-2.0)"
Run,Boolean Writable,"trueText=s:On",Modbus,00003,Coil,,Default
Load,Numeric Point,,Decimal,12,Input,Unsigned Long,Default
""",
        ["input 7 f32 l r Flow", "holding 100 s16 x0.01 +-2 m rw Level", "coil 2 bool rw Run", "input 12 u32 r Load"],
        "",
    ),
    "modbus2mqtt: functions of polls, types that may be missing": (
        "mqtt.csv",
        b"device,pit,3\npoll,seen,10,4,input_register,2.0\nref,level,10,r,int16,0.01\nref,raw,11,r\n"
        b"poll,set,5,4,coil,1\nref,run,5,rw\npoll,all,100,9,holding_register,1\nref,sum,100,r,uint32LE\n"
        b"ref,model,104,r,string4\n",
        ["input 10 s16 x0.01 r level", "input 11 u16 r raw", "coil 5 bool rw run", "holding 100 u32 CDAB r sum",
         "holding 104 text r model"],
        "",
    ),
    "epics: records, and the ports that say where their registers begin": (
        "pit.cmd",
        b"""drvModbusAsynConfigure("IN", "PLC", 1, 4, 0x20, 20, INT16, 500, "x")
drvModbusAsynConfigure("OUT","PLC", 1, 16, 200, 8, 0, 1, "x")
drvModbusAsynConfigure("DO", "PLC", 1, 5, 8, 8, 0, 1, "x")
record(ai,"$(P)LT") { field(DESC,"Level") field(INP,"@asyn(IN,3)") field(LINR,"SLOPE")
 field(ESLO,"0.01") field(EGU,"m") }
record(ao,"$(P)SP") { field(DESC,"Speed set") field(OUT,"@asyn(OUT,2)FLOAT32_LE") field(EGU,"rpm") }
record(bo,"$(P)RUN") { field(OUT,"@asynMask(DO,1,0x1)") }
record(calc,"$(P)C") { field(DESC,"Sum") field(INPA,"3") }
""",
        ["input 35 s16 x0.01 m r Level", "holding 202 f32 CDAB rpm w Speed set", "coil 9 bool w $(P)RUN"],
        "",
    ),
    "the signs of a program in a table that is none of it": (
        "list.csv",
        b"Address,Name,Type,Unit,Scale,Remark\n100,Flow,int16,l/s,0.1,poll\n101,Level,uint16,m,0.01,poll\n"
        b"102,Load,uint32,kg,1,poll\n104,Speed,uint16,rpm,1,poll\npoll,what,is,marked,so,above\n",
        ["holding 100 s16 x0.1 l/s Flow", "holding 101 u16 x0.01 m Level", "holding 102 u32 kg Load",
         "holding 104 u16 rpm Speed"],
        "looks like",
    ),
    "modbus schema: comments, a field without its expression": (
        "schema.yaml",
        b"description: Meter\nblocks:\n- id: main\n  start: 3x1\n  fields:\n"
        b"  # watts\n  - {id: p, expression: 'int32(3x0001 # 2) / 10', unit: W}\n  - {id: none}\n"
        b"  - {id: u, expression: \"uint16(input-register:9)\"}\n",
        ["input 0 s32 x0.1 W r p", "input 9 u16 r u"],
        "none",
    ),
    "wirenboard: comments, a comma too many, texts as numbers": (
        "config-x.json",
        b"""// our own copy
{ "title": "X", /* old */
  "device": { "name": "x", "channels": [
    { "name": "T", "reg_type": "input", "address": "0x0010", "type": "temperature", "format": "s16", "scale": "0,1", },
    { "name": "E", "reg_type": "holding", "address": 20, "format": "u32", "word_order": "little_endian", },
    { "name": "Door", "reg_type": "holding", "address": "30:3:1" },
  ], } }""",
        ["input 16 s16 x0.1 °C r T", "holding 20 u32 CDAB r E", "holding 30 bits {3=Door} Bits of 30"],
        "",
    ),
    "wirenboard: devices within the device": (
        "sub.json",
        b"""{"title": "Y", "device": {"name": "y", "channels": [{"name": "In 1", "device_type": "s", "shift": 100}],
  "subdevices": [{"title": "s", "device": {"channels": [{"name": "U", "reg_type": "input", "address": 2}]}}]}}""",
        ["input 102 u16 r In 1 U"],
        "",
    ),
    "esphome: filters that compute nothing": (
        "tank.yaml",
        b"sensor:\n  - {platform: modbus_controller, name: L, address: 3, register_type: read, value_type: U_WORD,\n"
        b"     filters: [{throttle: 10s}, {multiply: 0.5}, {sliding_window_moving_average: {window_size: 5}}]}\n",
        ["input 3 u16 x0.5 r L"],
        "",
    ),
    "openhab: transformations, profiles of items, data that is only written, a bit": (
        "kiln.things",
        b"""Bridge modbus:serial:line "Line" [ port="/dev/ttyS2", baud=9600, id=7 ] {
  Bridge poller fast [ start=200, length=6, type="holding" ] {
    Thing data zone1 "Zone 1" [ readStart="200", readValueType="int16",
                                readTransform="JS(| input / 100)" ]
    Thing data fan [ readStart="201", readValueType="uint16", writeStart="201", writeType="holding" ]
    Thing data door "Door" [ readStart="202.3", readValueType="bit" ]
    Thing data gas "Gas" [ readStart="204", readValueType="uint32_swap" ]
  }
  Thing data start "Start" [ writeStart="17", writeType="coil" ]
}
Number:Volume Gas "Gas [%.2f m3]" { channel="modbus:data:line:fast:gas:number"
  [ profile="modbus:gainOffset", gain="0.01 m3" ] }
""",
        ["holding 200 s16 x0.01 r Zone 1", "holding 201 u16 rw fan", "holding 204 u32 CDAB x0.01 m3 r Gas",
         "coil 17 bool w Start", "holding 202 bits {3=Door} Bits of 202"],
        "",
    ),
    "nodered: what functions, changes and ranges behind a read compute": (
        "flows.json",
        b"""[{"id":"a","type":"modbus-read","name":"Level","dataType":"InputRegister","adr":"7","quantity":"1","rate":"2",
"rateUnit":"s","wires":[["d","b"],[]]},
{"id":"b","type":"function","name":"m","wires":[[]],
"func":"let raw = msg.payload[0];\\nif (raw > 32767) raw -= 65536;\\nmsg.payload = raw * 0.01;\\nreturn msg;"},
{"id":"d","type":"debug","name":"see","wires":[]},
{"id":"e","type":"modbus-getter","name":"Counter","dataType":"HoldingRegister","adr":12,"quantity":2,"wires":[["f"],[]]},
{"id":"f","type":"change",
"rules":[{"t":"set","p":"payload","pt":"msg","to":"payload[0] * 65536 + payload[1]","tot":"jsonata"}],"wires":[[]]},
{"id":"g","type":"modbus-read","name":"Valve","dataType":"HoldingRegister","adr":"20","quantity":"1","wires":[["h"],[]]},
{"id":"h","type":"range","minin":"0","maxin":"4000","minout":"-50","maxout":"150","wires":[[]]},
{"id":"i","type":"modbus-write","name":"Horn","dataType":"Coil","adr":"3","quantity":"1","wires":[[],[]]}]""",
        ["input 7 s16 x0.01 r Level", "holding 12 u32 Counter", "holding 20 u16 x0.05 +-50 Valve",
         "coil 3 bool w Horn"],
        "",
    ),
    "ignition: stations, folders, bits, texts, tags of memory": (
        "tags.json",
        b"""[{"name":"Pump","tagType":"Folder","tags":[
{"name":"Speed","tagType":"AtomicTag","valueSource":"opc","opcItemPath":"[Pumps]3.HRUS51","engUnit":"rpm"},
{"name":"Tripped","opcItemPath":{"bindType":"parameter","binding":"ns=1;s=[Pumps]3.HR60.2"}},
{"name":"Energy","opcItemPath":"ns=1;s=[Pumps]3.IRUI_64200","engUnit":"kWh","readOnly":true},
{"name":"Tank","opcItemPath":"ns=1;s=[Pumps]3.IR9","scaleMode":"Linear","rawLow":4000,"rawHigh":20000,"scaledLow":0,"scaledHigh":8},
{"name":"Serial","opcItemPath":"ns=1;s=[Pumps]3.HRS300:12"},
{"name":"Sum","valueSource":"memory"},
{"name":"Other","opcItemPath":"ns=2;s=Machine.Speed"}]}]""",
        ["holding 50 u16 rpm Speed", "input 199 u64 kWh r Energy", "input 8 s16 x0.0005 +-2 r Tank",
         "holding 299 text Serial", "holding 59 bits {2=Tripped} Bits of 59"],
        "counted from 1",
    ),
    "openems: channels of an element, words in the other order, tasks that write": (
        "BatteryImpl.java",
        b"""return new ModbusProtocol(this, //
  new FC3ReadRegistersTask(40, Priority.HIGH, //
    m(new UnsignedWordElement(40)).m(Batt.ChannelId.SOC, SCALE_FACTOR_MINUS_1).m(OTHER, DIRECT_1_TO_1).build(),
    m(SymmetricEss.ChannelId.POWER, new SignedDoublewordElement(41).wordOrder(WordOrder.LSWMSW), INVERT),
    new DummyRegisterElement(43, 44), m(new BitsWordElement(45, this).bit(0, ChannelId.TOO_HOT).bit(5, ChannelId.OPEN)),
    m(ChannelId.SERIAL, new StringWordElement(46, 8)),
    m(ChannelId.LIMIT, new UnsignedWordElement(60), ElementToChannelConverter.SCALE_FACTOR_2)),
  new FC16WriteRegistersTask(60, m(ChannelId.LIMIT, new UnsignedWordElement(60), SCALE_FACTOR_2)),
  new FC5WriteCoilTask(2, m(ChannelId.RESET, new CoilElement(2))));
enum ChannelId { SERIAL(Doc.of(STRING)),
  LIMIT(Doc.of(OpenemsType.INTEGER).accessMode(AccessMode.READ_WRITE).unit(Unit.WATT)); }
""",
        ["holding 40 u16 x0.1 r SOC", "holding 40 u16 r OTHER", "holding 41 s32 CDAB x-1 r POWER",
         "holding 46 text r SERIAL", "holding 60 u16 x100 W rw LIMIT",
         "coil 2 bool w RESET", "holding 45 bits {0=TOO_HOT; 5=OPEN} Bits of 45"],
        "",
    ),
    "sunspec: sizes that are missing, a mark, a number as text": (
        "model_103.json",
        """\ufeff{"id": "103", "group": {"name": "inv", "points": [{"name": "ID", "type": "uint16"},
  {"name": "W", "type": "int32", "units": "W", "sf": -1}, {"name": "A", "type": "uint16", "sf": "A_SF"},
  {"name": "A_SF", "type": "sunssf"}]}}""".encode(),
        ["holding 40070 u16 r ID", "holding 40071 s32 x0.1 W r W", "holding 40073 u16 r A", "holding 40074 s16 r A_SF"],
        "",
    ),
}  # fmt: skip


@pytest.mark.parametrize("oddity", FILES)
def test_a_file_of_people(oddity: str) -> None:
    check_import(FILES[oddity])


REFUSED = {
    "a unit that is no YAML": ("ha.yaml", "modbus:\n  - name: a\n    sensors:\n      - unit: %\n", "line 4"),
    "a tab in YAML": ("esp.yaml", "sensor:\n  - platform: modbus_controller\n\taddress: 5\n", "line 3"),
    "JSON that ends early": ("t.json", '{"device": {\n "channels": [{"name": "x"\n', "line 3"),
    "TOML with a bare variable": ("t.conf", "[[inputs.modbus]]\n  slave_id = $UNIT\n", "line 2"),
    "all of it elsewhere": ("configuration.yaml", "modbus: !include modbus.yaml\n", "modbus.yaml"),
    "no headings": ("list.csv", "40001,Voltage,V\n40002,Current,A\n", "not a known register map.*heading"),
    "numbers of parameters, many the same": (
        "drive.txt",
        "Programming guide of the PD 7\n\nThe number of a parameter is what the display shows.\n\n"
        " 1-1*  Data of the motor at hand\n 1-10  Motor power of the plate  4 kW\n"
        " 1-12  Motor voltage of the plate  400 V\n 1-13  Motor current of the plate  8.1 A\n"
        "Ramps are of the set that is chosen.\n 2-0*  Ramps of the first set\n 2-01  Ramp up of the first set  3 s\n"
        " 2-02  Ramp down of the first set  3 s\n 2-05  Limit of torque, both  160 %\nA restart keeps them all.\n",
        "reads as prose",
    ),
    "a template of templates": ("x.json.jinja", '{% set a = 1 %}\n{"device": {"channels": []}}', "line 1"),
}  # fmt: skip


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_read_is_said_with_its_place(case: str) -> None:
    file, text, expected = REFUSED[case]
    with pytest.raises(MapError, match=expected) as raised:
        import_maps(file, text.encode())
    assert str(raised.value).startswith(f"{file}: ") and "\n" not in str(raised.value)
