"""One contested place: which candidates compete there, how far the lattice looks, and what it makes of them.

The rule: declared candidates alone first, in a window that grows only while nothing can be told; everything else that a
stretch may hold (functions of unknown length, frames made wrong, frames that came damaged) is looked for only where
those leave noise. The lattice looks at nothing behind the window, so what is decided never hangs on later bytes.
"""

from __future__ import annotations

import numpy as np

from dissectors.lengths import Role

from .broken import broken_windows
from .contest import (
    WINDOWS,
    Decision,
    Event,
    decide,
    events_in,
    explained,
    forced,
    go_on,
    margins,
    only_frames,
    settled,
)
from .damaged import damaged_answers, damaged_requests
from .lattice import SURE, Candidate, Lattice, Said
from .options import Options
from .pieces import NOISE, Decided
from .places import SILENT, places
from .prefix import opening
from .runs import Runs, Stretch
from .silence import Trust, Turn, classes_of, next_checkpoint
from .tape import Tape
from .unknown import unknown_windows


class Contested:
    """Decides what the engine cannot take as it stands, place by place. The tape and the trust are the engine's."""

    def __init__(self, tape: Tape, trust: Trust, options: Options, role: Role | None) -> None:
        """`role`: the only one that frames of this port have, where that is known."""
        self._tape, self._trust, self._options, self._role = tape, trust, options, role
        self._idle_class = int(classes_of(np.array([options.idle_ns]), tape.char_ns)[0])
        self._stuck = -1, -1  # offsets: what could not be decided, and how far the bytes went then
        self.heard: set[int] = set()  # functions that nobody has declared and this bus has used
        self.looked = 0  # bytes that the last decision has looked at

    def waits(self, stretch: Stretch, at: int) -> bool:
        """Whether nothing has come since the last look at these bytes that could decide anything."""
        origin, known = self._stuck
        tape = self._tape
        if origin != tape.base + stretch.begin + at:
            return False
        begin, upto = known - tape.base, stretch.begin + len(stretch.data)
        return (
            upto - stretch.begin - at < WINDOWS[1]
            and not (stretch.found.end + stretch.begin > begin).any()
            and not (tape.classes[begin:upto] >= SILENT).any()
        )

    def decide(self, stretch: Stretch, runs: Runs, at: int, said: Said, *, quiet: bool, final: bool) -> list[Decision]:
        """What is certain from `at` on, one decision after the other; none if more must be known.

        `said` is the conversation up to there; `quiet`: the line was quiet behind the stretch; `final`: nothing comes.
        """
        n = len(stretch.data)
        known = at + 1 < n and int(stretch.data[at + 1]) in self.heard
        for window in WINDOWS:
            limit = min(n, at + window)
            whole = limit == n
            if not whole and window < WINDOWS[-1] and not known and not stretch.any(at, limit):
                continue
            self.looked = limit - at
            decisions = self._explain(stretch, runs, at, limit, said, quiet=quiet and whole, final=final and whole)
            if decisions[0].steps:
                return decisions
            if whole:
                break
        base = self._tape.base + stretch.begin
        self._stuck = base + at, base + n
        return []

    def _explain(
        self, stretch: Stretch, runs: Runs, at: int, limit: int, said: Said, *, quiet: bool, final: bool
    ) -> list[Decision]:
        """The certain steps in [at, limit): by declared candidates, and where those leave noise by all that there are.

        `quiet`: the line was quiet at `limit`; `final`: nothing comes after it.
        """
        tape, trust = self._tape, self._trust
        origin = stretch.begin + at
        data = stretch.data[at:limit].tobytes()
        silences = tape.classes[origin : origin + len(data) + 1]
        classes = silences.tolist()
        candidates = stretch.candidates(at, limit)
        idle_bits = max(0.0, trust.evidence[Turn.REQUEST][self._idle_class])

        limits = next_checkpoint(tape.base + origin) - tape.base - origin

        def contested(position: int) -> bool:
            """Whether what begins there is for the lattice, too, and silences are still worth the same."""
            i = int(np.searchsorted(runs.start, at + position))
            here = i < len(runs.start) and runs.start[i] == at + position
            return position < limits and here and not (runs.clean[i] and not runs.either[i])

        def begun(candidates: list[Candidate]) -> tuple[Lattice, list[Event]]:
            lattice = Lattice(data, tape.base + origin, classes, trust, candidates, said)
            return lattice, events_in(tape, self._options, trust, origin, len(data), candidates, classes, quiet=quiet)

        decision = None
        if candidates and candidates[0].start == 0:  # else there is noise, whatever comes
            lattice, events = begun(candidates)
            decision = decide(lattice, data, events, idle_bits)
            if only_frames(decision):
                return go_on(lattice, data, events, idle_bits, decision, contested)
            if final and not decision.steps:
                decision = settled(lattice, len(data))
                if only_frames(decision):
                    return [decision]
        idle = (tape.quiet(origin, origin + len(data) + 1, self._options.idle_ns) - origin).tolist()
        idle += [len(data)] * quiet
        spots = places(data, silences, candidates, idle, trust.parts())
        may = opening(stretch.crc, at, len(data))
        more = unknown_windows(data, stretch.crc, at, spots, candidates, self.heard, may)
        more += broken_windows(data, stretch.crc, at, spots, candidates + more, may)
        more += damaged_requests(data, spots, candidates)
        more += damaged_answers(data, spots, candidates, said.pending)
        more = [candidate for candidate in more if self._role in (None, candidate.role)]
        if more or decision is None:
            lattice, events = begun(sorted(candidates + more, key=lambda c: (c.start, c.end, c.role)))
            decision = decide(lattice, data, events, idle_bits)
        if not decision.steps and final:
            decision = settled(lattice, len(data))
        elif not decision.steps and len(data) == WINDOWS[-1]:
            decision = forced(lattice, len(data))
        return [decision]

    def pieces(self, decision: Decision, origin: int) -> Decided:
        """A decision's steps, which begin at index `origin` of the tape; what functions they use is remembered."""
        steps = decision.steps
        start = np.array([s.start for s in steps], np.intp)
        end = np.array([s.end for s in steps], np.intp)
        role = np.array([s.candidate.role if s.candidate else NOISE for s in steps], np.uint8)
        found = margins(decision)
        margin = np.array([min(bits, SURE) for bits, _ in found], np.float32)
        why = explained(steps, found, self._tape.base + origin) if self._options.explain else None
        for step in steps:
            if step.candidate is not None and not step.candidate.declared:
                self.heard.add(int(self._tape.data[origin + step.start + 1]) & 0x7F)
        check = np.array([s.candidate is not None and not s.candidate.damaged for s in steps], np.bool_)
        weighed = np.ones(len(start), np.bool_)
        return Decided(start + origin, end + origin, role, check, margin, weighed, why)
