"""A field: a stretch of a frame with its name, its value and what to say of it, in words of whatever language.

Fields form a tree. Offsets are in the ADU's bytes (`Adu.data`). Top-level fields tile the ADU; children lie inside
their parent. Where bits are meant, `bit` is the lowest one, counted from the least significant bit of the field's
bytes read as one big-endian number, and `bits` says how many.

Frames are told in English here; whoever tells them otherwise hands over words of the same kind.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Final


def plural(number: int, noun: str) -> str:
    """`1 coil`, `3 coils`."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


@dataclass(frozen=True, slots=True)
class Wording:
    """`say` gives words, or a template with the same places, by its English; `count` so many of a noun."""

    say: Callable[[str], str] = str
    count: Callable[[int, str], str] = plural

    def fill_template(self, template: str, /, **numbers: object) -> str:
        """A template by its English, filled."""
        return self.say(template).format_map(numbers)


ENGLISH: Final = Wording()


Value = int | float | str | bool | None


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a frame.

    `value` is a number, truth value or text as JSON has them (opaque bytes: their hex; fields that only hold other
    fields: None); `raw` is the hex of its bytes; `text` is for people; `problem` is what breaks the specification.
    `address` is the physical address of a register, coil or input, where it is known.
    """

    name: str
    start: int
    length: int
    value: Value
    raw: str
    text: str
    bit: int | None = None
    bits: int | None = None
    fields: tuple[Field, ...] = ()
    problem: str | None = None
    address: int | None = None

    def to_json(self) -> dict[str, object]:
        """The field as the JSON object that exports write; keys that say nothing are left out."""
        line: dict[str, object] = {
            "name": self.name,
            "start": self.start,
            "length": self.length,
            "value": self.value,
            "raw": self.raw,
            "text": self.text,
        }
        if self.bit is not None:
            line["bit"] = self.bit
            line["bits"] = self.bits
        if self.address is not None:
            line["address"] = self.address
        if self.problem is not None:
            line["problem"] = self.problem
        if self.fields:
            line["fields"] = [field.to_json() for field in self.fields]
        return line


# What is seen while a declaration reads bytes: values by name so far, fields so far, and what the request said.


@dataclass(slots=True)
class FieldTracer:
    """The state of one reading.

    `data` is the ADU, `offset` and `end` where in it the declared part begins and ends. `brief` asks for the
    short texts of a summary and no children of long blocks. `request` holds the numbers of the request that is
    answered, by name; `echoes` names those that the response must repeat. `wording` is what texts and problems are told
    in.
    """

    data: bytes
    offset: int
    end: int
    brief: bool = False
    request: Mapping[str, int] = field(default_factory=dict)
    echoes: tuple[str, ...] = ()
    wording: Wording = ENGLISH
    values: dict[str, object] = field(default_factory=dict)
    fields: list[Field] = field(default_factory=list)

    def number(self, name: str | None) -> int | None:
        """A number by name: of this PDU, else of the request."""
        if name is None:
            return None
        value = self.values.get(name)
        if value is None:
            value = self.request.get(name)
        return value if isinstance(value, int) else None

    def make(
        self,
        name: str,
        start: int,
        length: int,
        value: Value,
        text: str,
        fields: tuple[Field, ...] = (),
        problem: str | None = None,
    ) -> Field:
        """A field by its place in the declared part."""
        at = self.offset + start
        raw = self.data[at : at + length].hex()
        return Field(name, at, length, value, raw, text, None, None, fields, problem)


# Templates of summaries: `read {quantity:coil} from {starting_address}`.
#
# `{name}` is a field's text; `{name:noun}` its number with the noun, in the plural where it takes one.


class _Word:
    def __init__(self, field: Field, wording: Wording) -> None:
        self.field = field
        self.wording = wording

    def __format__(self, noun: str) -> str:
        if not noun:
            return self.wording.say(self.field.text)
        value = self.field.value
        if not isinstance(value, int):
            return f"{self.field.text} {self.wording.say(noun)}"
        return self.wording.count(value, noun)


def filled(template: str, fields: Iterable[Field], wording: Wording = ENGLISH) -> str | None:
    """The template with its fields put in; None where one is missing (or the template is empty)."""
    if not template:
        return None
    try:
        return wording.say(template).format_map({field.name: _Word(field, wording) for field in fields})
    except (LookupError, AttributeError, ValueError):
        return None
