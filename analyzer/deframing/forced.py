"""Where candidates tile the bytes with no rival: the path is forced, and whole runs of frames are taken as arrays.

An interval (start, end) that no other one overlaps needs no lattice; most need no thought about their role either.
Some do: a write's echo reads as request and as response. Request and echo side by side, and a request that nobody
answers, are told apart here by their places, as the lattice would; whatever is not plain is left to it. What hangs on
bytes and places alone is worked out for a whole slice at once (`forced_runs`); what silence has to say is asked when a
run is taken (`plain_reach`). What is taken here the lattice would take as well: the bits counted are the least that it
could give.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.adu import EXCEPTION, MAX_ADU

from .candidates import CRC_BITS, Candidates
from .conversation import OPEN, REACH, Conversation, ConversationTracker, responses_fit
from .crc_windows import CrcWindows
from .gaps import GapStatistics, SpeakerTurn
from .lattice import CONTRARY, FITS, FITS_EXCEPTION, HALF, LEAD
from .paths import Candidate
from .rules import Bytes, Index, Mask, length_tables

_PLAIN: Final = -4.0  # bits by which silence may speak against a role that the places speak for
_SURE: Final = 10.0  # bits for an echo, and not the request once more, where requests go unanswered
_ENOUGH: Final = 6.0  # bits for a request that nobody answers over an answer that nobody asked for
_MORE: Final = 12.0  # bits for one that comes after others that nobody answers
_BACK: Final = 2 * OPEN  # frames that it may not answer either: an answer among them would keep others open
_NEVER: Final = -(1 << 62)
_ASKS, _ANSWERS, _AGAIN = int(SpeakerTurn.REQUEST), int(SpeakerTurn.RESPONSE), int(SpeakerTurn.AGAIN)


class ForcedRuns(NamedTuple):
    """Intervals (start, end) of candidates, with what bytes and places say of them."""

    start: Index
    end: Index
    role: NDArray[np.uint8]  # where it is not plain, that of the first candidate
    either: Mask  # both roles read alike
    structure: NDArray[np.float32]
    lean: NDArray[np.float32]  # bits of structure for a request over an answer, where both roles read alike
    clean: Mask  # no other interval overlaps it, and it breaks no limit
    last: Index  # the last interval of the run that each is in
    second: Mask  # its role, though either, follows from that of the one before it
    again: Index  # places of those that ask, though either, if silence agrees: nobody answers, as those before
    doubt: Index  # places of those whose role only the lattice tells
    asks: ForcedRequests
    fits: Mask  # that it answers the one before it

    def contested(self, position: int) -> bool:
        """Whether an interval begins there that has rivals, or whose role is not plain."""
        i = int(np.searchsorted(self.start, position))
        begins = i < len(self.start) and self.start[i] == position
        return begins and not (self.clean[i] and not self.either[i])


class ForcedRequests(NamedTuple):
    """Intervals that read as request and as response, and ask, if silence agrees: the next one answers, or nobody."""

    number: Index
    alone: Mask  # nobody answers it
    waits: Mask  # the one before it, in its run, wants an answer
    late: Mask  # the same was asked shortly before, and nobody answered


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
        low, high = np.searchsorted(found.start, (max(origin, start - MAX_ADU), end))
        others = (found.end[low:high] <= end) & (found.end[low:high] > start)
        others &= (found.start[low:high] != start) | (found.end[low:high] != end)
        return bool(others.any())

    def candidates_in(self, at: int, limit: int, known: int) -> list[Candidate]:
        """Those that lie in [at, limit) and end behind `known`, with offsets from `at`."""
        low, high = np.searchsorted(self.found.start, (at, limit))
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


def forced_runs(found: Candidates, data: Bytes, known: int) -> ForcedRuns:
    """Intervals of candidates; clean ones end at or before `known`, where nothing can still appear."""
    n = len(found)
    new = np.ones(n, np.bool_)
    new[1:] = (found.start[1:] != found.start[:-1]) | (found.end[1:] != found.end[:-1])
    first = np.flatnonzero(new)
    start, end, role = found.start[first], found.end[first], found.role[first]
    either = np.diff(np.append(first, n)) > 1
    m = len(start)
    furthest = np.zeros(m, np.intp)
    furthest[1:] = np.maximum.accumulate(end)[:-1]
    lean = np.zeros(m, np.float32)  # candidates of one place are by role
    lean[either] = found.structure[first[either]] - found.structure[first[either] + 1]
    structure = found.structure[first] + np.maximum(-lean, 0)
    clean = (furthest <= start) & (end <= known) & (structure >= 0)  # else it breaks a limit
    clean[:-1] &= start[1:] >= end[:-1]
    joined = np.zeros(m + 1, np.bool_)  # at k: k follows k - 1 in one run
    joined[1:m] = clean[1:] & clean[:-1] & (start[1:] == end[:-1])
    heads = np.flatnonzero(~joined[:m])
    lasts = np.append(heads[1:] - 1, m - 1)[: len(heads)]
    last = np.repeat(lasts, lasts - heads + 1) if m else np.empty(0, np.intp)
    plain = _PlainRoles(data, start, end, role, either, joined, known)
    fits = _answering(data, start, plain.role, joined)
    late = _late(data, start, plain.role, fits, plain.ask)
    asks = ForcedRequests(plain.ask, plain.alone, plain.waits, late)
    structure = found.structure[first] - np.where(either & (plain.role == _ANSWERS), lean, 0)
    doubt = np.union1d(plain.doubt, np.flatnonzero(either & (structure < 0)))
    return ForcedRuns(
        start, end, plain.role, either, structure, lean, clean, last, plain.second, plain.again, doubt, asks, fits
    )


def _answering(data: Bytes, start: Index, role: NDArray[np.uint8], joined: Mask) -> Mask:
    """Which intervals answer the one before them."""
    fits = np.zeros(len(start), np.bool_)
    after = 1 + np.flatnonzero(joined[1 : len(start)] & (role[1:] > role[:-1]))
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
    asked = np.sort(np.append(key(np.flatnonzero((role == _ASKS) & unanswered)), _NEVER))
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
        some = np.flatnonzero(either)
        if not len(some):
            return
        asks, answers = either | (role == _ASKS), either | (role == _ANSWERS)
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
        self.role[pair & either], self.role[self.second] = _ASKS, _ANSWERS
        open_ones = some[~self.second[some]]
        waits = joined[open_ones] & (self.role[open_ones - 1] == _ASKS) & (data.take(start[open_ones - 1]) != 0)
        alone = ~answered[open_ones] & joined[open_ones + 1]
        alone &= self.role[np.minimum(open_ones + 1, m - 1)] == _ASKS
        self.again = _never_answering(open_ones[alone & waits], data, start, asks, joined)
        alone &= ~waits
        alone[alone] = ~self._repeated_behind(open_ones[alone], data, start, end)
        plain = pair[open_ones] | alone
        self.ask, self.alone, self.waits = open_ones[plain], alone[plain], waits[plain]
        plain[np.searchsorted(open_ones, self.again)] = True
        self.doubt = open_ones[~plain]

    def _repeated_behind(self, indices: Index, data: Bytes, start: Index, end: Index) -> Mask:
        """Whether what follows each is the request before it once more: that it knows if this one asks or answers."""
        asking = np.flatnonzero(self.role == _ASKS)
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


def plain_reach(
    runs: ForcedRuns,
    i: int,
    last: int,
    data: Bytes,
    silences: NDArray[np.uint8],
    statistics: GapStatistics,
    tracker: ConversationTracker,
    *,
    waiting: bool,
) -> tuple[int, NDArray[np.float32]]:
    """How far, from interval i on and before `last`, roles are plain: the first one that is not; and by how many bits.

    `waiting`: the frame before is a request that wants an answer; `tracker` is the conversation up to it.
    """
    at = int(np.searchsorted(runs.doubt, i))
    if at < len(runs.doubt):
        last = min(last, int(runs.doubt[at]))
    table, asking = statistics.table, statistics.request_bits
    low, high = np.searchsorted(runs.again, (i, last))
    if low < high:
        again = runs.again[low:high]
        if again[0] == i and not waiting:
            return i, np.empty(0, np.float32)
        before = silences.take(runs.start[again])
        first = table[_AGAIN, before] - table[_ANSWERS, before] + asking + runs.lean.take(again)
        certain = first + (statistics.unanswered_bits - CONTRARY) >= _MORE
        if not certain.all():
            last = int(again[int(np.argmin(certain))])
    low, high = np.searchsorted(runs.asks.number, (i, last))
    number, alone, waits, late = (column[low:high] for column in runs.asks)
    if len(number):
        start = runs.start[number]
        if number[0] == i:
            waits = np.append(waiting, waits[1:])
        early = np.flatnonzero(start < REACH)
        if len(early):  # what was asked before may be before these bytes
            conversation = tracker.conversation
            asked = {open_requests.adu[:2] for open_requests in conversation.open_requests}
            late = late.copy()
            late[early] |= [data[s : s + 2].tobytes() in asked for s in start[early].tolist()]
            for k in early[alone[early]].tolist():  # the request before it once more, behind it
                behind = number[k] + 1
                late[k] |= data[runs.start[behind] : runs.end[behind]].tobytes() == conversation.last
        before, behind = silences.take(start), silences.take(runs.end[number])
        first = table[np.where(waits, _AGAIN, _ASKS), before] - table[_ANSWERS, before] + asking
        first += runs.lean.take(number)
        echo = table[_ANSWERS, behind] - table[_AGAIN, behind] - runs.lean.take(number + 1)
        repeated = statistics.unanswered_bits + HALF  # two requests that nobody answers stand against an echo
        least = np.where(waits, _SURE + statistics.unanswered_bits, max(_PLAIN, LEAD + 2 * repeated))
        answered = (first >= _PLAIN) & (echo >= least)
        unanswered = statistics.unanswered_bits + table[_AGAIN, behind] - table[_ASKS, behind]
        unanswered = np.where(data.take(start) != 0, unanswered, 0.0)  # a broadcast is not answered
        bits = first - statistics.unasked[0].take(before) + unanswered
        certain = np.where(alone, (bits >= _ENOUGH) & ~waits, answered) & ~late
        if not certain.all():
            high = int(np.argmin(certain))
            last, number, alone, bits = int(number[high]), number[:high], alone[:high], bits[:high]
    margin = runs.structure[i:last] + np.float32(CRC_BITS + statistics.noise_cost)
    if len(number):
        margin[number[alone] - i] = bits[alone]
    return last, margin


def without_tail(runs: ForcedRuns, i: int, last: int, silences: NDArray[np.uint8], statistics: GapStatistics) -> int:
    """The end of a run from interval i on, before `last`, behind which the lattice has the word.

    After a whole exchange, and where silence parts them, the lattice would decide as well before it goes on; a frame
    by itself it would decide together with what follows, but for a request after others that nobody answers.
    """
    last = _without_echoes(runs, i, last, silences, statistics)
    end = int(runs.end[last - 1]) if last > i else 0
    if last == i or end == len(silences) or silences[end] or (runs.fits[last - 1] and last - 2 >= i):
        return last
    last -= 1
    while last > i and runs.either[last - 1] and runs.either[last] and not _holds(runs.again, last - 1):
        last -= 1
    return _without_echoes(runs, i, last, silences, statistics)


def _without_echoes(runs: ForcedRuns, i: int, last: int, silences: NDArray[np.uint8], statistics: GapStatistics) -> int:
    """The same without exchanges at the end of which the second frame may be the request once more: what follows
    tells, and the lattice would wait for it."""
    while last - 2 >= i and runs.fits[last - 1] and runs.either[last - 1] and runs.end[last - 1] < len(silences):
        silence = silences[runs.start[last - 1]]
        echo = statistics.table[_ANSWERS, silence] - statistics.table[_AGAIN, silence]
        if echo - statistics.unanswered_bits >= LEAD:
            break
        last -= 2
    return last


def _holds(indices: Index, number: int) -> bool:
    at = int(np.searchsorted(indices, number))
    return at < len(indices) and int(indices[at]) == number


def plain_evidence(
    data: Bytes,
    start: Index,
    end: Index,
    role: NDArray[np.uint8],
    classes: NDArray[np.uint8],
    statistics: GapStatistics,
    conversation: Conversation,
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """What silence and conversation say for frames of a run, in bits, as the lattice would weigh them.

    `classes` are those of the silences before the frames; `conversation` is the conversation before the first.
    """
    asks = (role == _ASKS) & (data.take(start) != 0)
    open_requests = np.append(not conversation.answered, asks[:-1])
    turns = np.where(asks & open_requests, _AGAIN, role)
    conversation_bits = np.where(asks & open_requests, statistics.unanswered_bits, 0.0)
    answers = np.flatnonzero(role[1:] > role[:-1]) + 1
    fits = responses_fit(data, start[answers - 1], start[answers])
    failed = data.take(start[answers] + 1) & EXCEPTION != 0
    conversation_bits[answers] = np.where(fits, np.where(failed, FITS_EXCEPTION, FITS), CONTRARY)
    if role[0] == _ANSWERS:
        known = conversation.answers(data[start[0] : end[0]].tobytes()) is not None
        certain = int(length_tables().certain[data[start[0] + 1] & 0x7F])
        free = conversation.answered or statistics.answers_only
        unasked = float(statistics.unasked[certain, classes[0]]) if free else CONTRARY
        conversation_bits[0] = FITS if known else unasked
    return statistics.table[turns, classes], conversation_bits
