"""Blocks to build declarations from: parts whose length a count before them gives, or that go on to the end.

`count` is the name of the number that counts a block's bytes (times `scale`), `less` how many of those go to other
fields in between. A block that the bytes end in is described as far as it goes.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

import construct

from .declaration import AnyConstruct, Part, Short, register_text
from .fields import ENGLISH, Field, FieldTracer, Value, Wording
from .values import Area, device_text, is_text, logical

if TYPE_CHECKING:
    _Struct = construct.Struct
    _Switch = construct.Switch[Any, Any]
else:
    _Struct = construct.Struct
    _Switch = construct.Switch


class Counted(Part):
    """Bytes that a number before them counts."""

    def __init__(self, count: str, *, less: int = 0, scale: int = 1) -> None:
        super().__init__()
        self.count = count
        self.less = less
        self.scale = scale

    def _parse(self, stream: Any, context: Any, path: str) -> Any:  # noqa: ARG002
        wanted = max(0, context[self.count] * self.scale - self.less)
        data = stream.read(wanted)
        value = self.decoded(data)
        if len(data) < wanted:
            raise Short(wanted, len(data), value)
        return value

    def _build(self, obj: Any, stream: Any, context: Any, path: str) -> Any:  # noqa: ARG002
        stream.write(self.encoded(obj))
        return obj

    def decoded(self, data: bytes) -> Any:
        """The value of these bytes."""
        return data

    def encoded(self, value: Any) -> bytes:
        """The bytes of this value."""
        return bytes(value)


class Registers(Counted):
    """Registers; `start` names the address of the first, in this PDU or in the request."""

    shown: Final = 16  # in one line of text; the fields below it have them all

    def __init__(
        self,
        count: str,
        *,
        less: int = 0,
        scale: int = 1,
        start: str | None = None,
        area: Area | None = None,
        each: str = "register",
    ) -> None:
        super().__init__(count, less=less, scale=scale)
        self.start = start
        self.area: Area | None = area
        self.each = each

    def decoded(self, data: bytes) -> list[int]:
        n = len(data) // 2
        return list(struct.unpack(f">{n}H", data[: 2 * n]))

    def encoded(self, value: Sequence[int]) -> bytes:
        return struct.pack(f">{len(value)}H", *value)

    @property
    def looks_at(self) -> tuple[str, ...]:
        return () if self.start is None else (self.start,)

    def text(self, value: Sequence[int], wording: Wording = ENGLISH) -> str:
        """The registers on one line."""
        text = " ".join(map(self.digits, value[: self.shown]))
        return f"{text}{_in_all(len(value), wording)}" if len(value) > self.shown else text

    @staticmethod
    def digits(register: int) -> str:
        """One register in that line."""
        return str(register)

    def words(self, register: int) -> str:
        """One register, its address apart."""
        return register_text(register)

    def child(self, at: int, register: int, raw: str, address: int | None) -> Field:
        """The field of one register, at `at` in the ADU."""
        text = self.words(register)
        if address is not None:
            text = f"{logical(address, self.area) if self.area else address}: {text}"
        return Field(self.each, at, 2, register, raw, text, None, None, (), None, address)

    def describe(self, name: str, start: int, length: int, value: Sequence[int], tracer: FieldTracer) -> Field:
        text = self.text(value, tracer.wording)
        if tracer.brief:
            return tracer.make(name, start, length, len(value), text)
        first = tracer.number(self.start)
        at = tracer.offset + start
        raw = tracer.data[at : at + length].hex()
        children = [
            self.child(at + 2 * i, register, raw[4 * i : 4 * i + 4], _address(first, i))
            for i, register in enumerate(value)
        ]
        problem = None
        if length % 2:
            problem = tracer.wording.say("an odd number of bytes: the last is half a register")
            children.append(tracer.make("rest", start + length - 1, 1, raw[-2:], raw[-2:], problem=problem))
        return Field(name, at, length, None, raw, text, None, None, tuple(children), problem)


class Bits(Counted):
    """Coils or inputs, least significant bit first; `quantity` names how many, `start` the address of the first."""

    shown: Final = 64  # in one line of text

    def __init__(self, count: str, *, each: str, area: Area, start: str, quantity: str) -> None:
        super().__init__(count)
        self.each = each
        self.area: Area = area
        self.start = start
        self.quantity = quantity

    def decoded(self, data: bytes) -> list[bool]:
        return [bool(byte >> bit & 1) for byte in data for bit in range(8)]

    def encoded(self, value: Sequence[bool]) -> bytes:
        padded = [*value, *[False] * (-len(value) % 8)]
        return bytes(sum(padded[i + bit] << bit for bit in range(8)) for i in range(0, len(padded), 8))

    @property
    def looks_at(self) -> tuple[str, ...]:
        return self.start, self.quantity

    def text(self, value: Sequence[bool], wording: Wording = ENGLISH) -> str:
        """The bits on one line, those of a byte together."""
        digits = "".join("1" if on else "0" for on in value[: self.shown])
        text = " ".join(digits[i : i + 8] for i in range(0, len(digits), 8))
        return f"{text}{_in_all(len(value), wording)}" if len(value) > self.shown else text

    def child(self, at: int, on: bool, raw: str, bit: int, address: int | None, wording: Wording = ENGLISH) -> Field:
        """The field of one coil or input, in the byte at `at` in the ADU."""
        text = wording.say("on" if on else "off")
        if address is not None:
            text = f"{logical(address, self.area)}: {text}"
        return Field(self.each, at, 1, on, raw, text, bit, 1, (), None, address)

    def describe(self, name: str, start: int, length: int, value: Sequence[bool], tracer: FieldTracer) -> Field:
        quantity = tracer.number(self.quantity)
        n = len(value) if quantity is None else min(quantity, len(value))
        text = self.text(value[:n], tracer.wording)
        if tracer.brief:
            return tracer.make(name, start, length, n, text)
        first = tracer.number(self.start)
        at = tracer.offset + start
        raw = tracer.data[at : at + length].hex()
        children = [
            self.child(
                at + (i >> 3), value[i], raw[i >> 3 << 1 : (i >> 3 << 1) + 2], i & 7, _address(first, i), tracer.wording
            )
            for i in range(n)
        ]
        if n < len(value):
            children.append(self.padding(at, raw, value, n, tracer.wording))
        return Field(name, at, length, None, raw, text, None, None, tuple(children))

    @staticmethod
    def padding(at: int, raw: str, value: Sequence[bool], n: int, wording: Wording = ENGLISH) -> Field:
        """What the last bytes hold beyond the quantity: zeros ([1] 6.1)."""
        byte, bit = n >> 3, n & 7
        spare = len(value) - n
        number = sum(on << i for i, on in enumerate(value[n:]))
        problem = wording.say("unused bits are not zero") if number else None
        if spare < 8:
            return Field(
                "padding", at + byte, 1, number, raw[2 * byte :], f"{number:0{spare}b}", bit, spare, (), problem
            )
        first = byte + (1 if bit else 0)
        return Field(
            "padding",
            at + first,
            len(value) // 8 - first,
            raw[2 * first :],
            raw[2 * first :],
            raw[2 * first :],
            None,
            None,
            (),
            problem,
        )


class Octets(Counted):
    """Bytes whose meaning the declaration does not know; printable ones are shown as text too."""

    @property
    def looks_at(self) -> tuple[str, ...]:
        return ()

    def describe(self, name: str, start: int, length: int, value: bytes, tracer: FieldTracer) -> Field:
        return opaque(name, start, length, value, tracer)


class Text(Counted):
    """A string of the device's own."""

    @property
    def looks_at(self) -> tuple[str, ...]:
        return ()

    def describe(self, name: str, start: int, length: int, value: bytes, tracer: FieldTracer) -> Field:
        text = device_text(value)
        return tracer.make(name, start, length, text, text)


