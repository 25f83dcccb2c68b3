"""08 Diagnostics ([1] 6.8): a sub-function and its data, two bytes by the specification; more are seen."""

from __future__ import annotations

from typing import Final

from construct import Struct, Switch, this

from dissectors.blocks import Record, Rest
from dissectors.declaration import Function
from dissectors.limits import Choice
from dissectors.parts import AnyConstruct, Code, Mask, Number, State

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
