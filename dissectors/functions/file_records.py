"""14 Read File Record, 15 Write File Record ([1] 6.14, 6.15): groups, each with its reference, counted in bytes."""

from __future__ import annotations

from typing import Final

from construct import Struct

from ..blocks import Items, Record, Registers
from ..declaration import ByteCount, Code, Function, Number
from ..limits import Bound

_REFERENCE: Final = {6: "extended memory file"}
_LAST_RECORD: Final = 9999


def _reference() -> Code:
    return Code(1, _REFERENCE, soft=False)


def _where() -> tuple[Number, Number]:
    return Number(2, Bound(0, 2, 1, 0xFFFF)), Number(2, Bound(0, 2, 0, _LAST_RECORD))


_FILE, _RECORD = _where()

READ_FILE_RECORD: Final = Function(
    0x14,
    "Read File Record",
    request=Struct(
        "byte_count" / ByteCount(0x07, 0xF5, multiple=7),
        "sub_requests"
        / Items(
            "sub_request"
            / Record(
                "{record_length:register} of file {file_number} from record {record_number}",
                "reference_type" / _reference(),
                "file_number" / _FILE,
                "record_number" / _RECORD,
                "record_length" / Number(2),
            ),
            octets="byte_count",
        ),
    ),
    response=Struct(
        "byte_count" / ByteCount(0x04, 0xF5, multiple=2),
        "sub_responses"
        / Items(
            "sub_response"
            / Record(
                "{record_data}",
                "file_response_length" / Number(1, Bound(0, 1, 0x03, 0xF5)),
                "reference_type" / _reference(),
                "record_data" / Registers("file_response_length", less=1),
            ),
            octets="byte_count",
        ),
    ),
    clause="6.14",
    request_words="read file records: {sub_requests}",
    response_words="file records: {sub_responses}",
)

_WRITE: Final = Struct(
    "byte_count" / ByteCount(0x09, 0xFB),
    "sub_requests"
    / Items(
        "sub_request"
        / Record(
            "{record_length:register} of file {file_number} from record {record_number}: {record_data}",
            "reference_type" / _reference(),
            "file_number" / _FILE,
            "record_number" / _RECORD,
            "record_length" / Number(2),
            "record_data" / Registers("record_length", scale=2),
        ),
        octets="byte_count",
    ),
)

WRITE_FILE_RECORD: Final = Function(
    0x15,
    "Write File Record",
    request=_WRITE,
    response=_WRITE,
    clause="6.15",
    echoes=("byte_count",),
    request_words="write file records: {sub_requests}",
    response_words="file records written: {sub_requests}",
)
