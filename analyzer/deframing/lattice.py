"""The most likely explanation of a contested stretch of bytes.

Theory. Every byte is part of a frame or noise. An explanation is a path through positions: frames (candidates) and
noise runs, end to end. Its score is a log-likelihood ratio in bits against "all of it is noise that nobody sent":

    frame   + CRC (16) + structure (function, limits, counts) + silence before it + conversation
    noise   - a cost to begin, - a cost a byte (less for 00, FE, FF, which drivers make when they switch)

Paths are extended from left to right; at each position only a few survive (a beam), told apart by what the
conversation would be after them: the pending requests are part of a path, for what an answer is worth depends on
them. A frame whose payload holds whole frames inherits what those would have scored (`_inside`): chance or the
sender put them there, and the outer frame explains them as well as they explain themselves.

The lattice only looks at bytes before the position it has advanced to, so a decision taken at a position is the same
whatever comes later. Where survivors part and meet again, the loser is remembered: the margin of every boundary, and
what would have stood there instead, come from that.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate
from math import inf

from dissectors.length_rules import Role
from dissectors.limits import EXCEPTION

from ..tables.schema import GLITCHES
from .candidates import CRC_BITS
from .conversation import (
    Candidate,
    Conversation,
    Losers,
    OpenRequest,
    PathStep,
    Survivor,
    by_end,
    candidate_end,
    path_score,
    pruned,
)
from .gaps import GapStatistics, SpeakerTurn
from .rules import length_tables

NOISE_BYTE = 77 / 64
GLITCH_BYTE = 39 / 64
GLITCH_RUN = 6  # bytes
FITS = 21.0  # an answer of the right unit, function and count: what its header proves beyond its structure
FITS_BARE = 13.0  # an answer of which only unit and function are known
FITS_EXCEPTION = 8.0
LATE = -8.0  # it answers an older request
LATE_BYTE = -1.0 / 16  # for each byte that has passed since the request: answers come soon or never
ANSWERED_IN_NOISE = -1.0
ASKED_IN_NOISE = -9.0  # nothing was, but what was noise may have been the request
CONTRARY = -24.0  # something else was pending
MISMATCH = 3.0  # of the unit and function that were asked, and something else is amiss
AGAINST_FRAME = -9.0  # the most that silence and conversation say against a frame that is legal by itself
HALF = 1.0  # of the requests that nobody answers, half are asked again, half are given up
REPEATED = -5.0  # a request that was just answered, once more
KNOWN = 3.0  # bits of a function that its structure counts already
IMPOSSIBLE = -1000.0
EMBEDDED = 3.0  # a whole frame inside a payload
AFTER_NOISE = -2.0
LEAD = 8.0  # bits over the next best reading of the same bytes that a decision needs
LOST = 4  # bytes of noise that may have been a frame
_GLITCHES = bytes(GLITCHES)
_COST_STEPS = 64
_OCTET_COSTS = bytes(round(_COST_STEPS * (GLITCH_BYTE if octet in GLITCHES else NOISE_BYTE)) for octet in range(256))


class Lattice:
    """Grows paths over bytes from position 0, which is known to be a boundary; more bytes and candidates may be added.

    `silences` are gap classes a byte; `statistics` says what they are worth on this tap.
    """

    _data: bytes
    offset: int
    _silences: Sequence[int]
    _gap_bits: list[list[float]]
    glitch_cost: float
    noise_cost: float
    _request: float
    _unasked: list[list[float]]
    _answers_only: bool
    _certain: bytes
    _units: list[float]
    _unanswered: float
    _octet_cost: list[int]
    _scored: dict[tuple[int, int], list[tuple[float, Survivor]]]
    _waiting: list[Candidate]
    _candidates: list[Candidate]
    _before: Conversation
    framed: bool
    _opened: dict[PathStep, tuple[Conversation, tuple[OpenRequest, ...]]]
    position: int
    _landings: list[int]
    _survivors: list[list[Survivor]]

    def __init__(
        self, offset: int, statistics: GapStatistics, conversation: Conversation, position: int = 0, *, framed: bool
    ) -> None:
        """`position`, of bytes that begin at `offset` in the stream, is a boundary up to which all is decided.

        `framed`: a frame ends there.
        """
        self._data = b""
        self.offset = offset
        self._silences = ()
        self._gap_bits = statistics.bits_by_turn
        self.glitch_cost = statistics.glitch_cost
        self.noise_cost = statistics.noise_cost
        self._request = statistics.request_bits
        self._unasked = statistics.unasked.tolist()
        self._answers_only = statistics.answers_only
        self._certain = length_tables().certain.tobytes()
        self._units = statistics.unit_bits
        self._unanswered = statistics.unanswered_bits + HALF
        self._octet_cost = [0]
        self._scored = {}  # `_at`, by position and landing
        self._waiting = []  # by end, the next one last
        self._candidates = []  # by end: those that paths have been grown by
        self.restart(position, conversation, framed=framed)

    @property
    def ends(self) -> set[int]:
        """Where candidates end that are yet to come."""
        return {candidate.end for candidate in self._waiting}

    def extend(self, data: bytes, silences: Sequence[int]) -> None:
        """More bytes: `data` is all of them, those before the same."""
        more = data[len(self._data) :].translate(_OCTET_COSTS)
        self._octet_cost += list(accumulate(more, initial=self._octet_cost.pop()))
        self._data, self._silences = data, silences
        self._scored.clear()

    def add(self, candidates: Iterable[Candidate]) -> None:
        """Candidates that end behind the position advanced to."""
        self._waiting += candidates
        self._waiting.sort(key=by_end, reverse=True)

    def restart(self, position: int, conversation: Conversation, *, framed: bool) -> None:
        """What is before a position is decided; `conversation` is that up to there; `framed`: a frame ends there."""
        self._before, self.framed = conversation, framed
        self._opened = {}  # `open_after` of frames
        self.position = position
        self._landings = [position]
        self._scored.clear()
        self._survivors = [[Survivor(0.0, None, position, conversation)]]

    def rewind(self, position: int) -> None:
        """Back to a position, with nothing yet to come behind it."""
        kept = bisect_right(self._landings, position)
        del self._landings[kept:], self._survivors[kept:]
        del self._candidates[bisect_right(self._candidates, position, key=candidate_end) :]
        self._waiting.clear()
        self._scored.clear()
        self.position = position

    def advance(self, position: int) -> None:
        """Extend all paths to `position`, by candidates that end at or before it."""
        waiting = self._waiting
        while waiting and waiting[-1].end <= position:
            end = waiting[-1].end
            landed: list[tuple[float, Survivor]] = []
            while waiting and waiting[-1].end == end:
                candidate = waiting.pop()
                self._candidates.append(candidate)
                if candidate.start >= self._landings[0]:
                    landed += [(path.score, path) for path in self._taken(candidate)]
            if landed:
                self._survivors.append(pruned(landed + self._at(end), end))
                self._landings.append(end)
        self.position = max(self.position, position)

    def _at(self, position: int) -> list[tuple[float, Survivor]]:
        """Survivors at a position with their scores there."""
        before = bisect_right(self._landings, position) - 1
        found = self._scored.get((position, before))
        if found is None:
            found = [(self._score(path, position), path) for path in self._survivors[before]]
            self._scored[position, before] = found
        return found

    def _score(self, path: Survivor, position: int) -> float:
        """The score of a path with the noise behind it."""
        begin = path.end
        if begin == position:
            return path.score
        cost = self.glitch_cost + (self._octet_cost[position] - self._octet_cost[begin]) / _COST_STEPS
        if self._glitch(begin, position):
            return path.score - cost
        cost += max(0.0, self.noise_cost - self.glitch_cost)
        if (self.framed or path.tip is not None) and position - begin >= LOST:
            suspicion = min(row[self._silences[begin]] for row in self._gap_bits)
            cost -= max(-4.0, min(0.0, 0.5 * suspicion))
        return path.score - cost

    def _glitch(self, begin: int, end: int) -> bool:
        """Whether these bytes are what a switching driver leaves."""
        return end - begin <= GLITCH_RUN and not self._data[begin:end].translate(None, _GLITCHES)

    def _own_bits(self, candidate: Candidate) -> tuple[float, float]:
        """What a candidate's bytes tell by themselves, and the least that its silence and conversation may: those of
        a frame that checks, of a known function, tell little against it."""
        if candidate.damaged:
            return candidate.structure, -inf
        if candidate.doubtful:
            return candidate.structure + CRC_BITS, -inf
        known = candidate.role == Role.REQUEST or self._certain[self._data[candidate.start + 1] & 0x7F]
        gain = candidate.structure + (CRC_BITS + self._inside(candidate))
        return gain, AGAINST_FRAME if candidate.declared and known else -inf

    def _taken(self, candidate: Candidate) -> Iterator[Survivor]:
        """From each survivor at its start, the path on which this candidate is a frame."""
        start, end, damaged = candidate.start, candidate.end, candidate.damaged
        adu = self._data[start:end]
        gain, least = self._own_bits(candidate)
        request = OpenRequest.of(self.offset + start, adu) if candidate.role == Role.REQUEST else None
        for score, path in self._at(start):
            before, conversation, noise = path.tip, path.conversation, path.end < start
            glitch = noise and self._glitch(path.end, start)
            waiting = request is not None and not conversation.answered and bool(conversation.open_requests)
            # (a silence is before the glitch, if any is)
            gap = max(self._silences[path.end : start + 1]) if glitch else self._silences[start]
            silence = self._gap_bits[SpeakerTurn.AGAIN if waiting else candidate.role][gap]
            unheard = not glitch and start - path.end >= LOST
            lost = unheard if noise else before is not None and before.damaged_request
            if request is not None:
                bits, conversation = self._asks(conversation, request, damaged=damaged, lost=lost)
            else:
                bits, conversation = self._answers(conversation, candidate, adu, lost=lost)
            worth = gain + max(silence + bits, least)
            since = 0.0 if damaged else worth if noise else path.since_noise + worth
            if noise:
                before = PathStep(path.end, start, None, before, score, path.conversation)
                score += 0.0 if glitch or start - path.end < LOST else AFTER_NOISE
            tip = PathStep(start, end, candidate, before, score + worth, conversation, silence, bits, path.losers)
            yield Survivor(score + worth, tip, end, conversation, path.noisy or damaged or noise, since)

    def _asks(
        self, conversation: Conversation, request: OpenRequest, *, damaged: bool, lost: bool
    ) -> tuple[float, Conversation]:
        """What the conversation makes of a request, in bits, and the conversation after it.

        `lost`: there was noise before it, which may have been a request, or an answer.
        """
        adu = request.adu
        unit = self._units[adu[0]]
        if damaged:
            return unit, conversation  # nobody will answer it
        # All bytes of the last request again are no chance. But if that was answered, and noise behind it may have
        # been another, nobody knows which was the last: what stands in that noise would speak against itself.
        if adu == conversation.last and not (self._request or (lost and conversation.answered)):
            same = min(FITS, 8.0 * (len(adu) - 2) - KNOWN)
            bits = same + (REPEATED if conversation.answered else self._unanswered)
        elif conversation.answered:
            bits = unit
        else:
            bits = unit + (ANSWERED_IN_NOISE if lost else self._unanswered)
        return bits + self._request, conversation.ask(request)

    def _answers(
        self, conversation: Conversation, candidate: Candidate, adu: bytes, *, lost: bool
    ) -> tuple[float, Conversation]:
        """The same of a response."""
        which = conversation.answers(adu)
        newest = which == len(conversation.open_requests) - 1 and not conversation.answered
        if candidate.damaged and not newest:
            return IMPOSSIBLE, conversation
        stray = self._unasked_for(conversation, adu, self._silences[candidate.start], lost=lost)
        if which is None:
            return stray, conversation
        asked = conversation.open_requests[which]
        if candidate.declared and candidate.doubtful:  # a header as it should be speaks against what contradicts it
            bits = MISMATCH
        else:
            bits = FITS_EXCEPTION if adu[1] & EXCEPTION else FITS if asked.expects.marks else FITS_BARE
        bits += LATE_BYTE * (self.offset + candidate.start - asked.start - len(asked.adu)) + (0.0 if newest else LATE)
        return (bits, conversation.answer(which)) if bits >= stray else (stray, conversation)

    def _unasked_for(self, conversation: Conversation, adu: bytes, silence: int, *, lost: bool) -> float:
        """The same of a response to no request that is known; `silence`: the class of that before it."""
        certain = self._certain[adu[1] & 0x7F]
        if conversation.waits_for(adu) and certain:
            return MISMATCH
        unasked = self._unasked[certain][silence]
        if lost:
            unasked = max(ASKED_IN_NOISE, unasked)
        elif not (conversation.answered or self._answers_only):
            unasked = CONTRARY
        return unasked + self._units[adu[0]]

    def _inside(self, outer: Candidate) -> float:
        """What the candidates inside one would score at best by themselves, less the price of being there."""
        ends, best = [outer.start], [0.0]  # best[i]: score of those that end at or before ends[i]
        for candidate in self._candidates[bisect_right(self._candidates, outer.start, key=candidate_end) :]:
            if candidate.end >= outer.end:
                break
            if candidate.start <= outer.start or candidate.damaged or candidate.doubtful:
                continue
            before = best[bisect_right(ends, candidate.start) - 1]
            score = before + max(0.0, CRC_BITS + candidate.structure - EMBEDDED)
            if score > best[-1]:
                ends.append(candidate.end)
                best.append(score)
        return best[-1]

    @property
    def best(self) -> Survivor:
        """The best path to the position advanced to."""
        return max(self._at(self.position), key=path_score)[1]

    def gap_bits(self, position: int) -> float:
        """Bits that the silence there gives to an answer's start."""
        return self._gap_bits[SpeakerTurn.RESPONSE][self._silences[position]]

    def before(self, step: PathStep) -> tuple[float, Conversation]:
        """The score of a path before one of its steps, and the conversation there."""
        return (0.0, self._before) if step.before is None else (step.before.score, step.before.conversation)

    def bits_of_start(self, start: int, role: int, conversation: Conversation) -> float:
        """What silence and conversation say of a legal frame that begins there and was not asked for."""
        unit, certain = self._data[start], self._certain[self._data[start + 1] & 0x7F]
        waiting = not conversation.answered and bool(conversation.open_requests)
        if role == Role.REQUEST:
            turn, bits = (SpeakerTurn.AGAIN, self._unanswered) if waiting else (SpeakerTurn.REQUEST, 0.0)
            bits += self._request
        else:
            contrary = waiting and not self._answers_only
            turn, bits = SpeakerTurn.RESPONSE, CONTRARY if contrary else self._unasked[certain][self._silences[start]]
        return max(self._units[unit] + bits + self._gap_bits[turn][self._silences[start]], AGAINST_FRAME)

    @property
    def lead(self) -> float:
        """By how much the best path leads the next one, bits."""
        scores = sorted((score for score, _ in self._at(self.position)), reverse=True)
        return scores[0] - scores[1] if len(scores) > 1 else inf

    def rivals(self) -> Losers:
        """The paths that the best one beats here: by how many bits, and their last steps."""
        paths = self._at(self.position)
        best_score, best = max(paths, key=path_score)
        return best.losers + tuple((best_score - score, path.tip) for score, path in paths if path is not best)

    def open_after(self, frames: Sequence[PathStep]) -> tuple[OpenRequest, ...]:
        """The requests that no whole frame among these, all of a path, has answered; a damaged answer may be none."""
        conversation: Conversation = self._before
        again: tuple[OpenRequest, ...] = ()
        known = len(frames)
        while known and frames[known - 1] not in self._opened:
            known -= 1
        if known:
            conversation, again = self._opened[frames[known - 1]]
        for step in frames[known:]:
            adu = self._data[step.start : step.end]
            if step.candidate is not None and step.candidate.role == Role.REQUEST:
                # a request that seems to come once more may be the beginning of its answer
                again = tuple(p for p in conversation.open_requests if p.adu == adu)
                conversation = conversation.ask(OpenRequest.of(self.offset + step.start, adu))
            elif (which := conversation.answers(adu)) is not None:
                conversation = conversation.answer(which)
            self._opened[step] = conversation, again
        return (*conversation.open_requests, *again)

    def steps(self) -> list[PathStep]:
        """The best path to here, step by step from where it begins."""
        score, path = max(self._at(self.position), key=path_score)
        tip = path.tip
        if path.end < self.position:
            tip = PathStep(path.end, self.position, None, tip, score, path.conversation)
        steps = []
        while tip is not None:
            steps.append(tip)
            tip = tip.before
        return steps[::-1]
