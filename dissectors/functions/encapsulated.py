"""2B Encapsulated Interface Transport ([1] 6.19 to 6.21): 0D CANopen reference, 0E Read Device Identification."""

from __future__ import annotations

from typing import Final

from construct import Struct, this

from dissectors.blocks import Items, Record, Rest, Text, Variant
from dissectors.declaration import Function
from dissectors.parts import Code, Number, State

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
