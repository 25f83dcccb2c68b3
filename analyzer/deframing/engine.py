"""Bytes in, segments out: the deframer of one port's stream.

Where candidates tile the bytes end to end with no rival, the path is forced and whole runs are taken as arrays
(`runs`); only what is left goes through the lattice (`contested`). The engine is sans-IO and holds the undecided bytes
alone: at most a window, and what one feed brought.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from captures.chunks import Block
from dissectors.length_rules import Role
from dissectors.limits import MAX_ADU, MIN_ADU

from ..options import Options
from .buffer import ByteBuffer, CharacterTime
from .candidates import CRC_BITS, Candidates, more_candidates, search_candidates
from .certainty import Lessons
from .conversation import REACH, ConversationTracker, FrameRun
from .decisions import WINDOWS, Decider
from .forced import ANSWERS, ASKS, ForcedRuns, SearchedBytes, forced_runs
from .gaps import SILENT, GapStatistics, classes_of, next_checkpoint
from .looks import STAGES
from .reach import RunContext, plain_evidence, run_reach
from .rules import Bytes, CrcWindows, Index, Mask, crc_windows
from .segments import NOISE, DecidedSegments, StreamSegments, evidence_rows, join_segments

_SLICE: Final = 1 << 20  # bytes searched at once
_MUCH: Final = 1 << 16  # bytes: fed at once, more will follow, or a quiet line
_LOOKS_AHEAD: Final = 16  # bytes behind its end that a search may want to see of a short frame
_NOWHERE: Final = (-1, -1)
_CROWD: Final = 64  # bytes that a look left undecided: the next is made when so many more have come,
_MORE: Final = 4  # or one for so many of them, or the line falls quiet
_QUIET: Final = 2  # stages of a quiet line


class Engine:
    """Decides, in stream order, what every byte is. `feed` as bytes come, `take` what was decided."""

    buffer: ByteBuffer
    options: Options
    _role: Role | None
    statistics: GapStatistics
    _tracker: ConversationTracker
    _decider: Decider
    _searched: int
    _found: Candidates
    _found_from: int
    _left: int
    _waiting: bool
    _framed: int
    _asked: tuple[int, int]
    _lessons: Lessons
    _decided: list[DecidedSegments]
    _out: list[StreamSegments]

    def __init__(self, character: CharacterTime, options: Options, role: Role | None = None) -> None:
        """`role`: the only one that frames of this port have, where that is known."""
        self.buffer = ByteBuffer(character)
        self.options = options
        self._role = role
        self.statistics = GapStatistics()
        self._tracker = ConversationTracker()
        self._decider = Decider(self.buffer, self.statistics, options, role)
        self._searched = -1  # bytes of the stream up to which candidates are known
        self._found = Candidates.none()  # those, and perhaps some that end behind it, with offsets from
        self._found_from = 0  # this byte of the stream
        self._left = 0  # bytes that the newest look left undecided
        self._waiting = False  # the last frame was a request that wants an answer
        self._framed = -1  # offset: where the last frame ended
        self._asked = _NOWHERE  # offsets: where a request that was taken without the lattice began and ended
        self._lessons = Lessons(self.statistics)
        self._decided = []  # since the work began
        self._out = []

    def feed(self, block: Block, now_ns: int | None = None) -> None:
        """Chunks of one port. `now_ns`: the line has been silent from the last of them up to then."""
        self.buffer.append(block)
        if now_ns is None:
            if self._look_pays(0):
                self.buffer.close(over=False)
                self._work(self.buffer.ready, 0)
        else:
            self.tick(now_ns)

    def tick(self, now_ns: int) -> None:
        """The line has been silent up to now."""
        buffer, options = self.buffer, self.options
        silence = now_ns - buffer.last_time
        if not len(buffer) or silence < 0:
            return
        if not self._look_pays(_QUIET if silence >= options.idle_ns else 1):
            return
        ready, stages = buffer.ready, 0
        buffer.close(over=True)
        if silence > buffer.char_ns:  # else more may follow at once: only what is before the last read is whole
            ready = len(buffer)
            stages = 1 + (silence >= options.idle_ns) + (silence >= options.cut_ns)
            if stages == 1 and not self.statistics.may_end(int(classes_of(np.array([silence]), buffer.char_ns)[0])):
                stages = 0
        self._work(ready, stages)

    def close(self) -> None:
        """No more bytes come."""
        self.buffer.close(over=True)
        self._work(len(self.buffer), STAGES)

    def take_segments(self) -> list[StreamSegments]:
        """What was decided since the last call."""
        out, self._out = self._out, []
        return out

    @property
    def undecided_ns(self) -> int | None:
        """The time of the first byte that is not decided, or None."""
        return int(self.buffer.time[0]) if len(self.buffer) else None

    def _look_pays(self, stages: int) -> bool:
        """Whether to look at once: what is crowded is dear to look at, and decided later it is decided the same."""
        new, left = len(self.buffer) - self._left, self._left
        return stages >= _QUIET or left < _CROWD or len(self.buffer) >= WINDOWS[-1] or new >= max(_CROWD, left // _MORE)

    def _work(self, ready: int, stages: int) -> None:
        """Decide as much of the first `ready` bytes of the buffer as can be; `stages` of the silence behind them."""
        buffer = self.buffer
        begin = 0
        while begin < ready:
            upto = min(ready, begin + _SLICE + WINDOWS[-1])
            last = upto == ready
            more = not last or (upto - begin >= _MUCH and stages <= 1)
            stop = upto - WINDOWS[-1] if more else upto  # the next slice, or feed, knows more of what is behind
            begin += self._slice(begin, upto, stop - begin, stages if last else 0)
            if last:
                break
        if begin:
            decided, self._decided = join_segments(self._decided), []
            self._out.append(
                StreamSegments(buffer.base, buffer.data[:begin], decided, buffer.reads(decided.start, decided.end))
            )
            buffer.drop(begin)
        self._left = len(buffer)

    def _slice(self, begin: int, upto: int, stop: int, stages: int) -> int:
        """Decide bytes [begin, upto) of the buffer, as far as `stop` bytes at least; how many were."""
        data, final = self.buffer.data[begin:upto], stages == STAGES
        if len(data) < MIN_ADU and not final:
            return 0
        crc = crc_windows(data)
        found = self._whole(self._search(data, crc, self.buffer.base + begin), begin)
        known = len(data) if final else len(data) - MAX_ADU
        runs = forced_runs(found, data, known, self._silences(begin, len(data)))
        stretch = SearchedBytes(data, begin, crc, found)
        at = 0
        while at < stop:
            i = int(runs.start.searchsorted(at))
            if i < len(runs.start) and runs.start[i] == at and runs.clean[i]:
                moved = self._run(stretch, runs, i)
                if moved > at:
                    at = moved
                    continue
            if not stages and self._tells_nothing(stretch, at):
                break
            moved = self._contest(stretch, runs, at, stages)
            if moved == at:
                break
            at = moved
        return at

    def _tells_nothing(self, stretch: SearchedBytes, at: int) -> bool:
        """Whether there is no place from `at` on at which the lattice would look for a decision, as amid a frame."""
        size, found = len(stretch.data), stretch.found
        if size - at >= WINDOWS[0] or (len(found) and found.start[-1] >= at):
            return False
        low, high = stretch.begin + at, stretch.begin + size + 1
        quiet_ns = min(self.options.idle_ns, self.options.cut_ns)
        silent = self.buffer.classes[low + 1 : high].max(initial=0) >= SILENT
        return not silent and not len(self.buffer.quiet(low, high, quiet_ns))

    def _silences(self, begin: int, size: int) -> NDArray[np.uint8]:
        """Classes of the silences before so many bytes, and of the one behind them where more has come."""
        return self.buffer.classes[begin : begin + size + 1]

    def _search(self, data: Bytes, crc: CrcWindows, offset: int) -> Candidates:
        """Candidates of bytes at a stream offset; what an earlier look has found is not searched again."""
        searched = self._searched - offset
        if searched <= MAX_ADU:  # what ends behind it may begin anywhere before
            found = search_candidates(data, crc)
        else:
            known, shift = self._found, offset - self._found_from
            some = (known.start >= shift) & (known.end <= searched + shift)
            known = Candidates(
                known.start[some] - shift, known.end[some] - shift, known.role[some], known.structure[some]
            )
            found = more_candidates(known, searched, data, crc)
        self._searched = -1
        if len(data) <= 2 * WINDOWS[-1]:  # else so much is decided at once
            self._searched, self._found, self._found_from = offset + len(data) - _LOOKS_AHEAD, found, offset
        return found

    def _whole(self, found: Candidates, begin: int) -> Candidates:
        """Candidates that no long silence cuts, of the role that this port has."""
        if self._role is not None:
            found = found.of(self._role)
        if not len(found) or not self.buffer.lasts(self.options.cut_ns):
            return found
        low, high = begin + int(found.start[0]), begin + int(found.end.max())
        cuts = self.buffer.quiet(low, high, self.options.cut_ns) - begin
        if not len(cuts):
            return found
        whole = np.searchsorted(cuts, found.start, side="right") == np.searchsorted(cuts, found.end, side="left")
        return Candidates(found.start[whole], found.end[whole], found.role[whole], found.structure[whole])

    def _run(self, stretch: SearchedBytes, runs: ForcedRuns, i: int) -> int:
        """Take intervals without rivals from i on, as far as their roles are plain; the position behind them.

        Never beyond a checkpoint, where what silences are worth may change.
        """
        begin, data = stretch.begin, stretch.data
        at = int(runs.start[i])
        offset = self.buffer.base + begin
        if runs.second[i] and self._asked[1] != offset + at:
            return at
        if runs.role[i] == ANSWERS and self._framed != offset + at:
            return at  # by itself, that is little to begin with: the lattice would wait for what follows
        limit = next_checkpoint(offset + at) - offset
        last = int(runs.last[i]) + 1
        if runs.end[last - 1] > limit:
            last = max(i + 1, i + int(runs.end[i:last].searchsorted(limit, side="right")))
        classes = self._silences(begin, len(data))
        context = RunContext(data, classes, self.statistics, self._tracker, self._waiting)
        last, margin = run_reach(runs, i, last, context)
        if last <= i:
            return at
        start, end, role = runs.start[i:last], runs.end[i:last], runs.role[i:last]
        structure = runs.structure[i:last]
        why = None
        if self.options.explain:
            why = evidence_rows(last - i)
            why.length[:], why.crc[:] = structure, CRC_BITS
            why.silence[:], why.conversation[:] = plain_evidence(
                data, start, end, role, classes.take(start), self.statistics, self._tracker.conversation
            )
        decided = DecidedSegments(start + begin, end + begin, role, margin > 0, margin, margin < 0, why)
        self._take(stretch, start, end, runs.fits[i:last], decided)
        return int(end[-1])

    def _take(self, stretch: SearchedBytes, start: Index, end: Index, fits: Mask, decided: DecidedSegments) -> None:
        """Frames (`start` and `end` in the stretch) are decided without the lattice."""
        offset, role = self.buffer.base + stretch.begin, decided.role
        first = max(0, int(start.searchsorted(end[-1] - REACH)) - 1)
        run = FrameRun(
            self.buffer.data, self.buffer.base, decided.start[first:], decided.end[first:], role[first:], fits[first:]
        )
        self._tracker.extend(run)
        self._decide(decided, noise=False)
        asks = role[-1] == ASKS
        self._waiting = bool(asks and stretch.data[start[-1]])
        self._framed = offset + int(end[-1])
        self._asked = (offset + int(start[-1]), self._framed) if asks else _NOWHERE

    def _contest(self, stretch: SearchedBytes, runs: ForcedRuns, at: int, stages: int) -> int:
        """Decide from `at` on through the lattice; the position reached, `at` if more must be known."""
        framed = self._framed == self.buffer.base + stretch.begin + at
        decisions = self._decider.decide(stretch, runs, at, self._tracker.conversation, stages, framed=framed)
        if not decisions:
            return at
        last = decisions[-1].steps[-1]
        if last.candidate is not None:
            self._framed = self.buffer.base + stretch.begin + at + last.end
        self._decide(self._decider.segments(decisions, stretch, at))
        frames = [(s.start, s.candidate.role) for d in decisions for s in d.steps if s.candidate is not None]
        if frames:
            start, role = frames[-1]
            self._waiting = role == ASKS and bool(stretch.data[at + start])
        self._tracker.settle(last.conversation)
        return at + last.end

    def _decide(self, decided: DecidedSegments, *, noise: bool = True) -> None:
        """Segments are decided: given when work is done, learnt from at the next checkpoint at the latest."""
        buffer = self.buffer
        low, high = int(decided.start[0]), int(decided.end[-1])
        if decided.why is not None:
            decided.why.margin[:] = decided.margin
        self._decided.append(self._parted(decided) if noise else decided)
        taught = decided._replace(start=decided.start - low, end=decided.end - low) if low else decided
        self._lessons.add(taught, buffer.base + low, buffer.data[low:high], buffer.classes[low:high])
        if buffer.base + high >= next_checkpoint(self.statistics.checkpoint):
            self._lessons.learn()

    def _parted(self, decided: DecidedSegments) -> DecidedSegments:
        """The same, noise in two where a silence parts frames."""
        start, end, role, check, margin, contested, why = decided
        noise = role == NOISE
        if not noise.any():
            return decided
        start, end, segment = self.buffer.parted(start, end, noise, self.statistics.trusted)
        why = None if why is None else why[segment]
        return DecidedSegments(start, end, role[segment], check[segment], margin[segment], contested[segment], why)
