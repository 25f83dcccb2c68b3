"""A function of the protocol as one declaration: what its request and its response hold, and how people say it.

Everything else follows from it: predicted lengths, plausibility, what a response must repeat, annotation, summaries.
`request` and `response` are constructs of the data after the function code; the parts here and in `dissectors.blocks`
carry limits and words, any other construct works too and just has less to say. A vendor's function is declared the same
way, in a file or a package of the user's own:

    from construct import Float32b, Struct
    from dissectors import Function, Number

    TREND = Function(
        0x41, "Read Trend", request=Struct("channel" / Number(1)), response=Struct("level" / Float32b),
        request_words="read the trend of channel {channel}",
    )

The length rules walk a declaration for sizes, counts and checks; the annotation reads through it and asks each part to
describe what it read. Numbers are big-endian and unsigned, as the specification's are ([1] 4.2).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from string import Formatter
from typing import TYPE_CHECKING, Any, Final, Literal

import construct

from .fields import ENGLISH, Field, FieldTracer, Wording
from .limits import Bound, Check, Choice, Multiple, taken
from .values import Area, hexadecimal, logical, signed
from .values import bits as bit_text

if TYPE_CHECKING:
    AnyConstruct = construct.Construct[Any, Any]
    AnySubconstruct = construct.Subconstruct[Any, Any, Any, Any]
else:
    AnyConstruct = construct.Construct
    AnySubconstruct = construct.Subconstruct

Width = Literal[1, 2]


class Short(construct.StreamError):
    """A part that the bytes end in; `value` is what there was of it."""

    def __init__(self, wanted: int, there: int, value: object = None) -> None:
        self.wanted = wanted
        self.there = there
        self.value = value
        super().__init__(self.told(ENGLISH))

    def told(self, wording: Wording) -> str:
        """How many bytes are missing."""
        if self.wanted == 1:
            return wording.say("1 byte expected, none found")
        words = "{wanted} expected, 1 found" if self.there == 1 else "{wanted} expected, {there} found"
        return wording.fill_template(words, wanted=wording.count(self.wanted, "byte"), there=self.there)


class Part(AnyConstruct):
    """A construct that describes what it read."""

    @property
    def looks_at(self) -> tuple[str, ...] | None:
        """Numbers, by name, on which `describe` hangs beside the part's own bytes; None where only it can know.

        A part that overrides `describe` or `problem` says it anew, see `dependencies`.
        """
        return None

    def describe(self, name: str, start: int, length: int, value: Any, tracer: FieldTracer) -> Field:
        """The field of a value that was read from `length` bytes at `start` of the declared part."""
        return tracer.make(name, start, length, value, str(value))

    def problem(self, value: Any, length: int, tracer: FieldTracer) -> str | None:  # noqa: ARG002
        """What breaks the specification here, or None."""
        return None


class Number(Part):
    """A number of 1 or 2 bytes; `noun` follows it in words (`12 bus messages`)."""

    def __init__(self, width: Width = 2, *checks: Check, noun: str = "") -> None:
        super().__init__()
        self.width: int = width
        self.checks = tuple(replace(check, width=width) for check in checks)
        self.noun = noun

    @property
    def looks_at(self) -> tuple[str, ...]:
        return ()

    def _parse(self, stream: Any, context: Any, path: str) -> int:  # noqa: ARG002
        data = stream.read(self.width)
        if len(data) < self.width:
            raise Short(self.width, len(data))
        return int.from_bytes(data, "big")

    def _build(self, obj: Any, stream: Any, context: Any, path: str) -> Any:  # noqa: ARG002
        try:
            stream.write(obj.to_bytes(self.width, "big"))
        except (AttributeError, OverflowError) as error:
            raise construct.IntegerError(f"{obj!r} does not fit {self.width} bytes", path=path) from error
        return obj

    def _sizeof(self, context: Any, path: str) -> int:  # noqa: ARG002
        return self.width

    def describe(self, name: str, start: int, length: int, value: int, tracer: FieldTracer) -> Field:
        at = tracer.offset + start
        raw = tracer.data[at : at + length].hex()
        if tracer.brief and (brief := self.brief(value)) != self.text(value):
            text = tracer.wording.say(brief)
        else:
            text = self.told(value, tracer.wording)
        return Field(name, at, length, value, raw, text, None, None, (), self.problem(value, length, tracer))

    def problem(self, value: int, length: int, tracer: FieldTracer) -> str | None:  # noqa: ARG002
        for check in self.checks:
            if (broken := check.broken(value, tracer.wording)) is not None:
                return broken
        return None

    def text(self, value: int) -> str:
        """The value for people."""
        return f"{value} {self.noun}" if self.noun else str(value)

    def told(self, value: int, wording: Wording) -> str:
        """The value for people, in words of theirs."""
        return f"{value} {wording.say(self.noun)}" if self.noun else wording.say(self.text(value))

    def brief(self, value: int) -> str:
        """The value in a summary."""
        return self.text(value)


class Quantity(Number):
    """How many bits or registers: the specification's limits, which real frames do break."""

    def __init__(self, low: int, high: int) -> None:
        super().__init__(2, Bound(0, 2, low, high))


