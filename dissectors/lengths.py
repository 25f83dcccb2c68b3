"""How long a PDU is and what holds for it, from its first bytes; and whether a response answers a request.

Nothing is stated here: `dissectors.length_rules` makes a `LengthRule` of each declaration, and this file looks them up
by (function, role). Offsets are in the PDU: 0 is the function code. An exception is a response with 80 in its function.

A serial answer carries no address: all that ties it to its request is unit, function, the byte count that the quantity
asked for, and whatever the function echoes. Pairs are given here as unit and PDU; what follows (a CRC) does no harm.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from .crc import crc_ends
from .length_rules import DeclarationShape, LengthRule, Role, broken_value, compiled, relations_of, shape
from .limits import (
    CRC_SIZE,
    EXCEPTION,
    MAX_ADU,
    OVERHEAD,
    Bound,
    Choice,
    Count,
    Echo,
    Multiple,
    RequestedByteCount,
    Sized,
    taken,
)
from .registry import functions, revision

__all__ = [
    "RULES",
    "Bound",
    "Choice",
    "Count",
    "Echo",
    "LengthRule",
    "Multiple",
    "RequestedByteCount",
    "Role",
    "Sized",
    "adu_end",
    "compiled",
    "declared_roles",
    "layout",
    "pdu_length",
    "plausibility",
    "relations",
    "revision",
    "rule",
    "sound_roles",
]


class _CompiledRules:
    """Everything compiled from the declarations of one revision."""

    def __init__(self, of_revision: int) -> None:
        self.revision = of_revision
        self.rules: dict[tuple[int, Role], LengthRule] = {}
        self.shapes: dict[tuple[int, Role], DeclarationShape] = {}
        self.relations: dict[int, tuple[Echo | RequestedByteCount, ...]] = {}
        self.roles: dict[int, tuple[Role, ...]] = {}


_ROLES: Final = tuple(Role)
_cache: list[_CompiledRules] = []


def _all() -> _CompiledRules:
    if _cache and _cache[0].revision == revision():
        return _cache[0]
    from .functions.exceptions import RESPONSE

    declared = functions()
    current = _CompiledRules(revision())
    for function in declared.values():
        for role in Role:
            current.rules[function.code, role], current.shapes[function.code, role] = compiled(function, role)
        current.relations[function.code] = relations_of(
            function, current.shapes[function.code, Role.REQUEST], current.shapes[function.code, Role.RESPONSE]
        )
    exception = shape(RESPONSE)
    for code in range(EXCEPTION, 0x100):  # with 80 itself: real servers answer function 0 so
        current.rules[code, Role.RESPONSE] = LengthRule(
            code, Role.RESPONSE, "Exception", exception.size, None, tuple(exception.checks), None, False
        )
    for code, role in current.rules:
        current.roles[code] = (*current.roles.get(code, ()), role)
    _cache[:] = [current]
    return current


class _Rules(Mapping[tuple[int, Role], LengthRule]):
    """All rules, compiled when first looked at and again when a function has been registered."""

    def __getitem__(self, key: tuple[int, Role]) -> LengthRule:
        return _all().rules[key]

    def __iter__(self) -> Iterator[tuple[int, Role]]:
        return iter(_all().rules)

    def __len__(self) -> int:
        return len(_all().rules)


RULES: Final[Mapping[tuple[int, Role], LengthRule]] = _Rules()


def rule(function: int, role: Role) -> LengthRule | None:
    """The rule of a function byte, or None where nobody has declared it."""
    return _all().rules.get((function, role))


def declared_roles(function: int) -> tuple[Role, ...]:
    """The roles in which somebody has declared a function byte, in their order."""
    return _all().roles.get(function, ())


def miscounted_role(function: int) -> Role:
    """Who rather made a frame of another length than its header predicts: the one role whose length a count tells."""
    declared = [(role, rule(function, role)) for role in Role]
    counted = [role for role, one in declared if one is not None and one.count is not None]
    return counted[0] if len(counted) == 1 else Role.REQUEST


def relations(function: int) -> tuple[Echo | RequestedByteCount, ...]:
    """What a response must share with its request; nothing for undeclared functions and exceptions."""
    return _all().relations.get(function, ())


def layout(function: int, role: Role) -> Mapping[str, tuple[int, int]]:
    """Offset in the PDU and width of the numbers whose place is fixed, by name."""
    declared = _all().shapes.get((function, role))
    return {} if declared is None else declared.layout


def pdu_length(pdu: bytes, role: Role) -> int | None:
    """The length that the first bytes of a PDU predict for a role.

    None: more bytes are needed, or nothing tells; -1: these bytes cannot be a PDU of this role.
    """
    if not pdu:
        return None
    length_rule = rule(pdu[0], role)
    if length_rule is None:
        return -1 if pdu[0] & EXCEPTION or not pdu[0] else None
    return _length_by(length_rule, pdu)


def _length_by(length_rule: LengthRule, pdu: bytes) -> int | None:
    if length_rule.walk is not None:
        return length_rule.walk(pdu)
    for check in length_rule.checks:
        if not check.soft and broken_value(check, pdu):
            return -1
    if length_rule.base is None or length_rule.count is None:
        return length_rule.base
    end = length_rule.count.offset + length_rule.count.width
    if len(pdu) < end:
        return None
    return length_rule.base + length_rule.count.scale * int.from_bytes(pdu[length_rule.count.offset : end], "big")


def sound_roles(pdu: bytes) -> tuple[Role, ...]:
    """The roles in which a whole PDU is of a declared function and as long as that predicts."""
    if not pdu:
        return ()
    rules, code, size = _all().rules, pdu[0], len(pdu)
    return tuple(
        role
        for role in _ROLES
        if (length_rule := rules.get((code, role))) is not None
        and (length_rule.variable or _length_by(length_rule, pdu) == size)
    )


def adu_end(data: bytes, role: Role) -> int | None:
    """Where the RTU ADU ends with which `data` begin, one of this role if it may be; None: it is not whole yet.

    A right CRC alone does not tell: of 256 ADUs one ends in 00, and is right a byte before its end already.
    """
    ends = crc_ends(data, 0, MAX_ADU)
    sound = {end: sound_roles(data[1 : end - CRC_SIZE]) for end in ends}
    likely = [end for end in ends if role in sound[end]]
    predicted = pdu_length(data[1:], role) or 0
    if not likely and OVERHEAD + predicted <= len(data):
        likely = [end for end in ends if sound[end]] or ends
    return likely[0] if likely else None


def is_open(function: int, role: Role) -> bool:
    """Whether nothing says how long a frame of this function is."""
    declared = rule(function, role)
    return declared is None or declared.variable or (declared.base is None and declared.walk is None)


def plausibility(pdu: bytes, role: Role) -> list[str]:
    """The checks that a PDU breaks, in words; checks of fields that it does not reach are left out."""
    length_rule = rule(pdu[0], role) if pdu else None
    if length_rule is None:
        return []
    names = {offset: name for name, (offset, _) in layout(pdu[0], role).items()}
    broken = []
    for check in length_rule.checks:
        words = broken_value(check, pdu)
        if words:
            offset = check.count_offset if isinstance(check, Sized) else check.offset
            broken.append(f"{names.get(offset, f'byte {offset}')}: {words}")
    return broken


@dataclass(frozen=True, slots=True)
class Expectation:
    """What the answer to one request must look like."""

    unit: int
    function: int
    marks: tuple[tuple[int, bytes], ...]  # (offset, the unit's being 0, and the bytes that must stand there)

    def fits(self, response: bytes) -> bool:
        """Whether a response (the whole one, or its beginning) answers the request; an exception always may."""
        if len(response) < 2 or response[0] != self.unit:
            return False
        if response[1] == self.function | EXCEPTION:
            return True
        if response[1] != self.function:
            return False
        for at, mark in self.marks:  # noqa: SIM110 - the lattice asks this for every path
            if response[at : at + len(mark)] != mark:
                return False
        return True

    @property
    def header(self) -> bytes:
        """The first bytes that such an answer (no exception) must have."""
        head = bytes((self.unit, self.function))
        for at, mark in self.marks:
            if at != len(head):
                break
            head += mark
        return head


def expectation(request: bytes) -> Expectation:
    """The expectation that a request raises."""
    return _expectation(request, revision())


@lru_cache(maxsize=4096)
def _expectation(request: bytes, _revision: int) -> Expectation:
    marks = []
    for relation in relations(request[1]):
        if isinstance(relation, RequestedByteCount):
            at = relation.quantity_offset + 1
            count = taken(int.from_bytes(request[at : at + 2], "big"), relation.bits) & 0xFF
            marks.append((relation.count_offset + 1, bytes([count])))
        else:
            at = relation.request_offset + 1
            marks.append((relation.response_offset + 1, request[at : at + relation.width]))
    return Expectation(request[0], request[1], tuple(sorted(marks)))
