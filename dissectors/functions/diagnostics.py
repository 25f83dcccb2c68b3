"""08 Diagnostics ([1] 6.8): a sub-function and its data, two bytes by the specification; more are seen."""

from __future__ import annotations

from typing import Final

from construct import Struct, Switch, this

from ..blocks import EachByte, Record, Rest
from ..declaration import AnyConstruct, ByteCount, Code, Flags, Function, Mask, Number, State
from ..fields import ENGLISH, Wording
from ..limits import Choice

_ZERO: Final = Number(2, Choice(0, 2, (0,)))
_QUERY: Final = Rest(usual=2)
_RESTART: Final = State(2, {0x0000: "keep the event log", 0xFF00: "clear the event log"})
_DELIMITER: Final = Record("{delimiter}", "delimiter" / Number(1), "zero" / Number(1, Choice(0, 1, (0,))))


def _count(noun: str) -> Number:
    return Number(2, noun=noun)


# sub-function: (name, data of the request, data of the response)
SUB_FUNCTIONS: Final[dict[int, tuple[str, AnyConstruct, AnyConstruct]]] = {
    0: ("Return Query Data", _QUERY, _QUERY),
    1: ("Restart Communications Option", _RESTART, _RESTART),
    2: ("Return Diagnostic Register", _ZERO, Mask()),
    3: ("Change ASCII Input Delimiter", _DELIMITER, _DELIMITER),
    4: ("Force Listen Only Mode", _ZERO, _ZERO),
    10: ("Clear Counters and Diagnostic Register", _ZERO, _ZERO),
    11: ("Return Bus Message Count", _ZERO, _count("messages seen on the bus")),
    12: ("Return Bus Communication Error Count", _ZERO, _count("CRC errors")),
    13: ("Return Bus Exception Error Count", _ZERO, _count("exceptions returned")),
    14: ("Return Server Message Count", _ZERO, _count("messages to this server or broadcast")),
    15: ("Return Server No Response Count", _ZERO, _count("messages without a response")),
    16: ("Return Server NAK Count", _ZERO, _count("negative acknowledges")),
    17: ("Return Server Busy Count", _ZERO, _count("times busy")),
    18: ("Return Bus Character Overrun Count", _ZERO, _count("characters overrun")),
    20: ("Clear Overrun Counter and Flag", _ZERO, _ZERO),
}

_SUB_FUNCTION: Final = Code(2, {code: name for code, (name, _, _) in SUB_FUNCTIONS.items()})

DIAGNOSTICS: Final = Function(
    0x08,
    "Diagnostics",
    request=Struct(
        "sub_function" / _SUB_FUNCTION,
        "data"
        / Switch(this.sub_function, {code: data for code, (_, data, _) in SUB_FUNCTIONS.items()}, default=_QUERY),
    ),
    response=Struct(
        "sub_function" / _SUB_FUNCTION,
        "data"
        / Switch(this.sub_function, {code: data for code, (_, _, data) in SUB_FUNCTIONS.items()}, default=_QUERY),
    ),
    clause="6.8",
    echoes=("sub_function",),
    request_words="diagnostics: {sub_function}, data {data}",
    response_words="diagnostics: {sub_function}: {data}",
)


# 07 Read Exception Status, 0B Get Comm Event Counter, 0C Get Comm Event Log ([1] 6.7, 6.9, 6.10).


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


def event(byte: int, wording: Wording = ENGLISH) -> str:
    """An event byte in words ([1] 6.10): received, sent, listen only entered, communications restarted."""
    say = wording.say
    if byte == 0x04:
        return say("entered listen only mode")
    if byte == 0x00:
        return say("communications restarted")
    if byte == 0x20:  # so in the specification's example, though bit 6 marks what was sent
        return say("in listen only mode")
    if byte & 0x80:
        kind, names = "received", _RECEIVED
    elif byte & 0x40:
        kind, names = "sent", _SENT
    else:
        return wording.fill_template("unknown event {code}", code=f"{byte:02X}")
    bits = [say(name) for bit, name in names.items() if byte >> bit & 1]
    return f"{say(kind)}: {', '.join(bits)}" if bits else say(kind)


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
        "events" / EachByte("byte_count", "event", event, less=6),
    ),
    clause="6.10",
    request_words="get comm event log",
    response_words="{event_count:event}, {message_count:message}, {status}; newest first: {events}",
)
