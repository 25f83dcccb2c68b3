"""Requests without an answer, repeated ones, answers that come too late: what became of each request.

Rests on the transactions, in the order of their requests. Two things only look like silence and are told apart by
their haste: a frame that the tap shows twice, and a write whose echo differs, which reads like another request. No
master repeats itself or goes on so soon.
"""

from __future__ import annotations

from bisect import bisect_left
from collections.abc import Iterator, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import relations
from dissectors.limits import Echo

from ...tables.findings import About, Findings, Rule, Severity, looks_for
from ...tables.schema import Protocol, Rows, join_rows, take_rows
from ...tables.transactions import NEVER, TRANSACTION, Status
from ..damage.triage import HASTE_NS
from ..tap_clock import FIRST, UNKNOWN
from ..view import DiagnosisStep, where
from .strangers import BROADCAST_ANSWERED, DUPLICATE, MISMATCH

_STRAY: Final = 4  # bytes that may have been an answer
_ECHO_NS: Final = 5_000_000
_DEVICE_NS: Final = 1_000_000  # no device answers sooner
_SURE_ECHOES: Final = 3
_ECHOING: Final = 0.3  # of all requests
_ANSWERED, _UNANSWERED, _DAMAGED = int(Status.ANSWERED), int(Status.UNANSWERED), int(Status.DAMAGED)


def _silent(numbers: Mapping[str, float]) -> str:
    waited = f" in {numbers['waited_ms']:.4g} ms, until the next request" if "waited_ms" in numbers else ""
    return f"unit {numbers['unit']:.0f} did not answer{waited}"


NO_RESPONSE: Final = Rule(
    "no-response",
    Severity.ERROR,
    About.TRANSACTION,
    when="nobody answers a request",
    clause="[2] 2.4.1",
    numbers=("unit", "waited_ms", "function", "answered_before", "over_tcp"),
    varies="answered_before",
    loses=True,
    wastes="waited_ms",
    text=_silent,
    cause=lambda numbers: (
        "a request that reached it damaged, a unit that restarts or is busy, or a loose contact: it answers otherwise"
        if numbers["answered_before"]
        else "no such unit behind this server, or one that its serial line does not reach"
        if "over_tcp" in numbers
        else "it has not answered so far: no such unit, or one without power; else a wrong baud rate or parity, "
        "swapped A and B, or a request that reached it damaged"
    ),
    remedy=lambda numbers: (
        "look when it falls silent: its power, its connector, what the master asks of it just then"
        if numbers["answered_before"]
        else "check the unit's number, and the line behind the gateway if it is one; take it off the poll list if it "
        "is not there"
        if "over_tcp" in numbers
        else "check the unit's power, address, line settings and wiring; take it off the poll list if it is not there"
    ),
)
RETRY: Final = Rule(
    "retry",
    Severity.NOTE,
    About.TRANSACTION,
    when="the same request comes again after no answer or a damaged one",
    clause="[2] 2.4.1",
    numbers=("unit", "after_ms"),
    text=lambda numbers: (
        "the master repeats its request"
        + (f", {numbers['after_ms']:.4g} ms after the first try" if "after_ms" in numbers else "")
    ),
    cause="it got no answer, a damaged one or one too late",
    remedy="look at what became of the request before",
)


def _came_late(numbers: Mapping[str, float]) -> str:
    behind = f", {numbers['late_ms']:.4g} ms after it" if "late_ms" in numbers else ""
    words = f"unit {numbers['unit']:.0f} answers frame {numbers['request']:.0f}{behind}, when the master has gone on; "
    if numbers["mistaken"]:
        return words + "it fits the master's newest request as well, which takes these values one poll too late"
    return words + "it does not fit the master's newest request, which can reject it"


