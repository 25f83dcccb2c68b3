"""The poll round: what a client asks again and again, in its order, with the time of each slot.

Requests are cut into rounds at one poll. The sequence that most rounds share is the round; polls that come in every
n-th round, always at one place of it, are its slower slots. The cut that explains most requests is taken, and nothing
is said where it explains few: such a client has no order.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median
from typing import Final

from .sequence import AskedPoll, PollSequence

_RECURS: Final = 3
_ANCHORS: Final = 16
_BASES: Final = 4
_ROUNDS: Final = 3  # at least
_LEAST: Final = 0.6  # of requests that recur, explained
_STEADY: Final = 0.8  # of a slower poll's strides and places
_PAUSE: Final = 2.5  # times the usual slot: where a round ends


@dataclass(frozen=True, slots=True)
class RoundSlot:
    """A poll of a round; `every`: in each so many-th round; `offset_ns` since the round's first slot, None without
    times or where it is a slower one; `frame`: the first request."""

    poll: AskedPoll
    every: int
    offset_ns: int | None
    count: int
    frame: int


@dataclass(frozen=True, slots=True)
class BusRound:
    """A round in its order; `period_ns` is the median, `jitter_ns` how far nine in ten stray from it; `share` of the
    requests that recur follow it, in `rounds` rounds."""

    slots: tuple[RoundSlot, ...]
    period_ns: int | None
    jitter_ns: int | None
    share: float
    rounds: int


@dataclass(frozen=True, slots=True)
class _RoundCut:
    """One way to cut; `at` are the cycles that follow it: numbers into `starts`."""

    base: tuple[int, ...]
    slower: tuple[tuple[int, int, int], ...]  # poll, behind which slot of the base, every so many rounds
    starts: tuple[int, ...]
    at: tuple[int, ...]
    score: float


def bus_round(sequence: PollSequence, *, timed: bool) -> BusRound | None:
    """The round that a client keeps; None where it keeps none."""
    counts = Counter(sequence.order)
    polls = [poll for poll, count in counts.most_common() if count >= _RECURS]
    numbers = {poll: number for number, poll in enumerate(polls)}
    kept = [(numbers[poll], t_ns) for poll, t_ns in zip(sequence.order, sequence.times, strict=True) if poll in numbers]
    if not kept:
        return None
    ids, times = [number for number, _ in kept], [t_ns for _, t_ns in kept]
    fits = [fit for anchor in range(min(len(polls), _ANCHORS)) for fit in _fits(ids, anchor)]
    best = max(fits, key=lambda fit: (round(fit.score, 3), -len(fit.base)), default=None)
    if best is None or best.score < _LEAST:
        return None
    return _as_round(best, ids, times if timed else None, polls, sequence)


def _fits(ids: Sequence[int], anchor: int) -> Iterator[_RoundCut]:
    starts = [at for at, number in enumerate(ids) if number == anchor]
    cycles = [tuple(ids[first:last]) for first, last in pairwise(starts)]
    if len(cycles) < _ROUNDS:
        return
    for base, count in Counter(cycles).most_common(_BASES):
        if count >= _ROUNDS:
            yield _fit(base, cycles, starts, len(ids))


def _fit(base: tuple[int, ...], cycles: Sequence[tuple[int, ...]], starts: Sequence[int], total: int) -> _RoundCut:
    members = set(base)
    at = [number for number, cycle in enumerate(cycles) if _follows(cycle, base, members)]
    seen: dict[int, list[tuple[int, int]]] = {}  # slower poll: (round, slot of the base that it comes behind)
    for number in at:
        slot = -1
        for poll in cycles[number]:
            if poll in members:
                slot += 1
            else:
                seen.setdefault(poll, []).append((number, slot))
    slower = [(poll, *steady) for poll, places in seen.items() if (steady := _steady(places)) is not None]
    explained = len(at) * len(base) + sum(len(seen[poll]) for poll, *_ in slower)
    return _RoundCut(base, tuple(slower), tuple(starts), tuple(at), explained / total)


def _follows(cycle: tuple[int, ...], base: tuple[int, ...], members: set[int]) -> bool:
    if cycle == base:
        return True
    others = [poll for poll in cycle if poll not in members]
    return len(set(others)) == len(others) and tuple(poll for poll in cycle if poll in members) == base


def _steady(places: Sequence[tuple[int, int]]) -> tuple[int, int] | None:
    """Behind which slot a slower poll comes, and every how many rounds; None where it keeps neither."""
    strides = [after - before for (before, _), (after, _) in pairwise(places)]
    if len(strides) < _RECURS - 1:
        return None
    (stride, count), (slot, there) = _commonest(strides), _commonest(slot for _, slot in places)
    if count < _STEADY * len(strides) or there < _STEADY * len(places):
        return None
    return slot, stride


def _commonest(values: Iterable[int]) -> tuple[int, int]:
    return Counter(values).most_common(1)[0]


def _as_round(
    fit: _RoundCut, ids: Sequence[int], times: Sequence[int] | None, polls: Sequence[AskedPoll], sequence: PollSequence
) -> BusRound:
    offsets = _offsets(fit, ids, times)
    period = jitter = None
    if times is not None:
        spans = [times[fit.starts[number + 1]] - times[fit.starts[number]] for number in fit.at]
        period = round(median(spans))
        strays = sorted(abs(each - period) for each in spans)
        jitter = strays[min(int(0.9 * len(strays)), len(strays) - 1)]
    slots: list[RoundSlot] = []
    for at, number in enumerate(fit.base):
        slots.append(_slot(polls[number], 1, offsets[at], sequence))
        behind = sorted((ids.index(poll), poll, every) for poll, slot, every in fit.slower if slot == at)
        slots += [_slot(polls[poll], every, None, sequence) for _, poll, every in behind]
    first = _first_slot(slots, period)
    begin = slots[first].offset_ns
    turned = [*slots[first:], *slots[:first]]
    if period and begin is not None:
        turned = [
            slot if slot.offset_ns is None else replace(slot, offset_ns=(slot.offset_ns - begin) % period)
            for slot in turned
        ]
    return BusRound(tuple(turned), period, jitter, min(fit.score, 1.0), len(fit.at))


def _slot(poll: AskedPoll, every: int, offset_ns: int | None, sequence: PollSequence) -> RoundSlot:
    held = sequence.polls[poll]
    return RoundSlot(poll, every, offset_ns, held.count, held.request)


def _offsets(fit: _RoundCut, ids: Sequence[int], times: Sequence[int] | None) -> list[int | None]:
    """The median time of each slot of the base since its round began."""
    if times is None:
        return [None] * len(fit.base)
    members, since = set(fit.base), [list[int]() for _ in fit.base]
    for number in fit.at:
        first, last = fit.starts[number], fit.starts[number + 1]
        mine = [at for at in range(first, last) if ids[at] in members]
        for slot, at in enumerate(mine):
            since[slot].append(times[at] - times[first])
    return [round(median(each)) for each in since]


def _first_slot(slots: Sequence[RoundSlot], period: int | None) -> int:
    """Where a round begins: behind a pause, else with what was asked first."""
    timed = [(at, slot.offset_ns) for at, slot in enumerate(slots) if slot.offset_ns is not None]
    if period and len(timed) > 1:
        gaps = [(after - before, at) for (_, before), (at, after) in pairwise(timed)]
        gaps.append((period - timed[-1][1], timed[0][0]))
        longest, at = max(gaps)
        if longest >= _PAUSE * max(median(gap for gap, _ in gaps), 1):
            return at
    base = [at for at, slot in enumerate(slots) if slot.every == 1]
    return min(base, key=lambda at: slots[at].frame)
