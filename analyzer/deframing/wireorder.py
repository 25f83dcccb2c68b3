"""Rows of several ports in the order of the wire.

Two taps are two clocks: reads return late, by up to 16 ms behind a USB adapter, and clocks are set apart. On a healthy
bus heard by two adapters every second answer seems to come before its request. Where each of two ports carries one
direction the bytes tell the order: the next answer belongs to the newest request if it fits that one, and comes before
the next request. Clocks decide only what lies further apart than they can be wrong (`horizon_ns`), which is measured:
a byte a read tells how far a tap's times stray.

What is decided hangs on rows and their times alone, never on how they were fed: the row that was heard first is placed
when all that was heard within the horizon behind it is known.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from captures.line import LineSettings
from dissectors.lengths import Expectation, expectation

from ..tables.batch import adu_of
from ..tables.schema import Kind, Protocol, Row
from .clockskew import MOST_NS, ClockSkew, TapClocks
from .directions import certain_frames, either_way, said_directions, settled_directions
from .segments import UnorderedRows

_SETTLE_FRAMES: Final = 32  # by which directions are settled
_SETTLE_NS: Final = 2_000_000_000  # or those heard in this time
_AHEAD_NS: Final = 32_000_000  # that an answer may seem to come before its request
_EVER: Final = -(1 << 62)
_REQUEST: Final = int(Kind.REQUEST)


class Across(NamedTuple):
    """Of rows in wire order: which answers (mask) belong to requests of `requests`' port, and what times carry."""

    answers: NDArray[np.bool_]
    requests: int
    unsure_ns: NDArray[np.int64]  # response times up to this may be the clocks' doing

    def of(self, which: NDArray[Any]) -> Across:
        """The same of some rows."""
        return Across(self.answers[which], self.requests, self.unsure_ns[which])

    def behind(self, count: int) -> Across:
        """The same behind so many rows of a time when there was one port."""
        return Across(np.pad(self.answers, (count, 0)), self.requests, np.pad(self.unsure_ns, (count, 0)))


class _NewestRequest(NamedTuple):
    """A right request as it was decided, and when the read that brought its first byte returned."""

    port: int
    protocol: int
    captured: bytes
    heard_ns: int
    t_end_ns: int


