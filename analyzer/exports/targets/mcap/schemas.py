"""The messages of an exported MCAP, declared once: their schemas in the file and their bytes follow (docs/mcap.md).

Field names are a contract; field numbers follow from the order, so a new field goes last, before the text. Numbers are
of fixed width and a message has all its fields, so that a million are packed as columns. What a frame does not have (a
request's response time) is absent rather than -1, which a plot would show.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from enum import IntEnum
from typing import Final

from captures.formats.mcap.protobuf import Message, MessageField, Type, plain_schema
from dissectors.functions import functions

from ....tables.findings import Severity
from ....tables.schema import Kind, Protocol
from ....tables.transactions import Status

EVIDENCE: Final = ("length", "crc", "silence", "conversation", "margin")


def frame(*, explain: bool = False) -> Message:
    """One frame; log_time is its last stop bit. With `explain`, why its boundaries stand where they do, in bits."""
    evidence = (
        *(MessageField(f"evidence_{name}", Type.FLOAT) for name in EVIDENCE),
        MessageField("runner_up_start", Type.SFIXED64, optional=True),
        MessageField("runner_up_length", Type.FIXED32, optional=True),
        MessageField("runner_up_kind", Type.ENUM, names=_names(Kind)),
    )
    return Message(
        "rtuscope.Frame",
        (
            MessageField("index", Type.FIXED64),
            MessageField("start", Type.FIXED64),
            MessageField("length", Type.FIXED32),
            MessageField("t_start_ns", Type.SFIXED64),
            MessageField("protocol", Type.ENUM, names=_names(Protocol)),
            MessageField("direction", Type.ENUM, names=_names(Kind)),
            MessageField("unit", Type.FIXED32),
            MessageField("function", Type.ENUM, names=function_names()),
            MessageField("crc_ok", Type.BOOL),
            MessageField("address", Type.FIXED32, optional=True),
            MessageField("quantity", Type.FIXED32, optional=True),
            MessageField("exception", Type.FIXED32, optional=True),
            MessageField("confidence", Type.FLOAT),
            MessageField("request_start", Type.FIXED64, optional=True),
            MessageField("response_time_ns", Type.FIXED64, optional=True),
            MessageField("port", Type.FIXED32),
            MessageField("findings", Type.FIXED32),
            MessageField("response_time_low_ns", Type.FIXED64, optional=True),  # where the tap's clock bounds it only
            MessageField("response_time_high_ns", Type.FIXED64, optional=True),
            *(evidence if explain else ()),
            MessageField("data", Type.BYTES),
        ),
    )


def transaction() -> Message:
    """A request and what became of it; log_time is the start of the answer, else the end of the request."""
    return Message(
        "rtuscope.Transaction",
        (
            MessageField("request", Type.FIXED64),
            MessageField("response", Type.FIXED64, optional=True),
            MessageField("unit", Type.FIXED32),
            MessageField("function", Type.ENUM, names=function_names()),
            MessageField("status", Type.ENUM, names=_names(Status)),
            MessageField("response_time_ms", Type.DOUBLE, optional=True),
            MessageField("retry", Type.BOOL),
            MessageField("late", Type.BOOL),
            MessageField(
                "response_time_low_ms", Type.DOUBLE, optional=True
            ),  # between what it lies as far as the tap's clock tells
            MessageField("response_time_high_ms", Type.DOUBLE, optional=True),
        ),
    )


NOISE: Final = Message(
    "rtuscope.Noise",
    (
        MessageField("start", Type.FIXED64),
        MessageField("length", Type.FIXED32),
        MessageField("t_start_ns", Type.SFIXED64),
        MessageField("port", Type.FIXED32),
        MessageField("data", Type.BYTES),
    ),
)


REGISTER: Final = Type.FIXED32  # the type of a value, by what it is
BIT: Final = Type.BOOL


def values(area: str, letter: str, unit: int, addresses: Sequence[int], *, bits: bool) -> tuple[str, bytes]:
    """Name and schema of a unit's values, a field an address: `r107` a register, `b19` a coil or input."""
    name = f"rtuscope.unit_{unit}_{area}"
    return name, plain_schema(name, (f"{letter}{address}" for address in addresses), BIT if bits else REGISTER)


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


LEVELS: Final = {Severity.NOTE: 2, Severity.WARNING: 3, Severity.ERROR: 4}  # of log messages
