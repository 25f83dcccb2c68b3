"""Every place in a block where a frame could stand: offset, role, length predicted by the bytes there, CRC right.

Array arithmetic over all offsets at once. Where the length does not hang on the bytes, the CRC is compared first (two
shifted arrays, the cheapest pass there is) and the function looked at in the few hits; where a count gives the length,
the function is looked at first. A candidate proves little by itself (1 window in 65,536 checks by chance, and payloads
hold whole frames): `base` says how much, in bits, and the lattice decides.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role

from .prefix import Windows
from .rules import MAX_ADU, MIN_ADU, OVERHEAD, Bytes, Index, RoleTables, field, tables

CRC_BITS: Final = 16.0
KNOWN_BITS: Final = 3.0  # one of the 20-odd functions in use, of 256
STRANGE_BITS: Final = -3.0  # an exception of a function that nobody has declared
GLITCHES: Final = frozenset((0x00, 0xFE, 0xFF))  # what RS-485 drivers leave on the line when they switch
ZERO_BITS: Final = -8.0  # 1 in 256 check values ends in 00
BROKEN_LIMIT: Final = -6.0  # a limit of the specification that real frames do break now and then


@dataclass(frozen=True, slots=True)
class Candidates:
    """Columns, ordered by start, then end, then role."""

    start: Index
    end: Index
    role: NDArray[np.uint8]
    structure: NDArray[np.float32]  # bits: function and checks; the CRC's are the same for all

    def __len__(self) -> int:
        return len(self.start)

    def of(self, role: Role) -> Candidates:
        """Those of one role."""
        mine = self.role == role
        return Candidates(self.start[mine], self.end[mine], self.role[mine], self.structure[mine])


def search(data: Bytes, crc: Windows) -> Candidates:
    """All candidates that lie whole in `data`."""
    starts: list[Index] = []
    ends: list[Index] = []
    roles: list[NDArray[np.uint8]] = []
    bits: list[NDArray[np.float32]] = []
    for role in (Role.REQUEST, Role.RESPONSE):
        rules = tables(role)
        start, end = _checking(data, crc, rules)
        start, end, structure = _weigh(data, start, end, rules)
        starts.append(start)
        ends.append(end)
        roles.append(np.full(len(start), role, np.uint8))
        bits.append(structure)
    start, end, role_of = np.concatenate(starts), np.concatenate(ends), np.concatenate(roles)
    order = np.lexsort((role_of, end, start))
    structure = np.concatenate(bits)[order]
    start, end = start[order], end[order]
    structure[1:] += _zeros(data, start, end)
    return Candidates(start, end, role_of[order], structure)


def _zeros(data: Bytes, start: Index, end: Index) -> NDArray[np.float32]:
    """Bits that candidates, but for the first, lose to a shorter one before them, behind which they hold only zeros.

    Zeros behind a right CRC leave it right, so it proves nothing that the shorter one's does not.
    """
    more = np.where(start[1:] == start[:-1], end[1:] - end[:-1], 0)
    some = np.flatnonzero((more > 0) & (more <= 4))
    lost = np.zeros(len(more), np.float32)
    for i in some.tolist():
        if not data[end[i] : end[i + 1]].any():
            lost[i] = ZERO_BITS * more[i]
    return lost


def _checking(data: Bytes, crc: Windows, rules: RoleTables) -> tuple[Index, Index]:
    """Starts and ends of the windows of predicted length whose CRC is right."""
    heads, tails = crc
    n = len(data)
    found: list[tuple[Index, Index]] = []
    for length, functions in rules.fixed:
        if n >= length:
            start = np.flatnonzero(heads[: n - length + 1] == tails[length:])
            start = start[functions.take(data.take(start + 1))]
            found.append((start, start + length))
    for group in rules.counted:
        least = group.offset + group.width
        if n > least:
            base = group.base.take(data[1 : n - least + 1])
            start = np.flatnonzero(base)
            end = start + base.take(start) + group.scale * field(data, start + group.offset, group.width)
            fits = end <= n
            start, end = start[fits], end[fits]
            right = heads.take(start) == tails.take(end)
            start, end = start[right], end[right]
            short = end - start <= MAX_ADU
            found.append((start[short], end[short]))
    for function, walk, reach in rules.walked:
        start = np.flatnonzero(
            data[1 : max(1, n - reach + 1)] == function
        )  # a walk is slow: first what arrays can rule out
        checks = rules.checks[function]
        for test in checks.hard if checks is not None else ():
            start = start[test(data, start)]
        walks = [(i, walk(data[i + 1 : i + MAX_ADU].tobytes())) for i in start.tolist()]
        pairs = [(i, i + k + OVERHEAD) for i, k in walks if k is not None and k > 0 and i + k + OVERHEAD <= n]
        start, end = np.array(pairs, np.intp).reshape(-1, 2).T
        right = heads.take(start) == tails.take(end)
        found.append((start[right], end[right]))
    if not found:
        return np.empty(0, np.intp), np.empty(0, np.intp)
    return np.concatenate([f[0] for f in found]), np.concatenate([f[1] for f in found])


def _weigh(data: Bytes, start: Index, end: Index, rules: RoleTables) -> tuple[Index, Index, NDArray[np.float32]]:
    """Drop what breaks a hard check; give the rest its structural bits."""
    functions = data.take(start + 1)
    declared = tables(Role.REQUEST).known.take(functions & 0x7F)
    structure = np.where(declared, np.float32(KNOWN_BITS), np.float32(STRANGE_BITS))
    keep = np.ones(len(start), np.bool_)
    for i in np.flatnonzero(functions >= 0xFE).tolist():  # an exception of 7E or 7F, or what drivers leave behind
        keep[i] = not GLITCHES.issuperset(data[start[i] : end[i]].tobytes())
    for function in np.flatnonzero(np.bincount(functions, minlength=256)).tolist():
        checks = rules.checks[function]
        if checks is None:
            continue
        which = np.flatnonzero(functions == function)
        at = start[which]
        for test in checks.hard:
            keep[which] &= test(data, at)
        structure[which] += checks.bits
        for test, bits in zip(checks.soft, checks.soft_bits, strict=True):
            structure[which] += np.where(test(data, at), np.float32(bits), np.float32(BROKEN_LIMIT))
    return start[keep], end[keep], structure[keep]


def lengths_at(data: bytes, start: int) -> list[tuple[int, Role]]:
    """Predicted ADU lengths at one offset, per role; a length beyond the data is a frame that may still come.

    Roles that the bytes rule out are left out; a header that is not whole yet gives MIN_ADU, the least it can be.
    """
    found = []
    for role in (Role.REQUEST, Role.RESPONSE):
        length = predicted(data, start, role)
        if length is not None:
            found.append((length, role))
    return found


def predicted(data: bytes, start: int, role: Role) -> int | None:
    """The ADU length that the header at `start` predicts for a role, MIN_ADU while the header is not whole, or None."""
    from dissectors.lengths import pdu_length, rule

    pdu = data[start + 1 : start + MAX_ADU]
    if not pdu:
        return MIN_ADU
    declared = rule(pdu[0], role)
    if declared is None or (declared.base is None and declared.walk is None):
        return None
    length = pdu_length(pdu, role)
    if length is None:
        return max(MIN_ADU, len(pdu) + OVERHEAD)
    return None if length < 0 else length + OVERHEAD
