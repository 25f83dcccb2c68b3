"""Protobuf messages of one constant layout, declared once: the schema in the file and the bytes both follow from it.

A message whose fields all have a fixed width, and which writes every field, is the same bytes but for the values. So
its tags are constants of a numpy dtype, and a million messages are filled in as columns. A field that a message lacks
gives its place to a number of the same width that no schema declares (`SPARE`), which readers skip by protobuf's rules;
so such a field is absent, not 0. A text or bytes field may stand last: its length is a varint of four bytes, the longer
ones padded, which readers accept too.

    POINT = Message("test.Point", (Field("x", Type.DOUBLE), Field("y", Type.DOUBLE, optional=True)))
    rows = np.repeat(POINT.layout(), 3)
    rows["x"] = 1, 2, 3
    POINT.put(rows, "y", (5, 0, 7), present=np.array([True, False, True]))
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from functools import cache, cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

ENCODING: Final = "protobuf"
SPARE: Final = (15, 2047)  # numbers of no field, with a tag of one and of two bytes
_NUMBERS: Final = tuple(number for number in range(1, SPARE[1]) if number not in SPARE)
_PLAIN_NUMBERS: Final = range(SPARE[0] + 1, SPARE[1])
PLAIN: Final = len(_PLAIN_NUMBERS)
_OPTIONAL, _REPEATED = 1, 3


class Type(IntEnum):
    """Types of fields, by their numbers in a descriptor."""

    DOUBLE = 1
    FLOAT = 2
    FIXED64 = 6
    FIXED32 = 7
    BOOL = 8
    STRING = 9
    BYTES = 12
    ENUM = 14
    SFIXED32 = 15
    SFIXED64 = 16


# Type: wire type, numpy type of the value. An enum has values up to 127: a varint of one byte.
_WIRE: Final[dict[Type, tuple[int, str]]] = {
    Type.DOUBLE: (1, "<f8"),
    Type.FLOAT: (5, "<f4"),
    Type.FIXED64: (1, "<u8"),
    Type.FIXED32: (5, "<u4"),
    Type.BOOL: (0, "u1"),
    Type.STRING: (2, "<u4"),
    Type.BYTES: (2, "<u4"),
    Type.ENUM: (0, "u1"),
    Type.SFIXED32: (5, "<i4"),
    Type.SFIXED64: (1, "<i8"),
}


@dataclass(frozen=True, slots=True)
class MessageField:
    """One field; `names` are the values of an enum by name, `repeated` is for schemas only, not for rows."""

    name: str
    type: Type
    optional: bool = False
    repeated: bool = False
    names: Mapping[str, int] | None = None


@dataclass(frozen=True)
class Message:
    """A message type by its full name, `package.Name`, with its fields in the order in which rows have them."""

    name: str
    fields: tuple[MessageField, ...]

    @cached_property
    def numbers(self) -> dict[str, int]:
        """The number of each field: 1, 2, 3 ... without the spare ones."""
        return {field.name: number for field, number in zip(self.fields, _NUMBERS, strict=False)}

    def schema(self) -> bytes:
        """A serialised FileDescriptorSet, as MCAP wants it for the schema encoding "protobuf"."""
        parts: list[bytes] = []
        choices = 0
        for field in self.fields:
            parts.append(delimited(2, self._field(field, choices)))
            choices += field.optional
        for field in self.fields:
            if field.names is not None and self._enum_of(field) is field:
                parts.append(delimited(4, _enum(_type_name(field), field.names)))
        parts += [delimited(8, text_field(1, f"_{field.name}")) for field in self.fields if field.optional]
        return _file(self.name, b"".join(parts))

    def _field(self, field: MessageField, choice: int) -> bytes:
        name = field.name.encode()
        parts = [delimited(1, name), _kind(self.numbers[field.name], field.repeated, field.type)]
        if b"_" in name:
            parts.append(delimited(10, name))  # the name in JSON, which would else be in camel case
        if field.names is not None:
            parts.append(text_field(6, f".{self.name}.{_type_name(self._enum_of(field))}"))
        if field.optional:
            parts += [varint_field(9, choice), varint_field(17, 1)]
        return b"".join(parts)

    def _enum_of(self, field: MessageField) -> MessageField:
        """The first field with the same enum, which gives it its name: a message can't have a value's name twice."""
        return next(sibling for sibling in self.fields if sibling.names == field.names)

    def layout(self, head: np.dtype[np.void] | None = None, without: Collection[str] = ()) -> NDArray[np.void]:
        """One row with all tags set and all values 0, behind a field `record` of type `head`; `np.repeat` makes many.

        Fields named in `without` are left out, which reads as 0, or as absent where they are optional.
        """
        parts: list[tuple[str, Any]] = [] if head is None else [("record", head)]
        fields = [field for field in self.fields if field.name not in without]
        for field in fields:
            width = len(_varint(self._tags[field.name]))
            parts += [(tag_of(field.name), f"<u{width}"), (field.name, _WIRE[field.type][1])]
        row = np.zeros(1, parts)
        for field in fields:
            row[tag_of(field.name)] = tag_bytes(self._tags[field.name])
        return row

    @cached_property
    def _tags(self) -> dict[str, int]:
        return {field.name: self.numbers[field.name] << 3 | _WIRE[field.type][0] for field in self.fields}

    def put(self, rows: NDArray[np.void], name: str, values: ArrayLike, *, present: NDArray[np.bool_]) -> None:
        """Values of an optional field, in those rows that have it."""
        tag = self._tags[name]
        spare = SPARE[tag > 0x7F] << 3 | tag & 7
        rows[name] = values
        rows[tag_of(name)] = np.where(present, tag_bytes(tag), tag_bytes(spare))


def plain_schema(name: str, fields: Iterable[str], kind: Type) -> bytes:
    """The schema of a message whose fields are all of one type, any of which it may lack; ASCII names of up to 100
    letters, no underscores.

    An export makes many of these, with up to `PLAIN` fields each, so no object a field is made. Their numbers begin
    with 16, so that all tags have two bytes: `plain_items` are such fields.
    """
    parts, choices = [], []
    for field, rest in zip(fields, _plain_kinds(kind), strict=False):
        parts.append(f"\x12{chr(len(field) + len(rest) + 2)}\n{chr(len(field))}{field}{rest}")
        choices.append(f"\x42{chr(len(field) + 3)}\n{chr(len(field) + 1)}_{field}")
    return _file(name, "".join((*parts, *choices)).encode("latin-1"))


def plain_items(kind: Type, places: NDArray[Any], values: NDArray[Any]) -> NDArray[np.void]:
    """Fields of such messages, all of one width: `places` in the message, 0 for its first field, and values."""
    items = np.empty(len(places), [("tag", "<u2"), ("value", _WIRE[kind][1])])
    items["tag"] = _plain_tags(kind).take(places)
    items["value"] = values
    return items


def tag_of(name: str) -> str:
    """The name of the column that holds a field's tag."""
    return f"#{name}"


