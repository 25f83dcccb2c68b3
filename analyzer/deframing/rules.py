"""The length rules of `dissectors.lengths`, compiled to tables that arrays can be put through.

Protocol knowledge stays in the declarations: this file only turns `Rule` values, which speak of one PDU, into lookup
tables by function code, which speak of every offset of a block at once. Offsets here are in the ADU (the unit is 0).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Final, overload

import numpy as np
from numpy.typing import NDArray

from dissectors.adu import MIN_ADU, OVERHEAD
from dissectors.length_rules import LengthRule, Role
from dissectors.lengths import RULES, pdu_length
from dissectors.limits import Bound, Choice, Multiple, Sized, taken
from dissectors.registry import revision

Bytes = NDArray[np.uint8]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_STEPS: Final = 1024.0


@overload
def exact_bits(bits: float) -> float: ...
@overload
def exact_bits(bits: NDArray[np.float64]) -> NDArray[np.float64]: ...
def exact_bits(bits: float | NDArray[np.float64]) -> float | NDArray[np.float64]:
    """Bits of evidence to the nearest step of 1/1024: sums of them are exact, whatever the order.

    Two explanations may weigh the same (of writes that look like their echoes, which asks?). Then the order of the
    paths decides, and that must not hang on what was added up before: a lattice begins where the last decision ended.
    """
    return np.rint(bits * _STEPS) / _STEPS if isinstance(bits, np.ndarray) else round(bits * _STEPS) / _STEPS


@dataclass(frozen=True, slots=True)
class CountedLengths:
    """Functions of a role whose length hangs on a count at the same place in the same way: base + scale * field."""

    role: Role
    offset: int
    width: int
    scale: int
    base: int
    functions: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class WalkedLengths:
    """A function of a role whose length takes a walk through its bytes."""

    role: Role
    function: int
    length: Callable[[bytes], int | None]  # of a PDU
    reach: int  # bytes that the checks look at


@dataclass(frozen=True, slots=True)
class FrameRule:
    """A function of a role, for a look at one place: an ADU's length is base + scale * field, or takes a walk."""

    role: Role
    offset: int
    width: int
    scale: int
    base: int
    walk: WalkedLengths | None = None


@dataclass(frozen=True, slots=True)
class FunctionGroups:
    """Up to eight groups whose functions one pass over the bytes finds: `table` maps a function to the groups' bits."""

    table: bytes
    groups: tuple[CountedLengths | WalkedLengths, ...]


@dataclass(frozen=True, slots=True)
class RoleChecks:
    """What a PDU of one function and role can be held to, once its length and CRC are right."""

    hard: tuple[Callable[[Bytes, Index], Mask], ...]
    soft: tuple[Callable[[Bytes, Index], Mask], ...]
    bits: float  # evidence of passing all of the hard ones
    soft_bits: tuple[float, ...]  # evidence of passing each soft one
    declared: tuple[Bound | Choice | Multiple | Sized, ...]  # all of them, as they are declared


@dataclass(frozen=True, slots=True)
class LengthTables:
    """Everything about lengths, by function byte (exceptions have theirs, with the high bit)."""

    fixed: tuple[tuple[int, tuple[tuple[Role, Mask], ...]], ...]  # ADU length, and which functions have it in a role
    marked: tuple[FunctionGroups, ...]
    checks: tuple[RoleChecks | None, ...]  # 512: by 256 * role + function
    of_function: tuple[tuple[FrameRule, ...], ...]  # all of these, by function
    known: Mask  # functions with a predicted length
    certain: Mask  # and of these those whose requests and responses do not look alike


def big_endian_at(data: Bytes, at: Index, width: int) -> Index:
    """Big-endian fields of 1 or 2 bytes at many places."""
    value = data.take(at).astype(np.intp)
    return value if width == 1 else (value << 8) | data.take(at + 1)


def _check(check: Bound | Choice | Multiple | Sized) -> tuple[Callable[[Bytes, Index], Mask], float]:
    """A check as a function of (bytes, starts of ADUs), and the bits that passing it is worth."""
    if isinstance(check, Bound):
        span = 1 << (8 * check.width)
        return (
            lambda data, at: _in_range(big_endian_at(data, at + check.offset + 1, check.width), check.low, check.high),
            exact_bits(math.log2(span / (min(check.high, span - 1) - check.low + 1))),
        )
    if isinstance(check, Choice):
        return (
            lambda data, at: _among(big_endian_at(data, at + check.offset + 1, check.width), check.values),
            exact_bits(8 * check.width - math.log2(len(check.values))),
        )
    if isinstance(check, Multiple):
        return (
            lambda data, at: big_endian_at(data, at + check.offset + 1, check.width) % check.n == 0,
            exact_bits(math.log2(check.n)),
        )

    def sized(data: Bytes, at: Index) -> Mask:
        quantity = big_endian_at(data, at + check.quantity_offset + 1, 2)
        fits: Mask = big_endian_at(data, at + check.count_offset + 1, 1) == taken(quantity, check.bits)
        return fits

    return sized, 8.0