class Split(Counted):
    """Counted bytes that a function takes apart: it is given them and returns (name, length, value, text) in order.

    A value of None stands for the bytes' hex. Where it is a number the text is the declaration's; other texts are the
    device's own.
    """

    shown: Final = 8  # in one line of text

    def __init__(
        self, count: str, pieces: Callable[[bytes], Sequence[tuple[str, int, Value, str]]], *, less: int = 0
    ) -> None:
        super().__init__(count, less=less)
        self.pieces = pieces

    def told(self, value: int, text: str, wording: Wording) -> str:  # noqa: ARG002
        """The text of a number in the words of who reads it."""
        return wording.say(text)

    def line(self, texts: Sequence[str], wording: Wording = ENGLISH) -> str:
        """The pieces' texts on one line."""
        text = ", ".join(texts[: self.shown])
        return f"{text}{_in_all(len(texts), wording)}" if len(texts) > self.shown else text

    @property
    def looks_at(self) -> tuple[str, ...]:
        return ()

    def describe(self, name: str, start: int, length: int, value: bytes, tracer: FieldTracer) -> Field:
        children = []
        at = start
        for label, size, plain, text in self.pieces(value):
            shown = value[at - start : at - start + size].hex() if plain is None else plain
            if isinstance(plain, int):
                text = self.told(plain, text, tracer.wording)
            children.append(tracer.make(label, at, size, shown, text))
            at += size
        text = self.line([child.text for child in children], tracer.wording)
        return tracer.make(name, start, length, None, text, tuple(children))


