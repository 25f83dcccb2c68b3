"""Where doubts begin: answers that do not simply follow the only request of their unit that is open.

Most rows are nothing of the kind, and arrays tell so at once. What is kept between two looks is how each lane ended.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import Int64s, Kind, Protocol
from .contents import telling, words_of
from .pairedrows import NO_LANE, Lane, PairedRows, lanes_of, marks_of
from .rules import Index

HISTORY: Final = 2048  # rows back in which answers of a poll are looked for
_FEW: Final = 48  # rows
_REQUEST, _RESPONSE, _NOISE = int(Kind.REQUEST), int(Kind.RESPONSE), int(Kind.NOISE)
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


class OddRows(NamedTuple):
    """Rows with answers that may begin a doubt, each in order."""

    odd: Index  # that do not simply follow the only request of their unit that is open
    same: Index  # that are the answer before once more, to another request: odd of a unit that answers twice
    moved: Index  # those of `same` whose polls held something else before, or may well have


class Oddities:
    """How lanes ended, and what is odd in what comes next."""

    _asked: dict[Lane, _LaneEnd]

    def __init__(self) -> None:
        self._asked = {}

    def found(self, new: PairedRows, past: Callable[[], list[PairedRows]]) -> OddRows:
        """Those of `new`; `past` gives the rows before them that may be looked at."""
        if not len(new.asker):
            return OddRows(*[np.zeros(0, np.intp)] * 3)
        odd, same = self._odd_of_few(new) if len(new.asker) <= _FEW else self._odd_of_many(new)
        return OddRows(odd, same, _moved(new, same, past()) if len(same) else same)

    def _odd_of_few(self, new: PairedRows) -> tuple[Index, Index]:
        """The same row by row, for arrays of so few take longer; and answers that are the one before once more."""
        rows, odd, same, ends = new.loose.rows, [], [], self._asked
        columns = (rows.kind, rows.unit, rows.check, rows.protocol, rows.index, rows.request)
        values = zip(new.asker.tolist(), *(column.tolist() for column in columns), strict=True)
        marks = marks_of(new).tolist()
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
        lane = lanes_of(new)
        whole = (lane != NO_LANE).nonzero()[0]
        order = whole[np.argsort(lane[whole], kind="stable")]
        if not len(order):
            return order, order
        marks = marks_of(new)[order]
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


def _moved(new: PairedRows, same: Index, past: list[PairedRows]) -> Index:
    """Of answers that are the one before once more, to another request: those whose polls held something else, and
    telling ones to polls of which nothing is known."""
    before = sum(len(part.asker) for part in past)
    every = PairedRows.joined([*past, new])
    rows = every.loose.rows
    lane, marks = lanes_of(every), marks_of(every)
    order = np.argsort(lane, kind="stable")
    paired = (lane[order][1:] == lane[order][:-1]) & (rows.kind[order][:-1] == _REQUEST)
    paired &= (rows.kind[order][1:] == _RESPONSE) & (lane[order][1:] != NO_LANE)
    answers, asked = order[1:][paired], order[:-1][paired]
    polls = lane[answers] << 32 | marks[asked]
    place = np.lexsort((answers, polls))
    answers, polls = answers[place], polls[place]
    moved = (polls[1:] == polls[:-1]) & (marks[answers[1:]] != marks[answers[:-1]])
    moved &= answers[1:] - answers[:-1] < HISTORY
    found: Index = np.intersect1d(answers[1:][moved] - before, same)
    first = np.intersect1d(answers[np.append(True, polls[1:] != polls[:-1])] - before, same)
    return np.union1d(found, first[[telling(words_of(new.loose.bytes_of(row))) for row in first.tolist()]])
