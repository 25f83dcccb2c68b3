"""The rule of one side of a declaration: how long such a PDU is and what holds for it, as plain data.

Nothing is stated here: the declaration is walked, from the construct itself, for its shape and what its size hangs on.
The walk follows named parts from the start and keeps their place as long as all before them has a fixed size. A block
that a number before it counts gives a `Count`; checks get their place in the PDU. Where the size hangs on more than
one count (lists of counted things, alternatives of different sizes), `stepped` says so, and only reading the bytes
tells. Offsets are in the PDU: 0 is the function code. `dissectors.lengths` looks rules up by function code.
"""

from __future__ import annotations

import copy
import enum
import io
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Final

import construct

from .blocks import Counted, Items, Rest
from .declaration import AnyConstruct, AnySubconstruct, ByteCount, Function, Number
from .limits import MAX_PDU, Bound, Check, Choice, Count, Echo, Multiple, RequestedByteCount, Sized, taken

_GREEDY: Final = (construct.GreedyRange, type(construct.GreedyBytes))
# What these read passes through another coding: they are leaves, for places inside them mean nothing outside.
_RECODED: Final[tuple[type[AnyConstruct], ...]] = tuple(
    getattr(construct, name) for name in ("Transformed", "Restreamed", "Compressed", "ProcessXor", "ProcessRotateLeft")
)
# What these read of a stream does not hang on what they hold: nothing inside goes on to the end of the PDU.
_BOUNDED: Final[tuple[type[AnyConstruct], ...]] = tuple(
    getattr(construct, name) for name in ("Prefixed", "FixedSized", "NullTerminated")
)
_INNER: Final = ("subcon", "thensubcon", "elsesubcon", "default", "lengthfield", "countfield")


@dataclass(slots=True)
class DeclarationShape:
    """`size` is the bytes that are always there, the function code included. `layout` places the named numbers."""

    size: int = 1
    count: Count | None = None
    checks: list[Check | Sized] = field(default_factory=list)
    layout: dict[str, tuple[int, int]] = field(default_factory=dict)
    numbers: dict[str, Number] = field(default_factory=dict)  # the parts behind `layout`
    blocks: list[tuple[int, Counted]] = field(default_factory=list)  # counted blocks whose place is fixed
    asks: list[tuple[int, str, bool]] = field(default_factory=list)  # byte count for a quantity not in this PDU
    open_ended: bool = False  # more bytes are legal
    bare: bool = False  # nothing says how many bytes are usual
    stepped: bool = False


def shape(declaration: AnyConstruct) -> DeclarationShape:
    """The shape of a PDU: function code, then what the declaration says."""
    declared = DeclarationShape()
    _walk(declaration, None, declared, 1)
    return declared


def _walk(con: AnyConstruct, name: str | None, declared: DeclarationShape, at: int | None) -> int | None:
    """Adds a construct at PDU offset `at` (None: not fixed) and returns the offset behind it."""
    while isinstance(con, construct.Renamed):
        name, con = con.name, con.subcon
    if isinstance(con, Number):
        _walk_number(con, name, declared, at)
        return _fixed(con.width, declared, at)
    if isinstance(con, construct.Struct | construct.Sequence):
        for part in con.subcons:
            at = _walk(part, None, declared, at)
        return at
    if isinstance(con, Counted):
        if at is not None:
            declared.blocks.append((at, con))
        declared.size -= con.less
        counter = declared.layout.get(con.count)
        if con.less and counter is not None:  # fewer than what it counts besides cannot be
            declared.checks.append(Bound(*counter, con.less, 0x100 ** counter[1] - 1, soft=False))
        _walk_counted(con.count, con.scale, declared)
        return None
    if isinstance(con, Items):
        _items(con, declared, at)
        return None
    if isinstance(con, Rest):
        declared.open_ended = True
        declared.bare = declared.bare or not con.usual
        declared.size += con.usual
        return None
    if isinstance(con, _GREEDY):
        declared.open_ended = declared.bare = True
        return None
    if isinstance(con, construct.Switch):
        return _switch(con, declared, at)
    return _foreign(con, name, declared, at)


def _fixed(size: int, declared: DeclarationShape, at: int | None) -> int | None:
    declared.size += size
    return None if at is None else at + size


def _walk_counted(name: object, scale: int, declared: DeclarationShape) -> None:
    """Bytes that the number `name` counts."""
    counter = declared.layout.get(name) if isinstance(name, str) else None
    if counter is None or declared.count is not None:
        declared.stepped = True
    else:
        declared.count = Count(*counter, scale)


def _walk_number(con: Number, name: str | None, declared: DeclarationShape, at: int | None) -> None:
    if at is None:
        return
    declared.checks += [replace(check, offset=at) for check in con.checks]
    if isinstance(con, ByteCount) and con.of is not None and con.width == 1:
        quantity = declared.layout.get(con.of)
        if quantity is None:
            declared.asks.append((at, con.of, con.bits))
        else:
            declared.checks.append(Sized(at, quantity[0], con.bits))
    if name is not None:
        declared.layout[name] = (at, con.width)
        declared.numbers[name] = con


