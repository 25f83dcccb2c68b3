"""What becomes of requests: whether they are answered, and how soon."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from operator import ge, gt, le, lt
from typing import Any, Final

import numpy as np
from lark import Token

from captures.line import LineSettings

from ...filters.kinds import Literal, duration
from ...languages import page_words
from ...reports import Report
from ...reports.model import Times
from ...reports.page import unknown
from ...tables.transactions import Status, TransactionRows
from ...words import duration as worded
from ..model import Breach, Breaches, CheckedBatch, RuleResult, Start, form
from ..parsing import at
from .counts import whole

COMPARE: Final[dict[str, Callable[[Any, Any], Any]]] = {"<": lt, "<=": le, ">": gt, ">=": ge}


@dataclass
class _Answered:
    """Counts polls and those that nobody answered; the capture's end may cut the last one off."""

    unit: int | None

    def __post_init__(self) -> None:
        self._breaches = Breaches()
        self._polls = self._unheard = 0
        self._silent: int | None = None  # the newest request without an answer
        self._last = -1

    def feed(self, checked: CheckedBatch) -> None:
        polls = _of_unit(checked.transactions, self.unit)
        polls = polls[polls.status != Status.BROADCAST]
        unheard = polls.status == Status.UNHEARD
        self._unheard += int(np.count_nonzero(unheard))
        polls = polls[~unheard]
        self._polls += len(polls)
        self._last = max(self._last, int(checked.batch.rows.index.max(initial=-1)))
        bad = np.flatnonzero((polls.status == Status.UNANSWERED) | (polls.status == Status.DAMAGED))
        if len(bad):
            newest = bad[-1]
            self._silent = int(polls.request[newest]) if polls.status[newest] == Status.UNANSWERED else None
        self._breaches.add(
            bad, lambda number: _breach(polls, number, page_words(_FATE[Status(int(polls.status[number]))]))
        )

    def verdict(self, report: Report) -> RuleResult:  # noqa: ARG002
        count, first, polls = self._breaches.count, self._breaches.first, self._polls
        tail = ""
        if self._silent is not None and self._silent == self._last:
            count, polls, tail = (
                count - 1,
                polls - 1,
                page_words("; the last one was still open when the capture ended"),
            )
            first = [breach for breach in first if breach.index != self._silent]
        if self._unheard:
            tail += page_words("; {count:,} more while nothing was heard", count=self._unheard)
        words = page_words("no polls seen")
        if polls:
            words = page_words("{some:,} of {all:,} polls answered", some=polls - count, all=polls) + tail
        return RuleResult(polls > 0 and not count, words, tuple(first))


_FATE: Final = {Status.UNANSWERED: "no answer", Status.DAMAGED: "answered by a damaged frame"}


@form("every-poll-answered", '"every"i "poll"i ["of"i "unit"i NUMBER] "answered"i',
      "each request to a unit gets a whole answer, which an exception is too", "every poll answered",
      "every poll of unit 17 answered")  # fmt: skip
def every_poll(line: LineSettings, unit: Token | None) -> Start:  # noqa: ARG001
    number = None if unit is None else whole(unit, 255)
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
                False, page_words("cannot be told: {why}", why=page_words("this tap's times cannot tell them"))
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
        return RuleResult(False, words, tuple(self._breaches.first))


@form("response-time", 'SHARE "response_time"i ["of"i "unit"i NUMBER] COMPARED NUMBER [UNIT]',
      "a percentile (good to 0.5 %), the mean or an end of the response times; fails where the tap cannot tell",
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
    which = None if unit is None else whole(unit, 255)
    return lambda: _Soon(share.lower(), which, str(compared), bound, f"{number} {suffix or 'ms'}")


def _of_unit(transactions: TransactionRows, unit: int | None) -> TransactionRows:
    return transactions if unit is None else transactions[transactions.unit == unit]


def _breach(polls: TransactionRows, number: int, text: str) -> Breach:
    """A request as a place."""
    asked = page_words("unit {unit}, function {function:02d}", unit=polls.unit[number], function=polls.function[number])
    place = (polls.request, polls.start, polls.length, polls.port, polls.t_start_ns)
    return Breach(f"{asked}: {text}", *(int(column[number]) for column in place))
