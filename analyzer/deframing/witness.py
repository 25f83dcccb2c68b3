"""The third witness of who answers whom: rows wait where header and order alone cannot tell, until contents do.

Most answers follow their requests, and nothing is asked. An event begins a doubt: a request that nobody answered, an
answer in a gap, one that does not fit. From then on the paths of that unit's answers are weighed (`queues`), with what
its polls held so far (`contents`), until one is left and stands where it should. Rows are given when the answers before
them are settled, and never revised; what cannot be settled within `_HOLD_FRAMES` frames or `_HOLD_NS` is unsure.

What is decided hangs on rows and their times alone, not on how they were fed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import partial
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import expectation

from ..tables.batch import adu_of
from ..tables.schema import GLITCHES, Int64s, Kind, Protocol
from ..tables.transactions import LONGEST_NS
from .contents import KnownPolls, words_of
from .queues import AskedRequest, PendingAnswer, SettledAnswer, UnitQueue
from .rules import Index
from .segments import UnorderedRows
from .wireorder import Across

_HOLD_FRAMES: Final = 128
_HOLD_NS: Final = 4_000_000_000
_LATENCY_NS: Final = 2_000_000_000  # by which a read may come late: what began before is known by then
_HISTORY: Final = 2048  # rows back in which answers of a poll are looked for
_ANSWERS: Final = 8  # of a poll
_ASKS: Final = 24  # frames of a unit that are looked back on when a doubt begins
_DAMAGED: Final = 3  # bytes that may have been an answer
_BETWEEN: Final = 3  # rows behind a request in which its damaged answer may stand
_REQUEST, _RESPONSE, _NOISE = int(Kind.REQUEST), int(Kind.RESPONSE), int(Kind.NOISE)
Lane = int  # a unit behind a port: port * 256 + unit
_NO_LANE: Final = -1
_FEW: Final = 48  # rows
_TCP: Final = int(Protocol.TCP)


class _LaneEnd(NamedTuple):
    """How a lane ends: requests since its last answer (-1: it has not begun), index and mark of the newest of these;
    what the last answer was to, and its mark.
    """

    open: int
    newest: int
    asked: int
    poll: int
    answer: int


_NOTHING: Final = _LaneEnd(-1, -1, -1, -1, -1)


class PairedRows(NamedTuple):
    """Rows in wire order, numbered and paired by header; of each the port that asks, and by how much clocks may lie."""

    loose: UnorderedRows
    asker: Int64s
    unsure_ns: Int64s

    @classmethod
    def of(cls, loose: UnorderedRows, across: Across | None) -> PairedRows:
        """`across`: of two ports that carry one direction each."""
        asker = loose.rows.port.astype(np.int64)
        unsure = np.full(len(asker), -1, np.int64)
        if across is not None:
            asker[across.answers] = across.requests
            unsure[across.answers] = across.unsure_ns[across.answers]
        return cls(loose, asker, unsure)

    @classmethod
    def joined(cls, parts: list[PairedRows]) -> PairedRows:
        """All of these, in order."""
        parts = [part for part in parts if len(part.asker)]
        if len(parts) < 2:
            return parts[0] if parts else cls.of(UnorderedRows.nothing(), None)
        own = [part.loose.placed_anew() for part in parts]  # joining moves them, and others look at them
        return cls(
            UnorderedRows.joined(own),
            np.concatenate([part.asker for part in parts]),
            np.concatenate([part.unsure_ns for part in parts]),
        )

    def cut(self, first: int, last: int) -> PairedRows:
        """Those from one to another (excluded)."""
        if first == 0 and last == len(self.asker):
            return self
        return PairedRows(self.loose.picked(np.arange(first, last)), self.asker[first:last], self.unsure_ns[first:last])


@dataclass(slots=True)
class _Doubt:
    """A unit whose answers are looked at, and what its polls held."""

    queue: UnitQueue = field(default_factory=UnitQueue)
    known: KnownPolls = field(default_factory=KnownPolls)


class AnswerWitness:
    """Rows paired by header in, and out again as soon as it is settled whose each answer is, or that nobody knows."""

    _history: list[PairedRows]
    _held: PairedRows
    _seen: int
    _doubts: dict[Lane, _Doubt]
    _asked: dict[Lane, _LaneEnd]
    _earlier: dict[int, bytes]
    _latest_ns: int

    def __init__(self) -> None:
        self._history = []  # rows that were given, the last of them
        self._held = PairedRows.of(UnorderedRows.nothing(), None)
        self._seen = 0  # of these, how many were gone through
        self._doubts = {}
        self._asked = {}  # how each lane ends
        self._earlier = {}
        self._latest_ns = -(1 << 62)

    def settle(
        self, loose: UnorderedRows, across: Across | None, earlier: dict[int, bytes], until: int | None, *, timed: bool
    ) -> tuple[UnorderedRows, dict[int, bytes]]:
        """More rows; gives those that are settled, with the bytes of requests before them that they answer.

        All that was heard before `until` (ns) is known; None: all.
        """
        new = PairedRows.of(loose, across)
        if not self._doubts and not len(self._held.asker):
            odd = self._odd(new)
            if not len(odd):
                self._remember(new)
                return loose, earlier
        elif not len(new.asker) and not len(self._held.asker):
            return loose, earlier
        else:
            odd = self._odd(new)
        self._earlier |= earlier
        past = self._past()
        work = PairedRows.joined([*past, self._held, new])
        before = sum(len(part.asker) for part in past)
        walk = _DoubtWalk(work, self._doubts, timed=timed, latest_ns=self._latest_ns)
        begin = before + len(self._held.asker)
        walk.go(odd + begin, begin)
        self._latest_ns = walk.latest_ns
        walk.close(until)
        certain = walk.certain(before)
        given = work.cut(before, certain)
        self._held = work.cut(certain, len(work.asker))
        bytes_before = self._requests_before(given.loose, work)
        self._history = [work.cut(max(certain - _HISTORY, 0), certain)]
        if not len(self._held.asker):
            self._earlier = {}
        return given.loose, bytes_before

    def _past(self) -> list[PairedRows]:
        """Rows that were given, those that may be looked at."""
        if len(self._history) > 1:
            every = PairedRows.joined(self._history)
            self._history = [every.cut(max(len(every.asker) - _HISTORY, 0), len(every.asker))]
        return self._history

    def _remember(self, rows: PairedRows) -> None:
        count = len(rows.asker)
        if not count:
            return
        self._history.append(rows)
        kept = sum(len(part.asker) for part in self._history)
        if kept - len(self._history[0].asker) >= _HISTORY or len(self._history) > _HISTORY // 8:
            every = self._history[-1:] if count >= _HISTORY else self._past()
            self._history = every
        frames = rows.loose.rows.kind.nonzero()[0]
        if len(frames):
            self._latest_ns = max(self._latest_ns, int(rows.loose.rows.t_start_ns[frames].max()))

    def _odd(self, new: PairedRows) -> Index:
        """Rows with answers that do not simply follow the only request of their unit that is open."""
        if not len(new.asker):
            return np.zeros(0, np.intp)
        odd, same = self._odd_of_few(new) if len(new.asker) <= _FEW else self._odd_of_many(new)
        return np.union1d(odd, self._moved(new, same)) if len(same) else odd

    def _moved(self, new: PairedRows, same: Index) -> Index:
        """Of answers that are the one before once more, to another request: those whose polls held something else."""
        past = [*self._past(), self._held]
        before = sum(len(part.asker) for part in past)
        every = PairedRows.joined([*past, new])
        rows = every.loose.rows
        lane, marks = _lanes(every), _marks(every)
        order = np.argsort(lane, kind="stable")
        paired = (lane[order][1:] == lane[order][:-1]) & (rows.kind[order][:-1] == _REQUEST)
        paired &= (rows.kind[order][1:] == _RESPONSE) & (lane[order][1:] != _NO_LANE)
        answers, asked = order[1:][paired], order[:-1][paired]
        polls = lane[answers] << 32 | marks[asked]
        place = np.lexsort((answers, polls))
        answers, polls = answers[place], polls[place]
        moved = (polls[1:] == polls[:-1]) & (marks[answers[1:]] != marks[answers[:-1]])
        moved &= answers[1:] - answers[:-1] < _HISTORY
        found: Index = np.intersect1d(answers[1:][moved] - before, same)
        return found

    def _odd_of_few(self, new: PairedRows) -> tuple[Index, Index]:
        """The same row by row, for arrays of so few take longer; and answers that are the one before once more."""
        rows, odd, same, ends = new.loose.rows, [], [], self._asked
        columns = (rows.kind, rows.unit, rows.check, rows.protocol, rows.index, rows.request)
        values = zip(new.asker.tolist(), *(column.tolist() for column in columns), strict=True)
        marks = _marks(new).tolist()
        for row, (port, kind, unit, whole, protocol, index, request) in enumerate(values):
            if kind == _NOISE or not whole or not unit or protocol == _TCP:
                continue
            lane = port << 8 | unit
            end = ends.get(lane, _NOTHING)
            if kind == _REQUEST:
                ends[lane] = end._replace(open=min(max(end.open, 0) + 1, 2), newest=index, asked=marks[row])
                continue
            if end.open >= 0 and (end.open != 1 or request != end.newest):
                odd.append(row)
            poll = end.asked if end.open > 0 else -1
            if marks[row] == end.answer and poll != end.poll:
                same.append(row)
            ends[lane] = _LaneEnd(0, -1, -1, poll, marks[row])
        return np.array(odd, np.intp), np.array(same, np.intp)

    def _odd_of_many(self, new: PairedRows) -> tuple[Index, Index]:
        rows = new.loose.rows
        lane = _lanes(new)
        whole = (lane != _NO_LANE).nonzero()[0]
        order = whole[np.argsort(lane[whole], kind="stable")]
        if not len(order):
            return order, order
        marks = _marks(new)[order]
        mine, asks, index = lane[order], rows.kind[order] == _REQUEST, rows.index[order]
        begins = np.append(True, mine[1:] != mine[:-1])
        open_before = np.zeros(len(order), np.int64)  # requests before each since its lane's last answer, up to 2
        newest = np.full(len(order), -1, np.int64)
        open_before[1:] = asks[:-1]
        open_before[2:] += asks[1:-1] & asks[:-2] & ~begins[1:-1]
        newest[1:] = np.where(asks[:-1], index[:-1], -1)
        unknown = np.zeros(len(order), np.bool_)
        for at in begins.nonzero()[0].tolist():
            count, asked, *_ = self._asked.get(int(mine[at]), _NOTHING)
            open_before[at], newest[at], unknown[at] = max(count, 0), asked, count < 0
            if at + 1 < len(order) and not begins[at + 1]:
                open_before[at + 1] = (1 + min(max(count, 0), 1)) if asks[at] else 0
        same = self._same(mine, asks, begins, marks)
        ends = np.append(begins[1:], True).nonzero()[0]
        for at in ends.tolist():
            count = int(min(open_before[at] + 1, 2)) if asks[at] else 0
            newest_of = (count, int(index[at]), int(marks[at])) if asks[at] else (0, -1, -1)
            end = self._asked.get(int(mine[at]), _NOTHING)
            self._asked[int(mine[at])] = _LaneEnd(*newest_of, end.poll, end.answer)
        odd = ~asks & ((open_before != 1) | (rows.request[order] != newest)) & ~unknown
        return np.sort(order[odd]), np.sort(order[same])

    def _same(self, lane: Int64s, asks: NDArray[np.bool_], begins: NDArray[np.bool_], marks: Int64s) -> Index:
        """Places, in order of lanes, of answers that are the lane's answer before once more, to another request."""
        answers = (~asks).nonzero()[0]
        if not len(answers):
            return answers
        polls = np.where(asks[answers - 1] & ~begins[answers], marks[answers - 1], -1)
        for k in begins[answers].nonzero()[0].tolist():
            end = self._asked.get(int(lane[answers[k]]), _NOTHING)
            polls[k] = end.asked if end.open > 0 else -1
        first = np.append(True, lane[answers[1:]] != lane[answers[:-1]])
        before = np.append(-1, marks[answers[:-1]])
        poll_before = np.append(-1, polls[:-1])
        last = np.append(first[1:], True)
        for k in first.nonzero()[0].tolist():
            end = self._asked.get(int(lane[answers[k]]), _NOTHING)
            before[k], poll_before[k] = end.answer, end.poll
        for k in last.nonzero()[0].tolist():
            mine = int(lane[answers[k]])
            end = self._asked.get(mine, _NOTHING)
            self._asked[mine] = end._replace(poll=int(polls[k]), answer=int(marks[answers[k]]))
        found: Index = answers[(marks[answers] == before) & (polls != poll_before)]
        return found

    def _requests_before(self, given: UnorderedRows, work: PairedRows) -> dict[int, bytes]:
        """The bytes of requests that rows answer and that lie before all of them."""
        rows = given.rows
        frames = rows.kind.nonzero()[0]
        if not len(frames):
            return {}
        requests = rows.request[frames]
        outside = np.unique(requests[(requests >= 0) & (requests < int(rows.index[frames[0]]))])
        found = {}
        every = work.loose.rows.kind.nonzero()[0]
        indices = work.loose.rows.index[every]
        for number in outside.tolist():
            at = int(indices.searchsorted(number))
            if at < len(indices) and indices[at] == number:
                found[number] = work.loose.bytes_of(int(every[at]))
            elif number in self._earlier:
                found[number] = self._earlier[number]
        return found


