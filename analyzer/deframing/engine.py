"""Bytes in, pieces out: the deframer of one port's stream.

Where candidates tile the bytes end to end with no rival, the path is forced and whole runs are taken as arrays
(`runs`); only what is left goes through the lattice (`contest`). The engine is sans-IO and holds the undecided bytes
alone: at most a window, and what one feed brought.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role

from ..frames import Kind, Rows
from .broken import broken_windows
from .candidates import CRC_BITS, GLITCHES, Candidates, search
from .contest import WINDOWS, Decision, Event, decide, forced, margins, settled
from .damaged import damaged_answers, damaged_requests
from .lattice import GLITCH_RUN, NOISE_BEGINS, Candidate, Lattice
from .options import Options
from .pieces import NOISE, NOTHING, Pieces, evidence
from .places import SILENT, places
from .prefix import windows
from .rules import MAX_ADU, MIN_ADU, Bytes, Index
from .runs import Runs, Stretch, plain_evidence, plain_roles, runs_of
from .silence import Trust, Turn, classes_of, next_checkpoint
from .talk import Run, Talk
from .tape import Character, Tape, Times
from .unknown import unknown_windows

_KINDS: Final = {Role.REQUEST: Kind.REQUEST, Role.RESPONSE: Kind.RESPONSE, NOISE: Kind.NOISE}
_PARTS_NOISE: Final = 3.0  # bits of a silence at which noise is cut in two
_AGAINST: Final = -3.0  # bits: so little silence that hardly a frame ends there
_SURE: Final = 64.0  # bits: what cannot be doubted
_SLICE: Final = 1 << 18  # bytes searched at once
_REACH: Final = 1300  # bytes: further back than a conversation reaches


class Engine:
    """Decides, in stream order, what every byte is. `feed` as bytes come, `take` what was decided."""

    def __init__(self, character: Character, options: Options, role: Role | None = None) -> None:
        """`role`: the only one that frames of this port have, where that is known."""
        self.tape = Tape(character)
        self.options = options
        self._role = role
        self.trust = Trust()
        self._talk = Talk()
        self._vendor: set[int] = set()
        self._stuck = -1, -1  # offsets: what could not be decided, and how far the bytes went then
        self._waiting = False  # the last frame was a request that wants an answer
        self._idle_class = int(classes_of(np.array([options.idle_ns]), character.ns)[0])
        self._out: list[Pieces] = []
        self._decided: list[Bytes] = []

    def feed(self, data: Bytes, sizes: Index, times: Times, marks: NDArray[np.uint8], errors: Index) -> None:
        """Chunks, none empty: bytes end to end, size, time (ns) and direction mark of each, bytes that came marked."""
        self.tape.append(data, sizes, times, marks, errors)
        self._work(self.tape.ready, quiet=False, final=False)

    def tick(self, now_ns: int) -> None:
        """The line has been silent up to now."""
        if len(self.tape) and now_ns > self.tape.last_time:
            self.tape.close()
            silence = now_ns - self.tape.last_time
            self._work(len(self.tape), quiet=silence >= self.options.idle_ns, final=silence >= self.options.cut_ns)

    def close(self) -> None:
        """No more bytes come."""
        self.tape.close()
        self._work(len(self.tape), quiet=True, final=True)

    def take(self) -> tuple[Pieces, Bytes]:
        """What was decided since the last call, and its bytes."""
        out, self._out = self._out, []
        decided, self._decided = self._decided, []
        pieces = Pieces(*(np.concatenate(columns) for columns in zip(NOTHING, *out, strict=True)))
        return pieces, np.concatenate(decided) if decided else np.empty(0, np.uint8)

    @property
    def undecided_ns(self) -> int | None:
        """The time of the first byte that is not decided, or None."""
        return int(self.tape.time[0]) if len(self.tape) else None

    def _work(self, ready: int, *, quiet: bool, final: bool) -> None:
        """Decide as much of the first `ready` bytes of the tape as can be."""
        tape = self.tape
        begin = 0
        while begin < ready:
            upto = min(ready, begin + _SLICE + WINDOWS[-1])
            last = upto == ready
            stop = upto if last else upto - WINDOWS[-1]  # the next slice knows more of what is behind
            begin += self._slice(begin, upto, stop - begin, quiet=quiet and last, final=final and last)
            if last:
                break
        if begin:
            self._decided.append(tape.data[:begin])
            tape.drop(begin)

    def _slice(self, begin: int, upto: int, stop: int, *, quiet: bool, final: bool) -> int:
        """Decide bytes [begin, upto) of the tape, as far as `stop` bytes at least; how many were."""
        data = self.tape.data[begin:upto]
        if len(data) < MIN_ADU and not final:
            return 0
        crc = windows(data)
        found = self._whole(search(data, crc), begin)
        runs = runs_of(found, len(data) if final else len(data) - MAX_ADU)
        stretch = Stretch(data, begin, crc, found)
        at = 0
        while at < stop:
            i = int(np.searchsorted(runs.start, at))
            if i < len(runs.start) and runs.start[i] == at and runs.clean[i]:
                moved = self._run(stretch, runs, i)
                if moved > at:
                    at = moved
                    continue
            if not (quiet or final) and self._waits(stretch, at):
                break
            moved = self._contest(stretch, at, quiet=quiet, final=final)
            if moved == at:
                self._stuck = self.tape.base + begin + at, self.tape.base + upto
                break
            at = moved
        return at

    def _whole(self, found: Candidates, begin: int) -> Candidates:
        """Candidates that no long silence cuts, of the role that this port has."""
        if self._role is not None:
            found = found.of(self._role)
        if not len(found):
            return found
        low, high = begin + int(found.start[0]), begin + int(found.end.max())
        cuts = self.tape.quiet(low, high, self.options.cut_ns) - begin
        if not len(cuts):
            return found
        whole = np.searchsorted(cuts, found.start, side="right") == np.searchsorted(cuts, found.end, side="left")
        return Candidates(found.start[whole], found.end[whole], found.role[whole], found.structure[whole])

    def _run(self, stretch: Stretch, runs: Runs, i: int) -> int:
        """Take intervals without rivals from i on, as far as their roles are plain; the position behind them.

        Never beyond a checkpoint, where what silences are worth may change.
        """
        begin = stretch.begin
        at = int(runs.start[i])
        offset = self.tape.base + begin
        limit = next_checkpoint(offset + at) - offset
        last = min(int(runs.last[i]) + 1, max(i + 1, int(np.searchsorted(runs.end, limit, side="right"))))
        start, end = runs.start[i:last], runs.end[i:last]
        role = plain_roles(
            stretch.data, start, runs.role[i:last], runs.either[i:last],
            self.tape.classes[begin : begin + len(stretch.data)], self.trust, answered=not self._waiting,
        )  # fmt: skip
        count = len(role)
        if not count:
            return at
        start, end, structure = start[:count], end[:count], runs.structure[i : i + count]
        why = evidence(count)
        why["length"], why["crc"] = structure, CRC_BITS
        why["margin"] = structure + np.float32(CRC_BITS + NOISE_BEGINS)
        if self.options.explain:
            classes = self.tape.classes.take(start + begin)
            why["silence"], why["conversation"] = plain_evidence(
                stretch.data, start, end, role, classes, self.trust, self._talk.said
            )
        self._commit(start + begin, end + begin, role, np.ones(count, np.bool_), why, contested=False)
        first = int(np.searchsorted(start, end[-1] - _REACH))
        places = start[first:] + begin, end[first:] + begin
        self._talk.go_on(Run(self.tape.data, self.tape.base, *places, role[first:]), alone=first > 0)
        return int(end[-1])

    def _waits(self, stretch: Stretch, at: int) -> bool:
        """Whether nothing has come since the last look at these bytes that could decide anything."""
        origin, known = self._stuck
        tape = self.tape
        if origin != tape.base + stretch.begin + at:
            return False
        begin, upto = known - tape.base, stretch.begin + len(stretch.data)
        return (
            upto - stretch.begin - at < WINDOWS[1]
            and not (stretch.found.end + stretch.begin > begin).any()
            and not (tape.classes[begin:upto] >= SILENT).any()
        )

    def _contest(self, stretch: Stretch, at: int, *, quiet: bool, final: bool) -> int:
        """Decide from `at` on through the lattice; the position reached, `at` if more must be known."""
        n = len(stretch.data)
        for window in WINDOWS:
            limit = min(n, at + window)
            whole = limit == n
            if not whole and window < WINDOWS[-1] and not stretch.any(at, limit):
                continue
            decision = self._explain(stretch, at, limit, quiet=quiet and whole, final=final and whole)
            if decision.steps or whole:
                break
        if not decision.steps:
            return at
        self._steps(decision, stretch.begin + at)
        self._talk.settle(decision.steps[-1].said)
        return at + decision.steps[-1].end

    def _explain(self, stretch: Stretch, at: int, limit: int, *, quiet: bool, final: bool) -> Decision:
        """The certain steps in [at, limit): by declared candidates, and where those leave noise by all that there are.

        `quiet`: the line was quiet at `limit`; `final`: nothing comes after it.
        """
        tape = self.tape
        origin = stretch.begin + at
        data = stretch.data[at:limit].tobytes()
        silences = tape.classes[origin : origin + len(data) + 1]
        classes = silences.tolist()
        candidates = stretch.candidates(at, limit)
        idle_bits = max(0.0, self.trust.evidence[Turn.REQUEST][self._idle_class])

        def decided(candidates: list[Candidate], *, force: bool) -> Decision:
            lattice = Lattice(data, tape.base + origin, classes, self.trust, candidates, self._talk.said)
            decision = decide(
                lattice, data, self._events(origin, len(data), candidates, classes, quiet=quiet), idle_bits
            )
            if decision.steps:
                return decision
            if final:
                lattice.advance(len(data))
                return settled(lattice)
            return forced(lattice, len(data)) if force else decision

        decision = decided(candidates, force=False)
        if decision.steps and all(s.candidate is not None for s in decision.steps):
            return decision
        closed = quiet or len(tape.quiet(origin + len(data) - 1, origin + len(data) + 1, self.options.idle_ns)) > 0
        spots = places(data, silences, candidates, closed=closed, parts=self.trust.parts())
        more = unknown_windows(data, stretch.crc, at, spots, candidates, self._vendor)
        more += broken_windows(data, stretch.crc, at, spots, candidates + more)
        more += damaged_requests(data, spots, candidates)
        more += damaged_answers(data, tape.base + origin, spots, candidates, self._talk.said.pending)
        more = [candidate for candidate in more if self._role in (None, candidate.role)]
        if not more and (decision.steps or len(data) < WINDOWS[-1]):
            return decision
        candidates = sorted(candidates + more, key=lambda c: (c.start, c.end, c.role))
        return decided(candidates, force=len(data) == WINDOWS[-1])

    def _events(
        self, origin: int, size: int, candidates: list[Candidate], classes: list[int], *, quiet: bool
    ) -> list[Event]:
        """Where something may be decided, in stream order."""
        tape, options = self.tape, self.options
        idle = set((tape.quiet(origin, origin + size + 1, options.idle_ns) - origin).tolist())
        cut = set((tape.quiet(origin, origin + size + 1, options.cut_ns) - origin).tolist())
        if quiet:
            idle.add(size)
        edge = origin + size == tape.ready
        spots = sorted({c.end for c in candidates} | idle | cut)
        against = [max(bits) < _AGAINST for bits in zip(*self.trust.evidence, strict=True)]  # by class
        events = []
        for p in spots:
            inner = p < len(classes)
            silent = classes[p] > 0 if inner else edge
            events.append(Event(p, p in idle, p in cut, p in idle or silent, not (inner and against[classes[p]])))
        return [event for event in events if event.position > 0]

    def _steps(self, decision: Decision, origin: int) -> None:
        """Commit steps of the lattice."""
        steps = decision.steps
        base = self.tape.base + origin
        start = np.array([s.start for s in steps], np.intp)
        end = np.array([s.end for s in steps], np.intp)
        role = np.array([s.candidate.role if s.candidate else NOISE for s in steps], np.uint8)
        why = evidence(len(steps))
        for row, step, (margin, other) in zip(why, steps, margins(decision), strict=True):
            row["margin"] = min(margin, _SURE)
            row["silence"], row["conversation"] = step.silence, step.conversation
            if step.candidate is not None:
                row["length"] = step.candidate.structure
                row["crc"] = 0.0 if step.candidate.damaged else CRC_BITS
            if other is not None:
                kind = _KINDS[other.candidate.role if other.candidate else NOISE]
                row["rival_start"], row["rival_length"] = base + other.start, other.end - other.start
                row["rival_kind"] = kind
        for step in steps:
            if step.candidate is not None and not step.candidate.declared:
                self._vendor.add(int(self.tape.data[origin + step.start + 1]) & 0x7F)
        check = np.array([s.candidate is not None and not s.candidate.damaged for s in steps], np.bool_)
        self._commit(start + origin, end + origin, role, check, why, contested=True)

    def _commit(
        self,
        start: Index,
        end: Index,
        role: NDArray[np.uint8],
        check: NDArray[np.bool_],
        why: Rows,
        *,
        contested: bool,
    ) -> None:
        """Pieces (indices of the tape) are decided: report them, learn from them."""
        tape = self.tape
        parts = self.trust.parts(_PARTS_NOISE)
        self._learn(start, end, role, int(start[0]), int(end[-1]))
        if (role == NOISE).any():
            start, end, piece = self._parted(start, end, role, parts)
            role, check, why = role[piece], check[piece], why[piece]
        offsets = start.astype(np.int64) + tape.base, end.astype(np.int64) + tape.base
        times = (*tape.spans(start, end), *tape.reads(start, end))
        weighed = np.full(len(start), contested)
        self._out.append(Pieces(*offsets, role, check, *times, why, tape.gaps(start, end), weighed))

    def _parted(
        self, start: Index, end: Index, role: NDArray[np.uint8], parts: NDArray[np.bool_]
    ) -> tuple[Index, Index, Index]:
        """Pieces with noise cut where a silence surely parts it, and which of the given pieces each is of."""
        begins, owners = [], []
        for i, (low, high, kind) in enumerate(zip(start.tolist(), end.tolist(), role.tolist(), strict=True)):
            cuts = low + 1 + np.flatnonzero(parts[self.tape.classes[low + 1 : high]]) if kind == NOISE else ()
            begins += [low, *cuts]
            owners += [i] * (1 + len(cuts))
        starts = np.array(begins, np.intp)
        return starts, np.append(starts[1:], end[-1]), np.array(owners, np.intp)

    def _learn(self, start: Index, end: Index, role: NDArray[np.uint8], low: int, high: int) -> None:
        """Let decided pieces teach what silences and glitches mean here."""
        data = self.tape.data
        frames = role != NOISE
        asks = (role == Role.REQUEST) & (data.take(start) != 0)
        waits = np.append(self._waiting, asks[frames][:-1])
        turns = np.where(waits & asks[frames], Turn.AGAIN, role[frames]).astype(np.uint8)
        if len(turns):
            self._waiting = bool(asks[frames][-1])
        short = np.flatnonzero(~frames & (end - start <= GLITCH_RUN))
        glitches = [e for s, e in zip(start[short].tolist(), end[short].tolist(), strict=True)
                    if GLITCHES.issuperset(data[s:e].tobytes())]  # fmt: skip
        classes = self.tape.classes[low:high]
        if len(short):
            classes = classes.copy()  # a silence before a glitch is the silence before the frame behind it
            for s, e in zip(start[short] - low, end[short] - low, strict=True):
                if e < len(classes):
                    classes[e] = max(classes[e], classes[s:e].max())
        base = self.tape.base
        self.trust.learn(
            classes, start[frames] - low, end[frames] - low, turns, data.take(start[frames]),
            np.array(glitches, np.intp) - low, base + low, base + high,
        )  # fmt: skip
