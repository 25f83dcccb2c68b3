"""What the specification says of contents: requests that break its limits, bits that mean nothing, exception answers.

No limit stands here: the checks of the declarations are put through whole columns, and the few frames that break one
are looked at. What a client asks is judged once, on the request; an answer that repeats it is not judged again. Of
exceptions: what the device said, what the specification means by it, what vendors use it for.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.functions import exception_meaning, exception_name, function_class, function_code, function_name
from dissectors.length_rules import Role
from dissectors.lengths import RULES, layout, relations
from dissectors.limits import EXCEPTION, LAST_UNIT, MAX_ADU, Bound, Choice, RequestedByteCount, Sized, taken
from dissectors.registry import revision

from ...languages import phrase
from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ...tables.schema import Protocol
from ...tables.transactions import OF_GATEWAYS
from ..view import DiagnosisStep, where


def _quantity_text(numbers: Mapping[str, float]) -> str:
    function, quantity, low, high = (int(numbers[key]) for key in ("function", "quantity", "low", "high"))
    return phrase(
        "{name}: {quantity} is outside {low} to {high}",
        name=function_name(function), quantity=quantity, low=low, high=high,
    )  # fmt: skip


QUANTITY: Final = Rule(
    "quantity-out-of-range",
    Severity.ERROR,
    About.FRAME,
    when="a quantity is zero or over what the function allows",
    clause="[1] 6",
    numbers=("quantity", "low", "high", "function"),
    text=_quantity_text,
    cause="the client's poll list asks for more than one frame can carry, or for nothing",
    remedy="split the poll into blocks within the limit",
)
BYTE_COUNT: Final = Rule(
    "byte-count-mismatch",
    Severity.ERROR,
    About.FRAME,
    when="the byte count does not fit the quantity in the same frame",
    clause="[1] 6",
    numbers=("byte_count", "quantity", "due", "function"),
    text="the byte count is {byte_count:.0f}, but a quantity of {quantity:.0f} needs {due:.0f} bytes",
    cause="the sender computes its byte count wrongly: registers counted as bytes, or bits not rounded up",
    remedy="correct the sender: 2 bytes per register, one byte per 8 bits or part of them",
)
COIL_VALUE: Final = Rule(
    "invalid-coil-value",
    Severity.ERROR,
    About.FRAME,
    when="function 05 writes a value other than 0000 or FF00",
    clause="[1] 6.5",
    numbers=("value",),
    text=lambda numbers: phrase(
        "a coil is written with {value}; only FF00 (on) and 0000 (off) are allowed",
        value=f"{int(numbers['value']):04X}",
    ),
    cause="the client writes 1 for on, or swaps the two bytes",
    remedy="send FF00 for on and 0000 for off",
)
PADDING: Final = Rule(
    "padding-bits-set",
    Severity.NOTE,
    About.FRAME,
    when="unused bits of the last byte of coils are not zero",
    clause="[1] 6.1",
    numbers=("unused_bits", "last_byte"),
    text=lambda numbers: phrase(
        "the {unused_bits:.0f} unused bits of the last byte ({octet}) are not zero",
        numbers,
        octet=f"{int(numbers['last_byte']):02X}",
    ),
    cause="the device sends whole bytes of its memory without clearing the unused bits",
    remedy="ignore these bits in the client; the device's vendor should clear them",
)
_GATEWAY: Final = 0xFF  # the unit of a server that is itself meant, over Modbus TCP ([3] 4.4.2.2)
RESERVED_UNIT: Final = Rule(
    "reserved-unit",
    Severity.WARNING,
    About.FRAME,
    when="the unit address is 248 to 255",
    clause="[2] 2.2",
    numbers=("unit",),
    text="unit {unit:.0f} is in use, but 248 to 255 are reserved",
    varies="unit",
    cause=lambda numbers: phrase(
        "a client of Modbus TCP that asks unit FF, which a gateway passes on, or a device's own service address"
        if numbers["unit"] == _GATEWAY
        else "a device's own service address, or an address set wrongly"
    ),
    remedy=lambda numbers: phrase(
        "set the unit's number in the client; give the device an address from 1 to 247"
        if numbers["unit"] == _GATEWAY
        else "give the device an address from 1 to 247"
    ),
)
RESERVED_FUNCTION: Final = Rule(
    "reserved-function",
    Severity.NOTE,
    About.FRAME,
    when="the function code is neither defined nor in the user ranges",
    clause="[1] 5",
    numbers=("function",),
    text=lambda numbers: phrase(
        "{code} is not in the specification and not in the user ranges (65-72, 100-110)",
        code=function_code(int(numbers["function"])),
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
    text="a request with function code {function:.0f}; valid codes are 1 to 127",
    cause="the sender builds its request from the wrong byte, or repeats an exception answer",
    remedy="correct the client's function code",
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
    remedy="ask for less at a time, or correct the sender",
)


@dataclass(frozen=True, slots=True)
class _QuantityLimits:
    """The limits of a quantity that stands at one place, by function code; of other functions, none."""

    offset: int
    width: int
    functions: set[int]
    low: NDArray[np.int64]
    high: NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class _RequestLimits:
    """What requests are held to here, out of all that is declared."""

    quantities: tuple[_QuantityLimits, ...]
    sizes: tuple[tuple[int, Sized], ...]  # by function code
    coils: tuple[tuple[int, Choice], ...]


@cache
def _checks(_revision: int) -> _RequestLimits:
    quantities: dict[tuple[int, int], _QuantityLimits] = {}
    sizes, coils = [], []
    for (code, role), declared in RULES.items():
        names = {offset: name for name, (offset, _) in layout(code, role).items()} if role is Role.REQUEST else {}
        for check in declared.checks if role is Role.REQUEST else ():
            name = "" if isinstance(check, Sized) else names.get(check.offset, "")
            if isinstance(check, Sized):
                sizes.append((code, check))
            elif isinstance(check, Choice) and name == "output_value":
                coils.append((code, check))
            elif isinstance(check, Bound) and name.startswith("quantity"):
                of_all = _QuantityLimits(
                    check.offset, check.width, set(), np.zeros(256, np.int64), np.full(256, 1 << 16)
                )
                limits = quantities.setdefault((check.offset, check.width), of_all)
                limits.functions.add(code)
                limits.low[code], limits.high[code] = check.low, check.high
    return _RequestLimits(tuple(quantities.values()), tuple(sizes), tuple(coils))


@looks_for(QUANTITY, BYTE_COUNT, COIL_VALUE)
def limits(view: DiagnosisStep) -> Iterator[Findings]:
    """Requests that break a check of their declaration."""
    if not len(view.requests):
        return
    checks, rows = _checks(revision()), view.rows
    for limit in checks.quantities:
        if limit.functions.isdisjoint(view.asked_functions):
            continue
        codes, quantity = view.requested, view.numbers(limit.offset, limit.width)
        low, high = limit.low.take(codes), limit.high.take(codes)
        wrong = where((quantity >= 0) & ((quantity < low) | (quantity > high)))
        if len(wrong):
            yield QUANTITY.on(rows[view.requests[wrong]], quantity[wrong], low[wrong], high[wrong], codes[wrong])
    for code, size in checks.sizes:
        if code in view.asked_functions:
            selected = where(view.requested == code)
            quantity, count = (
                view.numbers(*at)[selected] for at in ((size.quantity_offset, 2), (size.count_offset, 1))
            )
            due = taken(quantity, size.bits)
            wrong = where((quantity >= 0) & (count >= 0) & (count != due))
            if len(wrong):
                yield BYTE_COUNT.on(
                    rows[view.requests[selected[wrong]]], count[wrong], quantity[wrong], due[wrong], code
                )
    for code, coil in checks.coils:
        if code in view.asked_functions:
            selected = where(view.requested == code)
            value = view.numbers(coil.offset, coil.width)[selected]
            wrong = where((value >= 0) & ~np.isin(value, coil.values))
            if len(wrong):
                yield COIL_VALUE.on(rows[view.requests[selected[wrong]]], value[wrong])


@looks_for(PADDING)
def padding(view: DiagnosisStep) -> Iterator[Findings]:
    """Answers whose last byte holds more bits than the request asked for, and not as zeros."""
    functions = view.rows.function[view.responses]
    for code in where(np.bincount(functions)).tolist():
        for relation in relations(code):
            if not isinstance(relation, RequestedByteCount) or not relation.bits:
                continue
            answers = view.responses[functions == code]
            answers = answers[(view.rows.request[answers] >= 0) & (view.function_bytes(answers) == code)]
            quantity = view.asked(answers, relation.quantity_offset)
            last = view.data.take(view.last_byte(answers))
            used = quantity & 7
            wrong = where((quantity > 0) & (used > 0) & (last >> used > 0))
            if len(wrong):
                yield PADDING.on(view.rows[answers[wrong]], 8 - used[wrong], last[wrong])


@looks_for(RESERVED_UNIT, RESERVED_FUNCTION, INVALID_FUNCTION, TOO_LONG)
def codes(view: DiagnosisStep) -> Iterator[Findings]:
    """Units, function codes and lengths that the specification does not know."""
    unit = where((view.rows.unit > LAST_UNIT) & (view.rows.protocol != Protocol.TCP))  # 255 is usual there
    if len(unit):
        rows = view.rows[view.right(unit)]
        yield RESERVED_UNIT.on(rows, rows.unit)
    for code in view.asked_functions:
        if code & EXCEPTION or not code:
            yield INVALID_FUNCTION.on(view.rows[view.requests[view.requested == code]], code)
        elif _reserved(code, revision()):
            yield RESERVED_FUNCTION.on(view.rows[view.requests[view.requested == code]], code)
    for row in view.strays.tolist():
        code = int(view.data[view.plain.at[row] + 1])
        if code and not code & EXCEPTION and _reserved(code, revision()):
            yield RESERVED_FUNCTION.on(view.rows[row : row + 1], code)
    long = where(view.rows.length > MAX_ADU)
    if len(long):
        rows = view.rows[view.right(long)]
        rows = rows[rows.protocol == Protocol.RTU]
        yield TOO_LONG.on(rows, rows.length)


@lru_cache(maxsize=512)
def _reserved(code: int, _revision: int) -> bool:
    return function_class(code) in ("reserved", "unassigned")


# What devices really mean by a code: (likely cause, remedy).
_USES: Final[Mapping[int, tuple[str, str]]] = {
    0x01: ("the device does not have this function", "look the function up in the device's manual"),
    0x02: (
        "an address the device lacks, often off by one (40108 is address 107), or 03 and 04 mixed up",
        "check the starting address and the quantity against the register map; try one register",
    ),
    0x03: (
        "by the specification a malformed quantity or coil value; many vendors also mean a value out of range",
        "check quantity, byte count and the range of the written value",
    ),
    0x04: ("the device could not do it: a broken sensor or a missing module", "read the device's own status"),
    0x05: ("the device took the command and needs time", "ask for completion later, do not repeat the command"),
    0x06: ("the device is busy, often with its flash memory", "ask again later, poll more slowly"),
    0x07: ("the device cannot run this program function", "look the function up in the device's manual"),
    0x08: ("the device's extended memory is damaged", "service the device"),
    0x0A: (
        "the gateway reports it, not the device: it has no route to that unit",
        "check the gateway's routing of units",
    ),
    0x0B: (
        "the gateway reports it, not the device: the unit behind it is silent",
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


_ITSELF: Final = (
    "unit {unit:02X} is the gateway itself, not a unit behind it",
    "set the unit's number in the client",
)


def _use(numbers: Mapping[str, float]) -> tuple[str, str]:
    if int(numbers["code"]) in OF_GATEWAYS and int(numbers["unit"]) in (0, _GATEWAY):
        return _ITSELF
    return _USES.get(int(numbers["code"]), ("a vendor-specific code", "look the code up in the device's manual"))


EXCEPTION_ANSWER: Final = Rule(
    "exception",
    Severity.WARNING,
    About.FRAME,
    when="a unit answers with an exception",
    clause="[1] 7",
    numbers=("code", "function", "unit"),
    varies="code",
    text=_text,
    cause=lambda numbers: phrase(_use(numbers)[0], unit=int(numbers["unit"])),
    remedy=lambda numbers: phrase(_use(numbers)[1]),
)


@looks_for(EXCEPTION_ANSWER)
def exceptions(view: DiagnosisStep) -> Iterator[Findings]:
    """Every exception answer with a right check value."""
    raised = view.right(where(view.rows.exception))
    if len(raised):
        rows = view.rows[raised]
        yield EXCEPTION_ANSWER.on(rows, rows.exception, rows.function, rows.unit)