class WireOrder:
    """Takes rows of ports as they are decided, gives them in order as that becomes certain."""

    _ports: list[int]
    _since: int | None
    _first_ns: list[int]
    _alone: bool
    _held: UnorderedRows
    _directions: tuple[int, int] | None
    _settled: bool
    _newest: _NewestRequest | None
    _merge: _Merge

    def __init__(self, line: LineSettings) -> None:
        self._ports = []  # as they came
        self._since = None  # ns: when there were two; what was heard before is of one port
        self._first_ns = []  # when each was heard first
        self._alone = False  # the first one was given as it came
        self._held = UnorderedRows.nothing()
        self._directions = said_directions(line)
        self._settled = self._directions is not None
        self._newest = None  # the row before there were two, where it is one
        self._merge = _Merge()

    @property
    def skew(self) -> ClockSkew | None:
        """What is known of two taps' clocks; None where there are no two, or nothing is known."""
        return self._merge.clocks.skew if self._directions is not None else None

    @property
    def since_ns(self) -> int | None:
        """Since when there are two ports; None while there is one."""
        return self._since

    def joins(self, port: int, first_ns: int) -> None:
        """A port is heard for the first time."""
        self._ports.append(port)
        self._first_ns.append(first_ns)
        if self._settled:
            self._since = _EVER
        elif self._alone and len(self._ports) == 2:
            self._since = first_ns

    def put_in_order(self, parts: Sequence[UnorderedRows], until: int | None) -> tuple[UnorderedRows, Across | None]:
        """Rows whose places are certain, with more of them; all that was heard before `until` is known (None: all)."""
        if self._since is None:
            loose = UnorderedRows.joined([self._held, *parts])
            alone_ns = 0 if self._alone else self._alone_from(loose, until)
            if alone_ns is None:
                self._held = loose
                return UnorderedRows.nothing(), None
            if len(self._ports) < 2:
                self._alone, self._held = True, UnorderedRows.nothing()
                self._remember(loose, len(loose.rows) - 1)
                return loose, None
            self._since = self._first_ns[1] if self._first_ns[1] > alone_ns else _EVER
            self._held, parts = loose, ()
        loose = UnorderedRows.joined([self._held, *parts])
        heard = loose.heard
        order = np.lexsort((loose.rows.port, heard))
        known = len(order) if until is None else int(np.searchsorted(heard[order], until))
        early = min(known, int(np.searchsorted(heard[order], self._since)))  # before there was a second port
        self._remember(loose, int(order[early - 1]) if early else -1)
        if not self._settled and known > early:
            self._settle(loose, order[early:known], until)
        if not self._settled or self._directions is None:
            count = known if self._settled else early
            self._held = loose.picked(order[count:])
            return loose.picked(order[:count]), None
        if self._newest is not None:
            self._merge.begin(self._newest, self._directions[0])
            self._newest = None
        numbered = np.flatnonzero(loose.rows.protocol[order[early:known]] == Protocol.TCP)
        if len(numbered):
            until = int(heard[order[early + numbered[0]]])
        placed, unsure = self._merge.order(loose, order[early:], self._directions, until)
        self._turn(loose, placed)
        left = np.ones(len(order), np.bool_)
        left[order[:early]] = left[placed] = False
        asks, answers = self._directions
        across = np.zeros(early + len(placed), np.bool_)
        across[early:] = loose.rows.port[placed] == answers
        placed = np.concatenate((order[:early], placed))
        unsure = np.concatenate((np.zeros(early, np.int64), unsure))
        if len(numbered):
            self._directions = None  # transactions are numbered from here on, and several may be open
            rest = order[:known][left[order[:known]]]
            left[rest] = False
            placed = np.concatenate((placed, rest))
            across, unsure = np.pad(across, (0, len(rest))), np.pad(unsure, (0, len(rest)))
        self._held = loose.picked(order[left[order]])
        return loose.picked(placed), Across(across, asks, unsure)

    def _alone_from(self, loose: UnorderedRows, until: int | None) -> int | None:
        """When the first port had been heard so long, or in both directions, that it is no half of a pair."""
        if not self._ports:
            return None
        certain = certain_frames(loose.rows) & (loose.rows.port == self._ports[0])
        heard = [loose.heard[certain & (loose.rows.kind == kind)] for kind in (Kind.REQUEST, Kind.RESPONSE)]
        alone_ns = self._first_ns[0] + MOST_NS
        if all(map(len, heard)):
            alone_ns = min(alone_ns, max(int(times[0]) for times in heard))
        return alone_ns if until is None or alone_ns < until else None

    def _remember(self, loose: UnorderedRows, newest: int) -> None:
        """Keep the newest row that was heard before there was a second port; -1: there is none."""
        if newest < 0:
            return
        rows, self._newest = loose.rows, None
        if rows.kind.item(newest) == _REQUEST and rows.unit.item(newest) and rows.check.item(newest):
            self._newest = _NewestRequest(
                rows.port.item(newest),
                rows.protocol.item(newest),
                loose.bytes_of(newest),
                loose.heard.item(newest),
                rows.t_end_ns.item(newest),
            )

    def _settle(self, loose: UnorderedRows, order: NDArray[np.intp], until: int | None) -> None:
        """Settle directions by the first frames, once there are enough of them."""
        begin = int(loose.heard[order[0]])
        frames = order[(loose.rows.kind[order] != Kind.NOISE) & (loose.heard[order] <= begin + _SETTLE_NS)]
        if len(frames) < _SETTLE_FRAMES and until is not None and until <= begin + _SETTLE_NS:
            return
        first, second = self._ports[:2]
        self._settled = True
        rows = loose.rows[frames[:_SETTLE_FRAMES]]
        if not (rows.protocol == Protocol.TCP).any():
            self._directions = settled_directions(rows, loose.data, (first, second))

    def _turn(self, loose: UnorderedRows, which: NDArray[np.intp]) -> None:
        """What reads alike in both directions goes the way of its port."""
        assert self._directions is not None
        kinds = dict(zip(self._directions, (Kind.REQUEST, Kind.RESPONSE), strict=True))
        for port, kind in kinds.items():
            mine = which[(loose.rows.port[which] == port) & (loose.rows.kind[which] != kind)]
            mine = mine[either_way(loose.rows[mine])]
            loose.rows.kind[mine] = kind


class _Head(NamedTuple):
    """The next frame of a port, and where in its list it stands: noise before it goes with it."""

    place: int
    row: int


