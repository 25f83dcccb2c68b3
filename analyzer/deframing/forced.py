"""Where candidates tile the bytes with no rival: the path is forced, and whole runs of frames are taken as arrays.

An interval (start, end) that no other one overlaps needs no lattice; most need no thought about their role either.
Some do: a write's echo reads as request and as response. Request and echo side by side, and a request that nobody
answers, are told apart here by their places, as the lattice would; whatever is not plain is left to it. What hangs on
bytes and places alone is worked out for a whole slice at once; what silence has to say is asked when a run is taken
(`reach`). What is taken here the lattice would take as well: the bits counted are the least that it could give.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.limits import MAX_ADU

from .candidates import Candidates
from .conversation import OPEN, REACH, Candidate, response_fits, responses_fit
from .gaps import SpeakerTurn
from .rules import Bytes, CrcWindows, Index, Mask

_BACK: Final = 2 * OPEN  # frames that it may not answer either: an answer among them would keep others open
_NEVER: Final = -(1 << 62)
_FEW: Final = 48  # intervals
_NONE: Final = np.empty(0, np.intp)
ASKS, ANSWERS = int(SpeakerTurn.REQUEST), int(SpeakerTurn.RESPONSE)


class ForcedRuns(NamedTuple):
    """Intervals (start, end) of candidates, with what bytes and places say of them."""

    start: Index
    end: Index
    role: NDArray[np.uint8]  # where it is not plain, that of the first candidate
    either: Mask  # both roles read alike
    structure: NDArray[np.float32]
    lean: NDArray[np.float32]  # bits of structure for a request over an answer, where both roles read alike
    clean: Mask  # no other interval overlaps it, and it breaks no limit
    known: int  # the first interval that one may still overlap that has not come yet
    last: Index  # the last interval of the run that each is in
    second: Mask  # its role, though either, follows from that of the one before it
    again: Index  # places of those that ask, though either, if silence agrees: nobody answers, as those before
    doubt: Index  # places of those whose role only the lattice tells
    asks: ForcedRequests
    fits: Mask  # that it answers the one before it

    def plain(self, position: int) -> bool:
        """Whether an interval begins there that has no rivals, and whose role is plain."""
        i = int(self.start.searchsorted(position))
        return bool(i < len(self.start) and self.start[i] == position and self.clean[i] and not self.either[i])


class ForcedRequests(NamedTuple):
    """Intervals that read as request and as response, and ask, if silence agrees: the next one answers, or nobody."""

    number: Index
    alone: Mask  # nobody answers it
    waits: Mask  # the one before it, in its run, wants an answer
    late: Mask  # the same was asked shortly before, and nobody answered


_NOBODY: Final = ForcedRequests(_NONE, *[np.empty(0, np.bool_)] * 3)


@dataclass(frozen=True, slots=True)
class SearchedBytes:
    """What is known of the bytes being worked on, which begin at index `begin` of the buffer."""

    data: Bytes
    begin: int
    crc: CrcWindows
    found: Candidates

    def rivalled(self, start: int, end: int, origin: int) -> bool:
        """Whether another interval, from `origin` on, overlaps this one and ends with it at the latest."""
        found = self.found
        low, high = found.start.searchsorted((max(origin, start - MAX_ADU), end)).tolist()
        others = (found.end[low:high] <= end) & (found.end[low:high] > start)
        others &= (found.start[low:high] != start) | (found.end[low:high] != end)
        return bool(np.count_nonzero(others))

    def candidates_in(self, at: int, limit: int, known: int) -> list[Candidate]:
        """Those that lie in [at, limit) and end behind `known`, with offsets from `at`."""
        low, high = self.found.start.searchsorted((at, limit)).tolist()
        if low == high:
            return []
        start, end = self.found.start[low:high], self.found.end[low:high]
        fits = (end <= limit) & (end > known)
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


def forced_runs(found: Candidates, data: Bytes, known: int, silences: NDArray[np.uint8]) -> ForcedRuns:
    """Intervals of candidates; behind `known`, up to where nothing can still appear, clean ones end before a silence.

    `silences`: classes of those before the bytes, and of the one behind them where more has come; 0 where that is not
    known.
    """
    n = len(found)
    if n <= _FEW:
        spans = list(zip(found.start.tolist(), found.end.tolist(), strict=True))
        if len(set(spans)) == n:
            return _few_runs(found, spans, data, known, silences)
    new = np.ones(n + 1, np.bool_)  # and a spare one behind the last
    new[1:n] = (found.start[1:] != found.start[:-1]) | (found.end[1:] != found.end[:-1])
    first = new[:n].nonzero()[0]
    start, end, role = found.start[first], found.end[first], found.role[first]
    either = ~new.take(first + 1)
    m = len(start)
    furthest = np.zeros(m, np.intp)
    furthest[1:] = np.maximum.accumulate(end)[:-1]
    lean = np.zeros(m, np.float32)  # candidates of one place are by role
    lean[either] = found.structure[first[either]] - found.structure[first[either] + 1]
    structure = found.structure[first] + np.maximum(-lean, 0)
    clean = (furthest <= start) & (structure >= 0)  # else it breaks a limit
    clean[:-1] &= start[1:] >= end[:-1]
    open_ones = (end > known).nonzero()[0]
    silent = end[open_ones] < len(silences)
    silent[silent] = silences.take(end[open_ones][silent]) > 0
    clean[open_ones] &= silent
    joined = np.zeros(m + 1, np.bool_)  # at k: k follows k - 1 in one run
    joined[1:m] = clean[1:] & clean[:-1] & (start[1:] == end[:-1])
    heads = (~joined).nonzero()[0]  # and the spare one
    last = (heads[1:] - 1).repeat(heads[1:] - heads[:-1])
    closed = joined.copy()
    closed[open_ones] = False
    plain = _PlainRoles(data, start, end, role, either, closed, known)
    fits = _answering(data, start, plain.role, joined)
    late = _late(data, start, plain.role, fits, plain.ask)
    asks = ForcedRequests(plain.ask, plain.alone, plain.waits, late)
    structure = found.structure[first] - np.where(either & (plain.role == ANSWERS), lean, 0)
    doubt = np.union1d(plain.doubt, np.flatnonzero(either & (structure < 0))) if either.any() else plain.doubt
    first_open = int(open_ones[0]) if len(open_ones) else m
    return ForcedRuns(
        start, end, plain.role, either, structure, lean, clean, first_open, last, plain.second, plain.again, doubt,
        asks, fits,
    )  # fmt: skip


def _few_runs(
    found: Candidates, spans: list[tuple[int, int]], data: Bytes, known: int, silences: NDArray[np.uint8]
) -> ForcedRuns:
    """The same of a few intervals that read as request or as response, not as both: one by one, for arrays of so few
    take longer."""
    m, octets, classes = len(spans), data.tobytes(), silences.tolist()
    role, structure = found.role.tolist(), found.structure.tolist()
    clean, fits, last = [False] * m, [False] * m, list(range(m))
    furthest, first_open = 0, m
    for k, (start, end) in enumerate(spans):
        clean[k] = furthest <= start and structure[k] >= 0 and (k + 1 == m or spans[k + 1][0] >= end)
        if end > known:
            first_open = min(first_open, k)
            clean[k] = clean[k] and end < len(classes) and classes[end] > 0
        furthest = max(furthest, end)
        if k and clean[k] and clean[k - 1] and start == spans[k - 1][1]:
            last[k - 1] = -1  # that of the next one
            if role[k] > role[k - 1]:
                fits[k] = response_fits(octets, spans[k - 1][0], start)
    for k in range(m - 1, -1, -1):
        if last[k] < 0:
            last[k] = last[k + 1]
    no = np.zeros(m, np.bool_)
    return ForcedRuns(
        found.start, found.end, found.role, no, found.structure, np.zeros(m, np.float32), np.array(clean, np.bool_),
        first_open, np.array(last, np.intp), no, _NONE, _NONE, _NOBODY, np.array(fits, np.bool_),
    )  # fmt: skip


def _answering(data: Bytes, start: Index, role: NDArray[np.uint8], joined: Mask) -> Mask:
    """Which intervals answer the one before them."""
    fits = np.zeros(len(start), np.bool_)
    after = 1 + (joined[1 : len(start)] & (role[1:] > role[:-1])).nonzero()[0]
    fits[after] = responses_fit(data, start[after - 1], start[after])
    return fits


def _late(data: Bytes, start: Index, role: NDArray[np.uint8], fits: Mask, indices: Index) -> Mask:
    """Whether at `indices` a late answer may stand: to a request of that unit and function, not long before."""

    def key(which: Index) -> Index:
        at = start[which]
        return (data.take(at).astype(np.intp) << 8 | data.take(at + 1)) << 32 | at

    if not len(indices):
        return np.empty(0, np.bool_)
    unanswered = np.append(~fits[1:], True)
    asked = np.sort(np.append(key(np.flatnonzero((role == ASKS) & unanswered)), _NEVER))
    mine = key(indices)
    late: Mask = mine - asked[np.searchsorted(asked, mine) - 1] <= REACH
    return late


class _PlainRoles:
    """The roles that follow from bytes and places.

    Plain are two frames of which the second may answer the first, where no third could take part; and a request that
    the next frame, a request too, does not answer, where nothing waits for an answer.
    """

    def __init__(
        self, data: Bytes, start: Index, end: Index, role: NDArray[np.uint8], either: Mask, joined: Mask, known: int
    ) -> None:
        m = len(start)
        self.role = role
        self.second = np.zeros(m, np.bool_)
        self.ask = self.again = self.doubt = np.empty(0, np.intp)
        self.alone = self.waits = np.empty(0, np.bool_)
        some = either.nonzero()[0]
        if not len(some):
            return
        asks, answers = either | (role == ASKS), either | (role == ANSWERS)
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
        fits = responses_fit(data, start[before], start[after])
        answered = np.zeros(m + 2, np.bool_)  # at k: what follows k may answer it
        answered[before[fits]] = True
        pair = np.zeros(m, np.bool_)  # at k: k + 1 answers k, and no third takes part
        pair[:-1] = answered[: m - 1] & joined[1:m] & ~answered[1:m] & followed[1:m]
        pair[1:] &= ~(answered[: m - 1] & joined[1:m])
        self.second[1:] = pair[:-1]
        self.second &= either
        self.role = role.copy()
        self.role[pair & either], self.role[self.second] = ASKS, ANSWERS
        open_ones = some[~self.second[some]]
        waits = joined[open_ones] & (self.role[open_ones - 1] == ASKS) & (data.take(start[open_ones - 1]) != 0)
        alone = ~answered[open_ones] & joined[open_ones + 1]
        alone &= self.role[np.minimum(open_ones + 1, m - 1)] == ASKS
        self.again = _never_answering(open_ones[alone & waits], data, start, asks, joined)
        alone &= ~waits
        alone[alone] = ~self._repeated_behind(open_ones[alone], data, start, end)
        plain = pair[open_ones] | alone
        self.ask, self.alone, self.waits = open_ones[plain], alone[plain], waits[plain]
        plain[np.searchsorted(open_ones, self.again)] = True
        self.doubt = open_ones[~plain]

    def _repeated_behind(self, indices: Index, data: Bytes, start: Index, end: Index) -> Mask:
        """Whether what follows each is the request before it once more: that it knows if this one asks or answers."""
        asking = np.flatnonzero(self.role == ASKS)
        before, behind = asking.searchsorted(indices) - 1, indices + 1
        asked = asking[np.maximum(before, 0)]
        same: Mask = (before >= 0) & (end[asked] - start[asked] == end[behind] - start[behind])
        for first in (start, start + 1, end - 2, end - 1):  # unit, function, check value
            same &= data.take(first[asked]) == data.take(first[behind])
        return same


def _never_answering(indices: Index, data: Bytes, start: Index, asks: Mask, joined: Mask) -> Index:
    """Those of `indices` that answer none of the frames before them in their run, all of which ask."""
    indices = indices[indices >= _BACK]
    for back in range(1, _BACK + 1):
        asker = indices - back
        indices = indices[joined[asker + 1] & asks[asker] & ~responses_fit(data, start[asker], start[indices])]
    return indices
