"""How long a PDU is and what holds for it, from its first bytes: rules as plain data, compiled from the declarations.

Nothing is stated here: `dissectors.structure` walks each declaration, and this file turns what it found into a `Rule`
by (function, role). Offsets are in the PDU: 0 is the function code. An exception is a response with 80 in its function.
"""

from __future__ import annotations

import enum
import io
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Final

import construct

from .declaration import EXCEPTION, Function
from .limits import Asked, Bound, Choice, Count, Echo, Multiple, Sized, taken
from .parts import AnyConstruct
from .registry import functions, revision
from .structure import Impossible, Shape, Unknowable, measuring, shape

__all__ = [
    "MAX_PDU",
    "RULES",
    "Asked",
    "Bound",
    "Choice",
    "Count",
    "Echo",
    "Multiple",
    "Role",
    "Rule",
    "Sized",
    "compiled",
    "layout",
    "pdu_length",
    "plausibility",
    "relations",
    "revision",
    "rule",
]

MAX_PDU: Final = 253  # [1] 4.1: what a serial ADU of 256 bytes leaves


class Role(enum.IntEnum):
    """Who speaks: the client asks, the server answers."""

    REQUEST = 0
    RESPONSE = 1


@dataclass(frozen=True, slots=True)
class Rule:
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
        if any(_value_broken(check, pdu) for check in self.checks):
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


class _Compiled:
    """Everything compiled from the declarations of one revision."""

    def __init__(self, of_revision: int) -> None:
        self.revision = of_revision
        self.rules: dict[tuple[int, Role], Rule] = {}
        self.shapes: dict[tuple[int, Role], Shape] = {}
        self.relations: dict[int, tuple[Echo | Asked, ...]] = {}


_cache: list[_Compiled] = []


def _all() -> _Compiled:
    if _cache and _cache[0].revision == revision():
        return _cache[0]
    from .functions.exceptions import RESPONSE

    declared = functions()
    made = _Compiled(revision())
    for function in declared.values():
        for role in Role:
            made.rules[function.code, role], made.shapes[function.code, role] = compiled(function, role)
        made.relations[function.code] = _relations(
            function, made.shapes[function.code, Role.REQUEST], made.shapes[function.code, Role.RESPONSE]
        )
    exception = shape(RESPONSE)
    for code in range(EXCEPTION, 0x100):  # with 80 itself: real servers answer function 0 so
        made.rules[code, Role.RESPONSE] = Rule(
            code, Role.RESPONSE, "Exception", exception.size, None, tuple(exception.checks), None, False
        )
    _cache[:] = [made]
    return made


def compiled(function: Function, role: Role) -> tuple[Rule, Shape]:
    """The rule of one side of a declaration, and the shape behind it."""
    declaration = function.request if role is Role.REQUEST else function.response
    found = shape(declaration)
    checks = tuple(found.checks)
    base, count, walk = None if found.bare else found.size, found.count, None
    if found.stepped:
        base, count, walk = None, None, _Walk(measuring(declaration), checks)
    return Rule(function.code, role, function.name, base, count, checks, walk, found.open_ended), found


def _relations(function: Function, request: Shape, response: Shape) -> tuple[Echo | Asked, ...]:
    echoes: list[Echo | Asked] = []
    for name in function.echoes:
        asked, answered = request.layout.get(name), response.layout.get(name)
        if asked is not None and answered is not None and asked[1] == answered[1]:
            echoes.append(Echo(asked[0], answered[0], asked[1]))
    for at, quantity, bits in response.asks:
        if quantity in request.layout:
            echoes.append(Asked(at, request.layout[quantity][0], bits))
    return tuple(echoes)


class _Rules(Mapping[tuple[int, Role], Rule]):
    """All rules, compiled when first looked at and again when a function has been registered."""

    def __getitem__(self, key: tuple[int, Role]) -> Rule:
        return _all().rules[key]

    def __iter__(self) -> Iterator[tuple[int, Role]]:
        return iter(_all().rules)

    def __len__(self) -> int:
        return len(_all().rules)


RULES: Final[Mapping[tuple[int, Role], Rule]] = _Rules()


def rule(function: int, role: Role) -> Rule | None:
    """The rule of a function byte, or None where nobody has declared it."""
    return _all().rules.get((function, role))


def relations(function: int) -> tuple[Echo | Asked, ...]:
    """What a response must share with its request; nothing for undeclared functions and exceptions."""
    return _all().relations.get(function, ())


def layout(function: int, role: Role) -> Mapping[str, tuple[int, int]]:
    """Offset in the PDU and width of the numbers whose place is fixed, by name."""
    found = _all().shapes.get((function, role))
    return {} if found is None else found.layout


def pdu_length(pdu: bytes, role: Role) -> int | None:
    """The length that the first bytes of a PDU predict for a role.

    None: more bytes are needed, or nothing tells; -1: these bytes cannot be a PDU of this role.
    """
    if not pdu:
        return None
    known = rule(pdu[0], role)
    if known is None:
        return -1 if pdu[0] & EXCEPTION or not pdu[0] else None
    if known.walk is not None:
        return known.walk(pdu)
    for check in known.checks:
        if not check.soft and _value_broken(check, pdu):
            return -1
    if known.base is None or known.count is None:
        return known.base
    end = known.count.offset + known.count.width
    if len(pdu) < end:
        return None
    return known.base + known.count.scale * int.from_bytes(pdu[known.count.offset : end], "big")


def plausibility(pdu: bytes, role: Role) -> list[str]:
    """The checks that a PDU breaks, in words; checks of fields that it does not reach are left out."""
    known = rule(pdu[0], role) if pdu else None
    if known is None:
        return []
    places = {place: name for name, (place, _) in layout(pdu[0], role).items()}
    broken = []
    for check in known.checks:
        words = _value_broken(check, pdu)
        if words:
            place = check.count_offset if isinstance(check, Sized) else check.offset
            broken.append(f"{places.get(place, f'byte {place}')}: {words}")
    return broken


def _value_broken(check: Bound | Choice | Multiple | Sized, pdu: bytes) -> str | None:
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
