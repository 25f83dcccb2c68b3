"""11 Report Server ID ([1] 6.13): what a device says of itself, in a layout of its own.

The specification has a server id, a run indicator (00 off, FF on) and additional data, but not the length of the first.
Seen: one byte of id and the indicator at the start; a text with the indicator at the end; a text alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from construct import Struct

from dissectors.blocks import Split
from dissectors.declaration import Function
from dissectors.fields import Value
from dissectors.parts import ByteCount
from dissectors.text import device_text, is_text

_RUN: Final = {0x00: "off", 0xFF: "on"}


def _pieces(data: bytes) -> Sequence[tuple[str, int, Value, str]]:
    if len(data) >= 2 and data[1] in _RUN and not is_text(data):
        found = [("server_id", 1, data[0], f"{data[0]} (0x{data[0]:02X})"), _run(data[1])]
        return [*found, _data("additional_data", data[2:])] if len(data) > 2 else found
    if len(data) >= 2 and data[-1] in _RUN and is_text(data[:-1]) and not is_text(data):
        return [_data("server_id", data[:-1]), _run(data[-1])]
    if len(data) >= 2 and data[-1] == 0 and is_text(data):
        return [_data("server_id", data[:-1]), _run(0)] if data[-2] else [_data("server_id", data)]
    return [_data("server_id", data)] if data else []


def _run(byte: int) -> tuple[str, int, Value, str]:
    return "run_indicator", 1, byte, f"run indicator {_RUN[byte]}"


def _data(name: str, data: bytes) -> tuple[str, int, Value, str]:
    if is_text(data):
        text = device_text(data)
        return name, len(data), text, text
    return name, len(data), None, data.hex(" ")


REPORT_SERVER_ID: Final = Function(
    0x11,
    "Report Server ID",
    request=Struct(),
    response=Struct("byte_count" / ByteCount(1, 251), "data" / Split("byte_count", _pieces)),
    clause="6.13",
    request_words="report server id",
    response_words="server id: {data}",
)