class EachByte(Split):
    """Counted bytes each of which stands for something by itself: `words` says what."""

    def __init__(self, count: str, each: str, words: Callable[[int, Wording], str], *, less: int = 0) -> None:
        super().__init__(count, lambda data: [(each, 1, byte, "") for byte in data], less=less)
        self.each = each
        self.words = words

    def told(self, value: int, text: str, wording: Wording) -> str:  # noqa: ARG002
        return self.words(value, wording)


class Rest(Part):
    """Everything to the end of the PDU; `usual` bytes by the specification, but any number is seen."""

    def __init__(self, usual: int = 0) -> None:
        super().__init__()
        self.usual = usual

    def _parse(self, stream: Any, context: Any, path: str) -> bytes:  # noqa: ARG002
        data: bytes = stream.read()
        if len(data) < self.usual:
            raise Short(self.usual, len(data), data)
        return data

    def _build(self, obj: Any, stream: Any, context: Any, path: str) -> Any:  # noqa: ARG002
        stream.write(obj)
        return obj

    @property
    def looks_at(self) -> tuple[str, ...]:
        return ()

    def describe(self, name: str, start: int, length: int, value: bytes, tracer: FieldTracer) -> Field:
        return opaque(name, start, length, value, tracer)


class Items(Part):
    """Elements one after another: as many bytes as `octets` counts, or as many elements as `number` counts."""

    def __init__(self, element: AnyConstruct, *, octets: str | None = None, number: str | None = None) -> None:
        super().__init__()
        self.subcon = element
        self.octets = octets
        self.number = number

    def _parse(self, stream: Any, context: Any, path: str) -> list[Any]:
        items: list[Any] = []
        if self.number is not None:
            for _ in range(context[self.number]):
                items.append(self.subcon._parsereport(stream, context, path))
        elif self.octets is not None:
            end = stream.tell() + context[self.octets]
            while (at := stream.tell()) < end:
                items.append(self.subcon._parsereport(stream, context, path))
                if stream.tell() == at:  # an element of no bytes would go on for ever
                    break
        return items

    def _build(self, obj: Any, stream: Any, context: Any, path: str) -> Any:
        for item in obj:
            self.subcon._build(item, stream, context, path)
        return obj

    def problem(self, value: Any, length: int, tracer: FieldTracer) -> str | None:  # noqa: ARG002
        counted = tracer.number(self.octets)
        if counted is not None and counted != length:
            words = "the byte count says {counted}, what is in it takes {length}"
            return tracer.wording.fill_template(words, counted=counted, length=length)
        return None


class Record(_Struct):
    """A Struct inside a declaration, with a template of its text: `{object_id}: {object_value}`."""

    def __init__(self, words: str, *subcons: AnyConstruct) -> None:
        super().__init__(*subcons)
        self.words = words


class Variant(_Switch):
    """A Switch that holds the rest of a PDU: its fields stand beside those before it, not below a field of its own."""


def _in_all(number: int, wording: Wording) -> str:
    """What stands behind the first of many."""
    return wording.fill_template(" … {number} in all", number=number)


def _address(first: int | None, i: int) -> int | None:
    """The address of number `i` from the first one's, as long as there are addresses."""
    return None if first is None or first + i > 0xFFFF else first + i


def opaque(name: str, start: int, length: int, data: bytes, tracer: FieldTracer, problem: str | None = None) -> Field:
    """Bytes that mean nothing known."""
    text = data.hex(" ")
    if is_text(data) and length > 1:
        text = f"{text} ({device_text(data)})"
    return tracer.make(name, start, length, data.hex(), text, problem=problem)
