"""The lines of logs that tools write, declared: a new tool is a new entry.

A pattern has named groups for what it knows: `time`, `mark`, `hex`, `length` (bytes that there should be) and `cut`
(the tool's sign that it shows only some of them).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from enum import Enum, auto

from captures.text.marks import NONE, RX, TX


class Role(Enum):
    """What a line of a tool's own layout is."""

    BYTES = auto()
    STRING = auto()  # bytes as a C string
    HEADER = auto()  # time, mark or label of the lines below
    NOTHING = auto()  # the tool's other lines, which carry no bytes


@dataclass(frozen=True, slots=True)
class Shape:
    """The layout of one tool's line; `mark` for a layout that is a direction by itself."""

    tool: str
    role: Role
    pattern: re.Pattern[str]
    mark: int = NONE


MARK_WORDS = {">": TX, ">>>": TX, "tx": TX, "send": TX, "write": TX, "written": TX, "irp_mj_write": TX}
MARK_WORDS |= {"<": RX, "<<<": RX, "rx": RX, "recv": RX, "read": RX, "irp_mj_read": RX, "processing": RX}
_STRACE = r"^(?:\[pid +\d+\] |\d+ +)?(?:(?P<time>\d\d:\d\d:\d\d(?:\.\d+)?|\d{9,10}\.\d+) )?"

