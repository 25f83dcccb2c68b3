"""Bytes in, pieces out: the deframer of one port's stream.

Where candidates tile the bytes end to end with no rival, the path is forced and whole runs are taken as arrays
(`runs`); only what is left goes through the lattice (`contested`). The engine is sans-IO and holds the undecided bytes
alone: at most a window, and what one feed brought.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Role

from .candidates import CRC_BITS, GLITCHES, Candidates, search
from .contest import WINDOWS
from .contested import Contested
from .lattice import GLITCH_RUN, NOISE_BEGINS
from .near import STILL, plain_frames
from .options import Options
from .pieces import NOISE, Decided, Pieces, evidence, joined
from .prefix import windows
from .readings import echoed, plain_one
from .repeats import Place, Repeats, copied
from .rules import MAX_ADU, MIN_ADU, Bytes, Index, Mask
from .runs import Runs, Stretch, plain_evidence, reach, runs_of
from .silence import Trust, Turn, next_checkpoint
from .talk import REACH, Run, Talk
from .tape import Character, Tape, Times

_PARTS_NOISE: Final = 6.0  # bits of a silence at which noise is cut in two
_SLICE: Final = 1 << 20  # bytes searched at once
_MUCH: Final = 1 << 16  # bytes: fed at once, more will follow, or a quiet line
_NOWHERE: Final = (-1, -1)


class Engine:
    """Decides, in stream order, what every byte is. `feed` as bytes come, `take` what was decided."""

    def __init__(self, character: Character, options: Options, role: Role | None = None) -> None:
        """`role`: the only one that frames of this port have, where that is known."""
        self.tape = Tape(character)
        self.options = options
        self._role = role
        self.trust = Trust()
        self._talk = Talk()
        self._contested = Contested(self.tape, self.trust, options, role)
        self._waiting = False  # the last frame was a request that wants an answer
        self._waited = False  # the same of the last frame learnt from
        self._asked = _NOWHERE  # offsets: where a request that was taken without the lattice began and ended
        self._fresh: list[Decided] = []
        self._repeats = Repeats(self.tape, options)
        self._learnt: list[Decided] = []  # since the work began
        self._out: list[Pieces] = []

    def feed(
        self,
        data: Bytes,
        sizes: Index,
        times: Times,
        marks: NDArray[np.uint8],
        errors: Index,
        now_ns: int | None = None,
    ) -> None:
        """Chunks, none empty: bytes end to end, size, time (ns) and direction mark of each, bytes that came marked.

        `now_ns`: the line has been silent from the last of them up to then.
        """
        self.tape.append(data, sizes, times, marks, errors)
        if now_ns is None:
            self._work(self.tape.ready, quiet=False, final=False)
        else:
            self.tick(now_ns)

    def tick(self, now_ns: int) -> None:
        """The line has been silent up to now."""
        silence = now_ns - self.tape.last_time
        if len(self.tape) and silence >= 0:
            ready = self.tape.ready
            self.tape.close()
            if silence > self.tape.char_ns:  # else more may follow at once: only what is before the last read is whole
                ready = len(self.tape)
            self._work(ready, quiet=silence >= self.options.idle_ns, final=silence >= self.options.cut_ns)

    def close(self) -> None:
        """No more bytes come."""
        self.tape.close()
        self._work(len(self.tape), quiet=True, final=True)

    def take(self) -> list[Pieces]:
        """What was decided since the last call."""
        out, self._out = self._out, []
        return out

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
            more = not last or (upto - begin >= _MUCH and not quiet and not final)
            stop = upto - WINDOWS[-1] if more else upto  # the next slice, or feed, knows more of what is behind
            begin += self._slice(begin, upto, stop - begin, quiet=quiet and last, final=final and last)
            if last:
                break
        if begin:
            self._flush()
            decided, self._learnt = joined(self._learnt), []
            self._out.append(Pieces(tape.base, tape.data[:begin], decided, tape.seen(decided.start, decided.end)))
            tape.drop(begin)

    def _slice(self, begin: int, upto: int, stop: int, *, quiet: bool, final: bool) -> int:
        """Decide bytes [begin, upto) of the tape, as far as `stop` bytes at least; how many were."""
        data = self.tape.data[begin:upto]
        if len(data) < MIN_ADU and not final:
            return 0
        crc = windows(data)
        found = self._whole(search(data, crc), begin)
        runs = runs_of(found, data, len(data) if final else len(data) - MAX_ADU)
        stretch = Stretch(data, begin, crc, found)
        at = 0
        while at < stop:
            i = int(np.searchsorted(runs.start, at))
            if i < len(runs.start) and runs.start[i] == at:
                moved = (self._run if runs.clean[i] else self._plain)(stretch, runs, i)
                moved = moved if moved > at else self._echoes(stretch, runs, i)
                moved = moved if moved > at else self._near(stretch, runs, i)
                if moved > at:
                    at = moved
                    continue
            if not (quiet or final) and self._contested.waits(stretch, at):
                break
            moved = self._again(stretch, at, stop)
            if moved > at:
                at = moved
                continue
            moved = self._contest(stretch, runs, at, quiet=quiet, final=final)
            if moved == at:
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
        begin, data = stretch.begin, stretch.data
        at = int(runs.start[i])
        offset = self.tape.base + begin
        if runs.second[i] and self._asked[1] != offset + at:
            return at
        limit = next_checkpoint(offset + at) - offset
        last = int(runs.last[i]) + 1
        if runs.end[last - 1] > limit:
            last = max(i + 1, i + int(np.searchsorted(runs.end[i:last], limit, side="right")))
        classes = self.tape.classes[begin : begin + len(data)]
        last, margin = reach(runs, i, last, data, classes, self.trust, self._talk, waiting=self._waiting)
        if last <= i:
            return at
        start, end, role = runs.start[i:last], runs.end[i:last], runs.role[i:last]
        structure = runs.structure[i:last]
        why = None
        if self.options.explain:
            why = evidence(last - i)
            why["length"], why["crc"] = structure, CRC_BITS
            why["silence"], why["conversation"] = plain_evidence(
                data, start, end, role, classes.take(start), self.trust, self._talk.said
            )
        decided = Decided(start + begin, end + begin, role, margin > 0, margin, margin < 0, why)
        self._take(stretch, start, end, runs.fits[i:last], decided)
        return int(end[-1])

    def _plain(self, stretch: Stretch, runs: Runs, i: int) -> int:
        """Take one frame at a place of two readings, where it is plain which; the position behind it."""
        at = int(runs.start[i])
        offset = self.tape.base + stretch.begin
        if self.options.explain or (self._waiting and not offset <= self._asked[0] < self._asked[1] == offset + at):
            return at
        classes = self.tape.classes[stretch.begin : stretch.begin + len(stretch.data)]
        asked = self._asked[0] - offset if self._waiting else None
        found = plain_one(runs, i, stretch.data, classes, self.trust, asked)
        if found is None:
            return at
        one, bits = found
        start, end, role = runs.start[one : one + 1], runs.end[one : one + 1], runs.role[one : one + 1]
        margin = np.array([bits], np.float32)
        taped = start + stretch.begin, end + stretch.begin
        self._take(stretch, start, end, margin < 0, Decided(*taped, role, margin > 0, margin, margin < 0))
        return int(end[0])

    def _near(self, stretch: Stretch, runs: Runs, i: int) -> int:
        """Take plain frames that end where a longer one could still come; the position behind them."""
        begin, data, tape = stretch.begin, stretch.data, self.tape
        at, offset = int(runs.start[i]), tape.base + begin
        if self.options.explain or len(data) - at > WINDOWS[1]:
            return at
        silences = tape.classes[begin : begin + len(data) + 1].tolist()
        if begin + len(data) == len(tape):
            silences.append(STILL if tape.ready == len(tape) else 0)
        limit = next_checkpoint(offset + at) - offset
        last = plain_frames(data, silences, runs, i, limit, self.trust, self._talk.said)
        if last == i:
            return at
        some = slice(i, last)
        start, end = runs.start[some], runs.end[some]
        margin = runs.structure[some] + np.float32(CRC_BITS + NOISE_BEGINS)
        right = np.ones(len(start), np.bool_)  # and contested, for that is how the lattice would say it
        fits = runs.role[some] == Role.RESPONSE
        decided = Decided(start + begin, end + begin, runs.role[some], right, margin, right)
        self._take(stretch, start, end, fits, decided)
        return int(end[-1])

    def _echoes(self, stretch: Stretch, runs: Runs, i: int) -> int:
        """Take requests and their echoes, all alike, from interval i on; the position behind them."""
        at = int(runs.start[i])
        offset = self.tape.base + stretch.begin
        asked = self._waiting or self._talk.said.pending
        if self.options.explain or not runs.clean[i] or not runs.either[i] or asked or not stretch.data[at]:
            return at
        last = int(runs.echoes[np.searchsorted(runs.echoes, i)]) + 1
        last = i + int(np.searchsorted(runs.end[i:last], next_checkpoint(offset + at) - offset, side="right"))
        classes = self.tape.classes[stretch.begin : stretch.begin + len(stretch.data)]
        bits = echoed(runs, i, last, classes, self.trust) if last - i > 2 else np.empty(0)
        if not len(bits):
            return at
        last = i + 2 * len(bits)
        start, end = runs.start[i:last], runs.end[i:last]
        margin = np.repeat(bits, 2).astype(np.float32)
        fits = np.arange(len(start)) % 2 == 1
        role = np.where(fits, Role.RESPONSE, Role.REQUEST).astype(np.uint8)
        taped = start + stretch.begin, end + stretch.begin
        self._take(stretch, start, end, fits, Decided(*taped, role, margin > 0, margin, margin < 0))
        return int(end[-1])

    def _take(self, stretch: Stretch, start: Index, end: Index, fits: Mask, decided: Decided) -> None:
        """Frames (`start` and `end` in the stretch) are decided without the lattice."""
        offset, role = self.tape.base + stretch.begin, decided.role
        first = max(0, int(np.searchsorted(start, end[-1] - REACH)) - 1)
        run = Run(
            self.tape.data, self.tape.base, decided.start[first:], decided.end[first:], role[first:], fits[first:]
        )
        self._talk.go_on(run)
        self._decide(decided)
        asks = role[-1] == Role.REQUEST
        self._waiting = bool(asks and stretch.data[start[-1]])
        self._asked = (offset + int(start[-1]), offset + int(end[-1])) if asks else _NOWHERE

    def _contest(self, stretch: Stretch, runs: Runs, at: int, *, quiet: bool, final: bool) -> int:
        """Decide from `at` on through the lattice; the position reached, `at` if more must be known."""
        decisions = self._contested.decide(stretch, runs, at, self._talk.said, quiet=quiet, final=final)
        if not decisions:
            return at
        offset, last = self.tape.base + stretch.begin + at, decisions[-1].steps[-1]
        self._repeats.looked(offset + self._contested.looked, offset + last.end)
        for decision in decisions:
            self._decide(self._contested.pieces(decision, stretch.begin + at))
        frames = [(s.start, s.candidate.role) for d in decisions for s in d.steps if s.candidate is not None]
        if frames:
            start, role = frames[-1]
            self._waiting = role == Role.REQUEST and bool(stretch.data[at + start])
        self._talk.settle(last.said)
        return at + last.end

    def _again(self, stretch: Stretch, at: int, stop: int) -> int:
        """Take from `at` on what repeats what was just decided; the position behind it."""
        begin = stretch.begin
        offset = self.tape.base + begin + at
        place = Place(offset, len(self._fresh), self._talk.said, self._waiting)
        room = min(stop - at, next_checkpoint(offset) - offset)
        repeat = self._repeats.look(begin + at, begin + len(stretch.data), place, len(self._contested.heard), room)
        if repeat is None:
            return at
        self._decide(copied(self._fresh[repeat.first : repeat.last], repeat))
        self._talk.settle(repeat.said)
        self._waiting = repeat.waiting
        self._asked = _NOWHERE
        return at + repeat.moved

    def _decide(self, decided: Decided) -> None:
        """Pieces are decided; they are learnt from at the next checkpoint, or when work is done."""
        self._fresh.append(decided)
        if self.tape.base + int(decided.end[-1]) >= next_checkpoint(self.trust.checkpoint):
            self._flush()

    def _flush(self) -> None:
        """Learn from fresh pieces."""
        if not self._fresh:
            return
        start, end, role, check, margin, contested, why = joined(self._fresh)
        if why is not None:
            why["margin"] = margin
        self._fresh.clear()
        self._repeats.clear()
        noise = role == NOISE
        parts = self.trust.parts(_PARTS_NOISE) if noise.any() else None
        self._learn(start, end, role)
        if parts is not None:
            start, end, piece = self.tape.parted(start, end, noise, parts)
            why = None if why is None else why[piece]
            role, check, margin, contested = role[piece], check[piece], margin[piece], contested[piece]
        self._learnt.append(Decided(start, end, role, check, margin, contested, why))

    def _learn(self, start: Index, end: Index, role: NDArray[np.uint8]) -> None:
        """Let decided pieces teach what silences and glitches mean here."""
        data, low, high = self.tape.data, int(start[0]), int(end[-1])
        frames = np.flatnonzero(role != NOISE)
        units = data.take(start[frames])
        asks = (role[frames] == Role.REQUEST) & (units != 0)
        waits = np.empty(len(frames), np.bool_)
        waits[:1], waits[1:] = self._waited, asks[:-1]
        turns = role[frames].copy()
        turns[waits & asks] = Turn.AGAIN
        if len(frames):
            self._waited = bool(asks[-1])
        classes = self.tape.classes[low:high]
        glitches: list[int] = []
        if len(frames) < len(role):
            short = np.flatnonzero((role == NOISE) & (end - start <= GLITCH_RUN))
            classes = classes.copy()  # a silence before a glitch is the silence before the frame behind it
            for s, e in zip((start[short] - low).tolist(), (end[short] - low).tolist(), strict=True):
                if GLITCHES.issuperset(data[s + low : e + low].tobytes()):
                    glitches.append(e)
                if e < len(classes):
                    classes[e] = max(classes[e], classes[s:e].max())
        base = self.tape.base
        self.trust.learn(
            classes, start[frames] - low, end[frames] - low, turns, units,
            np.array(glitches, np.intp), base + low, base + high,
        )  # fmt: skip
