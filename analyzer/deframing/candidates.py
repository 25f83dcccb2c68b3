"""Every place in a block where a frame could stand: offset, role, length predicted by the bytes there, CRC right.

Array arithmetic over all offsets at once. Where the length does not hang on the bytes, the CRC is compared first (two
shifted arrays, the cheapest pass there is) and the function looked at in the few hits; where a count gives the length,
the function is looked at first. A candidate proves little by itself (1 window in 65,536 checks by chance, and payloads
hold whole frames): `base` says how much, in bits, and the lattice decides.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.columnar import pdu_ends
from dissectors.length_rules import Role, broken_value
from dissectors.limits import MAX_ADU, MAX_PDU, MIN_ADU, OVERHEAD

from ..tables.schema import GLITCHES
from .rules import (
    Bytes,
    CountedLengths,
    CrcWindows,
    Index,
    LengthTables,
    Mask,
    WalkedLengths,
    big_endian_at,
    length_tables,
)

CRC_BITS: Final = 16.0
KNOWN_BITS: Final = 3.0  # one of the 20-odd functions in use, of 256
STRANGE_BITS: Final = -3.0  # an exception of a function that nobody has declared
_NONE: Final = np.empty(0, np.intp)
_LITTLE: Final = 1024  # bytes in which at most
_FEW: Final = 32  # places where a window with a right CRC begins are looked at one by one
_NEVER: Final = 1 << 62  # further than any byte
ZERO_BITS: Final = -8.0  # 1 in 256 check values ends in 00
_BITS_OF_FUNCTION: Final = np.array([STRANGE_BITS, KNOWN_BITS], np.float32)  # by whether it is declared
UNLIKELY_ROLE: Final = -4.0  # bits: the role in which these bytes break a limit, where they break none in the other
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

    @classmethod
    def none(cls) -> Candidates:
        """None at all."""
        return cls(_NONE, _NONE, np.empty(0, np.uint8), np.empty(0, np.float32))

    def of(self, role: Role) -> Candidates:
        """Those of one role."""
        mine = self.role == role
        return Candidates(self.start[mine], self.end[mine], self.role[mine], self.structure[mine])


def search_candidates(data: Bytes, crc: CrcWindows) -> Candidates:
    """All candidates that lie whole in `data`."""
    rules = length_tables()
    if len(data) <= _LITTLE:
        octets, heads, tails = data.tobytes(), crc.heads.tolist(), crc.tails.tolist()
        ends = set(tails)
        starts = [i for i, head in enumerate(heads) if head in ends]
        if len(starts) <= _FEW:
            return _search_few(data, octets, _windows_at(octets, starts, heads, tails, rules), rules)
    found = [*_fixed(data, crc, rules), *_marked(data, crc, rules)]
    if not found:
        return Candidates.none()
    start = np.concatenate([place.start for place in found])
    end = np.concatenate([place.end for place in found])
    role = np.array([place.role for place in found], np.uint8).repeat([len(place.start) for place in found])
    order = ((start << 16) + ((end - start) << 1) + role).argsort(kind="stable")
    start, end, role = start.take(order), end.take(order), role.take(order)
    return _weighed(data, start, end, role, *_weigh(data, start, end, role, rules))


def _weighed(
    data: Bytes, start: Index, end: Index, role: NDArray[np.uint8],
    keep: Mask, structure: NDArray[np.float32], broken: Mask,
) -> Candidates:  # fmt: skip
    """Candidates in order, as `_weigh` weighs each, held against each other."""
    if broken.any():
        _rule_out(keep, start, end, broken)
    if not keep.all():
        start, end, role, structure, broken = start[keep], end[keep], role[keep], structure[keep], broken[keep]
    _weigh_zeros(structure, data, start, end, broken)
    _weigh_roles(structure, start, end, broken)
    return Candidates(start, end, role, structure)


def _windows_at(
    octets: bytes, starts: Sequence[int], heads: Sequence[int], tails: Sequence[int], rules: LengthTables
) -> list[tuple[int, int, Role]]:
    """What `_fixed` and `_marked` find of a few places, in order: start, end, role."""
    n, found = len(octets), []
    for at in starts:
        for rule in rules.of_function[octets[at + 1]] if at + MIN_ADU <= n else ():
            walk, end = rule.walk, at + rule.base
            if walk is not None:
                size = walk.length(octets[at + 1 : at + MAX_ADU]) if at + walk.reach <= n else None
                end = at + size + OVERHEAD if size is not None and size > 0 else n + 1
            elif rule.scale:
                field = at + rule.offset
                counted = octets[field : field + rule.width]
                if len(counted) < rule.width:
                    continue
                end += rule.scale * int.from_bytes(counted, "big")
                if end - at > MAX_ADU:
                    continue
            if end <= n and heads[at] == tails[end]:
                found.append((at, end, rule.role))
    found.sort()
    return found


def _search_few(data: Bytes, octets: bytes, found: list[tuple[int, int, Role]], rules: LengthTables) -> Candidates:
    """Candidates of a few windows: looked at one by one, which takes less than arrays of so few would."""
    if not found:
        return Candidates.none()
    weighed = [_weigh_one(octets, *window, rules) for window in found]
    start, end, role = zip(*found, strict=True)
    keep, structure, broken = zip(*weighed, strict=True)
    columns = np.array(start, np.intp), np.array(end, np.intp), np.array(role, np.uint8)
    bits = np.array(structure, np.float32)
    if all(keep) and not any(broken) and len(set(start)) == len(start):
        return Candidates(*columns, bits)
    return _weighed(data, *columns, np.array(keep, np.bool_), bits, np.array(broken, np.bool_))


def _weigh_one(octets: bytes, start: int, end: int, role: Role, rules: LengthTables) -> tuple[bool, float, bool]:
    """As `_weigh`, of one candidate. Bits are exact whatever their order, see `rules.exact_bits`."""
    function = octets[start + 1]
    keep, broken = function < 0xFE or not GLITCHES.issuperset(octets[start:end]), False
    structure = KNOWN_BITS if rules.known[function & 0x7F] else STRANGE_BITS
    checks = rules.checks[256 * role + function]
    if checks is None:
        return keep, structure, broken
    pdu = octets[start + 1 : start + MAX_ADU]
    structure += checks.bits
    soft_bits = iter(checks.soft_bits)
    for check in checks.declared:
        wrong = broken_value(check, pdu) is not None
        if not check.soft:
            keep = keep and not wrong
        elif wrong:
            broken, structure = True, structure + BROKEN_LIMIT
            next(soft_bits)
        else:
            structure += next(soft_bits)
    return keep, structure, broken


def more_candidates(known: Candidates, searched: int, data: Bytes, crc: CrcWindows) -> Candidates:
    """The same, where those that end in the first `searched` bytes are known: each hangs on its own bytes alone."""
    low = max(0, searched - MAX_ADU)
    found = search_candidates(data[low:], CrcWindows(crc.heads[low:], crc.tails[low:]))
    new = found.end > searched - low
    start, end = found.start[new] + low, found.end[new] + low
    if not len(known):
        return Candidates(start, end, found.role[new], found.structure[new])
    start, end = np.concatenate((known.start, start)), np.concatenate((known.end, end))
    role = np.concatenate((known.role, found.role[new]))
    structure = np.concatenate((known.structure, found.structure[new]))
    order = ((start << 16) + ((end - start) << 1) + role).argsort(kind="stable")
    return Candidates(start[order], end[order], role[order], structure[order])


def _rule_out(keep: Mask, start: Index, end: Index, broken: Mask) -> None:
    """Drop those that break a limit and hold, or begin like, one that breaks none.

    `01 03 02 00 19 79 8E 00` is an answer and a stray byte, whatever a request for 6521 registers looks like. Where the
    very same bytes are legal in the other role (`_weigh_roles`) the conversation may tell.
    """
    legal = (keep & ~broken).nonzero()[0]
    if not len(legal):
        return
    some = (keep & broken).nonzero()[0]
    begin, until = start.take(some), end.take(some)
    starts, ends = start.take(legal), end.take(legal)  # in this order
    soonest = np.append(np.minimum.accumulate(ends[::-1])[::-1], _NEVER)  # end of any from here on
    shorter = soonest.take(starts.searchsorted(begin, side="right")) <= until
    alike = starts.searchsorted(begin)
    shorter |= (np.append(starts, -1).take(alike) == begin) & (np.append(ends, _NEVER).take(alike) < until)
    keep[some[shorter]] = False


def _weigh_zeros(structure: NDArray[np.float32], data: Bytes, start: Index, end: Index, broken: Mask) -> None:
    """Take bits from candidates that hold only zeros behind a shorter one with the same start.

    Zeros behind a right CRC leave it right, so it proves nothing that the shorter one's does not. But where only the
    shorter one breaks a limit, the longer one is the frame, for every 256th check value ends in 00, and gains them.
    """
    longer = (start[1:] == start[:-1]).nonzero()[0] + 1
    more = end.take(longer) - end.take(longer - 1)
    for i in longer.compress((more > 0) & (more <= 4)).tolist():
        if not data[end[i - 1] : end[i]].any():
            zeros = int(end[i] - end[i - 1])
            structure[i] += -ZERO_BITS if broken[i - 1] and not broken[i] else ZERO_BITS * zeros


def _weigh_roles(structure: NDArray[np.float32], start: Index, end: Index, broken: Mask) -> None:
    """Take bits from candidates that break a limit where the very same bytes break none in the other role.

    So that the legal one is likelier, and not so much that it is decided before what follows may speak for the other.
    """
    same = ((start[1:] == start[:-1]) & (end[1:] == end[:-1])).nonzero()[0]
    structure[same.compress(broken[same] & ~broken[same + 1])] += UNLIKELY_ROLE
    structure[1 + same.compress(broken[same + 1] & ~broken[same])] += UNLIKELY_ROLE


class _CheckedWindows(NamedTuple):
    """Windows of predicted length whose CRC is right."""

    role: Role
    start: Index
    end: Index


def _fixed(data: Bytes, crc: CrcWindows, rules: LengthTables) -> Iterator[_CheckedWindows]:
    """Of functions whose length does not hang on the bytes."""
    heads, tails = crc
    n = len(data)
    for length, functions in rules.fixed:
        if n < length:
            continue
        start = (heads[: n - length + 1] == tails[length:]).nonzero()[0]
        if not len(start):
            continue
        function = data.take(start + 1)
        for role, mine in functions:
            of_role = start.compress(mine.take(function))
            if len(of_role):
                yield _CheckedWindows(role, of_role, of_role + length)


def _marked(data: Bytes, crc: CrcWindows, rules: LengthTables) -> Iterator[_CheckedWindows]:
    """Of functions that have a count, or take a walk."""
    octets = data.tobytes()
    for marked in rules.marked:
        marks = np.frombuffer(octets.translate(marked.table), np.uint8)[1:]
        some = marks.nonzero()[0]
        marks = marks.take(some)
        present = int(np.bitwise_or.reduce(marks))
        for i, group in enumerate(marked.groups):
            if not present & 1 << i:
                continue
            start = some.compress(marks & np.uint8(1 << i) != 0)
            if isinstance(group, CountedLengths):
                yield _CheckedWindows(group.role, *_counted(data, crc, start, group))
            else:
                yield _CheckedWindows(group.role, *_walked(data, crc, start, group, rules))


def _counted(data: Bytes, crc: CrcWindows, start: Index, group: CountedLengths) -> tuple[Index, Index]:
    """Starts and ends of a group's functions."""
    n = len(data)
    start = start[: int(start.searchsorted(n - group.offset - group.width, side="right"))]
    end = big_endian_at(data, start + group.offset, group.width)
    end *= group.scale
    end += group.base
    end += start
    right = crc.heads.take(start) == crc.tails.take(end, mode="clip")
    start, end = start.compress(right), end.compress(right)
    fits = (end - start <= MAX_ADU) & (end <= n)
    return start[fits], end[fits]


