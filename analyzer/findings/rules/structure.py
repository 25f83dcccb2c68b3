"""Requests that break the specification's limits, and answers with bits that mean nothing.

No limit stands here: the checks of the declarations are put through whole columns, and the few frames that break one
are looked at. What a client asks is judged once, on the request; an answer that repeats it is not judged again.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.functions import function_class, function_name
from dissectors.lengths import Asked, Role, Sized, layout, relations, rule
from dissectors.limits import Bound, Choice

from ...deframing.rules import MAX_ADU, asked_bytes, field
from ..model import Findings, Severity
from ..registry import About, Rule, looks_for
from ..view import View

_LAST_UNIT: Final = 247
_EXCEPTION: Final = 0x80


def _asked(numbers: Mapping[str, float]) -> str:
    function, quantity, low, high = (int(numbers[key]) for key in ("function", "quantity", "low", "high"))
    return f"{function_name(function)} of {quantity}, allowed are {low} to {high}"


QUANTITY: Final = Rule(
    "quantity-out-of-range",
    Severity.ERROR,
    About.FRAME,
    when="a quantity is zero or over what the function allows",
    clause="[1] 6",
    numbers=("quantity", "low", "high", "function"),
    text=_asked,
    cause="the master's poll list asks for more than one frame can carry, or for nothing",
    remedy="split the poll into blocks within the limit",
)
BYTE_COUNT: Final = Rule(
    "byte-count-mismatch",
    Severity.ERROR,
    About.FRAME,
    when="the byte count does not fit the quantity in the same frame",
    clause="[1] 6",
    numbers=("byte_count", "quantity", "due", "function"),
    text="the byte count is {byte_count:.0f}, the quantity beside it, {quantity:.0f}, takes {due:.0f} bytes",
    cause="the sender computes its byte count wrongly: registers counted as bytes, or bits not rounded up",
    remedy="correct the sender: 2 bytes a register, one byte for 8 bits begun",
)
COIL_VALUE: Final = Rule(
    "invalid-coil-value",
    Severity.ERROR,
    About.FRAME,
    when="function 05 writes other than 0000 or FF00",
    clause="[1] 6.5",
    numbers=("value",),
    text=lambda numbers: f"a coil is written with {int(numbers['value']):04X}, allowed are FF00 (on) and 0000 (off)",
    cause="the master writes 1 for on, or swaps the two bytes",
    remedy="send FF00 for on and 0000 for off",
)
PADDING: Final = Rule(
    "padding-bits-set",
    Severity.NOTE,
    About.FRAME,
    when="unused bits of the last byte of coils are not zero",
    clause="[1] 6.1",
    numbers=("unused_bits", "last_byte"),
    text=lambda numbers: (
        f"the {int(numbers['unused_bits'])} unused bits of the last byte ({int(numbers['last_byte']):02X}) are not zero"
    ),
    cause="the device sends whole bytes of its memory and does not clear the bits that nobody asked for",
    remedy="ignore these bits in the master; the device's vendor should clear them",
)
RESERVED_UNIT: Final = Rule(
    "reserved-unit",
    Severity.WARNING,
    About.FRAME,
    when="the unit address is 248 to 255",
    clause="[2] 2.2",
    numbers=("unit",),
    text="unit {unit:.0f} is used, 248 to 255 are reserved",
    cause="a device's own service address, or an address set wrongly",
    remedy="give the device an address from 1 to 247",
)
RESERVED_FUNCTION: Final = Rule(
    "reserved-function",
    Severity.NOTE,
    About.FRAME,
    when="the function code is neither defined nor given to users",
    clause="[1] 5",
    numbers=("function",),
    text=lambda numbers: (
        f"function {int(numbers['function'])} ({int(numbers['function']):02X}) is neither defined by the specification "
        "nor free for users (65-72 and 100-110 are)"
    ),
    cause="a vendor's own function outside the ranges for users",
    remedy="look it up in the device's manual, and declare it to have it decoded (--functions)",
)
INVALID_FUNCTION: Final = Rule(
    "invalid-function",
    Severity.ERROR,
    About.FRAME,
    when="the function code is 0, or a request has an exception's",
    clause="[1] 4.1",
    numbers=("function",),
    text=lambda numbers: f"a request with function code {int(numbers['function'])}, possible are 1 to 127",
    cause="the sender builds its request from the wrong byte, or repeats an exception answer",
    remedy="correct the master's function code",
)
TOO_LONG: Final = Rule(
    "frame-too-long",
    Severity.ERROR,
    About.FRAME,
    when="a frame is longer than 256 bytes",
    clause="[2] 2.5.1",
    numbers=("bytes",),
    text=f"the frame has {{bytes:.0f}} bytes, {MAX_ADU} are the most",
    cause="the sender ignores the limit of the serial line; receivers with a 256-byte buffer drop the frame",
    remedy="ask for less at once, or correct the sender",
)


@looks_for(QUANTITY, BYTE_COUNT, COIL_VALUE)
def limits(view: View) -> Iterator[Findings]:
    """Requests that break a check of their declaration."""
    requests, functions = view.requests, view.requested
    for code in np.flatnonzero(np.bincount(functions, minlength=256)).tolist():
        known = rule(code, Role.REQUEST)
        if known is None or not known.checks:
            continue
        here = requests[functions == code]
        for check in known.checks:
            if isinstance(check, Sized):
                yield from _sized(view, here, check, code)
            elif isinstance(check, Bound | Choice):
                yield from _valued(view, here, check, code)


def _sized(view: View, here: NDArray[np.intp], check: Sized, code: int) -> Iterator[Findings]:
    here = here[view.reaches(here, max(check.count_offset + 1, check.quantity_offset + 2))]
    at = view.pdu(here)
    quantity = field(view.data, at + check.quantity_offset, 2)
    count = field(view.data, at + check.count_offset, 1)
    due = asked_bytes(quantity, check.bits)
    wrong = count != due
    if wrong.any():
        yield BYTE_COUNT.on(view.rows[here[wrong]], count[wrong], quantity[wrong], due[wrong], code)


def _valued(view: View, here: NDArray[np.intp], check: Bound | Choice, code: int) -> Iterator[Findings]:
    names = {place: name for name, (place, _) in layout(code, Role.REQUEST).items()}
    name = names.get(check.offset, "")
    here = here[view.reaches(here, check.offset + check.width)]
    value = field(view.data, view.pdu(here) + check.offset, check.width)
    if isinstance(check, Bound) and name.startswith("quantity"):
        wrong = (value < check.low) | (value > check.high)
        if wrong.any():
            yield QUANTITY.on(view.rows[here[wrong]], value[wrong], check.low, check.high, code)
    elif isinstance(check, Choice) and name == "output_value":
        wrong = ~np.isin(value, check.values)
        if wrong.any():
            yield COIL_VALUE.on(view.rows[here[wrong]], value[wrong])


@looks_for(PADDING)
def padding(view: View) -> Iterator[Findings]:
    """Answers whose last byte holds more bits than the request asked for, and not as zeros."""
    rows = view.rows
    functions = rows["function"][view.responses]
    for code in np.flatnonzero(np.bincount(functions, minlength=256)).tolist():
        for relation in relations(code):
            if not isinstance(relation, Asked) or not relation.bits:
                continue
            here = view.responses[functions == code]
            here = here[(rows["request"][here] >= 0) & (view.function_bytes(here) == code)]
            quantity = view.asked(here, relation.quantity_offset)
            last = view.data.take(view.last_byte(here))
            used = quantity & 7
            wrong = (quantity > 0) & (used > 0) & (last >> used > 0)
            if wrong.any():
                yield PADDING.on(rows[here[wrong]], 8 - used[wrong], last[wrong])


@looks_for(RESERVED_UNIT, RESERVED_FUNCTION, INVALID_FUNCTION, TOO_LONG)
def codes(view: View) -> Iterator[Findings]:
    """Units, function codes and lengths that the specification does not know."""
    rows = view.rows
    stray = view.responses[rows["request"][view.responses] < 0]
    reserved = np.flatnonzero((rows["unit"] > _LAST_UNIT) & rows["check"])
    if len(reserved):
        yield RESERVED_UNIT.on(rows[reserved], rows["unit"][reserved])
    for frames, functions in ((view.requests, view.requested), (stray, view.function_bytes(stray))):
        for code in np.flatnonzero(np.bincount(functions, minlength=256)).tolist():
            if code & _EXCEPTION or not code:
                if frames is view.requests:
                    yield INVALID_FUNCTION.on(rows[frames[functions == code]], code)
            elif function_class(code) in ("reserved", "unassigned"):
                yield RESERVED_FUNCTION.on(rows[frames[functions == code]], code)
    long = np.flatnonzero((rows["length"] > MAX_ADU) & rows["check"] & (rows["protocol"] == 0))
    if len(long):
        yield TOO_LONG.on(rows[long], rows["length"][long])
