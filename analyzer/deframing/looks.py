"""A look at a stretch that is not decided: its points, in stream order, what is known up to the newest, what may come.

What a silence tells grows with it: at a point there is first the gap, then a quiet line, then one so long that it ends
all. These stages are gone through in order, on a file as live, where a clock ticks through them. Before a decision a
frame that has begun may explain the end of the stretch better than what is there: the beginning of a long frame may
check by chance, or hold what does.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import zip_longest
from typing import Final

from dissectors.length_rules import Role
from dissectors.lengths import plausibility
from dissectors.limits import MAX_ADU

from .candidates import CRC_BITS, KNOWN_BITS, predicted_length
from .conversation import Candidate, Conversation, PathStep
from .lattice import EMBEDDED, FITS, NOISE_BYTE, Lattice
from .rules import length_tables
from .unpredicted import next_byte

GAP, IDLE, CUT = 0, 1, 2  # stages of a silence
STAGES: Final = 3
NEVER: Final = 1 << 62
_LOOKED: Final = 5  # times the bytes up to a point that looks at everything may have gone over, those there included
_LOOKED_FREELY: Final = 768  # and so many bytes besides


@dataclass(frozen=True, slots=True)
class DecisionPoint:
    """A position at which to look, and what the silence there is."""

    position: int
    stages: int = 1  # how many it goes through: 2 when the line was quiet, 3 when no frame spans it
    silent: bool = False  # some gap
    plausible: bool = True  # that gap, or the lack of one, does not speak against a frame's end
    parted: bool = False  # a gap that may part frames, or a window's end


@dataclass(slots=True)
class LaidPaths:
    """A lattice of all candidates up to a point, of which what comes leaves most as it is."""

    lattice: Lattice
    candidates: list[Candidate]  # by end
    position: int  # of the point
    pointed: int  # silences up to here are known

    def gone_on(self, candidates: list[Candidate]) -> Lattice:
        """The same lattice with these candidates (by end), back where they begin to differ from those that it had."""
        same = min(self.position - 1, self.pointed)
        for mine, other in zip_longest(self.candidates, candidates):
            if mine != other:
                same = min([same, *(one.end - 1 for one in (mine, other) if one is not None)])
                break
        self.lattice.rewind(same)
        self.lattice.add(candidates[bisect_right(candidates, same, key=_end_of_candidate) :])
        return self.lattice


@dataclass(slots=True)
class OpenLook:
    """What is known from one undecided position on; offsets are from where the look began.

    `origin` is the first byte that is not decided. A look is kept while nothing is decided there and more bytes come.
    """

    offset: int  # in the stream, of where it began
    conversation: Conversation  # up to the origin
    lattice: Lattice  # of declared candidates
    framed: bool  # a frame ends at the origin
    origin: int = 0
    data: bytes = b""
    classes: bytearray = field(default_factory=bytearray)  # of the silences before them
    candidates: list[Candidate] = field(default_factory=list)  # declared ones
    points: list[DecisionPoint] = field(default_factory=list)
    pointed: int = 0  # the position up to which there are points
    first_ends: dict[int, int] = field(default_factory=dict)  # of the candidates that begin at a position
    position: int = 0  # the newest one looked at, and how many stages of it
    stages: int = 0
    work: int = 0  # bytes that looks at everything have gone over, and as many for what crowds there
    affordable: bool = True  # to look at everything at that position
    paid: bool = False  # and that is counted
    everything: Lattice | None = None  # of all candidates up to that position
    laid: LaidPaths | None = None  # what `everything` was last

    def next_point(self, limit: int) -> DecisionPoint | None:
        """The first point up to `limit` that was not looked at in all its stages."""
        first = bisect_left(self.points, self.position, key=_position)
        for point in self.points[first : first + 2]:
            if point.position <= limit and (point.position > self.position or point.stages > self.stages):
                return point
        return None

    def move(self, point: DecisionPoint) -> range:
        """Go to a point: the stages that were not looked at."""
        first = self.stages if point.position == self.position else GAP
        if first == GAP:
            size = point.position - self.origin
            self.affordable = point.parted and self.work + size <= _LOOKED * size + _LOOKED_FREELY
            self.everything, self.paid = None, False
        self.position, self.stages = point.position, max(first, point.stages)
        return range(first, point.stages)

    def go_on(self, position: int, conversation: Conversation) -> None:
        """All before a position, where a frame ends, is decided."""
        self.origin = self.position = position
        self.conversation, self.stages, self.work = conversation, STAGES, 0  # no byte is left to be looked at there
        self.framed = True
        self.lattice.restart(position, conversation, framed=True)
        self.laid = None


def _end_of_candidate(candidate: Candidate) -> int:
    return candidate.end


def _position(point: DecisionPoint) -> int:
    return point.position


_HEADERS: Final = 8  # beginnings of an awaited answer that are gone through
_ODD: Final = 8  # steps whose beginnings are looked at, the newest


def answer_may_come(
    data: bytes, frames: Sequence[PathStep], steps: Sequence[PathStep], lattice: Lattice, idle_bits: float
) -> bool:
    """Whether an answer that a request asked for has begun in `data`.

    `frames` are those of `steps`, the best path of the lattice; `idle_bits`: what a quiet line says against more.
    """
    best, position = frames[-1].score, len(data)
    for request in lattice.open_after(frames):
        header = request.expects.header
        if len(header) < 2:
            continue
        start = data.find(
            header, max(steps[0].start, request.start + len(request.adu) - lattice.offset, position - MAX_ADU)
        )
        for _ in range(_HEADERS):
            if start < 0:
                break
            length = predicted_length(data, start, Role.RESPONSE)
            if length is not None and start + length > position:
                before = steps[bisect_right(steps, start, key=_end_of_step)]
                score = before.before.score if before.before is not None else 0.0
                if start > before.start:
                    score -= lattice.noise_cost + NOISE_BYTE * (start - before.start)
                score += CRC_BITS + KNOWN_BITS + FITS + lattice.gap_bits(start) - idle_bits
                if score + _held(frames, start) > best:
                    return True
            start = data.find(header, start + 1)
    return False


def frame_may_come(
    data: bytes,
    frames: Sequence[PathStep],
    steps: Sequence[PathStep],
    lattice: Lattice,
    idle_bits: float,
    only: Role | None,
) -> bool:
    """Whether a legal frame has begun where the best path has noise, or what limits or conversation speak against.

    `only`: the role that frames here have.
    """
    best, position = frames[-1].score, len(data)
    odd = [
        step
        for step in steps
        if position - MAX_ADU < step.start < frames[-1].end
        and (step.candidate is None or step.conversation_bits < 0 or step.candidate.structure < 0)
    ]
    for step in odd[-_ODD:]:
        before, conversation = lattice.before(step)
        for start in {step.start, next_byte(data, step.start)} if step.candidate is None else {step.start}:
            score = before - (lattice.glitch_cost if start > step.start else 0.0)
            score += _held(frames, start) - idle_bits
            for role in Role if only is None else (only,):
                length = predicted_length(data, start, role)
                if length is None or not position < start + length <= start + MAX_ADU:
                    continue
                checks, head = length_tables().checks[256 * role + data[start + 1]], data[start + 1 :]
                if checks is None or plausibility(head, role):
                    continue
                legal = CRC_BITS + KNOWN_BITS + checks.bits + sum(checks.soft_bits)
                if not idle_bits and step.candidate is not None and step.candidate.structure < 0:
                    return True  # what breaks a limit never stands for what breaks none
                if score + legal + lattice.bits_of_start(start, role, conversation) > best:
                    return True
    return False


def _held(frames: Sequence[PathStep], start: int) -> float:
    """What the frames behind a start would tell of one that holds them."""
    told = 0.0
    for frame in reversed(frames):
        if frame.start <= start:
            break
        if frame.candidate is not None:
            told += max(0.0, CRC_BITS + frame.candidate.structure - EMBEDDED)
    return told


def _end_of_step(step: PathStep) -> int:
    return step.end