def _marks(paired: PairedRows) -> Int64s:
    """By what frames in RTU mode are compared: length and CRC; those of other rows are all different."""
    rows, data = paired.loose.rows, paired.loose.data
    ends = rows.at + rows.length
    marks = rows.length << 16 | data.take(ends - 2, mode="clip").astype(np.int64) << 8 | data.take(ends - 1)
    plain: Int64s = np.where(rows.protocol == Protocol.RTU, marks, -2 - rows.index)
    return plain


def _lanes(paired: PairedRows) -> Int64s:
    """The lane of each row: a whole frame to or from one unit on a serial line; of any other none."""
    rows = paired.loose.rows
    serial = rows.check & (rows.kind != _NOISE) & (rows.unit != 0) & (rows.protocol != Protocol.TCP)
    lanes: Int64s = np.where(serial, paired.asker << 8 | rows.unit, _NO_LANE)
    return lanes


class _DoubtWalk:
    """One pass over rows: frames of units in doubt, one by one, and those that begin a doubt."""

    def __init__(self, work: PairedRows, doubts: dict[Lane, _Doubt], *, timed: bool, latest_ns: int) -> None:
        self._work, self._doubts, self._timed = work, doubts, timed
        self._rows, self._lane = work.loose.rows, _lanes(work)
        self._frames = self._rows.kind.nonzero()[0]
        self._index = self._rows.index[self._frames]
        self._own: dict[Lane, Index] = {}
        self.latest_ns = latest_ns

    def go(self, odd: Index, first: int) -> None:
        """Go through rows from one on; `odd` ones begin a doubt."""
        rows = self._rows
        starts = np.where(rows.kind != _NOISE, rows.t_start_ns, self.latest_ns)
        starts[:first] = self.latest_ns
        self._latest = np.maximum(np.maximum.accumulate(starts), self.latest_ns) if len(starts) else starts
        at = first
        upcoming = odd.tolist()
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

    def _begun(self, row: int, lane: Lane) -> _Doubt | None:
        """A doubt that begins with an odd answer; None where there is none: what was not answered came damaged."""
        doubt, queue = _Doubt(), UnitQueue()
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

    def _answer(self, doubt: _Doubt, row: int, lane: Lane) -> None:
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
            int(self._work.loose.head[row]) != newest.read,
        )  # fmt: skip
        doubt.queue.answer(answer, partial(self._strangeness, doubt, row, lane), timed=self._timed)

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

    def _strangeness(self, doubt: _Doubt, row: int, lane: Lane, ask: AskedRequest, adu: bytes) -> float:
        """How strange an answer is for a poll, by what that held before; an exception is never."""
        if adu[1] & 0x80:
            return 0.0
        poll = doubt.known.polls.get(ask.adu)
        if poll is None:
            poll = doubt.known.begin(ask.adu, self._answers_before(row, lane, ask.adu))
        return poll.strangeness(words_of(adu))

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

    def _write(self, doubt: _Doubt, settled: SettledAnswer) -> None:
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
        if ask.answered:  # then it is of a request like it that was not, if there is one
            ask = next((each for each in doubt.queue.asks if each.adu == ask.adu and not each.answered), ask)
        again, ask.answered = ask.answered, True
        if again and answer.taken_for < 0:
            return  # nobody waits for it, and it has stood there already
        rows.request[row], rows.request_start[row] = ask.number, ask.start
        if int(self._work.loose.head[row]) != ask.read:
            waited = max(0, answer.t_start_ns - ask.t_end_ns)
            rows.response_ns[row] = waited if waited > self._work.unsure_ns[row] else -1
        doubt.known.add(ask.adu, answer.adu)

    def _expire(self, doubt: _Doubt, now_ns: int, newest: int, *, forced: bool = False) -> None:
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
        before: Index = own[own.searchsorted(row - _HISTORY) : own.searchsorted(row)]
        return before

    def _of(self, lane: Lane) -> Index:
        if lane not in self._own:
            self._own[lane] = (self._lane == lane).nonzero()[0]
        return self._own[lane]

    def _row_of(self, number: int) -> int:
        return int(self._frames[self._index.searchsorted(number)])