LATE: Final = Rule(
    "late-response",
    Severity.ERROR,
    About.TRANSACTION,
    when="an answer comes after the master has gone on to its next request",
    clause="[2] 2.4.1",
    numbers=("unit", "late_ms", "request", "mistaken", "waited_ms"),
    varies="mistaken",
    loses=True,
    wastes="waited_ms",
    text=_came_late,
    cause=lambda numbers: (
        "the unit answers later than the master waits"
        + ("; answers carry no register address, so nobody notices the wrong values" if numbers["mistaken"] else "")
    ),
    remedy=lambda numbers: (
        "make the master's response timeout longer than the unit's longest response time"
        + ("; do not trust the values of this unit until then" if numbers["mistaken"] else "")
    ),
)
ECHO: Final = Rule(
    "echo",
    Severity.NOTE,
    About.TRANSACTION,
    when="the tap shows each sent frame twice",
    numbers=("after_ms",),
    text=lambda numbers: (
        "the same frame once more" + (f", {numbers['after_ms']:.3g} ms after itself" if "after_ms" in numbers else "")
    ),
    cause="the tap or a converter with local echo shows each sent frame twice",
    remedy="switch the converter's local echo off, or tap the line behind it",
)


class _TransactionColumns(NamedTuple):
    """A transaction's columns (TRANSACTION), and how many came before it."""

    request: int
    response: int
    start: int
    length: int
    response_start: int
    response_length: int
    t_start: int
    t_request: int
    t_response: int
    response_ns: int
    t_next: int
    garbage: int
    unit: int
    function: int
    exception: int
    status: int
    retry: bool
    again: bool
    late: bool
    mistaken: bool
    port: int
    response_port: int
    protocol: int
    number: int

    @property
    def shape(self) -> tuple[int, int, int, int]:
        return self.unit, self.function, self.length, self.port


_RULES: Final = (NO_RESPONSE, RETRY, LATE, ECHO, MISMATCH, BROADCAST_ANSWERED, DUPLICATE)


