"""What to ask instead: requests that the unit can serve, made from one that it cannot and those that it does.

None is ever sent. One that writes is for a person to look at, whose plant it is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

from .asked import ADDRESSED, ADDRESSES, SWAPPED, Request

Reason = str
_PARTS: Final = 40  # requests that one is split into, at most


def corrected(reason: Reason, asked: Request, well: Sequence[Request]) -> list[Request]:
    """Requests in place of one that fails for a reason, if any are known; `well`: some that the unit answers."""
    return _CORRECTIONS[reason](asked, well)


def areas(well: Sequence[Request], function: int) -> list[tuple[int, int]]:
    """Addresses [first, end) that these requests read by a function, those that touch put together."""
    found: list[tuple[int, int]] = []
    spans = sorted((r.address, r.end) for r in well if r.function == function and r.address is not None)
    for first, end in spans:
        if found and first <= found[-1][1]:
            found[-1] = found[-1][0], max(end, found[-1][1])
        else:
            found.append((first, end))
    return found


def _split(asked: Request, most: int) -> list[Request]:
    """What was asked for in parts of so many at most."""
    if asked.address is None or most < 1:
        return []
    end = min(asked.end, ADDRESSES)  # there is nothing to ask for behind the last address
    begins = range(asked.address, end, most)[:_PARTS]
    return [asked.part(begin, min(most, end - begin)) for begin in begins]


def _fewer(asked: Request, well: Sequence[Request]) -> list[Request]:
    same = [r.quantity for r in well if r.is_bits == asked.is_bits and r.is_read == asked.is_read]
    return _split(asked, min(max(same, default=asked.most), asked.most))


def _shorter(asked: Request, well: Sequence[Request]) -> list[Request]:
    longest = max((r.longest_frame for r in well), default=0)
    most = asked.quantity
    while most > 1 and replace(asked, quantity=most, data=asked.data[: 2 * most]).longest_frame > longest:
        most -= 1
    return _split(asked, most)


def _served(asked: Request, well: Sequence[Request]) -> list[Request]:
    """The parts of it that are known to read well; else the nearest request that the unit answers."""
    if asked.address is None:
        return []
    if asked.is_read:
        parts = [
            asked.part(begin, min(last - begin, asked.most))
            for first, end in areas(well, asked.function)
            if (begin := max(first, asked.address)) < (last := min(end, asked.end))
        ]
        if parts:
            return parts
    near = [r for r in well if r.address is not None and r.is_read]
    same = [r for r in near if r.function == asked.function] or [r for r in near if r.is_bits == asked.is_bits] or near
    where = asked.address
    return [min(same, key=lambda r: abs((r.address or 0) - where))] if same else []


def _to_the_end(asked: Request, well: Sequence[Request]) -> list[Request]:
    address = asked.address or 0
    if asked.end > ADDRESSES:
        return [asked.part(address, ADDRESSES - address)]
    inside = [end for first, end in areas(well, asked.function) if first <= address < end]
    return [asked.part(address, min(inside[0] - address, asked.quantity))] if inside else _served(asked, well)


def _numbered(asked: Request, _well: Sequence[Request]) -> list[Request]:
    meant = asked.numbered
    return [] if meant is None else [meant]


def _other_function(asked: Request, _well: Sequence[Request]) -> list[Request]:
    """The same by the other function of its kind."""
    swapped = SWAPPED.get(asked.function)
    if swapped is None or asked.address is None:
        return []
    if asked.is_read:
        return [replace(asked, function=swapped)]
    if asked.function == 6:
        return [replace(asked, function=16, data=asked.data[:2])]
    if asked.function == 5:
        return [replace(asked, function=15, data=bytes((asked.data[:1] == b"\xff",)))]
    if asked.function == 15:
        bits = int.from_bytes(asked.data, "little")
        return [
            Request(asked.unit, 5, asked.address + i, 1, b"\xff\0" if bits >> i & 1 else b"\0\0")
            for i in range(min(asked.quantity, _PARTS))
        ]
    return [
        Request(asked.unit, 6, asked.address + i, 1, asked.data[2 * i : 2 * i + 2])
        for i in range(min(asked.quantity, _PARTS))
    ]


def _has_function(asked: Request, well: Sequence[Request]) -> list[Request]:
    """By a function that the unit is known to have; else what it reads well nearby."""
    known = {r.function for r in well}
    if asked.function == 23 and asked.address is not None and (not known or known & {3, 16}):
        write_to, count = asked.data[2:4], int.from_bytes(asked.data[4:6], "big")
        write = Request(asked.unit, 16, int.from_bytes(write_to, "big"), count, asked.data[7:])
        return [write, Request(asked.unit, 3, asked.address, asked.quantity)]
    if SWAPPED.get(asked.function) in known:
        return _other_function(asked, well)
    if asked.function not in ADDRESSED:
        return []
    return _served(asked, well) or _other_function(asked, well)


def _halved(asked: Request, _well: Sequence[Request]) -> list[Request]:
    return [replace(asked, quantity=asked.quantity // 2)] if asked.is_read and asked.quantity > 1 else []


_CORRECTIONS: Final[Mapping[Reason, Callable[[Request, Sequence[Request]], list[Request]]]] = {
    "function": _has_function,
    "read-function": _other_function,
    "write-function": _other_function,
    "quantity": _fewer,
    "answer-too-long": _shorter,
    "address": _served,
    "range-end": _to_the_end,
    "register-number": _numbered,
    "counted-in-bytes": _halved,
}
REASONS: Final = tuple(_CORRECTIONS)


def in_bytes(asked: Request) -> list[Request]:
    """Requests to a unit that takes the quantity for a count of bytes: twice the quantity, in parts if need be."""
    doubled = replace(asked, quantity=2 * asked.quantity)
    return [doubled] if doubled.quantity <= asked.most else _split(doubled, asked.most)
