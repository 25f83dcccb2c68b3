"""A declaration made to tell what it reads: each named part is wrapped in one that adds a field to the recorder.

The wrapped copy reads as the declaration does, in whatever way construct combines parts; places come from the stream
(construct's substreams know theirs). When a part fails, what there is of it is recorded with the problem and the
failure goes on, so that a damaged frame gives all fields up to the damage.
"""

from __future__ import annotations

import io
import math
from dataclasses import replace
from functools import lru_cache
from typing import Any, Final

import construct

from .blocks import Variant, opaque
from .declaration import AnyConstruct, AnySubconstruct, Number, Part, Short
from .fields import Field, FieldTracer, Value, Wording, filled
from .length_rules import rebuilt
from .values import harmless

_TRIALS: Final = (construct.GreedyRange, construct.Select, construct.Peek)
_RECORDER: Final = "recorder"


def record(declaration: AnyConstruct, data: bytes, recorder: FieldTracer) -> tuple[int, str | None]:
    """Reads `data` by a declaration into the recorder's fields; returns how far it came and what stopped it."""
    stream = io.BytesIO(data)
    problem = None
    try:
        _telling(declaration).parse_stream(stream, recorder=recorder)
    except construct.ConstructError as error:
        problem = _message(error, recorder.wording)
    except Exception as error:  # a user's declaration may fail in any way on bytes that it was not made for
        why = f"{type(error).__name__}: {error}"
        problem = recorder.wording.fill_template("the declaration failed: {why}", why=why)
    return min(stream.tell(), len(data)), problem


@lru_cache(maxsize=1024)
def _telling(declaration: AnyConstruct) -> AnyConstruct:
    return rebuilt(declaration, _hook)


def _hook(con: AnyConstruct) -> AnyConstruct | None:
    if isinstance(con, construct.Renamed):
        inner: AnyConstruct = con
        while isinstance(inner, construct.Renamed):
            inner = inner.subcon
        return _named(str(con.name), inner)
    if isinstance(con, _TRIALS):
        return _tried(con)
    return None


def _named(name: str, inner: AnyConstruct) -> AnyConstruct:
    if isinstance(inner, Variant):
        return construct.Renamed(rebuilt(inner, _hook), name)
    if isinstance(inner, construct.Switch | construct.IfThenElse):
        chosen = rebuilt(inner, lambda con: None if con is inner else _hook_case(name, con))
        return construct.Renamed(chosen, name)
    traced = rebuilt(inner, _hook)
    return _Leaf(name, inner) if traced is inner else _Level(name, traced)


def _hook_case(name: str, case: AnyConstruct) -> AnyConstruct:
    return case if case is construct.Pass else _named(name, case)


def _tried(con: Any) -> AnyConstruct:
    """A construct that tries and takes back: fields of what it took back go too."""
    return rebuilt(con, lambda part: None if part is con else _trial(part))


def _trial(part: AnyConstruct) -> AnyConstruct:
    traced = rebuilt(part, _hook)
    return part if traced is part else _Trial(traced)


class _Trial(AnySubconstruct):
    def _parse(self, stream: Any, context: Any, path: str) -> Any:
        fields = context["_params"][_RECORDER].fields
        before = len(fields)
        try:
            return self.subcon._parsereport(stream, context, path)
        except Exception:
            del fields[before:]
            raise


class _Leaf(AnySubconstruct):
    """A named part that holds no named parts."""

    def __init__(self, name: str, subcon: AnyConstruct) -> None:
        super().__init__(subcon)
        self.name = self.label = name
        self.part = subcon if isinstance(subcon, Part) else None

    def _parse(self, stream: Any, context: Any, path: str) -> Any:
        tracer: FieldTracer = context["_params"][_RECORDER]
        start = stream.tell()
        try:
            value = self.subcon._parsereport(stream, context, path)
        except construct.StopFieldError:
            raise
        except Exception as error:
            self._broken(start, error, tracer)
            raise
        name = self.label
        length = stream.tell() - start
        if self.part is not None:
            field = self.part.describe(name, start, length, value, tracer)
        else:
            field = foreign(self.subcon, name, start, length, value, tracer)
        tracer.values[name] = value
        field = echoed(field, self.subcon, value, tracer)
        tracer.fields.append(field)
        return value

    def _broken(self, start: int, error: Exception, tracer: FieldTracer) -> None:
        """What there is of a part that failed."""
        data = tracer.data[tracer.offset + start : tracer.end]
        if not data:
            return
        problem = _message(error, tracer.wording)
        if isinstance(error, Short) and error.value is not None and self.part is not None:
            field = self.part.describe(self.label, start, len(data), error.value, tracer)
            tracer.fields.append(replace(field, problem=problem))
        else:
            tracer.fields.append(opaque(self.label, start, len(data), data, tracer, problem))