@looks_for(*_RULES)
class Outcomes:
    """Transactions in order; the newest waits for the one that comes after it.

    Nearly all went well: of these only those beside an odd one are looked at.
    """

    def __init__(self) -> None:
        self._held: Rows = np.zeros(0, TRANSACTION)  # odd ones, their neighbours, and the newest
        self._numbers: NDArray[np.int64] = np.zeros(0, np.int64)  # and how many came before each
        self._judged = 0  # of them, 1 once there is one
        self._odd = -1  # the number of the newest odd one
        self._requests = 0  # so far
        self._first_ones = 0  # of them, among the first frames: what those show counts for them, too
        self._echoes = 0  # requests that were answered when they came a second time, as far as all are judged
        self._echoes_at: list[int] = []  # the numbers of further ones
        self._rewritten: set[int] = set()  # units to which the same write went twice in a row, answered each time
        self._answering: dict[int, int] = {}  # units, and the number of the first request that each answered

    @property
    def open_from(self) -> int | None:
        return int(self._held["request"][self._judged]) if len(self._held) > self._judged else None

    def __call__(self, view: DiagnosisStep) -> Iterator[Findings]:
        if len(view.transactions):
            self._take(view)
        if view.clock.known and len(self._held) and self._held["request"][-1] >= FIRST:
            yield from self._go_on(view, len(self._held) - 1)

    def close(self, view: DiagnosisStep) -> Iterator[Findings]:
        """No transaction comes after the newest."""
        yield from self._go_on(view, len(self._held))

    def _take(self, view: DiagnosisStep) -> None:
        """Count new transactions, and hold those that may have to be looked at."""
        status, again, units = view.settled("status"), view.settled("retry"), view.settled("unit")
        odd = where((status == _UNANSWERED) | again | view.settled("again") | view.settled("late"))
        if len(odd):
            self._odd = self._requests + int(odd[-1])
        near = np.zeros(len(status) + 2, np.bool_)  # one before and one behind them
        near[odd] = near[odd + 1] = near[odd + 2] = True
        near[[1, -3, -2]] = True
        kept = where(near[1:-1])
        if self._first_ones == self._requests:
            self._first_ones += int(view.settled("request").searchsorted(FIRST))
        self._echoes_at += [self._requests + i for i in odd.tolist() if again[i] and status[i] != _UNANSWERED]
        answered = status == _ANSWERED
        for unit in where(np.bincount(units[answered])).tolist():
            if unit not in self._answering:
                self._answering[unit] = self._requests + int(np.argmax(answered & (units == unit)))
        self._held = join_rows((self._held, take_rows(view.transactions, kept)))
        self._numbers = np.concatenate((self._numbers, kept + self._requests))
        self._requests += len(status)

    def _go_on(self, view: DiagnosisStep, upto: int) -> Iterator[Findings]:
        """Judge those held, up to one, and keep the newest of them beside what is left."""
        if upto <= self._judged:
            return
        if self._odd >= self._numbers[self._judged]:
            yield from self._judge(view, self._judged, upto)
        done = bisect_left(self._echoes_at, int(self._numbers[upto - 1]))
        self._echoes += done
        del self._echoes_at[:done]
        self._held, self._numbers, self._judged = self._held[upto - 1 :], self._numbers[upto - 1 :], 1

    def _judge(self, view: DiagnosisStep, first: int, upto: int) -> Iterator[Findings]:
        """Say what is to be said of those held from `first` to `upto` (excluded)."""
        known = [
            _TransactionColumns._make((*row, number))
            for row, number in zip(self._held.tolist(), self._numbers.tolist(), strict=True)
        ]
        found: dict[Rule, list[int]] = {rule: [] for rule in _RULES}
        for i in range(first, upto):
            this = known[i]
            if this.late and this.response >= 0 and this.unit:
                found[LATE].append(i)
            if this.status != _UNANSWERED and not this.retry and not this.again:
                continue
            quick = view.timed and view.clock.verdict(this.request).wait_ns < HASTE_NS / 2
            rule = self._outcome(view, known, i, quick=quick)
            if rule is not None:
                found[rule].append(i)
            if this.retry and rule is not ECHO and rule is not DUPLICATE:
                found[RETRY].append(i)
        for rule, which in found.items():
            if which:
                spoken = "response" if rule is LATE else "request"
                clocked = [view.clock.verdict(index).wait_ns < UNKNOWN for index in self._held[spoken][which].tolist()]
                found_by = _said(rule, self._held, np.array(which), np.array(clocked) & view.timed)
                if rule is NO_RESPONSE:
                    began = [self._answering.get(known[i].unit, self._requests) < known[i].number for i in which]
                    found_by["numbers"][:, rule.numbers.index("answered_before")] = began
                yield found_by

    def _echoing(self, number: int) -> bool:
        """Whether nearly every request before this one came twice: that is the tap's doing."""
        requests = max(number, self._first_ones)
        echoes = self._echoes + bisect_left(self._echoes_at, requests)
        return echoes >= _SURE_ECHOES and echoes >= _ECHOING * requests

    def _outcome(
        self, view: DiagnosisStep, known: Sequence[_TransactionColumns], i: int, *, quick: bool
    ) -> Rule | None:
        """What became of a request without an answer, or of one that repeats the one before."""
        this, before = known[i], known[i - 1] if i else None
        if this.protocol == Protocol.TCP:  # no echoes, no broadcasts
            return NO_RESPONSE if this.status == _UNANSWERED and this.t_next != NEVER else None
        hasty = _hasty(before, this, quick=quick)
        if this.again and before is not None:
            behind = known[i + 1] if i + 1 < len(known) else None
            earlier = known[i - 2] if i > 1 else None
            if this.unit == 0:
                return BROADCAST_ANSWERED if quick and _echoed(earlier, before, this, behind) else None
            if this.status != _UNANSWERED:
                self._rewritten.add(this.unit)
            elif self._second_echo(view, before, this, behind):
                soon = this.t_start - before.t_response < HASTE_NS if quick else this.unit not in self._rewritten
                return DUPLICATE if soon else self._silence(view, known, i, quick=quick)
        if this.retry and before is not None:
            again = _again(before, this)
            if (hasty and _at_once(view, before, this)) or (again and not quick and self._echoing(this.number)):
                twice = _echoes(this.function) and this.status == _ANSWERED and not self._echoing(this.number)
                twice = twice and not _by_tap(view, this.request, this.t_start - before.t_request)
                return DUPLICATE if twice else ECHO  # thrice the same at once: a write and two echoes of it
        if this.status != _UNANSWERED:
            return None
        if _answers_broadcast(before, this, quick=quick):
            return BROADCAST_ANSWERED
        differs = hasty if quick else self._differs(before, this)
        if differs and not this.retry and _echoes(this.function):
            return MISMATCH
        return self._silence(view, known, i, quick=quick)

    def _second_echo(
        self,
        view: DiagnosisStep,
        before: _TransactionColumns,
        this: _TransactionColumns,
        behind: _TransactionColumns | None,
    ) -> bool:
        """Whether what reads like a write that nobody answers may be a second echo of the write before."""
        if this.request != before.response + 1 or self._echoing(this.number):
            return False
        if behind is not None and behind.retry and _at_once(view, this, behind):
            return False  # a request, which the tap shows twice
        return not _by_tap(view, before.request, before.t_response - before.t_request)

    def _silence(
        self, view: DiagnosisStep, known: Sequence[_TransactionColumns], i: int, *, quick: bool
    ) -> Rule | None:
        before, behind = known[i - 1] if i else None, known[i + 1] if i + 1 < len(known) else None
        return None if self._excused(view, before, known[i], behind, quick=quick) else NO_RESPONSE

    def _excused(
        self,
        view: DiagnosisStep,
        before: _TransactionColumns | None,
        this: _TransactionColumns,
        behind: _TransactionColumns | None,
        *,
        quick: bool,
    ) -> bool:
        """Whether something else explains that this request has no answer."""
        if this.t_next == NEVER or this.garbage >= _STRAY or this.request in view.explained:
            return True
        if behind is not None and _hasty(this, behind, quick=quick):
            if behind.retry:
                return _at_once(view, this, behind)  # this one, shown again
            return behind.status == _UNANSWERED and _echoes(behind.function)
        echoing = self._echoing(this.number)
        if behind is not None and echoing and behind.retry and _again(this, behind):
            return True
        if behind is not None and not quick and self._differs(this, behind):
            return _echoes(this.function)
        return echoing and _shown_twice(before, this)

    def _differs(self, before: _TransactionColumns | None, this: _TransactionColumns) -> bool:
        """Whether two unlike requests of one shape in a row, none answered, went to a unit that answers otherwise."""
        if before is None or not _again(before, this) or this.retry:
            return False
        if self._answering.get(this.unit, self._requests) >= max(this.number, self._first_ones):
            return False
        return before.status == _UNANSWERED == this.status


