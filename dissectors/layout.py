"""Declarations whose fields always stand in the same places, for those who describe many frames of one kind at once.

Most functions are numbers one after the other, and perhaps a counted block behind them. What is to be said of such a
number hangs on its value, on the numbers that it looks at, and on what it echoes; so each thing need be said only once
(`described`, which is what annotation says). A last part of another kind is a tail, whose own parts have no fixed
places. Where a declaration is not of this form there are no slots, and only the annotation of the whole frame tells.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

import construct

from .blocks import Bits, Counted, Registers
from .declaration import Address, AnyConstruct, Function, Number, Output, Part, Quantity, Register, dependencies
from .fields import Field, FieldTracer
from .functions.exceptions import RESPONSE as EXCEPTION_RESPONSE
from .length_rules import DeclarationShape, Role, field_names, rebuilt, shape
from .lengths import layout
from .limits import Count
from .registry import functions, revision
from .tracing import echoed
from .values import Area

_BODY = 2  # where the declared part begins in a serial ADU: behind unit and function code
_WIDTHS = (1, 2)


@dataclass(frozen=True, slots=True)
class FieldRef:
    """A number that a description hangs on: its name and its place in this PDU, or in the request's (`asked`)."""

    name: str
    offset: int
    width: int
    asked: bool


@dataclass(frozen=True, slots=True)
class Slot:
    """A number at a fixed place; `offset` is in the PDU. `echo`: the request's number that it must repeat."""

    name: str
    part: Number
    offset: int
    looks: tuple[FieldRef, ...]
    echo: FieldRef | None

    def described(self, value: int, looks: Sequence[int], asked: int = -1, *, brief: bool = False) -> Field:
        """The field of a value, as annotation gives it; `looks` as in `looks`, -1 for what is not known.

        `brief` gives it as it is for a summary.
        """
        at = 1 + self.offset
        tracer = _recorder(bytes(at) + value.to_bytes(self.part.width, "big"), self.looks, looks)
        tracer.brief = brief
        field = self.part.describe(self.name, at - _BODY, self.part.width, value, tracer)
        if self.echo is None or asked < 0:
            return field
        tracer.request = {self.name: asked}
        tracer.echoes = (self.name,)
        return echoed(field, self.part, value, tracer)


@dataclass(frozen=True, slots=True)
class CountedBlock:
    """A counted block behind the numbers; `count` is the slot of the number that counts it."""

    name: str
    part: Registers | Bits
    offset: int
    count: Slot
    start: FieldRef | None
    quantity: FieldRef | None

    def described(self, data: bytes) -> Field:
        """The field of these bytes where nothing is known of addresses and quantity."""
        return described(self.name, self.part, 1 + self.offset, data)


@dataclass(frozen=True, slots=True)
class Tail:
    """A part behind the numbers in which things have no fixed places, by its name; `declaration` is the whole side."""

    name: str
    part: AnyConstruct
    declaration: AnyConstruct


@dataclass(frozen=True, slots=True)
class Slots:
    """One side of a function: `size` is the bytes of its PDU without the block or the tail, if it has one."""

    numbers: tuple[Slot, ...]
    block: CountedBlock | None
    size: int
    tail: Tail | None = None

    @property
    def asks(self) -> bool:
        """Whether anything is looked up in the request."""
        looks = [ref for slot in self.numbers for ref in (*slot.looks, slot.echo)]
        if self.block is not None:
            looks += [self.block.start, self.block.quantity]
        return any(ref is not None and ref.asked for ref in looks)


def slots(function: Function, role: Role) -> Slots | None:
    """The slots of one side of a function, if it is of that form."""
    requested = layout(function.code, Role.REQUEST) if role is Role.RESPONSE else {}
    echoes = function.echoes if role is Role.RESPONSE else ()
    return _slots(function.request if role is Role.REQUEST else function.response, requested, echoes)


def exception_slots() -> Slots | None:
    """The slots of exception responses."""
    return _slots(EXCEPTION_RESPONSE, {}, ())


