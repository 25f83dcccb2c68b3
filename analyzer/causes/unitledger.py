"""What happened to the exchanges of one unit: counters, spells, a few samples with their bytes."""

from __future__ import annotations

from collections import Counter
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..tables.schema import NO_GAP
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


class UnitLedger:
    """One unit's exchanges."""

    unit: int
    outcomes: NDArray[np.int64]
    _counts: list[int] | None
    repeats: int
    strays: int
    unfit: int
    late: int
    doubles: int
    marked: int
    marked_bytes: int
    examples: dict[int, list[int]]
    redundant: Thinned
    heeded: Thinned
    redundant_pauses: Thinned
    last_pauses: Thinned
    redundant_turns: Thinned
    pauses: Thinned
    turns: Thinned
    echoes: int
    echo_strays: int
    echo_delays: Thinned
    echo_waits: Thinned
    strayed: int
    called: int
    behind: int
    first_answer: int | None
    first_again: int | None
    first: int
    last: int
    delays: Thinned
    waits: Thinned
    plain_waits: Thinned
    quiet_waits: Thinned
    quiet_again: Thinned
    garbage_waits: Thinned
    garbage_again: Thinned
    gaps: Thinned
    holes: Thinned
    hole_places: Counter[int]
    silences: Spells
    silences_but_echoes: Spells
    silences_but_tried: Spells
    silences_of_others: Spells
    refusals: Spells
    busy: int
    samples: Samples
    followed: Samples

    def __init__(self, unit: int) -> None:
        self.unit = unit
        self.outcomes = np.zeros(len(Ending), np.int64)
        self._counts = None  # the same, once somebody asks
        self.repeats = 0  # requests to it that repeat the one before
        self.strays = 0  # right answers of it that answer nothing, while another unit is asked
        self.unfit = 0  # and that stand where its answer was due, and are another
        self.late = 0  # that came when the master had gone on
        self.doubles = 0  # that came behind another answer to the same request
        self.marked = 0  # answers, right but for marks of the UART
        self.marked_bytes = 0
        self.examples = {}  # by outcome: indices of a few requests
        self.redundant = Thinned()  # ns, delays of good answers whose request the master repeats all the same
        self.heeded = Thinned()  # and of those whose request it does not repeat
        self.redundant_pauses = Thinned()  # ns, from the end of such an answer to the request's repetition
        self.last_pauses = Thinned()  # ns, from the end of a good answer to the last repetition to what is asked then
        self.redundant_turns = Thinned()  # ns, from their requests to the repetition, of the same
        self.pauses = Thinned()  # ns, from its good answers to the next request
        self.turns = Thinned()  # ns, from a request that is well answered to the next one
        self.echoes = 0  # answers that are their request once more
        self.echo_strays = 0  # right answers of it to nothing, or late, that could be requests as well
        self.echo_delays = Thinned()
        self.echo_waits = (
            Thinned()
        )  # ns, from a request without an answer to the same once more, where that may answer it
        self.strayed = 0  # requests without an answer behind which a byte strayed
        self.called = 0  # broadcasts that it answered, by its own address
        self.behind = 0  # good answers with something behind them before the next request
        self.first_answer = None
        self.first_again = None  # the first of its good answers whose request is repeated all the same
        self.first = 0  # ns or bytes: `Ledger.axis`
        self.last = 0
        self.delays = Thinned()  # ns
        self.waits = Thinned()  # ns, of requests that stayed without an answer, to the next request
        self.plain_waits = Thinned()  # and of those that cannot have been answered by the next one
        self.quiet_waits = Thinned()  # and of those behind which nothing at all came
        self.quiet_again = Thinned()  # and of those that the next request repeats
        self.garbage_waits = Thinned()
        self.garbage_again = Thinned()  # and of those whose request the master repeats next
        self.gaps = Thinned()  # ns, silence between a request and its answer by the reads
        self.holes = Thinned()  # ns, the longest silence inside an answer
        self.hole_places = Counter()
        self.silences = Spells()
        self.silences_but_echoes = Spells()  # as if there were no answers that are their request once more
        self.silences_but_tried = Spells()  # and no such answers to a request that comes several times
        self.silences_of_others = Spells()  # of requests whose answer reads otherwise than they
        self.refusals = Spells()
        self.busy = 0
        self.samples = Samples()  # without a good answer
        self.followed = Samples()  # with one, and something behind it

    def count(self, *outcomes: Ending) -> int:
        """How many requests to it ended so."""
        if self._counts is None:
            self._counts = self.outcomes.tolist()
        total = 0
        for outcome in outcomes:  # suspects ask thousands of times: half the price of `sum` over a generator
            total += self._counts[outcome]
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

    def add(self, mine: Exchanges, times: NDArray[np.int64], *, timed: bool, hole_ns: float) -> None:
        """Count its next exchanges; `times` tell their order, `timed` whether as time. Silences over `hole_ns` are
        holes in an answer."""
        outcome = mine.outcome
        counts = np.bincount(outcome, minlength=len(Ending))
        if not self.outcomes.any():
            self.first = int(times[0])
        self.outcomes += counts
        self._counts = None
        self.last = int(times[-1])
        self.repeats += int(np.count_nonzero(mine.repeats))
        for kind in counts.nonzero()[0].tolist():
            few = self.examples.setdefault(kind, [])
            if len(few) < _EXAMPLES:
                few += mine.request[outcome == kind][: _EXAMPLES - len(few)].tolist()
        good = (outcome == _OK) | (outcome == _EXCEPTION)
        every = int(counts[_OK] + counts[_EXCEPTION])
        if every:
            if self.first_answer is None:
                self.first_answer = int(times[np.argmax(good)])
            whole = every == len(mine)
            self._add_answers(
                mine if whole else mine[good], times if whole else times[good], timed=timed, hole_ns=hole_ns
            )
        if counts[_SILENT]:
            self.strayed += int(np.count_nonzero((outcome == _SILENT) & (mine.noise > 0)))
        if counts[_SILENT] or counts[_GARBAGE] or self.silences_but_echoes.is_open:
            heard = (outcome != _UNHEARD) & (outcome != _ECHO)  # nor does what a tap shows of its own end a silence
            _count_silences(self.silences, mine, times, heard)
            echoes = _are_echoes(mine)
            _count_silences(self.silences_but_echoes, mine, times, heard & ~echoes)
            _count_silences(self.silences_but_tried, mine, times, heard & ~(echoes & (mine.repeats | mine.next_same)))
            _count_silences(self.silences_of_others, mine, times, heard & ~ECHOED[mine.function])
        elif every:
            self.silences.pass_over(int(times[-1]))
            self.silences_but_echoes.pass_over(int(times[-1]))
            self.silences_but_tried.pass_over(int(times[-1]))
            self.silences_of_others.pass_over(int(times[-1]))
        if counts[_EXCEPTION] or self.refusals.is_open:
            busy = BUSY[mine.exception]
            self.busy += int(np.count_nonzero(busy))
            self.refusals.add(busy, times)
        if timed and counts[_SILENT] + counts[_GARBAGE]:
            waits = mine.t_next - mine.t_asked
            known = mine.t_next != NEVER
            silent = known & (outcome == _SILENT)
            self.waits.add(waits[silent])
            echo = mine.next_echoed | (ECHOED[mine.function] & mine.repeats)  # one of the two may be an answer, late
            quiet = silent & (mine.late + mine.strays + mine.noise == 0) & ~echo
            self.quiet_waits.add(waits[quiet])
            self.quiet_again.add(waits[quiet & mine.next_same])
            again = silent & ECHOED[mine.function] & mine.next_same
            self.echo_waits.add(waits[again])
            self.plain_waits.add(waits[silent & ~again])
            garbage = known & (outcome == _GARBAGE)
            self.garbage_waits.add(waits[garbage])
            self.garbage_again.add(waits[garbage & mine.next_same])

    def add_echo(self, delay_ns: int) -> None:
        """Count an answer that is not the one to the request before it, and reads like a request; `delay_ns`: behind one
        that stayed without an answer, else -1."""
        self.echo_strays += 1
        if delay_ns >= 0:
            self.echo_delays.add(np.array((delay_ns,)))

    def _add_answers(self, good: Exchanges, times: NDArray[np.int64], *, timed: bool, hole_ns: float) -> None:
        delays, noise, strays = good.delay, good.noise, good.strays
        known, again = delays >= 0, good.next_same
        self.delays.add(delays[known])
        if again.any():
            self.redundant.add(delays[known & again])
            if self.first_again is None:
                self.first_again = int(times[np.argmax(again)])
        self.heeded.add(delays[known & ~again])
        alone = (noise == 0) & (strays == 0)
        self.behind += len(good) - int(np.count_nonzero(alone))
        if timed:
            t_next = good.t_next
            followed = alone & (t_next != NEVER)
            self.pauses.add((t_next - good.t_answered)[followed])
            self.turns.add((t_next - good.t_asked)[followed])
            if again.any():
                self.redundant_pauses.add((t_next - good.t_answered)[followed & again])
                self.redundant_turns.add((t_next - good.t_asked)[followed & again])
            if good.repeats.any():
                self.last_pauses.add((t_next - good.t_answered)[followed & good.repeats & ~again])
        marks = good.marks
        if marks.any():
            self.marked += int(np.count_nonzero(marks))
            self.marked_bytes += int(marks.sum())
        echoes = _are_echoes(good)
        if echoes.any():
            self.echoes += int(np.count_nonzero(echoes))
            self.echo_delays.add(delays[known & echoes])
        gaps, holes = good.answer_gap, good.hole
        self.gaps.add(gaps[gaps != NO_GAP])
        self.holes.add(holes)
        long = holes > hole_ns
        if long.any():
            self.hole_places.update(good.hole_at[long].tolist())


def _are_echoes(mine: Exchanges) -> NDArray[np.bool_]:
    """Which exchanges are answered by what reads like their request once more."""
    found: NDArray[np.bool_] = ECHOED[mine.function] & (mine.outcome == _OK) & (mine.answer_bytes == mine.asked_bytes)
    return found


def _count_silences(spells: Spells, mine: Exchanges, times: NDArray[np.int64], counted: NDArray[np.bool_]) -> None:
    """Those of these exchanges that count, into spells of silence."""
    outcome = mine.outcome[counted]
    spells.add(outcome == _SILENT, times[counted], outcome == _GARBAGE, mine.repeats[counted])
