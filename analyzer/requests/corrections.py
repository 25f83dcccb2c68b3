"""What to ask instead: requests that the unit can serve, made from one that it cannot and those that it does.

None is ever sent. One that writes is for a person to look at, whose plant it is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

from .asked import ADDRESSED, ADDRESSES, READS, SWAPPED, Request

Reason = str
_PARTS: Final = 40  # requests that one is split into, at most


def corrected(reason: Reason, asked: Request, well: Sequence[Request]) -> list[Request]:
    """Requests in place of one that fails for a reason, if any are known; `well`: some that the unit answers. None that
    would write what the request does not hold."""
    return [each for each in _CORRECTIONS[reason](asked, well) if each.is_read or asked.is_whole & each.is_whole]


class Areas(NamedTuple):
    """Addresses [first, end) by address, apart from each other."""

    spans: list[tuple[int, int]]

    @classmethod
    def of(cls, well: Sequence[Request], function: int) -> Areas:
        """What these requests reach by a function."""
        return cls.joined((r.address, r.end) for r in well if r.function == function and r.address is not None)

    @classmethod
    def joined(cls, spans: Iterable[tuple[int, int]]) -> Areas:
        """These, those that touch put together."""
        found: list[tuple[int, int]] = []
        for first, end in sorted(spans):
            before, behind = found[-1] if found else (first, first)
            if first <= behind:
                found[-1:] = [(before, max(behind, end))]
            else:
                found.append((first, end))
        return cls(found)

    def hold(self, asked: Request) -> bool:
        """Whether a request asks for nothing else."""
        return any(first <= asked.begin and asked.end <= end for first, end in self.spans)

    def end_within(self, asked: Request) -> int | None:
        """Where the area ends in which a request begins; None where it begins in none."""
        return next((end for first, end in self.spans if first <= asked.begin < end), None)

    def part_with(self, asked: Request) -> bool:
        """Whether a request goes on beyond the end of the area that it begins in."""
        return any(first <= asked.begin < end < asked.end for first, end in self.spans)

    def shared(self, asked: Request) -> list[tuple[int, int]]:
        """What a request asks for of each."""
        both = [(max(first, asked.begin), min(end, asked.end)) for first, end in self.spans]
        return [(first, end) for first, end in both if first < end]


def _split(asked: Request, most: int) -> list[Request]:
    """What was asked for in parts of so many at most."""
    if most < 1:
        return []
    end = min(asked.end, ADDRESSES)  # there is nothing to ask for behind the last address
    begins = range(asked.begin, end, most)[:_PARTS]
    return [asked.part(begin, min(most, end - begin)) for begin in begins]


def _fewer(asked: Request, well: Sequence[Request]) -> list[Request]:
    same = [r.quantity for r in well if (r.is_bits, r.is_read) == (asked.is_bits, asked.is_read)]
    return _split(asked, min(max(same, default=asked.most), asked.most))


def _shorter(asked: Request, well: Sequence[Request]) -> list[Request]:
    longest = max((r.longest_frame for r in well), default=0)
    most = asked.quantity
    while most > 1 and replace(asked, quantity=most, data=asked.data[: 2 * most]).longest_frame > longest:
        most -= 1
    return _split(asked, most)


def _served(asked: Request, well: Sequence[Request]) -> list[Request]:
    """The parts of it that are known to read well; else the nearest request that the unit answers."""
    known = Areas.of(well, asked.function).shared(asked) if asked.is_read else []
    return [asked.part(first, min(end - first, asked.most)) for first, end in known] or _nearest(asked, well)


def _nearest(asked: Request, well: Sequence[Request]) -> list[Request]:
    """The read that is nearest, by the same function, else of the same kind, if there are any."""
    if asked.address is None:
        return []
    reads = sorted(
        (r for r in well if r.is_read),
        key=lambda r: (r.function != asked.function, r.is_bits != asked.is_bits, abs(r.begin - asked.begin)),
    )
    return reads[:1]


def _to_the_end(asked: Request, well: Sequence[Request]) -> list[Request]:
    end = ADDRESSES if asked.end > ADDRESSES else Areas.of(well, asked.function).end_within(asked)
    if end is None:
        return _served(asked, well)
    return [asked.part(asked.begin, min(end - asked.begin, asked.quantity, asked.most))]


def _numbered(asked: Request, _well: Sequence[Request]) -> list[Request]:
    meant = asked.numbered
    return [] if meant is None else [meant]


def _other_function(asked: Request, _well: Sequence[Request]) -> list[Request]:
    """The same by the other function of its kind."""
    return _BY_OTHER[asked.function](asked) if asked.function in _BY_OTHER else []


def _swapped_read(asked: Request) -> list[Request]:
    return [replace(asked, function=SWAPPED[asked.function])]


def _one_by_one(asked: Request, function: int, values: Iterable[bytes]) -> list[Request]:
    """Writes of one value each."""
    return [Request(asked.unit, function, asked.begin + at, 1, value) for at, value in enumerate(values)]


def _coils_written(asked: Request) -> list[Request]:
    bits = int.from_bytes(asked.data, "little")
    return _one_by_one(asked, 5, (_COIL[bits >> at & 1] for at in range(min(asked.quantity, _PARTS))))


def _registers_written(asked: Request) -> list[Request]:
    return _one_by_one(asked, 6, (asked.data[2 * at : 2 * at + 2] for at in range(min(asked.quantity, _PARTS))))


_COIL: Final = (b"\0\0", b"\xff\0")
_BY_OTHER: Final[Mapping[int, Callable[[Request], list[Request]]]] = {
    **dict.fromkeys(READS, _swapped_read),
    5: lambda asked: [replace(asked, function=15, data=bytes((asked.data[:1] == b"\xff",)))],
    6: lambda asked: [replace(asked, function=16, data=asked.data[:2])],
    15: _coils_written,
    16: _registers_written,
}


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
    return [replace(asked, quantity=asked.quantity // 2)] * min(asked.is_read, asked.quantity > 1)


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
