"""The third witness of who answers whom: rows wait where header and order alone cannot tell, until contents do.

Most answers follow their requests, and nothing is asked. An event begins a doubt (`oddities`): a request that nobody
answered, an answer in a gap, one that does not fit. From then on the paths of that unit's answers are weighed
(`doubts`, `queues`), with what its polls held so far (`contents`), until one leads and stands where it should. Rows are
given when the answers before them are settled, and never revised; what cannot be settled within some frames or seconds
is unsure.

What is decided hangs on rows and their times alone, not on how they were fed.
"""

from __future__ import annotations

from collections import defaultdict, deque

import numpy as np

from .doubts import Doubt, DoubtWalk
from .oddities import HISTORY, Oddities, OddRows
from .pairedrows import Lane, PairedRows, lanes_of
from .queues import UnitHabit
from .segments import UnorderedRows
from .wireorder import Across


class _GivenRows:
    """The last of the rows that were given, those that may be looked at: joined only when they are, since live they
    come by twos."""

    _parts: deque[PairedRows]
    _count: int

    def __init__(self) -> None:
        self._parts = deque()
        self._count = 0

    def add(self, rows: PairedRows) -> None:
        """More of them; whole parts that lie too far back go."""
        self._parts.append(rows)
        self._count += len(rows.asker)
        while self._count - len(self._parts[0].asker) >= HISTORY:
            self._count -= len(self._parts.popleft().asker)

    def all(self) -> PairedRows:
        """As one part."""
        if len(self._parts) > 1:
            every = PairedRows.joined([*self._parts])
            self.restart(every.cut(max(len(every.asker) - HISTORY, 0), len(every.asker)))
        return self._parts[0] if self._parts else PairedRows.of(UnorderedRows.nothing(), None)

    def restart(self, rows: PairedRows) -> None:
        """These alone."""
        self._parts, self._count = deque([rows]), len(rows.asker)


class AnswerWitness:
    """Rows paired by header in, and out again as soon as it is settled whose each answer is, or that nobody knows."""

    _given: _GivenRows
    _held: PairedRows
    _doubts: dict[Lane, Doubt]
    _habits: dict[Lane, UnitHabit]
    _oddities: Oddities
    _earlier: dict[int, bytes]
    _latest_ns: int

    def __init__(self) -> None:
        self._given = _GivenRows()
        self._held = PairedRows.of(UnorderedRows.nothing(), None)
        self._doubts = {}
        self._habits = {}
        self._oddities = Oddities()
        self._earlier = {}
        self._latest_ns = -(1 << 62)

    def settle(
        self, loose: UnorderedRows, across: Across | None, earlier: dict[int, bytes], until: int | None, *, timed: bool
    ) -> tuple[UnorderedRows, dict[int, bytes]]:
        """More rows; gives those that are settled, with the bytes of requests before them that they answer.

        All that was heard before `until` (ns) is known; None: all.
        """
        new = PairedRows.of(loose, across)
        held = len(self._held.asker) > 0
        if not len(new.asker) and not held:
            return loose, earlier
        odd = self._oddities.found(new, lambda: [self._given.all(), self._held])
        if not len(odd.odd) and not self._doubts and not held and not self._may_repeat(new, odd):
            self._remember(new)
            return loose, earlier
        self._earlier |= earlier
        past = self._given.all()
        work = PairedRows.joined([past, self._held, new])
        before = len(past.asker)
        walk = DoubtWalk(work, self._doubts, self._habits, timed=timed, latest_ns=self._latest_ns)
        begin = before + len(self._held.asker)
        walk.go_through_rows(odd, begin)
        self._latest_ns = walk.latest_ns
        walk.close(until)
        certain = walk.certain(before)
        given = work.cut(before, certain)
        self._held = work.cut(certain, len(work.asker))
        bytes_before = self._requests_before(given.loose, work)
        self._given.restart(work.cut(max(certain - HISTORY, 0), certain))
        if not len(self._held.asker):
            self._earlier = {}
        return given.loose, bytes_before

    def _may_repeat(self, new: PairedRows, odd: OddRows) -> bool:
        """Whether answers that are the ones before once more may be no answers to their requests."""
        same, moved = (np.unique(lanes_of(new)[rows]).tolist() for rows in (odd.same, odd.moved))
        habits = defaultdict(UnitHabit, self._habits)
        return any(habits[lane].doubles for lane in same) or not all(habits[lane].alike for lane in moved)

    def _remember(self, rows: PairedRows) -> None:
        if not len(rows.asker):
            return
        self._given.add(rows)
        frames = rows.loose.rows.kind.nonzero()[0]
        if len(frames):
            self._latest_ns = max(self._latest_ns, int(rows.loose.rows.t_start_ns[frames].max()))

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
