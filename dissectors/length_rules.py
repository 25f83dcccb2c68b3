"""The rule of one side of a declaration: how long such a PDU is and what holds for it, as plain data.

Nothing is stated here: `dissectors.structure` walks the declaration. Offsets are in the PDU: 0 is the function code.
`dissectors.lengths` looks rules up by function code.
"""

from __future__ import annotations

import enum
import io
from collections.abc import Callable
from dataclasses import dataclass

import construct

from .adu import MAX_PDU
from .declaration import Function
from .limits import Bound, Choice, Count, Echo, Multiple, RequestedByteCount, Sized, taken
from .parts import AnyConstruct
from .structure import DeclarationShape, Impossible, Unknowable, measuring, shape


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
    walk: Callable[[bytes], int | None] | None
    variable: bool


class _Walk:
    """PDU length by reading the declared part."""

    def __init__(self, declared: AnyConstruct, checks: tuple[Bound | Choice | Multiple | Sized, ...]) -> None:
        self.declared = declared
        self.checks = tuple(check for check in checks if not check.soft)

    def __call__(self, pdu: bytes) -> int | None:
        if any(broken_value(check, pdu) for check in self.checks):
            return -1
        stream = io.BytesIO(pdu[1:])
        try:
            self.declared.parse_stream(stream)
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
        base, count, walk = None, None, _Walk(measuring(declaration), checks)
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
