"""The conversation: who answers whom, which requests are open, and how that is carried along a stream and its paths.

One judge of answers: `Conversation` for a frame at a time (a path of the lattice, a contested stretch),
`responses_fit` for arrays of pairs. Runs of frames taken as arrays say nothing that needs knowing until the next
contested stretch; then the frames in reach of its beginning are gone through. A path through such a stretch is made of
candidates and steps, and few survive at a position.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.length_rules import Role
from dissectors.lengths import Expectation, expectation, relations
from dissectors.limits import Echo, RequestedByteCount, taken

from .rules import Bytes, Index, Mask, big_endian_at

OPEN: Final = 4  # requests that may be open at once
_OPEN_REACH: Final = 1024  # bytes: requests further back are forgotten
REACH: Final = 1300  # bytes: further back than a conversation reaches
_REQUEST: Final = int(Role.REQUEST)


class OpenRequest(NamedTuple):
    """A request that may still be answered."""

    start: int  # offset in the stream of its port
    adu: bytes
    expects: Expectation

    @classmethod
    def of(cls, start: int, adu: bytes) -> OpenRequest:
        return cls(start, adu, expectation(adu))


class Conversation(NamedTuple):
    """The conversation so far: outstanding requests, the newest last, and whether the newest was answered."""

    open_requests: tuple[OpenRequest, ...] = ()
    answered: bool = True
    last: bytes = b""  # the newest request

    def ask(self, request: OpenRequest) -> Conversation:
        """After a request. A broadcast is never answered, but some devices do."""
        return Conversation((*self._still_open(request.start, request.adu), request), request.adu[0] == 0, request.adu)

    def exchanged(self, start: int, adu: bytes) -> Conversation:
        """After a request and, right behind it, its answer."""
        return Conversation(self._still_open(start, adu), True, adu)

    def _still_open(self, start: int, adu: bytes) -> tuple[OpenRequest, ...]:
        """What stays outstanding when another request begins at `start`; asked once more, it is open once."""
        return tuple(p for p in self.open_requests[1 - OPEN :] if p.start >= start - _OPEN_REACH and p.adu != adu)

    def answers(self, adu: bytes) -> int | None:
        """Which pending request a response answers: the newest that fits."""
        for i in range(len(self.open_requests) - 1, -1, -1):
            if self.open_requests[i].expects.fits(adu):
                return i
        return None

    def waits_for(self, adu: bytes) -> bool:
        """Whether the newest request waits for an answer of this unit and function, whatever else it should be."""
        return not self.answered and bool(self.open_requests) and self.last[:2] == adu[:2]

    def answer(self, which: int) -> Conversation:
        """After an answer to pending[which]; older ones stay outstanding for a while."""
        newest = which == len(self.open_requests) - 1
        return Conversation(
            self.open_requests[:which] + self.open_requests[which + 1 :], self.answered or newest, self.last
        )


@dataclass(frozen=True, slots=True)
class FrameRun:
    """Frames (indices of `data`, whose first byte is at stream offset `base`)."""

    data: Bytes
    base: int
    start: Index
    end: Index
    role: NDArray[np.uint8]
    fits: Mask  # that it answers the one before it

    @property
    def octets(self) -> int:
        """Bytes."""
        return int(self.end[-1] - self.start[0])

    def adu(self, i: int) -> bytes:
        """The bytes of one."""
        return self.data[self.start[i] : self.end[i]].tobytes()


class ConversationTracker:
    """What was said so far, and runs of frames that have yet to be added to it."""

    _conversation: Conversation
    _runs: list[FrameRun]

    def __init__(self) -> None:
        self._conversation = Conversation()
        self._runs = []

    @property
    def conversation(self) -> Conversation:
        """The conversation up to now."""
        conversation = self._conversation
        for run in self._runs:
            conversation = conversation_after(conversation, run)
        self.settle(conversation)
        return conversation

    def settle(self, conversation: Conversation) -> None:
        """The conversation is this now."""
        self._conversation = conversation
        self._runs.clear()

    def extend(self, run: FrameRun) -> None:
        """A run of frames follows. What it, with the runs before it, puts out of reach is forgotten."""
        self._runs.append(run)
        if len(self._runs) == 1 and run.octets < REACH:
            return
        octets = 0
        for i in range(len(self._runs) - 1, -1, -1):
            octets += self._runs[i].octets
            if octets >= REACH:
                del self._runs[:i]
                self._conversation = Conversation()
                break


def conversation_after(conversation: Conversation, run: FrameRun) -> Conversation:
    """The conversation after a run: exchange by exchange, and at once where nothing is open."""
    n = len(run.start)
    asks, fits = [role == _REQUEST for role in run.role.tolist()], [*run.fits.tolist(), False]
    paired = [asks[j] and fits[j + 1] for j in range(n)]  # with the next one
    odd = [j for j in range(n) if not paired[j] and not (j and paired[j - 1])]
    odd.append(n)
    i = k = 0
    if all(asks[-OPEN:]) and len({run.adu(j) for j in range(max(0, n - OPEN), n)}) == OPEN:
        i = n - OPEN  # whatever was open before them is forgotten
    while i < n:
        while odd[k] < i:
            k += 1
        if odd[k] > i:
            if not conversation.open_requests:
                i = odd[k] - 2  # only the last exchange before it matters
            conversation = conversation.exchanged(run.base + int(run.start[i]), run.adu(i))
            i += 2
            continue
        adu = run.adu(i)
        if asks[i]:
            conversation = conversation.ask(OpenRequest.of(run.base + int(run.start[i]), adu))
        elif (which := conversation.answers(adu)) is not None:
            conversation = conversation.answer(which)
        i += 1
    return conversation


def responses_fit(data: Bytes, requests: Index, responses: Index, ends: tuple[Index, Index] | None = None) -> Mask:
    """For pairs of ADU starts: whether the response answers the request. Shape: that of the two arrays.

    `ends`: of requests and responses, where frames may be shorter than they should be; else the end of the data. One
    that ends before what should agree answers nothing.
    """
    function = data.take(requests + 1)
    answer = data.take(responses + 1)
    fits: NDArray[np.bool_] = (data.take(requests) == data.take(responses)) & ((answer & 0x7F) == function)
    plain = fits & (answer == function)
    for code in np.bincount(function[plain]).nonzero()[0].tolist():
        which = (plain & (function == code)).nonzero()[0]
        fits[which] = False
        reach = map(max, zip((0, 0), *map(_reach, relations(code)), strict=True))
        for starts, end, least in zip((requests, responses), ends or (None, None), reach, strict=True):
            room = len(data) if end is None else end.take(which)
            which = which.compress(starts.take(which) + least < room)
        request, response = requests.take(which), responses.take(which)
        agree = np.ones(len(which), np.bool_)
        for relation in relations(code):
            if isinstance(relation, RequestedByteCount):
                quantity = big_endian_at(data, request + relation.quantity_offset + 1, 2)
                count = big_endian_at(data, response + relation.count_offset + 1, 1)
                agree &= count == (taken(quantity, relation.bits) & 0xFF)
            else:
                agree &= _echoed(data, request, response, relation)
        fits[which] = agree
    return fits


def response_fits(octets: bytes, request: int, response: int) -> bool:
    """The same of one pair, in the bytes of the data."""
    function, answer = octets[request + 1], octets[response + 1]
    if octets[request] != octets[response] or answer & 0x7F != function:
        return False
    if answer != function:
        return True
    room = len(octets)
    for relation in relations(function):
        asked, answered = _reach(relation)
        if request + asked >= room or response + answered >= room:
            return False
        if isinstance(relation, RequestedByteCount):
            at = request + relation.quantity_offset + 1
            due = taken(octets[at] << 8 | octets[at + 1], relation.bits) & 0xFF
            agrees = octets[response + relation.count_offset + 1] == due
        else:
            at, echo = request + relation.request_offset + 1, response + relation.response_offset + 1
            agrees = octets[at : at + relation.width] == octets[echo : echo + relation.width]
        if not agrees:
            return False
    return True


def _reach(relation: RequestedByteCount | Echo) -> tuple[int, int]:
    """How many bytes behind its unit a request, and a response, has at the least that holds what this relates."""
    if isinstance(relation, RequestedByteCount):
        return relation.quantity_offset + 2, relation.count_offset + 1
    return relation.request_offset + relation.width, relation.response_offset + relation.width


def _echoed(data: Bytes, request: Index, response: Index, echo: Echo) -> Mask:
    same = np.ones(len(request), np.bool_)
    for i in range(echo.width):
        same &= data.take(request + (echo.request_offset + 1 + i)) == data.take(
            response + (echo.response_offset + 1 + i)
        )
    return same


SURE = 64.0  # bits: what cannot be doubted
_BEAM: Final = 6  # paths


class Candidate(NamedTuple):
    """A window that could be a frame; offsets in the stretch."""

    start: int
    end: int
    role: int
    structure: float
    declared: bool = True  # its function's length is known; else the window's CRC alone speaks for it
    damaged: bool = False  # its CRC is wrong: only an answer that fits a request is believed to be that
    doubtful: bool = False  # breaks a rule, or its function was never heard: whole frames inside count against it


def holds_a_frame(candidates: Sequence[Candidate], start: int, end: int) -> bool:
    """Whether a whole frame takes most of these bytes: then the rest are strays."""
    return any(start <= c.start and c.end <= end and 2 * (c.end - c.start) > end - start for c in candidates)


Losers = tuple[tuple[float, "PathStep | None"], ...]  # paths beaten: by how many bits, and their last steps


@dataclass(slots=True, eq=False)
class PathStep:
    """A part of a path: a frame or a run of noise, and the path before it."""

    start: int
    end: int
    candidate: Candidate | None
    before: PathStep | None
    score: float  # of the path up to its end
    conversation: Conversation  # the conversation after it
    gap_bits: float = 0.0
    conversation_bits: float = 0.0
    losers: Losers = ()  # paths that it beat to its start

    @property
    def damaged_request(self) -> bool:
        return self.candidate is not None and self.candidate.damaged and self.candidate.role == Role.REQUEST


class Survivor(NamedTuple):
    """A path that ends in a frame (or at the beginning); what is behind it, up to where one looks, is noise."""

    score: float  # at its end
    tip: PathStep | None
    end: int
    conversation: Conversation
    noisy: bool = False  # it holds noise, or a damaged frame
    since_noise: float = 0.0  # what its frames since the last noise have scored
    losers: Losers = ()  # paths beaten since its end


def pruned(paths: list[tuple[float, Survivor]], position: int) -> list[Survivor]:
    """The few of these paths to a position that are worth going on with, best first."""
    paths.sort(key=path_score, reverse=True)
    least = paths[0][0] - SURE
    ranks: dict[object, int] = {}
    survivors: list[tuple[float, Survivor]] = []
    for score, path in paths:
        if score < least:
            break  # nothing will bring it back
        conversation, last = path.conversation, path.tip and path.tip.candidate
        key = (
            path.end == position,
            last.role if last else -1,
            tuple([p.start for p in conversation.open_requests]),
            conversation.answered,
        )
        rival = ranks.get(key)
        if rival is None and len(ranks) < _BEAM:
            ranks[key] = len(survivors)
            survivors.append((score, path))
        else:
            rival = rival or 0
            best, winner = survivors[rival]
            if path.tip is not winner.tip:
                survivors[rival] = best, winner._replace(losers=(*winner.losers, (best - score, path.tip)))
    return [path for _, path in survivors]


def candidate_end(candidate: Candidate) -> int:
    return candidate.end


def by_end(candidate: Candidate) -> tuple[int, int, int]:
    """The order in which candidates are taken."""
    return candidate.end, candidate.start, candidate.role


def path_score(scored: tuple[float, Survivor]) -> float:
    return scored[0]