def _at_once(view: DiagnosisStep, before: _TransactionColumns, this: _TransactionColumns) -> bool:
    """Whether a request came right behind the one before, as an echo does."""
    return this.t_start - before.t_request < _ECHO_NS + view.clock.verdict(this.request).wait_ns


def _by_tap(view: DiagnosisStep, index: int, after_ns: int) -> bool:
    """Whether a frame came again sooner than any device sends it, on a clock that shows so much."""
    return view.clock.verdict(index).fine and after_ns < _DEVICE_NS


def _shown_twice(before: _TransactionColumns | None, this: _TransactionColumns) -> bool:
    """Whether this is a write's true echo, on a bus where the tap's copy of the write was taken for it."""
    same = before is not None and before.shape == this.shape and before.response == this.request - 1
    return same and _echoes(this.function)


def _again(before: _TransactionColumns, this: _TransactionColumns) -> bool:
    """Whether these are two frames in a row, of one shape."""
    return this.request == before.request + 1 and this.shape == before.shape


def _hasty(before: _TransactionColumns | None, this: _TransactionColumns, *, quick: bool) -> bool:
    """Whether a request of the same shape came right behind an unanswered one, sooner than a master gives up."""
    if before is None or not quick or before.status != _UNANSWERED or not _again(before, this):
        return False
    return this.t_start - before.t_request < HASTE_NS