class Address(Number):
    """A physical address; with an area, it has a logical number too."""

    def __init__(self, area: Area | None = None) -> None:
        super().__init__(2)
        self.area = area

    def text(self, value: int) -> str:
        if self.area is None:
            return f"{value} (0x{value:04X})"
        return f"{value} (0x{value:04X}, {logical(value, self.area)})"

    def brief(self, value: int) -> str:
        return str(value) if self.area is None else f"{value} ({logical(value, self.area)})"


class ByteCount(Number):
    """How many bytes follow; `of` names the quantity, in this PDU or in the request, that they are for."""

    def __init__(
        self,
        low: int,
        high: int,
        *,
        width: Width = 1,
        multiple: int = 1,
        of: str | None = None,
        bits: bool = False,
    ) -> None:
        even = (Multiple(0, width, multiple),) if multiple > 1 else ()
        super().__init__(width, *even, Bound(0, width, low, high))
        self.of = of
        self.bits = bits

    @property
    def looks_at(self) -> tuple[str, ...]:
        return () if self.of is None else (self.of,)

    def problem(self, value: int, length: int, tracer: FieldTracer) -> str | None:
        quantity = tracer.number(self.of)
        if quantity is not None and value != taken(quantity, self.bits):
            here = "the quantity, {quantity}, takes {taken}, not {value}"
            asked = "the quantity of the request, {quantity}, takes {taken}, not {value}"
            due = tracer.wording.count(taken(quantity, self.bits), "byte")
            words = here if self.of in tracer.values else asked
            return tracer.wording.fill_template(words, quantity=quantity, taken=due, value=value)
        return super().problem(value, length, tracer)


class Register(Number):
    """A register's value."""

    def text(self, value: int) -> str:
        return register_text(value)

    def brief(self, value: int) -> str:
        return str(value)


class Mask(Number):
    """A 16-bit mask or device-specific register: its bits are what counts."""

    def text(self, value: int) -> str:
        return f"{hexadecimal(value)} ({bit_text(value)})"

    def brief(self, value: int) -> str:
        return hexadecimal(value)


class Code(Number):
    """A number that stands for something; `known` False lets other values pass without a remark."""

    def __init__(
        self,
        width: Width,
        words: Mapping[int, str],
        *,
        soft: bool = True,
        known: bool = True,
        checks: tuple[Check, ...] = (),
    ) -> None:
        choice = (Choice(0, width, tuple(words), soft),) if known else ()
        super().__init__(width, *choice, *checks)
        self.words = words

    def text(self, value: int) -> str:
        word = self.words.get(value)
        digits = f"{value:0{2 * self.width}X}"
        return f"{digits} {word}" if word else digits

    def told(self, value: int, wording: Wording) -> str:
        word = self.words.get(value)
        return self.text(value).replace(word, wording.say(word)) if word else self.text(value)

    def brief(self, value: int) -> str:
        return self.words.get(value) or self.text(value)


