"""How far a forced run is taken, once silence has its say.

As far as roles are plain; and where so little is known of what follows that a longer frame may still come, as live, as
far as the lattice would not wait for one.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.limits import EXCEPTION

from .candidates import CRC_BITS
from .conversation import REACH, Conversation, ConversationTracker, responses_fit
from .forced import ANSWERS, ASKS, ForcedRuns
from .gaps import AGAINST, GapStatistics, SpeakerTurn
from .lattice import CONTRARY, FITS, FITS_EXCEPTION, HALF, LEAD
from .rules import Bytes, Index, length_tables

_PLAIN: Final = -4.0  # bits by which silence may speak against a role that the places speak for
_SURE: Final = 10.0  # bits for an echo, and not the request once more, where requests go unanswered
_ENOUGH: Final = 6.0  # bits for a request that nobody answers over an answer that nobody asked for
_MORE: Final = 12.0  # bits for one that comes after others that nobody answers
_FEW: Final = 64  # intervals that are looked at one by one
_AGAIN: Final = int(SpeakerTurn.AGAIN)


@dataclass(frozen=True, slots=True)
class RunContext:
    """What is known where a run begins. `silences` are classes of those before the bytes of `data`, and perhaps behind.

    `waiting`: the frame before is a request that wants an answer; `tracker` is the conversation up to it.
    """

    data: Bytes
    silences: NDArray[np.uint8]
    statistics: GapStatistics
    tracker: ConversationTracker
    waiting: bool


def run_reach(runs: ForcedRuns, i: int, last: int, context: RunContext) -> tuple[int, NDArray[np.float32]]:
    """The end of a run from interval i on, before `last`, and the margin (bits) of each interval in it."""
    bound = last
    last, margin = _plain_reach(runs, i, last, context)
    last = _quiet_reach(runs, i, last, context)
    if last < bound or last > runs.last[i] or runs.either[last]:
        last = _without_tail(runs, i, last, context.silences, context.statistics)
    return last, margin[: last - i]


def _plain_reach(runs: ForcedRuns, i: int, last: int, context: RunContext) -> tuple[int, NDArray[np.float32]]:
    """How far, from interval i on and before `last`, roles are plain: the first that is not; and by how many bits."""
    data, silences, statistics, waiting = context.data, context.silences, context.statistics, context.waiting
    surely = np.float32(CRC_BITS + statistics.noise_cost)
    if not len(runs.doubt) and not len(runs.again) and not len(runs.asks.number):
        return last, runs.structure[i:last] + surely
    at = int(runs.doubt.searchsorted(i))
    if at < len(runs.doubt):
        last = min(last, int(runs.doubt[at]))
    table, asking = statistics.table, statistics.request_bits
    low, high = runs.again.searchsorted((i, last))
    if low < high:
        again = runs.again[low:high]
        if again[0] == i and not waiting:
            return i, np.empty(0, np.float32)
        before = silences.take(runs.start[again])
        first = table[_AGAIN, before] - table[ANSWERS, before] + asking + runs.lean.take(again)
        certain = first + (statistics.unanswered_bits - CONTRARY) >= _MORE
        if not certain.all():
            last = int(again[int(np.argmin(certain))])
    low, high = runs.asks.number.searchsorted((i, last))
    number, alone, waits, late = (column[low:high] for column in runs.asks)
    if len(number):
        start = runs.start[number]
        if number[0] == i:
            waits = np.append(waiting, waits[1:])
        early = np.flatnonzero(start < REACH)
        if len(early):  # what was asked before may be before these bytes
            conversation = context.tracker.conversation
            asked = {open_requests.adu[:2] for open_requests in conversation.open_requests}
            late = late.copy()
            late[early] |= [data[s : s + 2].tobytes() in asked for s in start[early].tolist()]
            for k in early[alone[early]].tolist():  # the request before it once more, behind it
                behind = number[k] + 1
                late[k] |= data[runs.start[behind] : runs.end[behind]].tobytes() == conversation.last
        before, behind = silences.take(start), silences.take(runs.end[number])
        first = table[np.where(waits, _AGAIN, ASKS), before] - table[ANSWERS, before] + asking
        first += runs.lean.take(number)
        echo = table[ANSWERS, behind] - table[_AGAIN, behind] - runs.lean.take(number + 1)
        repeated = statistics.unanswered_bits + HALF  # two requests that nobody answers stand against an echo
        least = np.where(waits, _SURE + statistics.unanswered_bits, max(_PLAIN, LEAD + 2 * repeated))
        answered = (first >= _PLAIN) & (echo >= least)
        unanswered = statistics.unanswered_bits + table[_AGAIN, behind] - table[ASKS, behind]
        unanswered = np.where(data.take(start) != 0, unanswered, 0.0)  # a broadcast is not answered
        bits = first - statistics.unasked[0].take(before) + unanswered
        certain = np.where(alone, (bits >= _ENOUGH) & ~waits, answered) & ~late
        if not certain.all():
            high = int(np.argmin(certain))
            last, number, alone, bits = int(number[high]), number[:high], alone[:high], bits[:high]
    margin = runs.structure[i:last] + surely
    if len(number):
        margin[number[alone] - i] = bits[alone]
    return last, margin


def _quiet_reach(runs: ForcedRuns, i: int, last: int, context: RunContext) -> int:
    """The end of a run from interval i on, before `last`, as far as the lattice would not wait for longer frames.

    It waits for none where requests and their answers alternate, of units that are known, each before a silence that
    may end a frame, and nobody waits for an answer from before.
    """
    known = max(i, runs.known)
    if last <= known:
        return last
    data, silences, statistics = context.data, context.silences, context.statistics
    conversation, asked = context.tracker.conversation, context.waiting
    if known - i > _FEW or len(conversation.open_requests) != asked:
        return known
    units, most, asking = statistics.unit_bits, statistics.most, statistics.request_bits
    starts, ends, roles, fits = (column[i:last].tolist() for column in (runs.start, runs.end, runs.role, runs.fits))
    for k, start, end, role, answers in zip(range(i, last), starts, ends, roles, fits, strict=True):
        if role == ASKS:
            unit = int(data[start])
            plain = not asked and bool(unit) and units[unit] + asking >= 0
        else:
            answers = answers if k > i else conversation.answers(data[start:end].tobytes()) is not None
            plain = asked and answers
        if not plain or (k >= known and most[silences[end]] < AGAINST):
            return max(k, known)
        asked = not asked
    return last


def _without_tail(runs: ForcedRuns, i: int, last: int, silences: NDArray[np.uint8], statistics: GapStatistics) -> int:
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
        echo = statistics.table[ANSWERS, silence] - statistics.table[_AGAIN, silence]
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
    asks = (role == ASKS) & (data.take(start) != 0)
    open_requests = np.append(not conversation.answered, asks[:-1])
    turns = np.where(asks & open_requests, _AGAIN, role)
    conversation_bits = np.where(asks & open_requests, statistics.unanswered_bits, 0.0)
    answers = np.flatnonzero(role[1:] > role[:-1]) + 1
    fits = responses_fit(data, start[answers - 1], start[answers])
    failed = data.take(start[answers] + 1) & EXCEPTION != 0
    conversation_bits[answers] = np.where(fits, np.where(failed, FITS_EXCEPTION, FITS), CONTRARY)
    if role[0] == ANSWERS:
        known = conversation.answers(data[start[0] : end[0]].tobytes()) is not None
        certain = int(length_tables().certain[data[start[0] + 1] & 0x7F])
        free = conversation.answered or statistics.answers_only
        unasked = float(statistics.unasked[certain, classes[0]]) if free else CONTRARY
        conversation_bits[0] = FITS if known else unasked
    return statistics.table[turns, classes], conversation_bits
