"""Requests without an answer, repeated ones, answers that come too late: what became of each request.

Rests on the transactions, in the order of their requests. Two things only look like silence and are told apart by
their haste: a frame that the tap shows twice, and a write whose echo differs, which reads like another request. No
master repeats itself or goes on so soon.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from numpy.typing import NDArray

from dissectors.lengths import Echo, relations

from ...frames import Rows
from ...transactions import NEVER, TRANSACTION, Status
from ..clock import FIRST, UNKNOWN
from ..examiner import HASTE_NS
from ..model import Findings, Severity
from ..registry import About, Rule, looks_for
from ..view import View
from .strangers import BROADCAST_ANSWERED, MISMATCH

_STRAY: Final = 4  # bytes that may have been an answer
_ECHO_NS: Final = 5_000_000
_SURE_ECHOES: Final = 3
_ECHOING: Final = 0.3  # of all requests


def _silent(numbers: Mapping[str, float]) -> str:
    waited = f" in {numbers['waited_ms']:.4g} ms, until the next request" if "waited_ms" in numbers else ""
    return f"unit {numbers['unit']:.0f} did not answer{waited}"


NO_RESPONSE: Final = Rule(
    "no-response",
    Severity.ERROR,
    About.TRANSACTION,
    when="nobody answers a request",
    clause="[2] 2.4.1",
    numbers=("unit", "waited_ms", "function"),
    loses=True,
    wastes="waited_ms",
    text=_silent,
    cause="no such unit, or one without power; else a wrong baud rate or parity, swapped A and B, or a request that "
    "reached it damaged",
    remedy="check the unit's power, address, line settings and wiring; take it out of the poll list if it is not there",
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
LATE: Final = Rule(
    "late-response",
    Severity.ERROR,
    About.TRANSACTION,
    when="an answer comes after the master has gone on to its next request",
    clause="[2] 2.4.1",
    numbers=("unit", "late_ms", "request"),
    loses=True,
    wastes="late_ms",
    text=lambda numbers: (
        f"this answers frame {numbers['request']:.0f}"
        + (f", {numbers['late_ms']:.4g} ms after it" if "late_ms" in numbers else "")
        + "; the master has gone on since and takes it for the answer to its newest request"
    ),
    cause="the unit answers later than the master waits; answers carry no register address, so the values land in the "
    "wrong registers",
    remedy="make the master's response timeout longer than the unit's longest response time",
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


@looks_for(NO_RESPONSE, RETRY, LATE, ECHO, MISMATCH, BROADCAST_ANSWERED)
class Outcomes:
    """Transactions in order; the newest waits for the one that comes after it."""

    def __init__(self) -> None:
        self._held: Rows = np.zeros(0, TRANSACTION)
        self._judged = 0  # of them, 1 once there is one
        self._echoes = self._requests = 0  # so far; of the first ones, before any is judged
        self._answering: set[int] = set()  # units that have answered

    @property
    def open_from(self) -> int | None:
        return int(self._held["request"][self._judged]) if len(self._held) > self._judged else None

    def __call__(self, view: View) -> Iterator[Findings]:
        self._held = np.concatenate((self._held, view.transactions))
        if view.clock.known and len(self._held) and self._held["request"][-1] >= FIRST:
            yield from self._go_on(view, len(self._held) - 1)

    def close(self, view: View) -> Iterator[Findings]:
        """No transaction comes after the newest."""
        yield from self._go_on(view, len(self._held))

    def _go_on(self, view: View, upto: int) -> Iterator[Findings]:
        """Judge those held, up to one, and keep the newest of them beside what is left."""
        known, first = self._held, self._judged
        if not self._requests:  # what the first frames show counts for them, too
            self._count(known, 0, int(np.searchsorted(known["request"], FIRST)))
        if upto > first:
            yield from self._judge(view, known, first, upto)
            self._held, self._judged = known[upto - 1 :].copy(), 1

    def _judge(self, view: View, known: Rows, first: int, last: int) -> Iterator[Findings]:
        """Say what is to be said of transactions first to last (excluded); their neighbours are looked at, too."""
        late = np.flatnonzero(known["late"][first:last] & (known["response"][first:last] >= 0)) + first
        if len(late):
            clocked = [view.clock.verdict(index).wait_ns < UNKNOWN for index in known["response"][late].tolist()]
            yield _late(known[late], np.array(clocked) & view.timed)
        silent_ones = known["status"][first:last] == Status.UNANSWERED
        odd = np.flatnonzero(silent_ones | known["retry"][first:last]) + first
        found: dict[Rule, list[int]] = {rule: [] for rule in (NO_RESPONSE, RETRY, MISMATCH, BROADCAST_ANSWERED, ECHO)}
        for i in odd.tolist():
            self._count(known, first, i)
            first = i
            quick = view.timed and view.clock.verdict(int(known["request"][i])).wait_ns < HASTE_NS / 2
            rule = self._outcome(view, known, i, quick=quick)
            if rule is not None:
                found[rule].append(i)
            if known["retry"][i] and rule is not ECHO and rule is not BROADCAST_ANSWERED:
                found[RETRY].append(i)
        self._count(known, first, last)
        for rule, which in found.items():
            if which:
                clocked = [view.clock.verdict(index).wait_ns < UNKNOWN for index in known["request"][which].tolist()]
                timed = np.array(clocked) & view.timed
                yield _on(rule, known[which], *self._evidence(rule, known, np.array(which), timed))

    def _count(self, known: Rows, first: int, last: int) -> None:
        """Count requests, and those that were answered when they came a second time; the first frames only once."""
        if self._requests:
            first = max(first, int(np.searchsorted(known["request"][:last], FIRST)))
        if first < last:
            status = known["status"][first:last]
            self._requests += last - first
            self._echoes += int((known["retry"][first:last] & (status != Status.UNANSWERED)).sum())
            units = known["unit"][first:last][status == Status.ANSWERED]
            self._answering.update(np.flatnonzero(np.bincount(units)).tolist())

    @property
    def _echoing(self) -> bool:
        """Whether nearly every request comes twice: that is the tap's doing."""
        return self._echoes >= _SURE_ECHOES and self._echoes >= _ECHOING * self._requests

    def _outcome(self, view: View, known: Rows, i: int, *, quick: bool) -> Rule | None:
        """What became of a request without an answer, or of one that repeats the one before."""
        hasty = _hasty(known, i - 1, i, quick=quick)
        if known["retry"][i]:
            again = _again(known, i - 1, i)
            soon = not quick or known["t_start"][i] - known["t_request"][i - 1] < HASTE_NS
            if again and soon and known["unit"][i] == 0:
                return BROADCAST_ANSWERED
            if (hasty and self._at_once(view, known, i)) or (again and not quick and self._echoing):
                return ECHO
        if known["status"][i] != Status.UNANSWERED:
            return None
        if _answers_broadcast(known, i, quick=quick):
            return BROADCAST_ANSWERED
        differs = hasty if quick else self._differs(known, i - 1, i)
        if differs and not known["retry"][i] and _echoes(int(known["function"][i])):
            return MISMATCH
        return None if self._excused(view, known, i, quick=quick) else NO_RESPONSE

    def _evidence(
        self, rule: Rule, known: Rows, which: NDArray[np.intp], timed: NDArray[np.bool_]
    ) -> tuple[object, ...]:
        """The figures of a rule for some transactions; `timed`: whether their times mean anything."""
        these, before = known[which], known[np.maximum(which - 1, 0)]
        if rule is NO_RESPONSE:
            waited = (these["t_next"] - these["t_request"]) / 1e6
            return these["unit"], np.where(timed, waited, np.nan), these["function"]
        if rule is RETRY:
            failed = (which > 0) & np.isin(before["status"], (Status.UNANSWERED, Status.DAMAGED)) & timed
            return these["unit"], np.where(failed, (these["t_start"] - before["t_start"]) / 1e6, np.nan)
        if rule is ECHO:
            return (np.where(timed, np.maximum(these["t_start"] - before["t_request"], 0) / 1e6, np.nan),)
        return these["unit"], these["function"]

    def _excused(self, view: View, known: Rows, i: int, *, quick: bool) -> bool:
        """Whether something else explains that this request has no answer."""
        if known["t_next"][i] == NEVER or known["garbage"][i] >= _STRAY or int(known["request"][i]) in view.explained:
            return True
        if i + 1 < len(known) and _hasty(known, i, i + 1, quick=quick):
            following = known[i + 1]
            if following["retry"]:
                return self._at_once(view, known, i + 1)  # this one, shown again
            return bool(following["status"] == Status.UNANSWERED and _echoes(int(following["function"])))
        if i + 1 < len(known) and self._echoing and known["retry"][i + 1] and _again(known, i, i + 1):
            return True
        if i + 1 < len(known) and not quick and self._differs(known, i, i + 1):
            return _echoes(int(known["function"][i]))
        return self._shown_twice(known, i)

    def _at_once(self, view: View, known: Rows, i: int) -> bool:
        """Whether a request came right behind the one before, as an echo does."""
        near = _ECHO_NS + view.clock.verdict(int(known["request"][i])).wait_ns
        return bool(known["t_start"][i] - known["t_request"][i - 1] < near)

    def _differs(self, known: Rows, i: int, after: int) -> bool:
        """Whether two unlike requests of one shape in a row, none answered, went to a unit that answers otherwise."""
        if not _again(known, i, after) or known["retry"][after] or int(known["unit"][after]) not in self._answering:
            return False
        return bool(known["status"][i] == Status.UNANSWERED == known["status"][after])

    def _shown_twice(self, known: Rows, i: int) -> bool:
        """Whether this is a write's true echo, on a bus where the tap's copy of the write was taken for it."""
        if not self._echoing or i == 0:
            return False
        before, this = known[i - 1], known[i]
        same = all(before[name] == this[name] for name in ("unit", "function", "length", "port"))
        return bool(same and before["response"] == this["request"] - 1 and _echoes(int(this["function"])))


