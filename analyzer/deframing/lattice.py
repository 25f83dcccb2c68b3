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

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from dissectors.answers import Expectation, expectation
from dissectors.lengths import Role

from .candidates import CRC_BITS, GLITCHES
from .silence import Trust, Turn

NOISE_BEGINS = 9.0
NOISE_BYTE = 77 / 64
GLITCH_BYTE = 39 / 64
GLITCH_RUN = 6  # bytes
FITS = 21.0  # an answer of the right unit, function and count: what its header proves beyond its structure
FITS_BARE = 13.0  # an answer of which only unit and function are known
FITS_EXCEPTION = 8.0
LATE = -8.0  # it answers an older request
LATE_BYTE = -1.0 / 16  # for each byte that has passed since: late answers come soon or never
UNASKED = -14.0  # nothing was pending
ANSWERED_IN_NOISE = -1.0
ASKED_IN_NOISE = -9.0  # nothing was, but what was noise may have been the request
CONTRARY = -24.0  # something else was pending
HALF = 1.0  # of the requests that nobody answers, half are asked again, half are given up
REPEATED = -5.0  # a request that was just answered, once more
KNOWN = 3.0  # bits of a function that its structure counts already
IMPOSSIBLE = -1000.0
EMBEDDED = 3.0  # a whole frame inside a payload
AFTER_NOISE = -2.0
LEAD = 8.0  # bits over the next best reading of the same bytes that a decision needs
SURE = 64.0  # bits: what cannot be doubted
_GLITCHES = bytes(GLITCHES)
_BEAM = 6
OPEN = 4  # requests that may be open at once
_REACH = 1024  # bytes: requests further back are forgotten


class Candidate(NamedTuple):
    """A place where a frame could stand; offsets in the stretch."""

    start: int
    end: int
    role: int
    structure: float
    declared: bool = True  # its function's length is known; else the window's CRC alone speaks for it
    damaged: bool = False  # its CRC is wrong: only an answer that fits a request is believed to be that


class Pending(NamedTuple):
    """A request that may still be answered."""

    start: int  # offset in the stream of its port
    adu: bytes
    expects: Expectation

    @classmethod
    def of(cls, start: int, adu: bytes) -> Pending:
        return cls(start, adu, expectation(adu))


class Said(NamedTuple):
    """The conversation so far: outstanding requests, the newest last, and whether the newest was answered."""

    pending: tuple[Pending, ...] = ()
    answered: bool = True
    last: bytes = b""  # the newest request

    def ask(self, request: Pending) -> Said:
        """After a request. A broadcast is never answered, but some devices do."""
        return Said((*self._near(request.start, request.adu), request), request.adu[0] == 0, request.adu)

    def exchanged(self, start: int, adu: bytes) -> Said:
        """After a request and, right behind it, its answer."""
        return Said(self._near(start, adu), True, adu)

    def _near(self, start: int, adu: bytes) -> tuple[Pending, ...]:
        """What stays outstanding when another request begins at `start`; asked once more, it is open once."""
        return tuple(p for p in self.pending[1 - OPEN :] if p.start >= start - _REACH and p.adu != adu)

    def answers(self, adu: bytes) -> int | None:
        """Which pending request a response answers: the newest that fits."""
        for i in range(len(self.pending) - 1, -1, -1):
            if self.pending[i].expects.fits(adu):
                return i
        return None

    def answer(self, which: int) -> Said:
        """After an answer to pending[which]; older ones stay outstanding for a while."""
        newest = which == len(self.pending) - 1
        return Said(self.pending[:which] + self.pending[which + 1 :], self.answered or newest, self.last)


@dataclass(slots=True, eq=False)
class Step:
    """A piece of a path: a frame or a run of noise, and the path before it."""

    start: int
    end: int
    candidate: Candidate | None
    before: Step | None
    score: float  # of the path up to its end
    said: Said  # the conversation after it
    silence: float = 0.0
    conversation: float = 0.0
    losers: Sequence[tuple[float, Step | None]] = ()  # paths that it beat to its start

    @property
    def damaged_request(self) -> bool:
        return self.candidate is not None and self.candidate.damaged and self.candidate.role == Role.REQUEST


@dataclass(slots=True)
class Path:
    """A survivor: a score, its last step, and the conversation after it."""

    score: float
    tip: Step | None
    said: Said
    noise_from: int  # where the run of noise that it is in began, or -1
    noisy: bool = False  # it holds noise, or a damaged frame
    glitch: bool = False  # that run is of glitch bytes alone, so far
    since_noise: float = 0.0  # what its frames since the last noise have scored
    losers: list[tuple[float, Step | None]] = field(default_factory=list)  # paths beaten here, and by how much