class _Merge:
    """Puts the rows of two ports of one direction each, and of any others, in order."""

    clocks: TapClocks
    _asked: Expectation | None
    _asked_ns: tuple[int, int]
    _answered_ns: int | None
    _loose: UnorderedRows
    _rows: list[Row]
    _heard: list[int]

    def __init__(self) -> None:
        self.clocks = TapClocks()
        self._asked = None  # the newest request, unless it was answered
        self._asked_ns = (0, 0)  # when it was heard, when it ended
        self._answered_ns = None  # when the newest answer ended
        self._loose, self._rows, self._heard = UnorderedRows.nothing(), [], []  # of the call in progress

    def order(
        self, loose: UnorderedRows, which: NDArray[np.intp], ports: tuple[int, int], until: int | None
    ) -> tuple[NDArray[np.intp], NDArray[np.int64]]:
        """Of rows (places in `loose`, as heard) those that can be placed, and how unsure times are at each."""
        rows = loose.rows[which]
        self._loose = loose
        self._rows = [Row(*values) for values in rows.tolist()]
        self._heard = loose.heard[which].tolist()
        lanes: list[list[int]] = [[], [], []]
        lane_of = {ports[0]: 0, ports[1]: 1}
        for i, row in enumerate(self._rows):
            lanes[lane_of.get(row.port, 2)].append(i)
        at = [0, 0, 0]
        placed: list[int] = []
        unsure: list[int] = []
        while any(at[lane] < len(lanes[lane]) for lane in range(3)):
            begin = min(self._heard[lanes[lane][at[lane]]] for lane in range(3) if at[lane] < len(lanes[lane]))
            horizon = begin + self.clocks.horizon_ns
            if until is not None and horizon >= until:
                break
            lane, upto = self._next(lanes, at, horizon)
            for i in lanes[lane][at[lane] : upto]:
                self._place(i, lane)
                placed.append(i)
                unsure.append(self.clocks.unsure_ns)
            at[lane] = upto
        return which[np.array(placed, np.intp)], np.array(unsure, np.int64)

    def begin(self, newest: _NewestRequest, requests: int) -> None:
        """The request before there were two ports may still be open."""
        if newest.port == requests:
            self._asked = expectation(adu_of(newest.captured, newest.protocol).data)
            self._asked_ns = (newest.heard_ns, newest.t_end_ns)

    def _next(self, lanes: list[list[int]], at: list[int], horizon: int) -> tuple[int, int]:
        """The lane that goes on, and up to where."""
        heads = [self._head(lanes[lane], at[lane], horizon) for lane in (0, 1)]
        request, answer = heads
        first = min(
            (lane for lane in range(3) if at[lane] < len(lanes[lane])),
            key=lambda lane: (self._heard[lanes[lane][at[lane]]], lane),
        )
        if first == 2 or request is None or answer is None:
            head = heads[first] if first < 2 else None
            return first, at[first] + 1 if head is None else head.place + 1
        chosen = self._choice(request.row, answer.row, self._head(lanes[1], answer.place + 1, horizon))
        if chosen is None:
            chosen = int(self._heard[answer.row] < self._heard[request.row])
        head = heads[chosen]
        assert head is not None
        return chosen, head.place + 1

    def _head(self, lane: list[int], place: int, horizon: int) -> _Head | None:
        """The next frame, if it was heard before the horizon."""
        while place < len(lane) and self._heard[lane[place]] <= horizon:
            if self._rows[lane[place]].kind != Kind.NOISE:
                return _Head(place, lane[place])
            place += 1
        return None

    def _choice(self, request: int, answer: int, second: _Head | None) -> int | None:
        """Which comes next, by what fits: 0 the request, 1 the answer, None where the times have to tell."""
        adu = self._adu(answer)
        ours = self._asked is not None and self._asked.fits(adu)
        asks = expectation(self._adu(request))
        theirs = asks.fits(adu)
        if ours == theirs:
            if not ours:
                return None
            if second is not None and asks.fits(self._adu(second.row)):
                return 1
            return self._nearer(request, answer)
        if ours:
            return 1
        ahead = self._rows[request].t_end_ns - self._rows[answer].t_start_ns
        return 0 if ahead <= _AHEAD_NS else None

    def _nearer(self, request: int, answer: int) -> int:
        """The same where the answer fits both: was the request before given up?"""
        start = self._rows[answer].t_start_ns
        here, before = start - self._rows[request].t_end_ns, start - self._asked_ns[1]
        unsure, usual = self.clocks.unsure_ns, self.clocks.usual_ns
        given_up = here >= -unsure and abs(here - usual) + unsure < abs(before - usual)
        return 0 if given_up else 1

    def _place(self, i: int, lane: int) -> None:
        """A row is placed: learn from it."""
        row = self._rows[i]
        if row.kind == Kind.NOISE or lane == 2:
            return
        self.clocks.frame(row.reads, row.length, row.gap_most_ns, row.gap_least_ns)
        start, end = row.t_start_ns, row.t_end_ns
        if lane == 0:
            if self._answered_ns is not None:
                self.clocks.went_on(start - self._answered_ns)
            adu = self._adu(i)
            self._asked = expectation(adu) if row.check and adu[0] else None
            self._asked_ns, self._answered_ns = (self._heard[i], end), None
        elif self._asked is not None and self._asked.fits(self._adu(i)):
            self.clocks.answered(start - self._asked_ns[1])
            self._asked, self._answered_ns = None, end

    def _adu(self, i: int) -> bytes:
        row = self._rows[i]
        adu = self._loose.data[row.at : row.at + row.length].tobytes()
        return adu if row.protocol == Protocol.RTU else adu_of(adu, row.protocol).data