def _again(known: Rows, i: int, after: int) -> bool:
    """Whether these are two frames in a row, of one shape."""
    if i < 0 or known["request"][after] != known["request"][i] + 1:
        return False
    return all(known[name][i] == known[name][after] for name in ("unit", "function", "length", "port"))


def _hasty(known: Rows, i: int, after: int, *, quick: bool) -> bool:
    """Whether a request of the same shape came right behind an unanswered one, sooner than a master gives up."""
    if i < 0 or not quick:
        return False
    if known["status"][i] != Status.UNANSWERED or not _again(known, i, after):
        return False
    return bool(known["t_start"][after] - known["t_request"][i] < HASTE_NS)


def _answers_broadcast(known: Rows, i: int, *, quick: bool) -> bool:
    """Whether this is the answer of a device to the broadcast before, which reads like a request to that device."""
    if i == 0 or not quick:
        return False
    before, this = known[i - 1], known[i]
    same = all(before[name] == this[name] for name in ("function", "length", "port"))
    soon = this["t_start"] - before["t_request"] < HASTE_NS
    follows = before["unit"] == 0 and this["request"] == before["request"] + 1
    return bool(same and soon and follows and _echoes(int(this["function"])))


def _echoes(function: int) -> bool:
    return any(isinstance(relation, Echo) for relation in relations(function))


def _on(rule: Rule, transactions: Rows, *numbers: object) -> Findings:
    columns = (transactions[name] for name in ("request", "start", "length", "port", "t_start"))
    return rule.at(*columns, *numbers)


def _late(which: Rows, timed: NDArray[np.bool_]) -> Findings:
    behind = np.where(timed, (which["t_response"] - which["t_request"]) / 1e6, np.nan)
    columns = (which[name] for name in ("response", "response_start", "response_length", "port", "t_response"))
    return LATE.at(*columns, which["unit"], behind, which["request"])
