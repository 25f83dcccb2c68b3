"""A declaration and some bytes give a tree of fields; the same in brief gives one line of words.

Whatever the bytes are, there is an answer: the top-level fields cover every byte of the ADU once, what breaks the
specification is said where it is (`Field.problem`), and bytes that nothing explains are a field of their own.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Final

from .blocks import opaque
from .declaration import AnyConstruct, Short
from .envelopes import MBAP, Adu
from .fields import ENGLISH, Field, FieldTracer, Wording, filled
from .functions.exceptions import RESPONSE as EXCEPTION_RESPONSE
from .functions.exceptions import exception_name
from .length_rules import Role
from .lengths import layout
from .limits import BROADCAST, CRC_SIZE, EXCEPTION, LAST_UNIT
from .registry import function as declared
from .registry import function_class, function_code, function_name
from .tracing import record

__all__ = ["Context", "Field", "annotate", "summary"]

_CHECK_WIDTH: Final = {"rtu": CRC_SIZE, "ascii": 1, "tcp": 0, "pdu": 0}


@dataclass(frozen=True, slots=True)
class Context:
    """What the conversation adds: `request` is the PDU that a response answers."""

    request: bytes | None = None


def annotate(adu: Adu, role: Role, context: Context = Context(), wording: Wording = ENGLISH) -> tuple[Field, ...]:
    """Every field of a frame, in order; offsets are in `adu.data`. Never raises, whatever the bytes.

    Texts and problems are told in the context's words; names never are, and text that is the device's own stays.
    """
    data = adu.data
    head = header_fields(adu, wording)
    at = sum(field.length for field in head)
    end = at + len(adu.pdu)
    body = _pdu(data, at, end, role, context, wording) if at < end else ()
    return (*head, *body, *check_fields(adu, end, wording))


def summary(adu: Adu, role: Role, context: Context = Context(), wording: Wording = ENGLISH) -> str:
    """A frame in words, on one line: `read 3 holding registers from 107 (40108)`; the check value apart."""
    say = wording.say
    data = adu.data
    at = adu.pdu_at
    end = at + len(adu.pdu)
    if at >= end:
        return say("no function code")
    code = data[at]
    name = function_name(code)
    if code & EXCEPTION and role is Role.RESPONSE:
        if end - at < 2:
            return say("exception without a code to {name}").format(name=name)
        number = data[at + 1]
        return say("exception {code:02X} {name}").format(code=number, name=say(exception_name(number)))
    function = declared(code)
    if function is None or code & EXCEPTION:
        return say("{name}, {bytes} of data").format(name=name, bytes=wording.count(end - at - 1, "byte"))
    recorder = _recorder(data, at, end, role, context, wording, brief=True)
    declaration = function.request if role is Role.REQUEST else function.response
    _, problem = record(declaration, data[at + 1 : end], recorder)
    for template in function.words(role.name.lower()):
        text = filled(template, recorder.fields, wording)
        if text is not None:
            return text
    return f"{name} {say(role.name.lower())}{': ' + problem if problem else ''}"


def header_fields(adu: Adu, wording: Wording = ENGLISH) -> tuple[Field, ...]:
    """What stands before the PDU."""
    data = adu.data
    if adu.protocol != "tcp":
        return (_unit(data, 0, wording, serial=True),) if data[: adu.pdu_at] else ()
    fields: list[Field] = []
    for name, at, end in (("transaction", 0, 2), ("protocol_id", 2, 4), ("length", 4, 6)):
        part = data[at:end]
        if not part:
            return tuple(fields)
        if len(part) < 2:
            problem = Short(2, 1).told(wording)
            fields.append(Field(name, at, 1, part.hex(), part.hex(), part.hex(), problem=problem))
            return tuple(fields)
        value = int.from_bytes(part, "big")
        problem = ""
        if name == "protocol_id" and value:
            problem = wording.say("0 is Modbus, anything else is not")
        elif name == "length" and value != len(data) - end:
            due = wording.count(value, "byte")
            problem = wording.fill_template("{due} should follow, {there} do", due=due, there=len(data) - end)
        fields.append(Field(name, at, 2, value, part.hex(), str(value), problem=problem or None))
    if len(data) >= MBAP:
        fields.append(_unit(data, MBAP - 1, wording, serial=False))
    return tuple(fields)


def _unit(data: bytes, at: int, wording: Wording, *, serial: bool) -> Field:
    unit = data[at]
    text, problem = str(unit), None
    if serial and unit == BROADCAST:
        text = wording.say("0 (broadcast)")
    elif serial and unit > LAST_UNIT:
        problem = wording.say("units 248 to 255 are reserved")
    return Field("unit", at, 1, unit, f"{unit:02x}", text, problem=problem)


def function_field(data: bytes, at: int, role: Role, wording: Wording = ENGLISH) -> Field:
    """The function code's field, which is at `at`."""
    code = data[at]
    raw = f"{code:02x}"
    kind = function_class(code)
    text = f"{function_code(code)} {function_name(code)}"
    if code & EXCEPTION and role is Role.RESPONSE:
        parts = (
            Field("exception_flag", at, 1, True, raw, wording.say("exception"), 7, 1),
            Field("function_code", at, 1, code & ~EXCEPTION, raw, text, 0, 7),
        )
        text = wording.fill_template("exception to {function}", function=text)
        return Field("function", at, 1, code, raw, text, fields=parts)
    problem = None
    if code & EXCEPTION:
        text, problem = f"0x{code:02X}", wording.say("function codes of requests are 1 to 127")
    elif kind == "invalid":
        problem = wording.say("function codes are 1 to 127")
    return Field("function", at, 1, code, raw, text, problem=problem)


