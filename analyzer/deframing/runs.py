"""Where candidates tile the bytes with no rival: the path is forced, and whole runs of frames are taken as arrays.

An interval (start, end) that no other one overlaps needs no lattice; most need no thought about their role either.
Some do: a write's echo reads as request and as response. Request and echo side by side are told apart here by their
places, as the lattice would; whatever is not plain is left to it. What hangs on bytes and places alone is worked out
for a whole slice at once (`runs_of`); what silence has to say is asked when a run is taken (`reach`).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role

from .candidates import Candidates
from .conversation import fitting
from .lattice import CONTRARY, FITS, FITS_EXCEPTION, OPEN, UNASKED, Candidate, Said
from .prefix import Windows
from .rules import Bytes, Index, Mask
from .silence import Trust, Turn

_ENOUGH: Final = 12.0  # bits by which a request that nobody answers must be one
_BACK: Final = 2 * OPEN  # frames that it may not answer either: an answer among them would keep others open
_PLAIN: Final = -4.0  # bits by which silence may speak against a role that the places speak for


class Runs(NamedTuple):
    """Intervals (start, end) of candidates, with what bytes and places say of them."""

    start: Index
    end: Index
    role: NDArray[np.uint8]  # where it is not plain, that of the first candidate
    either: Mask  # both roles read alike
    structure: NDArray[np.float32]
    clean: Mask  # no other interval overlaps it
    last: Index  # the last interval of the run that each is in
    second: Mask  # its role, though either, follows from that of the one before it
    asked: Index  # places of those that ask, though either, if silence agrees: the next one answers them
    alone: Index  # places of those that ask, though either, if silence agrees: nobody answers, as those before
    echoes: Index  # places of the last ones of those that may each answer the one before
    doubt: Index  # places of those whose role only the lattice tells
    fits: Mask  # that it answers the one before it


@dataclass(frozen=True, slots=True)
class Stretch:
    """What is known of the bytes being worked on, which begin at index `begin` of the tape."""

    data: Bytes
    begin: int
    crc: Windows
    found: Candidates

    def any(self, at: int, limit: int) -> bool:
        """Whether a candidate begins in [at, limit)."""
        low, high = np.searchsorted(self.found.start, (at, limit))
        return bool(low < high)

    def candidates(self, at: int, limit: int) -> list[Candidate]:
        """Those that lie in [at, limit), with offsets from `at`."""
        low, high = np.searchsorted(self.found.start, (at, limit))
        start, end = self.found.start[low:high], self.found.end[low:high]
        fits = end <= limit
        return [
            Candidate(*values)
            for values in zip(
                (start[fits] - at).tolist(),
                (end[fits] - at).tolist(),
                self.found.role[low:high][fits].tolist(),
                self.found.structure[low:high][fits].tolist(),
                strict=True,
            )
        ]


def runs_of(found: Candidates, data: Bytes, known: int) -> Runs:
    """Intervals of candidates; clean ones end at or before `known`, where nothing can still appear."""
    n = len(found)
    new = np.ones(n, np.bool_)
    new[1:] = (found.start[1:] != found.start[:-1]) | (found.end[1:] != found.end[:-1])
    first = np.flatnonzero(new)
    start, end, role = found.start[first], found.end[first], found.role[first]
    either = np.diff(np.append(first, n)) > 1
    m = len(start)
    reach = np.zeros(m, np.intp)
    reach[1:] = np.maximum.accumulate(end)[:-1]
    clean = (reach <= start) & (end <= known)
    clean[:-1] &= start[1:] >= end[:-1]
    joined = np.zeros(m + 1, np.bool_)  # at k: k follows k - 1 in one run
    joined[1:m] = clean[1:] & clean[:-1] & (start[1:] == end[:-1])
    heads = np.flatnonzero(~joined[:m])
    lasts = np.append(heads[1:] - 1, m - 1)[: len(heads)]
    last = np.repeat(lasts, lasts - heads + 1) if m else np.empty(0, np.intp)
    plain = _Plain(data, start, end, role, either, joined, known)
    return Runs(
        start,
        end,
        plain.role,
        either,
        found.structure[first],
        clean,
        last,
        plain.second,
        plain.asked,
        plain.alone,
        plain.echoes,
        plain.doubt,
        _answering(data, start, plain.role, joined),
    )


def _answering(data: Bytes, start: Index, role: NDArray[np.uint8], joined: Mask) -> Mask:
    """Which intervals answer the one before them."""
    fits = np.zeros(len(start), np.bool_)
    after = 1 + np.flatnonzero(joined[1 : len(start)] & (role[1:] == Role.RESPONSE) & (role[:-1] == Role.REQUEST))
    fits[after] = fitting(data, start[after - 1], start[after])
    return fits


class _Plain:
    """The roles that follow from bytes and places.

    Plain are two frames of which the second may answer the first, where no third could take part and nothing is
    pending before them.
    """

    def __init__(
        self, data: Bytes, start: Index, end: Index, role: NDArray[np.uint8], either: Mask, joined: Mask, known: int
    ) -> None:
        m = len(start)
        self.role = role
        self.second = np.zeros(m, np.bool_)
        self.asked = self.alone = self.echoes = self.doubt = np.empty(0, np.intp)
        some = np.flatnonzero(either)
        if not len(some):
            return
        asks, answers = either | (role == Role.REQUEST), either | (role == Role.RESPONSE)
        # Whatever follows the intervals of interest, joined or not; two at the most begin at one place.
        near = np.zeros(m + 1, np.bool_)
        near[some] = near[some + 1] = near[some - 1] = True  # (-1 is the spare place at the end)
        near[:m] &= end <= known  # else more may follow than is known
        before = np.flatnonzero(near[:m])
        after = np.searchsorted(start, end[before])
        after = np.concatenate((after, after + 1))
        before = np.concatenate((before, before))
        meets = after < m
        meets[meets] = start[after[meets]] == end[before[meets]]
        before, after = before[meets], after[meets]
        followed = np.zeros(m + 1, np.bool_)  # at k: it is known what follows k
        followed[before] = True
        ask = asks[before] & answers[after]
        before, after = before[ask], after[ask]
        fits = fitting(data, start[before], start[after])
        answered = np.zeros(m + 2, np.bool_)  # at k: what follows k may answer it
        answered[before[fits]] = True
        pair = np.zeros(m, np.bool_)  # at k: k + 1 answers k, and no third takes part
        pair[:-1] = answered[: m - 1] & joined[1:m] & ~answered[1:m] & followed[1:m]
        pair[1:] &= ~(answered[: m - 1] & joined[1:m])
        self.second[1:] = pair[:-1]
        self.role = role.copy()
        self.role[pair & either], self.role[self.second & either] = Role.REQUEST, Role.RESPONSE
        pending = np.zeros(m, np.bool_)
        pending[1:] = joined[1:m] & (self.role[:-1] == Role.REQUEST)
        first = pair & either
        self.echoes = np.flatnonzero(either & ~(answered[:m] & joined[1:] & np.append(either[1:], False)))
        alone = np.flatnonzero(either & joined[:m] & joined[1:] & followed[:m] & ~answered[:m])
        alone = alone[(alone >= _BACK) & asks.take(alone + 1, mode="clip") & (data.take(start[alone - 1]) != 0)]
        for back in range(1, _BACK + 1):  # it is no late answer, either
            asker = alone - back
            alone = alone[joined[asker + 1] & asks[asker] & ~fitting(data, start[asker], start[alone])]
        self.alone = alone
        doubt = either & ~(first & ~pending) & ~self.second
        doubt[alone] = False
        self.doubt = np.flatnonzero(doubt)
        self.asked = np.flatnonzero(first & ~pending)
        self.second &= either


def reach(runs: Runs, i: int, last: int, silences: NDArray[np.uint8], trust: Trust, *, waiting: bool) -> int:
    """How far, from interval i on and before `last`, roles are plain: the first one that is not.

    `waiting`: the frame before is a request that wants an answer.
    """
    at = int(np.searchsorted(runs.doubt, i))
    if at < len(runs.doubt):
        last = min(last, int(runs.doubt[at]))
    tables = np.array(trust.evidence)
    low, high = np.searchsorted(runs.alone, (i, last))
    if low < high:
        alone = runs.alone[low:high]
        if alone[0] == i and not waiting:
            return i
        before = silences.take(runs.start[alone])
        bits = tables[Turn.AGAIN][before] - tables[Turn.RESPONSE][before]
        told = bits + (trust.unanswered_bits - CONTRARY) >= _ENOUGH
        if not told.all():
            last = int(alone[int(np.argmin(told))])
    low, high = np.searchsorted(runs.asked, (i, last))
    if low < high:
        asked = runs.asked[low:high]
        if waiting and asked[0] == i:
            return i
        before, between = silences.take(runs.start[asked]), silences.take(runs.start[asked + 1])
        told = tables[Turn.REQUEST][before] - tables[Turn.RESPONSE][before] >= _PLAIN
        told &= tables[Turn.RESPONSE][between] - tables[Turn.AGAIN][between] >= _PLAIN
        if not told.all():
            last = int(asked[int(np.argmin(told))])
    return last


def plain_evidence(
    data: Bytes,
    start: Index,
    end: Index,
    role: NDArray[np.uint8],
    classes: NDArray[np.uint8],
    trust: Trust,
    said: Said,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What silence and conversation say for frames of a run, in bits, as the lattice would weigh them.

    `classes` are those of the silences before the frames; `said` is the conversation before the first.
    """
    asks = (role == Role.REQUEST) & (data.take(start) != 0)
    pending = np.append(not said.answered, asks[:-1])
    turns = np.where(asks & pending, Turn.AGAIN, role)
    conversation = np.where(asks & pending, trust.unanswered_bits, 0.0)
    answers = np.flatnonzero((role[1:] == Role.RESPONSE) & (role[:-1] == Role.REQUEST)) + 1
    fits = fitting(data, start[answers - 1], start[answers])
    failed = data.take(start[answers] + 1) & 0x80 != 0
    conversation[answers] = np.where(fits, np.where(failed, FITS_EXCEPTION, FITS), CONTRARY)
    if role[0] == Role.RESPONSE:
        known = said.answers(data[start[0] : end[0]].tobytes()) is not None
        conversation[0] = FITS if known else UNASKED if said.answered else CONTRARY
    return np.array(trust.evidence)[turns, classes], conversation
