"""07 Read Exception Status, 0B Get Comm Event Counter, 0C Get Comm Event Log ([1] 6.7, 6.9, 6.10)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from construct import Struct

from dissectors.blocks import Split
from dissectors.declaration import Function
from dissectors.fields import Value
from dissectors.parts import ByteCount, Flags, Number, State

_STATUS: Final = State(2, {0x0000: "ready", 0xFFFF: "busy with a program command"})

_RECEIVED: Final = {1: "communication error", 4: "character overrun", 5: "in listen only mode", 6: "broadcast"}
_SENT: Final = {
    0: "read exception (1 to 3)",
    1: "server abort exception (4)",
    2: "server busy exception (5, 6)",
    3: "program NAK exception (7)",
    4: "write timeout",
    5: "in listen only mode",
}


def event(byte: int) -> str:
    """An event byte in words ([1] 6.10): received, sent, listen only entered, communications restarted."""
    if byte == 0x04:
        return "entered listen only mode"
    if byte == 0x00:
        return "communications restarted"
    if byte == 0x20:  # so in the specification's example, though bit 6 marks what was sent
        return "in listen only mode"
    if byte & 0x80:
        kind, names = "received", _RECEIVED
    elif byte & 0x40:
        kind, names = "sent", _SENT
    else:
        return f"unknown event {byte:02X}"
    said = [name for bit, name in names.items() if byte >> bit & 1]
    return f"{kind}: {', '.join(said)}" if said else kind


def _events(data: bytes) -> Sequence[tuple[str, int, Value, str]]:
    return [("event", 1, byte, event(byte)) for byte in data]


READ_EXCEPTION_STATUS: Final = Function(
    0x07,
    "Read Exception Status",
    request=Struct(),
    response=Struct("output_data" / Flags({bit: f"output_{bit}" for bit in range(8)})),
    clause="6.7",
    request_words="read exception status",
    response_words="exception status {output_data}",
)

GET_COMM_EVENT_COUNTER: Final = Function(
    0x0B,
    "Get Comm Event Counter",
    request=Struct(),
    response=Struct("status" / _STATUS, "event_count" / Number(2)),
    clause="6.9",
    request_words="get comm event counter",
    response_words="{event_count:event}, {status}",
)

GET_COMM_EVENT_LOG: Final = Function(
    0x0C,
    "Get Comm Event Log",
    request=Struct(),
    response=Struct(
        "byte_count" / ByteCount(6, 6 + 64),
        "status" / _STATUS,
        "event_count" / Number(2),
        "message_count" / Number(2),
        "events" / Split("byte_count", _events, less=6),
    ),
    clause="6.10",
    request_words="get comm event log",
    response_words="{event_count:event}, {message_count:message}, {status}; newest first: {events}",
)
