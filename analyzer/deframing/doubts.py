"""A unit in doubt, answer by answer: from the odd row that begins it until its paths say one thing (`queues`)."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from typing import Final

import numpy as np

from dissectors.lengths import expectation

from ..tables.batch import adu_of
from ..tables.schema import GLITCHES, Kind, Protocol
from ..tables.transactions import LONGEST_NS
from .contents import MOST_BITS, REPEATED_BITS, KnownPolls, telling, words_of
from .oddities import HISTORY, OddRows
from .pairedrows import Lane, PairedRows, lanes_of
from .queues import AskedRequest, PendingAnswer, SettledAnswer, UnitHabit, UnitQueue
from .rules import Index

_HOLD_FRAMES: Final = 128
_HOLD_NS: Final = 4_000_000_000
_LATENCY_NS: Final = 2_000_000_000  # by which a read may come late: what began before is known by then
_ANSWERS: Final = 8  # of a poll
_ASKS: Final = 24  # frames of a unit that are looked back on when a doubt begins
_DAMAGED: Final = 3  # bytes that may have been an answer
_ALIKE: Final = 4  # repeats that are as expected,
_AS_EXPECTED: Final = 1.0  # bits: by so much an answer may be stranger than its poll's own
_BETWEEN: Final = 3  # rows behind a request in which its damaged answer may stand
_REQUEST, _RESPONSE, _NOISE = int(Kind.REQUEST), int(Kind.RESPONSE), int(Kind.NOISE)


class Repeat(Enum):
    """What an answer that may begin a doubt has of the one before (`OddRows`); none where it is odd in itself."""

    NONE, SAME, MOVED = range(3)


@dataclass(slots=True)
class Doubt:
    """A unit whose answers are looked at, and what its polls held."""

    queue: UnitQueue = field(default_factory=UnitQueue)
    known: KnownPolls = field(default_factory=KnownPolls)
    of_repeat: bool = False  # nothing was odd yet but that answers are the ones before once more
    apparent: KnownPolls = field(default_factory=KnownPolls)  # then: what polls hold, if all is as it seems
    alike: int = 0  # and the repeats that are as each poll's own answers are


class DoubtWalk:
    """One pass over rows: frames of units in doubt, one by one, and those that begin a doubt."""

    def __init__(
        self, work: PairedRows, doubts: dict[Lane, Doubt], habits: dict[Lane, UnitHabit], *, timed: bool, latest_ns: int
    ) -> None:
        self._work, self._doubts, self._habits, self._timed = work, doubts, habits, timed
        self._rows, self._lane = work.loose.rows, lanes_of(work)
        self._frames = self._rows.kind.nonzero()[0]
        self._index = self._rows.index[self._frames]
        self._own: dict[Lane, Index] = {}
        self._odd: dict[int, Repeat] = {}
        self.latest_ns = latest_ns

    def go_through_rows(self, found: OddRows, first: int) -> None:
        """Go through rows from one on, which these are counted from; odd ones begin a doubt, those that are the same
        as the answer before where their unit answers twice."""
        rows = self._rows
        starts = np.where(rows.kind != _NOISE, rows.t_start_ns, self.latest_ns)
        starts[:first] = self.latest_ns
        self._latest = np.maximum(np.maximum.accumulate(starts), self.latest_ns) if len(starts) else starts
        at = first
        odd, same, moved = (each + first for each in found)
        upcoming = np.union1d(odd, same).tolist()
        self._odd = dict.fromkeys(same.tolist(), Repeat.SAME) | dict.fromkeys(moved.tolist(), Repeat.MOVED)
        self._odd |= dict.fromkeys(odd.tolist(), Repeat.NONE)
        place = 0
        while True:
            while place < len(upcoming) and upcoming[place] < at:
                place += 1
            near = [upcoming[place]] if place < len(upcoming) else []
            for lane in self._doubts:
                own = self._of(lane)
                k = int(own.searchsorted(at))
                near += [int(own[k])] if k < len(own) else []
            if not near:
                break
            row = min(near)
            self._take(row, int(self._lane[row]))
            at = row + 1
        if len(self._latest):
            self.latest_ns = int(self._latest[-1])

    def close(self, until: int | None) -> None:
        """Nothing more is known than these rows and what was silent before `until`."""
        newest = int(self._index[-1]) if len(self._index) else 0
        silent_ns = (1 << 62) if until is None else until - _LATENCY_NS
        for lane in list(self._doubts):
            doubt = self._doubts[lane]
            self._expire(doubt, self.latest_ns, newest)
            if self._timed or until is None:
                self._expire(doubt, silent_ns, newest, forced=until is None)
            self._end(lane)

    def certain(self, first: int) -> int:
        """Up to which row all is settled."""
        waiting = [doubt.queue.pending[0].number for doubt in self._doubts.values() if doubt.queue.pending]
        if not waiting:
            return len(self._rows)
        return max(first, self._row_of(min(waiting)))

    def _take(self, row: int, lane: Lane) -> None:
        doubt = self._doubts.get(lane)
        if doubt is None:
            doubt = self._begun(row, lane)
            if doubt is None:
                return
            self._doubts[lane] = doubt
        index = int(self._rows.index[row])
        self._expire(doubt, int(self._latest[row]), index)
        self._look_for_broken(doubt.queue, row, lane)
        if self._rows.kind[row] == _REQUEST:
            doubt.queue.ask(self._ask(row))
        else:
            self._answer(doubt, row, lane)
        for settled in doubt.queue.settled():
            self._write(doubt, settled)
        self._end(lane)

    def _end(self, lane: Lane) -> None:
        """The doubt is over once one path is left that is as it should be."""
        if self._doubts[lane].queue.plain:
            del self._doubts[lane]

    def _begun(self, row: int, lane: Lane) -> Doubt | None:
        """A doubt that begins with an odd answer; None where there is none: what was not answered came damaged."""
        habit = self._habits.setdefault(lane, UnitHabit())
        repeat = self._odd[row]
        if {Repeat.SAME: not habit.doubles, Repeat.MOVED: habit.alike, Repeat.NONE: False}[repeat]:
            return None
        doubt, queue = Doubt(of_repeat=repeat == Repeat.MOVED), UnitQueue(habit=habit)
        habit.alike = False
        own = self._before(row, lane)[-_ASKS:]
        newest = -1
        for k, each in enumerate(own.tolist()):
            if self._rows.kind[each] == _REQUEST:
                ask = self._ask(each)
                behind = int(own[k + 1]) if k + 1 < len(own) else row
                followed = k + 1 < len(own) and self._rows.kind[behind] == _RESPONSE
                ask.taken = followed and ask.expects.fits(self._adu(behind))
                ask.damaged = not ask.taken and self._came_damaged(each, behind)
                queue.ask(ask)
            else:
                newest = max(newest, int(self._rows.request[each]))
                for ask in queue.asks:
                    ask.answered |= ask.number == self._rows.request[each]
        if not queue.asks:
            return None
        queue.paths = [queue.paths[0]._replace(newest=newest)]
        last = queue.asks[-1]
        simple = not last.taken and int(self._rows.request[row]) == last.number and not self._repeats(row, own)
        if simple and all(ask.taken or ask.damaged or ask.number <= newest for ask in queue.asks[:-1]):
            return None
        doubt.queue = queue
        return doubt

    def _repeats(self, row: int, own: Index) -> bool:
        """Whether an answer is the one before once more."""
        answers = own[self._rows.kind[own] == _RESPONSE]
        return len(answers) > 0 and self._adu(int(answers[-1])) == self._adu(row)

    def _came_damaged(self, request: int, behind: int) -> bool:
        """Whether what stands behind a request may be its answer, damaged."""
        for row in range(request + 1, min(request + 1 + _BETWEEN, behind)):
            if self._rows.kind[row] == _NOISE or not self._rows.check[row]:
                captured = self._work.loose.bytes_of(row)
                if sum(octet not in GLITCHES for octet in captured) >= _DAMAGED:
                    return True
            else:
                return False
        return False

    def _look_for_broken(self, queue: UnitQueue, row: int, lane: Lane) -> None:
        """Whether a request of the unit came broken since its last frame, by its first byte and its length."""
        own = self._of(lane)
        before = int(own[max(int(own.searchsorted(row)) - 1, 0)])
        between = slice(before + 1, row)
        broken = np.flatnonzero((self._rows.kind[between] == _NOISE) | ~self._rows.check[between]) + between.start
        if not len(broken):
            return
        captured = b"".join(self._work.loose.bytes_of(each) for each in broken.tolist())
        if captured[0] == lane & 0xFF and abs(len(captured) - len(queue.asks[-1].adu)) < _DAMAGED:
            queue.broken.append(int(self._rows.index[before]))

    def _answer(self, doubt: Doubt, row: int, lane: Lane) -> None:
        adu, asks = self._adu(row), doubt.queue.asks
        newest = asks[-1]
        self._went_on(asks, row, lane)
        waits = self._newest_request(row, lane) == newest.number
        began = int(self._rows.t_start_ns[row])
        waits &= not self._timed or began - newest.t_end_ns <= LONGEST_NS  # no client waits for so long
        taken = waits and not newest.taken and newest.expects.fits(adu)
        newest.taken |= taken
        answer = PendingAnswer(
            int(self._rows.index[row]), began, int(self._rows.t_end_ns[row]), adu, newest.number if taken else -1,
            int(self._work.loose.head[row]) != newest.read, self._repeats(row, self._before(row, lane)),
        )  # fmt: skip
        doubt.queue.answer(answer, partial(self._strangeness, doubt, row, lane), timed=self._timed)
        if doubt.of_repeat:
            self._weigh_repeat(doubt, answer)

    def _weigh_repeat(self, doubt: Doubt, answer: PendingAnswer) -> None:
        """Ends a doubt that repeats alone began, where all polls of the unit hold the same: a copy of another poll's
        answer would hardly be, again and again, what this poll's next one should be."""
        asks = doubt.queue.asks
        doubt.of_repeat = answer.taken_for >= 0 and all(ask.taken for ask in asks[-2:])
        words, request = words_of(answer.adu), asks[-1].adu
        poll = doubt.apparent.of(request)
        if answer.again and asks[-2:][0].adu != request:
            doubt.alike += poll.strangeness(words) <= _AS_EXPECTED
        poll.add(words)
        if doubt.of_repeat and doubt.alike >= _ALIKE:
            doubt.queue.take_as_they_seem()

    def _went_on(self, asks: list[AskedRequest], row: int, lane: Lane) -> None:
        """When the client went on to its next request, whichever unit that was to."""
        rows = self._rows
        for ask in asks:
            if ask.t_next_ns is None and ask.number >= self._index[0]:
                behind = slice(self._row_of(ask.number) + 1, row)
                asking = (rows.kind[behind] == _REQUEST) & (rows.port[behind] == lane >> 8)
                if asking.any():
                    ask.t_next_ns = int(rows.t_start_ns[behind][int(asking.argmax())])

    def _newest_request(self, row: int, lane: Lane) -> int:
        """The index of the newest whole request on the port that asks, whichever unit it is to."""
        rows = self._rows
        port = lane >> 8
        for at in range(row - 1, max(row - _HOLD_FRAMES, -1), -1):
            if rows.kind[at] == _REQUEST and rows.check[at] and rows.port[at] == port:
                return int(rows.index[at])
        return -1

    def _strangeness(self, doubt: Doubt, row: int, lane: Lane, ask: AskedRequest, adu: bytes) -> float:
        """How strange an answer is for a poll, by what that held before; an exception is never."""
        if adu[1] & 0x80:
            return 0.0
        poll = doubt.known.of(ask.adu, partial(self._answers_before, row, lane, ask.adu))
        words = words_of(adu)
        strange = poll.strangeness(words)
        if poll.held(words) or not telling(words) or not self._repeats(row, self._before(row, lane)):
            return strange
        return min(strange + REPEATED_BITS, MOST_BITS)

    def _answers_before(self, row: int, lane: Lane, request: bytes) -> list[bytes]:
        """The last certain answers of a poll before a row, the newest last."""
        rows, found = self._rows, []
        own = self._before(row, lane)
        at_request = {int(rows.index[each]): each for each in own.tolist() if rows.kind[each] == _REQUEST}
        for each in own[::-1].tolist():
            if rows.kind[each] == _RESPONSE and not rows.exception[each] and rows.request[each] >= 0:
                asked = at_request.get(int(rows.request[each]))
                if asked is not None and self._adu(asked) == request:
                    found.append(self._adu(each))
                    if len(found) == _ANSWERS:
                        break
        return found[::-1]

    def _write(self, doubt: Doubt, settled: SettledAnswer) -> None:
        """An answer is settled: what its row says."""
        answer, ask, rows = settled.answer, settled.request, self._rows
        row = self._row_of(answer.number)
        rows.unsure[row] = settled.unsure
        rows.request[row] = rows.request_start[row] = rows.response_ns[row] = rows.taken_for_start[row] = -1
        if answer.taken_for >= 0 and (ask is None or ask.number != answer.taken_for):
            taken = next(each for each in doubt.queue.asks if each.number == answer.taken_for)
            rows.taken_for_start[row] = taken.start
        if ask is None:
            return
        like = (each for each in [ask, *doubt.queue.asks] if each.adu == ask.adu and each.number < answer.number)
        ask = next((each for each in like if not each.answered), ask)  # of one like it that was not answered, if it was
        again, ask.answered = ask.answered, True
        if again and answer.taken_for < 0:
            doubt.queue.habit.doubles = True
            return  # nobody waits for it, and it has stood there already
        rows.request[row], rows.request_start[row] = ask.number, ask.start
        if int(self._work.loose.head[row]) != ask.read:
            waited = max(0, answer.t_start_ns - ask.t_end_ns)
            rows.response_ns[row] = waited if waited > self._work.unsure_ns[row] else -1
        doubt.known.add(ask.adu, answer.adu)

    def _expire(self, doubt: Doubt, now_ns: int, newest: int, *, forced: bool = False) -> None:
        """What has waited too long is unsure."""
        pending = doubt.queue.pending
        while pending and (
            forced
            or newest - pending[0].number > _HOLD_FRAMES
            or (self._timed and now_ns - pending[0].t_start_ns > _HOLD_NS)
        ):
            self._write(doubt, doubt.queue.give_up())
            for settled in doubt.queue.settled():
                self._write(doubt, settled)

    def _ask(self, row: int) -> AskedRequest:
        rows, adu = self._rows, self._adu(row)
        return AskedRequest(
            int(rows.index[row]), int(rows.start[row]), int(rows.t_end_ns[row]),
            int(self._work.loose.tail[row]), adu, expectation(adu),
        )  # fmt: skip

    def _adu(self, row: int) -> bytes:
        captured = self._work.loose.bytes_of(row)
        protocol = int(self._rows.protocol[row])
        return captured if protocol == Protocol.RTU else adu_of(captured, protocol).data

    def _before(self, row: int, lane: Lane) -> Index:
        own = self._of(lane)
        before: Index = own[own.searchsorted(row - HISTORY) : own.searchsorted(row)]
        return before

    def _of(self, lane: Lane) -> Index:
        if lane not in self._own:
            self._own[lane] = (self._lane == lane).nonzero()[0]
        return self._own[lane]

    def _row_of(self, number: int) -> int:
        return int(self._frames[self._index.searchsorted(number)])
