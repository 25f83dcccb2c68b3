"""The JSON schemas that an exported MCAP carries, so that it explains itself. Keys are a contract: docs/mcap.md.

`foxglove.Log` is the well-known schema of that name, to the letter; viewers show such a channel as a log.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, Final

_INTEGER: Final = {"type": "integer"}
_NUMBER: Final = {"type": "number"}
_STRING: Final = {"type": "string"}
_FLAG: Final = {"type": "boolean"}


def _maybe(schema: dict[str, Any]) -> dict[str, Any]:
    return {"oneOf": [schema, {"type": "null"}]}


FRAME: Final[dict[str, Any]] = {
    "title": "rtuscope.Frame",
    "description": "One Modbus frame as captured; log_time is its last stop bit",
    "type": "object",
    "properties": {
        "index": _INTEGER,
        "start": {**_INTEGER, "description": "offset of its first byte in its port's byte stream"},
        "length": {**_INTEGER, "description": "bytes"},
        "t_start_ns": _INTEGER,
        "t_end_ns": _INTEGER,
        "protocol": {**_STRING, "enum": ["rtu", "ascii", "tcp"]},
        "direction": {**_STRING, "enum": ["request", "response"]},
        "unit": _INTEGER,
        "function": _INTEGER,
        "name": _STRING,
        "summary": {**_STRING, "description": "the frame in words"},
        "exception": _maybe(_INTEGER),
        "crc_ok": _FLAG,
        "request_start": _maybe(_INTEGER),
        "response_time_ns": _maybe(_INTEGER),
        "hex": _STRING,
        "confidence": _NUMBER,
        "findings": {"type": "array", "items": {"type": "object"}},
        "port": {**_INTEGER, "description": "which tap of several; absent for the first"},
    },
}

TRANSACTION: Final[dict[str, Any]] = {
    "title": "rtuscope.Transaction",
    "description": "A request and what became of it; log_time is the start of the answer, else the end of the request",
    "type": "object",
    "properties": {
        "request": {**_INTEGER, "description": "index of the request's frame"},
        "response": {**_maybe(_INTEGER), "description": "index of the answer's frame"},
        "unit": _INTEGER,
        "function": _INTEGER,
        "status": {**_STRING, "enum": ["answered", "exception", "unanswered", "broadcast", "damaged"]},
        "response_time_ms": {**_maybe(_NUMBER), "description": "null where the tap cannot tell"},
        "retry": _FLAG,
        "late": _FLAG,
    },
}

LOG: Final[dict[str, Any]] = {
    "title": "foxglove.Log",
    "description": "A log message",
    "type": "object",
    "properties": {
        "timestamp": {
            "type": "object",
            "title": "time",
            "properties": {
                "sec": {"type": "integer", "minimum": 0},
                "nsec": {"type": "integer", "minimum": 0, "maximum": 999999999},
            },
            "description": "Timestamp of log message",
        },
        "level": {
            "title": "foxglove.LogLevel",
            "description": "Log level",
            "oneOf": [
                {"title": name, "const": number}
                for number, name in enumerate(("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"))
            ],
        },
        "message": {"type": "string", "description": "Log message"},
        "name": {"type": "string", "description": "Process or node name"},
        "file": {"type": "string", "description": "Filename"},
        "line": {"type": "integer", "minimum": 0, "description": "Line number in the file"},
    },
}
LEVELS: Final = {"note": 2, "warning": 3, "error": 4}  # a finding's severity as a log level

NOISE: Final[dict[str, Any]] = {
    "title": "rtuscope.Noise",
    "description": "Bytes that belong to no frame; log_time is the last stop bit",
    "type": "object",
    "properties": {
        "kind": {**_STRING, "const": "noise"},
        "start": _INTEGER,
        "length": _INTEGER,
        "t_start_ns": _INTEGER,
        "t_end_ns": _INTEGER,
        "hex": _STRING,
        "port": _INTEGER,
    },
}


def values(unit: int, area: str, names: Iterable[str]) -> dict[str, Any]:
    """The schema of one unit's registers or bits; `names` are those of the channel's first message."""
    return {
        "title": "rtuscope.Values",
        "description": f"{area} values of unit {unit} as one transaction carried them, by address",
        "type": "object",
        "properties": dict.fromkeys(names, _NUMBER),
        "additionalProperties": _NUMBER,
    }
