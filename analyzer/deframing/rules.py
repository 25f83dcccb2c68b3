"""What arrays know of the protocol: the length rules of `dissectors.lengths` as tables, and CRC-16 of any window.

Protocol knowledge stays in the declarations: this file only turns `Rule` values, which speak of one PDU, into lookup
tables by function code, which speak of every offset of a block at once. Offsets here are in the ADU (the unit is 0).

The CRC is linear over GF(2). Let A be the step of the CRC register over one zero byte, T[b] the register that byte b
leaves, and s[j] the running register (from 0) before byte j: s[j+1] = A s[j] ^ T[b]. "Unwinding" the register by its
position, u[j] = A^-j s[j], turns the recurrence into a plain exclusive or: u[j+1] = u[j] ^ A^-(j+1) T[b]. A window
[i, j) that ends in its own check value leaves 0000 from the initial FFFF, which is u[j] == u[i] ^ A^-i FFFF. So

    heads[i] = u[i] ^ A^-i FFFF,  tails[j] = u[j]:   window [i, j) checks  <=>  heads[i] == tails[j].

A^-k T[b] needs no matrices: x generates all non-zero registers of even parity (32767 of them, one orbit of A), and an
odd one is an even one plus A's fixed point. So a register is a logarithm and a parity, A^-k subtracts k from the
logarithm, and a table of 32767 powers does the rest.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Final, NamedTuple, overload

import numpy as np
from numpy.typing import NDArray

from dissectors.columnar import pdu_ends
from dissectors.crc import CRC_TABLE
from dissectors.length_rules import LengthRule, PduWalk, Role
from dissectors.lengths import RULES, pdu_length
from dissectors.limits import CRC_SIZE, MIN_ADU, OVERHEAD, Bound, Choice, Multiple, Sized, taken
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
    length: PduWalk
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
    if not isinstance(check, Sized):
        kept = check

        def fits(data: Bytes, at: Index) -> Mask:
            right: Mask = kept.fits(big_endian_at(data, at + kept.offset + 1, kept.width))
            return right

        return fits, exact_bits(_bits(check))

    def sized(data: Bytes, at: Index) -> Mask:
        quantity = big_endian_at(data, at + check.quantity_offset + 1, 2)
        right: Mask = big_endian_at(data, at + check.count_offset + 1, 1) == taken(quantity, check.bits)
        return right

    return sized, 8.0


def _bits(check: Bound | Choice | Multiple) -> float:
    """How seldom chance fulfils a check; a bound may reach beyond what its field holds."""
    if isinstance(check, Bound):
        span = 1 << (8 * check.width)
        return math.log2(span / (min(check.high, span - 1) - check.low + 1))
    return check.bits


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
    if rule.base is None:
        end = at + length - CRC_SIZE
        found = None if rule.walk is None else pdu_ends(rule.walk.declaration)
        if found is None:
            windows = zip((at + 1).tolist(), end.tolist(), strict=True)
            return np.array([pdu_length(data[i:j].tobytes(), role) == j - i for i, j in windows], np.bool_)
        fits = (found(data, at + 2, end) == end).nonzero()[0]
    else:
        due: int | Index = rule.base + OVERHEAD
        if rule.count is not None:
            place = np.minimum(at + (rule.count.offset + 1), len(data) - rule.count.width)
            due = big_endian_at(data, place, rule.count.width) * rule.count.scale + due
        fits = (length == due).nonzero()[0]
    for check in rule.checks:
        if not check.soft:
            passed = length.take(fits) < _reach(check) + CRC_SIZE  # it ends before that field
            passed[~passed] = _check(check)[0](data, at.take(fits[~passed]))
            fits = fits[passed]
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


PERIOD: Final = 32767
_FEW: Final = 192  # bytes: of so few, one by one is faster than by arrays
_SLICE: Final = 1 << 16  # bytes worked on at once: what stays in the cache

U16 = NDArray[np.uint16]


class CrcWindows(NamedTuple):
    """Check [i, j) by `heads[i] == tails[j]`; one entry a byte boundary (n bytes give n + 1)."""

    heads: U16
    tails: U16


def possible_starts(crc: CrcWindows, at: int, size: int) -> frozenset[int]:
    """Which of the `size` bytes from index `at` on may begin a window that ends among them and checks.

    All that do are told; of the others, one in 65,536 is told a byte of `size`.
    """
    tails, heads = crc.tails[at : at + size + 1], crc.heads[at : at + size]
    if size <= _FEW:
        ends = frozenset(tails.tolist())
        return frozenset(start for start, head in enumerate(heads.tolist()) if head in ends)
    marked = np.zeros(1 << 16, np.bool_)
    marked[tails] = True
    return frozenset(marked.take(heads).nonzero()[0].tolist())


class _RegisterTables(NamedTuple):
    powers: U16  # A^k T[1] over two periods, then zeros; then the same with A's fixed point
    logs: NDArray[np.intp]  # of T[b]; into the zeros where T[b] has none; into the second half where it is odd
    turns: NDArray[np.intp]  # -(k + 1) mod PERIOD, for a slice at any phase
    initial: U16  # A^-k FFFF, for a slice at any phase


@cache
def _register_tables() -> _RegisterTables:
    registers = np.arange(1 << 16)
    steps = (registers >> 8) ^ np.array(CRC_TABLE)[registers & 0xFF]
    fixed = int(np.flatnonzero(steps == registers)[1])  # the first is 0
    orbit, leap = np.array([CRC_TABLE[1]]), steps
    while len(orbit) < PERIOD:  # `leap` goes as many steps as there are
        orbit, leap = np.concatenate((orbit, leap[orbit])), leap[leap]
    period = orbit[:PERIOD].astype(np.uint16)
    log = np.full(1 << 16, 2 * PERIOD)
    log[period] = np.arange(PERIOD)
    even = np.concatenate((period, period, np.zeros_like(period)))
    powers = np.concatenate((even, even ^ np.uint16(fixed)))

    def place(register: int) -> int:
        """Where the powers of a register begin."""
        odd = register != 0 and log[register] >= PERIOD
        return int(log[register ^ fixed]) + len(even) if odd else int(log[register])

    k = np.arange(PERIOD + _SLICE + 1)
    return _RegisterTables(
        powers,
        np.array([place(CRC_TABLE[b]) for b in range(256)], np.intp),
        ((-k - 1) % PERIOD).astype(np.intp),
        powers[place(0xFFFF) + (-k % PERIOD)],
    )


def crc_windows(data: NDArray[np.uint8]) -> CrcWindows:
    """Heads and tails of `data` (shape n), each of shape n + 1."""
    registers = _register_tables()
    if len(data) <= _FEW:
        return _of_few(data, registers)
    heads = np.empty(len(data) + 1, np.uint16)
    tails = np.empty(len(data) + 1, np.uint16)
    tails[0] = 0
    for begin in range(0, len(data), _SLICE):
        piece = data[begin : begin + _SLICE]
        n, phase = len(piece), begin % PERIOD
        turned = registers.logs.take(piece)
        turned += registers.turns[phase : phase + n]
        steps = registers.powers.take(turned)
        steps[0] ^= tails[begin]
        tails[begin + 1 : begin + n + 1] = _running(steps)
        np.bitwise_xor(tails[begin : begin + n], registers.initial[phase : phase + n], out=heads[begin : begin + n])
    heads[-1] = tails[-1] ^ registers.initial[len(data) % PERIOD]
    return CrcWindows(heads, tails)


def _of_few(data: NDArray[np.uint8], registers: _RegisterTables) -> CrcWindows:
    """The same of few bytes, in fewer steps."""
    n = len(data)
    tails = np.zeros(n + 1, np.uint16)
    np.bitwise_xor.accumulate(registers.powers.take(registers.logs.take(data) + registers.turns[:n]), out=tails[1:])
    return CrcWindows(tails ^ registers.initial[: n + 1], tails)


def _running(steps: U16) -> U16:
    """The exclusive or of each entry and all before it: four entries at once as the lanes of a word, then the words."""
    words = np.zeros(-(-len(steps) // 4), "<u8")
    lanes = words.view("<u2")
    lanes[: len(steps)] = steps
    words ^= words << 16
    words ^= words << 32
    words[1:] ^= np.bitwise_xor.accumulate(words >> 48)[:-1] * 0x0001_0001_0001_0001
    return lanes[: len(steps)]