def _items(con: Items, declared: DeclarationShape, at: int | None) -> None:
    """Elements; of the first, whose place is known, the leading number is held to its checks."""
    if con.octets is None:
        declared.stepped = True
        return
    _walk_counted(con.octets, 1, declared)
    element = con.subcon
    while isinstance(element, construct.Renamed):
        element = element.subcon
    if isinstance(element, construct.Struct) and element.subcons and at is not None:
        first: Any = element.subcons[0]
        while isinstance(first, construct.Renamed):
            first = first.subcon
        if isinstance(first, Number):
            declared.checks += [replace(check, offset=at) for check in first.checks]


def _switch(con: Any, declared: DeclarationShape, at: int | None) -> int | None:
    """Alternatives: of one size they have it, else only the bytes tell."""
    shapes = []
    for case in (*con.cases.values(), con.default):
        if case is construct.Pass:
            continue
        inner = DeclarationShape(size=0)
        _walk(case, None, inner, None)
        shapes.append(inner)
    declared.open_ended = declared.open_ended or any(s.open_ended for s in shapes)
    if shapes and len({s.size for s in shapes}) == 1 and not any(s.count or s.stepped or s.bare for s in shapes):
        return _fixed(shapes[0].size, declared, at)
    declared.stepped = True
    return None


def _foreign(con: Any, name: str | None, declared: DeclarationShape, at: int | None) -> int | None:
    """A construct from elsewhere: of fixed size, counted in one of the common ways, or read to know."""
    size = _size(con)
    if size is not None:
        if at is not None and name is not None and size in (1, 2) and _is_big_endian(con):
            declared.layout[name] = (at, size)
        return _fixed(size, declared, at)
    if isinstance(con, construct.Bytes):
        _walk_counted(path_name(con.length), 1, declared)
        return None
    if isinstance(con, construct.Array):
        each = _size(con.subcon)
        if each is not None:
            _walk_counted(path_name(con.count), each, declared)
            return None
    if isinstance(con, construct.Prefixed) and not con.includelength and at is not None:
        width = _size(con.lengthfield)
        if width in (1, 2) and declared.count is None and _is_big_endian(con.lengthfield):
            declared.count = Count(at, width, 1)
            declared.size += width
            return None
    declared.stepped = True
    inner = getattr(con, "subcon", None)
    if isinstance(inner, construct.Construct) and not isinstance(con, _BOUNDED):
        declared.open_ended = declared.open_ended or _greedy_inside(inner)
    return None


def _greedy_inside(con: AnyConstruct) -> bool:
    inner = DeclarationShape()
    _walk(con, None, inner, None)
    return inner.bare


def _size(con: Any) -> int | None:
    try:
        size: int = con.sizeof()
    except Exception:  # a user's construct may fail in any way when asked without bytes
        return None
    return size if size >= 0 else None


def _is_big_endian(con: Any) -> bool:
    """Whether a number is one that array code may read as unsigned and big-endian."""
    while isinstance(con, construct.Renamed | construct.Enum):
        con = con.subcon
    if isinstance(con, construct.FormatField):
        return con.fmtstr in (">B", ">H")
    return isinstance(con, construct.BytesInteger) and not con.signed and not con.swapped


def path_name(path: object) -> str | None:
    """`byte_count` of `this.byte_count`; None for anything more involved."""
    parts = repr(path)
    if parts.startswith("this['") and parts.endswith("']") and parts.count("[") == 1:
        return parts[len("this['") : -2]
    return None


def rebuilt(con: AnyConstruct, hook: Callable[[AnyConstruct], AnyConstruct | None]) -> AnyConstruct:
    """A copy of a declaration, parts replaced by what `hook` returns for them (None: kept, and looked into)."""
    new = hook(con)
    if new is not None:
        return new
    if isinstance(con, _RECODED):
        return con
    changed: dict[str, Any] = {}
    attributes = vars(con)
    for name in _INNER:
        inner = attributes.get(name)
        if isinstance(inner, construct.Construct):
            copied = rebuilt(inner, hook)
            if copied is not inner:
                changed[name] = copied
    if isinstance(parts := attributes.get("subcons"), list):
        others = [rebuilt(part, hook) for part in parts]
        if any(copied is not part for copied, part in zip(others, parts, strict=True)):
            changed["subcons"] = others
    if isinstance(cases := attributes.get("cases"), dict):
        chosen = {key: rebuilt(case, hook) for key, case in cases.items()}
        if any(chosen[key] is not cases[key] for key in cases):
            changed["cases"] = chosen
    if not changed:
        return con
    twin: AnyConstruct = copy.copy(con)
    vars(twin).update(changed)
    return twin


def field_names(con: AnyConstruct) -> list[str]:
    """The names that a declaration gives to its parts."""
    names: list[str] = []

    def note(part: AnyConstruct) -> None:
        if isinstance(part, construct.Renamed):
            names.append(str(part.name))

    rebuilt(con, note)
    return names