class Lattice:
    """Grows paths over `data` from position 0, which is known to be a boundary.

    `silences` are gap classes a byte; `trust` says what they are worth on this tap.
    """

    def __init__(
        self,
        data: bytes,
        offset: int,
        silences: Sequence[int],
        trust: Trust,
        candidates: Sequence[Candidate],
        said: Said,
    ) -> None:
        self._data = data
        self.offset = offset
        self._silences = silences
        self._trust = trust.evidence
        self._glitch_cost = trust.glitch_cost
        self._units = trust.unit_bits
        self._unanswered = trust.unanswered_bits + HALF
        self._before = said
        self._waiting = list(reversed(candidates))
        self._all = candidates
        self._starts = [c.start for c in candidates]
        self._flight: dict[int, list[Path]] = {}
        self.position = 0
        self.paths = [Path(0.0, None, said, -1)]

    def advance(self, position: int) -> None:
        """Extend all paths to `position`, by candidates that end at or before it."""
        while self.position < position:
            ends = min((e for e in self._flight if e <= position), default=position)
            start = self._waiting[-1].start if self._waiting else position
            if start <= self.position:
                self._take(self._waiting.pop())
                continue
            self._move(min(ends, start, position))

    def restart(self, said: Said) -> None:
        """What is before the position advanced to is decided; `said` is the conversation up to there."""
        self._flight.clear()
        self._before = said
        self.paths = [Path(0.0, None, said, -1)]

    def _move(self, position: int) -> None:
        """Let survivors run on as noise to `position`; let the frames that end there join them."""
        steps = self._data[self.position : position]
        noise = len(steps.translate(None, _GLITCHES))
        cost = GLITCH_BYTE * (len(steps) - noise) + NOISE_BYTE * noise
        glitch = not noise
        for path in self.paths:
            if path.noise_from < 0:
                path.noise_from = self.position
                path.glitch = True
                path.score -= self._glitch_cost
            if path.glitch and not (glitch and position - path.noise_from <= GLITCH_RUN):
                path.glitch = False
                path.score -= max(0.0, NOISE_BEGINS - self._glitch_cost)
                if path.tip is not None:
                    suspicion = min(row[self._silences[path.noise_from]] for row in self._trust)
                    path.score += max(-4.0, min(0.0, 0.5 * suspicion))
            path.score -= cost
        self.position = position
        landed = self._flight.pop(position, [])
        if landed:
            self._prune(landed + self.paths)

    def _prune(self, paths: list[Path]) -> None:
        paths.sort(key=_score, reverse=True)
        least = paths[0].score - SURE
        kept: dict[object, Path] = {}
        for path in paths:
            if path.score < least:
                break  # nothing will bring it back
            said, last = path.said, path.tip and path.tip.candidate
            key = (
                path.noise_from < 0,
                last.role if last else -1,
                tuple([p.start for p in said.pending]),
                said.answered,
            )
            rival = kept.get(key)
            if rival is None and len(kept) < _BEAM:
                kept[key] = path
            else:
                winner = rival or paths[0]
                if path.tip is not winner.tip:
                    winner.losers.append((winner.score - path.score, path.tip))
        self.paths = list(kept.values())

    def _take(self, candidate: Candidate) -> None:
        """Branch: from each survivor, the path on which this candidate is a frame."""
        start, end, damaged = candidate.start, candidate.end, candidate.damaged
        if start < self.position:
            return
        adu = self._data[start:end]
        gain = (0.0 if damaged else CRC_BITS + self._inside(candidate)) + candidate.structure
        request = Pending.of(self.offset + start, adu) if candidate.role == Role.REQUEST else None
        landing = self._flight.setdefault(end, [])
        for path in self.paths:
            before, said, noise_from = path.tip, path.said, path.noise_from
            waiting = request is not None and not said.answered and bool(said.pending)
            # (a silence is before the glitch, if any is)
            gap = max(self._silences[noise_from : start + 1]) if path.glitch else self._silences[start]
            silence = self._trust[Turn.AGAIN if waiting else candidate.role][gap]
            if noise_from >= 0:
                lost = not path.glitch and start - noise_from >= 4
            else:
                lost = before is not None and before.damaged_request
            if request is not None:
                bits, said = self._asks(said, request, damaged=damaged, lost=lost)
            else:
                bits, said = self._answers(said, adu, start, damaged=damaged, lost=lost)
            score = path.score + gain + silence + bits
            since = 0.0 if damaged else path.since_noise + gain + silence + bits
            if noise_from >= 0:
                score += 0.0 if path.glitch else AFTER_NOISE
                since = 0.0 if damaged else gain + silence + bits
                before = Step(noise_from, start, None, before, path.score, path.said)
            tip = Step(start, end, candidate, before, score, said, silence, bits, tuple(path.losers))
            landing.append(Path(score, tip, said, -1, path.noisy or damaged or noise_from >= 0, False, since))

    def _asks(self, said: Said, request: Pending, *, damaged: bool, lost: bool) -> tuple[float, Said]:
        """What the conversation makes of a request, in bits, and the conversation after it.

        `lost`: there was noise before it, which may have been a request, or an answer.
        """
        adu = request.adu
        unit = self._units[adu[0]]
        if damaged:
            return unit, said  # nobody will answer it
        if said.last == adu:  # its very bytes, as many as they are: not by chance
            same = min(FITS, 8.0 * (len(adu) - 2) - KNOWN)
            bits = same + (REPEATED if said.answered else self._unanswered)
        elif said.answered:
            bits = unit
        else:
            bits = unit + (ANSWERED_IN_NOISE if lost else self._unanswered)
        return bits, said.ask(request)

    def _answers(self, said: Said, adu: bytes, start: int, *, damaged: bool, lost: bool) -> tuple[float, Said]:
        """The same of a response, which begins at `start`."""
        which = said.answers(adu)
        newest = which == len(said.pending) - 1 and not said.answered
        if damaged and not newest:
            return IMPOSSIBLE, said
        if which is None:
            unit = self._units[adu[0]]
            if lost:
                return ASKED_IN_NOISE + unit, said
            return (UNASKED if said.answered else CONTRARY) + unit, said
        asked = said.pending[which]
        bits = FITS_EXCEPTION if adu[1] & 0x80 else FITS if asked.expects.marks else FITS_BARE
        if not newest:
            bits += LATE + LATE_BYTE * (self.offset + start - asked.start - len(asked.adu))
        return bits, said.answer(which)

    def _inside(self, outer: Candidate) -> float:
        """What the candidates inside one would score at best by themselves, less the price of being there."""
        first = bisect_right(self._starts, outer.start)
        last = bisect_left(self._starts, outer.end)
        if first == last:
            return 0.0
        inner = [c for c in self._all[first:last] if c.end < outer.end and not c.damaged]
        ends, best = [0], [0.0]  # best[i]: score of those that end at or before ends[i]
        for candidate in sorted(inner, key=_end):
            before = best[bisect_right(ends, candidate.start) - 1]
            score = before + max(0.0, CRC_BITS + candidate.structure - EMBEDDED)
            if score > best[-1]:
                ends.append(candidate.end)
                best.append(score)
        return best[-1]

    @property
    def best(self) -> Path:
        """The best path to the position advanced to."""
        return max(self.paths, key=_score)

    def silence(self, position: int) -> float:
        """Bits that the silence there gives to an answer's start."""
        return self._trust[Turn.RESPONSE][self._silences[position]]

    @property
    def lead(self) -> float:
        """By how much the best path leads the next one, bits."""
        scores = sorted((p.score for p in self.paths), reverse=True)
        return scores[0] - scores[1] if len(scores) > 1 else float("inf")

    def rivals(self) -> list[tuple[float, Step | None]]:
        """The paths that the best one beats here: by how many bits, and their last steps."""
        best = self.best
        return best.losers + [(best.score - p.score, p.tip) for p in self.paths if p is not best]

    def open_after(self, frames: Sequence[Step]) -> tuple[Pending, ...]:
        """The requests that no whole frame among these has answered; a damaged answer may turn out to be none."""
        said = self._before
        for step in frames:
            adu = self._data[step.start : step.end]
            if step.candidate is not None and step.candidate.role == Role.REQUEST:
                said = said.ask(Pending.of(self.offset + step.start, adu))
            elif (which := said.answers(adu)) is not None:
                said = said.answer(which)
        return said.pending

    def steps(self) -> list[Step]:
        """The best path to here, piece by piece from position 0."""
        path = self.best
        tip = path.tip
        if path.noise_from >= 0:
            tip = Step(path.noise_from, self.position, None, tip, path.score, path.said)
        found = []
        while tip is not None:
            found.append(tip)
            tip = tip.before
        return found[::-1]


def _end(candidate: Candidate) -> int:
    return candidate.end


def _score(path: Path) -> float:
    return path.score
