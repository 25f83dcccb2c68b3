"""Exception responses ([1] 7): any function with the high bit set, and one code."""

from __future__ import annotations

from typing import Final

from construct import Struct

from ..declaration import Code

# code: (name, meaning)
EXCEPTIONS: Final[dict[int, tuple[str, str]]] = {
    0x01: ("illegal function", "the server does not know this function, or not in its present state"),
    0x02: ("illegal data address", "the server has no such address, or too few registers from there"),
    0x03: ("illegal data value", "a field of the request is malformed (this does not mean a value out of range)"),
    0x04: ("server device failure", "the server failed at what was asked for, and cannot recover"),
    0x05: ("acknowledge", "accepted, and will take long: ask for program completion later"),
    0x06: ("server device busy", "the server is busy with a long command: ask again later"),
    0x07: ("negative acknowledge", "the server cannot do this program function (functions 13 and 14)"),
    0x08: ("memory parity error", "the server found its extended memory damaged (functions 20 and 21)"),
    0x0A: ("gateway path unavailable", "the gateway has no path to that unit: misconfigured or overloaded"),
    0x0B: ("gateway target device failed to respond", "the unit behind the gateway does not answer"),
}

RESPONSE: Final = Struct("exception_code" / Code(1, {code: name for code, (name, _) in EXCEPTIONS.items()}))


def exception_name(code: int) -> str:
    """The exception's name in the specification, in lower case; `unknown exception` where it has none."""
    return EXCEPTIONS[code][0] if code in EXCEPTIONS else "unknown exception"


def exception_meaning(code: int) -> str:
    """What the specification means by it, in a phrase; empty where it has none."""
    return EXCEPTIONS[code][1] if code in EXCEPTIONS else ""
