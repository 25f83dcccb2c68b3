"""What is certain of a stretch, by the margin of every step over the best explanation without it; and what it teaches.

Decided segments teach how silences, glitches and turns are on this line, counted into `gaps.GapStatistics`. What is
counted changes nothing before the next checkpoint. So lessons are gathered until then: a live line's reads bring a few
frames each, and a lesson costs the same for one frame as for a hundred.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.length_rules import Role

from ..tables.schema import GLITCHES, BoundaryEvidence, Kind
from .candidates import CRC_BITS
from .conversation import Losers, PathStep
from .gaps import GapStatistics, LearntFrames, SpeakerTurn
from .lattice import GLITCH_RUN, LOST
from .rules import Bytes, length_tables
from .segments import NOISE, DecidedSegments, evidence_rows, join_segments

_KINDS: Final = {Role.REQUEST: Kind.REQUEST, Role.RESPONSE: Kind.RESPONSE, NOISE: Kind.NOISE}


class Decision(NamedTuple):
    """Certain steps from the lattice's first position on, and the paths that theirs beat where they ended."""

    steps: list[PathStep]
    rivals: Losers

    @property
    def only_frames(self) -> bool:
        """Whether something was decided and no byte of it is noise."""
        return bool(self.steps) and all(step.candidate is not None for step in self.steps)


UNDECIDED: Final = Decision([], ())


def margins(decision: Decision) -> list[tuple[float, PathStep | None]]:
    """For each step, by how much its path beat the best path without it, and what that path had there.

    Where two paths met, the winner's steps since they parted are as sure as the difference (soft-output Viterbi).
    """
    steps = decision.steps
    margin: list[tuple[float, PathStep | None]] = [(float("inf"), None)] * len(steps)
    index = {_key(step): i for i, step in enumerate(steps)}
    beaten = [(at, *rival) for at, step in enumerate(steps) for rival in step.losers]
    beaten += [(len(steps), *rival) for rival in decision.rivals]
    for at, difference, loser in beaten:
        shared: set[int] = set()
        parted = 0  # steps before it are those of both
        segments: list[PathStep] = []
        while loser is not None:
            i = index.get(_key(loser))
            if i is None:
                segments.append(loser)
            elif steps[i] is loser:
                parted = i + 1
                break
            else:
                shared.add(i)
            loser = loser.before
        for i in range(parted, at):
            if i not in shared and difference < margin[i][0]:
                mine = steps[i]
                margin[i] = (difference, next((p for p in segments if p.start < mine.end and p.end > mine.start), None))
    return margin


def evidence_of_steps(
    steps: Sequence[PathStep], found: Sequence[tuple[float, PathStep | None]], offset: int
) -> BoundaryEvidence:
    """The evidence of steps (their margins apart) that begin at a stream offset, with what `margins` found."""
    why = evidence_rows(len(steps))
    for i, (step, (_, other)) in enumerate(zip(steps, found, strict=True)):
        why.silence[i], why.conversation[i] = step.gap_bits, step.conversation_bits
        if step.candidate is not None:
            why.length[i] = step.candidate.structure
            why.crc[i] = 0.0 if step.candidate.damaged else CRC_BITS
        if other is not None:
            why.rival_start[i], why.rival_length[i] = offset + other.start, other.end - other.start
            why.rival_kind[i] = _KINDS[other.candidate.role if other.candidate else NOISE]
    return why


def _key(step: PathStep) -> tuple[int, int, int]:
    return step.start, step.end, step.candidate.role if step.candidate else -1


_MANY: Final = 64  # lessons that are kept one by one: as one they take less room


class _Lesson(NamedTuple):
    """Decided segments, positions in their bytes `data`; classes of the silences before these."""

    decided: DecidedSegments
    offset: int  # of the first byte in the stream
    data: Bytes
    classes: NDArray[np.uint8]


class Lessons:
    """Segments, end to end in stream order, that have yet to be learnt from."""

    _statistics: GapStatistics
    _joined: list[_Lesson]
    _newest: list[_Lesson]
    _waited: bool

    def __init__(self, statistics: GapStatistics) -> None:
        self._statistics = statistics
        self._joined = []
        self._newest = []  # behind those
        self._waited = False  # the last frame learnt from is a request that wants an answer

    def add(self, decided: DecidedSegments, offset: int, data: Bytes, classes: NDArray[np.uint8]) -> None:
        """Segments that were decided, positions in `data`, which begins at a stream offset."""
        self._newest.append(_Lesson(decided, offset, data, classes))
        if len(self._newest) >= _MANY:
            self._joined.append(_end_to_end(self._newest))
            self._newest = []

    def learn(self) -> None:
        """Let what there is teach what silences and glitches mean here."""
        lesson = _end_to_end([*self._joined, *self._newest])
        self._joined, self._newest = [], []
        self._learn(lesson.decided, lesson.offset, lesson.data, lesson.classes)

    def _learn(self, decided: DecidedSegments, offset: int, data: Bytes, classes: NDArray[np.uint8]) -> None:
        """`decided`: positions in `data`; `classes` may be written to."""
        start, end, role, check = decided[:4]
        frames = (role != NOISE).nonzero()[0]
        units = data.take(start[frames])
        asks = (role[frames] == Role.REQUEST) & (units != 0)
        waits = np.empty(len(frames), np.bool_)
        waits[:1], waits[1:] = self._waited, asks[:-1]
        turns = role[frames].copy()
        turns[waits & asks & check[frames]] = SpeakerTurn.AGAIN  # what is damaged may be an answer after all
        if len(frames):
            self._waited = bool(asks[-1])
        glitches: list[int] = []
        noises: list[int] = []
        unasked = (role[frames] == Role.RESPONSE) & ~waits
        if len(frames) < len(role):
            noise = (role == NOISE).nonzero()[0]  # a silence before a glitch is that before the frame behind it
            for s, e in zip(start[noise].tolist(), end[noise].tolist(), strict=True):
                short = e - s <= GLITCH_RUN
                glitch = short and GLITCHES.issuperset(data[s:e].tobytes())
                (glitches if glitch else noises).append(e)
                if short and e < len(classes):
                    classes[e] = max(classes[e], classes[s:e].max())
            behind = frames[1:] - 1
            unasked[1:] &= (role[behind] != NOISE) | (end[behind] - start[behind] < LOST)  # else it may have been asked
        certain = length_tables().certain.take(data.take(start[frames] + 1) & 0x7F) & check[frames]
        learnt = LearntFrames(start[frames], end[frames], turns, units, certain, unasked)
        self._statistics.learn(
            classes, learnt, np.array(glitches, np.intp), np.array(noises, np.intp), offset, offset + len(data)
        )


def _end_to_end(lessons: Sequence[_Lesson]) -> _Lesson:
    """Lessons end to end as one, in arrays of its own."""
    first = lessons[0].offset
    shifts = [each.offset - first for each in lessons]
    decided = join_segments(
        [
            each.decided._replace(start=each.decided.start + shift, end=each.decided.end + shift, why=None)
            for each, shift in zip(lessons, shifts, strict=True)
        ]
    )
    data = np.concatenate([each.data for each in lessons])
    return _Lesson(decided, first, data, np.concatenate([each.classes for each in lessons]))
