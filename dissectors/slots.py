"""Declarations whose fields always stand in the same places, for those who describe many frames of one kind at once.

Most functions are numbers one after the other, and perhaps a counted block behind them. What is to be said of such a
number hangs on its value, on the numbers that it looks at, and on what it echoes; so each thing need be said only once
(`described`, which is what annotation says). Where a declaration is not of this form there are no slots, and only the
annotation of the whole frame tells.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import construct

from .blocks import Bits, Counted, Registers
from .declaration import Function
from .fields import Field
from .functions.exceptions import RESPONSE as EXCEPTION_RESPONSE
from .lengths import Role, layout
from .parts import AnyConstruct, Number, dependencies
from .recorder import Recorder
from .recording import echoed

_BODY = 2  # where the declared part begins in a serial ADU: behind unit and function code
_WIDTHS = (1, 2)


@dataclass(frozen=True, slots=True)
class Look:
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
    looks: tuple[Look, ...]
    echo: Look | None

    def described(self, value: int, looks: Sequence[int], asked: int = -1, *, brief: bool = False) -> Field:
        """The field of a value, as annotation gives it; `looks` as in `looks`, -1 for what is not known.

        `brief` gives it as it is for a summary.
        """
        at = 1 + self.offset
        seen = _recorder(bytes(at) + value.to_bytes(self.part.width, "big"), self.looks, looks)
        seen.brief = brief
        field = self.part.describe(self.name, at - _BODY, self.part.width, value, seen)
        if self.echo is None or asked < 0:
            return field
        seen.request = {self.name: asked}
        seen.echoes = (self.name,)
        return echoed(field, self.part, value, seen)


@dataclass(frozen=True, slots=True)
class Block:
    """A counted block behind the numbers; `count` is the slot of the number that counts it."""

    name: str
    part: Registers | Bits
    offset: int
    count: Slot
    start: Look | None
    quantity: Look | None

    def described(self, data: bytes) -> Field:
        """The field of these bytes where nothing is known of addresses and quantity."""
        at = 1 + self.offset
        part: Counted = self.part
        return part.describe(self.name, at - _BODY, len(data), part.decoded(data), _recorder(bytes(at) + data))


@dataclass(frozen=True, slots=True)
class Slots:
    """One side of a function: `size` is the bytes of its PDU without the block."""

    numbers: tuple[Slot, ...]
    block: Block | None
    size: int

    @property
    def asks(self) -> bool:
        """Whether anything is looked up in the request."""
        looks = [look for slot in self.numbers for look in (*slot.looks, slot.echo)]
        if self.block is not None:
            looks += [self.block.start, self.block.quantity]
        return any(look is not None and look.asked for look in looks)


def slots(function: Function, role: Role) -> Slots | None:
    """The slots of one side of a function, if it is of that form."""
    asked = layout(function.code, Role.REQUEST) if role is Role.RESPONSE else {}
    echoes = function.echoes if role is Role.RESPONSE else ()
    return _slots(function.request if role is Role.REQUEST else function.response, asked, echoes)


def exception_slots() -> Slots | None:
    """The slots of exception responses."""
    return _slots(EXCEPTION_RESPONSE, {}, ())


def _slots(declaration: AnyConstruct, asked: Mapping[str, tuple[int, int]], echoes: tuple[str, ...]) -> Slots | None:
    if type(declaration) is not construct.Struct:
        return None
    numbers: dict[str, Slot] = {}
    at = 1
    for i, named in enumerate(declaration.subcons):
        name, part = _named(named)
        if name is None or name in numbers:
            return None
        if isinstance(part, Counted):
            block = _block(name, part, at, numbers, asked) if i == len(declaration.subcons) - 1 else None
            return None if block is None or name in echoes else Slots(tuple(numbers.values()), block, at)
        if not isinstance(part, Number) or type(part)._parse is not Number._parse or part.width not in _WIDTHS:
            return None
        looked = dependencies(part)
        looks = None if looked is None else [_look(other, numbers, asked) for other in looked]
        if looks is None or len(looks) > 1:
            return None
        echo = Look(name, *asked[name], asked=True) if name in echoes and name in asked else None
        numbers[name] = Slot(name, part, at, tuple(look for look in looks if look is not None), echo)
        at += part.width
    return Slots(tuple(numbers.values()), None, at)


def _named(con: AnyConstruct) -> tuple[str | None, AnyConstruct]:
    name = None
    while isinstance(con, construct.Renamed):
        name, con = name or str(con.name), con.subcon
    return name, con


def _block(
    name: str, part: Counted, at: int, numbers: Mapping[str, Slot], asked: Mapping[str, tuple[int, int]]
) -> Block | None:
    if type(part) not in (Registers, Bits) or part.count not in numbers:
        return None
    assert isinstance(part, Registers | Bits)
    start = None if part.start is None else _look(part.start, numbers, asked)
    quantity = _look(part.quantity, numbers, asked) if isinstance(part, Bits) else None
    return Block(name, part, at, numbers[part.count], start, quantity)


def _look(name: str, numbers: Mapping[str, Slot], asked: Mapping[str, tuple[int, int]]) -> Look | None:
    """Where a number is found, as `Recorder.number` would: in this PDU, else in the request's; None for nowhere."""
    if name in numbers:
        return Look(name, numbers[name].offset, numbers[name].part.width, asked=False)
    return Look(name, *asked[name], asked=True) if name in asked else None


def _recorder(data: bytes, looks: Sequence[Look] = (), values: Sequence[int] = ()) -> Recorder:
    known = [(look, value) for look, value in zip(looks, values, strict=True) if value >= 0]
    return Recorder(
        data,
        _BODY,
        len(data),
        request={look.name: value for look, value in known if look.asked},
        values={look.name: value for look, value in known if not look.asked},
    )