class State(Code):
    """A number that stands for a state, which alone is worth showing (`on`)."""

    def text(self, value: int) -> str:
        return self.words.get(value) or f"0x{value:0{2 * self.width}X}"


class Output(State):
    """What a coil is set to."""

    def __init__(self) -> None:
        super().__init__(2, {0xFF00: "on", 0x0000: "off"})


class Flags(Number):
    """A byte of single bits, each with a name."""

    def __init__(self, names: Mapping[int, str]) -> None:
        super().__init__(1)
        self.names = names

    @property
    def looks_at(self) -> tuple[str, ...]:
        return ()

    def describe(self, name: str, start: int, length: int, value: int, tracer: FieldTracer) -> Field:
        field = super().describe(name, start, length, value, tracer)
        return field if tracer.brief else replace(field, fields=flag_fields(field, value, self.names, tracer.wording))

    def text(self, value: int) -> str:
        return f"0x{value:02X} ({value:08b})"


def dependencies(part: Part) -> tuple[str, ...] | None:
    """What a part looks at; None where it describes in a way of its own and does not say."""
    for kind in type(part).__mro__:
        members = vars(kind)
        if "looks_at" in members:
            return part.looks_at
        if "describe" in members or "problem" in members:
            return None
    return None


def flag_fields(parent: Field, value: int, names: Mapping[int, str], wording: Wording = ENGLISH) -> tuple[Field, ...]:
    """A field for each named bit of a byte."""
    fields = []
    for bit, name in names.items():
        on = bool(value >> bit & 1)
        fields.append(Field(name, parent.start, 1, on, parent.raw, wording.say("yes" if on else "no"), bit, 1))
    return tuple(fields)


def register_text(value: int) -> str:
    """A register as unsigned, signed where that differs, and hexadecimal."""
    if value & 0x8000:
        return f"{value} ({signed(value)}, {hexadecimal(value)})"
    return f"{value} ({hexadecimal(value)})"


USER_DEFINED: Final = frozenset((*range(65, 73), *range(100, 111)))  # [1] 5
RESERVED: Final = frozenset((9, 10, 13, 14, 41, 42, 90, 91, 125, 126, 127))  # [1] annex A


class DeclarationError(Exception):
    """A declaration that cannot be used; the message names it (file and line, where it has them) and says why."""


@dataclass(frozen=True)
class Function:
    """The declaration of one function code.

    `clause` is where the specification has it, `area` the data that it works on. `echoes` names request fields that a
    response repeats. The words are templates of a summary: `{quantity:coil}` is `1 coil` or `3 coils`, `{name}` the
    field's short text. Of several templates the first that has all its fields is used.
    """

    code: int
    name: str
    request: AnyConstruct
    response: AnyConstruct
    clause: str = ""
    area: Area | None = None
    echoes: tuple[str, ...] = ()
    request_words: str | tuple[str, ...] = ()
    response_words: str | tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.code, int) or not 1 <= self.code <= 127:
            raise DeclarationError(f"function {self.name!r}: the code is {self.code!r}, but codes run from 1 to 127")
        for side in ("request", "response"):
            if not isinstance(getattr(self, side), construct.Construct):
                raise DeclarationError(f"function {self.code} {self.name!r}: the {side} is not a construct")
            try:
                for template in self.words(side):
                    list(Formatter().parse(template))
            except ValueError as error:
                raise DeclarationError(f"function {self.code} {self.name!r}: {side}_words: {error}") from error

    def words(self, side: str) -> tuple[str, ...]:
        """The templates of a side, `request` or `response`."""
        words = self.request_words if side == "request" else self.response_words
        return (words,) if isinstance(words, str) else words


def class_of(code: int) -> str:
    """The class of a function code that is not declared: user-defined, reserved, unassigned or invalid ([1] 5)."""
    if not 1 <= code <= 127:
        return "invalid"
    if code in USER_DEFINED:
        return "user-defined"
    return "reserved" if code in RESERVED else "unassigned"