def _in_range(value: Index, low: int, high: int) -> Mask:
    inside: Mask = (value >= low) & (value <= high)
    return inside


def _among(value: Index, values: Sequence[int]) -> Mask:
    found = np.zeros(len(value), np.bool_)
    for one in values:
        found |= value == one
    return found


def _reach(check: Bound | Choice | Multiple | Sized) -> int:
    """How many bytes of an ADU a check looks at."""
    if isinstance(check, Sized):
        return max(check.count_offset + 2, check.quantity_offset + 3)
    return check.offset + check.width + 1


def _checks(rule: LengthRule) -> RoleChecks:
    compiled = [(_check(check), check.soft) for check in rule.checks]
    return RoleChecks(
        tuple(test for (test, _), soft in compiled if not soft),
        tuple(test for (test, _), soft in compiled if soft),
        sum(bits for (_, bits), soft in compiled if not soft),
        tuple(bits for (_, bits), soft in compiled if soft),
        rule.checks,
    )


def lengths_fit(data: Bytes, at: Index, length: Index, function: int, role: Role) -> Mask:
    """Which ADUs (starts and lengths) of one function byte are as long as its declaration predicts in a role."""
    rule = RULES.get((function, role))
    if rule is None:
        return np.zeros(len(at), np.bool_)
    if rule.variable:
        return np.ones(len(at), np.bool_)
    if rule.base is None or max(map(_reach, rule.checks), default=0) > rule.base + 1:
        windows = zip((at + 1).tolist(), (length - OVERHEAD).tolist(), strict=True)
        return np.array([pdu_length(data[i : i + n].tobytes(), role) == n for i, n in windows], np.bool_)
    due: int | Index = rule.base + OVERHEAD
    if rule.count is not None:
        place = np.minimum(at + (rule.count.offset + 1), len(data) - rule.count.width)
        due = big_endian_at(data, place, rule.count.width) * rule.count.scale + due
    fits = (length == due).nonzero()[0]
    checks = length_tables().checks[256 * role + function]
    for test in checks.hard if checks is not None else ():
        fits = fits[test(data, at.take(fits))]
    sound = np.zeros(len(at), np.bool_)
    sound[fits] = True
    return sound


def length_tables() -> LengthTables:
    """The tables, made anew when a user has registered another function."""
    return _tables(revision())


@cache
def _tables(_revision: int) -> LengthTables:
    fixed: dict[int, dict[Role, Mask]] = {}
    counted: dict[tuple[Role, int, int, int, int], list[int]] = {}
    walked: list[WalkedLengths] = []
    of_function: list[list[FrameRule]] = [[] for _ in range(256)]
    checks: list[RoleChecks | None] = [None] * (256 * len(Role))
    known = np.zeros(256, np.bool_)
    for rule in RULES.values():
        if rule.base is None and rule.walk is None:
            continue
        known[rule.function] |= rule.role is Role.REQUEST
        checks[256 * rule.role + rule.function] = _checks(rule)
        if rule.walk is not None:
            reach = max((_reach(check) for check in rule.checks), default=MIN_ADU)
            walked.append(WalkedLengths(rule.role, rule.function, rule.walk, reach))
            of_function[rule.function].append(FrameRule(rule.role, 0, 0, 0, 0, walked[-1]))
        elif rule.count is not None:
            base = (rule.base or 0) + OVERHEAD
            key = (rule.role, rule.count.offset + 1, rule.count.width, rule.count.scale, base)
            counted.setdefault(key, []).append(rule.function)
            of_function[rule.function].append(FrameRule(*key))
        else:
            of_function[rule.function].append(FrameRule(rule.role, 0, 0, 0, (rule.base or 0) + OVERHEAD))
            of_length = fixed.setdefault((rule.base or 0) + OVERHEAD, {})
            of_length.setdefault(rule.role, np.zeros(256, np.bool_))[rule.function] = True
    groups: list[CountedLengths | WalkedLengths] = [
        *(CountedLengths(*key, tuple(functions)) for key, functions in counted.items()),
        *walked,
    ]
    certain = known.copy()
    for of_length in fixed.values():
        if len(of_length) == len(Role):
            certain &= ~(of_length[Role.REQUEST] & of_length[Role.RESPONSE])
    return LengthTables(
        tuple((length, tuple(fixed[length].items())) for length in sorted(fixed)),
        tuple(_marked(groups[i : i + 8]) for i in range(0, len(groups), 8)),
        tuple(checks),
        tuple(map(tuple, of_function)),
        known,
        certain,
    )


def _marked(groups: list[CountedLengths | WalkedLengths]) -> FunctionGroups:
    table = bytearray(256)
    for i, group in enumerate(groups):
        for function in (group.function,) if isinstance(group, WalkedLengths) else group.functions:
            table[function] |= 1 << i
    return FunctionGroups(bytes(table), tuple(groups))
