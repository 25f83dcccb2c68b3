"""The bus as a whole: its load, who is on it, whether requests are answered and how soon, and that nothing is wrong."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import ge, gt, le, lt
from typing import Any, ClassVar, Final

import numpy as np
from lark import Token
from numpy.typing import NDArray

from captures.line import LineSettings

from ...filters.literals import Literal, duration
from ...languages import counted, page_words
from ...reports import Report
from ...reports.model import Counts, Times
from ...reports.page import unknown, unknown_load
from ...reports.troubles import of_echoes
from ...tables.schema import Kind
from ...tables.transactions import Status, TransactionRows
from ...words import decimal
from ...words import duration as worded
from .. import CheckError
from ..model import Breach, Breaches, CheckedBatch, RuleResult, Start, comma_separated, form
from ..parsing import at
from .counts import whole_number

COMPARE: Final[dict[str, Callable[[Any, Any], Any]]] = {"<": lt, "<=": le, ">": gt, ">=": ge}


@dataclass
class _Answered:
    """Where polls were that nobody answered; the report counts them."""

    unit: int | None

    def __post_init__(self) -> None:
        self._breaches, self._without_echoes = Breaches(), Breaches()
        self._held = TransactionRows.zeros(0)  # the last one: the next may be the same once more

    def feed(self, checked: CheckedBatch) -> None:
        polls = TransactionRows.joined((self._held, checked.transactions))
        echoes = np.isin(polls.request, checked.findings.index[of_echoes(checked.findings)])
        self._held = polls[-1:]
        self._take(polls[:-1], shown_again=echoes[1:])

    def _take(self, polls: TransactionRows, shown_again: NDArray[np.bool_]) -> None:
        bad = (polls.status == Status.UNANSWERED) | (polls.status == Status.DAMAGED)
        if self.unit is not None:
            bad &= polls.unit == self.unit
        for breaches, which in ((self._breaches, bad), (self._without_echoes, bad & ~shown_again)):
            breaches.add(
                np.flatnonzero(which),
                lambda number: _breach(polls, number, page_words(_FATE[Status(int(polls.status[number]))])),
            )

    def verdict(self, report: Report) -> RuleResult:
        self._take(self._held, np.zeros(len(self._held), np.bool_))
        counts = report.transactions
        if self.unit is not None:
            counts = next((row.counts for row in report.units if row.unit == self.unit), Counts())
        count = counts.unanswered + counts.damaged
        breaches = self._without_echoes if report.transactions.echoes else self._breaches
        places, more = breaches.told
        polls = counts.requests - counts.broadcasts - counts.unheard
        tail = ""
        if counts.unheard and report.deaf:
            tail = page_words("; {count:,} more while nothing was received", count=counts.unheard)
        elif counts.unheard:
            tail = page_words("; the last one was still open when the capture ended")
        words = page_words("no polls seen")
        if polls:
            words = page_words("{some:,} of {all:,} polls answered", some=polls - count, all=polls) + tail
        return RuleResult(polls > 0 and not count, words, places, more)


_FATE: Final = {Status.UNANSWERED: "no answer", Status.DAMAGED: "answered by a damaged frame"}


@form("every-poll-answered", '"every"i "poll"i ["of"i "unit"i NUMBER] "answered"i',
      "each request to a unit gets a complete answer (an exception counts)", "every poll answered",
      "every poll of unit 17 answered")  # fmt: skip
def every_poll(line: LineSettings, unit: Token | None) -> Start:  # noqa: ARG001
    number = None if unit is None else whole_number(unit, 255)
    return lambda: _Answered(number)


@dataclass
class _Soon:
    """Compares one figure of the response times."""

    share: str
    unit: int | None
    compared: str
    bound_ns: float
    bound: str

    def __post_init__(self) -> None:
        self._breaches = Breaches()

    def feed(self, checked: CheckedBatch) -> None:
        polls = _of_unit(checked.transactions, self.unit)
        if self.compared in ("<", "<="):
            over = (polls.response_ns >= 0) & ~COMPARE[self.compared](polls.response_ns, self.bound_ns)
            self._breaches.add(
                np.flatnonzero(over),
                lambda number: _breach(
                    polls, number, page_words("answered after {time}", time=worded(int(polls.response_ns[number])))
                ),
            )

    def verdict(self, report: Report) -> RuleResult:
        times = report.times
        if self.unit is not None:
            times = next((row.times for row in report.units if row.unit == self.unit), Times())
        if not times.count:
            return RuleResult(False, unknown("no response time could be measured"))
        bounds = times.bounds(self.share)
        if bounds is None:
            return RuleResult(
                False, page_words("cannot be told: {why}", why=page_words("this tap's timestamps are too coarse"))
            )
        words = f"{self.share} {times.worded(self.share)}, {page_words('{count:,} measured', count=times.count)}"
        verdicts = {bool(COMPARE[self.compared](figure, self.bound_ns)) for figure in bounds}
        if len(verdicts) > 1:
            return RuleResult(False, page_words("cannot be told: {why}", why=words))
        if verdicts == {True}:
            return RuleResult(True, words)
        if count := self._breaches.count:
            bound = f"{self.compared} {self.bound}"
            words += page_words(", {count:,} not {bound}", count=count, bound=bound)
        return RuleResult(False, words, *self._breaches.told)


@form("response-time", 'SHARE "response_time"i ["of"i "unit"i NUMBER] COMPARED NUMBER [UNIT]',
      "a percentile (within 0.5%), mean, minimum or maximum of response times; fails if the tap cannot measure them",
      "p95 response_time < 80 ms",
      "max response_time of unit 17 <= 0.5 s")  # fmt: skip
def response_time(
    line: LineSettings,  # noqa: ARG001
    share: Token,
    unit: Token | None,
    compared: Token,
    number: Token,
    suffix: Token | None,
) -> Start:
    bound = duration(Literal("number", str(number), at(number), str(suffix or "")))
    assert isinstance(bound, int | float)
    which = None if unit is None else whole_number(unit, 255)
    return lambda: _Soon(share.lower(), which, str(compared), bound, f"{number} {suffix or 'ms'}")


def _of_unit(transactions: TransactionRows, unit: int | None) -> TransactionRows:
    return transactions if unit is None else transactions[transactions.unit == unit]


def _breach(polls: TransactionRows, number: int, text: str) -> Breach:
    """A request as a place."""
    asked = page_words("unit {unit}, function {function:02d}", unit=polls.unit[number], function=polls.function[number])
    place = (polls.request, polls.start, polls.length, polls.port, polls.t_start_ns)
    return Breach(f"{asked}: {text}", *(int(column[number]) for column in place))


@dataclass
class _Summed:
    """A rule that the report alone decides."""

    verdict: Callable[[Report], RuleResult]

    def feed(self, checked: CheckedBatch) -> None:
        pass


@form("load", '"load"i COMPARED NUMBER "%"', "share of time with bytes on the line", "load < 60 %")
def load(line: LineSettings, compared: Token, number: Token) -> Start:  # noqa: ARG001
    bound = float(number) / 100
    if bound > 1:
        raise CheckError("a load is at most 100%", at(number))

    def verdict(report: Report) -> RuleResult:
        mean = report.load.mean
        if mean is None:
            return RuleResult(False, unknown_load(report))
        return RuleResult(bool(COMPARE[compared](mean, bound)), decimal(f"{mean:.1%}"))

    return lambda: _Summed(verdict)


@form(
    "at-least-frames",
    '"at"i "least"i NUMBER "frames"i',
    "the capture has at least N frames",
    "at least 100 frames",
)
def at_least_frames(line: LineSettings, number: Token) -> Start:  # noqa: ARG001
    least = whole_number(number)
    return lambda: _Summed(lambda report: RuleResult(report.frames >= least, counted(report.frames, "frame", "frames")))


@dataclass
class _UnitsOnBus:
    """Who speaks and who is spoken to, in frames with a right check value; broadcasts apart."""

    allowed: frozenset[int]
    all_of_them: bool

    def __post_init__(self) -> None:
        self._breaches = Breaches()
        self._heard: set[int] = set()
        self._answered: set[int] = set()

    def feed(self, checked: CheckedBatch) -> None:
        rows = checked.batch.rows
        sound = (rows.kind != Kind.NOISE) & rows.check & (rows.unit > 0)
        units, where = np.unique(rows.unit[sound], return_index=True)
        new = ~np.isin(units, list(self.allowed | self._heard))
        strange = np.sort(np.flatnonzero(sound)[where[new]])  # the first frame of each
        self._heard.update(units.tolist())
        self._answered.update(np.unique(rows.unit[sound & (rows.kind == Kind.RESPONSE)]).tolist())
        self._breaches.add(strange, lambda row: checked.place(row, page_words("unit {unit}", unit=rows.unit[row])))

    def verdict(self, report: Report) -> RuleResult:  # noqa: ARG002
        strangers = self._heard - self.allowed
        absent = self.allowed - self._answered if self.all_of_them else set()
        parts = [
            page_words("units {units}", units=comma_separated(self._heard)) if self._heard else page_words("no units")
        ]
        parts += [page_words("not expected: {units}", units=comma_separated(strangers))] if strangers else []
        parts += [page_words("never answered: {units}", units=comma_separated(absent))] if absent else []
        return RuleResult(not strangers and not absent, "; ".join(parts), *self._breaches.told)


@form("units-are", '"units"i "are"i numbers', "exactly these units are asked and answer",
      "units are 1, 2, 17")  # fmt: skip
def units_are(line: LineSettings, numbers: list[Token]) -> Start:  # noqa: ARG001
    allowed = frozenset(whole_number(number, 255) for number in numbers)
    return lambda: _UnitsOnBus(allowed, all_of_them=True)


@form("no-units-but", '"no"i "units"i "but"i numbers', "no other unit is asked or answers", "no units but 1, 2")
def no_units_but(line: LineSettings, numbers: list[Token]) -> Start:  # noqa: ARG001
    allowed = frozenset(whole_number(number, 255) for number in numbers)
    return lambda: _UnitsOnBus(allowed, all_of_them=False)


@dataclass
class _Causes:
    """Counts the causes that concern a unit, or all; notes are no fault."""

    needs_causes: ClassVar[bool] = True
    unit: int | None

    def feed(self, checked: CheckedBatch) -> None:
        pass

    def verdict(self, report: Report) -> RuleResult:
        causes = [cause for cause in report.causes if cause.severity != "note"]
        if self.unit is not None:
            causes = [cause for cause in causes if self.unit in cause.units]
        listed = "; ".join(f"{cause.cause} ({cause.sure}): {cause.text}" for cause in causes)
        return RuleResult(not causes, listed or page_words("none"))


@form("no-causes", '"no"i ("cause"i | "causes"i) ["of"i "unit"i NUMBER]',
      "no cause found for the bus, or for one unit, except notes", "no causes",
      "no cause of unit 7")  # fmt: skip
def no_causes(line: LineSettings, unit: Token | None) -> Start:  # noqa: ARG001
    number = None if unit is None else whole_number(unit, 255)
    return lambda: _Causes(number)