def _walked(
    data: Bytes, crc: CrcWindows, start: Index, group: WalkedLengths, rules: LengthTables
) -> tuple[Index, Index]:
    """Of a function that takes a walk: in arrays where its declaration has steps, else one by one, which is slow."""
    n = len(data)
    start = start[: int(np.searchsorted(start, n - group.reach, side="right"))]
    checks = rules.checks[256 * group.role + group.function]
    for test in checks.hard if checks is not None else ():
        start = start[test(data, start)]
    if (ends := pdu_ends(group.length.declaration)) is None:
        windows = (data[i + 1 : i + MAX_ADU].tobytes() for i in start.tolist())
        size = np.fromiter((group.length(window) or -1 for window in windows), np.intp)
    else:
        size = ends(data, start + 2, np.minimum(start + MAX_ADU, n)) - (start + 1)
    end = start + size + OVERHEAD
    fits = (size > 0) & (size <= MAX_PDU) & (end <= n)
    start, end = start[fits], end[fits]
    right = crc.heads.take(start) == crc.tails.take(end)
    return start[right], end[right]


def _weigh(
    data: Bytes, start: Index, end: Index, role: NDArray[np.uint8], rules: LengthTables
) -> tuple[Mask, NDArray[np.float32], Mask]:
    """Which candidates break no hard check, the structural bits of each, and which break a limit."""
    functions = data.take(start + 1)
    structure = _BITS_OF_FUNCTION.take(rules.known.take(functions & 0x7F))
    keep = np.ones(len(start), np.bool_)
    broken = np.zeros(len(start), np.bool_)
    kinds = functions + (role.astype(np.uint16) << 8)
    present = np.bincount(kinds).nonzero()[0].tolist()
    for kind in present:
        which = (kinds == kind).nonzero()[0] if len(present) > 1 else slice(None)
        at = start[which]
        if kind & 0xFF >= 0xFE:  # an exception of 7E or 7F, or what drivers leave behind
            spans = zip(at.tolist(), end[which].tolist(), strict=True)
            keep[which] = [not GLITCHES.issuperset(data[low:high].tobytes()) for low, high in spans]
        checks = rules.checks[kind]
        if checks is None:
            continue
        for test in checks.hard:
            keep[which] &= test(data, at)
        bits = np.full(1, checks.bits, np.float32)
        for test, soft in zip(checks.soft, checks.soft_bits, strict=True):
            right = test(data, at)
            broken[which] |= ~right
            bits = bits + np.where(right, np.float32(soft), np.float32(BROKEN_LIMIT))
        structure[which] += bits
    return keep, structure, broken


def predicted_length(data: bytes, start: int, role: Role) -> int | None:
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