def _slots(declaration: AnyConstruct, request: Mapping[str, tuple[int, int]], echoes: tuple[str, ...]) -> Slots | None:
    if type(declaration) is not construct.Struct:
        return None
    numbers: dict[str, Slot] = {}
    at = 1
    for i, named in enumerate(declaration.subcons):
        name, part = _named(named)
        if name is None or name in numbers:
            return None
        if not isinstance(part, Number) or type(part)._parse is not Number._parse or part.width not in _WIDTHS:
            if i < len(declaration.subcons) - 1 or not {name, *field_names(part)}.isdisjoint({*echoes, *numbers}):
                return None
            block = _block(name, part, at, numbers, request)
            return Slots(tuple(numbers.values()), block, at, Tail(name, part, declaration) if block is None else None)
        needed = dependencies(part)
        looks = None if needed is None else [_field_ref(need, numbers, request) for need in needed]
        if looks is None or len(looks) > 1:
            return None
        echo = FieldRef(name, *request[name], asked=True) if name in echoes and name in request else None
        numbers[name] = Slot(name, part, at, tuple(ref for ref in looks if ref is not None), echo)
        at += part.width
    return Slots(tuple(numbers.values()), None, at)


def _named(con: AnyConstruct) -> tuple[str | None, AnyConstruct]:
    name = None
    while isinstance(con, construct.Renamed):
        name, con = name or str(con.name), con.subcon
    return name, con


def _block(
    name: str, part: AnyConstruct, at: int, numbers: Mapping[str, Slot], requested: Mapping[str, tuple[int, int]]
) -> CountedBlock | None:
    if not isinstance(part, Registers | Bits) or type(part) not in (Registers, Bits) or part.count not in numbers:
        return None
    start = None if part.start is None else _field_ref(part.start, numbers, requested)
    quantity = _field_ref(part.quantity, numbers, requested) if isinstance(part, Bits) else None
    return CountedBlock(name, part, at, numbers[part.count], start, quantity)


def _field_ref(name: str, numbers: Mapping[str, Slot], requested: Mapping[str, tuple[int, int]]) -> FieldRef | None:
    """Where a number is found, as `Recorder.number` would: in this PDU, else in the request's; None for nowhere."""
    if name in numbers:
        return FieldRef(name, numbers[name].offset, numbers[name].part.width, asked=False)
    return FieldRef(name, *requested[name], asked=True) if name in requested else None


def described(name: str, part: Part, at: int, data: bytes, *, brief: bool = False) -> Field:
    """The field of a part, where nothing is known but its bytes, which begin at `at` in the ADU."""
    tracer = _recorder(bytes(at) + data)
    tracer.brief = brief
    value: Any = data
    if isinstance(part, Number):
        value = int.from_bytes(data, "big")
    elif isinstance(part, Counted):
        value = part.decoded(data)
    return part.describe(name, at - _BODY, len(data), value, tracer)


def _recorder(data: bytes, looks: Sequence[FieldRef] = (), values: Sequence[int] = ()) -> FieldTracer:
    present = [(ref, value) for ref, value in zip(looks, values, strict=True) if value >= 0]
    return FieldTracer(
        data,
        _BODY,
        len(data),
        request={ref.name: value for ref, value in present if ref.asked},
        values={ref.name: value for ref, value in present if not ref.asked},
    )


# What a PDU speaks of: an address, a quantity, values; and where in its bytes they stand, told by its declaration.
#
# Nothing is stated here. The first `Address` of a side is its address, the first `Quantity` its quantity; values are
# what `Registers` and `Bits` hold, or a `Register` or `Output` right after its address. A response looks up in its
# request what its own bytes do not say. Array code reads whole captures by these places; where a list of counted
# things leaves a block no fixed place, `listed` says so, and only the annotation of each frame tells
# (`values_listed`).


_NOTHING: Final = DeclarationShape()


