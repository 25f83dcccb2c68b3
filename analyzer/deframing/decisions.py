"""What is decided of a stretch where candidates compete: when is enough known, and how far does a decision reach?

Positions where something could be decided are decision points: the end of a candidate, a quiet line (idle timeout), a
silence that ends every frame, the window being full. They are taken in stream order, and what is decided at one hangs
on the bytes before it and the silence there alone, so a stream fed byte by byte and a whole file come to the same
decisions at the same offsets.

At each point declared candidates compete alone first, in a lattice that grows as bytes come. Everything else that a
stretch may hold (functions of unknown length, frames made wrong, frames that came damaged) is looked for only where
those leave noise and the line falls silent, or a window is full: the price of such a look is that of all bytes up to
the point, so few are made (`OpenLook.move`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from dissectors.length_rules import Role
from dissectors.limits import MAX_ADU

from ..options import Options
from .broken import broken_windows, damaged_answers, damaged_requests, silent_windows
from .buffer import ByteBuffer
from .certainty import UNDECIDED, Decision, evidence_of_steps, margins
from .conversation import SURE, Conversation, PathStep, by_end
from .forced import ForcedRuns, SearchedBytes
from .gaps import AGAINST, MAY_PART, GapStatistics, SpeakerTurn, classes_of, next_checkpoint, silence_positions
from .lattice import LEAD, Lattice
from .looks import CUT, GAP, IDLE, NEVER, DecisionPoint, LaidPaths, OpenLook, answer_may_come, frame_may_come
from .rules import possible_starts
from .segments import NOISE, DecidedSegments
from .unpredicted import possible_edges, unknown_windows

WINDOWS: Final = (96, 384, 2048)  # bytes looked at: mostly a few frames do; the last at most waits for a decision
_ALONE: Final = 15.0  # bits that frames end to end with silence behind them need
_AMID: Final = 48.0  # bits that frames need after noise, or with more bytes right behind them
_SPARSE: Final = 4  # bytes a candidate, on a line of short frames
_DEAR: Final = 12  # bytes that each further one costs


class Decider:
    """Decides what the engine cannot take as it stands. The buffer and the gap statistics are the engine's."""

    _buffer: ByteBuffer
    _statistics: GapStatistics
    _options: Options
    _role: Role | None
    _idle_class: int
    _look: OpenLook | None
    heard: set[int]

    def __init__(self, buffer: ByteBuffer, statistics: GapStatistics, options: Options, role: Role | None) -> None:
        """`role`: the only one that frames of this port have, where that is known."""
        self._buffer, self._statistics, self._options, self._role = buffer, statistics, options, role
        self._idle_class = int(classes_of(np.array([options.idle_ns]), buffer.char_ns)[0])
        self._look = None
        self.heard = set()  # functions that nobody has declared and this bus has used

    def decide(
        self,
        stretch: SearchedBytes,
        runs: ForcedRuns,
        at: int,
        conversation: Conversation,
        stages: int,
        *,
        framed: bool,
    ) -> list[Decision]:
        """What is certain from `at` on, one decision after the other; none if more must be known.

        `conversation`: up to there; `stages`: those that the silence behind the stretch has come to; `framed`: a frame
        ends at `at`.
        """
        offset = self._buffer.base + stretch.begin + at
        look, self._look = self._look, None
        if look is None or look.offset != offset:
            lattice = Lattice(offset, self._statistics, conversation, framed=framed)
            look = OpenLook(offset, conversation, lattice, framed)
        settled = next_checkpoint(offset) - offset  # silences are worth the same up to here
        decisions: list[Decision] = []
        while (decision := self._next(look, stretch, at, stages)).steps:
            decisions.append(decision)
            self._hear(look, decision)
            end = decision.steps[-1].end
            if not decision.only_frames or end >= settled or runs.plain(at + end):
                return decisions
            look.go_on(end, decision.steps[-1].conversation)
        if not decisions:
            self._look = look
        return decisions

    def _hear(self, look: OpenLook, decision: Decision) -> None:
        """Remember the functions of undeclared length of a decision: the next one knows them."""
        for step in decision.steps:
            if step.candidate is not None and not step.candidate.declared:
                self.heard.add(look.data[step.start + 1] & 0x7F)

    def _next(self, look: OpenLook, stretch: SearchedBytes, at: int, stages: int) -> Decision:
        """What is certain next."""
        size = len(stretch.data) - at
        while True:
            window = next(look.origin + window for window in WINDOWS if look.origin + window > look.position)
            self._extend(look, stretch, at, min(size, window))
            point = look.next_point(min(size, window))
            if point is None and window > size:
                break
            if point is None:
                point = DecisionPoint(window, plausible=False, parted=True)
            elif point.position == window:
                point = replace(point, parted=True)
            decision = self._decision(look, stretch, at, point)
            if decision.steps:
                return decision
        if stages and (size > look.position or stages > look.stages):
            return self._decision(look, stretch, at, DecisionPoint(size, stages, silent=True, parted=True))
        return UNDECIDED

    def _extend(self, look: OpenLook, stretch: SearchedBytes, at: int, limit: int) -> None:
        """Let a look know the first `limit` bytes, at least, and the points there of which the silence is known."""
        buffer, begin, known = self._buffer, stretch.begin + at, len(look.data)
        size = len(stretch.data) - at
        if limit > known:
            limit = min(size, max(limit, 2 * known))
            look.data = stretch.data[at : at + limit].tobytes()
            new = stretch.candidates_in(at, at + limit, at + known)
            look.candidates += new
            look.lattice.extend(look.data, look.classes)
            look.lattice.add(new)
            for candidate in new:
                look.first_ends[candidate.start] = min(candidate.end, look.first_ends.get(candidate.start, NEVER))
        else:
            limit = known
        last = limit if begin + limit < buffer.classed else limit - 1
        if last > look.pointed or limit > known:
            look.classes[look.pointed :] = buffer.classes[begin + look.pointed : begin + limit + 1].tobytes()
            look.points += self._points(look, begin, look.pointed, last)
            look.pointed = max(look.pointed, last)

    def _points(self, look: OpenLook, begin: int, low: int, high: int) -> list[DecisionPoint]:
        """The points in (low, high] of a look that began at index `begin` of the buffer."""
        buffer, options = self._buffer, self._options
        span, idle, cut = (begin + low, begin + high + 1), set[int](), set[int]()
        if len(buffer.quiet(*span, min(options.idle_ns, options.cut_ns))):
            idle.update((buffer.quiet(*span, options.idle_ns) - begin).tolist())
            cut.update((buffer.quiet(*span, options.cut_ns) - begin).tolist())
        parted = set(silence_positions(look.classes[: high + 1], low + 1, MAY_PART))
        ends = {c.end for c in look.candidates if low < c.end <= high}
        return [
            self._point(look, position, 1 + (position in idle) + (position in cut), position in parted)
            for position in sorted(idle | cut | parted | ends)
        ]

    def _point(self, look: OpenLook, position: int, stages: int = 1, parted: bool = False) -> DecisionPoint:
        silence = look.classes[position]
        return DecisionPoint(
            position, stages, silence > 0 or stages > 1, self._statistics.most[silence] >= AGAINST, parted or stages > 1
        )

    def _decision(self, look: OpenLook, stretch: SearchedBytes, at: int, point: DecisionPoint) -> Decision:
        """What is certain at a point, stage by stage."""
        overdue = point.position == look.origin + WINDOWS[-1]
        for stage in look.move(point):
            tiled = False
            if look.first_ends.get(look.origin, NEVER) <= point.position:  # else there is noise, whatever comes
                look.lattice.advance(point.position)
                decision = self._certain(look, look.lattice, point, stage)
                legal = _breaks_no_limit(decision.steps or look.lattice.steps())
                if decision.only_frames and legal:
                    return decision
                best = look.lattice.best
                tiled = legal and stage == GAP and not best.noisy and best.end == point.position
            if (look.affordable and not tiled) or stage == CUT or overdue:
                decision = self._of_everything(look, stretch, at, point, stage)
                if decision.steps:
                    return decision
        return decide_overdue(self._everything(look, stretch, at, point, GAP), point.position) if overdue else UNDECIDED

    def _of_everything(
        self, look: OpenLook, stretch: SearchedBytes, at: int, point: DecisionPoint, stage: int
    ) -> Decision:
        """What is certain at a stage of a point, or at a place before it, by all candidates that there are."""
        if stage == IDLE:
            look.everything = None  # what stands before the silence now stands between two
        if look.affordable and not look.paid:
            look.work += point.position - look.origin
            look.paid = True
        if look.everything is None:
            lattice = self._everything(look, stretch, at, point, stage)
            tried = lattice.position  # up to there by the look before, in vain
            points = {p.position: p for p in look.points if p.stages > 1}
            for position in sorted({*points, *lattice.ends}):
                if tried < position < point.position:
                    lattice.advance(position)
                    before = points.get(position) or self._point(look, position)
                    decision = self._certain(look, lattice, before, before.stages - 1)
                    if decision.steps:
                        return decision
        else:
            lattice = look.everything
        lattice.advance(point.position)
        return self._certain(look, lattice, point, stage)

    def _everything(self, look: OpenLook, stretch: SearchedBytes, at: int, point: DecisionPoint, stage: int) -> Lattice:
        """A lattice of all candidates up to a stage of a point."""
        if look.everything is not None:
            return look.everything
        origin, end = look.origin, point.position
        data, classes = look.data[origin:end], look.classes[origin:end]
        declared = [
            c._replace(start=c.start - origin, end=c.end - origin)
            for c in look.candidates
            if c.start >= origin and c.end <= end
        ]
        quiet = [p.position - origin for p in look.points if p.stages > 1 and origin < p.position < end]
        quiet += [end - origin] * (point.silent and point.parted)
        first = look.offset + origin == 0
        edges = possible_edges(data, classes, declared, quiet, self._statistics, first=first, over=stage > GAP)
        may = possible_starts(stretch.crc, at + origin, len(data))
        more = unknown_windows(data, stretch.crc, at + origin, edges, declared, self.heard, may)
        asked = look.conversation.open_requests
        more += broken_windows(data, stretch.crc, at + origin, edges, declared + more, asked, may)
        more += silent_windows(data, stretch.crc, at + origin, edges, declared + more)
        more += damaged_requests(data, edges.behind(more), declared)
        more += damaged_answers(data, stretch.crc, at + origin, edges, declared, asked)
        look.work += _DEAR * max(0, len(declared) + len(more) - len(data) // _SPARSE)
        candidates = [c for c in look.candidates if c.start >= origin and c.end <= end]
        candidates += [
            c._replace(start=c.start + origin, end=c.end + origin) for c in more if self._role in (None, c.role)
        ]
        candidates.sort(key=by_end)
        if look.laid is not None and look.laid.position > origin + 1 and look.laid.pointed > origin:
            look.laid.lattice.extend(look.data, look.classes)
            lattice = look.laid.gone_on(candidates)
        else:
            lattice = Lattice(look.offset, self._statistics, look.conversation, origin, framed=look.framed)
            lattice.extend(look.data, look.classes)
            lattice.add(candidates)
        look.everything = lattice
        look.laid = LaidPaths(lattice, candidates, end, look.pointed)
        return lattice

    def _certain(self, look: OpenLook, lattice: Lattice, point: DecisionPoint, stage: int) -> Decision:
        """What a lattice that was advanced to a point makes certain at a stage of it."""
        if stage == CUT:
            return Decision(lattice.steps(), lattice.rivals())
        if stage == GAP and not _enough(lattice, point):
            return UNDECIDED
        steps = lattice.steps()
        frames = [s for s in steps if s.candidate is not None and not s.candidate.damaged]
        if not frames or self._awaited(look, point, stage, frames, steps, lattice):
            return UNDECIDED
        return Decision(steps[: steps.index(frames[-1]) + 1], lattice.rivals())

    def _awaited(
        self,
        look: OpenLook,
        point: DecisionPoint,
        stage: int,
        frames: Sequence[PathStep],
        steps: Sequence[PathStep],
        lattice: Lattice,
    ) -> bool:
        """Whether a longer frame may still come that would explain the end better."""
        statistics, data = self._statistics, look.data[: point.position]
        idle_bits = max(0.0, statistics.bits_by_turn[SpeakerTurn.REQUEST][self._idle_class]) * (stage == IDLE)
        if answer_may_come(data, frames, steps, lattice, idle_bits):
            return True
        if stage == IDLE and statistics.parts[self._idle_class]:
            return False
        return frame_may_come(data, frames, steps, lattice, idle_bits, self._role)

    def segments(self, decisions: Sequence[Decision], stretch: SearchedBytes, at: int) -> DecidedSegments:
        """Steps of decisions end to end, whose offsets are from `at`, in the buffer."""
        origin = stretch.begin + at
        steps = [step for decision in decisions for step in decision.steps]
        found = [margin for decision in decisions for margin in margins(decision)]
        start = np.array([s.start for s in steps], np.intp)
        end = np.array([s.end for s in steps], np.intp)
        role = np.array([s.candidate.role if s.candidate else NOISE for s in steps], np.uint8)
        margin = np.array([min(bits, SURE) for bits, _ in found], np.float32)
        why = evidence_of_steps(steps, found, self._buffer.base + origin) if self._options.explain else None
        check = np.array([s.candidate is not None and not s.candidate.damaged for s in steps], np.bool_)
        rivals = [
            s.candidate is None or stretch.rivalled(at + s.start, at + s.end, at + decision.steps[0].start)
            for decision in decisions
            for s in decision.steps
        ]
        return DecidedSegments(start + origin, end + origin, role, check, margin, np.array(rivals, np.bool_), why)


def _enough(lattice: Lattice, point: DecisionPoint) -> bool:
    """Whether the best path ends in a frame here, and has gathered what a decision needs while the line goes on."""
    if not point.plausible:
        return False
    path, tip = lattice.best, lattice.best.tip
    if path.end < point.position or tip is None or tip.candidate is None or tip.candidate.damaged:
        return False
    if lattice.lead < LEAD:
        return False
    alone = point.silent and not path.noisy
    return path.since_noise >= (_ALONE if alone else _AMID) or (lattice.framed and _goes_on(lattice))


def _breaks_no_limit(steps: Sequence[PathStep]) -> bool:
    """Whether none of these frames, all declared, does what a device's answer that counts wrong may look like."""
    return all(step.candidate is None or step.candidate.structure >= 0 for step in steps)


def _goes_on(lattice: Lattice) -> bool:
    """Whether the best path goes on, from a frame that was decided, with declared frames alone: as well as decided."""
    frames = [step.candidate for step in lattice.steps()]
    return all(one is not None and one.declared and not one.doubtful and not one.damaged for one in frames)


def decide_overdue(lattice: Lattice, position: int) -> Decision:
    """The best path's steps well before `position`: what waited too long is decided as it stands."""
    lattice.advance(position)
    limit = position - 2 * MAX_ADU
    steps = []
    for step in lattice.steps():
        if step.end > limit:
            if step.candidate is None and step.start < limit:
                steps.append(PathStep(step.start, limit, None, step.before, step.score, step.conversation))
            break
        steps.append(step)
    return Decision(steps, lattice.rivals())
