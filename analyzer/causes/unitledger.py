"""What happened to the exchanges of one unit: counters, spells, a few samples with their bytes."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ..tables.schema import NO_GAP, Bools, Int64s
from ..tables.transactions import ECHOED, NEVER
from .exchanges import Ending, Exchanges
from .flatmemory import Spells, Thinned
from .samples import Samples

_EXAMPLES: Final = 3
_SEVERAL: Final = 5
AT_ONCE_NS: Final = 40e6
_OK, _EXCEPTION, _SILENT, _GARBAGE, _UNHEARD, _ECHO = (
    int(each) for each in (Ending.OK, Ending.EXCEPTION, Ending.SILENT, Ending.GARBAGE, Ending.UNHEARD, Ending.ECHO)
)
BUSY: Final = np.isin(np.arange(256), (5, 6))  # acknowledge, server device busy


@dataclass(slots=True, eq=False)
class UnitLedger:
    """One unit's exchanges; times in ns."""

    unit: int
    outcomes: Int64s = field(default_factory=lambda: np.zeros(len(Ending), np.int64))
    repeats: int = 0  # requests to it that repeat the one before
    strays: int = 0  # right answers of it that answer nothing, while another unit is asked
    unfit: int = 0  # and that stand where its answer was due, and are another
    late: int = 0  # that came when the master had gone on
    doubles: int = 0  # that came behind another answer to the same request
    marked: int = 0  # answers, right but for marks of the UART
    marked_bytes: int = 0
    echoes: int = 0  # answers that are their request once more
    echo_strays: int = 0  # right answers of it to nothing, or late, that could be requests as well
    strayed: int = 0  # requests without an answer behind which a byte strayed
    called: int = 0  # broadcasts that it answered, by its own address
    behind: int = 0  # good answers with something behind them before the next request
    busy: int = 0
    first_again: int | None = None  # the first of its good answers whose request is repeated all the same
    first: int = 0  # ns, or bytes where there are no times
    last: int = 0
    examples: dict[int, list[int]] = field(default_factory=dict)  # by outcome: indices of a few requests
    delays: Thinned = field(default_factory=Thinned)  # of its good answers
    redundant: Thinned = field(default_factory=Thinned)  # of answers whose request the master repeats all the same
    heeded: Thinned = field(default_factory=Thinned)  # and of those whose request it does not repeat
    echo_delays: Thinned = field(default_factory=Thinned)
    pauses: Thinned = field(default_factory=Thinned)  # from its good answers to the next request
    redundant_pauses: Thinned = field(default_factory=Thinned)  # and to the repetition of their request
    last_pauses: Thinned = field(default_factory=Thinned)  # and of answers to its last repetition to what is asked then
    turns: Thinned = field(default_factory=Thinned)  # from a request that is well answered to the next one
    redundant_turns: Thinned = field(default_factory=Thinned)  # and to its repetition
    waits: Thinned = field(default_factory=Thinned)  # of requests that stayed without an answer, to the next request
    plain_waits: Thinned = field(default_factory=Thinned)  # and of those that cannot have been answered by the next one
    echo_waits: Thinned = field(default_factory=Thinned)  # and of those that it repeats, and may answer
    quiet_waits: Thinned = field(default_factory=Thinned)  # and of those behind which nothing at all came
    quiet_again: Thinned = field(default_factory=Thinned)  # and of these that the next request repeats
    garbage_waits: Thinned = field(default_factory=Thinned)
    garbage_again: Thinned = field(default_factory=Thinned)  # and of those whose request the master repeats next
    gaps: Thinned = field(default_factory=Thinned)  # silence between a request and its answer by the reads
    holes: Thinned = field(default_factory=Thinned)  # the longest silence inside an answer
    hole_places: Counter[int] = field(default_factory=Counter)
    silences: Spells = field(default_factory=Spells)
    silences_but_echoes: Spells = field(
        default_factory=Spells
    )  # as if there were no answers that are their request once more
    silences_but_tried: Spells = field(
        default_factory=Spells
    )  # and no such answers to a request that comes several times
    silences_of_others: Spells = field(default_factory=Spells)  # of requests whose answer reads otherwise than they
    refusals: Spells = field(default_factory=Spells)
    samples: Samples = field(default_factory=Samples)  # without a good answer
    followed: Samples = field(default_factory=Samples)  # with one, and something behind it
    _counts: list[int] = field(default_factory=list)  # `outcomes`, once somebody asks

    def count(self, *outcomes: Ending) -> int:
        """How many requests to it ended so."""
        counts = self._counts = self._counts or self.outcomes.tolist()
        total = 0
        for outcome in outcomes:  # suspects ask thousands of times: half the price of `sum` over a generator
            total += counts[outcome]
        return total

    @property
    def asked(self) -> int:
        """Requests to it of which something is known."""
        return self.count(Ending.OK, Ending.EXCEPTION, Ending.SILENT, Ending.GARBAGE)

    @property
    def echoes_itself(self) -> bool:
        """Whether what reads like requests that come again comes sooner than any master gives up: two devices of one
        address each take the other's answer for a request, where it reads like one."""
        waits = self.echo_waits
        return len(waits) >= _SEVERAL and waits.total < AT_ONCE_NS * len(waits)

    @property
    def loose(self) -> int:
        """Right answers of it that are not those to the request before them."""
        return self.strays + self.unfit + self.late + self.doubles

    @property
    def answered(self) -> int:
        """Requests that got a whole answer; an exception is one."""
        return self.count(Ending.OK, Ending.EXCEPTION)

    def add(self, mine: Exchanges, times: Int64s, *, timed: bool, hole_ns: float) -> None:
        """Count its next exchanges; `times` tell their order, `timed` whether as time. Silences over `hole_ns` are
        holes in an answer."""
        outcome = mine.outcome
        counts = np.bincount(outcome, minlength=len(Ending))
        if not self.outcomes.any():
            self.first = int(times[0])
        self.outcomes += counts
        self._counts = []
        self.last = int(times[-1])
        self.repeats += int(np.count_nonzero(mine.repeats))
        for kind in counts.nonzero()[0].tolist():
            few = self.examples.setdefault(kind, [])
            if len(few) < _EXAMPLES:
                few += mine.request[outcome == kind][: _EXAMPLES - len(few)].tolist()
        answered = int(counts[_OK] + counts[_EXCEPTION])
        if answered == len(mine):
            self._add_answers(mine, times, timed=timed, hole_ns=hole_ns)
        elif answered:
            good = outcome <= _EXCEPTION
            self._add_answers(mine[good], times[good], timed=timed, hole_ns=hole_ns)
        spells = (self.silences, self.silences_but_echoes, self.silences_but_tried, self.silences_of_others)
        if counts[_SILENT] or counts[_GARBAGE] or self.silences_but_echoes.is_open:
            self._add_silences(mine, times, spells)
        elif answered:
            for each in spells:
                each.pass_over(int(times[-1]))
        if counts[_EXCEPTION] or self.refusals.is_open:
            busy = BUSY[mine.exception]
            self.busy += int(np.count_nonzero(busy))
            self.refusals.add(busy, times, np.zeros_like(busy), mine.repeats)
        if timed and counts[_SILENT] + counts[_GARBAGE]:
            self._add_waits(mine)

    def _add_silences(self, mine: Exchanges, times: Int64s, spells: tuple[Spells, ...]) -> None:
        outcome = mine.outcome
        self.strayed += int(np.count_nonzero((outcome == _SILENT) & (mine.noise > 0)))
        heard = (outcome != _UNHEARD) & (outcome != _ECHO)  # what a tap shows of its own ends no silence
        echoes = _are_echoes(mine)
        but = (np.zeros_like(echoes), echoes, echoes & (mine.repeats | mine.next_same), ECHOED[mine.function])
        for each, left_out in zip(spells, but, strict=True):
            which = heard & ~left_out
            ended = outcome[which]
            each.add(ended == _SILENT, times[which], ended == _GARBAGE, mine.repeats[which])

    def _add_waits(self, mine: Exchanges) -> None:
        waits, again, may_answer = mine.t_next - mine.t_asked, mine.next_same, ECHOED[mine.function]
        known = mine.t_next != NEVER
        silent, garbage = known & (mine.outcome == _SILENT), known & (mine.outcome == _GARBAGE)
        echo = mine.next_echoed | (may_answer & mine.repeats)  # one of the two may be an answer, late
        quiet = silent & (mine.late + mine.strays + mine.noise == 0) & ~echo
        doubtful = silent & may_answer & again
        for those, which in (
            (self.waits, silent), (self.plain_waits, silent & ~doubtful), (self.echo_waits, doubtful),
            (self.quiet_waits, quiet), (self.quiet_again, quiet & again),
            (self.garbage_waits, garbage), (self.garbage_again, garbage & again),
        ):  # fmt: skip
            those.add(waits[which])

    def add_echo(self, delay_ns: int) -> None:
        """Count an answer that is not the one to the request before it, and reads like a request; `delay_ns`: behind one
        that stayed without an answer, else -1."""
        self.echo_strays += 1
        if delay_ns >= 0:
            self.echo_delays.add(np.array((delay_ns,)))

    def _add_answers(self, good: Exchanges, times: Int64s, *, timed: bool, hole_ns: float) -> None:
        delays, again, repeated = good.delay, good.next_same, bool(good.next_same.any())
        known, alone = delays >= 0, (good.noise == 0) & (good.strays == 0)
        self.delays.add(delays[known])
        self.heeded.add(delays[known & ~again])
        self.behind += len(good) - int(np.count_nonzero(alone))
        if repeated:
            self.redundant.add(delays[known & again])
            if self.first_again is None:
                self.first_again = int(times[np.argmax(again)])
        if timed:
            followed = alone & (good.t_next != NEVER)
            pauses, turns = good.t_next - good.t_answered, good.t_next - good.t_asked
            self.pauses.add(pauses[followed])
            self.turns.add(turns[followed])
            if repeated:
                self.redundant_pauses.add(pauses[followed & again])
                self.redundant_turns.add(turns[followed & again])
            if good.repeats.any():
                self.last_pauses.add(pauses[followed & good.repeats & ~again])
        self.marked += int(np.count_nonzero(good.marks))
        self.marked_bytes += int(good.marks.sum())
        echoes = _are_echoes(good)
        if echoes.any():
            self.echoes += int(np.count_nonzero(echoes))
            self.echo_delays.add(delays[known & echoes])
        gaps, holes = good.answer_gap, good.hole
        self.gaps.add(gaps[gaps != NO_GAP])
        self.holes.add(holes)
        self.hole_places.update(good.hole_at[holes > hole_ns].tolist())


def _are_echoes(mine: Exchanges) -> Bools:
    """Which exchanges are answered by what reads like their request once more."""
    found: Bools = ECHOED[mine.function] & (mine.outcome == _OK) & (mine.answer_bytes == mine.asked_bytes)
    return found