@dataclass(frozen=True, slots=True)
class NumberRef:
    """A two-byte number by its offset in the PDU: this one, or the request that it answers."""

    offset: int
    asked: bool = False


@dataclass(frozen=True, slots=True)
class ValueRun:
    """Values in a PDU, from `offset` on.

    `count` says how many bytes they take, `less` how many of those go to other fields; without it there is one value,
    of two bytes. `bits`: coils or inputs, least significant bit first, as many as `quantity` says; else registers.
    """

    offset: int
    bits: bool
    count: Count | None = None
    less: int = 0
    start: NumberRef | None = None  # the address of the first
    quantity: NumberRef | None = None


@dataclass(frozen=True, slots=True)
class Contents:
    """What one side of a function speaks of; None where it has no such thing."""

    area: Area | None
    address: NumberRef | None
    quantity: NumberRef | None
    held: ValueRun | None
    listed: frozenset[str]  # names of the fields that are values, where those have no fixed place
    declaration: AnyConstruct


def contents() -> dict[tuple[int, Role], Contents]:
    """The contents of all declared functions, by function code and role; exceptions apart."""
    if not _cache or _cache[0][0] != revision():
        sides = {}
        for function in functions().values():
            request = shape(function.request)
            sides[function.code, Role.REQUEST] = _contents(function, function.request, request, _NOTHING)
            sides[function.code, Role.RESPONSE] = _contents(
                function, function.response, shape(function.response), request
            )
        _cache[:] = [(revision(), sides)]
    return _cache[0][1]


_cache: list[tuple[int, dict[tuple[int, Role], Contents]]] = []


def values_listed(fields: Iterable[Field], names: frozenset[str]) -> Iterator[int]:
    """The values among the fields of one frame, in wire order."""
    for field in fields:
        if field.name in names and isinstance(field.value, int):
            yield int(field.value)
        yield from values_listed(field.fields, names)


def _contents(
    function: Function, declaration: AnyConstruct, own: DeclarationShape, request: DeclarationShape
) -> Contents:
    run = _value_block(own, request) or _single(own)
    return Contents(
        function.area,
        _first(own, Address) or _first(request, Address, asked=True),
        _first(own, Quantity),
        run,
        frozenset() if run else _names(declaration),
        declaration,
    )


def _first(declared: DeclarationShape, kind: type[Number], *, asked: bool = False) -> NumberRef | None:
    for name, number in declared.numbers.items():
        if isinstance(number, kind):
            return NumberRef(declared.layout[name][0], asked)
    return None


def _number_ref(name: str | None, own: DeclarationShape, request: DeclarationShape) -> NumberRef | None:
    for declared in (own, request):
        if name is not None and declared.layout.get(name, (0, 0))[1] == 2:
            return NumberRef(declared.layout[name][0], declared is request)
    return None


def _value_block(own: DeclarationShape, request: DeclarationShape) -> ValueRun | None:
    for at, block in own.blocks:
        counter = own.layout.get(block.count)
        if counter is None or not isinstance(block, Registers | Bits):
            continue
        count = Count(*counter, block.scale)
        quantity = _number_ref(block.quantity, own, request) if isinstance(block, Bits) else None
        return ValueRun(
            at, isinstance(block, Bits), count, block.less, _number_ref(block.start, own, request), quantity
        )
    return None


def _single(own: DeclarationShape) -> ValueRun | None:
    before: NumberRef | None = None
    for name, number in own.numbers.items():
        at = own.layout[name][0]
        if before is not None and isinstance(number, Register | Output):
            return ValueRun(at, isinstance(number, Output), start=before)
        before = NumberRef(at) if isinstance(number, Address) else None
    return None


def _names(declaration: AnyConstruct) -> frozenset[str]:
    """What the values of a declaration are called, wherever in it they are."""
    names: set[str] = set()

    def note(con: AnyConstruct) -> None:
        if isinstance(con, Registers | Bits):
            names.add(con.each)

    rebuilt(declaration, note)
    return frozenset(names)
