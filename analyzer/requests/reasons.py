"""Why a unit does not serve some requests: the property that sets those that fail apart from those that succeed.

Requests that always fail, in between others that succeed, fail for what they are. What they have in common, and none
that succeeds has, is the reason: the one that takes fewest bits to say for the requests that it covers. What a spell in
time explains as well has none, nor does a unit that never answers: each failure counts by how unlikely it is between
two successes of the unit, where the failures of requests that do succeed at times tell how unlikely that is.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import comb, log2
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .asked import ADDRESSED, ADDRESSES, READS, SWAPPED, Request
from .corrections import Reason, areas, corrected, in_bytes
from .history import Got

LEAST: Final = 3  # failures of a request, each between successes
_CODES: Final = 1 << 10  # more than there are of `Got`
_BITS: Final = 12.0  # that they must be worth against spells
_ALWAYS: Final = 0.95
ECHOED: Final = (5, 6, 22)  # functions whose answer is the request once more:
_RETRIES: Final = 0.3  # so many retries of one that fails may read as its answer
_MOSTLY: Final = 0.7  # of the visits of one that fails: noise may damage silence as well
_WELL: Final = 0.5  # of the visits of a request that succeeds
_BACKGROUND: Final = 0.004
_MAY_BE_EMPTY: Final = 8.0  # bits against a reason for one request that is refused by 04: a log without an entry is so
_IMPOSSIBLE: Final = 3.0  # bits for a request that no device may serve by the specification
_SAME_BYTE: Final = 5.0  # bits for a byte count that is the quantity, rather than any other wrong one
_LEAST_BUFFER: Final = 24  # bytes: no device holds less
_COVERED_BITS: Final = 6.0  # that a request which fails is worth to the property that foretells it
_UNKNOWN, _ADDRESS, _VALUE, _FAILED = 1, 2, 3, 4  # exception codes that may tell of the request ([1] 7)
_TELLS: Final = (_UNKNOWN, _ADDRESS, _VALUE, _FAILED, int(Got.SILENCE))  # 05, 06, 08, 0A and 0B tell of a state


@dataclass(frozen=True, slots=True)
class Unserved:
    """Requests of one unit that fail for one reason; `polls`: their numbers; `got`: how each kind of failure came how
    often among the visits looked at; `ask_instead`: requests that it can serve, in the place of these."""

    unit: int
    reason: Reason
    polls: tuple[int, ...]
    requests: tuple[Request, ...]
    well: tuple[Request, ...]
    got: Mapping[int, int]
    bits: float
    ask_instead: tuple[Request, ...]

    @property
    def is_silent(self) -> bool:
        """Whether most of them stay without an answer, and are not refused."""
        return 2 * self.got.get(int(Got.SILENCE), 0) > sum(self.got.values())


@dataclass(frozen=True, slots=True)
class _Told:
    number: int
    request: Request
    got: Counter[int]
    between: int = 0  # failures between successes of the unit, those side by side counted once

    @property
    def told(self) -> Counter[int]:
        return Counter({code: count for code, count in self.got.items() if code in _TELLS})

    @property
    def code(self) -> int:
        return max(self.told, key=lambda code: self.told[code], default=0)


def unserved(
    unit: int, visits: Sequence[NDArray[np.int64]], request_of: Callable[[int], Request | None]
) -> list[Unserved]:
    """The reasons of one unit, the one that explains most first; `visits` as in `RequestHistory`, `request_of` reads
    the number of what was asked."""
    polls = _polls(visits, request_of)
    if halves := _in_bytes(unit, polls):
        return [halves]
    well = [poll for poll in polls if poll.got[Got.ANSWER] >= _WELL * sum(poll.got.values())]
    failing = [poll for poll in polls if _always_fails(poll)]
    if not failing:
        return []
    if well:
        failing, background = _between(failing, well, visits)
        failing = [poll for poll in failing if poll.between >= LEAST]
        if sum(poll.between for poll in failing) * -log2(background) < _BITS:
            return []
        return list(_explained(unit, failing, [poll.request for poll in well], background))
    refused = [poll for poll in failing if _tells_alone(poll)]
    every = sum(sum(poll.got.values()) for poll in polls)
    if not refused or sum(sum(poll.told.values()) for poll in refused) < _ALWAYS * every:
        return []
    return list(_explained(unit, refused, [], _BACKGROUND))


def _polls(visits: Sequence[NDArray[np.int64]], request_of: Callable[[int], Request | None]) -> list[_Told]:
    if not visits:
        return []
    every = np.concatenate(visits)
    pairs, counts = np.unique(every[:, 0] * _CODES + every[:, 1], return_counts=True)
    got: dict[int, Counter[int]] = {}
    for pair, count in zip(pairs.tolist(), counts.tolist(), strict=True):
        got.setdefault(pair // _CODES, Counter())[pair % _CODES] = count
    read = ((number, request_of(number), codes) for number, codes in got.items())
    return [_Told(number, request, codes) for number, request, codes in read if request is not None]


def _always_fails(poll: _Told) -> bool:
    """Whether a request always fails in ways that may tell of it."""
    told, every = sum(poll.told.values()), sum(poll.got.values())
    answers = _RETRIES if poll.request.function in ECHOED else 1 - _ALWAYS
    return told >= LEAST and told >= (1 - answers) * _MOSTLY * every and poll.got[Got.ANSWER] <= answers * every


def _tells_alone(poll: _Told) -> bool:
    """Whether a refusal says enough where the unit serves nothing else: no such function, or no request can be so."""
    asked = poll.request
    impossible = asked.end > ADDRESSES or asked.quantity > asked.most or asked.numbered is not None
    return poll.code == _UNKNOWN or (poll.code in (_ADDRESS, _VALUE) and impossible)


def _between(
    failing: list[_Told], well: Sequence[_Told], visits: Sequence[NDArray[np.int64]]
) -> tuple[list[_Told], float]:
    """Of each request how often it failed between two successes of others; and how often requests that do succeed fail
    so, the likeliest failure of theirs: what chance, noise and short outages do."""
    good = np.array([poll.number for poll in well], np.int64)
    bad = np.array([poll.number for poll in failing], np.int64)
    counts: Counter[int] = Counter()
    chance = trials = 0
    for part in visits:
        poll, got = part[:, 0], part[:, 1]
        steady = np.isin(poll, good)
        marks = np.flatnonzero(steady)
        if len(marks) < 2:
            continue
        answered = (got == Got.ANSWER)[marks]
        for at, (first, last) in enumerate(pairwise(marks.tolist())):
            if answered[at] and answered[at + 1] and last - first > 1:
                counts.update(set(poll[first + 1 : last][np.isin(poll[first + 1 : last], bad)].tolist()))
        inner = answered[:-2] & answered[2:]
        trials += int(np.count_nonzero(inner))
        chance += int(np.count_nonzero(inner & ~answered[1:-1]))
    background = max((chance + 0.5) / (trials + 1), _BACKGROUND)
    return [_Told(poll.number, poll.request, poll.got, counts[poll.number]) for poll in failing], min(background, 0.9)


@dataclass(frozen=True, slots=True)
class _SharedTrait:
    """A property that foretells the failure of some requests: how many bits it takes to say, and the exception codes
    that go with it."""

    reason: Reason
    covers: list[_Told]
    cost: float
    codes: Mapping[int, float] = field(default_factory=dict)

    @property
    def bits(self) -> float:
        """What it saves."""
        codes = Counter(poll.code for poll in self.covers)
        likely = sum(self.codes.get(code, 0.0) * count for code, count in codes.items()) / max(len(self.covers), 1)
        if codes == {_FAILED: 1}:
            likely -= _MAY_BE_EMPTY
        return _COVERED_BITS * len(self.covers) - self.cost + likely


def _explained(unit: int, failing: list[_Told], well: list[Request], background: float) -> Iterator[Unserved]:
    """Reason after reason, until each request that fails has one."""
    while failing:
        best = max(_properties(failing, well), key=lambda each: each.bits, default=None)
        if best is None or best.bits <= 0:
            return
        asked = tuple(poll.request for poll in best.covers)
        instead = [one for request in asked for one in corrected(best.reason, request, well)]
        got: Counter[int] = Counter()
        for poll in best.covers:
            got.update(poll.told)
        failures = sum(poll.between or sum(poll.told.values()) for poll in best.covers)
        yield Unserved(
            unit,
            best.reason,
            tuple(poll.number for poll in best.covers),
            asked,
            tuple(well),
            dict(got),
            failures * -log2(background) + best.bits,
            tuple(dict.fromkeys(instead)),
        )
        failing = [poll for poll in failing if poll not in best.covers]


def _properties(failing: list[_Told], well: list[Request]) -> Iterator[_SharedTrait]:
    """All that could be said of these requests; of each property none that succeeds has it."""
    for find in (_by_function, _by_other_function, _by_size, _by_place, _by_number, _by_count):
        yield from (found for found in find(failing, well) if found.covers)


_FOREIGN: Final = {_UNKNOWN: 4.0, _ADDRESS: -6.0, _VALUE: -6.0, _FAILED: -4.0}
_PLACED: Final = {_UNKNOWN: -4.0, _ADDRESS: 1.5, _VALUE: -1.0, _FAILED: -3.0}
_SIZED: Final = {_UNKNOWN: -4.0, _ADDRESS: -1.0, _VALUE: 2.0, _FAILED: -3.0}


def _by_function(failing: list[_Told], well: list[Request]) -> Iterator[_SharedTrait]:
    served = {request.function for request in well}
    for function in sorted({poll.request.function for poll in failing} - served):
        mine = [poll for poll in failing if poll.request.function == function]
        other = SWAPPED.get(function)
        others = [poll for poll in failing if poll.request.function == other]
        told = _unlikely(len(mine), len(well))
        if function in READS or function not in SWAPPED or (others and other not in served):
            yield _SharedTrait("function", mine, 2.0 - told, _FOREIGN)
            if function in READS and other in served:
                yield _SharedTrait("read-function", mine, 2.0 - told, {_UNKNOWN: -4.0, _ADDRESS: 2.0})
        elif other in served or all(poll.code in (_UNKNOWN, Got.SILENCE) for poll in mine):
            sure = {} if other in served else _FOREIGN
            yield _SharedTrait("write-function", mine, 1.0 - told, sure)


def _by_other_function(failing: list[_Told], well: list[Request]) -> Iterator[_SharedTrait]:
    """Reads of what the other function reads well."""
    for function in READS:
        mine = [poll for poll in failing if poll.request.function == function]
        held = areas(well, SWAPPED[function])
        shared = [p for p in mine if any(f <= (p.request.address or 0) and p.request.end <= e for f, e in held)]
        yield _SharedTrait(
            "read-function", shared, 1.0 - _unlikely(len(shared), len(well)), {_UNKNOWN: -4.0, _ADDRESS: 2.0}
        )


def _by_size(failing: list[_Told], well: list[Request]) -> Iterator[_SharedTrait]:
    over = [poll for poll in failing if poll.request.address is not None and poll.request.quantity > poll.request.most]
    yield _SharedTrait("quantity", over, -_IMPOSSIBLE, _SIZED)
    for bits in (False, True):
        for read in (True, False):
            good = [r.quantity for r in well if r.is_bits == bits and r.is_read == read and r.address is not None]
            mine = [p for p in failing if p.request.is_bits == bits and p.request.is_read == read]
            over = [p for p in mine if good and p.request.quantity > max(good)]
            yield _SharedTrait("quantity", over, 3.0 - _unlikely(len(over), len(good)), _SIZED)
    lengths = [r.longest_frame for r in well if r.address is not None]
    if lengths:
        longest = max(*lengths, _LEAST_BUFFER)
        long = [p for p in failing if p.request.address is not None and p.request.longest_frame > longest]
        yield _SharedTrait(
            "answer-too-long",
            long,
            3.5 - _unlikely(len(long), len(lengths)),
            {_UNKNOWN: -4.0, _ADDRESS: -2.0, _VALUE: 1.0, _FAILED: 1.0},
        )


def _unlikely(hits: int, others: int) -> float:
    """Bits of so many requests being larger than all others, or farther out, by chance."""
    return min(log2(comb(hits + others, hits)), _COVERED_BITS)


def _outside(asked: Request, well: Sequence[Request]) -> float:
    """Bits by which the place of a request tells that it is the place: it lies apart from all that reads well."""
    spans = [(r.address, r.end) for r in well if r.address is not None and r.function == asked.function]
    if not spans or asked.address is None:
        return 0.0
    apart = asked.end <= min(first for first, _ in spans) or asked.address >= max(end for _, end in spans)
    return log2((len(spans) + 1) / 2) if apart else -1.0


def _by_place(failing: list[_Told], well: list[Request]) -> Iterator[_SharedTrait]:
    placed = [poll for poll in failing if poll.request.address is not None and poll.request.function in ADDRESSED]
    yield _SharedTrait("range-end", [poll for poll in placed if poll.request.end > ADDRESSES], -_IMPOSSIBLE)
    for function in sorted({poll.request.function for poll in placed}):
        mine = [poll for poll in placed if poll.request.function == function]
        ends = {end: first for first, end in areas(well, function)}
        over = [
            p
            for p in mine
            if any(first <= (p.request.address or 0) < end < p.request.end for end, first in ends.items())
        ]
        yield _SharedTrait("range-end", over, 3.0, _PLACED)
    if any(poll.request.is_read for poll in placed) and (well or not placed):
        reads = [poll for poll in placed if poll.request.is_read and poll.code != _FAILED]
        told = [_outside(poll.request, well) for poll in reads]
        cost = 3.0 + 2.0 * max(len(reads) - 1, 0)
        yield _SharedTrait("address", reads, cost - min(sum(told), _COVERED_BITS), _PLACED)
        for poll, bits in zip(reads, told, strict=True):
            yield _SharedTrait("address", [poll], 3.0 - bits, _PLACED)


def _by_number(failing: list[_Told], well: list[Request]) -> Iterator[_SharedTrait]:
    """Register numbers used as addresses, where nothing that is served has an address like one."""
    real = {_block(request) for request in well if request.numbered}
    mine = [poll for poll in failing if poll.request.numbered and _block(poll.request) not in real]
    if mine:
        yield _SharedTrait("register-number", mine, -1.0 - _unlikely(len(mine), len(well)), {_UNKNOWN: -4.0})


def _block(request: Request) -> int:
    """The first digit of a register number."""
    return (request.address or 0) // 10_000


def _by_count(failing: list[_Told], well: list[Request]) -> Iterator[_SharedTrait]:
    """Quantities that are bytes: half of each reads well, or the list goes on behind half of it."""
    for function in (3, 4):
        mine = [poll for poll in failing if poll.request.function == function]
        begins = Counter(p.request.address for p in mine)
        begins.update(r.address for r in well if r.function == function)
        halves = {(r.address, r.quantity) for r in well if r.function == function}
        even = [p for p in mine if p.request.quantity % 2 == 0]

        def is_half(asked: Request) -> bool:
            half = asked.quantity // 2
            return (asked.address, half) in halves or ((asked.address or 0) + half) in begins  # noqa: B023

        found = [poll for poll in even if is_half(poll.request)]
        if len(found) > 1 and len(even) == len(mine):
            yield _SharedTrait(
                "counted-in-bytes", even if 2 * len(found) >= len(even) else found, 2.0, _PLACED | _SIZED
            )


def _in_bytes(unit: int, polls: list[_Told]) -> Unserved | None:
    """A unit that answers as many bytes as registers were asked for, each time."""
    words = [poll for poll in polls if poll.request.function in (3, 4)]
    halved = [poll for poll in words if poll.got[Got.HALF] > _MOSTLY * sum(poll.got.values())]
    count = sum(poll.got[Got.HALF] for poll in halved)
    if count < LEAST or any(poll.got[Got.ANSWER] for poll in words):
        return None
    asked = tuple(poll.request for poll in halved)
    instead = tuple(dict.fromkeys(one for request in asked for one in in_bytes(request)))
    numbers = tuple(poll.number for poll in halved)
    bits = count * (-log2(_BACKGROUND) + _SAME_BYTE)
    return Unserved(unit, "counted-in-bytes", numbers, asked, (), {int(Got.HALF): count}, bits, instead)