SHAPES = (
    Shape(
        "socat -x",
        Role.HEADER,
        re.compile(
            r"^(?P<mark>[<>]) (?P<time>\d{4}/\d\d/\d\d \d\d:\d\d:\d\d\.\d+) +length=(?P<length>\d+) from=\d+ to=\d+\s*$"
        ),
    ),
    Shape(
        "strace",
        Role.STRING,
        re.compile(
            _STRACE + r"(?:<\.\.\. )?(?P<mark>read|write)(?: resumed>|\(\d+(?:<[^>]*>)?, )"
            r'"(?P<hex>(?:[^"\\]|\\.)*)"(?P<cut>\.\.\.)?, \d+\)\s+= (?P<length>-?\d+)'
        ),
    ),
    Shape(
        "strace",
        Role.NOTHING,
        re.compile(
            _STRACE + r"(?:\w+\(.*(?:\)\s+= (?:-?\d|0x|\?)|<unfinished)|<\.\.\. \w+ resumed|"
            r"(?:\+{3}|-{3}) (?:exited|killed|SIG))"
        ),
    ),
    Shape("Modbus Poll", Role.BYTES, re.compile(r"^(?P<mark>Tx|Rx):\d{4,}-(?P<hex>.*)$")),
    Shape("Modbus Poll", Role.BYTES, re.compile(r"^\d{4,}-(?P<mark>Tx|Rx):(?P<hex>.*)$")),
    Shape(
        "QModMaster",
        Role.BYTES,
        re.compile(r"^\[\w+\]>(?P<mark>Tx|Rx) > (?P<time>\d\d:\d\d:\d\d:\d{3}) : ?(?P<hex>.*)$"),
    ),
    Shape(
        "pymodbus",
        Role.BYTES,
        re.compile(
            r"^(?P<time>\d{4}-\d\d-\d\d \d\d:\d\d:\d\d[,.]\d{3})?.*?\b(?P<mark>send|recv|processing): "
            r"(?P<hex>(?:0x[0-9a-f]{1,2}(?: |$))*)\s*(?:(?:extra data|unexpected data|old_data):.*)?$",
            re.IGNORECASE,
        ),
    ),
    Shape("pymodbus", Role.NOTHING, re.compile(r"^\d{4}-\d\d-\d\d \d\d:\d\d:\d\d[,.]\d{3} [A-Z]+ +\w+:\d+ ")),
    Shape("libmodbus", Role.BYTES, re.compile(r"^(?P<hex>(?:\[[0-9A-F]{2}\])+)\s*$"), TX),
    Shape("libmodbus", Role.BYTES, re.compile(r"^(?P<hex>(?:<[0-9A-F]{2}>)+)\s*$"), RX),
    Shape(
        "libmodbus, mbpoll",
        Role.NOTHING,
        re.compile(
            r"^(?:Waiting for an? (?:confirmation|indication)|Opening /|-- Polling|\[\d+\]:\s|Bytes flushed|"
            r"debug enabled|Set (?:mode|device|function|rtu|number|start|response|timeout|daddr)\b|iGet\w*List\(|"
            r"Integer found:|iCount=|\d+ bytes flushed|"
            r"ERROR |(?:Read|Write) .* failed:|mbpoll \d|Protocol configuration:|Slave configuration\.*:|"
            r"Communication\.+:|Data type\.+:|Written \d|Copyright |This program comes|"
            r"This is free software|to redistribute|under certain|\s+(?:address|start|baudrate|t/o)\b)"
        ),
    ),
    Shape(
        "ESPHome",
        Role.BYTES,
        re.compile(
            r"^(?:\[(?P<time>\d\d:\d\d:\d\d(?:\.\d+)?)\])?\[[A-Z]+\]\[uart_debug:\d+\]: (?P<mark>>>>|<<<) (?P<hex>.*)$"
        ),
    ),
    Shape("ESPHome", Role.NOTHING, re.compile(r"^(?:\[[\d:.]+\])?\[[A-Z]{1,2}\]\[[\w.]+:\d+\]:")),
    Shape(
        "PortMon",
        Role.BYTES,
        re.compile(
            r"^\d+\s+(?P<time>\d{1,2}:\d\d:\d\d(?:\.\d+)?(?: [AP]M)?|\d+\.\d+)?\s"
            r".*?\b(?P<mark>IRP_MJ_READ|IRP_MJ_WRITE)\s.*\bLength (?P<length>\d+): "
            r"(?P<hex>(?:[0-9A-Fa-f]{2}(?:\s|$))+)(?P<cut>\.\.\.)?\s*$"
        ),
    ),
    Shape(
        "serial port monitors, table",
        Role.BYTES,
        re.compile(
            r"^\d+\t(?:(?P<time>[^\t]*\d:\d\d:\d\d[^\t]*)\t)?(?:[^\t]*\t){0,12}?(?P<mark>IRP_MJ_READ|IRP_MJ_WRITE)\t"
            r"(?:[^\t]*\t){0,12}?(?P<hex>[0-9A-Fa-f]{2}(?: [0-9A-Fa-f]{2})+) ?(?:\t|$)"
        ),
    ),
    Shape(
        "Eltima Serial Port Monitor",
        Role.HEADER,
        re.compile(r"^\d+\s+(?P<mark>IRP_MJ_READ|IRP_MJ_WRITE) - Request transfers data\b"),
    ),
    Shape(
        "Eltima Serial Port Monitor",
        Role.NOTHING,
        re.compile(r"^\s+(?:STATUS_\w+|IOCTL_\w+ - .*|(?=[A-Za-z]*[g-zG-Z])[A-Za-z]+ - \w+)\s*$"),
    ),
    Shape(
        "Free Serial Analyzer",
        Role.HEADER,
        re.compile(r"^\[(?P<time>\d[^\]]+)\] (?P<mark>Written|Read) data \(\S+\)\s*$"),
    ),
    Shape(
        "PortMon",
        Role.NOTHING,
        re.compile(
            r"^\d+\s.*\b(?:IRP_MJ_(?!READ|WRITE)\w+|IOCTL_\w+|"
            r"IRP_MJ_(?:READ|WRITE)\b(?!.*\b[0-9A-Fa-f]{2} [0-9A-Fa-f]{2}\b))"
        ),
    ),
    Shape("sigrok uart", Role.BYTES, re.compile(r"^\d+-\d+ uart-\d+: (?P<hex>[0-9A-Fa-f]{2})\s*$")),
    Shape("sigrok uart", Role.NOTHING, re.compile(r"^\d+-\d+ uart-\d+: \D")),
)
