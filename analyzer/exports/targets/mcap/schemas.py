"""The messages of an exported MCAP, declared once: their schemas in the file and their bytes follow (docs/mcap.md).

Field names are a contract; field numbers follow from the order, so a new field goes last, before the text. Numbers are
of fixed width and a message has all its fields, so that a million are packed as columns. What a frame does not have (a
request's response time) is absent rather than -1, which a plot would show.

`foxglove.Log` is the well-known schema of that name, to the letter; viewers show such a channel as a log.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from enum import IntEnum
from typing import Any, Final

from analyzer.findings.model import Severity
from analyzer.frames import Kind, Protocol
from analyzer.transactions import Status
from captures.formats.mcap.protobuf import Field, Message, Type, plain_schema
from dissectors.functions import functions

EVIDENCE: Final = ("length", "crc", "silence", "conversation", "margin")


def frame(*, explain: bool = False) -> Message:
    """One frame; log_time is its last stop bit. With `explain`, why its boundaries stand where they do, in bits."""
    evidence = (
        *(Field(f"evidence_{name}", Type.FLOAT) for name in EVIDENCE),
        Field("runner_up_start", Type.SFIXED64, optional=True),
        Field("runner_up_length", Type.FIXED32, optional=True),
        Field("runner_up_kind", Type.ENUM, names=_names(Kind)),
    )
    return Message(
        "rtuscope.Frame",
        (
            Field("index", Type.FIXED64),
            Field("start", Type.FIXED64),
            Field("length", Type.FIXED32),
            Field("t_start_ns", Type.SFIXED64),
            Field("protocol", Type.ENUM, names=_names(Protocol)),
            Field("direction", Type.ENUM, names=_names(Kind)),
            Field("unit", Type.FIXED32),
            Field("function", Type.ENUM, names=function_names()),
            Field("crc_ok", Type.BOOL),
            Field("address", Type.FIXED32, optional=True),
            Field("quantity", Type.FIXED32, optional=True),
            Field("exception", Type.FIXED32, optional=True),
            Field("confidence", Type.FLOAT),
            Field("request_start", Type.FIXED64, optional=True),
            Field("response_time_ns", Type.FIXED64, optional=True),
            Field("port", Type.FIXED32),
            Field("findings", Type.FIXED32),
            *(evidence if explain else ()),
            Field("data", Type.BYTES),
        ),
    )


def transaction() -> Message:
    """A request and what became of it; log_time is the start of the answer, else the end of the request."""
    return Message(
        "rtuscope.Transaction",
        (
            Field("request", Type.FIXED64),
            Field("response", Type.FIXED64, optional=True),
            Field("unit", Type.FIXED32),
            Field("function", Type.ENUM, names=function_names()),
            Field("status", Type.ENUM, names=_names(Status)),
            Field("response_time_ms", Type.DOUBLE, optional=True),
            Field("retry", Type.BOOL),
            Field("late", Type.BOOL),
        ),
    )


NOISE: Final = Message(
    "rtuscope.Noise",
    (
        Field("start", Type.FIXED64),
        Field("length", Type.FIXED32),
        Field("t_start_ns", Type.SFIXED64),
        Field("port", Type.FIXED32),
        Field("data", Type.BYTES),
    ),
)


REGISTER: Final = Type.FIXED32  # the type of a value, by what it is
BIT: Final = Type.BOOL


def values(area: str, letter: str, start: int, count: int, *, bits: bool) -> tuple[str, bytes]:
    """Name and schema of values of consecutive addresses, a field each: `r107` a register, `b19` a coil or input."""
    name = f"rtuscope.{area}_{span(start, count, '_')}"
    fields = (f"{letter}{address}" for address in range(start, start + count))
    return name, plain_schema(name, fields, BIT if bits else REGISTER)


def span(start: int, count: int, dash: str = "-") -> str:
    """Addresses in words: `107-109`, or `107` alone."""
    return f"{start}{dash}{start + count - 1}" if count > 1 else str(start)


def function_names() -> Mapping[str, int]:
    """The declared functions' names as those of an enum, in capitals so that none is a field's; 0 is no function."""
    names: dict[str, int] = {"NO_FUNCTION": 0}
    for code, declared in sorted(functions().items()):
        name = re.sub(r"\W+", "_", declared.name, flags=re.ASCII).strip("_").upper()
        if not name or name[0].isdigit() or name in names:
            name = f"{name}_{code}" if name and not name[0].isdigit() else f"FUNCTION_{code}"
        names[name] = code
    return names


def _names(members: Iterable[IntEnum]) -> Mapping[str, int]:
    return {member.name.lower(): int(member) for member in members}


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
LEVELS: Final = {Severity.NOTE: 2, Severity.WARNING: 3, Severity.ERROR: 4}  # of log messages