def echoed(field: Field, part: AnyConstruct, value: Any, tracer: FieldTracer) -> Field:
    """A field of that value, held to what the request has in its place."""
    if field.name not in tracer.echoes or field.problem is not None:
        return field
    requested = tracer.request.get(field.name)
    if requested is None or requested == value:
        return field
    asked = part.told(requested, tracer.wording) if isinstance(part, Number) else requested
    return replace(field, problem=tracer.wording.fill_template("the request has {value}", value=asked))


class _Level(AnySubconstruct):
    """A named part that holds named parts."""

    def __init__(self, name: str, subcon: AnyConstruct) -> None:
        super().__init__(subcon)
        self.name = self.label = name

    def _parse(self, stream: Any, context: Any, path: str) -> Any:
        tracer: FieldTracer = context["_params"][_RECORDER]
        start = stream.tell()
        outer = tracer.fields
        tracer.fields = []
        value = None
        failed = True
        try:
            value = self.subcon._parsereport(stream, context, path)
            failed = False
        finally:
            inner = tuple(tracer.fields)
            tracer.fields = outer
            end = max((child.start + child.length - tracer.offset for child in inner), default=start)
            if not failed:
                end = max(end, stream.tell())
            if not failed or inner:
                words = filled(getattr(self.subcon, "words", ""), inner, tracer.wording) or ", ".join(
                    c.text for c in inner
                )
                problem = None
                if failed:
                    problem = tracer.wording.say("incomplete")
                elif isinstance(self.subcon, Part):
                    problem = self.subcon.problem(value, end - start, tracer)
                tracer.fields.append(tracer.make(self.label, start, end - start, None, words, inner, problem))
        return value


def foreign(con: Any, name: str, start: int, length: int, value: Any, tracer: FieldTracer) -> Field:
    """The field of a construct from elsewhere: its value as it is, lists by element, bit structures by bits."""
    raw = tracer.data[tracer.offset + start : tracer.offset + start + length]
    element = getattr(con, "subcon", None)
    if isinstance(value, list) and value and isinstance(element, construct.Construct) and length % len(value) == 0:
        each = length // len(value)
        children = [
            foreign(element, f"{name}[{i}]", start + i * each, each, item, tracer) for i, item in enumerate(value)
        ]
        return tracer.make(name, start, length, None, " ".join(c.text for c in children), tuple(children))
    if isinstance(value, dict):
        children = list(_bit_fields(con, value, name, start, length, tracer))
        text = ", ".join(f"{key} {_json_value(item)[1]}" for key, item in value.items() if not str(key).startswith("_"))
        return tracer.make(name, start, length, None, text, tuple(children))
    if isinstance(value, bytes):
        return opaque(name, start, length, raw, tracer)
    plain, text = _json_value(value)
    return tracer.make(name, start, length, plain, text)


def _bit_fields(
    con: Any, value: dict[str, Any], name: str, start: int, length: int, tracer: FieldTracer
) -> list[Field]:
    """The fields of a BitStruct, whose places are bits from the most significant on."""
    inner = getattr(con, "subcon", None)
    if not isinstance(con, construct.Transformed) or not isinstance(inner, construct.Struct):
        return []
    fields = []
    left = 8 * length
    for part in inner.subcons:
        try:
            width = part.sizeof()
        except construct.ConstructError:
            return []
        left -= width
        if part.name and part.name in value:
            plain, text = _json_value(value[part.name])
            field = tracer.make(name, start, length, plain, text)
            fields.append(Field(part.name, field.start, length, plain, field.raw, text, left, width))
    return fields


def _json_value(value: Any) -> tuple[Value, str]:
    """A foreign value as JSON has it, and its text."""
    number = getattr(value, "intvalue", None)
    if isinstance(number, int):  # construct's Enum: a name that knows its number
        return number, harmless(str(value))
    if isinstance(value, bool) or value is None:
        return value, {True: "yes", False: "no", None: ""}[value]
    if isinstance(value, int):
        return int(value), str(int(value))
    if isinstance(value, float):
        return (value if math.isfinite(value) else None), f"{value:.7g}"
    if isinstance(value, bytes):
        return value.hex(), value.hex(" ")
    text = harmless(str(value))
    return text, text


def _message(error: Exception, wording: Wording) -> str:
    """What went wrong, on one line, without construct's path."""
    if isinstance(error, Short):
        return error.told(wording)
    text = str(error.args[0]) if isinstance(error, construct.ConstructError) and error.args else str(error)
    text = text.split("\n")[0] if not text.startswith("Error in path") else text.split("\n", 1)[-1].split("\n")[0]
    return harmless(text) or type(error).__name__