def _pdu(data: bytes, at: int, end: int, role: Role, context: Context, wording: Wording) -> tuple[Field, ...]:
    """The fields of the PDU from `at` to `end`."""
    head = function_field(data, at, role, wording)
    code = data[at]
    function = declared(code)
    begin = at + 1
    exception = bool(code & EXCEPTION)
    recorder = _recorder(data, at, end, role, context, wording)
    if (role is Role.REQUEST) if exception else (function is None):
        rest = data[begin:end]
        return (head, opaque("data", 0, len(rest), rest, recorder)) if rest else (head,)
    if exception or function is None:
        declaration: AnyConstruct = EXCEPTION_RESPONSE
    else:
        declaration = function.request if role is Role.REQUEST else function.response
    reached, problem = record(declaration, data[begin:end], recorder)
    fields = [head, *_tiled(recorder, begin, begin + reached if problem is None else end, end)]
    if problem is not None and not any(field.problem for field in fields):
        # Nothing of the part that failed is there to carry the problem: the last field that is there does.
        fields[-1] = replace(fields[-1], problem=wording.fill_template("after this, {problem}", problem=problem))
    return tuple(fields)


def _recorder(
    data: bytes, at: int, end: int, role: Role, context: Context, wording: Wording, *, brief: bool = False
) -> FieldTracer:
    code = data[at]
    request: Mapping[str, int] = {}
    echoes: tuple[str, ...] = ()
    asked = context.request
    if role is Role.RESPONSE and asked and asked[0] == code:
        request = {
            name: int.from_bytes(asked[offset : offset + width], "big")
            for name, (offset, width) in layout(code, Role.REQUEST).items()
            if offset + width <= len(asked)
        }
        function = declared(code)
        echoes = function.echoes if function is not None else ()
    return FieldTracer(data, at + 1, end, brief, request, echoes, wording)


def _tiled(recorder: FieldTracer, begin: int, reached: int, end: int) -> Iterator[Field]:
    """The recorded fields with nothing between them left out: what no field covers is opaque."""
    at = begin
    for field in recorder.fields:
        if field.start < at or field.start + field.length > end:
            continue  # a look ahead or back: its bytes belong to another field
        if field.start > at:
            yield _gap("unnamed", at, field.start, recorder)
        at = field.start + field.length
        yield field
    if at < reached:
        yield _gap("unnamed", at, reached, recorder)
        at = reached
    if at < end:
        left = recorder.wording.count(end - at, "byte")
        problem = recorder.wording.fill_template("{bytes} more than the frame's fields take", bytes=left)
        yield _gap("surplus", at, end, recorder, problem)


def _gap(name: str, at: int, end: int, recorder: FieldTracer, problem: str | None = None) -> Field:
    return opaque(name, at - recorder.offset, end - at, recorder.data[at:end], recorder, problem)


def check_fields(adu: Adu, at: int, wording: Wording = ENGLISH) -> tuple[Field, ...]:
    """The check value's field, which is at `at`; TCP has none."""
    say = wording.say
    width = _CHECK_WIDTH[adu.protocol]
    if not width or not adu.data:
        return ()
    name = "crc" if adu.protocol == "rtu" else "lrc"
    if adu.check_received is None and at < len(adu.data):
        raw = adu.data[at:].hex()
        problem = say("cut: half of it is there")
        return (Field(name, at, len(adu.data) - at, None, raw, f"{raw.upper()} …", problem=problem),)
    if adu.check_received is None or adu.check_computed is None:
        problem = wording.fill_template("{bytes} can't hold a frame", bytes=wording.count(at, "byte"))
        return (Field(name, at, 0, None, "", say("missing"), problem=problem),)
    raw = adu.data[at:].hex()
    if adu.check_ok:
        return (Field(name, at, width, adu.check_received, raw, say("ok")),)
    due = adu.check_computed.to_bytes(width, "little").hex(" ").upper()
    there = adu.data[at:].hex(" ").upper()
    text = wording.fill_template("wrong: {there}, should be {due}", due=due, there=there)
    return (
        Field(
            name, at, width, adu.check_received, raw, text, problem=wording.fill_template("{due} is correct", due=due)
        ),
    )
