"""What a PDU speaks of: an address, a quantity, values; and where in its bytes they stand, told by its declaration.

Nothing is stated here. The first `Address` of a side is its address, the first `Quantity` its quantity; values are what
`Registers` and `Bits` hold, or a `Register` or `Output` right after its address. A response looks up in its request
what its own bytes do not say. Array code reads whole captures by these places; where a list of counted things leaves
a block no fixed place, `listed` says so, and only the annotation of each frame tells (`values_listed`).
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Final

from .blocks import Bits, Registers
from .declaration import Function
from .fields import Field
from .lengths import Role, revision
from .limits import Count
from .parts import Address, AnyConstruct, Number, Output, Quantity, Register
from .registry import functions
from .structure import Shape, rebuilt, shape
from .values import Area

_NOTHING: Final = Shape()


@dataclass(frozen=True, slots=True)
class Place:
    """A two-byte number by its offset in the PDU: this one, or the request that it answers."""

    offset: int
    asked: bool = False


@dataclass(frozen=True, slots=True)
class Held:
    """Values in a PDU, from `offset` on.

    `count` says how many bytes they take, `less` how many of those go to other fields; without it there is one value,
    of two bytes. `bits`: coils or inputs, least significant bit first, as many as `quantity` says; else registers.
    """

    offset: int
    bits: bool
    count: Count | None = None
    less: int = 0
    start: Place | None = None  # the address of the first
    quantity: Place | None = None


@dataclass(frozen=True, slots=True)
class Contents:
    """What one side of a function speaks of; None where it has no such thing."""

    area: Area | None
    address: Place | None
    quantity: Place | None
    held: Held | None
    listed: frozenset[str]  # names of the fields that are values, where those have no fixed place


def contents() -> dict[tuple[int, Role], Contents]:
    """The contents of all declared functions, by function code and role; exceptions apart."""
    if not _cache or _cache[0][0] != revision():
        made = {}
        for function in functions().values():
            asked = shape(function.request)
            made[function.code, Role.REQUEST] = _contents(function, function.request, asked, _NOTHING)
            made[function.code, Role.RESPONSE] = _contents(function, function.response, shape(function.response), asked)
        _cache[:] = [(revision(), made)]
    return _cache[0][1]


_cache: list[tuple[int, dict[tuple[int, Role], Contents]]] = []


def values_listed(fields: Iterable[Field], names: frozenset[str]) -> Iterator[int]:
    """The values among the fields of one frame, in wire order."""
    for field in fields:
        if field.name in names and isinstance(field.value, int):
            yield int(field.value)
        yield from values_listed(field.fields, names)


def _contents(function: Function, declaration: AnyConstruct, own: Shape, asked: Shape) -> Contents:
    held = _block(own, asked) or _single(own)
    return Contents(
        function.area,
        _first(own, Address) or _first(asked, Address, asked=True),
        _first(own, Quantity),
        held,
        frozenset() if held else _names(declaration),
    )


def _first(found: Shape, kind: type[Number], *, asked: bool = False) -> Place | None:
    for name, number in found.numbers.items():
        if isinstance(number, kind):
            return Place(found.layout[name][0], asked)
    return None


def _named(name: str | None, own: Shape, asked: Shape) -> Place | None:
    for found in (own, asked):
        if name is not None and found.layout.get(name, (0, 0))[1] == 2:
            return Place(found.layout[name][0], found is asked)
    return None


def _block(own: Shape, asked: Shape) -> Held | None:
    for at, block in own.blocks:
        place = own.layout.get(block.count)
        if place is None or not isinstance(block, Registers | Bits):
            continue
        count = Count(*place, block.scale)
        quantity = _named(block.quantity, own, asked) if isinstance(block, Bits) else None
        return Held(at, isinstance(block, Bits), count, block.less, _named(block.start, own, asked), quantity)
    return None


def _single(own: Shape) -> Held | None:
    before: Place | None = None
    for name, number in own.numbers.items():
        at = own.layout[name][0]
        if before is not None and isinstance(number, Register | Output):
            return Held(at, isinstance(number, Output), start=before)
        before = Place(at) if isinstance(number, Address) else None
    return None


def _names(declaration: AnyConstruct) -> frozenset[str]:
    """What the values of a declaration are called, wherever in it they are."""
    found: set[str] = set()

    def look(con: AnyConstruct) -> None:
        if isinstance(con, Registers | Bits):
            found.add(con.each)

    rebuilt(declaration, look)
    return frozenset(found)