class Unknowable(construct.ConstructError):
    """A part that goes on to the end: the bytes do not say where that is."""


class Impossible(construct.ConstructError):
    """A number that breaks a hard check: these bytes are no such PDU."""


class _OpenShape(AnyConstruct):
    def _parse(self, stream: Any, context: Any, path: str) -> Any:  # noqa: ARG002
        raise Unknowable("no end in sight")


class _CheckedShape(AnySubconstruct):
    def __init__(self, number: Number) -> None:
        super().__init__(number)
        self.checks = tuple(check for check in number.checks if not check.soft)

    def _parse(self, stream: Any, context: Any, path: str) -> int:
        value: int = self.subcon._parsereport(stream, context, path)
        if any(check.broken(value) for check in self.checks):
            raise Impossible("a hard check is broken")
        return value


def measuring(declaration: AnyConstruct) -> AnyConstruct:
    """The declaration made strict: it stops at what has no end (`Unknowable`) and at what cannot be (`Impossible`)."""

    def hook(con: AnyConstruct) -> AnyConstruct | None:
        if isinstance(con, _BOUNDED):
            return con
        if isinstance(con, (Rest, *_GREEDY)):
            return _OpenShape()
        if isinstance(con, Number) and any(not check.soft for check in con.checks):
            return _CheckedShape(con)
        return None

    return rebuilt(declaration, hook)


class Role(enum.IntEnum):
    """Who speaks: the client asks, the server answers."""

    REQUEST = 0
    RESPONSE = 1


@dataclass(frozen=True, slots=True)
class LengthRule:
    """What is known of the PDUs of one function and role.

    `base` is the PDU's length without the counted part (None: the header does not tell); `count` the counted part;
    `walk` gives the length where it takes reading more than one count: None while bytes are missing or where nothing
    tells, -1 where the bytes cannot be such a PDU. `variable`: other lengths than the predicted one are legal too.
    """

    function: int
    role: Role
    name: str
    base: int | None
    count: Count | None
    checks: tuple[Bound | Choice | Multiple | Sized, ...]
    walk: PduWalk | None
    variable: bool


class PduWalk:
    """PDU length by reading the declared part."""

    def __init__(self, declaration: AnyConstruct, checks: tuple[Bound | Choice | Multiple | Sized, ...]) -> None:
        self.declaration = declaration
        self._measured = measuring(declaration)
        self.checks = tuple(check for check in checks if not check.soft)

    def __call__(self, pdu: bytes) -> int | None:
        if any(broken_value(check, pdu) for check in self.checks):
            return -1
        stream = io.BytesIO(pdu[1:])
        try:
            self._measured.parse_stream(stream)
        except Unknowable:
            return None
        except construct.StreamError:
            return None if len(pdu) < MAX_PDU else -1
        except Impossible:
            return -1
        except Exception:  # a user's declaration may fail in any way on bytes that it was not made for
            return -1
        length = 1 + stream.tell()
        return length if length <= MAX_PDU else -1


def compiled(function: Function, role: Role) -> tuple[LengthRule, DeclarationShape]:
    """The rule of one side of a declaration, and the shape behind it."""
    declaration = function.request if role is Role.REQUEST else function.response
    declared = shape(declaration)
    checks = tuple(declared.checks)
    base, count, walk = None if declared.bare else declared.size, declared.count, None
    if declared.stepped:
        base, count, walk = None, None, PduWalk(declaration, checks)
    return LengthRule(function.code, role, function.name, base, count, checks, walk, declared.open_ended), declared


def relations_of(
    function: Function, request: DeclarationShape, response: DeclarationShape
) -> tuple[Echo | RequestedByteCount, ...]:
    echoes: list[Echo | RequestedByteCount] = []
    for name in function.echoes:
        requested, answered = request.layout.get(name), response.layout.get(name)
        if requested is not None and answered is not None and requested[1] == answered[1]:
            echoes.append(Echo(requested[0], answered[0], requested[1]))
    for at, quantity, bits in response.asks:
        if quantity in request.layout:
            echoes.append(RequestedByteCount(at, request.layout[quantity][0], bits))
    return tuple(echoes)


def broken_value(check: Bound | Choice | Multiple | Sized, pdu: bytes) -> str | None:
    """What is wrong, or None; None as well where the PDU does not reach so far."""
    if isinstance(check, Sized):
        if len(pdu) <= max(check.count_offset, check.quantity_offset + 1):
            return None
        quantity = int.from_bytes(pdu[check.quantity_offset : check.quantity_offset + 2], "big")
        count, due = pdu[check.count_offset], taken(quantity, check.bits)
        return None if count == due else f"the quantity, {quantity}, takes {due} bytes, not {count}"
    end = check.offset + check.width
    if len(pdu) < end:
        return None
    return check.broken(int.from_bytes(pdu[check.offset : end], "big"))
