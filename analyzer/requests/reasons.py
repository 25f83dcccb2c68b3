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
from itertools import chain, pairwise
from math import comb, log2
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from .asked import ADDRESSES, READS, SWAPPED, SWAPPED_WRITES, Request
from .corrections import Areas, Reason, corrected, in_bytes
from .got import Got

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
_OF_WORDS: Final = (3, 4)  # functions that read registers
_NO_REQUEST_IS: Final = 1 << 32  # so large or so long
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
    def untried(self) -> Sequence[Request]:
        """What to ask instead that is not asked already: what is would stand under other names."""
        return [request for request in self.ask_instead if request not in self.well]

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


def unserved(unit: int, visits: NDArray[np.int64], request_of: Callable[[int], Request | None]) -> list[Unserved]:
    """The reasons of one unit, the one that explains most first; `visits` as `visits_of` has them, `request_of` reads
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
    if sum(sum(poll.told.values()) for poll in refused) < _ALWAYS * every:
        return []
    return list(_explained(unit, refused, [], _BACKGROUND))


def _polls(visits: NDArray[np.int64], request_of: Callable[[int], Request | None]) -> list[_Told]:
    pairs, counts = np.unique(visits[:, 0] * _CODES + visits[:, 1], return_counts=True)
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
    if asked.impossible is None and asked.numbered is None:
        return poll.code == _UNKNOWN
    return poll.code in (_UNKNOWN, _ADDRESS, _VALUE)


def _between(failing: list[_Told], well: Sequence[_Told], visits: NDArray[np.int64]) -> tuple[list[_Told], float]:
    """Of each request how often it failed between two successes of others; and how often requests that do succeed fail
    so, the likeliest failure of theirs: what chance, noise and short outages do."""
    good = np.array([poll.number for poll in well], np.int64)
    bad = np.array([poll.number for poll in failing], np.int64)
    counts: Counter[int] = Counter()
    poll, got = visits.T
    marks = np.flatnonzero(np.isin(poll, good))
    answered = (got == Got.ANSWER)[marks]
    for at, (first, last) in enumerate(pairwise(marks.tolist())):
        if answered[at] and answered[at + 1]:
            counts.update(set(poll[first + 1 : last][np.isin(poll[first + 1 : last], bad)].tolist()))
    inner = answered[:-2] & answered[2:]
    trials, chance = int(np.count_nonzero(inner)), int(np.count_nonzero(inner & ~answered[1:-1]))
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


@dataclass(frozen=True, slots=True)
class _FailingBesideWell:
    """Requests that fail, beside those that succeed."""

    failing: list[_Told]
    well: list[Request]

    @property
    def placed(self) -> _FailingBesideWell:
        """Those that have an address."""
        addressed = [request for request in self.well if request.address is not None]
        return _FailingBesideWell([poll for poll in self.failing if poll.request.address is not None], addressed)

    def parts(self, kind: Callable[[Request], Any]) -> list[tuple[Any, _FailingBesideWell]]:
        """The same, each kind of request by itself, where any of it fails."""
        found: dict[Any, _FailingBesideWell] = {}
        for poll in self.failing:
            found.setdefault(kind(poll.request), _FailingBesideWell([], [])).failing.append(poll)
        for request in self.well:
            found.get(kind(request), _FailingBesideWell([], [])).well.append(request)
        return sorted(found.items())

    def which(self, is_so: Callable[[Request], bool]) -> list[_Told]:
        """Those that fail of which this is so."""
        return [poll for poll in self.failing if is_so(poll.request)]

    def larger(self, measure: Callable[[Request], int], least: int = 0) -> list[_Told]:
        """Those that fail of which something is more than of any that succeeds, and than so much."""
        most = max(least, max(map(measure, self.well), default=_NO_REQUEST_IS))
        return self.which(lambda asked: measure(asked) > most)


def _properties(failing: list[_Told], well: list[Request]) -> Iterator[_SharedTrait]:
    """All that could be said of these requests; of each property none that succeeds has it."""
    every = _FailingBesideWell(failing, well)
    kinds = (_by_function, _by_other_function, _by_size, _by_place, _by_number, _by_count)
    yield from filter(_covers_any, chain.from_iterable(find(every) for find in kinds))


def _covers_any(trait: _SharedTrait) -> bool:
    return bool(trait.covers)


_FOREIGN: Final = {_UNKNOWN: 4.0, _ADDRESS: -6.0, _VALUE: -6.0, _FAILED: -4.0}
_PLACED: Final = {_UNKNOWN: -4.0, _ADDRESS: 1.5, _VALUE: -1.0, _FAILED: -3.0}
_SIZED: Final = {_UNKNOWN: -4.0, _ADDRESS: -1.0, _VALUE: 2.0, _FAILED: -3.0}
_TOO_LONG: Final = {_UNKNOWN: -4.0, _ADDRESS: -2.0, _VALUE: 1.0, _FAILED: 1.0}
_READ_ELSEWHERE: Final = {_UNKNOWN: -4.0, _ADDRESS: 2.0}


def _by_function(every: _FailingBesideWell) -> Iterator[_SharedTrait]:
    """Functions of which no request succeeds."""
    unserved_functions = [(function, part) for function, part in every.parts(_function) if not part.well]
    missing, served = dict(unserved_functions), {request.function for request in every.well}
    for function, part in unserved_functions:
        mine, other = part.failing, SWAPPED.get(function)
        told = _unlikely(len(mine), len(every.well))
        if function not in SWAPPED_WRITES or other in missing:
            yield _SharedTrait("function", mine, 2.0 - told, _FOREIGN)
            if function in READS and other in served:
                yield _SharedTrait("read-function", mine, 2.0 - told, _READ_ELSEWHERE)
        elif other in served:
            yield _SharedTrait("write-function", mine, 1.0 - told)
        elif {_UNKNOWN, int(Got.SILENCE)}.issuperset(poll.code for poll in mine):
            yield _SharedTrait("write-function", mine, 1.0 - told, _FOREIGN)


def _function(asked: Request) -> int:
    return asked.function


def _by_other_function(every: _FailingBesideWell) -> Iterator[_SharedTrait]:
    """Reads of what the other function reads well."""
    for function, part in every.parts(_function):
        shared = part.which(Areas.of(every.well, SWAPPED[function]).hold) if function in READS else []
        yield _SharedTrait("read-function", shared, 1.0 - _unlikely(len(shared), len(every.well)), _READ_ELSEWHERE)


def _by_size(every: _FailingBesideWell) -> Iterator[_SharedTrait]:
    """Requests of more, or with a longer answer, than any that succeeds, or than any may be."""
    placed = every.placed
    yield _SharedTrait("quantity", placed.which(lambda asked: asked.quantity > asked.most), -_IMPOSSIBLE, _SIZED)
    for _, part in placed.parts(lambda asked: (asked.is_bits, not asked.is_read)):
        over = part.larger(lambda asked: asked.quantity)
        yield _SharedTrait("quantity", over, 3.0 - _unlikely(len(over), len(part.well)), _SIZED)
    long = placed.larger(lambda asked: asked.longest_frame, _LEAST_BUFFER)
    yield _SharedTrait("answer-too-long", long, 3.5 - _unlikely(len(long), len(placed.well)), _TOO_LONG)


def _unlikely(hits: int, others: int) -> float:
    """Bits of so many requests being larger than all others, or farther out, by chance."""
    return min(log2(comb(hits + others, hits)), _COVERED_BITS)


def _outside(asked: Request, same: Sequence[Request]) -> float:
    """Bits by which the place of a request tells that it is the place: it lies apart from all that the same function
    reads well."""
    if not same:
        return 0.0
    apart = asked.end <= min(r.begin for r in same) or asked.begin >= max(r.end for r in same)
    return log2((len(same) + 1) / 2) if apart else -1.0


def _by_place(every: _FailingBesideWell) -> Iterator[_SharedTrait]:
    """Requests beyond the last address, beyond the end of what is served, or somewhere else."""
    yield _SharedTrait("range-end", every.which(lambda asked: asked.end > ADDRESSES), -_IMPOSSIBLE)
    parts = dict(every.parts(_function))
    for function, part in parts.items():
        yield _SharedTrait("range-end", part.which(Areas.of(part.well, function).part_with), 3.0, _PLACED)
    if every.well:
        areas = {function: Areas.of(part.well, function) for function, part in parts.items()}
        refused = [poll for poll in every.failing if poll.request.is_read and poll.code != _FAILED]
        refused = [poll for poll in refused if not areas[poll.request.function].hold(poll.request)]  # it reads well
        reads = [(poll, _outside(poll.request, parts[poll.request.function].well)) for poll in refused]
        told_together = min(sum(told for _, told in reads), _COVERED_BITS)
        yield _SharedTrait("address", refused, 3.0 + 2.0 * max(len(reads) - 1, 0) - told_together, _PLACED)
        for poll, told in reads:
            yield _SharedTrait("address", [poll], 3.0 - told, _PLACED)


def _by_number(every: _FailingBesideWell) -> Iterator[_SharedTrait]:
    """Register numbers used as addresses, where nothing that is served has an address like one."""
    real = {None, *(request.number_digit for request in every.well)}
    mine = every.which(lambda asked: asked.number_digit not in real)
    yield _SharedTrait("register-number", mine, -1.0 - _unlikely(len(mine), len(every.well)), {_UNKNOWN: -4.0})


def _by_count(every: _FailingBesideWell) -> Iterator[_SharedTrait]:
    """Quantities that are bytes: half of each reads well, or the list goes on behind half of it."""
    for function, part in every.parts(_function):
        mine = part.failing if function in _OF_WORDS else []
        begins = {asked.begin for asked in (*part.well, *(poll.request for poll in mine))}
        halves = {(asked.begin, asked.quantity) for asked in part.well}
        counts = [(poll, poll.request.begin, poll.request.quantity // 2) for poll in mine]
        found = [poll for poll, begin, half in counts if (begin, half) in halves or begin + half in begins]
        if len(found) > 1 and not any(poll.request.quantity % 2 for poll in mine):
            covers = mine if 2 * len(found) >= len(mine) else found
            yield _SharedTrait("counted-in-bytes", covers, 2.0, _PLACED | _SIZED)


def _in_bytes(unit: int, polls: list[_Told]) -> Unserved | None:
    """A unit that answers as many bytes as registers were asked for, each time."""
    words = [poll for poll in polls if poll.request.function in _OF_WORDS]
    halved = [poll for poll in words if poll.got[Got.HALF] > _MOSTLY * sum(poll.got.values())]
    count = sum(poll.got[Got.HALF] for poll in halved)
    if count < LEAST or any(poll.got[Got.ANSWER] for poll in words):
        return None
    asked = tuple(poll.request for poll in halved)
    instead = tuple(dict.fromkeys(one for request in asked for one in in_bytes(request)))
    numbers = tuple(poll.number for poll in halved)
    bits = count * (-log2(_BACKGROUND) + _SAME_BYTE)
    return Unserved(unit, "counted-in-bytes", numbers, asked, (), {int(Got.HALF): count}, bits, instead)