def _echoed(
    earlier: _TransactionColumns | None,
    before: _TransactionColumns,
    this: _TransactionColumns,
    behind: _TransactionColumns | None,
) -> bool:
    """Whether a broadcast that comes twice came the second time from a device: at once, and neither before nor behind.

    Clients repeat broadcasts, though after a pause, and those that make none send more than two.
    """
    if not (_again(before, this) and this.t_start - before.t_request < HASTE_NS):
        return False
    if before.again and earlier is not None and before.t_start - earlier.t_request < HASTE_NS:
        return False
    return behind is None or not (behind.again and behind.t_start - this.t_request < HASTE_NS)


def _answers_broadcast(before: _TransactionColumns | None, this: _TransactionColumns, *, quick: bool) -> bool:
    """Whether this is the answer of a device to the broadcast before, which reads like a request to that device."""
    if before is None or not quick or before.unit or before.shape[1:] != this.shape[1:]:
        return False
    soon = this.t_start - before.t_request < HASTE_NS
    return soon and this.request == before.request + 1 and _echoes(this.function)


def _echoes(function: int) -> bool:
    return any(isinstance(relation, Echo) for relation in relations(function))


def _said(rule: Rule, held: Rows, which: NDArray[np.intp], timed: NDArray[np.bool_]) -> Findings:
    """What a rule says of some transactions; `timed`: whether their times mean anything."""
    these, before = held[which], held[np.maximum(which - 1, 0)]
    columns = (these[name] for name in ("request", "start", "length", "port", "t_start"))
    if rule is LATE:
        columns = (
            these[name] for name in ("response", "response_start", "response_length", "response_port", "t_response")
        )
        behind = np.where(timed, (these["t_response"] - these["t_request"]) / 1e6, np.nan)
        waited = np.where(timed & (these["t_next"] != NEVER), (these["t_next"] - these["t_request"]) / 1e6, np.nan)
        return rule.at(*columns, these["unit"], behind, these["request"], these["mistaken"], waited)
    if rule is DUPLICATE:
        own = these["status"] == _ANSWERED  # else what reads like a request is the second answer
        pairs = (
            ("response", "request"),
            ("response_start", "start"),
            ("response_length", "length"),
            ("response_port", "port"),
            ("t_response", "t_start"),
        )
        index, start, length, port, t_ns = (np.where(own, these[one], these[other]) for one, other in pairs)
        first = np.where(own, these["t_start"], before["t_response"])
        later = np.where(timed, (t_ns - first) / 1e6, np.nan)
        return rule.at(index, start, length, port, t_ns, these["unit"], later)
    if rule is NO_RESPONSE:
        waited = np.where(timed, (these["t_next"] - these["t_request"]) / 1e6, np.nan)
        over_tcp = np.where(these["protocol"] == Protocol.TCP, 1.0, np.nan)
        return rule.at(*columns, these["unit"], waited, these["function"], 0, over_tcp)
    if rule is RETRY:
        failed = (which > 0) & np.isin(before["status"], (_UNANSWERED, _DAMAGED)) & timed
        return rule.at(*columns, these["unit"], np.where(failed, (these["t_start"] - before["t_start"]) / 1e6, np.nan))
    if rule is ECHO:
        later = np.maximum(these["t_start"] - before["t_request"], 0) / 1e6
        return rule.at(*columns, np.where(timed, later, np.nan))
    return rule.at(*columns, these["unit"], these["function"])
