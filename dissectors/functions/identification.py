"""2B Encapsulated Interface Transport ([1] 6.19 to 6.21): 0D CANopen reference, 0E Read Device Identification."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from construct import Struct, this

from ..blocks import Items, Record, Rest, Split, Text, Variant
from ..declaration import ByteCount, Code, Function, Number, State
from ..fields import Value
from ..values import device_text, is_text

CANOPEN: Final = 0x0D
DEVICE_IDENTIFICATION: Final = 0x0E

_OBJECTS: Final = {
    0x00: "VendorName",
    0x01: "ProductCode",
    0x02: "MajorMinorRevision",
    0x03: "VendorUrl",
    0x04: "ProductName",
    0x05: "ModelName",
    0x06: "UserApplicationName",
    **dict.fromkeys(range(0x07, 0x80), "reserved"),
    **dict.fromkeys(range(0x80, 0x100), "private"),
}

_MEI: Final = Code(
    1, {CANOPEN: "CANopen General Reference", DEVICE_IDENTIFICATION: "Read Device Identification"}, soft=False
)
_READ_CODE: Final = Code(
    1, {1: "basic, stream", 2: "regular, stream", 3: "extended, stream", 4: "one object"}, soft=False
)
_CONFORMITY: Final = Code(
    1,
    {
        0x01: "basic, stream only",
        0x02: "regular, stream only",
        0x03: "extended, stream only",
        0x81: "basic, stream and single objects",
        0x82: "regular, stream and single objects",
        0x83: "extended, stream and single objects",
    },
)
_OBJECT: Final = Code(1, _OBJECTS, known=False)

_OTHER: Final = Struct("data" / Rest())

ENCAPSULATED_INTERFACE_TRANSPORT: Final = Function(
    0x2B,
    "Encapsulated Interface Transport",
    request=Struct(
        "mei_type" / _MEI,
        "mei_data"
        / Variant(
            this.mei_type,
            {DEVICE_IDENTIFICATION: Struct("read_device_id_code" / _READ_CODE, "object_id" / _OBJECT)},
            default=_OTHER,
        ),
    ),
    response=Struct(
        "mei_type" / _MEI,
        "mei_data"
        / Variant(
            this.mei_type,
            {
                DEVICE_IDENTIFICATION: Struct(
                    "read_device_id_code" / _READ_CODE,
                    "conformity_level" / _CONFORMITY,
                    "more_follows" / State(1, {0x00: "nothing follows", 0xFF: "more follows"}),
                    "next_object_id" / _OBJECT,
                    "number_of_objects" / Number(1),
                    "objects"
                    / Items(
                        "object"
                        / Record(
                            "{object_id}: {object_value}",
                            "object_id" / _OBJECT,
                            "object_length" / Number(1),
                            "object_value" / Text("object_length"),
                        ),
                        number="number_of_objects",
                    ),
                )
            },
            default=_OTHER,
        ),
    ),
    clause="6.19",
    echoes=("mei_type",),
    request_words=("read device identification: {read_device_id_code}, from {object_id}", "{mei_type}: {data}"),
    response_words=("device identification: {objects}, {more_follows}", "{mei_type}: {data}"),
)


# 11 Report Server ID ([1] 6.13): what a device says of itself, in a layout of its own.
#
# The specification has a server id, a run indicator (00 off, FF on) and additional data, but not the length of the
# first. Seen: one byte of id and the indicator at the start; a text with the indicator at the end; a text alone.


_RUN: Final = {0x00: "off", 0xFF: "on"}


def _pieces(data: bytes) -> Sequence[tuple[str, int, Value, str]]:
    if len(data) >= 2 and data[1] in _RUN and not is_text(data):
        parts = [("server_id", 1, data[0], f"{data[0]} (0x{data[0]:02X})"), _run(data[1])]
        return [*parts, _data("additional_data", data[2:])] if len(data) > 2 else parts
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
