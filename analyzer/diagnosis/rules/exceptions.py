"""Exception answers: what the device said, what the specification means by it, what vendors use it for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

from dissectors.functions import exception_meaning, exception_name, function_name

from ...languages import phrase
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ..view import DiagnosisStep, where

# What devices really mean by a code: (likely cause, remedy).
_USES: Final[Mapping[int, tuple[str, str]]] = {
    0x01: ("the device does not have this function", "look the function up in the device's manual"),
    0x02: (
        "an address that the device does not have, often one off (40108 is address 107), or 03 and 04 mixed up",
        "check the starting address and the quantity against the register map; try one register",
    ),
    0x03: (
        "by the specification a malformed quantity or coil value; many vendors also mean a value out of range",
        "check quantity, byte count and the range of the written value",
    ),
    0x04: ("the device failed at it: a broken sensor, or a module missing behind it", "read the device's own status"),
    0x05: ("the device took the command and needs time", "ask for completion later, do not repeat the command"),
    0x06: ("the device is busy, often with its flash memory", "ask again later, poll more slowly"),
    0x07: ("the device cannot run this program function", "look the function up in the device's manual"),
    0x08: ("the device's extended memory is damaged", "service the device"),
    0x0A: ("a gateway says it, not the device: it has no way to that unit", "check the gateway's routing of units"),
    0x0B: (
        "a gateway says it, not the device: the unit behind it is silent",
        "check the unit's power, address, line settings and the gateway's timeout",
    ),
}


def _text(numbers: Mapping[str, float]) -> str:
    code, function, unit = (int(numbers[key]) for key in ("code", "function", "unit"))
    refused = phrase(
        "unit {unit} refuses {function}: exception {code:02X} {name}",
        unit=unit, function=function_name(function), code=code, name=exception_name(code),
    )  # fmt: skip
    meaning = exception_meaning(code)
    return refused + (f", {phrase(meaning)}" if meaning else "")


def _use(numbers: Mapping[str, float]) -> tuple[str, str]:
    return _USES.get(int(numbers["code"]), ("a code of the vendor's own", "look the code up in the device's manual"))


EXCEPTION: Final = Rule(
    "exception",
    Severity.WARNING,
    About.FRAME,
    when="a unit answers by an exception",
    clause="[1] 7",
    numbers=("code", "function", "unit"),
    varies="code",
    text=_text,
    cause=lambda numbers: phrase(_use(numbers)[0]),
    remedy=lambda numbers: phrase(_use(numbers)[1]),
)


@looks_for(EXCEPTION)
def exceptions(view: DiagnosisStep) -> Iterator[Findings]:
    """Every exception answer with a right check value."""
    raised = view.right(where(view.rows.exception))
    if len(raised):
        rows = view.rows[raised]
        yield EXCEPTION.on(rows, rows.exception, rows.function, rows.unit)
