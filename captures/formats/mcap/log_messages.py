"""`foxglove.Log` in protobuf: the well-known schema of log messages, which viewers show as a log, and its messages."""

from __future__ import annotations

from typing import Final

from .protobuf import delimited, varint_field

LOG_NAME: Final = "foxglove.Log"
_INT64, _INT32, _FIXED32, _STRING, _MESSAGE, _ENUM = 3, 5, 7, 9, 11, 14  # types of a field descriptor
_LEVELS: Final = ("UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL")


def log_schema() -> bytes:
    """The schema as a serialised FileDescriptorSet; it brings google.protobuf.Timestamp along."""
    stamp = _text(1, "Timestamp") + _field("seconds", 1, _INT64) + _field("nanos", 2, _INT32)
    levels = b"".join(delimited(2, _text(1, name) + varint_field(2, n)) for n, name in enumerate(_LEVELS))
    log = b"".join(
        (
            _text(1, "Log"),
            _field("timestamp", 1, _MESSAGE, ".google.protobuf.Timestamp"),
            _field("level", 2, _ENUM, ".foxglove.Log.Level"),
            _field("message", 3, _STRING),
            _field("name", 4, _STRING),
            _field("file", 5, _STRING),
            _field("line", 6, _FIXED32),
            delimited(4, _text(1, "Level") + levels),
        )
    )
    return _file("google/protobuf/timestamp.proto", "google.protobuf", stamp) + _file(
        "foxglove/Log.proto", "foxglove", log, "google/protobuf/timestamp.proto"
    )


def log_message(t_ns: int, level: int, message: str, name: str) -> bytes:
    """One message; `level` 1 debug, 2 info, 3 warning, 4 error."""
    seconds, nanos = divmod(max(t_ns, 0), 1_000_000_000)
    stamp = varint_field(1, seconds) + varint_field(2, nanos)
    return delimited(1, stamp) + varint_field(2, level) + _text(3, message) + _text(4, name)


def _field(name: str, number: int, kind: int, type_name: str = "") -> bytes:
    parts = (_text(1, name), varint_field(3, number), varint_field(4, 1), varint_field(5, kind))
    return delimited(2, b"".join((*parts, _text(6, type_name) if type_name else b"")))


def _file(name: str, package: str, message: bytes, *needs: str) -> bytes:
    depends = b"".join(_text(3, need) for need in needs)
    return delimited(1, _text(1, name) + _text(2, package) + depends + delimited(4, message) + _text(12, "proto3"))


def _text(number: int, text: str) -> bytes:
    return delimited(number, text.encode("utf-8", "replace"))
