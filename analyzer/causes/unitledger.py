"""What happened to the exchanges of one unit: counters, spells, a few samples with their bytes, and its rows of the table."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ..tables.schema import NO_GAP, Bools, Int64s
from ..tables.transactions import ECHOED
from .exchanges import Ending, Exchanges
from .exchangetable import AskedRows, ExchangeTable
from .flatmemory import Spells, Thinned
from .samples import Samples

_EXAMPLES: Final = 3
_SEVERAL: Final = 5
AT_ONCE_NS: Final = 40e6
BUSY: Final = np.isin(np.arange(256), (5, 6))  # acknowledge, server device busy
_OF_WAIT: Final = ("wait", "rested")


class UnitFigures:
    """A figure of some exchanges of a unit, as far as it is known; read once, until more come."""

    def __init__(self, figure: str, of: Callable[[AskedRows], Bools], unknown: int = NO_GAP) -> None:
        self._figure, self._of, self._unknown = figure, of, unknown

    def __set_name__(self, _: type[UnitLedger], name: str) -> None:
        self._name = name

    def __get__(self, unit: UnitLedger, _: type[UnitLedger]) -> Thinned:
        return unit.table.known((unit.unit, self._name), lambda: self._read(unit.table, unit.table.of(unit.unit)))

    def _read(self, table: ExchangeTable, rows: AskedRows) -> Thinned:
        by_wait = self._figure in _OF_WAIT
        known = (rows.wait if by_wait else rows.column(self._figure)) > self._unknown
        return table.numbers(rows[self._of(rows) & known & (table.timed or not by_wait)], self._figure)


def _followed(rows: AskedRows) -> Bools:
    return rows.good & rows.alone


def _silent(rows: AskedRows) -> Bools:
    found: Bools = rows.outcome == Ending.SILENT
    return found


def _quiet(rows: AskedRows) -> Bools:
    """Behind which nothing at all came, and neither of which the next one is an answer."""
    echo = rows.next_echoed | (ECHOED[rows.function] & rows.repeats)  # one of the two may be an answer, late
    return _silent(rows) & ~rows.odd & ~echo


@dataclass(slots=True, eq=False)
class UnitLedger:
    """One unit's exchanges; times in ns."""

    unit: int
    table: ExchangeTable = field(default_factory=ExchangeTable)  # of the bus
    outcomes: Int64s = field(default_factory=lambda: np.zeros(len(Ending), np.int64))
    repeats: int = 0  # requests to it that repeat the one before
    strays: int = 0  # right answers of it that answer nothing, while another unit is asked
    unfit: int = 0  # and that stand where its answer was due, and are another
    unfit_alone: int = 0  # requests to it behind which nothing else came
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
    first: int = 0  # ns, or bytes where there are no times
    last: int = 0
    examples: dict[int, list[int]] = field(default_factory=dict)  # by outcome: indices of a few requests
    echo_delays: Thinned = field(default_factory=Thinned)
    silences: Spells = field(default_factory=Spells)
    silences_but_echoes: Spells = field(default_factory=Spells)  # as if no answers were their request once more,
    silences_of_others: Spells = field(default_factory=Spells)  # of requests whose answer reads otherwise than they
    refusals: Spells = field(default_factory=Spells)
    samples: Samples = field(default_factory=Samples)  # without a good answer
    followed: Samples = field(default_factory=Samples)  # with one, and something behind it
    _counts: list[int] = field(default_factory=list)  # `outcomes`, once somebody asks

    delays = UnitFigures("delay", lambda rows: rows.good, -1)  # of its good answers
    redundant = UnitFigures(
        "delay", lambda rows: rows.good & rows.next_same, -1
    )  # of those asked for once more all the same
    heeded = UnitFigures("delay", lambda rows: rows.good & ~rows.next_same, -1)  # and of the others
    pauses = UnitFigures("rested", _followed)  # from its good answers to the next request
    redundant_pauses = UnitFigures("rested", lambda rows: _followed(rows) & rows.next_same)  # to the same once more
    last_pauses = UnitFigures(
        "rested", lambda rows: _followed(rows) & rows.repeats & ~rows.next_same
    )  # and to another then
    turns = UnitFigures("wait", _followed)  # from a request that is well answered to the next one
    redundant_turns = UnitFigures("wait", lambda rows: _followed(rows) & rows.next_same)
    waits = UnitFigures("wait", _silent)  # of requests that stayed without an answer, to the next request
    plain_waits = UnitFigures("wait", lambda rows: _silent(rows) & ~rows.doubtful)
    echo_waits = UnitFigures("wait", lambda rows: rows.doubtful)
    quiet_waits = UnitFigures("wait", _quiet)
    quiet_again = UnitFigures("wait", lambda rows: _quiet(rows) & rows.next_same)
    garbage_again = UnitFigures("wait", lambda rows: (rows.outcome == Ending.GARBAGE) & rows.next_same)  # damaged ones
    gaps = UnitFigures("gap", lambda rows: rows.good)  # silence between a request and its answer by the reads
    holes = UnitFigures("hole", lambda rows: rows.good)  # the longest silence inside an answer

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

    @property
    def first_again(self) -> int | None:
        """When the first of its good answers came whose request is repeated all the same; None for none."""
        rows = self.table.of(self.unit)
        return next(iter(rows.time[rows.good & rows.next_same].tolist()), None)

    def hole_places(self, least_ns: float) -> Counter[int]:
        """Before which bytes of answers silences of so long stand."""
        rows = self.table.of(self.unit)
        return Counter(rows.hole_at[rows.good & (rows.hole > least_ns)].tolist())

    def add(self, mine: Exchanges, times: Int64s) -> None:
        """Count its next exchanges; `times` tell their order."""
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
        if answered := int(counts[Ending.OK] + counts[Ending.EXCEPTION]):
            self._add_answers(mine)
        spells = (self.silences, self.silences_but_echoes, self.silences_of_others)
        if counts[Ending.SILENT] or counts[Ending.GARBAGE] or self.silences_but_echoes.is_open:
            self._add_silences(mine, times, spells)
        elif answered:
            for each in spells:
                each.pass_over(int(times[-1]))
        if counts[Ending.EXCEPTION] or self.refusals.is_open:
            busy = BUSY[mine.exception]
            self.busy += int(np.count_nonzero(busy))
            self.refusals.add(busy, times, np.zeros_like(busy), mine.repeats)

    def _add_silences(self, mine: Exchanges, times: Int64s, spells: tuple[Spells, ...]) -> None:
        outcome = mine.outcome
        self.strayed += int(np.count_nonzero((outcome == Ending.SILENT) & (mine.noise > 0)))
        heard = (outcome != Ending.UNHEARD) & (outcome != Ending.ECHO)  # what a tap shows of its own ends no silence
        echoes = _are_echoes(mine)
        but = np.zeros_like(echoes), echoes, ECHOED[mine.function]
        for each, left_out in zip(spells, but, strict=True):
            which = heard & ~left_out
            ended = outcome[which]
            each.add(ended == Ending.SILENT, times[which], ended == Ending.GARBAGE, mine.repeats[which])

    def add_echo(self, delay_ns: int) -> None:
        """Count an answer that is not the one to the request before it, and reads like a request; `delay_ns`: behind one
        that stayed without an answer, else -1."""
        self.echo_strays += 1
        if delay_ns >= 0:
            self.echo_delays.add(np.array((delay_ns,)))

    def _add_answers(self, mine: Exchanges) -> None:
        good = mine.outcome <= Ending.EXCEPTION
        self.behind += int(np.count_nonzero(good & ((mine.noise > 0) | (mine.strays > 0))))
        self.marked += int(np.count_nonzero(mine.marks[good]))
        self.marked_bytes += int(mine.marks[good].sum())
        echoes = _are_echoes(mine)
        if echoes.any():
            self.echoes += int(np.count_nonzero(echoes))
            self.echo_delays.add(mine.delay[echoes & (mine.delay >= 0)])


def _are_echoes(mine: Exchanges) -> Bools:
    """Which exchanges are answered by what reads like their request once more."""
    found: Bools = ECHOED[mine.function] & (mine.outcome == Ending.OK) & (mine.answer_bytes == mine.asked_bytes)
    return found