def tag_bytes(tag: int) -> int:
    """The little-endian number whose bytes are this tag's varint."""
    return int.from_bytes(_varint(tag), "little")


def packed_length(sizes: ArrayLike) -> NDArray[np.uint32]:
    """Lengths under 2^28 as varints of four bytes each, in little-endian numbers."""
    n = np.asarray(sizes, np.uint32)
    low, high = n & 0x7F | (n << 1 & 0x7F00), n << 2 & 0x7F0000 | (n << 3 & 0x7F000000)
    return (low | high | 0x808080).astype(np.uint32, copy=False)


def delimited(number: int, content: bytes | memoryview) -> bytes:
    """A field of text, bytes, packed numbers or a message."""
    size = len(content)
    head = bytes((number << 3 | 2, size)) if number < 16 and size < 0x80 else _varint(number << 3 | 2) + _varint(size)
    return head + content


def fields_in(message: bytes | memoryview) -> Iterable[tuple[int, int | bytes | memoryview]]:
    """(number, value) of each field of a serialised message; ValueError where it is none.

    Fixed widths come as unsigned numbers, what has a length as a view of the message.
    """
    view, at, end = memoryview(message), 0, len(message)
    while at < end:
        tag, at = _read_varint(view, at)
        wire = tag & 7
        if wire == 0:
            value, at = _read_varint(view, at)
            yield tag >> 3, value
            continue
        if wire == 2:
            size, at = _read_varint(view, at)
        elif wire in (1, 5):
            size = 8 if wire == 1 else 4
        else:
            raise ValueError(f"wire type {wire} is not used")
        if at + size > end:
            raise ValueError("a field reaches past the message's end")
        content = view[at : at + size]
        yield tag >> 3, content if wire == 2 else int.from_bytes(content, "little")
        at += size


def _read_varint(view: memoryview, at: int) -> tuple[int, int]:
    value = shift = 0
    while at < len(view) and shift < 70:
        byte = view[at]
        value |= (byte & 0x7F) << shift
        at += 1
        if byte < 0x80:
            return value, at
        shift += 7
    raise ValueError("a number is cut short")


def _kind(number: int, repeated: bool, type: Type) -> bytes:
    """What a descriptor says of a field beside its name."""
    return varint_field(3, number) + varint_field(4, _REPEATED if repeated else _OPTIONAL) + varint_field(5, type)


@cache
def _plain_kinds(type: Type) -> tuple[str, ...]:
    """The same of plain fields, by their places in the message; a letter a byte. Thousands of schemas say it."""
    rest = varint_field(4, _OPTIONAL) + varint_field(5, type) + varint_field(17, 1)
    return tuple(
        (varint_field(3, number) + rest + varint_field(9, choice)).decode("latin-1")
        for choice, number in enumerate(_PLAIN_NUMBERS)
    )


@cache
def _plain_tags(type: Type) -> NDArray[np.uint16]:
    tags = np.array(_PLAIN_NUMBERS) << 3 | _WIRE[type][0]
    return (tags & 0x7F | 0x80 | tags >> 7 << 8).astype(np.uint16)  # varints of two bytes


def _file(name: str, content: bytes) -> bytes:
    """A set of one file with one message type, of which `content` says all but its name and its reserved numbers."""
    package, _, own = name.rpartition(".")
    parts = (
        text_field(1, f"{name.replace('.', '/')}.proto"),
        text_field(2, package),
        delimited(4, text_field(1, own) + content + _RESERVED),
        text_field(12, "proto3"),
    )
    return delimited(1, b"".join(parts))


def _enum(name: str, names: Mapping[str, int]) -> bytes:
    values = (delimited(2, text_field(1, key) + varint_field(2, value)) for key, value in names.items())
    return text_field(1, name) + b"".join(values)


def _type_name(field: MessageField) -> str:
    return "".join(word.capitalize() for word in field.name.split("_"))


def _varint(value: int) -> bytes:
    found = bytearray()
    while value > 0x7F:
        found.append(value & 0x7F | 0x80)
        value >>= 7
    found.append(value)
    return bytes(found)


def varint_field(number: int, value: int) -> bytes:
    """A whole number, not negative, as a field."""
    return _varint(number << 3) + _varint(value)


def text_field(number: int, text: str) -> bytes:
    """A string as a field; what UTF-8 has no bytes for is a question mark."""
    return delimited(number, text.encode("utf-8", "replace"))


_RESERVED: Final = b"".join(delimited(9, varint_field(1, spare) + varint_field(2, spare + 1)) for spare in SPARE)
